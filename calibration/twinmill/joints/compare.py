# SPDX-License-Identifier: Apache-2.0
"""How far an MJCF, run by stock MuJoCo, goes from a log: over short windows, and over all of it."""

from dataclasses import dataclass
from pathlib import Path
from runpy import run_path
from typing import Any

import mujoco
import numpy as np

from twinmill.joints.diagnose import Logs, plant_of
from twinmill.joints.log import JointLog
from twinmill.joints.mjcf import Mjcf

WINDOW_S = 2.0  # as of the published answers on the EMPS benchmark
LEAST_S = 0.5  # of a window that is counted


@dataclass(frozen=True)
class JointComparison:
    """Errors of positions of a log's joints, measured less predicted.

    Attributes:
        joints, units: of the columns.
        window_rms: (J,) over windows, each begun from the measured state.
        free_rms: (J,) over the longest stretch of the log, run from its start by commands alone.
        warnings: what is odd about the log.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    window_rms: np.ndarray
    free_rms: np.ndarray
    warnings: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill compare --json` of an MJCF."""
        return {
            "joints": [
                {"joint": name, "unit": unit, "window_rms": window, "free_run_rms": free}
                for name, unit, window, free in zip(
                    self.joints,
                    self.units,
                    self.window_rms.tolist(),
                    self.free_rms.tolist(),
                    strict=True,
                )
            ],
            "window_s": WINDOW_S,
            "warnings": list(self.warnings),
        }


def compare_joints(log: Logs, model: Path | str, hook: Path | str | None = None) -> JointComparison:
    """Runs a log's commands through MuJoCo, and compares positions.

    Args:
        log: arrays, or a file of them; or several of one machine.
        model: path of the MJCF.
        hook: Python file of `explain_joints`, whose forces act as well.

    Raises:
        LogError: the log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.
    """
    mjcf = Mjcf.load(model)
    plant, warnings = plant_of(log, mjcf)
    own, series = plant.series.log, plant.series
    speed = np.column_stack([np.interp(own.t_s, series.t_s, v) for v in series.v.T])
    stock = mujoco.MjModel.from_xml_path(str(model))
    forces = run_path(str(hook))["add_forces"] if hook else None
    mujoco.set_mjcb_passive(forces)
    try:
        windows = [
            _run(stock, own, speed, part)
            for whole in own.stretches
            for part in _windows(own.t_s, whole)
        ]
        longest = max(own.stretches, key=lambda part: np.ptp(own.t_s[part]))
        free = _run(stock, own, speed, longest)
    finally:
        mujoco.set_mjcb_passive(None)
    every = np.concatenate(windows) if windows else free
    return JointComparison(mjcf.joints, mjcf.units, _rms(every), _rms(free), warnings)


def _rms(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt((errors**2).mean(axis=0)))


def _windows(t_s: np.ndarray, whole: slice) -> list[slice]:
    edges = np.searchsorted(t_s, np.arange(t_s[whole][0], t_s[whole][-1], WINDOW_S))
    ends = [*edges[1:], whole.stop]
    return [
        slice(a, b)
        for a, b in zip(edges, ends, strict=True)
        if b - a > 1 and t_s[b - 1] - t_s[a] >= LEAST_S
    ]


def _run(model: Any, log: JointLog, speed: np.ndarray, part: slice) -> np.ndarray:
    """(N, J) errors of a part of a log, from its first state on; a command holds until the next.

    Forces of a hook may depend on the time since the run began, which is MuJoCo's.
    """
    data, stamps = mujoco.MjData(model), log.since_s[part]
    data.time = stamps[0]
    data.qpos[:], data.qvel[:] = log.qpos[part][0], speed[part][0]
    step_s, out = float(model.opt.timestep), np.zeros_like(log.qpos[part])
    for k in range(1, len(stamps)):
        data.ctrl[:] = log.ctrl[part][k - 1]
        while data.time + step_s / 2 < stamps[k]:
            mujoco.mj_step(model, data)
        # to the stamp, which is seldom a whole number of steps away
        rest = stamps[k] - data.time
        out[k] = log.qpos[part][k] - (data.qpos + rest * data.qvel)
    return out
