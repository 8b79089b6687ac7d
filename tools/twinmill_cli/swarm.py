# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm arm`, `start`, `stop`, `select` and `status`."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import URL
from twinmill_cli.lazy import working
from twinmill_cli.options import Arm, KeyFile, LcmUrl, Prefix
from twinmill_cli.output import AsJson, deliver, print_object

if working():  # not for --help
    from rich import box
    from rich.console import Console, Group
    from rich.live import Live
    from rich.table import Table
    from rich.text import Text

    from twinmill.robots import tell
    from twinmill.robots.fleet import RUN_PERIOD_S, Fleet, Robot
    from twinmill.robots.key import load
    from twinmill.terminal import Fitting

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
    swarm.command("arm")(_arm)
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
    *,
    robots: Robots = "",
    behavior: Behavior = "",
    in_s: Annotated[
        float, typer.Option("--in-s", min=0.5, max=600, help="From now to the common start.")
    ] = 1.0,
    partial: Annotated[
        bool, typer.Option("--partial", help="Start though some refuse or do not answer.")
    ] = False,
    arm: Arm = False,
    untethered: Annotated[
        bool,
        typer.Option(
            "--untethered", help="Robots drive on without this command; it ends once they drive."
        ),
    ] = False,
    link_timeout_s: Annotated[
        float | None,
        typer.Option(
            min=0.2, max=600, help="Robots stop when they lose this command for so long; 2 s."
        ),
    ] = None,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Start all robots at one instant, or none, and hold them: Ctrl-C stops them.

    While this runs they hear that somebody is there; a robot that hears nothing
    for 2 s stops. The instant is one of the robots' own clocks: keep them set
    (NTP).

    Example: twinmill swarm start --behavior milling --in-s 3
    """
    if untethered and link_timeout_s is not None:
        raise ValueError("--untethered and --link-timeout-s: give one of them.")
    fleet = Fleet(lcm_url, channel_prefix, key=load(key))
    asked = tell.find(fleet, parse_robots(robots))
    refuse_doubles(fleet, asked)
    warn_of_clocks(fleet, asked)
    if arm:
        tell.arm(fleet, asked)
    timeout_ms = 0 if untethered else round(1e3 * link_timeout_s) if link_timeout_s else -1
    with ended_by_signals():
        begun = tell.start(
            fleet, asked, behavior, ahead_s=in_s, partial=partial, link_timeout_ms=timeout_ms
        )
        with stopped_if_it_fails(fleet, asked):
            ok = all(a.accepted and a.signed and a.mode != "stopped" for a in begun.answers)
            data = {"start_utime_us": begun.utime_us, "called_off": begun.called_off}
            words = _start_words(begun, ok, untethered)
            code = _finish("start", begun.answers, ok, words, data=data, as_json=as_json)
            if begun.called_off or untethered:
                return code
            return max(code, _hold(fleet, asked))


def _start_words(begun: tell.Start, ok: bool, untethered: bool) -> str:
    if begun.called_off:
        return (
            f"Called off: {_why(begun.answers)}. All were stopped, and must be armed before they "
            "start (--arm); --partial starts some."
        )
    at = datetime.fromtimestamp(begun.utime_us / 1e6).strftime("%H:%M:%S.%f")[:-3]
    words = f"Started at {at}." if ok else f"Started at {at}, but not all: see above."
    return f"{words} {'They drive on by themselves.' if untethered else 'Ctrl-C stops them.'}"


@contextmanager
def stopped_if_it_fails(fleet: Fleet, robots: set[int]) -> Iterator[None]:
    """Whatever ends the command once robots drive, a full disk below its output too, stops them."""
    try:
        yield
    except BaseException as error:
        given = tell.stop(fleet, robots)
        print(f"twinmill: {_stop_words(given, 10)}", file=sys.stderr)
        if not isinstance(error, KeyboardInterrupt):
            raise
        raise typer.Exit(0 if _all_stand(given) else 1) from error


def _hold(fleet: Fleet, robots: set[int]) -> int:
    """Robots hear that somebody is there, until Ctrl-C or until all stand by themselves."""
    held = [fleet.robots[i] for i in sorted(robots) if i in fleet.robots]
    console = Console(stderr=True)
    with (
        Live(console=console, refresh_per_second=4)
        if console.is_terminal
        else nullcontext(None) as live
    ):
        while not all(robot.mode == "stopped" for robot in held):
            fleet.listen(0.25)
            if live:
                live.update(status_table(held))
    words = "All stand: stopped by another command, by their button, or a script is over."
    print(f"twinmill: {words}", file=sys.stderr)
    return 0


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """SIGTERM and a lost terminal end as Ctrl-C does. What kills, robots notice by themselves."""
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.default_int_handler) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def _arm(
    *,
    robots: Robots = "",
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Let robots be started again that were stopped by a command. Nothing moves yet.

    Example: twinmill swarm arm
    """
    fleet = Fleet(lcm_url, channel_prefix, key=load(key))
    asked = tell.find(fleet, parse_robots(robots))
    refuse_doubles(fleet, asked)
    given = tell.arm(fleet, asked)
    ok = all(answer.accepted and answer.signed for answer in given)
    words = "All are armed." if ok else "Not all are armed: see above."
    return _finish("arm", given, ok, words, data={}, as_json=as_json)


def _stop(
    *,
    robots: Robots = "",
    timeout_s: Annotated[float, typer.Option("--timeout-s", min=0.5, help="Give up after.")] = 10.0,
    host: Annotated[
        list[str] | None,
        typer.Option(
            "--host",
            metavar="HOST",
            help="Tell this machine, too, though it was never heard: where multicast does not "
            "pass. Repeatable.",
        ),
    ] = None,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Stop robots: said again until each has signed that it stands.

    They start again only after `twinmill swarm arm`, or by their button.

    Example: twinmill swarm stop
    """
    asked = parse_robots(robots)
    operator_key, fault = _key_if_there(key)
    with saying_nothing() as say:
        fleet = Fleet(lcm_url, channel_prefix, key=operator_key)
        given = tell.stop(
            fleet,
            asked,
            timeout_s,
            host or (),
            waiting=lambda left: say(_waiting_words(left, timeout_s)),
        )
    _tell_fault(fault)
    words = _stop_words(given, timeout_s)
    return _finish("stop", given, _all_stand(given), words, data={}, as_json=as_json)


@contextmanager
def saying_nothing() -> Iterator[Callable[[str], None]]:
    """No library's message keeps a stop waiting, as on a full pipe or after Ctrl-S.

    Gives a function that says a sentence where there is room for it, and else says nothing.
    """
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)

    def say(sentence: str) -> None:
        with suppress(OSError):
            if select.select([], [kept], [], 0)[1]:
                os.write(kept, f"twinmill: {sentence}\n".encode())

    try:
        yield say
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _key_if_there(path: Path | None) -> tuple[bytes | None, str]:
    """The key, or why there is none: then a stop is said all the same, and nobody is believed."""
    try:
        return load(path), ""
    except (ValueError, OSError) as error:
        return None, str(error)


def _tell_fault(fault: str) -> None:
    if fault:
        print(f"twinmill: {fault}", file=sys.stderr)


def _all_stand(given: list[tell.Answer]) -> bool:
    return bool(given) and not _moving(given)


def _moving(given: list[tell.Answer]) -> list[tell.Answer]:
    """Robots that have not signed that they stand, or of which there are two."""
    return [a for a in given if not (a.accepted and a.signed and a.stands) or a.is_double]


def _waiting_words(left: set[int], timeout_s: float) -> str:
    """What a stop waits for."""
    names = ", ".join(f"R{i:02d}" for i in sorted(left))
    whom = f"{names} to sign that they stand" if names else "a robot to be heard"
    return f"stop is said all the time; waiting up to {timeout_s:g} s for {whom}."


def _stop_words(given: list[tell.Answer], timeout_s: float) -> str:
    """Which robots must be stopped by hand."""
    if not given:
        return f"No robot was heard in {timeout_s:g} s; stop was said all the time."
    names = ", ".join(f"R{a.robot_id:02d}" for a in _moving(given))
    if not names:
        return "All stand."
    return f"NOT ALL STAND: {names}: no stop was confirmed. SWITCH OFF BY HAND what still drives."


def _select(
    behavior: Annotated[str, typer.Argument(metavar="BEHAVIOR", help="As milling.")],
    *,
    robots: Robots = "",
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Choose what robots do; those that run change at once.

    Example: twinmill swarm select diffusing --robots 1,2
    """
    fleet = Fleet(lcm_url, channel_prefix, key=load(key))
    asked = tell.find(fleet, parse_robots(robots))
    command = tell.make_command(tell.VERBS.VERB_SELECT, behavior)
    given = tell.tell(fleet, command, asked, until_s=time.monotonic() + 5)
    ok = all(answer.accepted and answer.signed for answer in given)
    words = f"All chose {behavior}." if ok else f"Not all did{_hint(given)}."
    return _finish("select", given, ok, words, data={}, as_json=as_json)


def refuse_doubles(fleet: Fleet, robots: set[int]) -> None:
    """Raises ValueError if two robots have one number: a command would reach either or both."""
    for robot_id in sorted(robots & set(fleet.robots)):
        robot = fleet.robots[robot_id]
        if robot.is_double:
            raise ValueError(
                f"two robots say that they are number {robot_id} "
                f"({', '.join(robot.senders.hosts)}): give one another, `twinmill flash HOST=ID`."
            )


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
    verb: str, given: list[tell.Answer], ok: bool, words: str, *, data: dict, as_json: bool
) -> int:
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("robot", "acknowledged", "now"):
        table.add_column(column)
    for answer in given:
        ok = answer.accepted and answer.signed
        said = Text("yes", "green") if ok else Text(f"no: {answer.reason}", "red")
        now = Text("; ".join([answer.mode or "?", *answer.alarms]), "red" if answer.alarms else "")
        table.add_row(f"R{answer.robot_id:02d}", said, now)
    data = {"verb": verb, "ok": ok, **data, "robots": [a.to_json() for a in given]}
    deliver(data, Group(*([Fitting(table)] if given else []), words), as_json)
    return 0 if ok else 1


def _status(
    *,
    once: Annotated[bool, typer.Option("--once", help="Print one table and end.")] = False,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Show who is there and how they are, until Ctrl-C.

    Example: twinmill swarm status
    """
    operator_key, fault = _key_if_there(key)
    _tell_fault(fault)
    fleet = Fleet(lcm_url, channel_prefix, key=operator_key)
    if once or as_json or not sys.stdout.isatty():
        fleet.listen(1.0)
        fleet.listen(RUN_PERIOD_S - 1, lambda: all(r.run for r in fleet.robots.values()))
        robots = [fleet.robots[i] for i in sorted(fleet.robots)]
        if as_json:
            print_object({"robots": [r.to_json() for r in robots]})
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


def status_table(robots: list[Robot]) -> Fitting | Text:
    """One row a robot."""
    if not robots:
        return Text("No robot is heard.")
    table = Table(box=None, padding=(0, 1, 0, 0))
    for column in ("robot", "source", "version", "behaviour", "mode", "battery", "camera"):
        table.add_column(column, no_wrap=True)
    for column in ("sees", "clock", "silent"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("link", no_wrap=True)
    table.add_column("alarms")
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
            _link(robot),
            Text("; ".join(robot.alarms), "bold red"),
        )
    return Fitting(table)


def _link(robot: Robot) -> Text:
    """What it has signed of how it may be commanded."""
    if not robot.link:
        return Text("not signed", "red")
    if not robot.is_armed:
        return Text("stopped: arm it", "yellow")
    return Text({None: "armed", True: "held", False: "untethered"}[robot.is_tethered])


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
