# SPDX-License-Identifier: Apache-2.0
"""A designed motion keeps limits in stock MuJoCo, and parts what it was designed to part."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from twinmill import LogError, diagnose_joints
from twinmill.joints import next as design
from twinmill.joints.diagnose import plant_of
from twinmill.joints.excitation import Limits, motion
from twinmill.joints.log import JointLog
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.next import next_joints

SLIDE = """<mujoco model="slide">
  <option timestep="0.002"/>
  <worldbody>
    <body name="carriage">
      <joint name="x" type="slide" axis="1 0 0" damping="10" frictionloss="3"
        range="-0.4 0.4" limited="true"/>
      <geom type="box" size=".1 .1 .1" mass="5"/>
    </body>
    {wall}
  </worldbody>
  <actuator>
    <{kind} name="drive" joint="x" {more}/>
  </actuator>
</mujoco>
"""
T_S = np.arange(0, 16, 0.004)


def carriage(tmp_path, kind="motor", more="", wall=""):
    path = tmp_path / "slide.xml"
    path.write_text(SLIDE.format(kind=kind, more=more, wall=wall))
    return path


def recorded(path, wanted, push=lambda v: 0.0):
    """A log of a controlled slide, its encoder with 20 um of noise."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, random = mujoco.MjData(model), np.random.default_rng(3)
    qpos, ctrl = np.zeros(len(T_S)), np.zeros(len(T_S))
    data.qpos[0] = wanted[0]
    for k in range(len(T_S)):
        qpos[k] = data.qpos[0] + 2e-5 * random.standard_normal()
        error = wanted[k] - data.qpos[0]
        data.ctrl[0] = ctrl[k] = 600 * error - 60 * data.qvel[0] if model.nu else 0.0
        for _ in range(2):
            data.qfrc_applied[0] = push(data.qvel[0])
            mujoco.mj_step(model, data)
    return JointLog(T_S, ctrl, qpos)


def motions(told):
    """Motions begun, of which a clock that gives each 2 s counts the time."""
    return sum(words.startswith("motion") for words in told)


def slow():
    """One speed alone, to and fro: friction is known, and not how it grows."""
    return 0.15 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * T_S / 4))


@pytest.mark.parametrize(("kind", "more"), [("motor", ""), ("position", 'kp="900" kv="60"')])
def test_motions_within_limits_keep_them_when_mujoco_runs_them(tmp_path, kind, more):
    path = carriage(tmp_path, kind, more)
    mjcf = Mjcf.load(path)
    log = recorded(carriage(tmp_path), slow())
    path = carriage(tmp_path, kind, more)
    plant, _ = plant_of(log, mjcf)
    limits = Limits.of(mjcf, plant.series, times_speed=2.0)
    stock, t_s = mujoco.MjModel.from_xml_path(str(path)), np.arange(0, 10, 0.01)
    kept = 0
    for seed in range(8):
        one = motion(mjcf, stock, limits, log.qpos[0], t_s=t_s, seed=seed)
        data = mujoco.MjData(stock)
        data.qpos[:] = one.log.qpos[0]
        within = True
        for k in range(len(t_s)):
            data.ctrl[:] = one.log.ctrl[k]
            assert one.log.qpos[k] == pytest.approx(data.qpos[0], abs=1e-9)
            for _ in range(5):
                mujoco.mj_step(stock, data)
            within &= abs(data.qpos[0]) <= 0.4 and abs(data.qvel[0]) < 1.1 * limits.speed[0]
        kept += not one.exceeds
        assert within or one.exceeds
    assert kept


def test_speeds_that_the_log_lacks_part_forms_of_friction(tmp_path, monkeypatch):
    """At one speed its forms are the same; algebra: c v and c v |v| are told by two speeds."""
    told: list[str] = []
    monkeypatch.setattr(design, "TRIED", 16)
    monkeypatch.setattr(design, "time", SimpleNamespace(monotonic=lambda: 2.0 * motions(told)))
    path = carriage(tmp_path, more='forcerange="-60 60" ctrlrange="-60 60"')
    log = recorded(path, slow(), push=lambda v: -8 * v)
    with threadpool_limits(1, "blas"):
        before = diagnose_joints(log, path).answer
        assert "viscous_friction@x" in before.findings[0].group
        found = next_joints(log, path, duration_s=16, times_speed=3, progress=told.append)
        wanted = np.interp(T_S, found.log.t_s, found.log.qpos[:, 0])
        again = recorded(path, wanted, push=lambda v: -8 * v)
        after = diagnose_joints([log, again], path).answer
    assert "motion 9 of 16, 16 s left" in told  # 8 more of 2 s each
    assert any("viscous_friction@x" in pair for pair in found.odds)
    assert max(found.odds.values()) > max(found.before.values())
    assert after.findings[0].effect == "viscous_friction@x"
    assert after.findings[0].certainty == "sure"
    value, std = after.findings[0].numbers["damping"]
    assert abs(value - 8) < 3 * std


def test_what_the_own_log_shows_is_no_question(tmp_path, monkeypatch):
    """One speed alone leaves viscous friction and drag a group; the own log told them apart."""
    monkeypatch.setattr(design, "TRIED", 4)
    path = carriage(tmp_path, more='forcerange="-60 60" ctrlrange="-60 60"')
    log = recorded(path, slow(), push=lambda v: -8 * v)
    lively = np.interp(T_S, np.arange(0, 17, 0.8), np.random.default_rng(1).uniform(-0.3, 0.3, 22))
    own = recorded(path, lively, push=lambda v: -8 * v)
    with threadpool_limits(1, "blas"):
        found = next_joints(log, path, own=own, duration_s=8, times_speed=3)
    assert found.diagnosis.always.effects == ("viscous_friction@x",)
    assert not found.to_json()["findings"]
    assert not any("viscous_friction@x" in pair and "drag@x" in pair for pair in found.odds)


def test_the_reason_is_told_where_no_motion_keeps_the_limits(tmp_path, monkeypatch):
    monkeypatch.setattr(design, "TRIED", 3)
    wall = '<geom name="wall" type="box" pos="0.1 0 0" size=".05 .5 .5"/>'
    path = carriage(tmp_path)
    log = recorded(path, slow(), push=lambda v: -8 * v)
    path = carriage(tmp_path, wall=wall.replace("<geom", '<geom margin="0" gap="0"'))
    with threadpool_limits(1, "blas"), pytest.raises(LogError) as error:
        next_joints(log, path, duration_s=5)
    assert "none of 3 motions of 5 s keeps the limits" in str(error.value)
    assert "'wall'" in str(error.value)
