# SPDX-License-Identifier: Apache-2.0
"""What a robot would do and what motion capture would see, had it already driven some moves."""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import Timing, Track
from twinmill.experiment.moves import Move
from twinmill.model.parameters import CLOCK
from twinmill.predict.problem import Scene
from twinmill.predict.residual import StepGrid

LEAD_S = 1.0  # stands before the first move, and as long after the last
BETWEEN_S = 0.5  # more than any clock offset: so much later the next of several starts begins
SILENT = ("noise.sensor_m", "noise.sensor_rad", "noise.drive_mps", "noise.drive_radps")


@dataclass(frozen=True)
class Rows:
    """A script: (K,) s at which each duty begins, and (K, 4) duties, -1..1; it ends at end_s."""

    t_s: np.ndarray
    duty: np.ndarray
    end_s: float


def rows_of(moves: list[Move]) -> Rows:
    """Moves one after the other, with a rest before and after; commands that change nothing go."""
    hold_s = np.concatenate([[LEAD_S], *(m.hold_s for m in moves), [LEAD_S]])
    duty = np.vstack([np.zeros((1, 4)), *(m.duty for m in moves), np.zeros((1, 4))])
    ends_s = np.cumsum(hold_s)
    fresh = np.append(True, np.any(duty[1:] != duty[:-1], axis=1))
    return Rows((ends_s - hold_s)[fresh], duty[fresh], float(ends_s[-1]))


def csv_text(rows: Rows) -> str:
    """The script as firmware and twin read it.

    Rows `t_s,fl_pct,fr_pct,rl_pct,rr_pct`, each held until the next; the last one stops.
    """
    lines = ["t_s,fl_pct,fr_pct,rl_pct,rr_pct"]
    for t_s, duty in zip(rows.t_s, rows.duty, strict=True):
        lines.append(",".join([f"{t_s:.3f}", *(f"{100 * d:.0f}" for d in duty + 0.0)]))
    return "\n".join([*lines, f"{rows.end_s:.3f},0,0,0,0", ""])


@dataclass(frozen=True)
class Played:
    """Commands of one or several starts on one time axis, and when poses of them are seen.

    Attributes:
        rows: commands.
        part: (N,) which start each pose belongs to.
        pose_t_s: (N,) capture's clock.
        battery_V: as in the log before.
    """

    rows: Rows
    part: np.ndarray
    pose_t_s: np.ndarray
    battery_V: float

    @classmethod
    def of(cls, starts: list[list[Move]], like: Scene) -> "Played":
        """Each start is a list of moves; clock, battery and rate of poses are the scene's."""
        parts = [rows_of(moves) for moves in starts]
        lengths_s = [rows.end_s + BETWEEN_S for rows in parts]
        begins_s = np.cumsum([0.0, *lengths_s[:-1]])
        period_s = like.measurement.track.timing.pose_period_s
        offset_s = like.model.get(CLOCK)
        seen = [np.arange(b, b + r.end_s, period_s) for b, r in zip(begins_s, parts, strict=True)]
        rows = Rows(
            np.concatenate([b + r.t_s for b, r in zip(begins_s, parts, strict=True)]),
            np.concatenate([r.duty for r in parts]),
            float(sum(lengths_s)),
        )
        part = np.repeat(np.arange(len(seen)), [len(s) for s in seen])
        battery_V = float(np.median(like.measurement.track.battery_V))
        return cls(rows, part, np.concatenate(seen) + offset_s, battery_V)

    def path(self, model: native.Model, start: np.ndarray) -> np.ndarray:
        """(N, 3) poses without any noise, had each start begun at `start` (3,)."""
        quiet = model.copy()
        for name in SILENT:
            quiet.set(name, 0.0)
        return native.replica(quiet, self._track(np.tile(start, (len(self.part), 1))), 1)

    def scene(self, like: Scene, start: np.ndarray) -> Scene:
        """As if motion capture had seen the scene's model drive; with the same noise."""
        pose = self.path(like.model, start)
        old = like.measurement.track
        track = Track(
            old.robot_id,
            old.command_kind,
            self.rows.t_s,
            self.rows.duty,
            np.full(len(self.rows.t_s), self.battery_V),
            self.pose_t_s,
            pose,
            self.part,
            pose[:, 2],
            np.zeros((0, 2)),
            Timing(old.timing.pose_period_s, old.timing.command_period_s, 0.0, 0.0),
            [],
        )
        seen = Measurement("planned", "", track, self._track(pose), [], 0)
        return replace(like, measurement=seen, grid=StepGrid.of(seen))

    def _track(self, pose: np.ndarray) -> native.Track:
        rows = self.rows
        return native.Track(
            np.ascontiguousarray(rows.t_s),
            np.ascontiguousarray(rows.duty),
            np.full(len(rows.t_s), self.battery_V),
            np.ascontiguousarray(self.pose_t_s),
            np.ascontiguousarray(pose),
            np.ascontiguousarray(self.part, np.int64),
        )
