# SPDX-License-Identifier: Apache-2.0
"""MJCF: MuJoCo in C, its JAX and Warp programs, and DeepMind's library above it."""

import re
from pathlib import Path

from interop.cells import Told, writes
from interop.robot import (
    BODY_RADIUS_M,
    DELAY_S,
    FORWARD_GAIN,
    LAG_S,
    MARKER_M,
    MASS_KG,
    write,
)

SPEED_MPS = 0.2  # of every wheel's rim
STEPS_S = (0.002, 0.0005, 0.0001)
FILE = "robot.mjcf"


def _write(folder: Path) -> None:
    write(folder, "mjcf")


def _with_step(text: str, step_s: float) -> str:
    """The file as a user makes it finer or coarser."""
    return re.sub(r'timestep="[^"]*"', f'timestep="{step_s}"', text)


@writes("MJCF", "MuJoCo", "mujoco-core==4.0.1", ours=_write)
def mujoco(folder: Path) -> Told:
    """The C library from Python."""
    import mujoco

    text = (folder / FILE).read_text()
    told = _held_by(mujoco.MjModel.from_xml_string(text))
    for step_s in STEPS_S:
        model = mujoco.MjModel.from_xml_string(_with_step(text, step_s))
        data = mujoco.MjData(model)
        data.ctrl[:] = SPEED_MPS

        def speed_mps(model=model, data=data) -> float:
            mujoco.mj_step(model, data)
            return data.qvel[0]

        told |= _moves_by(speed_mps, step_s)
    return told


def _held_by(model) -> Told:
    """What stands in a model that MuJoCo compiled."""
    import numpy as np

    site = model.site("marker").pos[:2]
    numbers = {model.numeric(i).name for i in range(model.nnumeric)}
    return {
        "mass": np.isclose(model.body_mass.sum(), MASS_KG),
        "hull": np.isclose(model.geom("hull").size[0], BODY_RADIUS_M),
        "marker": np.allclose(site, MARKER_M),
        "camera": model.ncam == 1 and tuple(model.cam_resolution[0]) == (640, 480),
        "noise of poses, as a number": np.isclose(model.sensor("position").noise[0], 0.0003),
        "tables in `<custom>`": {"duty_pct", "fl_rim_mps", "lag_s"} <= numbers,
    }


def _moves_by(speed_mps, step_s: float) -> Told:
    """What a straight drive shows: `speed_mps` makes a step and tells the speed after it.

    It stands still for the delay, and has 1 - 1/e of its speed one lag later. The body settles a
    millisecond behind its wheels; a step more or less is allowed.
    """
    import math

    course = [speed_mps() for _ in range(round((DELAY_S + 10 * LAG_S) / step_s))]
    began_s = step_s * next(k for k, v in enumerate(course) if abs(v) > 1e-6)
    end_mps = FORWARD_GAIN * SPEED_MPS
    share = course[round((began_s + LAG_S) / step_s)] / end_mps
    return {
        f"delay at steps of {1000 * step_s:g} ms": abs(began_s - DELAY_S) < 1.5 * step_s,
        "lag": abs(share - (1 - 1 / math.e)) < (step_s + 0.002) / LAG_S,
        "speed": abs(course[-1] / end_mps - 1) < 0.001,
    }
