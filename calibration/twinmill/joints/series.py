# SPDX-License-Identifier: Apache-2.0
"""States and commands of a log on a fine grid, and changes of velocity over steps.

The velocity at the edge of a step is the slope of a straight line through the positions within half
a step on either side. It is a linear functional of the position, so that its change over a step is
an integral of the acceleration with a known weight: measured positions are compared with predicted
accelerations without one being differentiated twice, or the other smoothed otherwise (the weak
form; Messenger and Bortz 2021, J. Comput. Phys. 443). Windows of neighbouring edges touch and do
not overlap, so that white noise of positions is white noise of these velocities.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter
from scipy.sparse import block_diag, csr_matrix

from twinmill.data.lcm_log import LogError
from twinmill.joints.log import JointLog

STEP_S = 0.05  # about the time in which a servo settles
FEWEST = 8  # samples of a step: fewer give no slope
FINE = 5  # states within a step at which the acceleration is predicted
FEWEST_STEPS = 10  # of a stretch, and of a log
BLOCK_S, FEWEST_BLOCKS = 8.0, 6  # blocks of time counted as independent
DEGREE = 3  # of the polynomial through the positions about a state


@dataclass(frozen=True)
class Series:
    """n states of a log and W steps.

    Attributes:
        log: as recorded.
        t_s: (n,) times of states.
        q, v: (n, J) positions and velocities of joints, for what depends on them.
        seen_q, seen_v: the same from the positions of a step about each, for the base's prediction.
        width_s: (n,) time that a state stands for.
        mid_s, step_s: (W,) middle and length of each step.
        changes: (W, J) measured change of velocity.
        weights: (W, n) sparse: the same of accelerations (n, J).
        at: (W,) state in the middle of each step.
        stretches: slices of steps that follow each other without a gap.
        runs: slices of states of each run.
        block: (W,) number of the block of time.
    """

    log: JointLog
    t_s: np.ndarray
    q: np.ndarray
    v: np.ndarray
    seen_q: np.ndarray
    seen_v: np.ndarray
    width_s: np.ndarray
    mid_s: np.ndarray
    step_s: np.ndarray
    changes: np.ndarray
    weights: csr_matrix
    at: np.ndarray
    stretches: list[slice]
    runs: list[slice]
    block: np.ndarray
    _integral: np.ndarray = field(repr=False)

    @property
    def since_s(self) -> np.ndarray:
        """(n,) time of each state since its run began."""
        return np.concatenate([self.t_s[run] - self.t_s[run][0] for run in self.runs])

    def commands(self, delay_s: np.ndarray) -> np.ndarray:
        """(n, U) mean command to each actuator about each state, held from stamp to stamp."""
        out = np.empty((len(self.t_s), self.log.ctrl.shape[1]))
        half = self.width_s / 2
        for a, late_s in enumerate(delay_s):
            own = self.t_s - late_s
            out[:, a] = self._up_to(own + half, a) - self._up_to(own - half, a)
        return out / self.width_s[:, None]

    def _up_to(self, t_s: np.ndarray, a: int) -> np.ndarray:
        """Integral of a command up to some times; before the first and after the last it holds."""
        stamps, ctrl = self.log.t_s, self.log.ctrl[:, a]
        found = np.interp(t_s, stamps, self._integral[:, a])
        found += np.minimum(t_s - stamps[0], 0) * ctrl[0]
        return found + np.maximum(t_s - stamps[-1], 0) * ctrl[-1]


def series_of(log: JointLog) -> Series:
    """The states and steps of a log.

    Raises:
        LogError: it is too short.
    """
    step_s = max(STEP_S, FEWEST * log.period_s)
    fine = step_s / FINE
    parts = [_part(log, part, step_s, fine) for part in log.stretches]
    found = [part for part in parts if part is not None]
    if sum(len(p.changes) for p in found) < FEWEST_STEPS:
        raise LogError(
            f"{log.name}: has fewer than {FEWEST_STEPS + 2} steps of {step_s:g} s without a gap; "
            "record for longer."
        )
    rows = np.cumsum([0, *(len(p.changes) for p in found)])
    first = np.cumsum([0, *(len(p.t_s) for p in found)])
    mid_s = np.concatenate([p.mid_s for p in found])
    length_s = min(BLOCK_S, np.ptp(mid_s) / FEWEST_BLOCKS)
    t_s = np.concatenate([p.t_s for p in found])
    edges = [*np.searchsorted(t_s, log.t_s[[*log.begins]]), len(t_s)]
    q, v = (np.concatenate([getattr(p, name) for p in found]) for name in ("q", "v"))
    held = np.diff(log.t_s)[:, None] * log.ctrl[:-1]
    return Series(
        log,
        t_s,
        q,
        v,
        q,
        v,
        np.full(first[-1], fine),
        mid_s,
        np.full(len(mid_s), step_s),
        np.concatenate([p.changes for p in found]),
        _stacked([p.weights for p in found]),
        np.concatenate([p.at + begin for p, begin in zip(found, first, strict=False)]),
        [slice(a, b) for a, b in pairwise(rows)],
        [slice(int(a), int(b)) for a, b in pairwise(edges) if b > a],
        np.floor((mid_s - mid_s[0]) / length_s * (1 - 1e-9)).astype(int),
        np.concatenate([np.zeros((1, log.ctrl.shape[1])), np.cumsum(held, axis=0)]),
    )


@dataclass(frozen=True)
class _Part:
    """One stretch; as of `Series`."""

    t_s: np.ndarray
    q: np.ndarray
    v: np.ndarray
    mid_s: np.ndarray
    changes: np.ndarray
    weights: np.ndarray
    at: np.ndarray


def _part(log: JointLog, part: slice, step_s: float, fine_s: float) -> _Part | None:
    """The steps of a stretch; None where it is too short for any."""
    stamps, qpos = log.t_s[part], log.qpos[part]
    edges_s = np.arange(stamps[0] + step_s / 2, stamps[-1] - step_s / 2, step_s)
    if len(edges_s) <= FEWEST_STEPS:
        return None
    t_s = np.arange(stamps[0] + fine_s / 2, stamps[-1], fine_s)
    within = np.column_stack([edges_s - step_s / 2, edges_s + step_s / 2])
    slopes, before = zip(*(_edge(stamps, qpos, t_s, w) for w in within), strict=True)
    mid_s = (edges_s[1:] + edges_s[:-1]) / 2
    q, v = smoothed(stamps, qpos, t_s, step_s)
    return _Part(
        t_s, q, v, mid_s, np.diff(slopes, axis=0), -np.diff(before, axis=0) * fine_s,
        np.searchsorted(t_s, mid_s),
    )  # fmt: skip


def _edge(
    stamps: np.ndarray, qpos: np.ndarray, t_s: np.ndarray, within_s: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (J,) of positions in a window, and (n,) how much of it lies before each state.

    The slope is the mean of the velocity under a weight, which is constant between two samples.
    """
    low, high = np.searchsorted(stamps, within_s)
    own = stamps[low:high]
    pull = (own - own.mean()) / np.sum((own - own.mean()) ** 2)
    up_to = np.r_[0.0, np.cumsum(-np.cumsum(pull)[:-1] * np.diff(own))]
    return pull @ qpos[low:high], np.interp(t_s, own, up_to, left=0.0, right=1.0)


def smoothed(
    stamps: np.ndarray, qpos: np.ndarray, t_s: np.ndarray, width_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """(n, J) positions and velocities at some times, by polynomials through samples about each."""
    count = min(int(np.round(width_s / np.median(np.diff(stamps)))) + 1, len(stamps))
    first = np.clip(np.searchsorted(stamps, t_s) - count // 2, 0, len(stamps) - count)
    index = first[:, None] + np.arange(count)
    away = (stamps[index] - t_s[:, None]) / width_s
    powers = away[:, :, None] ** np.arange(DEGREE + 1)
    gram = np.einsum("nik,nil->nkl", powers, powers)
    push = np.einsum("nik,nij->nkj", powers, qpos[index])
    found = np.linalg.solve(gram, push)
    return found[:, 0], found[:, 1] / width_s


def lagged(u: np.ndarray, lag_s: float, step_s: float) -> np.ndarray:
    """Mean of a first-order lag's output over each of equal times, its input constant in each."""
    kept = np.exp(-step_s / lag_s)
    end, _ = lfilter([1 - kept], [1, -kept], u, zi=[kept * u[0]])
    before = np.r_[u[0], end[:-1]]
    return np.asarray(u + (before - u) * (lag_s / step_s) * (1 - kept))


def _stacked(parts: list[np.ndarray]) -> csr_matrix:
    """Block diagonal of blocks that are mostly zeros, which `block_diag` of dense ones stores."""
    return block_diag([csr_matrix(part) for part in parts], format="csr")
