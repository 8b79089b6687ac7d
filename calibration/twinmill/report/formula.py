# SPDX-License-Identifier: Apache-2.0
"""A formula for what is left, in words and drawn over the data."""

from collections.abc import Sequence

import numpy as np

from twinmill.arguments import option
from twinmill.diagnosis.forms import ANGLES
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.rest import Rest
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.taking import Taken
from twinmill.diagnosis.units import ADDS_TO, NAMES
from twinmill.report.canvas import MEASURED, PREDICTED, draw, legend_above
from twinmill.report.html import Figure

PARTS = {
    "motion": "share of all speeds",
    "travel": "share of the way",
    "aside": "share of the way led aside",
    "theta_rad": "heading, rad",
}
SIDES = 1.96  # standard errors: 95 %


def sentences(rest: Rest) -> list[str]:
    """What is said of a formula for what is left; that none holds, where something depends."""
    found = rest.proven
    if found:
        return [_said(found), _bounds(found)]
    if not rest.on or rest.share < SETTINGS.nothing_left:
        return []
    return [
        f"Something is left; it depends {rest.on}. No formula for it held on drives that it was "
        "not fitted to: more of this drive would tell."
    ]


def _said(found: Formula) -> str:
    what = f"In place of {' and '.join(found.instead_of)}" if found.instead_of else "What is left"
    like = f" In words: {found.like}." if found.like else ""
    return (
        f"{what}: {found.forms[0].adds_to} += {found.text}. On stretches that neither chose nor "
        f"fitted it, it takes {100 * found.takes:.0f} % of the squared error (p "
        f"{found.chance:.2g}, the best of {found.tried} forms).{like}"
    )


def taken(beyond: Taken | None) -> list[str]:
    """What is said of a formula that was to go into the model; nothing if there was none."""
    if not beyond:
        return []
    scores = f"{beyond.before:.2f} without it, {beyond.after:.2f} with it"
    if not beyond.kept:
        return [
            f"The formula that was proven is not in the model: {beyond.why_not} (held-out score "
            f"{scores})."
        ]
    instead = beyond.formula.instead_of
    place = f" in place of {' and '.join(instead)}" if instead else ""
    return [
        f"The model has a formula{place}, fitted together with the rest: {beyond.added.equals}. It "
        f"takes {100 * beyond.share:.0f} % of the squared error above the floor that was left "
        f"(held-out score {scores}). {_numbers(beyond.added)}"
        f" {option('formula', False)} leaves it out.",
        *([beyond.note] if beyond.note else []),
    ]


def _bounds(found: Formula) -> str:
    return f"{_numbers(found)} {100 * found.again:.0f} % of resamplings choose the same dependence."


def _numbers(found: Formula) -> str:
    """With their intervals, and where they were seen."""
    numbers = [
        f"{n.name or 'constant'} {n.value:.3g} ({n.low:.3g} to {n.high:.3g})"
        + ("" if n.unit in ("", "1") else f" {n.unit}")
        for n in found.numbers
    ]
    seen = [_range(name, low, high) for name, (low, high) in found.holds.items()]
    where = f" Seen at {', '.join(seen)}; beyond that it is a guess." if seen else ""
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

    def paint(axes) -> None:
        axes.errorbar(
            curve.at,
            curve.left,
            yerr=SIDES * curve.spread,
            fmt="o",
            ms=4,
            lw=1,
            color=MEASURED,
            label="what is left",
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
        "What the model with the findings leaves, in bins of the variable, with 95 % intervals, "
        "and what the formula adds there. A base refit may shift all points alike."
    )
    return [Figure(draw(2.4, paint), "The formula for what is left", caption)]
