# SPDX-License-Identifier: Apache-2.0
"""A planned run for people: terminal and report."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.arguments import option
from twinmill.experiment.design import Chance, Plan
from twinmill.experiment.power import percent
from twinmill.model.parameters import catalogue
from twinmill.report import Section, show
from twinmill.report import next_run_figures as figures
from twinmill.report.tables import Cell, Table, Tone, number
from twinmill.terminal import whole

if TYPE_CHECKING:  # needs more packages than a run that tells effects apart
    from twinmill.swarm.narrowing import Narrowing

MOST_NAMED = 4  # quantities of a narrowing run
SMALL_SHARE = 0.05  # of the variance


@dataclass(frozen=True)
class How:
    """How to play a script.

    Attributes:
        first: sentences on what to do before.
        commands: where or when, and the command line.
    """

    first: str
    commands: list[tuple[str, str]]


def terminal(plan: Plan, how: How) -> RenderableType:
    """What a person reads; command lines stay whole, to be copied."""
    steps = [part for where, command in how.commands for part in (Text(where), whole(command))]
    return Group(
        Text(plan.why),
        Text(_outlook(plan), show.STYLES[_tone(plan.predicted_power)]),
        Text(f"It takes {_length(plan)}"),
        Text(),
        show.table(_moves(plan)),
        show.table(_chances(plan)),
        *(Text(line) for line in (*_hidden(plan), how.first)),
        *steps,
    )


def section(plan: Plan, how: How) -> Section:
    """The page of a planned run: its path, its script and what it would tell apart."""
    power = plan.predicted_power
    return Section(
        "The next run",
        [("chance of the right name", percent(power), _tone(power))],
        f"{plan.why} {_outlook(plan)}",
        [("run", _length(plan))],
        [figures.commands(plan), figures.floor(plan), figures.margins(plan)],
        [_chances(plan), _moves(plan)],
        next_step=how.first,
        commands=how.commands,
        warnings=_hidden(plan),
    )


def _length(plan: Plan) -> str:
    along_m, across_m = plan.extent_m
    return (
        f"{plan.rows.end_s:.1f} s on {along_m:.1f} m along by {across_m:.1f} m across, the robot's "
        "body included."
    )


def _outlook(plan: Plan) -> str:
    told, asked = len(plan.separates), len(plan.chances)
    return (
        f"The run tells {told} of these {asked}: if one of them is missing, the right name comes "
        f"with a chance of {percent(plan.predicted_power)}."
    )


def _hidden(plan: Plan) -> list[str]:
    """What even this run does not tell, and what would."""
    entries = catalogue()
    return [
        f"{c.effect} stays open ({_rival(c)}); measured by hand: {entries[c.effect]['measure']}"
        for c in plan.chances
        if c.effect not in plan.separates
    ]


def _rival(chance: Chance) -> str:
    return f"like {chance.rival}" if chance.rival else "too weak here"


def _moves(plan: Plan) -> Table:
    rows, at_s = [], float(plan.rows.t_s[1])
    for name, same in groupby(plan.moves, key=lambda move: move.name):
        moves = list(same)
        times = f"{len(moves)} x " if len(moves) > 1 else ""
        rows.append([Cell(f"{at_s:.1f}"), Cell(f"{times}{name}")])
        at_s += sum(move.duration_s for move in moves)
    return Table("The script", ["from (s)", "move"], rows, words=(1,))


def _chances(plan: Plan) -> Table:
    rows = [
        [
            Cell(c.effect),
            Cell(c.rival or "none"),
            Cell(number(c.margin_before)),
            Cell(number(c.margin)),
            Cell(percent(c.power_before)),
            Cell(percent(c.power), _tone(c.power)),
        ]
        for c in plan.chances
    ]
    return Table(
        "What it tells apart",
        [
            "effect",
            "best\nimitation",
            "margin\nso far",
            "with\nthis run",
            "named\nso far",
            "then",
        ],
        rows,
        "Margin: chi2 of the effect's trace that no rival and no change of the base could leave, "
        "at its fitted strength or else its usual one. Named: chance that it is, if it is the one: "
        "it must stand out, be told from its rivals and lower the score by 2 %. Where no log tells "
        "its strength, that is the mean over weak, usual and strong (0.4, 1, 2.5 times).",
        words=(0, 1),
    )


def _tone(power: float) -> Tone:
    return "good" if power > 0.8 else "warn" if power > 0.5 else "bad"


def narrowing_terminal(found: Narrowing, how: How) -> RenderableType:
    """What a person reads of a run that narrows what a swarm is predicted to do."""
    steps = [part for where, command in how.commands for part in (Text(where), whole(command))]
    return Group(*map(Text, [*_narrowed(found), how.first]), *steps)


def _narrowed(found: Narrowing) -> list[str]:
    """What is open, why, and what the run does about it."""
    before, after = found.stds
    share, shares = found.spread.shares.mean(), found.spread.shares
    takes = list(found.spread.known_takes().items())[:MOST_NAMED]
    named = ", ".join(f"{name} ({part:.0%})" for name, part in takes if part > SMALL_SHARE)
    moves = [(name, len(list(group))) for name, group in groupby(m.name for m in found.moves)]
    drive = ", ".join(f"{count} x {name}" if count > 1 else name for name, count in moves)
    said = [
        f"{share:.0%} of runs end as {found.goal}, ± {100 * before:.1f} points by what the fits "
        f"leave open ({len(shares)} models drawn: {shares.min():.0%} to {shares.max():.0%}).",
        f"Known exactly, one of these would take so much of that variance: {named}.",
        f"After a fit to this run of {found.rows.end_s:.0f} s it would be ± {100 * after:.1f} "
        f"points: {drive}.",
    ]
    if found.spread.foretold <= 0:
        said.append(
            f"Which number moves it is not known: what {len(shares)} models tell of another is no "
            "better than their mean, so these points and this drive may be chance. More "
            f"{option('draws')} "
            f"and {option('seeds')} tell, or nothing here matters (twinmill swarm matters)."
        )
    if found.untold > SMALL_SHARE:
        said.append(
            f"{found.untold:.0%} of it no drive of one robot shows: measure that by itself."
        )
    return said
