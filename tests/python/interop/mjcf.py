# SPDX-License-Identifier: Apache-2.0
"""MJCF: MuJoCo in C, its programs for JAX and Warp, and DeepMind's library above it."""

import math
import os
import re
from collections.abc import Callable
from pathlib import Path

from interop.cells import Told, writes
from interop.robot import BODY_RADIUS_M, DELAY_S, FORWARD_GAIN, LAG_S, MARKER_M, MASS_KG, write

FILE = "robot.mjcf"
SPEED_MPS = 0.2  # of every wheel's rim
STEPS_S = (0.002, 0.0005, 0.0001)
Step = Callable[[], float]  # makes a step of a straight drive, and tells the speed after it


def _write(folder: Path) -> None:
    write(folder, "mjcf")


@writes("MJCF", "MuJoCo", "mujoco-core==4.0.1", ours=_write)
def mujoco(folder: Path) -> Told:
    """The C library from Python."""
    import mujoco

    def begin(text: str) -> Step:
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        data.ctrl[:] = SPEED_MPS

        def step() -> float:
            mujoco.mj_step(model, data)
            return data.qvel[0]

        return step

    text = (folder / FILE).read_text()
    return _held_by(mujoco.MjModel.from_xml_string(text)) | _moves(text, begin)


@writes("MJCF", "dm_control", "dm_control==1.0.50", "mujoco==3.17.0", ours=_write)
def dm_control(folder: Path) -> Told:
    """PyMJCF, which reads the file by a schema of its own and hands on what it knows."""
    os.environ["MUJOCO_GL"] = "disabled"  # no display is asked for
    from dm_control import mjcf

    def begin(text: str) -> Step:
        physics = mjcf.Physics.from_mjcf_model(mjcf.from_xml_string(text))

        def step() -> float:
            physics.data.ctrl[:] = SPEED_MPS
            physics.step()
            return physics.data.qvel[0]

        return step

    text = (folder / FILE).read_text()
    physics = mjcf.Physics.from_mjcf_model(mjcf.from_xml_string(text))
    comment = "Not carried:" in mjcf.from_xml_string(text).to_xml_string()
    told = _held_by(physics.model.ptr) | _moves(text, begin) | {"the comment": comment}
    return told | {"two in an arena of composer": _drives_in_an_arena(text)}


def _drives_in_an_arena(text: str) -> bool:
    """The second of two is told to drive: it alone does, after its delay, at its speed."""
    from dm_control import composer, mjcf

    class Robot(composer.Entity):
        def _build(self, name: str) -> None:
            self._model = mjcf.from_xml_string(text)
            self._model.model = name

        @property
        def mjcf_model(self):
            return self._model

    arena = composer.Arena()
    first, second = Robot("R00"), Robot("R01")
    for k, robot in enumerate((first, second)):
        arena.attach(robot).pos = [0, k, 0]
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    physics.bind(second.mjcf_model.find_all("actuator")).ctrl = SPEED_MPS
    at, stands = (physics.bind(one.mjcf_model.find("joint", "x")) for one in (second, first))
    physics.step(round((DELAY_S - 0.002) / physics.timestep()))
    waits = abs(at.qvel.item()) < 1e-6
    physics.step(round(1 / physics.timestep()))
    moves = abs(at.qvel.item() / (FORWARD_GAIN * SPEED_MPS) - 1) < 0.001
    return waits and moves and abs(stands.qpos.item()) < 1e-6


@writes("MJCF", "MJX (JAX)", "mujoco-mjx==3.17.0", "jax==0.10.2", ours=_write)
def mjx(folder: Path) -> Told:
    """MuJoCo in JAX, on a CPU."""
    os.environ["JAX_PLATFORMS"] = "cpu"
    import jax
    import mujoco
    from mujoco import mjx

    def begin(text: str) -> Step:
        model = mujoco.MjModel.from_xml_string(text)
        there, move = mjx.put_model(model), jax.jit(mjx.step)
        data = mjx.put_data(model, mujoco.MjData(model))
        data = data.replace(ctrl=jax.numpy.full(model.nu, SPEED_MPS))

        def step() -> float:
            nonlocal data
            data = move(there, data)
            return float(data.qvel[0])

        return step

    text = (folder / FILE).read_text()
    return _held_by(mujoco.MjModel.from_xml_string(text)) | _moves(text, begin)


@writes("MJCF", "MuJoCo Warp", "mujoco-warp==4.0.0", "warp-lang==1.19.0", ours=_write)
def mujoco_warp(folder: Path) -> Told:
    """MuJoCo in Warp, on a CPU: that of a GPU is made of the same kernels."""
    import mujoco
    import mujoco_warp as mjw
    import numpy as np
    import warp

    warp.config.quiet = True

    def begin(text: str) -> Step:
        model = mujoco.MjModel.from_xml_string(text)
        there, data = mjw.put_model(model), mujoco.MjData(model)
        data = mjw.put_data(model, data)
        data.ctrl.assign(np.full((1, model.nu), SPEED_MPS, np.float32))

        def step() -> float:
            mjw.step(there, data)
            return float(data.qvel.numpy()[0, 0])

        return step

    text = (folder / FILE).read_text()
    return _held_by(mujoco.MjModel.from_xml_string(text)) | _moves(text, begin)


def _held_by(model) -> Told:
    """Facts in a model that MuJoCo compiled."""
    import numpy as np

    numbers = {model.numeric(i).name for i in range(model.nnumeric)}
    return {
        "mass": np.isclose(model.body_mass.sum(), MASS_KG),
        "hull": np.isclose(model.geom("hull").size[0], BODY_RADIUS_M),
        "marker": np.allclose(model.site("marker").pos[:2], MARKER_M),
        "camera": tuple(model.cam_resolution[0]) == (640, 480),
        "noise of poses, a number": np.isclose(model.sensor("position").noise[0], 0.0003),
        "tables in `<custom>`": {"duty_pct", "fl_rim_mps", "lag_s"} <= numbers,
    }


def _moves(text: str, begin: Callable[[str], Step]) -> Told:
    """Straight drive of the model beside algebra.

    It stands still for the delay, and has 1 - 1/e of its speed one lag later. The body settles a
    millisecond behind its wheels; a step more or less is allowed. With `actearly` it moves in the
    first step, without a delay.
    """
    end_mps = FORWARD_GAIN * SPEED_MPS
    told = {}
    for step_s in STEPS_S:
        step = begin(re.sub(r'timestep="[^"]*"', f'timestep="{step_s}"', text))
        course_mps = [step() for _ in range(round((DELAY_S + LAG_S) / step_s) + 1)]
        began_s = step_s * next(k for k, v in enumerate(course_mps) if abs(v) > 1e-6)
        share = course_mps[round((began_s + LAG_S) / step_s)] / end_mps
        told[f"delay, steps of {1000 * step_s:g} ms"] = abs(began_s - DELAY_S) < 1.5 * step_s
        lag = abs(share - (1 - 1 / math.e)) < (step_s + 0.002) / LAG_S
        told["lag"] = told.get("lag", True) and lag
        if step_s == STEPS_S[0]:
            told["speed"] = abs([step() for _ in range(300)][-1] / end_mps - 1) < 0.001
    told["`actearly`"] = begin(re.sub(r' (delay|nsample)="[^"]*"', "", text))() > 1e-6
    return told
