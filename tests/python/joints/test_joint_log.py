# SPDX-License-Identifier: Apache-2.0
"""Logs of joints: what is wrong with one is said in a sentence, and files hold what went in."""

import numpy as np
import pytest

from twinmill import JointLog, LogError, ModelError
from twinmill.joints.diagnose import plant_of
from twinmill.joints.files import read_joint_log
from twinmill.joints.mjcf import Mjcf

ARM = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="link">
      <joint name="elbow" axis="0 1 0" {joint}/>
      <geom size="0.1" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="drive" joint="elbow" ctrlrange="-2 2" ctrllimited="true" {motor}/>
  </actuator>
</mujoco>
"""
T_S = np.arange(400) * 0.01


def arm(tmp_path, joint="", motor=""):
    path = tmp_path / "arm.xml"
    limits = "" if "ball" in joint else 'range="-1.5 1.5" limited="true"'
    path.write_text(ARM.format(joint=f"{limits} {joint}", motor=motor))
    return Mjcf.load(path)


def log(ctrl=1.0, qpos=1.0, **names):
    return JointLog(T_S, ctrl * np.cos(T_S), qpos * np.sin(T_S), **names)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda: JointLog(T_S[::-1], T_S, T_S), "do not ascend in 399 places, first from 3.99 s"),
        (
            lambda: JointLog(T_S, T_S, np.where(T_S == 1, np.nan, T_S)),
            "1 of 400 rows, first at 1 s",
        ),
        (lambda: JointLog(T_S, T_S[1:], T_S), r"ctrl is of shape \(399,\)"),
        (lambda: JointLog(T_S[:20], T_S[:20], T_S[:20]), "has 20 samples, and 40 are the fewest"),
        (lambda: log(joints=["a", "b"]), "qpos has 1 columns, and there are 2 names"),
    ],
)
def test_bad_arrays_are_refused_in_a_sentence(given, said):
    with pytest.raises(LogError, match=said):
        given()


def test_a_log_that_does_not_fit_its_model_is_refused(tmp_path):
    for given, said in (
        (log(joints=["elbwo"]), "no joint 'elbwo'; the nearest is 'elbow'"),
        (log(actuators=["driver"]), "no actuator 'driver'; the nearest is 'drive'"),
        (log(qpos=80.0), "'elbow' reaches 80, beyond its range of -1.5 to 1.5 rad: these are deg"),
        (
            JointLog(T_S, T_S, np.column_stack([T_S, T_S])),
            r"has 2 joints, and the model 1 \(elbow\)",
        ),
    ):
        with pytest.raises(LogError, match=said):
            plant_of(given, arm(tmp_path))


def test_what_is_odd_about_a_log_is_told(tmp_path):
    late = T_S + 5.0 * (T_S > 2)
    given = JointLog(late, 3 * np.cos(T_S), 1.52 * np.sin(T_S), 57.3 * 1.52 * np.cos(T_S))
    said = " ".join(plant_of(given, arm(tmp_path))[1])
    for words in ("joint 'elbow' is beyond its range", "commands to 'drive'", "1 gaps", "qvel of"):
        assert words in said


@pytest.mark.parametrize(
    ("joint", "motor", "said"),
    [
        ('type="ball"', "", "neither a hinge nor a slide"),
        ("wrong=", "", "MuJoCo cannot load it"),
    ],
)
def test_models_that_are_not_judged_are_refused(tmp_path, joint, motor, said):
    with pytest.raises(ModelError, match=said):
        arm(tmp_path, joint, motor)


@pytest.mark.parametrize("suffix", ["npz", "csv"])
def test_files_hold_what_went_in_under_the_models_names(tmp_path, suffix):
    given = log(joints=["elbow"], actuators=["drive"])
    path = tmp_path / f"run.{suffix}"
    if suffix == "npz":
        given.saved(path)
    else:
        rows = np.column_stack([given.t_s, given.ctrl, given.qpos])
        np.savetxt(path, rows, "%.17g", ",", header="t_s,ctrl.drive,qpos.elbow", comments="")
    read = read_joint_log(path).ordered(["elbow"], ["drive"])
    for key in ("t_s", "ctrl", "qpos"):
        assert np.array_equal(getattr(read, key), getattr(given, key))


def test_a_table_of_other_columns_is_refused(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time,q\n0,1\n")
    with pytest.raises(LogError, match="no column 't_s'; its first are time, q"):
        read_joint_log(path)
