# SPDX-License-Identifier: Apache-2.0
"""A formula for what is left, in words and drawn over the data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from twinmill.arguments import option
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.rest import Rest
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.taking import Taken
from twinmill.formulas.forms import ANGLES
from twinmill.formulas.units import ADDS_TO, NAMES
from twinmill.report.canvas import MEASURED, PREDICTED, draw, legend_above
from twinmill.report.html import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PARTS = {
    "motion": "share of all speeds",
    "travel": "share of the distance",
    "aside": "share of the distance that is deflected sideways",
    "theta_rad": "heading, rad",
}
SIDES = 1.96  # standard errors: 95 %


def sentences(rest: Rest) -> list[str]:
    """Sentences on a formula for the rest; that none holds, where something depends."""
    found = rest.proven
    if found:
        return [_said(found), _bounds(found)]
    if not rest.on or rest.share < SETTINGS.nothing_left:
        return []
    return [
        f"An error is unexplained; it depends {rest.on}. No formula for it held on held-out "
        "data: a longer log of such drives would settle it."
    ]


def _said(found: Formula) -> str:
    what = f"In place of {' and '.join(found.instead_of)}" if found.instead_of else "Unexplained"
    like = f" In words: {found.like}." if found.like else ""
    return (
        f"{what}: {found.forms[0].adds_to} += {found.text}. On data used neither to choose nor to "
        f"fit it, it removes {100 * found.takes:.0f} % of the squared error (p "
        f"{found.chance:.2g}; {found.tried} forms were candidates).{like}"
    )


def taken(beyond: Taken | None) -> list[str]:
    """Sentences on a formula that was to go into the model; none if there was none."""
    if not beyond:
        return []
    scores = f"{beyond.before:.2f} without it, {beyond.after:.2f} with it"
    if not beyond.kept:
        return [
            f"The validated formula is not in the model: {beyond.why_not} (held-out score "
            f"{scores})."
        ]
    instead = beyond.formula.instead_of
    place = f" in place of {' and '.join(instead)}" if instead else ""
    return [
        f"A formula was added{place}, fitted together with all else: {beyond.added.equals}. It "
        f"removes {100 * beyond.share:.0f} % of the unexplained squared error "
        f"(held-out score {scores}). {_numbers(beyond.added)}"
        f" {option('formula', False)} leaves it out.",
        *([beyond.note] if beyond.note else []),
    ]


def _bounds(found: Formula) -> str:
    again = f"{100 * found.again:.0f} % of bootstrap samples choose the same dependence."
    return f"{_numbers(found)} {again}"


def _numbers(found: Formula) -> str:
    """With their intervals, and where they were seen."""
    numbers = [
        f"{n.name or 'constant'} {n.value:.3g} ({n.low:.3g} to {n.high:.3g})"
        + ("" if n.unit in ("", "1") else f" {n.unit}")
        for n in found.numbers
    ]
    seen = [_range(name, low, high) for name, (low, high) in found.holds.items()]
    where = f" Seen at {', '.join(seen)}; beyond that it extrapolates." if seen else ""
    return f"Its numbers with 95 % intervals: {', '.join(numbers)}.{where}"


def _range(name: str, low: float, high: float) -> str:
    if name in ANGLES and high - low >= 2 * np.pi:
        return f"{name} all round"
    return f"{name} {low:.2g} to {high:.2g} {_unit(name)}".rstrip()


def _unit(name: str) -> str:
    if name in ANGLES:
        return "rad"
    return "rad/s" if name == "omega" else str(NAMES[name])


def figures(rest: Rest) -> Sequence[Figure]:
    """The formula over what is left, in bins of its variable; none without a formula."""
    if not rest.proven or not rest.proven.curve:
        return []
    found, curve = rest.proven, rest.proven.curve
    to = found.forms[0].adds_to

    def paint(axes: Axes) -> None:
        axes.errorbar(
            curve.at,
            curve.left,
            yerr=SIDES * curve.spread,
            fmt="o",
            ms=4,
            lw=1,
            color=MEASURED,
            label="residual",
        )
        order = np.argsort(curve.at)
        axes.plot(curve.at[order], curve.drawn[order], color=PREDICTED, label="formula")
        axes.axhline(0, color="#888888", lw=0.8)
        by = f" per {curve.carrier}" if curve.carrier else ""
        unit = "" if to in PARTS else f", {ADDS_TO[to]}" if not by else ""
        within = f" within {curve.period:.3g} {_unit(curve.name)}" if curve.period else ""
        axes.set(
            xlabel=f"{curve.name}{within}, {_unit(curve.name)}".rstrip(", "),
            ylabel=f"{PARTS.get(to, to.rpartition('_')[0])}{by}{unit}",
        )
        legend_above(axes, 2)

    caption = (
        "Residuals of the model with the findings, in bins of the variable, with 95 % intervals, "
        "and the formula. A refit of the base may shift all points alike."
    )
    return [Figure(draw(2.4, paint), "The formula for the residuals", caption)]
