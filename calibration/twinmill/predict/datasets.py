# SPDX-License-Identifier: Apache-2.0
"""Data sets that a model is fitted to and judged on.

The search sees a data set through `Dataset` alone. Two kinds have errors over a floor
(`ErrorDataset`), which `ScoreFit` fits: `Trajectory`, one robot in one log, and `SteadyStates`, one
robot of a table. The third, `Detections`, has draws with chances and no floor: `DetectionFit` fits
it by likelihood.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.model.parameters import CLOCK, Parameter, of_each_log
from twinmill.predict.windows import EVERY_S, HORIZONS_S, Windows, difference

BLOCK_S = 8.0  # errors of different blocks count as independent
FEWEST_BLOCKS = 6  # a shorter log has shorter blocks
PARTS = 6  # of the held-out score: each is predicted by a fit to the other five
INDEPENDENT_S = 2.0  # predictions that start so far apart share nothing


class Dataset(Protocol):
    """Attributes and methods that all kinds of data sets have."""

    @property
    def label(self) -> str:
        """Short name."""
        ...

    @property
    def robot_id(self) -> int:
        """Number of the robot."""
        ...

    @property
    def block(self) -> np.ndarray:
        """(R,) number of the block of each row; blocks count as independent."""
        ...


class ErrorDataset(Dataset, Protocol):
    """One that has errors over a floor."""

    @property
    def own(self) -> Sequence[Parameter]:
        """Quantities of this data set alone, as its clock or its robot's gains."""
        ...

    @property
    def by_run(self) -> bool:
        """True if its robot's own parameters are of this data set alone, not of its others."""
        ...

    @property
    def part(self) -> np.ndarray:
        """(R,) number of the part of the data with which each row is left out."""
        ...

    @property
    def channel(self) -> np.ndarray:
        """(R,) number of the channel that each row belongs to."""
        ...

    @property
    def judged(self) -> np.ndarray:
        """(R,) share of the squared score that each row would make up if all were 1."""
        ...

    @property
    def n_eff(self) -> np.ndarray:
        """(C,) number of independent errors of each channel."""
        ...

    def rows(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        """(B, R) errors over floor for B rows of values; squares add up to the score's."""
        ...

    def rows_by_part(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        """(R,) the same, each part by its own one of PARTS rows of values."""
        ...


@dataclass(frozen=True)
class Trajectory:
    """One robot in one log: predictions from measured poses, at all horizons.

    Attributes:
        measurement: of the robot.
        windows: where predictions start and end.
        measured: (W, H, 3) displacements seen from the start; m, m, rad.
        floor: (H, 3) errors that count as one; infinite where a channel is not judged.
        keep: (W,) bool: windows that are judged.
        own: see ErrorDataset.
        by_run: what its robot has of its own is of this log alone: its runs differ.
        first_part: part that the log begins with. Logs often begin alike, so that of several each
            begins with another one: else a drive of all of them is left out at once.
        every_s: between two starts.
        independent: (3,) share of the errors of each channel that are, as the floor tells.
    """

    measurement: Measurement
    windows: Windows
    measured: np.ndarray
    floor: np.ndarray
    keep: np.ndarray
    own: tuple[Parameter, ...] = ()
    first_part: int = 0
    every_s: float = EVERY_S
    independent: np.ndarray = field(default_factory=lambda: np.ones(3))
    by_run: bool = False
    weight: np.ndarray = field(init=False, repr=False)
    block: np.ndarray = field(init=False, repr=False)
    part: np.ndarray = field(init=False, repr=False)
    channel: np.ndarray = field(init=False, repr=False)
    judged: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        counted = np.isfinite(self.measured) & self.keep[:, None, None]
        count = counted.sum(axis=0)
        judged = np.isfinite(self.floor) & (count > 0)
        scale = np.where(judged, self.floor * np.sqrt(np.maximum(count, 1) * judged.sum()), np.inf)
        object.__setattr__(self, "weight", np.where(counted, 1 / scale, 0.0))
        block = np.floor((self.start_s - self.start_s[0]) / self.block_s).astype(int)
        object.__setattr__(self, "block", np.repeat(block, self.measured[0].size))
        object.__setattr__(self, "part", (self.block + self.first_part) % PARTS)
        object.__setattr__(self, "channel", np.arange(self.measured.size) % 3)
        # Each horizon of a channel counts alike, however many windows it has.
        share = counted / (np.maximum(count, 1) * max(judged.sum(), 1)) * judged
        object.__setattr__(self, "judged", share.reshape(-1))

    @classmethod
    def of(cls, measurement: Measurement) -> "Trajectory":
        """With a floor of one everywhere: to be given a floor by `over`."""
        return cls.at(measurement, Windows.of(measurement.track))

    @classmethod
    def at(cls, measurement: Measurement, windows: Windows) -> "Trajectory":
        """A trajectory of some windows alone."""
        measured = windows.measured(measurement)
        return cls(
            measurement,
            windows,
            measured,
            np.ones((len(HORIZONS_S), 3)),
            np.ones(len(measured), bool),
        )

    def over(self, floor: np.ndarray, keep: np.ndarray | None = None) -> "Trajectory":
        """A copy with another noise floor; channels that never move (0 or NaN) are not judged."""
        known = np.where(floor > 1e-9, floor, np.inf)
        return replace(self, floor=known, keep=self.keep if keep is None else keep)

    def with_own_start(self, model: native.Model) -> "Trajectory":
        """A copy with its own initial state: angles of wheels and phases of formulas that act."""
        known = {p.name for p in self.own}
        fresh = tuple(p for p in of_each_log(model) if p.name not in known)
        return replace(self, own=(*self.own, *fresh)) if fresh else self

    def thinned(self, every: int) -> "Trajectory":
        """A copy with every Nth start alone: overlapping predictions are redundant."""
        return replace(
            self,
            windows=self.windows.thinned(every),
            measured=self.measured[::every],
            keep=self.keep[::every],
            every_s=every * self.every_s,
        )

    @property
    def label(self) -> str:
        """Name of the log and number of the robot."""
        return self.measurement.label

    @property
    def robot_id(self) -> int:
        """Number of the robot in the log."""
        return self.measurement.track.robot_id

    @property
    def start_s(self) -> np.ndarray:
        """(W,) times at which predictions start, by the capture's clock."""
        return self.measurement.track.pose_t_s[self.windows.starts]

    @property
    def block_s(self) -> float:
        """Within which errors count as correlated: shorter where the log is short."""
        span_s = float(np.ptp(self.start_s))
        return min(BLOCK_S, max(span_s / FEWEST_BLOCKS, 1e-3))

    @property
    def covered_s(self) -> float:
        """Time in which predictions start."""
        return float(np.count_nonzero(self.keep)) * self.every_s

    @property
    def n_eff(self) -> np.ndarray:
        """See ErrorDataset."""
        judged = np.isfinite(self.floor).any(axis=0)
        return judged * self.independent * max(self.covered_s / INDEPENDENT_S, 1.0)

    def errors(self, model: native.Model) -> np.ndarray:
        """(W, H, 3) measured less predicted."""
        return difference(self.measured, self.windows.predicted(self.measurement, model))

    def rows(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        """See ErrorDataset."""
        windows, run = self.windows, self.measurement.started
        return native.window_errors(
            model, run, windows.starts, windows.ends, names, values, *self._displaced
        )

    def rows_by_part(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        """See ErrorDataset."""
        windows, run = self.windows, self.measurement.started
        part = self.part.reshape(len(windows.starts), -1)[:, 0].copy()
        (rows,) = native.window_errors(
            model, run, windows.starts, windows.ends, names, values, *self._displaced, part
        )
        return rows

    @cached_property
    def _displaced(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where predictions start, what was measured, and how much each error counts."""
        start = self.windows.seen_from(self.measurement.track)
        return start, np.ascontiguousarray(self.measured), self.weight

    def as_errors(self, rows: np.ndarray) -> np.ndarray:
        """(R,) rows to (W, H, 3) errors in m, m, rad; NaN where not judged."""
        weight = self.weight.reshape(-1)
        errors = np.where(weight > 0, rows / np.where(weight > 0, weight, 1), np.nan)
        return errors.reshape(self.measured.shape)

    def score(self, model: native.Model) -> float:
        """RMS over horizons and channels of error over floor."""
        return float(np.sqrt(np.sum((np.nan_to_num(self.errors(model)) * self.weight) ** 2)))


def errors_of(dataset: ErrorDataset, model: native.Model) -> np.ndarray:
    """(R,) errors over floor of a model as it is."""
    (rows,) = dataset.rows(model, [CLOCK], np.array([[model.get(CLOCK)]]))  # any name would do
    return rows


def total_score(parts: Sequence[float]) -> float:
    """Score of several data sets: the geometric mean of each one's, no less than 1 each.

    A fit of several minimises just this; a plain mean would let one disturbed log speak for all.
    """
    if len(parts) == 1:
        return float(parts[0])
    return float(np.exp(np.mean(np.log(np.maximum(parts, 1.0)))))
