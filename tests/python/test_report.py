# SPDX-License-Identifier: Apache-2.0
import io
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

import twinmill as tm
from twinmill.data.measurement import load_measurements
from twinmill.fitting.compare import Comparison, compare
from twinmill.model.model_file import ModelFile
from twinmill.report import Provenance, Section, show, write_report
from twinmill.report.sections import comparison_section
from twinmill.report.tables import _clocks, _date

SOURCE = Provenance("twinmill compare run.lcmlog", "twinmill 0.1.0", "ab" * 32)


class Page(HTMLParser):
    """Resources that a browser would fetch, and the text of the page."""

    def __init__(self, text):
        super().__init__()
        self.fetched, self.tags, self.text = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.fetched += [
            value
            for key, value in attrs
            if key in ("src", "href", "xlink:href", "srcset", "data", "action")
        ]

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def section(coasting_robot):
    return comparison_section(
        compare(load_measurements([coasting_robot.log]), ModelFile.load(str(coasting_robot.model)))
    )


def test_report_fetches_nothing(section, tmp_path):
    text = write_report(tmp_path / "new" / "folder", "A report", SOURCE, [section]).read_text()
    page = Page(text)
    assert all(target.startswith("#") for target in page.fetched)
    assert not {"link", "iframe", "object"} & set(page.tags)
    assert "@import" not in text and "url(http" not in text


def test_same_comparison_gives_the_same_bytes(coasting_robot, tmp_path):
    pages = []
    for name in ("a", "b"):
        result = compare(
            load_measurements([coasting_robot.log]), ModelFile.load(str(coasting_robot.model))
        )
        page = write_report(tmp_path / name, "A report", SOURCE, [comparison_section(result)])
        pages.append(page.read_bytes())
    assert pages[0] == pages[1]


def test_report_says_where_it_comes_from(section, tmp_path):
    text = Page(write_report(tmp_path, "A report", SOURCE, [section]).read_text()).text
    assert all(
        part in text
        for part in (
            SOURCE.command,
            SOURCE.version,
            SOURCE.model_sha256[:16],
            "run.lcmlog",
            "model.toml",
            section.verdict,
        )
    )


def test_every_figure_is_well_formed_and_explained(section):
    assert len(section.figures) == 3
    for figure in section.figures:
        assert ET.fromstring(figure.svg).tag.endswith("svg")
        assert len(figure.caption.split()) > 15


def test_the_robot_is_shown_that_something_was_added_to_or_that_is_missed_most():
    robots = [
        SimpleNamespace(robot_id=i, score=score, size=9)
        for i, score in ((1, 1.0), (2, 3.0), (3, 2.0))
    ]
    of_all, of_one = (Comparison("m.toml", robots, [], about=about) for about in (None, 3))
    assert (of_all.shown.robot_id, of_one.shown.robot_id, of_one.worst.robot_id) == (2, 3, 2)


def test_names_from_a_log_are_text_and_not_markup(section, tmp_path):
    hostile = "<script>alert(1)</script>"
    told = Section(hostile, section.score, hostile, [("log", hostile)], warnings=[hostile])
    page = Page(write_report(tmp_path, hostile, SOURCE, [told, told]).read_text())
    assert "script" not in page.tags and hostile in page.text


@pytest.mark.parametrize("columns", [40, 48, 80])
def test_no_word_of_a_table_is_lost_in_a_narrow_terminal(section, columns):
    for table in section.tables:
        console = Console(width=columns, file=io.StringIO())
        console.print(show.table(table))
        words = {word.strip(";") for word in console.file.getvalue().split()}
        told = {word for row in table.rows for cell in row for word in cell.text.split()}
        heads = {word for column in table.columns for word in column.split()}
        assert told | heads <= words
        assert max(map(len, console.file.getvalue().splitlines())) <= columns


def noise_told(sensor_m, model_text, tmp_path):
    """Noise of arcs by a table and by algebra, each place `sensor_m` off."""
    period_s, rng = 0.02, np.random.default_rng(1)
    commands_t_s = np.arange(0, 40, 2.0)
    commands = np.column_stack(
        [rng.uniform(0.05, 0.3, 20), np.zeros(20), rng.choice([-0.8, 0, 0.5], 20)]
    )
    t_s = np.arange(0, 40, period_s)
    v, w = np.repeat(commands, round(2 / period_s), axis=0)[:-1, ::2].T
    theta_rad = np.concatenate([[0], np.cumsum(w * period_s)])
    chord_m = v * period_s * np.sinc(w * period_s / 2 / np.pi)
    towards = np.exp(1j * (theta_rad[:-1] + w * period_s / 2))
    place = np.concatenate([[0], np.cumsum(chord_m * towards)])
    pose = np.column_stack([place.real, place.imag, theta_rad])
    pose[:, :2] += sensor_m * rng.normal(size=(len(pose), 2))
    text = model_text("m", motor_lag_s=0).replace('"duty"', '"twist"')
    text = text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
    (tmp_path / "m.toml").write_text(text)
    log = tm.Log.from_arrays(t_s, pose, commands_t_s, commands, kind="twist", same_clock=True)
    table = str(tm.compare(log, tmp_path / "m.toml"))
    told = re.search(r"^ *noise +(.*?)^ *[a-z ]*floor ", table, re.S | re.M)[1]
    return " ".join(told.split())


def test_a_log_without_noise_is_said_to_have_none(model_text, tmp_path):
    """Motion by algebra has no noise but that of rounding, and that is none; 0.3 mm are told."""
    assert noise_told(0, model_text, tmp_path) == "none found"
    told = re.match(r"poses ([0-9.]+) mm", noise_told(3e-4, model_text, tmp_path))
    assert float(told[1]) == pytest.approx(0.3, rel=0.1)


def test_errors_of_a_wrong_model_are_not_white(section):
    """The model given lacks the robot's coasting."""
    assert dict(section.facts)["residuals"].startswith("not white")


def test_a_simulated_log_has_no_date():
    """The twin starts all its logs at one instant."""
    (run,) = tm.simulate(n=1, duration_s=12).measurements()
    assert _date(run) == "simulated"


@pytest.mark.parametrize(
    ("offset_s", "said"), [(0.151, "151 ms later than"), (-0.02, "20.0 ms earlier than")]
)
def test_the_clocks_offset_says_which_stamp_is_later(offset_s, said):
    """docs/conventions.md: t_capture = t_robot + offset."""
    robot = SimpleNamespace(measurement=SimpleNamespace(same_clock=False), time_offset_s=offset_s)
    assert said in _clocks(robot)
