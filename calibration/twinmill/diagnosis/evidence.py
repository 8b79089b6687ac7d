# SPDX-License-Identifier: Apache-2.0
"""Rows of the logs beside columns of forms: how well each predicts stretches that are left out."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from twinmill.diagnosis.columns import Columns
from twinmill.diagnosis.library import LEFT_OVER, norms
from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.independence import (
    LONGEST,
    by_chance,
    following,
    fresh_of_blocks,
    told_before,
)
from twinmill.fitting.opening import Opened
from twinmill.fitting.score_fit import ScoreFit
from twinmill.formulas.forms import GAINS, Form, Motion, sized
from twinmill.predict.windows import HORIZONS_S

STRETCH_S = 8.0  # of one half, before one of the other
SIGN_S = 4.0  # errors so far apart have signs of their own
HORIZONS = (0, 2, 4)  # of HORIZONS_S: those between would choose the same


class Evidence:
    """Rows of the logs, whitened, and the columns of forms beside what is free.

    Free is what the fit had free, and the gains of the base: a form that is nearly a gain is worth
    what it says beside that gain, which goes back when the form is in the model.

    Rows whose window reaches from one stretch into the next are left out.

    Args:
        logs: place among the fit's data sets, and the log.
        motion: of the logs.
        fit: of the final model.
        changes: of all logs' rows by each of the library's terms.
    """

    def __init__(
        self,
        logs: Sequence[tuple[int, Opened]],
        motion: Motion,
        fit: ScoreFit,
        changes: Columns,
    ) -> None:
        self.logs, self.motion = logs, motion
        self.every_s = logs[0][1].data.every_s
        self._divide()
        rows, _ = fit.state
        weight = np.concatenate([np.sqrt(fit.weight(i, rows[i])) for i, _ in logs])
        left, free, _ = fit.whitened([i for i, _ in logs])
        # As many independent errors as if all horizons were there.
        self.more = np.sqrt(len(HORIZONS_S) / len(HORIZONS))
        self.weight = self.more * weight[self.kept]
        self._left, self._free = self.more * left[self.kept], self.more * free[self.kept]
        self._changes = changes
        self._free = np.hstack([self._free, self.raw(sized(GAINS, motion))])
        self.weighed(np.ones(len(self._left)))

    def _divide(self) -> None:
        """Divides the kept rows into stretches and blocks of one sign, with channels and begins."""
        kept, stretch, block, longest, begin_s = [], [], [], [], []
        self._inside = []  # (W, HORIZONS, 3) of each log: rows that are kept, of these horizons
        first_stretch = first_block = 0
        after_s = 0.0
        for _, own in self.logs:
            data = own.data
            shape = data.measured.shape
            t_s = data.measurement.track.pose_t_s
            start_s = data.start_s - data.start_s[0]
            end_s = t_s[np.maximum(data.windows.ends, 0)] - data.start_s[0]
            at, fine = (np.floor(start_s / s).astype(int) for s in (STRETCH_S, SIGN_S))
            inside = np.floor(end_s / STRETCH_S).astype(int) == at[:, None]
            counted = np.zeros(shape[1], bool)
            counted[list(HORIZONS)] = True
            kept.append(np.broadcast_to((inside & counted)[..., None], shape).ravel())
            self._inside.append(np.repeat(inside[:, list(HORIZONS), None], shape[2], axis=2))
            stretch.append(np.broadcast_to((first_stretch + at)[:, None, None], shape).ravel())
            block.append(np.broadcast_to((first_block + fine)[:, None, None], shape).ravel())
            last = np.arange(shape[1]) == LONGEST
            longest.append(np.broadcast_to(last[:, None], shape).ravel())
            begin_s.append(np.broadcast_to((start_s + after_s)[:, None, None], shape).ravel())
            after_s += start_s[-1] + STRETCH_S  # apart from what follows
            first_stretch, first_block = stretch[-1].max() + 1, block[-1].max() + 1
        self.kept = np.concatenate(kept)
        _, self.stretch = np.unique(np.concatenate(stretch)[self.kept], return_inverse=True)
        self.block = np.concatenate(block)[self.kept]
        self.longest = np.concatenate(longest)[self.kept]
        self.begin_s = np.concatenate(begin_s)[self.kept]
        channels = [3 * k + own.data.channel for k, (_, own) in enumerate(self.logs)]
        self.channel = np.concatenate(channels)[self.kept]
        edges = np.flatnonzero(np.diff(self.stretch, prepend=-1))
        self.parts = [slice(a, b) for a, b in pairwise([*edges, len(self.stretch)])]

    def fresh(self, own: np.ndarray, after: np.ndarray) -> float:
        """Share of the evidence of blocks with signs of their own that no block before tells.

        What so few pairs of predictions may show by chance counts as nothing: of a half with gaps
        there are fewer pairs than predictions.

        Args:
            own: (R,) bool, rows that are judged.
            after: (r,) what is left of these.
        """
        longest = self.longest[own]
        begin_s, window = np.unique(self.begin_s[own][longest], return_inverse=True)
        made = self.left[own] - after
        says = np.bincount(window, (made * after)[longest])
        (again,) = told_before((says - says.mean())[:, None], begin_s)
        _, pairs = following(begin_s)
        sure = again > by_chance(len(pairs) * self.every_s)
        return fresh_of_blocks(again if sure else 0.0, SIGN_S)

    def weighed(self, scale: np.ndarray) -> None:
        """Weighs each row (R,) anew."""
        self.scale = scale
        free = scale[:, None] * self._free
        self.basis = np.linalg.qr(free)[0] if free.shape[1] else np.zeros((len(free), 0))
        self.left = self.beside(self._left)

    def beside(self, columns: np.ndarray) -> np.ndarray:
        """(R,) or (R, K) as weighed, without what is free."""
        weighed = (self.scale * columns.T).T
        return weighed - self.basis @ (self.basis.T @ weighed)

    def raw(self, forms: Sequence[Form]) -> np.ndarray:
        """(R, K) columns of forms, whitened as the fit is; the library's stand before others."""
        known = [f.column for f in forms if f.column >= 0]
        made = forms[len(known) :]
        columns = np.empty((len(self._left), len(known) + sum(len(f.shapes) for f in made)))
        if known:
            kept = np.flatnonzero(self.kept)
            columns[:, : len(known)] = self._changes.some(np.array(known), kept)
        if made:
            columns[:, len(known) :] = self.motion.columns(made, self._inside)
        columns *= self.weight[:, None]
        return columns

    def of_all(self, changes: Sequence[np.ndarray]) -> np.ndarray:
        """(R, 1) raw column of (R,) changes of each log's rows."""
        return (self.weight * np.concatenate(list(changes))[self.kept])[:, None]

    def seen(self, raw: np.ndarray) -> np.ndarray:
        """Projects (R, K) raw columns off the free ones; zero where next to nothing is left."""
        return self._seen(raw)[0]

    def _seen(self, raw: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Projected columns, and (K,) lengths with the free ones projected out and without."""
        columns = self.scale[:, None] * raw
        before = norms(columns)
        along = self.basis.T @ columns
        for part in self.parts:  # which stays near the processor
            columns[part] -= self.basis[part] @ along
        after = norms(columns)
        lost = after <= LEFT_OVER * np.maximum(before, 1e-9)
        columns[:, lost] = after[lost] = 0.0
        return columns, before, after

    def lifted(self, raw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Projected columns at their full length, and (K,) factors by which they are longer.

        A number is unlikely if what is seen of it is large. Of a form that is nearly free little
        is seen, so that by its own size its number would be pulled to nothing.
        """
        columns, before, after = self._seen(raw)
        times = np.where(after > 0, before / np.maximum(after, 1e-12), 0.0)
        columns *= times
        return columns, times


@dataclass(frozen=True)
class Sums:
    """Sums for T forms, each with the columns beside: grams (S, T, k, k) and moments (S, T, k)."""

    grams: np.ndarray
    moments: np.ndarray

    @classmethod
    def of(cls, rows: Evidence, pool: "Pool", chosen: np.ndarray) -> "Sums":
        """By stretch, after those of (R, q) chosen raw columns; a second column may be zero."""
        (columns, _), (beside, _) = rows.lifted(pool.raw), rows.lifted(chosen)
        widths = np.array([len(f.shapes) for f in pool.forms])
        first = np.cumsum([0, *widths[:-1]])
        second = np.minimum(first + 1, columns.shape[1] - 1)
        there = widths == 2
        q = beside.shape[1]
        grams = np.zeros((len(rows.parts), len(widths), q + 2, q + 2))
        moments = np.zeros((len(rows.parts), len(widths), q + 2))
        known = np.column_stack([rows.left, beside])
        for k, part in enumerate(rows.parts):
            own, some = columns[part], known[part]
            square = np.einsum("rt,rt->t", own, own)
            cross = np.einsum("rt,rt->t", own[:, :-1], own[:, 1:])
            across, within = some.T @ own, some.T @ some
            gram, moment = grams[k], moments[k]
            moment[:, :q] = within[0, 1:]
            gram[:, :q, :q] = within[1:, 1:]
            moment[:, q], moment[there, q + 1] = across[0, first], across[0, second[there]]
            gram[:, q, q], gram[there, q + 1, q + 1] = square[first], square[second[there]]
            gram[there, q, q + 1] = gram[there, q + 1, q] = cross[first[there]]
            gram[:, :q, q] = gram[:, q, :q] = across[1:, first].T
            gram[there, :q, q + 1] = gram[there, q + 1, :q] = across[1:, second[there]].T
        return cls(grams, moments)

    def fitted(self, weight: np.ndarray) -> np.ndarray:
        """(T, k) numbers of (S,) weighted stretches."""
        gram = np.tensordot(weight, self.grams, 1) + np.eye(self.grams.shape[-1])
        return np.linalg.solve(gram, np.tensordot(weight, self.moments, 1)[..., None])[..., 0]

    def held_out(self, half: np.ndarray) -> np.ndarray:
        """(T,) fall of the cost on each stretch of a half, fitted to its others."""
        grams, moments = self.grams[half], self.moments[half]
        others = grams.sum(axis=0) - grams + np.eye(grams.shape[-1])
        numbers = np.linalg.solve(others, (moments.sum(axis=0) - moments)[..., None])
        left = 2 * moments[..., None] - grams @ numbers
        return np.einsum("stki,stki->t", numbers, left)

    def some(self, wanted: Sequence[int] | np.ndarray) -> "Sums":
        """Those of the forms of these numbers."""
        return Sums(self.grams[:, wanted], self.moments[:, wanted])

    def of_rows_that_weigh(self, times: float) -> "Sums":
        """Sums if all rows weighed so many times as much."""
        return Sums(times**2 * self.grams, times**2 * self.moments)


@dataclass(frozen=True)
class Pool:
    """Forms to choose from, and their raw (R, K) columns."""

    forms: Sequence[Form]
    raw: np.ndarray

    def some(self, wanted: Sequence[int] | np.ndarray) -> "Pool":
        """Those of these numbers."""
        place = np.cumsum([0, *(len(f.shapes) for f in self.forms)])
        own = np.concatenate([np.arange(place[k], place[k + 1]) for k in wanted])
        return Pool([self.forms[k] for k in wanted], self.raw[:, own])


@dataclass(frozen=True)
class Chosen:
    """Terms chosen on one half, their raw columns, and what they gain there on left-out parts."""

    forms: tuple[Form, ...]
    raw: np.ndarray
    gain: float

    @property
    def numbers(self) -> int:
        """Count of the numbers in all terms."""
        return sum(f.numbers for f in self.forms)

    @property
    def net(self) -> float:
        """Gain, less what numbers cost."""
        return self.gain - SETTINGS.each * self.numbers


@dataclass(frozen=True)
class Proof:
    """Chosen formula, the chance of its fall on the other half, and the share that it takes.

    Attributes:
        scale: (R,) weights of the rows with which it was chosen.
    """

    chosen: Chosen
    chance: float
    takes: float
    scale: np.ndarray


def fitted(rows: Evidence, chosen: Chosen, half: np.ndarray) -> np.ndarray:
    """(K,) numbers in usual strengths, of a half."""
    own = half[rows.stretch]
    columns, times = rows.lifted(chosen.raw)
    x, left = columns[own], rows.left[own]
    return times * np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ left)


def made(rows: Evidence, forms: Sequence[Form], half: np.ndarray, found: Chosen) -> Chosen:
    """The best of forms whose columns are not there yet."""
    known = sized(forms, rows.motion)
    return best_of(rows, Pool(known, rows.raw(known)), half, found) if known else found


def best_of(rows: Evidence, pool: Pool, half: np.ndarray, found: Chosen) -> Chosen:
    """The form of a pool that gains most on left-out stretches of a half beside what was found."""
    gains = Sums.of(rows, pool, found.raw).held_out(half)
    k = int(np.argmax(gains))
    one = pool.some([k])
    return Chosen((*found.forms, *one.forms), np.hstack([found.raw, one.raw]), float(gains[k]))
