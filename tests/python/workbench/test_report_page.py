# SPDX-License-Identifier: Apache-2.0
"""A report opened from its file, without a server, has the workbench's charts."""

import re

import pytest
from playwright.sync_api import expect

from twinmill.data.measurement import load_measurements
from twinmill.fitting.compare import compare
from twinmill.model.model_file import ModelFile
from twinmill.report import Provenance, write_report
from twinmill.report.charted import charts
from twinmill.report.sections import comparison_section

SOURCE = Provenance("twinmill compare run.lcmlog", "twinmill 0.1.0", "ab" * 32)
LARGEST_BYTES, ROBOTS, LONG_S = 10e6, 20, 150.0  # what a report must bear
DRIVEN_S = 45.0


@pytest.fixture(scope="module")
def result(brief_coasting_robot):
    model = ModelFile.load(str(brief_coasting_robot.model))
    return compare(load_measurements([brief_coasting_robot.log]), model)


@pytest.fixture(scope="module")
def report(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return write_report(folder, "A report", SOURCE, [comparison_section(result)])


def test_its_numbers_are_those_of_compare(report, result, page):
    page.goto(report.as_uri())
    page.wait_for_function("document.body.dataset.predicted !== undefined")
    drawn = page.evaluate("Array.from(twinmill.prediction.arrays.errors.data)")
    error_m = (result.worst.errors[:, 2, :2] ** 2).sum(axis=1) ** 0.5  # half a second ahead
    assert drawn[1::5] == pytest.approx(error_m.tolist(), abs=1e-4, nan_ok=True)


def test_cursor_zoom_and_worst_moments_are_at_hand(report, result, page):
    page.goto(report.as_uri())
    page.wait_for_function("document.body.dataset.predicted !== undefined")
    first, last = page.evaluate("twinmill.span")
    box = page.locator("#series").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.wait_for_function(f"twinmill.t > {first + 0.3 * (last - first)}")
    page.keyboard.press("+")
    page.wait_for_function(f"twinmill.span[1] - twinmill.span[0] < {0.9 * (last - first)}")
    page.keyboard.down("Control")
    page.mouse.wheel(0, 2000)
    page.keyboard.up("Control")
    page.wait_for_function(f"twinmill.span[1] - twinmill.span[0] > {1.1 * (last - first)}")
    worst = result.worst.where[0]
    page.locator("#where").select_option(index=1)
    expect(page.locator("#marks")).to_contain_text(f"{worst.group}: {worst.regime}")
    assert page.evaluate("twinmill.marks.length") >= worst.windows


def test_the_page_scrolls_though_the_pointer_is_over_the_charts(report, page):
    page.goto(report.as_uri())
    page.wait_for_function("document.body.dataset.predicted !== undefined")
    span = page.evaluate("twinmill.span")
    page.locator("#series").hover()
    page.mouse.wheel(0, 300)
    page.wait_for_function("window.scrollY > 0")
    assert page.evaluate("twinmill.span") == span


def test_many_robots_and_long_logs_are_small_enough(result):
    """As of a fit: two models are drawn, and all data come for each robot."""
    page = charts(result, [("before", r.model) for r in result.robots])()
    data = sum(map(len, re.findall(r'<script type="text/plain".*?</script>', page)))
    assert data * ROBOTS * LONG_S / DRIVEN_S + len(page) - data < LARGEST_BYTES
