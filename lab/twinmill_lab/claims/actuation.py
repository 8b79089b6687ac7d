# SPDX-License-Identifier: Apache-2.0
"""Measured speeds and turn rates: means and spread of the paper's table, beside a public one.

The paper gives each robot's mean over the mean of all at two inputs, to 0.01; their spread is the
theta_a of all runs here. A steady-state table has more robots and operating points.
"""

import numpy as np
from scipy.stats import chi2

from twinmill.arguments import option
from twinmill.data.steady_table import SteadyTable
from twinmill_lab.claims.rows import Claim, Row

# Of the paper: each robot's mean speed over the group's, by speed input, and the same computed once
# more from the means in its table.
PUBLISHED = {50: (1.00, 1.03, 0.97), 100: (1.05, 0.95, 1.00)}
RECOMPUTED = {50: (1.003, 1.028, 0.969), 100: (1.045, 0.952, 1.003)}
ROUNDED = 0.0051  # half a unit of the published digits
THETA_STD = 0.04
FEWEST = 2  # robots of which a spread is told
CHANNELS = ("speed", "turn rate")


def actuation(sheets: list[SteadyTable]) -> Claim:
    """The paper's factors, and the spread over robots at each input of a table, if there is one."""
    factors = np.concatenate([np.array(values) for values in PUBLISHED.values()])
    spread = float(factors.std(ddof=1))
    rows = [
        Row(
            f"factor of robot {robot} at input {at}",
            *(ours,) * 3,
            (theirs, theirs),
            bool(abs(ours - theirs) < ROUNDED),
            "recomputed from the table's means; published to 0.01",
        )
        for at, values in PUBLISHED.items()
        for robot, (ours, theirs) in enumerate(zip(RECOMPUTED[at], values, strict=True), 1)
    ]
    agrees = bool(abs(spread - THETA_STD) < 0.005)
    rule = "0.04 is their standard deviation; as a variance it would be 0.2"
    reference = (THETA_STD, THETA_STD)
    rows.append(Row("spread of all six factors", spread, spread, spread, reference, agrees, rule))
    measured = _spreads(sheets)
    rows += measured
    return Claim(
        "actuation",
        "Measured speeds and turns of the robots",
        "Robots differ: each one's mean speed over the group's, N(1, 0.04).",
        agrees,
        f"The published factors vary by {spread:.3f}. {_told(sheets, measured)}",
        rows,
        [],
    )


def _told(sheets: list[SteadyTable], measured: list[Row]) -> str:
    if not sheets:
        return (
            f"Without a table of measured robots ({option('actuation')}) nothing stands beside "
            "them."
        )
    straight, turning = (
        [row.value for row in measured if row.by["turns"] is turns] for turns in (False, True)
    )
    return (
        f"In the measured table of {len({s.robot_id for s in sheets})} robots the spread depends "
        f"on the operating point: {_range(straight)} straight, {_range(turning)} where they turn. "
        "One number for all points is not what was measured."
    )


def _spreads(sheets: list[SteadyTable]) -> list[Row]:
    """Relative standard deviation over robots, by input and channel."""
    by_input: dict[tuple, list[np.ndarray]] = {}
    for sheet in sheets:
        for at, value in zip(sheet.inputs.tolist(), sheet.value, strict=True):
            by_input.setdefault(tuple(at), []).append(value)
    rows = []
    for (speed, direction, turn), values in by_input.items():
        for name, of in zip(CHANNELS, np.abs(np.array(values)).T, strict=True):
            known = of[np.isfinite(of)]
            if len(known) < FEWEST or known.mean() < 0.05:
                continue
            spread = float(known.std(ddof=1) / known.mean())
            low, high = _spread_interval(spread, len(known))
            what = f"spread of {name}, {len(known)} robots: input {speed:g}, {direction:g} degrees"
            what += f", turn {turn:g}" if turn else ""
            by = {"turns": turn != 0}
            mean = f"mean {known.mean():.3g} {'m/s' if name == 'speed' else 'rad/s'}"
            rows.append(Row(what, spread, low, high, None, None, mean, "%", by))
    return rows


def _spread_interval(spread: float, count: int) -> tuple[float, float]:
    """95 % interval of a standard deviation of so many normal values: chi-squared."""
    free = count - 1
    low, high = (spread * np.sqrt(free / chi2.ppf(at, free)) for at in (0.975, 0.025))
    return float(low), float(high)


def _range(values: list[float]) -> str:
    if not values:
        return "nothing measured"
    return f"{100 * min(values):.0f} to {100 * max(values):.0f} %"
