# SPDX-License-Identifier: Apache-2.0
"""Picture of a nameless dependence: gain and push along what it depends on.

The posterior of its likeliest form is a function of the motion. In bins of time, heading, speed,
rate of turn, or cells of the floor, its displacements are fitted by a share of the base's own, and
what that leaves by a constant velocity, channel by channel; both are linear in the form's weights,
so that their standard deviations follow from the posterior (Rasmussen and Williams 2006, eq. 2.11).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinmill.inference.discrepancy import SIZES, TIME, Kernel
from twinmill.inference.search import Evidence, Search
from twinmill.inference.steps import Motion
from twinmill.model.parameters import catalogue_name

BINS = {TIME: 48, "place": 6}  # along what it depends on: about half of its shortest wave
OTHER_BINS, FEWEST = 16, 6  # of a turn, or up to the top speed; steps in a bin that tell a share
STILL = 0.05  # of the usual velocity: a channel that is slower in a bin tells no share


@dataclass(frozen=True)
class Unnamed:
    """A dependence beside the likeliest effects, in B bins.

    Attributes:
        word: what it depends on.
        form: its likeliest form.
        at: (B, D) middles of the bins: s, rad, m/s, rad/s, or two coordinates in m.
        gain, gain_std: (B, 3) relative error of forward, left, turn, and its standard deviation;
            NaN where the robot does not move that way.
        push, push_std: (B, 3) error of the velocity that is there besides, m/s and rad/s.
        usual: (3,) root mean square velocity, m/s and rad/s.
    """

    word: str
    form: str
    at: np.ndarray
    gain: np.ndarray
    gain_std: np.ndarray
    push: np.ndarray
    push_std: np.ndarray
    usual: np.ndarray

    def to_json(self) -> dict[str, Any]:
        """Fields of `rest.curve`, one row a bin."""
        rows = ("at", "gain", "gain_std", "push", "push_std")
        return {"form": self.form} | {name: getattr(self, name).tolist() for name in rows}


def likeliest(search: Search, kinds: Collection[str]) -> Evidence | None:
    """Evidence of the likeliest set of effects of some kinds; None if that was not fitted."""
    sets = [s for s in search.likely() if {*map(catalogue_name, s)} == {*kinds}]
    return search.fitted[sets[0]] if sets else None


def unnamed(
    search: Search, own: Evidence, motion: Motion, words: Sequence[str]
) -> tuple[Unnamed, ...]:
    """Each of some dependences, all in one model; left out is one that has no such picture.

    Args:
        search: that was answered.
        own: of the likeliest set of effects.
        motion: of its logs.
        words: dependences that are sure, or else the likeliest.
    """
    kernels, linear, told = search.problem.kernels, own.linear, []
    for word in words:
        forms = [f for f, kernel in enumerate(kernels) if kernel.depends_on == word]
        if forms:
            f, s, _ = own.likeliest(forms)
            white = SIZES[s] * own.white(search.view, f)
            at = np.arange(len(linear.mean), len(linear.mean) + len(white))
            told.append((kernels[f], float(SIZES[s]), at))
            linear = linear.with_columns(white)
    mean, cov = linear.mean, linear.covariance
    return tuple(
        _binned(kernel, motion, axis, mean=size * mean[at], cov=size**2 * cov[np.ix_(at, at)])
        for kernel, size, at in told
        if (axis := _axis(kernel.depends_on, motion)) is not None
    )


def _axis(word: str, m: Motion) -> np.ndarray | None:
    """(W, D) what the robot is at in each step; None of a word that has no such axis."""
    rate = m.moved / m.step_s[:, None]
    axes = {
        TIME: m.t_s - m.t_s[0],
        "heading": np.mod(m.heading, 2 * np.pi),
        "speed": np.hypot(rate[:, 0], rate[:, 1]),
        "coupling of turns": rate[:, 2],
        "place": m.place,
    }
    return axes[word].reshape(len(m.t_s), -1) if word in axes else None


def _binned(
    kernel: Kernel, m: Motion, axis: np.ndarray, *, mean: np.ndarray, cov: np.ndarray
) -> Unnamed:
    """Gain and push in each bin in which the robot was."""
    number, middles = _bins(axis, BINS.get(kernel.depends_on, OTHER_BINS))
    at, value, std, still = [], [], [], []
    usual = np.sqrt(np.mean(m.moved**2, axis=0))
    for b in np.unique(number):
        own = number == b
        if own.sum() < FEWEST:
            continue
        maps = [_fit(kernel.columns[:, own, c], m.moved[own, c], m.step_s[own]) for c in range(3)]
        at.append(middles[b])
        value.append([fit @ mean for fit in maps])
        std.append([np.sqrt(np.einsum("ak,kl,al->a", fit, cov, fit)) for fit in maps])
        still.append(np.sqrt(np.mean(m.moved[own] ** 2, axis=0)) < STILL * usual)
    values, stds = np.array(value).reshape(-1, 3, 2), np.array(std).reshape(-1, 3, 2)
    return Unnamed(
        kernel.depends_on,
        kernel.name,
        np.array(at).reshape(-1, axis.shape[1]),
        np.where(still, np.nan, values[..., 0]),
        np.where(still, np.nan, stds[..., 0]),
        values[..., 1],
        stds[..., 1],
        usual / float(np.median(m.step_s)),
    )


def _bins(axis: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(W,) number of the bin of each step, and (count^D, D) their middles."""
    low, width = axis.min(axis=0), np.maximum(np.ptp(axis, axis=0), 1e-9) / count
    cell = np.minimum((axis - low) // width, count - 1).astype(int)
    shape = (count,) * axis.shape[1]
    every = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=-1)
    return np.ravel_multi_index(tuple(cell.T), shape), low + (every + 0.5) * width


def _fit(columns: np.ndarray, moved: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """(2, K) share of the displacement that fits each of K columns (K, n), and mean of the rest."""
    gain = columns @ moved / max(moved @ moved, 1e-12)
    return np.stack([gain, (columns.sum(axis=1) - gain * moved.sum()) / step_s.sum()])
