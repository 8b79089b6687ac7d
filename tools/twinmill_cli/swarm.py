# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm arm`, `start`, `stop`, `select` and `status`."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from twinmill.defaults import URL
from twinmill_cli import done
from twinmill_cli.ctrl_c import kept_free
from twinmill_cli.lazy import asks_for_help_alone, means_stop, working
from twinmill_cli.options import Arm, KeyFile, LcmUrl
from twinmill_cli.output import AsJson, print_object, say, telling
from twinmill_cli.swarm_door import (
    BusPrefix,
    KeyThere,
    Robots,
    check_behavior,
    check_bus,
    check_clocks,
    join,
    key_if_there,
    names,
    parse_robots,
    refuse_doubles,
    refuse_stopped,
    refuse_unheard,
    say_old_news,
)
from twinmill_cli.swarm_signals import (
    OVER_SSH,
    WhatEnds,
    commanding,
    ended_by_signals,
    is_over_ssh,
    told_of_signals,
)
from twinmill_cli.swarm_stop import LastStop, StopCommand, stop

if working():  # not for --help
    from rich.live import Live

    from twinmill.robots import tell
    from twinmill.robots.fleet import LINK_TIMEOUT_MS, RUN_PERIOD_S, Fleet, Robot
    from twinmill.robots.hold import Held
    from twinmill.terminal import PlainConsole
    from twinmill_cli.room import refuse_deleted, refuse_full
    from twinmill_cli.swarm_double import doubles
    from twinmill_cli.swarm_end import (
        addressed,
        beside_all,
        clocks,
        driving,
        finish,
        of_stops,
        of_those_to_begin,
        placed,
        times,
    )
    from twinmill_cli.swarm_screen import countdown, live_table, status_table
    from twinmill_cli.swarm_verdict import (
        LEFT_ALONE,
        NOBODY_TOLD,
        Verdict,
        of_arm,
        of_busy,
        of_countdown,
        of_end,
        of_heard,
        of_old_news,
        of_remarks,
        of_select,
        of_start,
        of_status,
        of_stop,
        of_taking_over,
    )
    from twinmill_cli.voice import Voice, refuse_deaf

if TYPE_CHECKING:  # the base of what Typer exports
    from typer._click.core import Context

Behavior = Annotated[
    str | None,
    typer.Option("--behavior", "-b", metavar="BEHAVIOR", help="Select it first, as milling."),
]


class SwarmGroup(TyperGroup):
    """The commands to a swarm: a -h before `stop` is no request for help either."""

    def make_context(
        self, info_name: str | None, args: list[str], *rest: Any, **options: Any
    ) -> Context:
        """Typer's."""
        self.add_help_option = asks_for_help_alone(args) or not means_stop(args)
        return super().make_context(info_name, args, *rest, **options)


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    swarm = typer.Typer(
        cls=SwarmGroup,
        help="Start, stop and watch the robots on the network, or those of twin_run.",
        no_args_is_help=True,
        context_settings={"token_normalize_func": str.lower},  # STOP is a stop
    )
    swarm.command("start")(_start)
    swarm.command("arm")(_arm)
    swarm.command("stop", cls=StopCommand)(stop)
    swarm.command("select")(_select)
    swarm.command("status")(_status)
    app.add_typer(swarm, name="swarm")


def _start(
    *,
    robots: Robots = None,
    behavior: Behavior = None,
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
    channel_prefix: BusPrefix = None,
    as_json: AsJson = False,
) -> int:
    """Start all robots at one instant, or none, and hold them: Ctrl-C stops them.

    While this runs they hear that somebody is there; a robot that hears nothing
    for 2 s stops. The instant is one of the robots' own clocks: keep them set
    (NTP).

    Example: twinmill swarm start --behavior milling --in-s 3
    """
    if untethered and link_timeout_s is not None:
        raise typer.BadParameter("give one of them.", param_hint="--untethered, --link-timeout-s")
    asked, behavior = parse_robots(robots), check_behavior(behavior, "'--behavior'")
    check_bus(lcm_url, channel_prefix)
    refuse_deaf()
    files = refuse_full()
    timeout_ms = 0 if untethered else round(1e3 * (link_timeout_s or LINK_TIMEOUT_MS / 1e3))
    options = {"ahead_s": in_s, "partial": partial, "link_timeout_ms": timeout_ms}
    with commanding("start", lambda: join(lcm_url, channel_prefix, key), as_json=as_json) as fleet:
        is_named, asked = bool(asked), tell.find(fleet, asked)
        if not partial:
            refuse_unheard(fleet, asked)
        refuse_doubles(fleet, asked)
        check_clocks(fleet, asked, in_s, may_differ=partial)
        busy = tell.find_busy(fleet, asked)
        refuse_stopped(fleet, asked, "started", "you arm and start them again (--arm)")
        if busy:
            say(of_taking_over(busy))
        if timeout_ms and is_over_ssh():
            say(OVER_SSH)
        if arm:
            tell.arm(fleet, asked)
        data = {
            **_drove(busy),
            "left_alone": [],
            "link_timeout_s": timeout_ms / 1e3,
        }
        code, voice = 1, Voice(as_json=as_json)
        old = {i for i in asked if (r := fleet.robots.get(i)) and r.signs_only_old_news}

        def heard(told: Verdict) -> str:
            by_old_news = {i for i in old if f"R{i:02d}" not in told.standing}
            return "" if is_named else of_heard(sorted(asked - by_old_news), sorted(by_old_news))

        ends = WhatEnds(lcm_url, channel_prefix, voice.say_instead)

        def check() -> None:
            voice.check_listener()
            ends.look()

        with ended_by_signals(fleet, check) as asked_to_end:
            try:
                with kept_free(fleet):
                    verdict = _drive(
                        fleet,
                        asked,
                        behavior,
                        voice,
                        data=data,
                        as_json=as_json,
                        heard=heard,
                        ends=ends,
                        signals=asked_to_end,
                        **options,
                    )
                code = verdict.code_after(asked_to_end)
            finally:
                done.decide(code)
                voice.end(code, asked_to_end)
        voice.check(signals=asked_to_end)
        refuse_deleted(files)
        return code


def _drive(
    fleet: Fleet,
    asked: set[int],
    behavior: str,
    voice: Voice,
    *,
    data: dict[str, Any],
    as_json: bool,
    heard: Callable[[Verdict], str],
    ends: Callable[..., str],
    signals: Sequence[int],
    **options: Any,
) -> Verdict:
    """Starts robots and holds them. Whatever ends that stops them before a word is said of it.

    Args:
        fleet: where they are.
        asked: the robots.
        behavior: as of tell.start().
        voice: what tells it.
        data: printed besides.
        as_json: how it is printed.
        heard: gives words on who is there, where nobody said who is meant; given the outcome.
        ends: gives words on what stops robots that are held; given "calls that off", on that.
        signals: that came, and come.
        options: of tell.start().
    """
    begun, held, halt = None, None, LastStop(voice, signals)
    instant_s = time.monotonic() + options["ahead_s"]
    ahead = countdown(_may_start(fleet, asked), options["ahead_s"], ends("calls that off"))
    voice.show_or_say(ahead)
    try:
        started = tell.start(fleet, asked, behavior, stopping=halt, **options)
        voice.clear()
        begun = of_start(started, ends(), drove_before=data["drove_before"])
        said = begun.more(heard(begun)).more(times(fleet, asked, begun.standing))
        said = beside_all(fleet, said)
        held = Held(fleet, started)
        data |= {"start_utime_us": started.begun_utime_us, "called_off": started.called_off}
        data["left_alone"] = sorted(started.left_alone)
        voice.tell_outcome(
            lambda: finish("start", started.answers, said, data, fleet=fleet, as_json=as_json),
            placed(fleet, asked, said).sentence,
        )
        if started.called_off or not held.robots:
            return said
        if options["link_timeout_ms"] == 0:
            voice.wait(fleet.listen)
            fleet.watch()  # the last that ends it, while robots drive on
            return said
        _hold(fleet, held, voice)
        ended = of_end(begun, held.states, None).more(of_stops(fleet, held.states))
        ended = ended.more(heard(ended)).beside(driving(fleet, asked))
        ended = beside_all(fleet, ended.more(times(fleet, asked, ended.standing)))
    except BaseException as error:
        done.became("")
        if held:
            held.settle()
        told = asked & fleet.addressed if time.monotonic() < instant_s else asked
        given = halt(fleet, told) if told else []
        voice.clear()
        states, known = held.ends() if held else {}, tell.have_confirmed(fleet, told)
        stopped = of_stop(given, halt.how) if told else NOBODY_TOLD
        ended = of_end(begun, states, stopped, was_confirmed=known)
        left = sorted(asked - told)
        data["left_alone"] = left
        ended = ended.beside([f"R{i:02d}" for i in left], LEFT_ALONE).more(_who_drives(fleet, left))
        ended = (
            ended.more(of_stops(fleet, states))
            .more(told_of_signals(signals))
            .more(of_remarks(given) if stopped.ok else "")
            .more(heard(ended))
            .beside(driving(fleet, asked))
            .more(times(fleet, asked, ended.standing))
        )
        ended = beside_all(fleet, ended)
        if begun is None:
            data |= {"start_utime_us": None, "called_off": False}
            voice.tell_outcome(
                lambda: finish("start", given, ended, data, fleet=fleet, as_json=as_json),
                placed(fleet, asked, ended).sentence,
            )
        if not isinstance(error, KeyboardInterrupt):
            voice.say_outcome(placed(fleet, asked, ended).sentence)
            raise
    if begun is not None:
        voice.say_outcome(placed(fleet, asked, ended).sentence)
    return ended


def _may_start(fleet: Fleet, asked: set[int]) -> set[int]:
    """Those of some robots that are not heard to sign nothing, as with another key."""
    return {i for i in asked if not ((r := fleet.robots.get(i)) and r.recent and not r.link)}


def _drove(busy: list[Robot]) -> dict[str, list[int]]:
    """Object on the robots that drove before anything was said from here."""
    return {"drove_before": [robot.robot_id for robot in busy if robot.drives_by_any_word]}


def _who_drives(fleet: Fleet, left: list[int]) -> str:
    """Sentence on robots that were left alone, and drive; empty if none does."""
    busy = [r for i in left if (r := fleet.robots.get(i)) and r.drives_by_any_word]
    return f"{of_busy(busy)}." if busy else ""


def _hold(fleet: Fleet, held: Held, voice: Voice) -> None:
    """Robots hear that somebody is there, until all stand by themselves."""
    try:
        while not held.is_over:
            tell.ask_once(fleet, {robot.robot_id for robot in held.robots})
            fleet.listen(0.1)
            for sentence in held.news():
                voice.say(sentence)
            voice.show(lambda: live_table(held.robots))
    finally:
        voice.clear()


def _arm(
    *,
    robots: Robots = None,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: BusPrefix = None,
    as_json: AsJson = False,
) -> int:
    """Let robots be started again that were stopped by a command. Nothing moves yet.

    Example: twinmill swarm arm
    """
    asked = parse_robots(robots)
    check_bus(lcm_url, channel_prefix)
    with commanding("arm", lambda: join(lcm_url, channel_prefix, key), as_json=as_json) as fleet:
        asked = tell.find(fleet, asked)
        refuse_doubles(fleet, asked)
        say_old_news(fleet, asked)
        busy = tell.find_busy(fleet, asked)
        refuse_stopped(fleet, asked, "armed", "you arm them")
        if busy:
            say(f"{of_busy(busy)}.")
        with telling(f"arming {names(asked)}, up to {tell.ARM_S:g} s until each has answered"):
            given = tell.arm(fleet, asked)
        verdict = beside_all(fleet, of_arm(given))
        done.decide(verdict.code, verdict.sentence)
        return finish("arm", given, verdict, _drove(busy), fleet=fleet, as_json=as_json)


def _select(
    behavior: Annotated[str, typer.Argument(metavar="BEHAVIOR", help="As milling.")],
    *,
    robots: Robots = None,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: BusPrefix = None,
    as_json: AsJson = False,
) -> int:
    """Choose what robots do; those that run change at once.

    Example: twinmill swarm select diffusing --robots 1,2
    """
    asked, behavior = parse_robots(robots), check_behavior(behavior, "BEHAVIOR")
    check_bus(lcm_url, channel_prefix)
    with commanding("select", lambda: join(lcm_url, channel_prefix, key), as_json=as_json) as fleet:
        asked = tell.find(fleet, asked)
        say_old_news(fleet, asked)
        tell.hear_doubles(fleet, asked)
        busy = tell.find_busy(fleet, asked)
        if busy:
            say(" ".join(filter(None, [of_countdown(busy, behavior), f"{of_busy(busy)}."])))
        command = tell.make_command(tell.VERBS.VERB_SELECT, behavior)
        given = tell.tell(fleet, command, asked, until_s=time.monotonic() + 5)
        verdict = beside_all(fleet, of_select(given, behavior))
        done.decide(verdict.code, verdict.sentence)
        return finish("select", given, verdict, _drove(busy), fleet=fleet, as_json=as_json)


def _status(
    *,
    once: Annotated[bool, typer.Option("--once", help="Print one table and end.")] = False,
    key: KeyThere = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: BusPrefix = None,
    as_json: AsJson = False,
) -> int:
    """Show who is there and how they are: at a terminal until Ctrl-C, else one table.

    Example: twinmill swarm status
    """
    check_bus(lcm_url, channel_prefix)
    operator_key, fault = key_if_there(key)
    if fault:
        say(f"no robot's signature can be checked: {fault}")

    def look_on() -> Fleet:
        return Fleet(lcm_url, channel_prefix or "", key=operator_key)

    with commanding("status", look_on, as_json=as_json, numbers=[signal.SIGINT]) as fleet:
        if once or as_json or not sys.stdout.isatty():
            return _print(fleet, fault, as_json=as_json)
        with suppress(KeyboardInterrupt):
            _show(fleet)
        return 0


def _show(fleet: Fleet) -> None:
    """Draws the table anew until a signal ends it."""
    with Live(console=PlainConsole(), auto_refresh=False) as live:
        while True:
            fleet.listen(0.25)
            tell.ask_once(fleet, {i for i, r in fleet.robots.items() if r.link})
            robots = [fleet.robots[i] for i in sorted(fleet.robots)]
            live.update(live_table(robots, has_key=fleet.has_key), refresh=True)


def _print(fleet: Fleet, key_fault: str, *, as_json: bool) -> int:
    """Prints the table once. Returns the exit code."""
    fleet.listen(1.0)
    known = fleet.robots
    fleet.listen(
        RUN_PERIOD_S - 1, lambda: bool(known) and all(r.is_source_known for r in known.values())
    )
    robots = [fleet.robots[i] for i in sorted(fleet.robots)]
    if not robots:
        say(f"no robot was heard: {tell.why_unheard(fleet)}")
    tell.ask_clocks(fleet, set(fleet.robots))
    heard, odd = placed(fleet, fleet.robots, of_status(robots)), clocks(fleet, fleet.robots)
    odd = " ".join(filter(None, [of_those_to_begin(fleet), doubles(fleet, fleet.robots), odd]))
    if as_json:
        data = {"verb": "status", "ok": heard.ok, "sentence": heard.more(odd).sentence}
        data |= addressed(fleet, fleet.robots)
        of_each = [r.to_json() for r in robots]
        print_object({**data, "robots": of_each, "key_fault": key_fault or None})
    else:
        PlainConsole().print(status_table(robots, has_key=fleet.has_key))
        where = placed(fleet, fleet.robots, Verdict(True, "")).sentence
        for words in filter(None, [where, of_old_news(robots), odd]):
            PlainConsole().print(words, soft_wrap=True)
    return heard.code
