# SPDX-License-Identifier: Apache-2.0
"""Cases with two logs to be predicted, and how well the truth itself predicts these.

The truth plays the commands of a log on the plant that made it, with what is hidden and what
happens by chance in it (when a wheel drops out, say), but without the disturbance of the motion
and without sensor noise. What its displacements miss is what no model could know.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twinmill.data.measurement import Measurement, load_measurements
from twinmill.experiment.drives import drive
from twinmill.predict.residual import rotate
from twinmill.predict.windows import HORIZONS_S, Windows, difference, rms
from twinmill_lab.challenge.cases import Case
from twinmill_lab.challenge.physics import STEP_S
from twinmill_lab.challenge.run import EPOCH_US, Plan, play, write_log

AHEAD_S = (0.5, 2.0)
UNSEEN_S = 45.0  # of a log that is predicted
# Another kind of drive than that of the log that is diagnosed.
OTHER = {"mixed": "joystick", "sorted": "joystick", "joystick": "mixed"}


@dataclass(frozen=True)
class Unseen:
    """A log that is predicted.

    Attributes:
        measurement: its poses and commands.
        windows: where predictions start and end.
        floor: (H, 3) RMS error of the truth's predictions, in m, m, rad.
    """

    measurement: Measurement
    windows: Windows
    floor: np.ndarray

    def over_truth(self, predicted: np.ndarray) -> list[float]:
        """RMS over channels of error over the truth's, at each of AHEAD_S.

        Args:
            predicted: (W, H, 3) displacements seen from the start.
        """
        wrong = rms(difference(self.windows.measured(self.measurement), predicted))
        ratio = np.sqrt(np.nanmean((wrong / self.floor) ** 2, axis=1))
        return [float(ratio[HORIZONS_S.index(ahead_s)]) for ahead_s in AHEAD_S]


def plans(case: Case, seed: int) -> Iterator[tuple[str, Plan]]:
    """The drives that are predicted: `same` in kind, and `other`."""
    robot = case.plan.robot
    for number, (label, style) in enumerate((("same", case.style), ("other", OTHER[case.style]))):
        random = np.random.default_rng([seed, 4, case.number, number])
        legs = drive(style, UNSEEN_S, robot.sideways, random)
        yield label, Plan(robot, legs, int(random.integers(2**31)))


def unseen(case: Case, seed: int, folder: Path) -> dict[str, Unseen]:
    """Both logs that are predicted; what takes long is kept in the folder."""
    return {
        label: _unseen(case, plan, folder / f"{label}.lcmlog") for label, plan in plans(case, seed)
    }


def _unseen(case: Case, plan: Plan, log: Path) -> Unseen:
    kept = log.with_suffix(".npy")
    if not kept.exists():
        motion = play(plan, case.hidden, forces=True)
        write_log(plan, motion, log)
        calm = play(plan, case.hidden, forces=True, calm=True).pose
        partly = kept.with_suffix(f".{os.getpid()}.npy")
        np.save(partly, calm)
        partly.rename(kept)
    (measurement,) = load_measurements([log])
    windows = Windows.of(measurement.track)
    true = _displacement(np.load(kept), _plant_s(measurement, plan), windows)
    floor = rms(difference(windows.measured(measurement), true))
    return Unseen(measurement, windows, floor)


def _plant_s(measurement: Measurement, plan: Plan) -> np.ndarray:
    """(N,) when the poses of a log were, on the plant's clock."""
    first_s = 1e-6 * (measurement.recorded_utime_us - EPOCH_US)
    return measurement.track.pose_t_s + first_s - plan.robot.offset_s


def _displacement(pose: np.ndarray, at_s: np.ndarray, windows: Windows) -> np.ndarray:
    """(W, H, 3) of a path in steps of STEP_S, seen from the start; NaN where the log ends."""
    steps_s = np.arange(len(pose)) * STEP_S
    path = np.column_stack([np.interp(at_s, steps_s, column) for column in pose.T])
    start = path[windows.starts][:, None]
    d = path[windows.ends] - start
    seen = np.stack([*rotate(d[..., 0], d[..., 1], -start[..., 2]), d[..., 2]], -1)
    seen[windows.ends < 0] = np.nan
    return seen
