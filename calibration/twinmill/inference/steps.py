# SPDX-License-Identifier: Apache-2.0
"""Prediction errors over short steps of a log, and what happened during each step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import Track
from twinmill.model.parameters import CLOCK

STEP_S = 0.1  # shorter than the memories looked for, long against the time between poses
FEWEST = 10  # steps of a stretch: a shorter one has hardly a step that its start does not touch
STANDS = 1e-6  # m or rad in a step: an axis that is never driven, over which nothing is divided
BLOCK_S, FEWEST_BLOCKS = 8.0, 6  # blocks of time counted as independent, as in `predict.datasets`


class Steps:
    """Displacements over W steps that do not overlap, seen from the pose at each start.

    The covariance of their errors can be written down (`noise`): white noise of the poses enters as
    a difference, a disturbance of the velocity with its memory. Steps of several logs stand one
    after the other.

    Attributes:
        logs: of one robot, each with its steps.
        stretches: slices of steps that follow each other without a gap.
        t_s, step_s: (W,) middle and length of each step, on the capture's clock; a further log
            follows the one before it.
        place, heading: (W, 2) m and (W,) rad in the middle of each step.
        block: (W,) number of the block of time.
        observed: (3,) channels (forward, left, turn) that were measured.
    """

    def __init__(self, logs: Sequence["StepsOfLog"]) -> None:
        self.logs = logs
        self.step_s = np.concatenate([log.step_s for log in logs])
        self.place = np.concatenate([log.place for log in logs])
        self.heading = np.concatenate([log.heading for log in logs])
        self.observed = np.all([log.observed for log in logs], axis=0)
        first = np.cumsum([0, *(len(log.t_s) for log in logs)])
        self.stretches = [
            slice(part.start + begin, part.stop + begin)
            for log, begin in zip(logs, first, strict=False)
            for part in log.stretches
        ]
        length_s = min(BLOCK_S, sum(np.ptp(log.t_s) for log in logs) / FEWEST_BLOCKS)
        begin_s, block = logs[0].t_s[0], -1
        t_s, blocks = [], []
        for log in logs:
            span_s = log.t_s - log.t_s[0]
            t_s.append(span_s + begin_s)
            number = np.maximum(np.floor(span_s / length_s - 1e-9), 0).astype(int)
            blocks.append(number + block + 1)
            begin_s, block = t_s[-1][-1] + BLOCK_S, blocks[-1][-1]
        self.t_s, self.block = np.concatenate(t_s), np.concatenate(blocks)

    def __len__(self) -> int:
        return len(self.t_s)

    def errors(
        self, model: native.Model, names: Sequence[str] = (), values: np.ndarray | None = None
    ) -> np.ndarray:
        """(B, W, 3) m and rad measured less predicted, for B rows of values of named quantities.

        Without names (1, W, 3) of the model as it stands.
        """
        each = [log.errors(model, names, values) for log in self.logs]
        return np.concatenate(each, axis=1) * self.observed

    def predicted(self, model: native.Model) -> np.ndarray:
        """(W, 3) displacements in m and rad that a model predicts."""
        measured = np.concatenate([log.measured[:, 0] for log in self.logs])
        return measured - self.errors(model)[0]


class StepsOfLog:
    """Steps of one log; see `Steps`.

    Attributes:
        measurement: of the log.
        late_s: offset of its clocks over that of the model.
        own: quantities that the log has a value of its own of, as its wheels' angles at the start.
        starts, ends: (W,) poses at which steps start and end.
        measured: (W, 1, 3) displacements in m and rad.
    """

    def __init__(
        self,
        measurement: Measurement,
        late_s: float = 0.0,
        own: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self.measurement, self.late_s, self.own = measurement, late_s, own
        track = measurement.track
        self.starts, self.ends, self.stretches = _cut(track)
        start, end = track.pose[self.starts], track.pose[self.ends]
        self.t_s = (track.pose_t_s[self.starts] + track.pose_t_s[self.ends]) / 2
        self.step_s = track.pose_t_s[self.ends] - track.pose_t_s[self.starts]
        self.place = (start[:, :2] + end[:, :2]) / 2
        self.observed = np.array([True, True, track.has_heading])
        smooth_rad = track.heading_smooth[self.starts]
        self.heading = (start[:, 2] + end[:, 2]) / 2 if track.has_heading else smooth_rad
        self._start = np.column_stack([start[:, :2], smooth_rad])
        measured = np.column_stack([_ahead(end - start, smooth_rad), np.zeros(len(start))])
        if track.has_heading:  # from reading to reading, so that its noise is a difference as well
            measured[:, 2] = end[:, 2] - start[:, 2]
        self.measured = measured[:, None]

    def errors(
        self, model: native.Model, names: Sequence[str] = (), values: np.ndarray | None = None
    ) -> np.ndarray:
        """(B, W, 3) as of `Steps`."""
        names = list(names) or [CLOCK]
        values = np.array([[model.get(CLOCK)]]) if values is None else np.atleast_2d(values)
        values = np.array(values, float)
        if self.own:
            model = model.copy()
            for name, value in self.own.items():
                model.set(name, value)
        if self.late_s and CLOCK in names:
            values[:, names.index(CLOCK)] += self.late_s
        elif self.late_s:
            model = model.copy()
            model.set(CLOCK, model.get(CLOCK) + self.late_s)
        measured = self.measured.copy()
        found = native.window_errors(
            model,
            self.measurement.started,
            self.starts,
            self.ends[:, None].copy(),
            names,
            values,
            self._start,
            measured,
            np.ones_like(measured),
        )
        return found.reshape(len(values), len(self.t_s), 3)


def _cut(track: Track) -> tuple[np.ndarray, np.ndarray, list[slice]]:
    """Poses at which steps start and end, and the stretches of steps."""
    period_s = track.timing.pose_period_s
    every_s = max(1, round(STEP_S / period_s)) * period_s
    starts, ends, lengths = [], [], []
    for number in np.unique(track.segment[track.segment >= 0]):
        index = np.flatnonzero(track.segment == number)
        t_s = track.pose_t_s[index]
        grid_s = np.arange(t_s[0], t_s[-1], every_s)
        at = np.unique(index[np.searchsorted(t_s, grid_s - period_s / 2)])
        if len(at) > FEWEST:
            starts.append(at[:-1])
            ends.append(at[1:])
            lengths.append(len(at) - 1)
    edges = np.cumsum([0, *lengths])
    stretches = [slice(a, b) for a, b in pairwise(edges)]
    return (
        np.concatenate(starts).astype(np.int64),
        np.concatenate(ends).astype(np.int64),
        stretches,
    )


def _ahead(step: np.ndarray, heading_rad: np.ndarray) -> np.ndarray:
    """(W, 2) of (W, 3) displacements in W, seen along a heading."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    return np.column_stack([c * step[:, 0] + s * step[:, 1], c * step[:, 1] - s * step[:, 0]])


@dataclass(frozen=True)
class Motion:
    """Regressors of a dependence: W steps as the base predicts them.

    Attributes:
        moved: (W, 3) displacements forward, left, turn in m and rad.
        instant: (W, 3) displacements of the base without its motor lag.
        t_s, step_s, place, heading: of the steps, see `Steps`.
        usual: (3,) root mean square displacement of a step, of this log or of the base's own.
        top: (5,) largest displacement along each axis, in the plane, and of turning in a step.
    """

    moved: np.ndarray
    instant: np.ndarray
    t_s: np.ndarray
    step_s: np.ndarray
    place: np.ndarray
    heading: np.ndarray
    usual: np.ndarray
    top: np.ndarray

    @property
    def moves(self) -> np.ndarray:
        """(W,) 1 where the robot moves, 0 where it stands, linear between."""
        relative = np.abs(self.moved) / self.top[:3]
        return np.clip(relative.max(axis=1) / 0.1, 0.0, 1.0)

    @property
    def pace(self) -> np.ndarray:
        """(W,) how far the robot travels and turns in a step, over what is usual; mean square 1."""
        return np.sqrt(((self.moved / self.usual) ** 2).sum(axis=1) / 2)


def motion_of(
    steps: Steps,
    moved: np.ndarray,
    instant: np.ndarray,
    scale: tuple[np.ndarray, np.ndarray] | None = None,
) -> Motion:
    """The motion of a log; `scale` (usual, top) is that of the base's own log, if it is known."""
    return Motion(
        moved, instant, steps.t_s, steps.step_s, steps.place, steps.heading,
        *(scale or scale_of(moved)),
    )  # fmt: skip


def scale_of(moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) and (5,) `usual` and `top` of a `Motion`."""
    size = np.sqrt((moved**2).mean(axis=0))
    plane = np.hypot(size[0], size[1])
    way = np.hypot(moved[:, 0], moved[:, 1])
    top = [*np.abs(moved).max(axis=0), way.max(), np.abs(moved[:, 2]).max()]
    return np.maximum([plane, plane, size[2]], STANDS), np.maximum(top, STANDS)
