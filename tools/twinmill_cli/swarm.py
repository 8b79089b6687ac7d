# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm arm`, `start`, `stop`, `select` and `status`."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import URL
from twinmill_cli.lazy import working
from twinmill_cli.options import Arm, KeyFile, LcmUrl, Prefix
from twinmill_cli.output import AsJson, decide, deliver, print_object, say

if working():  # not for --help
    from rich.console import Group
    from rich.live import Live

    from twinmill.robots import tell
    from twinmill.robots.fleet import RUN_PERIOD_S, Fleet
    from twinmill.robots.hold import Held
    from twinmill.robots.key import load, load_or_make
    from twinmill.terminal import PlainConsole
    from twinmill_cli.swarm_screen import answer_table, status_table
    from twinmill_cli.swarm_verdict import (
        DRIVING,
        Verdict,
        of_arm,
        of_busy,
        of_clocks,
        of_end,
        of_select,
        of_start,
        of_stop,
    )
    from twinmill_cli.voice import Voice

# All by which a terminal, a shell or a session that ends asks a program to end or to pause.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP)

Robots = Annotated[
    str | None,
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


def parse_robots(text: str | None) -> set[int]:
    """Robots as a user writes them; none where nothing was written, which means all.

    Raises:
        typer.BadParameter: it is no list of numbers in 0..99.
    """
    try:
        robots = set() if text is None else {int(word) for word in text.split(",")}
    except ValueError:
        robots = {-1}
    if not robots <= set(range(100)):
        raise typer.BadParameter(
            f"{text}: must be numbers in 0..99 with commas, as 1,2,5.", param_hint="'--robots'"
        )
    return robots


def _start(
    *,
    robots: Robots = None,
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
    asked = parse_robots(robots)
    fleet = Fleet(lcm_url, channel_prefix, key=load_or_make(key))
    asked = tell.find(fleet, asked)
    if not partial:
        refuse_unheard(fleet, asked)
    refuse_doubles(fleet, asked)
    check_clocks(fleet, asked, in_s, may_differ=partial)
    busy = tell.find_busy(fleet, asked)
    if busy:
        say(f"{of_busy(busy)}; this start takes over.")
    if arm:
        tell.arm(fleet, asked)
    timeout_ms = 0 if untethered else round(1e3 * link_timeout_s) if link_timeout_s else -1
    options = {"ahead_s": in_s, "partial": partial, "link_timeout_ms": timeout_ms}
    data = {"drove_before": [robot.robot_id for robot in busy if robot.drives]}
    code, voice = 1, Voice()
    with ended_by_signals(fleet, voice.check) as asked_to_end:
        try:
            verdict = _drive(fleet, asked, behavior, voice, data=data, as_json=as_json, **options)
            code = verdict.code
        finally:
            voice.end(code, asked_to_end)
            decide(code)
    voice.check()
    return code


def _drive(
    fleet: Fleet,
    asked: set[int],
    behavior: str,
    voice: Voice,
    *,
    data: dict,
    as_json: bool,
    **options,
) -> Verdict:
    """Starts robots and holds them. Whatever ends that stops them before a word is said of it.

    Args:
        fleet: where they are.
        asked: the robots.
        behavior: as of tell.start().
        voice: what tells it.
        data: printed besides.
        as_json: how it is printed.
        options: of tell.start().
    """
    begun = held = None
    try:
        started = tell.start(fleet, asked, behavior, **options)
        begun, held = of_start(started, options["link_timeout_ms"] == 0), Held(fleet, started)
        data |= {"start_utime_us": started.utime_us, "called_off": started.called_off}
        voice.tell(lambda: _finish("start", started.answers, begun, data, as_json=as_json))
        if started.called_off or not held.robots:
            return begun
        if options["link_timeout_ms"] == 0:
            while not voice.is_idle:
                fleet.listen(0.1)
            fleet.watch()  # the last that ends it, while robots drive on
            return begun
        _hold(fleet, held, voice)
        ended = of_end(begun, held.states, None).beside(_driving(fleet, asked))
    except BaseException as error:
        given = tell.stop(fleet, asked)
        states, known = held.states if held else {}, tell.have_confirmed(fleet, asked)
        ended = of_end(begun, states, of_stop(given), was_confirmed=known)
        ended = ended.beside(_driving(fleet, asked))
        if begun is None:
            data |= {"start_utime_us": None, "called_off": False}
            voice.tell(lambda: _finish("start", given, ended, data, as_json=as_json))
        if not isinstance(error, KeyboardInterrupt):
            voice.say(ended.sentence)
            raise
    if begun is not None:
        voice.say(ended.sentence)
    return ended


def _hold(fleet: Fleet, held: Held, voice: Voice) -> None:
    """Robots hear that somebody is there, until all stand by themselves."""
    try:
        while not held.is_over:
            fleet.listen(0.1)
            for sentence in held.news():
                voice.say(sentence)
            voice.show(lambda: status_table(held.robots))
    finally:
        voice.clear()


@contextmanager
def counting_signals() -> Iterator[list[int]]:
    """Signals that ask for the end do nothing but stand in a list."""
    asked: list[int] = []
    before = [signal.signal(number, lambda n, _: asked.append(n)) for number in ENDING]
    try:
        yield asked
    finally:
        for number, handler in zip(ENDING, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def ended_by_signals(fleet: Fleet, check: Callable[[], None]) -> Iterator[Sequence[int]]:
    """Signals that ask for the end raise KeyboardInterrupt where the fleet listens, only there.

    So nothing can be cut short but waiting, and a stop not even by a second signal. What kills,
    robots notice by themselves. Gives the signals that came.

    Args:
        fleet: whose watch it is.
        check: raises what else is to end it.
    """
    with counting_signals() as asked:

        def look() -> None:
            if asked:
                raise KeyboardInterrupt
            check()

        watch, fleet.watch = fleet.watch, look
        try:
            yield asked
        finally:
            fleet.watch = watch


def _arm(
    *,
    robots: Robots = None,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Let robots be started again that were stopped by a command. Nothing moves yet.

    Example: twinmill swarm arm
    """
    asked = parse_robots(robots)
    fleet = Fleet(lcm_url, channel_prefix, key=load_or_make(key))
    asked = tell.find(fleet, asked)
    refuse_doubles(fleet, asked)
    busy = tell.find_busy(fleet, asked)
    if busy:
        say(f"{of_busy(busy)}.")
    given = tell.arm(fleet, asked)
    return _finish("arm", given, of_arm(given), {}, as_json=as_json)


def _stop(
    *,
    robots: Robots = None,
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
    asked = parse_robots(robots or None)  # an empty list is no reason to stop nobody
    operator_key, fault = _key_if_there(key)
    voice = Voice()
    with counting_signals() as signals:
        with saying_nothing() as say:
            hosts, fleet = tell.Hosts(host or ()), Fleet(lcm_url, channel_prefix, key=operator_key)
            begin_s = time.monotonic()
            given = tell.stop(
                fleet,
                asked,
                timeout_s,
                hosts=hosts,
                waiting=lambda left: say(_waiting_words(left, hosts.unheard(fleet), timeout_s)),
                enough=lambda: _ends_a_stop(signals),
            )
            passed_s = time.monotonic() - begin_s
            if asked:
                fleet.listen(tell.OTHERS_S)
        is_cut_short = _ends_a_stop(signals) and passed_s < timeout_s
        verdict = of_stop(
            given,
            passed_s if is_cut_short else timeout_s,
            is_of_some=bool(asked),
            unheard=hosts.unheard(fleet),
            is_cut_short=is_cut_short,
        ).beside(_driving(fleet, asked))
        if fault:
            voice.say(fault)
        voice.tell(lambda: _finish("stop", given, verdict, {}, as_json=as_json))
        decide(verdict.code)
        voice.end(verdict.code, signals)
    voice.check()
    return verdict.code


def _ends_a_stop(signals: Sequence[int]) -> bool:
    """A person or program gave up waiting; a lost terminal ends no stop."""
    return any(number != signal.SIGHUP for number in signals)


def _driving(fleet: Fleet, asked: set[int]) -> list[str]:
    """Robots that drive and were not asked; nobody was asked where all were."""
    others = [fleet.robots[i] for i in sorted(set(fleet.robots) - asked)] if asked else []
    return [f"R{r.robot_id:02d}" for r in others if r.mode in DRIVING and r.is_here]


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
    except OSError as error:
        return None, f"--key {error.filename}: {error.strerror}, so no robot's answer is believed."
    except ValueError as error:
        return None, str(error)


def _waiting_words(left: set[int], unheard: list[str], timeout_s: float) -> str:
    """Reason why a stop still waits."""
    names = _names(left)
    where = f" from {', '.join(unheard)}" if unheard else ""
    whom = f"{names} to sign that they stand" if names else f"a robot to be heard{where}"
    return f"stop is said all the time; waiting up to {timeout_s:g} s for {whom}."


def _select(
    behavior: Annotated[str, typer.Argument(metavar="BEHAVIOR", help="As milling.")],
    *,
    robots: Robots = None,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    as_json: AsJson = False,
) -> int:
    """Choose what robots do; those that run change at once.

    Example: twinmill swarm select diffusing --robots 1,2
    """
    asked = parse_robots(robots)
    fleet = Fleet(lcm_url, channel_prefix, key=load_or_make(key))
    asked = tell.find(fleet, asked)
    command = tell.make_command(tell.VERBS.VERB_SELECT, behavior)
    given = tell.tell(fleet, command, asked, until_s=time.monotonic() + 5)
    return _finish("select", given, of_select(given, behavior), {}, as_json=as_json)


def refuse_unheard(fleet: Fleet, robots: set[int]) -> None:
    """Raises ValueError if some are not there, or cannot be told anything with this key.

    While nobody was told anything, nobody has to be stopped: another operator may hold them.
    """
    missing = _names(robots - fleet.here())
    if missing:
        raise ValueError(
            f"{missing}: not heard in {tell.FIND_S:g} s, so nothing was started; "
            "`twinmill swarm status` shows who is there, --partial starts the others."
        )
    # Half of all packets lost, one of a thousand has not been heard to sign in the first second.
    fleet.listen(tell.FIND_S, lambda: tell.all_linked(fleet, robots))
    strange = _names({i for i in robots if not fleet.robots[i].link})
    if strange:
        raise ValueError(f"{strange}: nothing was started: {tell.NO_SIGNATURE}")


def _names(robots: set[int]) -> str:
    return ", ".join(f"R{i:02d}" for i in sorted(robots))


def refuse_doubles(fleet: Fleet, robots: set[int]) -> None:
    """Raises ValueError if two robots have one number: a command would reach either or both."""
    for robot_id in sorted(robots & set(fleet.robots)):
        robot = fleet.robots[robot_id]
        if robot.is_double:
            raise ValueError(
                f"two robots say that they are number {robot_id} "
                f"({', '.join(robot.senders.hosts)}): give one another number, "
                "`twinmill robot flash HOST=ID`."
            )


def check_clocks(fleet: Fleet, robots: set[int], ahead_s: float, *, may_differ: bool) -> None:
    """Says on stderr whose clock would make the start no common one.

    Args:
        fleet: where they are.
        robots: whom to start.
        ahead_s: from now to the start.
        may_differ: it is no reason to refuse.

    Raises:
        ValueError: they could not all have begun soon after the instant.
    """
    clocks_s = {i: fleet.robots[i].clock_s for i in sorted(robots & set(fleet.robots))}
    told = of_clocks({f"R{i:02d}": s for i, s in clocks_s.items()}, ahead_s)
    if any(abs(s) > tell.BEGUN_S for s in clocks_s.values()) and not may_differ:
        raise ValueError(f"nothing was started: {told}; --partial starts those that do not refuse.")
    if told:
        say(f"{told}.")


def _finish(
    verb: str, given: list[tell.Answer], verdict: Verdict, data: dict, *, as_json: bool
) -> int:
    """Prints what came of a command, if need be on stderr alone. Returns its exit code."""
    robots = [answer.to_json() for answer in given]
    data = {"verb": verb, "ok": verdict.ok, "sentence": verdict.sentence, **data, "robots": robots}
    text = Group(*([answer_table(given)] if given else []), verdict.sentence)
    try:
        deliver(data, text, as_json)
    except OSError:
        say(verdict.sentence)
        raise
    return verdict.code


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
    if fault:
        say(fault)
    fleet = Fleet(lcm_url, channel_prefix, key=operator_key)
    if once or as_json or not sys.stdout.isatty():
        fleet.listen(1.0)
        known = fleet.robots
        fleet.listen(RUN_PERIOD_S - 1, lambda: known and all(r.run for r in known.values()))
        robots = [fleet.robots[i] for i in sorted(fleet.robots)]
        if as_json:
            print_object({"robots": [r.to_json() for r in robots]})
        else:
            PlainConsole().print(status_table(robots))
        return 0 if robots else 1
    try:
        with Live(console=PlainConsole(), auto_refresh=False) as live:
            while True:
                fleet.listen(0.25)
                robots = [fleet.robots[i] for i in sorted(fleet.robots)]
                live.update(status_table(robots), refresh=True)
    except KeyboardInterrupt:
        return 0
