# SPDX-License-Identifier: Apache-2.0
"""Imagined run: the robot drives some moves, and motion capture sees it."""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.log import CommandKind
from twinmill.data.measurement import Measurement
from twinmill.data.track import SILENCE_S, Timing, Track, command_at
from twinmill.experiment.moves import Move
from twinmill.model.parameters import CLOCK
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.residual import StepGrid

LEAD_S = 1.0  # stands before the first move, and as long after the last
BETWEEN_S = 0.5  # more than any clock offset: so much later the next of several starts begins
COLUMNS = {  # of a script: their names, how many are one of a track's, decimals
    "duty": (("fl_pct", "fr_pct", "rl_pct", "rr_pct"), 100, 0),
    "twist": (("vx_mps", "vy_mps", "omega_radps"), 1, 3),
}
SILENT = ("noise.sensor_m", "noise.sensor_rad", "noise.drive_mps", "noise.drive_radps")


@dataclass(frozen=True)
class Rows:
    """A script.

    Attributes:
        t_s: (K,) when each command begins.
        command: (K, 4) as in a track of this kind.
        end_s: when it ends.
        kind: of the commands.
    """

    t_s: np.ndarray
    command: np.ndarray
    end_s: float
    kind: CommandKind = "duty"


def rows_of(moves: list[Move], kind: CommandKind = "duty") -> Rows:
    """Moves one after the other, with a rest before and after; commands that change nothing go."""
    hold_s = np.concatenate([[LEAD_S], *(m.hold_s for m in moves), [LEAD_S]])
    command = np.vstack([np.zeros((1, 4)), *(m.command for m in moves), np.zeros((1, 4))])
    ends_s = np.cumsum(hold_s)
    fresh = np.append(True, np.any(command[1:] != command[:-1], axis=1))
    return Rows((ends_s - hold_s)[fresh], command[fresh], float(ends_s[-1]), kind)


def csv_text(rows: Rows) -> str:
    """The script as firmware and twin read it, or `robot characterise --script-as`.

    Rows `t_s,fl_pct,fr_pct,rl_pct,rr_pct` or `t_s,vx_mps,vy_mps,omega_radps`, each held until the
    next; the last one stops.
    """
    columns, scale, digits = COLUMNS[rows.kind]
    values = scale * rows.command[:, : len(columns)] + 0.0
    lines = [",".join(["t_s", *columns])]
    for t_s, row in zip(rows.t_s, values, strict=True):
        lines.append(",".join([f"{t_s:.3f}", *(f"{v:.{digits}f}" for v in row)]))
    return "\n".join([*lines, ",".join([f"{rows.end_s:.3f}", *["0"] * len(columns)]), ""])


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
    def of(cls, starts: list[list[Move]], like: ModelledLog) -> "Played":
        """Each start is a list of moves; clock, battery and rate of poses are the log's."""
        kind = like.measurement.track.command_kind
        parts = [rows_of(moves, kind) for moves in starts]
        lengths_s = [rows.end_s + BETWEEN_S for rows in parts]
        begins_s = np.cumsum([0.0, *lengths_s[:-1]])
        period_s = like.measurement.track.timing.pose_period_s
        offset_s = like.model.get(CLOCK)
        seen = [np.arange(b, b + r.end_s, period_s) for b, r in zip(begins_s, parts, strict=True)]
        rows = Rows(
            np.concatenate([b + r.t_s for b, r in zip(begins_s, parts, strict=True)]),
            np.concatenate([r.command for r in parts]),
            float(sum(lengths_s)),
            kind,
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

    def modelled(self, like: ModelledLog, start: np.ndarray) -> ModelledLog:
        """As if motion capture had seen the log's model drive; with the same noise.

        Telemetry tells the commands as often as in that log.
        """
        pose = self.path(like.model, start)
        old = like.measurement.track
        period_s = min(old.timing.command_period_s, SILENCE_S / 2)
        t_s = np.union1d(self.rows.t_s, np.arange(0.0, self.rows.t_s[-1], period_s))
        track = Track(
            robot_id=old.robot_id,
            command_kind=self.rows.kind,
            command_t_s=t_s,
            command=command_at(t_s, self.rows.t_s, self.rows.command),
            battery_V=np.full(len(t_s), self.battery_V),
            pose_t_s=self.pose_t_s,
            pose=pose,
            segment=self.part,
            heading_smooth=pose[:, 2],
            rest=np.zeros((0, 2)),
            timing=Timing(old.timing.pose_period_s, old.timing.command_period_s, 0.0),
            notes=[],
        )
        seen = Measurement("planned", "", track, [], 0)
        return replace(like, measurement=seen, grid=StepGrid.of(seen))

    def _track(self, pose: np.ndarray) -> native.Track:
        rows = self.rows
        return native.Track(
            np.ascontiguousarray(rows.t_s),
            np.ascontiguousarray(rows.command),
            np.full(len(rows.t_s), self.battery_V),
            np.ascontiguousarray(self.pose_t_s),
            np.ascontiguousarray(pose),
            np.ascontiguousarray(self.part, np.int64),
        )
