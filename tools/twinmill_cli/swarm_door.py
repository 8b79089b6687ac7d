# SPDX-License-Identifier: Apache-2.0
"""Options that all commands to the swarm have, each checked, and robots that are refused."""

from __future__ import annotations

import errno
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from twinmill_cli import several
from twinmill_cli.lazy import working
from twinmill_cli.output import say

if working():  # not for --help
    from twinmill.arguments import option
    from twinmill.data.bus import CHANNEL_MAX, check_url
    from twinmill.numbers_typed import typed_int
    from twinmill.robots import tell
    from twinmill.robots.fleet import Fleet
    from twinmill.robots.key import load, of_operator
    from twinmill_cli.swarm_double import doubles
    from twinmill_cli.swarm_verdict import of_busy, of_clocks, of_late, of_old_news

    PREFIX_MAX = CHANNEL_MAX - len("R00_SIGNED_ACK")  # the longest of robots' channels

if TYPE_CHECKING:
    from collections.abc import Iterable

Robots = Annotated[
    str | None,
    typer.Option(
        "--robots", metavar="IDS", help="Only these, as 1,2,5; without, all that are there."
    ),
]
KeyThere = Annotated[
    Path | None,
    typer.Option(
        "--key",
        metavar="FILE",
        help="The operator's key, by which answers are believed; none is made. Default: "
        "twinmill/swarm.key in ~/.config.",
    ),
]
BusPrefix = Annotated[
    str | None,
    typer.Option("--channel-prefix", help="As given to twin_run, to speak to a twin alone."),
]


def parse_robots(text: str | None) -> set[int]:
    """Robots as a user writes them; none where nothing was written, which means all.

    Raises:
        typer.BadParameter: it is no list of numbers in 0..99, or has one twice.
    """
    if text is None:
        return set()
    try:
        robots = [typed_int(word) for word in text.split(",")]
    except ValueError:
        robots = []
    if not robots or not set(robots) <= set(range(100)):
        # As the carriage return at the end of a list with Windows' ends of lines.
        written = (text if text.isprintable() else repr(text)) or "an empty list"
        raise typer.BadParameter(
            f"{written}: must be numbers in 0..99 with commas, as 1,2,5.", param_hint="'--robots'"
        )
    twice = sorted({i for i in robots if robots.count(i) > 1})
    if twice:
        raise typer.BadParameter(
            f"{text}: has {twice[0]} twice; which one was meant?", param_hint="'--robots'"
        )
    return set(robots)


def check_bus(lcm_url: str, channel_prefix: str | None) -> None:
    """Raises typer.BadParameter if no bus has such a URL, or a prefix is given that is empty.

    The latter is what an unset variable of a script leaves, and would command real robots.
    """
    check_network(lcm_url)
    if channel_prefix == "":
        raise typer.BadParameter(
            "is empty, and robots without a prefix would be commanded; leave it out if they are "
            "meant.",
            param_hint="'--channel-prefix'",
        )
    check_prefix(channel_prefix or "")


def check_network(lcm_url: str) -> None:
    """Raises typer.BadParameter if no bus has such a URL."""
    try:
        check_url(lcm_url)
    except RuntimeError as error:
        raise typer.BadParameter(f"{error}.", param_hint="'--lcm-url'") from error


def check_prefix(prefix: str) -> None:
    """Raises typer.BadParameter if no channel of LCM can begin so."""
    if not (prefix.isascii() and prefix.isprintable() and len(prefix) <= PREFIX_MAX):
        raise typer.BadParameter(
            f"{prefix}: must be at most {PREFIX_MAX} printable ASCII characters, as TWIN_; type "
            "it anew.",
            param_hint="'--channel-prefix'",
        )


def check_behavior(name: str | None, param_hint: str) -> str:
    """The name of a behaviour, or an empty one for none; raises typer.BadParameter if it is empty.

    Args:
        name: as given; None: it was not.
        param_hint: how it is given.
    """
    if name is not None and not name.strip():
        raise typer.BadParameter("is empty, and no behaviour's name.", param_hint=param_hint)
    return name or ""


def join(lcm_url: str, channel_prefix: str | None, key: Path | None) -> Fleet:
    """The robots of a bus, to be commanded.

    Raises:
        ValueError: the key cannot be used, or there is no such bus; the sentence says so.
    """
    try:
        operator_key = of_operator(key, say)
    except OSError as error:
        raise ValueError(f"{key_fault(error)} Nothing was said to any robot.") from error
    except ValueError as error:
        raise ValueError(f"{error} Nothing was said to any robot.") from error
    return Fleet(lcm_url, channel_prefix or "", key=operator_key)


def key_if_there(path: Path | None) -> tuple[bytes | None, str]:
    """The key, or a sentence on why there is none: then no robot's signature can be checked."""
    try:
        return load(path), ""
    except OSError as error:
        return None, key_fault(error)
    except ValueError as error:
        return None, str(error)


def key_fault(error: OSError) -> str:
    """Sentence on a key file that the system does not give."""
    file = str(error.filename)
    told = f"{option('key', file)}: {error.strerror}"
    if error.errno != errno.EACCES:
        return f"{told}."
    return (
        f"{told}; it may be another user's, as made with sudo: `ls -ld {quote(file)}` tells whose, "
        f"and `sudo chown $USER {quote(file)}` makes it yours (so for its folder)."
    )


def refuse_unheard(fleet: Fleet, robots: set[int]) -> None:
    """Raises ValueError if some are not there, or cannot be told anything with this key.

    While nobody was told anything, nobody has to be stopped: another operator may hold them.
    """
    missing = names(robots - fleet.here())
    if missing:
        raise ValueError(
            f"{missing}: not heard in {tell.FIND_S:g} s, so nothing was started; "
            "`twinmill swarm status` shows who is there, --partial starts the others."
        )
    # Half of all packets lost, one of a thousand has not been heard to sign in the first second.
    fleet.listen(tell.FIND_S, lambda: tell.all_linked(fleet, robots))
    strange = {i for i in robots if not fleet.robots[i].link}
    if strange:
        why = several.of(strange, tell.NO_SIGNATURE)
        driving = [fleet.robots[i] for i in sorted(strange) if fleet.robots[i].says_that_it_drives]
        more = f" {of_busy(driving)}." if driving else ""
        raise ValueError(f"nothing was started: {names(strange)} {why}.{more}")


def names(robots: Iterable[int]) -> str:
    """Robots by name, in order."""
    return ", ".join(f"R{i:02d}" for i in sorted(robots))


def refuse_doubles(fleet: Fleet, robots: set[int]) -> None:
    """Raises ValueError if two robots have one number: a command would reach either or both."""
    tell.hear_doubles(fleet, robots)
    if told := doubles(fleet, robots):
        raise ValueError(told)


def say_old_news(fleet: Fleet, robots: set[int]) -> None:
    """Says on stderr of which robots old news alone is heard, be they asked for an answer."""
    tell.ask_clocks(fleet, robots)
    if old := of_old_news(r for i in sorted(robots) if (r := fleet.robots.get(i))):
        say(old)


def refuse_stopped(fleet: Fleet, robots: set[int], done: str, again: str) -> None:
    """Refuses to loosen a stop that somebody said while this looked who is there.

    Args:
        fleet: where robots are.
        robots: of which some were stopped.
        done: what was not, as `started`.
        again: what to ask about before it is done.

    Raises:
        ValueError: one was heard.
    """
    if heard := fleet.stop_heard(robots):
        raise ValueError(f"nothing was {done}: a stop came from {heard}: ask there before {again}.")


def check_clocks(fleet: Fleet, robots: set[int], ahead_s: float, *, may_differ: bool) -> None:
    """Says on stderr of whom nothing is new, and whose clock would make the start no common one.

    Args:
        fleet: where they are.
        robots: whom to start.
        ahead_s: from now to the start.
        may_differ: it is no reason to refuse.

    Raises:
        ValueError: they could not all have begun soon after the instant.
    """
    tell.ask_clocks(fleet, robots)
    known = [fleet.robots[i] for i in sorted(robots & set(fleet.robots))]
    old = of_old_news(known)
    if old and not may_differ:
        raise ValueError(f"nothing was started: {old}")
    known = [robot for robot in known if not robot.is_old_news]
    clocks_s = {robot.robot_id: robot.clock_s for robot in known}
    told = of_clocks({f"R{i:02d}": s for i, s in clocks_s.items()}, ahead_s)
    if any(abs(s) > tell.BEGUN_S for s in clocks_s.values()) and not may_differ:
        raise ValueError(f"nothing was started: {told}; --partial starts those that do not refuse.")
    late = of_late(known)
    takes_s = max((r.round_trip_s for r in known if r.has_answered), default=0.0)
    if late and tell.CALL_OFF_S + takes_s > ahead_s and not may_differ:
        raise ValueError(
            f"nothing was started: {late} So long an answer to a start takes: "
            f"{tell.in_s_option(takes_s)} leaves time for it."
        )
    if any(r.late_s > tell.BEGUN_S for r in known) and not may_differ:
        raise ValueError(
            f"nothing was started: {late} That all drive is to be known {tell.BEGUN_S:g} s after "
            "the instant; --partial starts those that do not refuse."
        )
    for words in filter(None, [old, f"{told}." if told else "", late]):
        say(words)
