# SPDX-License-Identifier: Apache-2.0
"""Fixtures that several test files share."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi
from twinmill.calibration.log import RobotLog


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of recordings that are not part of the project."""
    beside = Path(__file__).resolve().parents[2] / ".." / "shared" / "data"
    path = Path(os.environ.get("TWINMILL_DATA", beside))
    if not path.is_dir():
        pytest.skip(f"no recordings at {path}: set TWINMILL_DATA")
    return path


@pytest.fixture
def write_log(tmp_path) -> Callable[..., Path]:
    """Writes (channel, message or bytes) events with LCM's own writer."""

    def write(*events, name="made.lcmlog") -> Path:
        log = lcm.EventLog(str(tmp_path / name), "w", overwrite=True)
        for k, (channel, message) in enumerate(events):
            log.write_event(k, channel, message if isinstance(message, bytes) else message.encode())
        log.close()
        return tmp_path / name

    return write


@pytest.fixture
def message() -> Callable:
    """Makes a message of a type by name, with the fields given."""

    def make(type_name: str, **fields):
        made = getattr(turbopi, f"{type_name}_t")()
        if type_name == "pose":
            made.valid, made.orientation_wxyz = 1, [1.0, 0.0, 0.0, 0.0]
        for name, value in fields.items():
            setattr(made, name, value)
        return made

    return make


@pytest.fixture
def driven() -> Callable[..., RobotLog]:
    """A robot at 0.3 m/s, 0.5 rad/s for some seconds: 120 Hz poses, 45 Hz commands, no noise."""

    def make(duration_s=10.0, **changes) -> RobotLog:
        pose_t_s, command_t_s = np.arange(0, duration_s, 1 / 120), np.arange(0, duration_s, 1 / 45)
        theta = 0.5 * pose_t_s
        pose = np.column_stack([0.6 * np.sin(theta), 0.6 * (1 - np.cos(theta)), theta])
        flags, count = np.zeros(len(command_t_s), np.int8), len(command_t_s)
        robot = RobotLog(
            robot_id=3, source="robot", behavior="", command_kind="duty", command_t_s=command_t_s,
            command=np.tile([0.5, 0.8, 0.5, 0.8], (count, 1)), battery_V=np.full(count, 8.0),
            mode=flags, detected_raw=flags, detected=flags, speed_input=np.zeros(count),
            turn_input=np.zeros(count), pose_t_s=pose_t_s, pose=pose,
            z_m=np.full(len(pose_t_s), 0.1), valid=np.ones(len(pose_t_s), bool))
        return replace(robot, **changes)

    return make
