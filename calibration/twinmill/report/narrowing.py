# SPDX-License-Identifier: Apache-2.0
"""A run that narrows what a swarm is predicted to do, for the terminal."""

from itertools import groupby

from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.report.next_run import How
from twinmill.swarm.narrowing import Narrowing

NAMED = 4  # numbers that are told
SMALL = 0.05  # part of the variance


def terminal(found: Narrowing, how: How) -> RenderableType:
    """What a person reads; command lines stay whole, to be copied."""
    steps = [
        line
        for where, command in how.commands
        for line in (Text(where), Text(f"  {command}", no_wrap=True, overflow="ignore"))
    ]
    return Group(*map(Text, [*sentences(found), how.first]), *steps)


def sentences(found: Narrowing) -> list[str]:
    """What is open, why, and what the run does about it."""
    before, after = found.stds
    share, shares = found.spread.shares.mean(), found.spread.shares
    parts = [(name, part) for name, part in found.spread.parts().items() if abs(part) > SMALL]
    named = ", ".join(f"{name} ({part:.0%})" for name, part in parts[:NAMED])
    moves = [(name, len(list(group))) for name, group in groupby(m.name for m in found.moves)]
    drive = ", ".join(f"{count} x {name}" if count > 1 else name for name, count in moves)
    said = [
        f"{share:.0%} of runs end as {found.goal}; what the fits leave open makes that +- "
        f"{before:.0%} ({len(shares)} models drawn, {shares.min():.0%} to {shares.max():.0%}).",
        f"That hangs on {named}.",
        f"After this run of {found.rows.end_s:.0f} s it would be +- {after:.0%}: {drive}.",
    ]
    if found.untold > SMALL:
        said.append(
            f"{found.untold:.0%} of it no drive of one robot shows: measure that by itself."
        )
    return said
