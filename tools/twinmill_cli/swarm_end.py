# SPDX-License-Identifier: Apache-2.0
"""Prints how a command to the swarm ended: table, sentence or JSON."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rich.console import Group

from twinmill.robots.hold import BY_COMMAND
from twinmill.robots.tell import OTHERS_S, ask_once
from twinmill.streams import STDOUT, leads_nowhere
from twinmill_cli import done
from twinmill_cli.output import deliver, say
from twinmill_cli.swarm_double import doubles
from twinmill_cli.swarm_screen import answer_table
from twinmill_cli.swarm_verdict import (
    BY_HAND,
    of_addressed,
    of_busy,
    of_clocks_now,
    of_late,
    of_old_news,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from twinmill.robots.fleet import Fleet
    from twinmill.robots.hold import State
    from twinmill.robots.tell import Answer
    from twinmill_cli.swarm_verdict import Verdict


def driving(fleet: Fleet, asked: set[int]) -> list[str]:
    """Robots that drive and were not asked; nobody was asked where all were.

    Who says so is listened to for a moment: that word may have come late, or just before a stop of
    somebody else. Whose clock is behind is asked, lest it be taken for old news.
    """
    others = set(fleet.robots) - asked if asked else set()
    with fleet.unwatched():
        ask_once(fleet, others)
        fleet.listen(OTHERS_S, lambda: not _may_drive(fleet, others))
    return _said_to_drive(fleet, asked)


def _may_drive(fleet: Fleet, others: set[int]) -> bool:
    known = [fleet.robots[i] for i in others]
    return any(r.says_that_it_drives or r.is_old_news for r in known)


def _said_to_drive(fleet: Fleet, asked: set[int]) -> list[str]:
    others = [fleet.robots[i] for i in sorted(set(fleet.robots) - asked)] if asked else []
    return [f"R{r.robot_id:02d}" for r in others if r.says_that_it_drives]


def clocks(fleet: Fleet, robots: Iterable[int]) -> str:
    """Sentences on clocks of some robots that are odd now, and on a late network; may be empty."""
    known = [r for i in sorted(robots) if (r := fleet.robots.get(i)) and not r.is_old_news]
    odd = of_clocks_now({f"R{r.robot_id:02d}": r.clock_s for r in known})
    return " ".join(filter(None, [odd, of_late(known)]))


def times(fleet: Fleet, robots: Iterable[int], standing: Collection[str] = ()) -> str:
    """Sentences on what is old news of some robots, and on clocks and network of the others.

    Args:
        fleet: where they are.
        robots: the robots.
        standing: names of those that are said to stand, as they have signed: what comes of them
            late makes that no old news.
    """
    robots = set(robots)
    open_robots = [i for i in sorted(robots) if f"R{i:02d}" not in standing]
    old = of_old_news(r for i in open_robots if (r := fleet.robots.get(i)))
    return " ".join(filter(None, [old, clocks(fleet, robots)]))


def of_stops(fleet: Fleet, states: dict[str, State]) -> str:
    """Sentence on where a stop came from that was not said here; empty if none was obeyed or heard.

    Args:
        fleet: where the robots are.
        states: of each that was held, by name.
    """
    stopped = {int(name[1:]) for name, state in states.items() if state is BY_COMMAND}
    heard = fleet.stop_heard(stopped) if stopped else ""
    return f"A stop came from {heard}." if heard else ""


def of_those_to_begin(fleet: Fleet, standing: Collection[str] = ()) -> str:
    """Sentence on robots that wait for a start, or fell silent and may drive; empty if none does.

    Whoever was asked.

    Args:
        fleet: where they are.
        standing: names of those that are said to stand, as they have signed.
    """
    known = [r for _, r in sorted(fleet.robots.items()) if f"R{r.robot_id:02d}" not in standing]
    busy = [r for r in known if r.may_begin]
    return f"{of_busy(busy, fleet.held)}." if busy else ""


def beside_all(fleet: Fleet, verdict: Verdict) -> Verdict:
    """An outcome with a word on all robots, asked or not, of which that must be known.

    They wait for a start and begin by themselves, or fell silent and may drive; or they are two of
    one number: then it is wrong.
    """
    if begins := of_those_to_begin(fleet, verdict.standing):
        of_some = verdict.of_some()
        is_silent = of_some != verdict and any(r.may_drive for r in fleet.robots.values())
        verdict = of_some.more(begins).more(BY_HAND if is_silent else "")
    told = doubles(fleet, fleet.robots)
    return replace(verdict.more(told), ok=False, ends_well=False) if told else verdict


def addressed(fleet: Fleet, robots: Iterable[int]) -> dict[str, Any]:
    """Object on whom a command was for, where that is not all robots of the default bus; or empty.

    Args:
        fleet: where they are.
        robots: that were asked or heard.
    """
    twins = [i for i in sorted(robots) if (r := fleet.robots.get(i)) and r.is_twin]
    where = {**fleet.addressed_by, **({"twins": twins} if twins else {})}
    return {"addressed": where} if where else {}


def placed(fleet: Fleet, robots: Iterable[int], verdict: Verdict) -> Verdict:
    """An outcome with words before it on whom the command was for, where these are needed."""
    return verdict.behind(of_addressed(addressed(fleet, robots).get("addressed", {})))


def finish(
    verb: str,
    given: list[Answer],
    verdict: Verdict,
    data: dict[str, Any],
    *,
    fleet: Fleet,
    as_json: bool,
) -> int:
    """Prints what came of a command, and whom it was for. Returns its exit code.

    If need be on stderr alone; there, too, what is wrong where stdout leads nowhere.
    """
    robots, asked = [answer.to_json() for answer in given], [a.robot_id for a in given]
    verdict = placed(fleet, asked, verdict)
    told = {"verb": verb, "ok": verdict.ok, "sentence": verdict.sentence}
    data = {**told, **addressed(fleet, asked), **data, "robots": robots}
    text = Group(*([answer_table(given)] if given else []), verdict.sentence)
    try:
        deliver(data, text, as_json)
    except BrokenPipeError as error:  # of which Typer says nothing
        say(verdict.sentence)
        done.told(verdict.sentence)
        raise OSError(f"{error.filename}: nobody reads it any more.") from error
    except OSError:
        say(verdict.sentence)
        done.told(verdict.sentence)
        raise
    done.told(verdict.sentence)
    if not verdict.ok and leads_nowhere(STDOUT):
        say(verdict.sentence)
    return verdict.code
