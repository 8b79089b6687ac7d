# SPDX-License-Identifier: Apache-2.0
"""Best-fitting periodic on/off disturbance.

The way within one bin of time is a column; any form that is there in some bins is a sum of these.
So thousands of periods, moments and parts cost little more than the bins do.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from twinmill.diagnosis.evidence import Evidence, Pool
from twinmill.diagnosis.settings import SETTINGS
from twinmill.formulas.forms import SHORTEST_S, Form, on_and_off, sized
from twinmill.formulas.term import TIME

BINS = 96
POINTS = 4  # of each bin, at which it is looked up whether a form is there
LONGEST = 1 / 2.5  # share of the time of all logs: what came but once more may be chance
PHASES = 24
PARTS = (0.2, 0.3, 0.4, 0.5)  # of a period; of a longer one the rest is that part
STEPS = 4  # a finer grid has so many to each side of the best, of the last one's step
FINER = (1.0, 0.2)
FIRST = 0.6  # share of a log that must predict the rest


def comes_again(rate: float, span: float) -> bool:
    """True if a wave has enough periods along a name of the motion not to be chance."""
    return rate * span * LONGEST > 2 * np.pi


@dataclass(frozen=True)
class Recurring:
    """Periodic forms that are tried over the logs of some evidence.

    Attributes:
        rows: of the logs.
    """

    rows: Evidence

    @cached_property
    def edges_s(self) -> np.ndarray:
        """(BINS + 1,) of bins of the time of all logs."""
        t_s = self.rows.motion.names["t"]
        return np.linspace(t_s.min(), t_s.max() + 1e-6, BINS + 1)

    @cached_property
    def raw(self) -> np.ndarray:
        """(R, BINS) raw columns of the way within each bin."""
        inside = [f"(t >= {a:.6f})*(t < {b:.6f})" for a, b in pairwise(self.edges_s)]
        return self.rows.raw([Form("motion", (text,), TIME, sizes=(1.0,)) for text in inside])

    @cached_property
    def first(self) -> np.ndarray:
        """(K, 3) rates in rad/s, angles at time 0 and parts of a period that are tried first."""
        span_s = np.ptp(self.edges_s)
        low, high = 1 / (LONGEST * span_s), 1 / SHORTEST_S
        per_s = np.linspace(low, high, max(2, round((high - low) * 10 * span_s)))
        angles = np.linspace(0, 2 * np.pi, PHASES, endpoint=False)
        grid = np.meshgrid(2 * np.pi * per_s, angles, PARTS, indexing="ij")
        return np.stack([g.ravel() for g in grid], axis=1)

    @property
    def tried(self) -> int:
        """Candidates."""
        return len(self.first)

    @cached_property
    def _there(self) -> np.ndarray:
        return self._in_bins(self.first)

    def _in_bins(self, tried: np.ndarray) -> np.ndarray:
        """(K, BINS) share of each bin in which candidates are there."""
        inside = (np.arange(POINTS) + 0.5) / POINTS
        waves, which = np.unique(tried[:, :2], axis=0, return_inverse=True)
        level = np.cos(np.pi * tried[:, [2]]).astype(np.float32)
        share = np.zeros((len(tried), BINS), np.float32)
        for part in inside:
            t_s = self.edges_s[:-1] + part * np.diff(self.edges_s)
            wave = np.sin((waves[:, [0]] * t_s + waves[:, [1]]).astype(np.float32))
            share += wave[which.ravel()] > level
        return share / np.float32(POINTS)

    def best(self, half: np.ndarray) -> Pool:
        """The one form that takes most on (S,) stretches of a half, as the rows are weighed."""
        own = half[self.rows.stretch]
        columns = self.rows.seen(self.raw)[own]
        gram = (columns.T @ columns).astype(np.float32)
        moment = (columns.T @ self.rows.left[own]).astype(np.float32)

        def most(tried: np.ndarray, there: np.ndarray) -> np.ndarray:
            taken = (there @ moment) ** 2
            return tried[np.argmax(taken / (np.einsum("kb,kb->k", there @ gram, there) + 1e-3))]

        best = most(self.first, self._there)
        for part in FINER:
            near = self._near(best, part)
            best = most(near, self._in_bins(near))
        forms = sized([on_and_off(*best)], self.rows.motion)
        return Pool(forms, self.rows.raw(forms))

    def goes_on(self, raw: np.ndarray) -> bool:
        """True if a form fitted to the first part of a log predicts the rest.

        Moments of chance do not come again by a clock, and waves that were fitted to them do not
        go on. Of several logs it is not asked: they tell it by themselves.

        Args:
            raw: (R, 1) raw column of the form that all of it told.
        """
        if len(self.rows.logs) > 1:
            return False
        count = len(self.rows.parts)
        early = np.arange(count) < FIRST * count
        columns = self.rows.seen(np.hstack([self.best(early).raw, raw]))
        before = early[self.rows.stretch]
        left, later = self.rows.left[~before], columns[~before]
        known = columns[before, 0]
        size = known @ self.rows.left[before] / max(known @ known, 1e-9)
        gain = size * (2 * later[:, 0] @ left - size * later[:, 0] @ later[:, 0])
        most = (later[:, 1] @ left) ** 2 / max(later[:, 1] @ later[:, 1], 1e-9)
        return bool(gain > max(SETTINGS.likely, SETTINGS.formula_goes_on * most))

    def _near(self, best: np.ndarray, part: float) -> np.ndarray:
        """(K, 3) candidates around one."""
        span_s, middle_s = np.ptp(self.edges_s), self.edges_s.mean()
        steps = part * np.arange(-STEPS, STEPS + 1) / STEPS
        rates = best[0] + 2 * np.pi * 0.1 / span_s * steps
        turns = 2 * np.pi / PHASES * steps
        parts = np.clip(best[2] + 0.1 * steps, 0.08, 0.5)
        grid = np.meshgrid(rates, turns, parts, indexing="ij")
        found = np.stack([g.ravel() for g in grid], axis=1)
        found[:, 1] += best[1] - (found[:, 0] - best[0]) * middle_s  # turned about the middle
        return found
