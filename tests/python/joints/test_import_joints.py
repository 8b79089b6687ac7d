# SPDX-License-Identifier: Apache-2.0
"""Other people's files of joints become one log, by names, units and clocks that they tell.

Truth is what the libraries rosbags, pandas and pyarrow were given to write.
"""

import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from twinmill.joints.files import read_joint_log
from twinmill_cli.main import app, run

ARM = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" range="-1.5 1.5" limited="true"/>
      <geom size="0.1" mass="1"/>
      <body name="fore" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" range="-1.5 1.5" limited="true"/>
        <geom size="0.1" mass="1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <{kind} name="m1" joint="shoulder"/>
    <{kind} name="m2" joint="elbow"/>
  </actuator>
</mujoco>
"""
STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
T_S = np.arange(300) * 0.01
Q = np.column_stack([np.sin(T_S), 0.5 * np.cos(2 * T_S)])
U = np.column_stack([np.cos(3 * T_S), np.sin(T_S + 1)])
START_NS = 1_700_000_000 * 10**9


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(kind="motor"))
    return path


def imported(arm, files, *options, suffix="npz"):
    out = arm.with_name(f"out.{suffix}")
    words = ["import-joints", *map(str, files), "--model", str(arm), "-o", str(out), "--force"]
    run([*words, *options])
    return read_joint_log(out).ordered(["shoulder", "elbow"], ["m1", "m2"])


def refused(arm, files, *options):
    out = arm.with_name("out.npz")
    words = ["import-joints", *map(str, files), "--model", str(arm), "-o", str(out)]
    result = CliRunner().invoke(app, [*words, *options])
    assert result.exception is not None and not out.exists()
    return str(result.exception)


def check(log, atol=1e-12):
    np.testing.assert_allclose(log.t_s, T_S, atol=1e-6)
    np.testing.assert_allclose(log.qpos, Q, atol=atol)
    np.testing.assert_allclose(log.ctrl, U, atol=atol)


def table(path, **columns):
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


@pytest.mark.parametrize("suffix", ["npz", "mcap"])
def test_a_table_with_words_units_and_dates(arm, suffix):
    path = table(
        arm.with_name("run.csv"),
        **{
            "Time [ms]": 1e3 * T_S,
            "Shoulder Position [deg]": np.degrees(Q[:, 0]),
            "elbow.pos": Q[:, 1],
            "cmd_m1": U[:, 0],
            "elbow_torque": U[:, 1],
            "temperature": T_S,
        },
    )
    check(imported(arm, [path], suffix=suffix))


def test_renamed_columns_and_a_table_of_commands_with_its_own_clock(arm):
    """Commands of twice the rate: each sample gets the mean of two, which keeps their integral."""
    fine = np.arange(600) * 0.005
    positions = table(arm.with_name("q.csv"), when=T_S, a=Q[:, 0], b=Q[:, 1])
    told = table(arm.with_name("u.csv"), when=fine, m1=np.cos(fine), m2=np.sin(fine))
    names = ("when=t_s", "a=qpos.shoulder", "b=qpos.elbow")
    log = imported(arm, [positions, told], *(w for n in names for w in ("--rename", n)))
    np.testing.assert_allclose(log.qpos, Q)
    want = (np.cos(fine[:-2:2]) + np.cos(fine[1:-1:2])) / 2
    np.testing.assert_allclose(log.ctrl[:-1, 0], want, atol=1e-12)


def bag(path, storage, *, names=("elbow", "shoulder", "gripper"), late_s=0.003):
    """States by header, received late and unevenly; an array of commands at the receipt's clock."""
    jitter = np.random.default_rng(1).uniform(-0.002, 0.002, len(T_S))
    kinds = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64MultiArray"
    with Writer(path, version=9, storage_plugin=storage) as writer:
        states = writer.add_connection("/joint_states", kinds[0], typestore=STORE)
        told = writer.add_connection("/effort_controller/commands", kinds[1], typestore=STORE)
        for k, t in enumerate(T_S):
            sent_ns = START_NS + round(t * 1e9)
            stamp = T["builtin_interfaces/msg/Time"](sec=sent_ns // 10**9, nanosec=sent_ns % 10**9)
            state = T[kinds[0]](
                header=T["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
                name=list(names),
                position=np.array([Q[k, 1], Q[k, 0], 9.0]),
                velocity=np.zeros(0),
                effort=np.zeros(0),
            )
            layout = T["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
            array = T[kinds[1]](layout=layout, data=U[k])
            received_ns = sent_ns + round(1e9 * late_s)
            writer.write(told, received_ns, STORE.serialize_cdr(array, kinds[1]))
            received_ns += round(1e9 * jitter[k])
            writer.write(states, received_ns, STORE.serialize_cdr(state, kinds[0]))
    return path


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_bag_of_states_and_an_array(arm, storage):
    """Unevenness of the receipt does not enter positions; both are late by the same 3 ms."""
    log = imported(arm, [bag(arm.with_name("bag"), storage)])
    np.testing.assert_allclose(np.diff(log.t_s), 0.01, atol=1e-8)
    assert len(log.t_s) >= len(T_S) - 1  # the first state may be older than the first command
    k = len(T_S) - len(log.t_s)
    np.testing.assert_allclose(log.qpos, Q[k:], atol=1e-12)
    # the median of the uneven times is 3 ms within 0.5 ms, a twentieth of a row
    off = np.abs(log.ctrl - U[k:])[:-1].max()
    assert off < 0.05 * np.abs(np.diff(U, axis=0)).max()


def test_what_is_written_as_mcap_other_readers_open(arm):
    """By rosbags, and by mcap: the messages of ROS 2, and the names of the actuators."""
    path = table(
        arm.with_name("run.csv"),
        **{"t_s": T_S, "qpos.shoulder": Q[:, 0], "qpos.elbow": Q[:, 1]},
        **{"ctrl.m1": U[:, 0], "ctrl.m2": U[:, 1]},
    )
    check(imported(arm, [path], suffix="mcap"))
    out = arm.with_name("out.mcap")
    with AnyReader([out], default_typestore=STORE) as reader:
        read = [
            reader.deserialize(raw, c.msgtype)
            for c, _, raw in reader.messages()
            if c.topic == "/joint_states"
        ]
    np.testing.assert_array_equal([m.position for m in read], Q)
    assert list(read[0].name) == ["shoulder", "elbow"]
    with out.open("rb") as stream:
        (kept,) = [m.metadata for m in make_reader(stream).iter_metadata()]
    assert json.loads(kept["actuators"]) == ["m1", "m2"] and "import joints" in kept["command"]
    again = imported(arm, [out], suffix="npz")  # a log is a bag, too
    check(again)


def test_episodes_of_a_data_set_are_runs_with_the_names_that_it_tells(arm):
    arm.write_text(ARM.format(kind="position"))
    folder = arm.with_name("set")
    (folder / "meta").mkdir(parents=True)
    (folder / "data").mkdir()
    names = ["elbow.pos", "shoulder.pos"]
    features = {key: {"names": names} for key in ("observation.state", "action")}
    (folder / "meta" / "info.json").write_text(json.dumps({"features": features}))
    path = folder / "data" / "file-000.parquet"
    parquet.write_table(
        pa.table(
            {
                "observation.state": np.degrees(np.tile(Q[:, ::-1], (2, 1))).tolist(),
                "action": np.degrees(np.tile(U[:, ::-1], (2, 1))).tolist(),
                "timestamp": np.tile(T_S, 2),
                "episode_index": np.repeat([0, 1], len(T_S)),
            }
        ),
        path,
    )
    for suffix in ("npz", "mcap"):
        log = imported(arm, [path], "--degrees", suffix=suffix)
        assert log.begins == (0, len(T_S)) and len(log.stretches) == 2
        np.testing.assert_allclose(log.qpos, np.tile(Q, (2, 1)), atol=1e-12)
        ends = [len(T_S) - 1]  # of the first run: the next one's first command is held there
        told = np.delete(log.ctrl, ends, 0)
        np.testing.assert_allclose(told, np.delete(np.tile(U, (2, 1)), ends, 0), atol=1e-12)
    arm.with_name("out.npz").unlink()
    assert "these are degrees" in refused(arm, [path])


def columns(**other):
    whole = {"t_s": T_S, "qpos.shoulder": Q[:, 0], "qpos.elbow": Q[:, 1]}
    return {**whole, "ctrl.m1": U[:, 0], "ctrl.m2": U[:, 1], **other}


@pytest.mark.parametrize(
    ("given", "options", "said"),
    [
        ({"qpos.elbow": None}, (), "no positions of joint 'elbow'"),
        ({"qpos.elbow": None, "elbwo": T_S}, (), "left over is 'elbwo': say which it is with"),
        ({}, ("--rename", "elbwo=qpos.elbow"), "has no 'elbwo' to rename; the nearest is"),
        ({"elbow pos": T_S}, (), "'qpos.elbow' and 'elbow pos' are both qpos.elbow"),
        ({"t_s": T_S[::-1]}, (), "do not ascend in 299 places, first in row 2"),
        ({"t_s": None}, (), "none of its columns may be the time"),
        ({"t_s": None, "time": T_S, "timestamp": T_S}, (), "each of time, timestamp"),
        ({"qpos.elbow": None, "elbow_mm": T_S, "ignored": T_S}, (), "no positions"),
        ({"qpos.elbow": None, "elbow_pos_mm": T_S}, (), "is in mm, and joint 'elbow' is a hinge"),
        ({"qpos.elbow": np.degrees(Q[:, 1])}, (), "these are degrees"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(arm, given, options, said):
    whole = {k: v for k, v in columns(**given).items() if v is not None}
    assert said in refused(arm, [table(arm.with_name("run.csv"), **whole)], *options)


def test_servos_told_degrees_that_answer_in_radians_are_refused(arm):
    arm.write_text(ARM.format(kind="position"))
    told = {"ctrl.m1": np.degrees(Q[:, 0]), "ctrl.m2": np.degrees(Q[:, 1])}
    path = table(arm.with_name("run.csv"), **columns(**told))
    assert "one is in degrees, the other in radians" in refused(arm, [path])


def test_bags_that_lack_something_are_refused(arm):
    path = bag(arm.with_name("bag"), StoragePlugin.MCAP, names=("a", "shoulder", "gripper"))
    assert "no positions of joint 'elbow'" in refused(arm, [path])
    assert "has no topic /cmd" in refused(arm, [path], "--command", "/cmd")
    told = refused(arm, [path], "--actuators", "m1")
    assert "has 2 commands without names, and there are 1 actuators (m1)" in told
