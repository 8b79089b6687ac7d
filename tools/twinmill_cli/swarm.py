# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm start`, `stop`, `select` and `status`."""

import json
import sys
import time
from datetime import datetime
from typing import Annotated

import typer
from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from twinmill.files import plain
from twinmill.robots import tell
from twinmill.robots.fleet import RUN_PERIOD_S, URL, Fleet, Robot
from twinmill_cli.options import LcmUrl, Prefix
from twinmill_cli.output import AsJson, deliver

CLOCK_WARN_S = 0.05

Robots = Annotated[
    str,
    typer.Option(
        "--robots", metavar="IDS", help="Only these, as 1,2,5; without, all that are there."
    ),
]
Behavior = Annotated[str, typer.Option("--behavior", "-b", help="Select it first.")]


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    swarm = typer.Typer(
        help="Start, stop and watch the robots on the network, or those of twin_run.",
        no_args_is_help=True,
    )
    swarm.command("start")(_start)
    swarm.command("stop")(_stop)
    swarm.command("select")(_select)
    swarm.command("status")(_status)
    app.add_typer(swarm, name="swarm")


def parse_robots(text: str) -> set[int]:
    """Robots as a user writes them.

    Raises:
        ValueError: it is no list of numbers in 0..99.
    """
    try:
        robots = {int(word) for word in text.split(",")} if text else set()
    except ValueError:
        robots = {-1}
    if not robots <= set(range(100)):
        raise ValueError(f"--robots {text}: must be numbers in 0..99 with commas, as 1,2,5.")
    return robots


def _start(
    robots: Robots = "",
    behavior: Behavior = "",
    in_s: Annotated[
        float, typer.Option("--in-s", min=0.5, max=600, help="From now to the common start.")
    ] = 1.0,
    partial: Annotated[
        bool, typer.Option("--partial", help="Start though some refuse or do not answer.")
    ] = False,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Arm robots, and start all of them at one instant, or none.

    The instant is one of the robots' own clocks: keep them set (NTP).

    Example: twinmill swarm start --behavior milling --in-s 3
    """
    fleet = Fleet(lcm_url, channel_prefix)
    asked = tell.find(fleet, parse_robots(robots))
    warn_of_clocks(fleet, asked)
    begun = tell.start(fleet, asked, behavior, in_s, partial)
    ok = all(answer.accepted and answer.mode != "stopped" for answer in begun.answers)
    if begun.called_off:
        words = f"Called off: {_why(begun.answers)}. All were stopped; --partial starts some."
    else:
        at = datetime.fromtimestamp(begun.utime_us / 1e6).strftime("%H:%M:%S.%f")[:-3]
        words = f"Started at {at}." if ok else f"Started at {at}, but not all: see above."
    data = {"start_utime_us": begun.utime_us, "called_off": begun.called_off}
    return _finish("start", begun.answers, ok, words, data, as_json)


def _stop(
    robots: Robots = "",
    timeout_s: Annotated[float, typer.Option("--timeout-s", min=0.5, help="Give up after.")] = 10.0,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Stop robots: said again until each has acknowledged and stands.

    Example: twinmill swarm stop
    """
    given = tell.stop(Fleet(lcm_url, channel_prefix), parse_robots(robots), timeout_s)
    ok = bool(given) and all(a.accepted and a.mode in ("", "stopped") for a in given)
    words = "All stand." if ok else "NOT ALL STAND: switch off by hand what still drives."
    if not given:
        words = f"No robot was heard in {timeout_s:g} s; stop was said all the time."
    return _finish("stop", given, ok, words, {}, as_json)


def _select(
    behavior: Annotated[str, typer.Argument(metavar="BEHAVIOR", help="As milling.")],
    robots: Robots = "",
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Choose what robots do; those that run change at once.

    Example: twinmill swarm select diffusing --robots 1,2
    """
    fleet = Fleet(lcm_url, channel_prefix)
    asked = tell.find(fleet, parse_robots(robots))
    command = tell.make_command(tell.VERBS.VERB_SELECT, behavior)
    given = tell.tell(fleet, command, asked, time.monotonic() + 5)
    ok = all(answer.accepted for answer in given)
    words = f"All chose {behavior}." if ok else f"Not all did{_hint(given)}."
    return _finish("select", given, ok, words, {}, as_json)


def warn_of_clocks(fleet: Fleet, robots: set[int]) -> None:
    """Says on stderr which robots' clocks would make the start no common one."""
    for robot_id in sorted(robots & set(fleet.robots)):
        clock_s = fleet.robots[robot_id].clock_s
        if abs(clock_s) > CLOCK_WARN_S:
            print(
                f"twinmill: robot {robot_id}: its clock is {clock_s:+.2f} s from this one, and so "
                "will be its start; set it (NTP).",
                file=sys.stderr,
            )


def _why(given: list[tell.Answer]) -> str:
    """Why not all start."""
    refused = [answer for answer in given if answer.accepted is False]
    words = f"{len(refused)} of {len(given)} refused" if refused else "not all acknowledged in time"
    return words + _hint(given)


def _hint(given: list[tell.Answer]) -> str:
    unknown = any(answer.reason.startswith("no behaviour") for answer in given)
    return "; `twinmill flash --behaviors FILE` brings tables to robots" if unknown else ""


def _finish(
    verb: str, given: list[tell.Answer], ok: bool, words: str, data: dict, as_json: bool
) -> int:
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("robot", "acknowledged", "now"):
        table.add_column(column)
    for answer in given:
        said = Text("yes", "green") if answer.accepted else Text(f"no: {answer.reason}", "red")
        table.add_row(f"R{answer.robot_id:02d}", said, answer.mode or "?")
    data = {"verb": verb, "ok": ok, **data, "robots": [a.to_json() for a in given]}
    deliver(data, Group(*([table] if given else []), words), as_json)
    return 0 if ok else 1


def _status(
    once: Annotated[bool, typer.Option("--once", help="Print one table and end.")] = False,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Show who is there and how they are, until Ctrl-C.

    Example: twinmill swarm status
    """
    fleet = Fleet(lcm_url, channel_prefix)
    if once or as_json or not sys.stdout.isatty():
        fleet.listen(1.0)
        fleet.listen(RUN_PERIOD_S - 1, lambda: all(r.run for r in fleet.robots.values()))
        robots = [fleet.robots[i] for i in sorted(fleet.robots)]
        if as_json:
            print(json.dumps(plain({"robots": [r.to_json() for r in robots]})))
        else:
            Console().print(status_table(robots))
        return 0 if robots else 1
    try:
        with Live(console=Console(), refresh_per_second=4) as live:
            while True:
                fleet.listen(0.25)
                live.update(status_table([fleet.robots[i] for i in sorted(fleet.robots)]))
    except KeyboardInterrupt:
        return 0


def status_table(robots: list[Robot]) -> Table | Text:
    """One row a robot."""
    if not robots:
        return Text("No robot is heard.")
    table = Table(box=None, padding=(0, 1, 0, 0))
    for column in ("robot", "source", "version", "behaviour", "mode", "battery", "camera"):
        table.add_column(column, no_wrap=True)
    for column in ("sees", "clock", "silent"):
        table.add_column(column, justify="right", no_wrap=True)
    for robot in robots:
        run, t = robot.run, robot.telemetry
        silent_s = time.monotonic() - robot.heard_s
        table.add_row(
            f"R{robot.robot_id:02d}",
            *((run.source, run.version, run.behavior) if run else ("?", "?", "?")),
            Text(robot.mode or "?", {"fault": "red", "running": "green"}.get(robot.mode, "")),
            _battery(t),
            Text(robot.camera, "red" if robot.camera in ("lost", "no frames") else ""),
            _sees(robot),
            Text(
                f"{round(robot.clock_s, 2) + 0:+.2f} s",
                "red" if abs(robot.clock_s) > CLOCK_WARN_S else "",
            ),
            Text(f"{silent_s:.1f} s", "" if robot.is_here else "red"),
        )
    return table


def _battery(telemetry) -> Text:
    if telemetry is None or telemetry.battery_V != telemetry.battery_V:
        return Text("?")
    low = telemetry.status_flags & telemetry.STATUS_BATTERY_LOW
    return Text(f"{telemetry.battery_V:.2f} V{' LOW' if low else ''}", "red" if low else "")


def _sees(robot: Robot) -> Text:
    if not robot.recent:
        return Text("?")
    mark = "● " if robot.telemetry.detected else "○ "
    return Text(f"{mark}{100 * robot.detected_frac:.0f} %")
