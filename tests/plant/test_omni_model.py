# SPDX-License-Identifier: Apache-2.0
"""turbopi_omni.xml and turbopi.xml in MuJoCo as it comes. Truth: the ideal mecanum equations."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

MODELS = Path(__file__).parents[2] / "twin/models/turbopi"
WHEELS = ("fl", "fr", "rl", "rr")
RADIUS_M = 0.0325
# Places of the wheels, and the sign of each roller axis (1, s, 0) at the floor.
X_M, Y_M = 0.059 * np.array([1, 1, -1, -1]), 0.067 * np.array([1, -1, 1, -1])
SIDE = np.array([-1, 1, 1, -1])


def drive(scene, twist, timestep_s, duration_s=1.0):
    """Mean body velocity in the half second after `duration_s`, and MuJoCo's warnings."""
    model = mujoco.MjModel.from_xml_path(str(MODELS / scene))
    model.opt.timestep = timestep_s
    data = mujoco.MjData(model)
    vx, vy, omega = twist
    rates = (vx - Y_M * omega + SIDE * (vy + X_M * omega)) / RADIUS_M
    for name, rate in zip(WHEELS, rates, strict=True):
        data.ctrl[model.actuator(name).id] = rate
    seen = []
    while data.time < duration_s + 0.5:
        mujoco.mj_step(model, data)
        if data.time > duration_s:
            seen.append([*data.sensor("velocity").data[:2], data.sensor("turn").data[2]])
    return np.mean(seen, axis=0), sum(w.number for w in data.warning)


@pytest.mark.parametrize("timestep_s", [0.002, 0.005])
@pytest.mark.parametrize(
    "twist", [(0.3, 0, 0), (0, 0.3, 0), (0, 0, 2), (0.2, 0.2, 0), (0.15, -0.1, 1)]
)
def test_omni_model_moves_as_mecanum_wheels_do(twist, timestep_s):
    velocity, warnings = drive("scene_omni.xml", twist, timestep_s)
    lever_m = 0.059 + 0.067
    rim_mps = abs(twist[0]) + abs(twist[1]) + lever_m * abs(twist[2])
    miss_mps = np.abs(velocity - twist) * [1, 1, lever_m]
    assert np.max(miss_mps) < 0.01 * rim_mps
    assert warnings == 0


def test_without_the_plant_the_other_model_cannot_move_sideways():
    velocity, _ = drive("scene.xml", (0, 0.3, 0), 0.002)
    assert abs(velocity[1]) < 0.03
    velocity, _ = drive("scene.xml", (0.3, 0, 0), 0.002)
    assert velocity[0] == pytest.approx(0.3, rel=0.02)


def test_both_models_are_one_robot():
    one, other = (
        mujoco.MjModel.from_xml_path(str(MODELS / name)) for name in ("scene.xml", "scene_omni.xml")
    )
    assert mujoco.mj_getTotalmass(one) == pytest.approx(mujoco.mj_getTotalmass(other))
    named = [[m.sensor(i).name for i in range(m.nsensor)] for m in (one, other)]
    assert named[0] == named[1] == ["position", "orientation", "velocity", "turn", *WHEELS]
    assert [m.ncam for m in (one, other)] == [1, 1]


@pytest.mark.parametrize("scene", ["scene.xml", "scene_omni.xml"])
def test_home_is_a_robot_that_stands_still(scene):
    model = mujoco.MjModel.from_xml_path(str(MODELS / scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    names = ("free", "pan", "tilt", *WHEELS)
    assert [model.joint(i).name for i in range(model.njnt)] == list(names)
    while data.time < 1:
        mujoco.mj_step(model, data)
    home = model.key("home").qpos
    # It settles into the floor by a fraction of a millimetre, and does not creep, turn or tilt.
    assert np.max(np.abs(data.qpos[:7] - home[:7])) < 1e-3
    assert np.max(np.abs(data.qpos[7:] - home[7:])) < 0.02
