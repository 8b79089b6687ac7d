# SPDX-License-Identifier: Apache-2.0
"""Readings of tables of steady speeds: one value of one robot at one input each."""

from collections.abc import Sequence
from copy import copy

import numpy as np
import twinmill_native as native

from twinmill.inference.steps import Motion, scale_of
from twinmill.predict.steady_states import SteadyStates


class Readings:
    """Readings over their floors, R of them; the steps of a table.

    Attributes:
        tables: each with its model's commands.
        observed: (1,) there is one channel.
        several: they are of several robots.
        block: (R,) number of the robot; of a single one that of the input.
        floor: (R,) standard deviation about the model of the kind of robot, in the reading's unit.
        zero: (R,) what was seen to stand, or not to turn.
        freedom: degrees of freedom of the floors: of several robots these beyond the first at each
            input, of a single one runs beyond the first.
    """

    def __init__(self, tables: Sequence[SteadyStates]) -> None:
        self.tables = tables
        self.observed = np.ones(1, bool)
        self.several = len({t.robot_id for t in tables}) > 1
        self._known = [np.isfinite(t.measured()) for t in tables]
        shapes = [k.shape for k in self._known]
        robots = [np.full(s, t.robot_id) for s, t in zip(shapes, tables, strict=True)]
        inputs = [np.broadcast_to(np.arange(s[0])[:, None], s) for s in shapes]
        own = self._of(robots if self.several else inputs)
        self.block = np.unique(own, return_inverse=True)[1]
        self.floor = self._of([t.floor() for t in tables])
        self.zero = self._of([t.measured() for t in tables]) == 0
        self.freedom = self._freedom()

    def __len__(self) -> int:
        return len(self.floor)

    def errors(
        self, model: native.Model, names: Sequence[str] = (), values: np.ndarray | None = None
    ) -> np.ndarray:
        """(B, R, 1) measured less predicted over floors, for B rows of values of named quantities.

        Without names (1, R, 1) of the model as it stands.
        """
        rows = np.zeros((1, 0)) if values is None else np.atleast_2d(values)
        each = [
            t.errors_with(self._own(model, t), names, rows)[:, known]
            for t, known in zip(self.tables, self._known, strict=True)
        ]
        return (np.concatenate(each, axis=1) / self.floor)[..., None]

    def weighed(self, weights: np.ndarray) -> "Readings":
        """Readings of which some tell less: their floors are wider by 1 over weights (R,)."""
        own = copy(self)
        own.floor = self.floor / weights
        return own

    def motion(self, model: native.Model) -> tuple[Motion, np.ndarray]:
        """The robots' motion at each reading, and (R, 3) change of the reading with it.

        The second in floors, for forward, left and turn in m/s, m/s, rad/s; on a bench the first
        of these is the wheel's speed in rad/s.
        """
        each = [t.motion(self._own(model, t)) for t in self.tables]
        moved, change = (self._of(own) for own in zip(*each, strict=True))
        zero, place = np.zeros(len(moved)), np.zeros((len(moved), 2))
        motion = Motion(moved, moved, zero, zero + 1, place, zero, *scale_of(moved))
        return motion, change / self.floor[:, None]

    def _freedom(self) -> int:
        sheets = [t.measurement for t in self.tables]
        if not self.several:
            return sum(int((s.runs - 1).sum()) for s in sheets)
        every = [(s.log_sha256, *row) for s in sheets for row in s.inputs.tolist()]
        return len(every) - len({*every})

    def _own(self, model: native.Model, table: SteadyStates) -> native.Model:
        """The model of one table's robot; of a single one the model has the numbers itself."""
        return model.for_robot(table.robot_id) if self.several else model

    def _of(self, each: Sequence[np.ndarray]) -> np.ndarray:
        """(R, ...) values of the readings, of (U, C, ...) for each table."""
        return np.concatenate([v[k] for v, k in zip(each, self._known, strict=True)])
