# SPDX-License-Identifier: Apache-2.0
"""Tables of robots: what each answered, and how each is."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from twinmill.robots.fleet import GONE_S, Robot
from twinmill.robots.tell import CLOCK_WARN_S, Answer
from twinmill.terminal import AsManyAsFit, Fitting


def countdown(robots: set[int], ahead_s: float, ends: str) -> str:
    """Line of a start that is ahead: who, when by this computer's clock, and what ends it.

    Args:
        robots: that may obey it; none where all that are heard have another key.
        ahead_s: from now to the start.
        ends: words on what does.
    """
    names = ", ".join(f"R{i:02d}" for i in sorted(robots))
    who = f"{names}: to" if robots else "No robot that is heard obeys the"
    at = time.strftime("%H:%M:%S", time.localtime(time.time() + ahead_s))
    return f"{who} start at {at}. {ends}."


def answer_table(given: list[Answer]) -> Fitting:
    """One row a robot: what it answered to a command."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False)
    is_start = any(answer.link_timeout_s is not None for answer in given)
    for column in ("robot", "acknowledged", "now", *(["link"] if is_start else [])):
        table.add_column(column)
    for answer in given:
        obeyed = answer.accepted and answer.signed
        said = Text("yes", "green") if obeyed else Text(f"no: {answer.reason}", "red")
        gone = answer.last_heard_s is not None and answer.last_heard_s > GONE_S
        mode = f"not heard for {answer.last_heard_s:.0f} s" if gone else answer.mode or "?"
        now = Text("; ".join([mode, *answer.alarms]), "red" if gone or answer.alarms else "")
        table.add_row(f"R{answer.robot_id:02d}", said, now, *([_kept(answer)] if is_start else []))
    return Fitting(table)


def _kept(answer: Answer) -> Text:
    """For how long it drives on without its operator, as it has signed; of one that stands none."""
    if answer.link_timeout_s is None:
        return Text("" if answer.stands else "?")
    return Text("untethered" if answer.untethered else f"{answer.link_timeout_s:g} s")


def status_table(robots: list[Robot], *, has_key: bool = True) -> Fitting | Text:
    """One row a robot: how it is.

    Args:
        robots: to be shown.
        has_key: what they sign could be checked.
    """
    return _table([_row(robot, has_key) for robot in robots])


def live_table(robots: list[Robot], *, has_key: bool = True) -> AsManyAsFit:
    """Robots that are looked at, those in trouble first; the last line tells of whom has no room.

    All is asked of the robots at once: another thread may draw.

    Args:
        robots: to be shown.
        has_key: as of `status_table`.
    """
    known = [(robot.mode or "?", _row(robot, has_key)) for robot in robots]
    known.sort(key=lambda of_one: not _is_troubled(of_one[1]))
    rows = [row for _, row in known]
    words = [(str(row[0]), "in trouble" if _is_troubled(row) else mode) for mode, row in known]

    def of_first(shown: int) -> RenderableType:
        if shown == len(rows):
            return _table(rows)
        rest = Text(_of_others(words[shown:]), "bold")
        return Group(_table(rows[:shown]), rest) if shown else rest

    return AsManyAsFit(len(rows), of_first)


def _of_others(words: list[tuple[str, str]]) -> str:
    """Line on robots that have no room, by their names and how they are."""
    by: dict[str, list[str]] = {}
    for name, how in words:
        by.setdefault(how, []).append(name)
    each = "; ".join(f"{', '.join(names)} {how}" for how, names in by.items())
    return f"and {len(words)} more: {f'all {next(iter(by))}' if len(by) == 1 else each}"


def _is_troubled(row: Sequence[Text]) -> bool:
    """Something of it is shown red."""
    return any("red" in str(cell.style) for cell in row if cell)


def _table(rows: list[list[Text]]) -> Fitting | Text:
    if not rows:
        return Text("No robot is heard.")
    table = Table(box=None, padding=(0, 1, 0, 0))
    for column in ("robot", "source", "version", "behaviour", "mode", "battery", "camera"):
        table.add_column(column, no_wrap=True)
    for column in ("sees", "clock", "silent"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("link", no_wrap=True)
    table.add_column("alarms")
    for row in rows:
        table.add_row(*row)
    return Fitting(table)


def _row(robot: Robot, has_key: bool) -> list[Text]:
    run, alarms = robot.run, filter(None, [*robot.alarms, _late(robot), robot.may_drive])
    silent_s = time.monotonic() - robot.heard_s
    return [
        Text(f"R{robot.robot_id:02d}"),
        *map(Text, (robot.source, run.version, run.behavior) if run else ("?", "?", "?")),
        _mode(robot),
        _battery(robot.telemetry),
        Text(robot.camera, "red" if robot.camera in ("lost", "no frames") else ""),
        _sees(robot),
        _clock(robot),
        Text(f"{silent_s:.1f} s", "" if robot.is_here else "red"),
        _link(robot) if has_key else Text("not checked: no key"),
        Text("; ".join(alarms), "bold red"),
    ]


def _mode(robot: Robot) -> Text:
    """Its mode of now, or, of one that fell silent, of then."""
    if not robot.is_here and robot.last_mode and not robot.is_old_news:
        return Text(f"was {robot.last_mode}", "red")
    return Text(robot.mode or "?", {"fault": "red", "running": "green"}.get(robot.mode, ""))


def _clock(robot: Robot) -> Text:
    """How far it is ahead, a question mark where that may be the network's delay."""
    if robot.late_s > CLOCK_WARN_S and not robot.has_answered and not robot.is_old_news:
        return Text(f"{-robot.late_s:+.2f} s?", "red")
    is_odd = abs(robot.clock_s) > CLOCK_WARN_S
    return Text(f"{round(robot.clock_s, 2) + 0:+.2f} s", "red" if is_odd else "")


def _late(robot: Robot) -> str:
    is_late = robot.late_s > CLOCK_WARN_S and robot.has_answered and not robot.is_old_news
    return f"network {robot.late_s:.2f} s late" if is_late else ""


def _link(robot: Robot) -> Text:
    """Signed statement of how the robot may be commanded."""
    if not robot.link:
        return Text("not signed", "red")
    if robot.is_old_news:
        return Text("signs no more" if robot.signs_no_more else "old news", "red")
    if not robot.is_here:
        return Text("not heard", "red")
    if not robot.is_armed:
        return Text("stopped: arm it", "yellow")
    if robot.is_held is False:
        return Text(f"no operator heard ({robot.link.link_timeout_ms / 1e3:g} s)", "red")
    return Text({None: "armed", True: "held", False: "untethered"}[robot.is_tethered])


def _battery(telemetry: Any) -> Text:
    if telemetry is None or telemetry.battery_V != telemetry.battery_V:
        return Text("?")
    low = telemetry.status_flags & telemetry.STATUS_BATTERY_LOW
    return Text(f"{telemetry.battery_V:.2f} V{' LOW' if low else ''}", "red" if low else "")


def _sees(robot: Robot) -> Text:
    if not robot.recent:
        return Text("?")
    mark = "● " if robot.telemetry.detected else "○ "
    return Text(f"{mark}{100 * robot.detected_frac:.0f} %")
