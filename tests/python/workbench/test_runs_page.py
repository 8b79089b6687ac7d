# SPDX-License-Identifier: Apache-2.0
"""The page of two runs: both over one time, one cursor, and what changed is marked."""

import re

import pytest

from twinmill.data.measurement import load_measurements
from twinmill.model.model_file import ModelFile
from twinmill.report import Provenance, write_report
from twinmill.report.runs import section
from twinmill.runs.compare import compare_runs


@pytest.fixture(scope="module")
def report(same_robot, tmp_path_factory):
    model = ModelFile.load(str(same_robot["first"].parent / "model.toml"))
    runs = [load_measurements([same_robot[name]], model.model)[0] for name in ("first", "weak")]
    source = Provenance("twinmill robot compare", "twinmill 0.1.0", "")
    folder = tmp_path_factory.mktemp("runs")
    drawn = section(compare_runs(*runs, model))
    return write_report(folder, "Two runs", source, [drawn], note="")


def test_one_cursor_goes_through_both_runs(report, page):
    page.goto(report.as_uri())
    box = page.locator("#runs canvas").bounding_box()

    def second() -> float:
        return float(re.match(r"[-\d.]+", page.locator("#runs .now").inner_text())[0])

    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 60)
    middle = second()
    curves = page.evaluate("RUNS.panels[0].curves.map((c) => [c.t[0], c.t.at(-1)])")
    assert max(start for start, _ in curves) < 0.5  # a common start
    assert middle == pytest.approx(max(end for _, end in curves) / 2, rel=0.1)
    page.locator("#runs").focus()
    page.keyboard.press("ArrowRight")
    assert second() > middle


def test_what_changed_is_marked_in_the_run(report, page):
    page.goto(report.as_uri())
    marks, end_s = page.evaluate("[RUNS.marks, RUNS.panels[0].curves[1].t.at(-1)]")
    assert marks and all(-0.5 <= a < b <= end_s + 1 for a, b in marks)
    assert sum(b - a for a, b in marks) < 0.7 * end_s  # half of the evidence, in less of the time
