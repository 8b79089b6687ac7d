# SPDX-License-Identifier: Apache-2.0
"""Results of joints as a person meets them: in a line, as text, as a table, in another process."""

import doctest
import json
import pickle
from functools import partial
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

import twinmill as tm
from twinmill import joint_results

PENDULUM = """<mujoco><option timestep="0.002"/><worldbody><body name="arm" pos="0 0 1">
<joint name="hinge" type="hinge" axis="0 1 0" damping="{damping}"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 -.4" mass=".5"/></body></worldbody>
<actuator><motor name="motor" joint="hinge" ctrlrange="-2 2" forcerange="-2 2"/></actuator>
</mujoco>"""
PUBLIC = [name for name in tm.__all__ if getattr(tm, name).__module__ == joint_results.__name__]


@pytest.fixture(scope="module")
def joint_log() -> tm.JointLog:
    """The pendulum in stock MuJoCo with a damping of 0.06 N m s/rad, where its file says 0.02."""
    model = mujoco.MjModel.from_xml_string(PENDULUM.format(damping=0.06))
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    told = np.repeat(random.uniform(-1, 1, 60), 50)
    qpos = np.zeros(len(told))
    for k, own in enumerate(told):
        qpos[k] = data.qpos[0] + random.normal(0, 0.0005)
        data.ctrl[0] = own
        mujoco.mj_step(model, data, nstep=5)
    return tm.JointLog(np.arange(len(told)) * 0.01, told, qpos)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pendulum")
    (folder / "pendulum.xml").write_text(PENDULUM.format(damping=0.02))
    return folder


def _made(result, *_, **__):
    """Result of a call of the examples, which was made with these arguments already."""
    return result


def test_the_examples_run_and_results_are_shown_in_a_line(joint_log, folder, monkeypatch):
    monkeypatch.chdir(folder)
    made = {
        "d": tm.diagnose_joints(joint_log, "pendulum.xml"),
        "better": tm.explain_joints(joint_log, "pendulum.xml"),
        "far": tm.compare_joints(joint_log, "pendulum.xml"),
        "motion": tm.next_joints(joint_log, "pendulum.xml", duration_s=10),
    }
    made["motion"].save("motion.csv")
    made["read"] = tm.import_joints("motion.csv", "pendulum.xml")
    known = {"diagnose_joints": "d", "explain_joints": "better", "next_joints": "motion"}
    again = {call: partial(_made, made[name]) for call, name in known.items()}
    as_tm = SimpleNamespace(**{name: again.get(name, getattr(tm, name)) for name in PUBLIC})
    names = {"tm": as_tm, "Path": type(folder), "joint_log": joint_log, **made}
    options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    with threadpool_limits(1, "blas"):
        done = doctest.testmod(joint_results, extraglobs=names, optionflags=options)
    assert done.attempted > 25 and not done.failed
    for thing in made.values():
        assert len(repr(thing)) < 200 and "\n" not in repr(thing)
        assert len(str(thing)) < 5000 and "<table" in thing._repr_html_()
        assert isinstance(thing.plot(), Figure)
        json.dumps(thing.to_json(), allow_nan=False)
        again = pickle.loads(pickle.dumps(thing))
        assert str(again) == str(thing) and again.to_json() == thing.to_json()
    assert repr(joint_log) == "JointLog(log: 1 joint, 1 actuator, 30 s)"
    told = made["d"].table().iloc[0]
    assert abs(told["value"] - 0.04) < 4 * told["std"]  # 0.06 less 0.02


def test_everything_public_of_joints_has_an_example():
    assert {"JointDiagnosis", "diagnose_joints", "next_joints"} <= set(PUBLIC)
    finder = doctest.DocTestFinder(exclude_empty=False)
    for found in finder.find(joint_results, "tm"):
        named = any(f"{found.name}.".startswith(f"tm.{name}.") for name in PUBLIC)
        shown = not any(part.startswith("_") or part == "of" for part in found.name.split("."))
        assert not (named and shown) or found.examples, found.name
