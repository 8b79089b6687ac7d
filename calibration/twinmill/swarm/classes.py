# SPDX-License-Identifier: Apache-2.0
"""Classes of a swarm's end state, their colours, and the aim of each behaviour."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binomtest

from twinmill.arguments import option
from twinmill.swarm.request import Request

if TYPE_CHECKING:  # `metrics` works where only sweeps' tables lack
    import pyarrow as pa

# Colours of Okabe and Ito (2008), told apart by colour-blind readers.
COLORS = {
    "milling": "#009e73",
    "ellipsoidal": "#f0e442",
    "cluster": "#d55e00",
    "separated": "#56b4e9",
    "jammed": "#a0a0a0",
    "undefined": "#e8e8e8",
}
WORDS = {
    "milling": "one steady ring",
    "ellipsoidal": "an uneven ring",
    "cluster": "one colliding group",
    "separated": "groups out of sight of each other",
    "jammed": "a ring that touches, or does not turn as one",
    "undefined": "too few robots",
}
# Aims beyond a class: nobody can reach another's view for all of the last 10 s.
DIFFUSED = "diffused"
# No evader came into a goal before a robot had touched it; of sweeps with a world.
KEPT_OUT = "kept-out"
GOALS = [*COLORS, DIFFUSED, KEPT_OUT]


def check_goal(name: str) -> str:
    """The name itself.

    Raises:
        ValueError: there is no such class; names the nearest.
    """
    if name in GOALS:
        return name
    near = difflib.get_close_matches(name, GOALS, n=1, cutoff=0.3)
    hint = f"; the nearest is '{near[0]}'" if near else ""
    raise ValueError(f"there is no class '{name}'{hint}. Classes: {', '.join(GOALS)}.")


def goal_of(request: Request) -> str:
    """Aim of the first species: to keep goals free, or the class that its name tells."""
    if request.has_goals:
        return KEPT_OUT
    return DIFFUSED if request.behavior.startswith(("diffusing", "disperse")) else "milling"


def reached(table: pa.Table, goal: str) -> np.ndarray:
    """(rows,) whether a run got there."""
    if goal == DIFFUSED:
        return table["least_diffusion"].to_numpy() > 1
    if goal == KEPT_OUT:
        if "reached_s" not in table.column_names:
            raise ValueError(
                f"{option('goal', goal)}: this sweep has no world; give twin_sweep one by --world."
            )
        return np.isnan(table["reached_s"].to_numpy())
    return np.array(table["class"].to_pylist()) == goal


def interval(count: int, of: int, exact: bool = False) -> tuple[float, float]:
    """95 % interval of a fraction: Wilson's, or that of Clopper and Pearson."""
    low, high = binomtest(int(count), int(of)).proportion_ci(method="exact" if exact else "wilson")
    return float(low), float(high)
