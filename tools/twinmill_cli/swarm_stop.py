# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm stop`: said to all that can be reached, whatever else is wrong."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from twinmill.defaults import URL
from twinmill_cli import done, several
from twinmill_cli.lazy import asks_for_help_alone, working
from twinmill_cli.options import LcmUrl
from twinmill_cli.output import AsJson
from twinmill_cli.swarm_door import (
    BusPrefix,
    KeyThere,
    Robots,
    check_network,
    check_prefix,
    key_if_there,
    names,
    parse_robots,
)
from twinmill_cli.swarm_signals import counting_signals, saying_nothing

if working():  # not for --help
    from twinmill.data.bus import open_bus
    from twinmill.robots import tell
    from twinmill.robots.fleet import Fleet
    from twinmill_cli.swarm_end import beside_all, driving, finish
    from twinmill_cli.swarm_verdict import Saying, Verdict, of_dry_run, of_stop
    from twinmill_cli.voice import Voice

if TYPE_CHECKING:  # the base of what Typer exports
    from typer._click.core import Context

WRONG_COMMAND_LINE = 2
MISREAD = "twinmill_cli.misread"  # in a context: why not all of its command line was read
FLAGS = ("--json",)
# What counts of a command line that cannot be read: it says nothing of which robots are meant.
# Fewer and fewer options, where these cannot be read either.
KEPT = (
    ("--host", "--key", "--lcm-url", "--channel-prefix"),
    ("--lcm-url", "--channel-prefix"),
    ("--lcm-url",),
)


class NothingStopped(typer.TyperException):
    """A stop that was not said, with the sentence of what refused it."""

    exit_code = WRONG_COMMAND_LINE


@contextmanager
def _refusing() -> Iterator[None]:
    """A command line that is refused says that nothing was stopped."""
    try:
        yield
    except typer.TyperException as error:
        if error.exit_code != WRONG_COMMAND_LINE:
            raise
        raise NothingStopped(f"{_sentence(error)} NOTHING WAS STOPPED.") from error


def _sentence(error: typer.TyperException) -> str:
    """Typer's, which may lack its full stop."""
    words = error.format_message()
    return words if words.endswith((".", "?")) else f"{words}."


class StopCommand(TyperCommand):
    """A stop whose command line cannot be read tells all robots to stop: whoever says it means one.

    Only where the bus cannot be read nobody knows where they are: then it says that nothing was
    stopped.
    """

    def make_context(
        self, info_name: str | None, args: list[str], *rest: Any, **options: Any
    ) -> Context:
        """Typer's; where it would refuse, that of what is left without the words on robots.

        Raises:
            typer.BadParameter: the bus cannot be read.
        """
        words = list(args)
        self.add_help_option = asks_for_help_alone(words)
        try:
            return super().make_context(info_name, args, *rest, **options)
        except typer.TyperException as error:
            if error.exit_code != WRONG_COMMAND_LINE or not working():
                raise
            misread = _sentence(error)
        for kept in KEPT:
            try:
                context = super().make_context(info_name, _kept(words, kept), *rest, **options)
            except typer.TyperException as error:
                refused = error
                continue
            context.meta[MISREAD] = misread
            return context
        with _refusing():
            raise refused


def _kept(words: list[str], kept: Sequence[str]) -> list[str]:
    """Some options of a command line, each with its value, if any is there."""
    found = []
    for place, word in enumerate(words):
        name, has_value, _ = word.partition("=")
        if name in FLAGS:
            found.append(name)
        elif name in kept:
            found += words[place : place + (1 if has_value else 2)]
    return found


def stop(
    *,
    context: typer.Context,
    robots: Robots = None,
    timeout_s: Annotated[float, typer.Option("--timeout-s", min=0.5, help="Give up after.")] = 10.0,
    host: Annotated[
        list[str] | None,
        typer.Option(
            "--host",
            metavar="HOST",
            help="Tell this machine, too, though it was never heard: where multicast does not "
            "pass. Answers come by multicast alone. Repeatable.",
        ),
    ] = None,
    key: KeyThere = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: BusPrefix = None,
    as_json: AsJson = False,
) -> int:
    """Stop robots: said again until each has signed that it stands.

    They start again only after `twinmill swarm arm`, or by their button. Where the command line
    cannot be read, all are stopped, and the exit code is 2.

    Example: twinmill swarm stop
    """
    voice = Voice()
    with counting_signals() as signals:
        with _refusing():
            check_network(lcm_url)
        misread = context.meta.get(MISREAD, "") or _of_hosts(host or ())
        asked, prefix, misread = _read(robots, channel_prefix or "", misread)
        fleet = _say_first(lcm_url, prefix, asked)
        begin_s = time.monotonic()
        fleet.key, fault = key_if_there(key)
        fleet.hear()
        with saying_nothing() as say:
            for words in filter(None, [misread, fault, fleet.deaf]):
                say(words)
            hosts = tell.Hosts([name.strip() for name in host or () if name.strip()])
            given = tell.stop(
                fleet,
                asked,
                timeout_s,
                hosts=hosts,
                waiting=lambda left: say(waiting_words(fleet, left, hosts, timeout_s)),
                driving=lambda robots: say(driving_words(robots)),
                enough=lambda: _ends_a_stop(signals),
            )
            passed_s = time.monotonic() - begin_s
            reached_s = tell.reached_s(fleet, passed_s)
            if asked:  # who drives besides
                fleet.listen(tell.OTHERS_S)
        beside, deaf = driving(fleet, asked), fleet.deaf
        fleet.close()
        is_cut_short = _ends_a_stop(signals) and passed_s < timeout_s
        how = Saying(
            passed_s=passed_s if is_cut_short else timeout_s,
            reached_s=reached_s,
            unheard=hosts.unheard(fleet),
            is_cut_short=is_cut_short,
            reach=fleet.reach,
            to_all=not asked,
            is_deaf=bool(deaf),
            key_fault=deaf or (f"No robot's signature could be checked: {fault}" if fault else ""),
        )
        verdict = of_stop(given, how, is_of_some=bool(asked)).beside(beside)
        verdict = beside_all(fleet, verdict.more(of_dry_run(given)))
        code = WRONG_COMMAND_LINE if misread else verdict.code
        if misread:
            verdict = Verdict(False, f"{misread} {verdict.sentence}")
        done.decide(code)
        voice.tell_outcome(
            lambda: finish("stop", given, verdict, {}, fleet=fleet, as_json=as_json),
            verdict.sentence,
        )
        voice.end(code, signals)
    voice.check()
    return code


def _say_first(lcm_url: str, prefix: str, asked: set[int]) -> Fleet:
    """Says stop before the disk, a name server or the system is asked for anything but a socket.

    Raises:
        ValueError: not even that can be had.
    """
    connect = partial(open_bus, needs_network=False, hears=False)
    try:
        fleet = Fleet(lcm_url, prefix, connect)
    except ValueError as error:
        raise ValueError(f"{error} NOTHING WAS STOPPED.") from error
    done.speaks(lambda: bool(fleet.said))
    tell.say_stop(fleet, asked)
    return fleet


def _read(robots: str | None, prefix: str, misread: str) -> tuple[set[int], str, str]:
    """The robots to stop and their channels' prefix.

    All, and none, where something could not be read; then there is a sentence on it.
    """
    asked: set[int] = set()
    try:
        check_prefix(prefix)
    except typer.BadParameter as error:
        prefix, misread = "", _sentence(error)
    try:
        asked = parse_robots(robots)
    except typer.BadParameter as error:
        misread = _sentence(error)
    asked = set() if misread else asked
    return asked, prefix, f"{misread} So all robots are told to stop." if misread else ""


def _of_hosts(names: Sequence[str]) -> str:
    """Sentence on a machine that has no name, as an unset variable of a script leaves; or empty."""
    if all(name.strip() for name in names):
        return ""
    return (
        "Invalid value for '--host': is empty, and no machine has that name; give its name or "
        "address, as robot03.local, or leave the option out."
    )


def _ends_a_stop(signals: Sequence[int]) -> bool:
    """A person or program gave up waiting; a lost terminal ends no stop."""
    return any(number != signal.SIGHUP for number in signals)


def waiting_words(fleet: Fleet, left: set[int], hosts: tell.Hosts, timeout_s: float) -> str:
    """Reason why a stop still waits."""
    unheard = hosts.unheard(fleet)
    where = f" from {', '.join(unheard)}" if unheard else ""
    words = several.of(left, "to sign that it stands")
    whom = f"{names(left)} {words}" if left else f"a robot to be heard{where}"
    if fleet.reach.said and not fleet.reach.out:
        return (
            f"nothing leaves this computer ({fleet.reach.fault}); tried again all the time, up to "
            f"{timeout_s:g} s."
        )
    return f"stop is said all the time; waiting up to {timeout_s:g} s for {whom}."


def driving_words(robots: set[int]) -> str:
    """Sentence on robots that drive while they are told to stop."""
    words = several.of(robots, "drives, and has not confirmed the stop")
    return f"{names(robots)} {words}."


class LastStop:
    """The stop of a command that ends: like `swarm stop` it says what it awaits, and can be ended.

    Signals that come before that is said ask for the stop itself, be they many.

    Args:
        voice: what tells it.
        signals: that came, and come.

    Attributes:
        how: the last was said.
    """

    def __init__(self, voice: Voice, signals: Sequence[int]):
        self.how = Saying()
        self._voice, self._signals = voice, signals

    def __call__(self, fleet: Fleet, robots: set[int]) -> list[tell.Answer]:
        """Says stop until all robots have signed that they stand. Returns what each answered."""
        begin_s, came = time.monotonic(), None

        def wait(left: set[int]) -> None:
            nonlocal came
            came = len(self._signals)
            self._voice.say(waiting_words(fleet, left, tell.Hosts(()), tell.STOP_S))

        def ends() -> bool:
            return came is not None and _ends_a_stop(self._signals[came:])

        given = tell.stop(
            fleet,
            robots,
            tell.STOP_S,
            waiting=wait,
            driving=lambda those: self._voice.say(driving_words(those)),
            enough=ends,
        )
        passed_s = time.monotonic() - begin_s
        self.how = Saying(
            passed_s=passed_s,
            is_cut_short=ends() and passed_s < tell.STOP_S,
            reach=fleet.reach,
        )
        return given
