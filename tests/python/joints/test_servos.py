# SPDX-License-Identifier: Apache-2.0
"""Servos compute their force from a measured position: its noise explains nothing by itself.

MuJoCo's `mj_step` runs the robot, at a tenth of the model's step.
"""

import mujoco
import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from twinmill import JointLog, diagnose_joints
from twinmill.joints.diagnose import plant_of
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.series import lagged
from twinmill.joints.states import without_noise

# stiff and strongly damped, as MuJoCo Menagerie has a UR5e's wrist
WRIST = """<mujoco model="wrist">
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="hand">
      <joint name="wrist" axis="0 1 0" armature="0.1" damping="{damping}"/>
      <inertial mass="1.2" pos="0 0 0.1" diaginertia="0.003 0.003 0.002"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="wrist" kp="500" kv="{kv}"/>
  </actuator>
</mujoco>
"""
PERIOD_S, DURATION_S, KNOTS_S = 0.008, 24.0, 0.8


def simulated(seed, noise_rad, kv=100, damping=0.0):
    """A log of the wrist between poses, straight ways."""
    model = mujoco.MjModel.from_xml_string(WRIST.format(kv=kv, damping=damping))
    model.opt.timestep = 2e-4
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    t_s = np.arange(0, DURATION_S, PERIOD_S)
    knots = np.arange(0, DURATION_S + 2 * KNOTS_S, KNOTS_S)
    ctrl = np.interp(t_s, knots, random.uniform(-0.8, 0.8, len(knots)))
    qpos = np.empty(len(t_s))
    data.qpos[0] = ctrl[0]
    for k in range(len(t_s)):
        qpos[k] = data.qpos[0]
        data.ctrl[0] = ctrl[k]
        for _ in range(40):
            mujoco.mj_step(model, data)
    return JointLog(t_s, ctrl, qpos + noise_rad * random.standard_normal(len(t_s)))


@pytest.fixture
def wrist(tmp_path):
    path = tmp_path / "wrist.xml"
    path.write_text(WRIST.format(kv=100, damping=0.0))
    return path


def test_a_servo_that_lacks_nothing_raises_no_alarm(wrist):
    with threadpool_limits(1, "blas"):
        found = diagnose_joints(simulated(1, 2e-4), wrist).answer
    assert not found.findings and found.verdict in ("model_adequate", "cannot_tell")


def test_a_run_leaves_nothing_of_a_servo_whose_ways_have_corners(wrist):
    """Without noise: less than a fiftieth of the momentum that its forces pass on in a step."""
    plant, _ = plant_of(simulated(4, 0.0), Mjcf.load(wrist))
    left = plant.errors(plant.begin()) * plant.usual.slides
    assert np.sqrt((left**2).mean()) < 0.02 * plant.usual.load * plant.series.step_s[0]


def test_what_is_no_noise_is_found_again():
    """A lag's answer to white forces at a tenth of the rate, with as much noise: most is gone."""
    random = np.random.default_rng(5)
    t_s = np.arange(4000) * 0.01
    smooth = lagged(lagged(random.standard_normal(4000), 0.2, 0.01), 0.2, 0.01)
    smooth *= 1 / np.std(smooth)
    found, slope = without_noise(t_s, (smooth + random.standard_normal(4000))[:, None], t_s)
    assert np.std(found[:, 0] - smooth) < 0.35
    assert np.corrcoef(slope[:, 0], np.gradient(smooth, t_s))[0, 1] > 0.7
    none, _ = without_noise(t_s, random.standard_normal((4000, 1)), t_s)
    assert np.std(none) < 0.05
