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
    """Text of a planned run; command lines stay whole, to be copied."""
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
        [("probability of the right name", percent(power), _tone(power))],
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
        f"The run identifies {told} of these {asked}: if one of them is missing, diagnose will "
        f"name it with a probability of {percent(plan.predicted_power)} (mean over all {asked})."
    )


def _hidden(plan: Plan) -> list[str]:
    """Effects that even this run does not identify, and how to measure them."""
    entries = catalogue()
    return [
        f"{c.effect} is not identified ({_rival(c)}); to measure it by hand: "
        f"{entries[c.effect]['measure']}"
        for c in plan.chances
        if c.effect not in plan.separates
    ]


def _rival(chance: Chance) -> str:
    return f"resembles {chance.rival}" if chance.rival else "too weak here"


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
        "What the run identifies",
        [
            "effect",
            "closest\nrival",
            "chi2\nso far",
            "with\nthis run",
            "power\nso far",
            "with\nthis run",
        ],
        rows,
        "Chi2: of the part of the effect's signature that neither the closest rival nor a refit of "
        "the base can reproduce, at the effect's fitted size or else a usual one. Power: "
        "probability that diagnose names the effect if it is the missing one, which takes "
        "significance, a lead over its rivals and a score lower by 2 %. Where no log determines "
        "its size, power is the mean over 0.4, 1 and 2.5 times the usual size.",
        words=(0, 1),
    )


def _tone(power: float) -> Tone:
    return "good" if power > 0.8 else "warn" if power > 0.5 else "bad"


def narrowing_terminal(found: Narrowing, how: How) -> RenderableType:
    """Text of a run that narrows the prediction of a swarm."""
    steps = [part for where, command in how.commands for part in (Text(where), whole(command))]
    return Group(*map(Text, [*_narrowed(found), how.first]), *steps)


def _narrowed(found: Narrowing) -> list[str]:
    """Uncertainty of the prediction, its sources, and the effect of the run on it."""
    before, after = found.stds
    share, shares = found.spread.shares.mean(), found.spread.shares
    takes = list(found.spread.known_takes().items())[:MOST_NAMED]
    named = ", ".join(f"{name} ({part:.0%})" for name, part in takes if part > SMALL_SHARE)
    moves = [(name, len(list(group))) for name, group in groupby(m.name for m in found.moves)]
    drive = ", ".join(f"{count} x {name}" if count > 1 else name for name, count in moves)
    said = [
        f"{share:.0%} of runs end as {found.goal}, ± {100 * before:.1f} points by the uncertainty "
        f"of the fits ({len(shares)} models drawn: {shares.min():.0%} to {shares.max():.0%}).",
        f"Share of that variance that each would remove if it were known exactly: {named}.",
        f"After a fit to this run of {found.rows.end_s:.0f} s it would be ± {100 * after:.1f} "
        f"points: {drive}.",
    ]
    if found.spread.foretold <= 0:
        said.append(
            f"No parameter was shown to matter: a regression on {len(shares)} models predicts "
            "another no better than their mean, so these points and this drive may be chance. Use "
            f"more {option('draws')} "
            f"and {option('seeds')}, or nothing here matters (twinmill swarm matters)."
        )
    if found.untold > SMALL_SHARE:
        said.append(
            f"{found.untold:.0%} of it cannot be measured by driving one robot: measure it apart."
        )
    return said
