# SPDX-License-Identifier: Apache-2.0
"""Tables of commands lose no word in a terminal of any width."""

import io
import json
import re
import time

import numpy as np
import pytest
import turbopi
from PIL import Image
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from twinmill.report import show
from twinmill.report.tables import Cell
from twinmill.report.tables import Table as Shown
from twinmill.robots.fleet import Robot
from twinmill.terminal import Fitting, PlainConsole, progress_bar, progress_words
from twinmill_cli import main as cli
from twinmill_cli.swarm_screen import live_table, status_table

WIDTHS = [40, 48, 80, 200]


def printed(what, columns) -> str:
    console = Console(width=columns, file=io.StringIO())
    console.print(what)
    return console.file.getvalue()


@pytest.mark.parametrize("columns", WIDTHS)
def test_a_long_name_is_not_cut_for_the_sake_of_a_cell_that_can_wrap(columns):
    table = Table("picture", "pixels")
    table.add_row("a_rather_long_name.png", "31279 (before 32768), and some words more to wrap")
    told = printed(Fitting(table), columns)
    for word in ("a_rather_long_name.png", "31279", "32768"):
        assert word in told
    assert max(map(len, told.splitlines())) <= columns


def test_a_table_whose_first_column_need_not_wrap_wraps_it_before_it_stops_being_a_table():
    table = Table(box=None)
    table.add_column("", no_wrap=True)
    table.add_column("share", justify="right", no_wrap=True)
    table.add_row("a name of several words", "45 to 81 %")
    assert "45 to 81 %" in printed(Fitting(table), 40)
    narrow = printed(Fitting(table), 24)
    assert "45 to 81 %" in narrow and "share 45" not in narrow


@pytest.mark.parametrize("columns", [60, 70, 80])
def test_a_column_of_words_wraps_before_one_that_cannot_leaves_the_terminal(columns):
    table = Table(box=None)
    for name in ("certainty", "estimates"):
        table.add_column(name)
    table.add_row(
        "no more than noise is left over here", "one_name_of_many_words_without_a_gap_in_it"
    )
    told = printed(Fitting(table), columns)
    assert "one_name_of_many_words_without_a_gap_in_it" in told
    assert max(len(line.rstrip()) for line in told.splitlines()) <= columns


def test_a_list_that_is_too_wide_has_a_line_for_each_entry_and_the_caption_all_columns():
    """An estimate of which the name stands on one line and the number on the next reads badly."""
    entries = ["loss 0.82 ± 0.2", "from_s 20.2 ± 3 s", "until_s 28.8 ± 3 s"]
    for columns in (44, 80):
        table = Table(box=None, caption="A caption of words that fit no narrow table but these.")
        table.add_column("effect", no_wrap=True)
        table.add_column("estimates")
        table.add_row("transient_loss", ", ".join(entries))
        told = [line.strip() for line in printed(Fitting(table, listed=(1,)), columns).splitlines()]
        ends = [line.removeprefix("transient_loss").strip(" ,") for line in told]
        assert entries == ends[1:4] if columns == 44 else ", ".join(entries) in ends[1]
        assert any(line.startswith("A caption of words that fit no narrow") for line in told)


@pytest.mark.parametrize("columns", WIDTHS)
def test_progress_keeps_its_words_and_numbers(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    words = "running all again, seeds and models fresh"
    for made, numbers in (
        (progress_bar(), ["12345/67890", "left -:--:--"]),
        (progress_bar(counted=False), ["18%", "left -:--:--"]),
        (progress_words(), ["0:00:00"]),
    ):
        made.add_task(words, total=67890, completed=12345)
        shown = printed(made.get_renderable(), columns)
        assert [word for word in (*words.split(), *numbers) if word not in shown] == []
        assert max(map(len, shown.splitlines())) <= columns


@pytest.mark.parametrize(("columns", "lines"), [(0, 50), (1, 50), (2, 50), (80, 0)])
def test_what_must_be_told_is_told_in_no_columns_too(columns, lines, monkeypatch):
    """With COLUMNS=0 nothing at all was said, as by a shell that had not asked its terminal yet."""
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("LINES", str(lines))
    words = "NOT ALL STAND: R02 水"
    for what in (words, Text(words), Fitting(_of_one(words))):
        console = PlainConsole(file=io.StringIO(), force_terminal=True, color_system=None)
        with Live(console=console, auto_refresh=False) as live:
            live.update(what, refresh=True)
        shown = console.file.getvalue()
        assert "".join(words.split()) in "".join(shown.split())


def _of_one(words: str) -> Table:
    table = Table(box=None, show_header=False)
    table.add_row(words)
    return table


@pytest.mark.parametrize("columns", WIDTHS)
def test_the_state_of_robots_is_told_whole(columns):
    robot = Robot(7, telemetry=turbopi.telemetry_t(), run=turbopi.run_t())
    robot.telemetry.battery_V = 7.43
    robot.run.source, robot.run.version, robot.run.behavior = "robot", "0.1.0", "milling_cmaes"
    told = printed(status_table([robot]), columns)
    for word in ("R07", "0.1.0", "milling_cmaes", "7.43", "stopped"):
        assert word in told
    assert "…" not in told


def shown(robots, columns, lines) -> list[str]:
    """Lines of a terminal on which robots are looked at."""
    console = PlainConsole(file=io.StringIO(), width=columns, height=lines)
    console.print(live_table(robots))
    return console.file.getvalue().splitlines()


def robots_of(*ids, heard_s) -> list[Robot]:
    robots = [Robot(i, heard_s=heard_s, link_s=heard_s) for i in ids]
    for robot in robots:
        robot.telemetry, robot.link = turbopi.telemetry_t(), turbopi.link_t()
        robot.link.armed, robot.link.utime_us = 1, round(1e6 * time.time())
    return robots


@pytest.mark.parametrize(("columns", "lines"), [(40, 10), (80, 24), (200, 10)])
def test_who_has_no_line_left_is_told_of_and_trouble_is_shown_first(clock, columns, lines):
    """R77 was silent, and stood below the end of the terminal."""
    now_s = time.monotonic()
    robots = [*robots_of(*range(30), heard_s=now_s), *robots_of(77, heard_s=now_s - 60)]
    said = shown(robots, columns, lines)
    first = next(line for line in said if "R" in line)
    assert len(said) <= lines and "77" in first and "…" not in "".join(said)
    names = {name for line in said for name in re.findall(r"R\d\d", line)}
    assert said[-1] == f"and {len(robots) - len(names)} more: all stopped"
    assert len(shown(robots[:2], columns, lines)) <= lines


def test_of_several_kinds_that_have_no_line_left_each_is_told_by_name(clock):
    now_s = time.monotonic()
    robots = [*robots_of(1, 2, heard_s=now_s), *robots_of(77, heard_s=now_s - 60)]
    assert shown(robots, 200, 1) == ["and 3 more: R77 in trouble; R01, R02 stopped"]


@pytest.mark.parametrize("columns", WIDTHS)
def test_limits_of_colour_are_told_with_the_names_of_the_pictures(
    tmp_path, monkeypatch, capsys, columns
):
    y, x = np.mgrid[:120, :160]
    green = np.hypot(x - 80, y - 60)[..., None] < 30
    path = tmp_path / "a_picture_with_a_long_name.png"
    Image.fromarray(np.where(green, [60, 170, 70], [170, 165, 160]).astype(np.uint8)).save(path)
    monkeypatch.setenv("COLUMNS", str(columns))
    cli.run(["threshold", str(path)])
    told = capsys.readouterr().out
    cli.run(["threshold", str(path), "--json"])
    (row,) = json.loads(capsys.readouterr().out)["pictures"]
    for word in (path.name, str(row["ball_blob_px"]), str(row["false_px_before"])):
        assert word in told


@pytest.mark.parametrize(("columns", "has_bar"), [(60, True), (56, False)])
def test_a_bar_goes_before_a_row_of_numbers_becomes_running_text(columns, has_bar):
    """With the bar 58 characters, without it 53."""
    row = [Cell("acceleration_limit"), Cell("99.9 %", bar=1.0), Cell("1.00 ± 0.057"), Cell("s2/m")]
    made = show.table(Shown("Missing", ["effect", "probability", "value ± std", "unit"], [row]))
    (line,) = [own for own in printed(made, columns).splitlines() if "acceleration" in own]
    assert all(cell.text in line for cell in row) and ("█" in line) == has_bar
