# SPDX-License-Identifier: Apache-2.0
"""Pictures of a dependence without a name: gain and push along what it depends on."""

from typing import Any

import numpy as np

from twinmill.inference.unnamed import Unnamed
from twinmill.report.canvas import BEFORE, FLOOR, PREDICTED, draw, legend_above
from twinmill.report.html import Figure

CHANNELS = (("forward", PREDICTED), ("left", BEFORE), ("turn", FLOOR))
# Of what each error is: in words, its factor and unit on an axis, and the channels that have it.
ERRORS = {
    "gain": ("gain error (%)", (100.0, 100.0, 100.0), (0, 1, 2)),
    "push": ("velocity error (mm/s)", (1e3, 1e3, 0.0), (0, 1)),
    "spin": ("turn rate error (°/s)", (0.0, 0.0, float(np.degrees(1))), (2,)),
}
AXES = {
    "time": ("time (s)", 1.0),
    "heading": ("heading (°)", float(np.degrees(1))),
    "speed": ("speed (m/s)", 1.0),
    "coupling of turns": ("turn rate (°/s)", float(np.degrees(1))),
}
BAND = 2.0  # standard deviations
FAINT = 0.2  # of the largest relative error: smaller ones are not drawn
WIDEST = 0.5  # standard deviation of a gain: where the robot hardly moved it tells nothing


def figures(left: Unnamed) -> list[Figure]:
    """The dependence as curves, or as a map of the floor; none where no bin shows it."""
    shown = _shown(left)
    if not shown:
        return []
    return [_floor(left, shown) if left.at.shape[1] > 1 else _curves(left, shown)]


def _shown(left: Unnamed) -> dict[str, list[int]]:
    """Channels of each kind of error that are of a size with the largest."""
    size = {(kind, c): _relative(left, kind, c) for kind, own in ERRORS.items() for c in own[2]}
    least = FAINT * max(size.values())
    found: dict[str, list[int]] = {}
    for (kind, c), relative in size.items():
        if relative > least:
            found.setdefault(kind, []).append(c)
    return found


def _relative(left: Unnamed, kind: str, c: int) -> float:
    """Root mean square of an error over the bins, as a share of the channel's usual velocity."""
    value = _of(left, kind)[0][:, c]
    known = value[np.isfinite(value)]
    unit = 1.0 if kind == "gain" else max(float(left.usual[c]), 1e-9)
    return float(np.sqrt(np.mean(known**2))) / unit if len(known) else 0.0


def _of(left: Unnamed, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """(B, 3) errors and their standard deviations; NaN where a bin tells none."""
    if kind != "gain":
        return left.push, left.push_std
    told = left.gain_std < WIDEST
    return np.where(told, left.gain, np.nan), np.where(told, left.gain_std, np.nan)


def _curves(left: Unnamed, shown: dict[str, list[int]]) -> Figure:
    label, factor = AXES[left.word]

    def paint(panels: Any) -> None:
        for axes, (kind, channels) in zip(np.atleast_1d(panels), shown.items(), strict=True):
            value, std = _of(left, kind)
            words, factors, _ = ERRORS[kind]
            for c in channels:
                name, colour = CHANNELS[c]
                low, middle, high = (
                    factors[c] * (value[:, c] + k * std[:, c]) for k in (-BAND, 0, BAND)
                )
                at = factor * left.at[:, 0]
                axes.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
                axes.plot(at, middle, marker="o", ms=3, color=colour, label=name)
            axes.axhline(0, color="#3c3c3c", lw=1, ls="--")
            axes.set_ylabel(words)
            legend_above(axes, 3)
        np.atleast_1d(panels)[-1].set_xlabel(label)

    return Figure(
        draw(2.2 * len(shown), paint, nrows=len(shown), sharex=True),
        f"What is left, by {left.word}",
        f"The likeliest form ({left.form}): by how much the robot's motion exceeds the model's "
        "with what was found: as a share of it (gain), and what that leaves. Band: two standard "
        "deviations.",
    )


def _floor(left: Unnamed, shown: dict[str, list[int]]) -> Figure:
    """Map of the largest error."""
    pairs = [(kind, c) for kind, channels in shown.items() for c in channels]
    kind, c = max(pairs, key=lambda pair: _relative(left, *pair))
    words, factors, _ = ERRORS[kind]
    value = factors[c] * _of(left, kind)[0][:, c]

    def paint(axes: Any) -> None:
        most = float(np.nanmax(np.abs(value)))
        x, y = left.at.T
        dots = axes.scatter(x, y, c=value, s=260, marker="s", cmap="PuOr", vmin=-most, vmax=most)
        for at, error in zip(left.at, value, strict=True):
            if np.isfinite(error):
                axes.annotate(f"{error:.0f}", at, ha="center", va="center", fontsize=7)
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
        axes.figure.colorbar(dots, ax=axes, label=f"{CHANNELS[c][0]}: {words}", shrink=0.8)

    return Figure(
        draw(3.6, paint),
        "What is left, by place",
        f"The likeliest form ({left.form}): by how much the robot's motion exceeds the model's "
        "with what was found, in each part of the floor.",
    )
