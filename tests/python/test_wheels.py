# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot wheels`: what each wheel did, by motion that the textbook's equations make.

Lynch and Park, Modern Robotics (2017), section 13.2.1: four mecanum wheels, one of them turning.
"""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import turbopi
import twinmill_native as native

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError
from twinmill.experiment.wheel_signs import read_signs, script
from twinmill_cli.main import run

WHEELS = ("fl_pct", "fr_pct", "rl_pct", "rr_pct")
LEVER_M = 0.059 + 0.067  # of the model below
ALONE = np.array([[1, -1, -1], [1, 1, 1], [1, 1, -1], [1, -1, 1]]) * [1, 1, 1 / LEVER_M]
RATE_HZ, RIM_MPS = 100, 0.2


@pytest.fixture
def model(model_text):
    return native.Model.from_toml(model_text("m"), "m")


def motion(rows, by_column):
    """(N,) s and (N, 3) poses of a body whose column k moves it by by_column[k]."""
    t_s = np.arange(0, rows[-1, 0], 1 / RATE_HZ)
    told = rows[np.searchsorted(rows[:, 0], t_s, "right") - 1, 1:]
    vx, vy, omega = (np.sign(told) @ by_column).T
    theta = np.cumsum(omega) / RATE_HZ
    world = np.exp(1j * (theta - omega / RATE_HZ / 2)) * (vx + 1j * vy)
    place = np.cumsum(world) / RATE_HZ
    return t_s, told, np.column_stack([place.real, place.imag, theta])


@pytest.fixture
def said(model, driven):
    """Reads the script's run of a robot whose column k is the wheel place[k], turning by sign."""

    def read(place=(0, 1, 2, 3), sign=(1, 1, 1, 1), late_s=0.0, mend=lambda pose: pose):
        _, rows = script(model, 50)
        t_s, told, pose = motion(rows, RIM_MPS / 4 * np.array(sign)[:, None] * ALONE[list(place)])
        robot = replace(
            driven(t_s[-1]),
            command_t_s=t_s,
            command=told / 100,
            pose_t_s=t_s + late_s,
            pose=mend(pose),
            **{key: np.ones(len(t_s)) for key in ("valid", "z_m", "battery_V", "frame_t_s")},
            **{key: np.zeros(len(t_s), np.int8) for key in ("mode", "detected_raw", "detected")},
        )
        return read_signs(replace(robot, valid=robot.valid > 0), model, "made")

    return read


def test_a_robot_that_is_right_is_found_so(said):
    signs = said(late_s=0.2)  # with clocks that are a fifth of a second apart
    assert signs.right and not signs.findings
    for column, wanted in zip(signs.columns, RIM_MPS / 4 * ALONE, strict=True):
        np.testing.assert_allclose(column.body, wanted, atol=0.01)


@pytest.mark.parametrize(
    ("place", "sign"),
    [
        ((0, 1, 2, 3), (1, 1, -1, 1)),
        ((1, 0, 2, 3), (1, 1, 1, 1)),
        ((0, 1, 3, 2), (1, -1, 1, 1)),
        ((1, 2, 3, 0), (1, 1, 1, 1)),
        ((3, 2, 1, 0), (-1, 1, -1, 1)),
    ],
)
def test_exchanged_and_backward_wheels_are_named(said, place, sign):
    signs = said(place, sign)
    assert [c.like for c in signs.columns] == [WHEELS[k] for k in place]
    assert [c.sign for c in signs.columns] == list(sign)
    assert not signs.right


def test_mirrored_poses_are_not_taken_for_exchanged_wheels(said):
    signs = said(mend=lambda pose: pose * [1, -1, -1])
    assert not signs.right
    assert "mirrored" in str(signs.findings[0])


def test_a_wheel_that_stands_is_seen(said):
    signs = said(sign=(1, 0, 1, 1))
    assert [c.stood for c in signs.columns] == [False, True, False, False] and not signs.right


def test_a_log_without_single_wheels_is_refused(driven, model):
    with pytest.raises(LogError, match="no command was alone"):
        read_signs(driven(), model, "made")


@pytest.mark.parametrize(
    ("sign", "exchanged"), [((1, 1), False), ((1, -1), False), ((1, 1), True), ((-1, 1), True)]
)
def test_of_two_motors_each_side_is_told_apart(
    tmp_path, monkeypatch, capsys, model_text, sign, exchanged
):
    """From tables, by a two-wheeled robot's equations: v = (r + l) / 2, omega = (r - l) / track."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(model_text("m").replace("mecanum", "differential"))
    assert run(["wheels", "--model", "m.toml"]) == 0
    rows = pd.read_csv("wheels.csv")
    pd.DataFrame({"t_s": rows.t_s, "left_pct": rows.fl_pct, "right_pct": rows.fr_pct}).to_csv(
        "c.csv", index=False
    )
    t_s = np.arange(0, rows.t_s.iloc[-1], 1 / RATE_HZ)
    told = rows.iloc[np.searchsorted(rows.t_s, t_s, "right") - 1]
    left, right = sign[0] * told.fl_pct.to_numpy(), sign[1] * told.fr_pct.to_numpy()
    if exchanged:
        left, right = right, left
    theta = np.cumsum(0.0036 * (right - left) / 0.134) / RATE_HZ
    ahead = 0.0018 * (left + right) * np.exp(1j * theta)
    place = np.cumsum(ahead) / RATE_HZ
    poses = {"t_s": t_s, "x_m": place.real, "y_m": place.imag, "theta_rad": theta}
    pd.DataFrame(poses).to_csv("p.csv", index=False)
    options = ImportOptions(robot_id=3, same_clock=True)
    import_log(tmp_path / "p.csv", tmp_path / "c.csv", tmp_path / "w.lcmlog", options=options)
    capsys.readouterr()
    right_so = sign == (1, 1) and not exchanged
    assert run(["wheels", "w.lcmlog", "--model", "m.toml", "--json"]) == (0 if right_so else 1)
    sides = json.loads(capsys.readouterr().out)["robots"][0]["columns"]
    assert [c["name"] for c in sides] == ["left_pct", "right_pct"]
    names = ["right_pct", "left_pct"] if exchanged else ["left_pct", "right_pct"]
    assert [c["does"] for c in sides] == names and [c["sign"] for c in sides] == list(sign)


def test_the_command_writes_the_script_and_reads_its_log(
    tmp_path, monkeypatch, capsys, model_text, write_log, message
):
    """The robot is told velocities and turns the wrong way; from messages on."""
    monkeypatch.chdir(tmp_path)
    text = model_text("m").replace('drive = "duty"', 'drive = "twist"')
    text = text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
    (tmp_path / "m.toml").write_text(text)
    assert run(["wheels", "--model", "m.toml"]) == 0
    with open("wheels.csv") as stream:
        header, *lines = csv.reader(stream)
    assert header == ["t_s", "vx_mps", "vy_mps", "omega_radps"]
    rows = np.array(lines, float)
    t_s, told, pose = motion(rows, np.diag([0.15, 0.15, -0.6]))
    events = []
    for at_s, value, (x, y, theta) in zip(t_s, told, pose, strict=True):
        stamp_us = round(1e6 * at_s) + 10**9
        drive = message("drive", utime_us=stamp_us, robot_id=4, kind=2, value=[*value, 0.0])
        seen = message("pose", utime_us=stamp_us, robot_id=4, position_m=[x, y, 0.1])
        seen.orientation_wxyz = [math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)]
        events += [("R04_DRIVE", drive), ("R04_POSE", seen)]
    log = write_log(*events)
    assert turbopi.drive_t.decode(events[0][1].encode()).kind == 2
    capsys.readouterr()
    assert run(["wheels", str(log), "--model", "m.toml"]) == 1
    assert "omega_radps backward" in " ".join(capsys.readouterr().out.split())
