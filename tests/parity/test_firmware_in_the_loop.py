# SPDX-License-Identifier: Apache-2.0
"""Hardware in the loop: the robot's own program, as a process, drives robots of the twin."""

import os
import shutil
import subprocess
from pathlib import Path

import lcm
import pytest
import turbopi

TWIN_RUN, TURBOPI = os.environ.get("TWIN_RUN", ""), os.environ.get("TURBOPI", "")
pytestmark = pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the program")
SWARM = ("--duration-s", 3, "--seed", 5)


def run(log, *arguments, n=2):
    spread = ("--spread-m", 0.7 if n == 2 else 1)
    command = [TWIN_RUN, "--sensor", "camera", "--n", n, *spread, *SWARM, "--log", log, *arguments]
    return subprocess.run(
        [*map(str, command)], capture_output=True, text=True, timeout=120, check=False
    )


def read(log):
    """All but what the robots say of their configuration, which names the command line."""
    events = lcm.EventLog(str(log), "r")
    return [(e.timestamp, e.channel, e.data) for e in events if not e.channel.endswith("_RUN")]


def telemetry(log):
    return [turbopi.telemetry_t.decode(e[2]) for e in read(log) if e[1].endswith("_TELEMETRY")]


@pytest.mark.parametrize(
    ("n", "arguments"),
    [(2, []), (8, ["--behavior", "milling:7,self_centering:1"]), (2, ["--plant", "planar"])],
)
def test_program_gives_the_duties_of_the_built_in_firmware(tmp_path, n, arguments):
    alone, looped = tmp_path / "alone.lcmlog", tmp_path / "looped.lcmlog"
    assert run(alone, *arguments, n=n).returncode == 0
    done = run(looped, *arguments, "--hil", n, n=n)
    assert done.returncode == 0, done.stderr
    assert read(looped) == read(alone)
    # A run in which robots turn both ways, so that equal means something.
    assert len({tuple(t.wheel_duty_pct) for t in telemetry(alone)}) > 1


def test_a_table_of_the_users_own_drives_the_odd_robot_of_a_mix(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text('spin_and_chase = "0,-1.5,100,0.125"\n')
    mix = ["--plant", "planar", "--behaviors", own, "--behavior", "milling:2,spin_and_chase:1"]
    alone, looped = tmp_path / "alone.lcmlog", tmp_path / "looped.lcmlog"
    assert run(alone, *mix, n=3).returncode == 0
    done = run(looped, *mix, "--hil", 3, n=3)
    assert done.returncode == 0, done.stderr
    assert read(looped) == read(alone)
    odd = {tuple(t.wheel_duty_pct) for t in telemetry(looped) if t.robot_id == 2}
    # Turn inputs -1.5 and 0.125 at full speed: the vendor's mixing cuts what is beyond 100.
    assert (100, -100, 100, -100) in odd and len(odd) > 1


def test_effects_of_the_sensor_act_on_the_program_alike(tmp_path):
    model = tmp_path / "poor.toml"
    installed = Path(__file__).parents[2] / "twin/models/turbopi/turbopi.toml"
    text = installed.read_text().replace("vote_frames = 10", "vote_frames = 3\ndelay_s = 0.1")
    effects = {
        "view_pan": "pan_rad = 0.2\n",
        "vote": "extra_frames = 1\n",
        "view_range": "factor = 1.5\nsoftness_m = 0.1\n",
        "view_angle": "factor = 1.3\n",
        "missed_detection": "rate = 0.3\n",
        "false_detection": "rate = 0.2\n",
        "occlusion": "radius_m = 0.1\n",
        "sensor_delay": "delay_s = 0.05\n",
    }
    text += "".join(f'[[effect]]\nname = "{name}"\n{rest}' for name, rest in effects.items())
    model.write_text(text)
    alone, looped = tmp_path / "alone.lcmlog", tmp_path / "looped.lcmlog"
    assert run(alone, "--model", model).returncode == 0
    assert run(looped, "--model", model, "--hil", 1).returncode == 0
    assert read(looped) == read(alone)


def test_the_programs_bytes_drive_the_wheels(tmp_path):
    slow = tmp_path / "slow"
    slow.write_text(f'#!/bin/sh\nexec "{TURBOPI}" "$@" --set duty_cap_pct=50\n')
    slow.chmod(0o755)
    log = tmp_path / "a.lcmlog"
    assert run(log, "--hil", 1, "--firmware", slow).returncode == 0
    most = [0, 0]
    for t in telemetry(log):
        most[t.robot_id] = max(most[t.robot_id], *t.wheel_duty_pct)
    assert most == [50, 100]


def test_without_waiting_it_drives_in_real_time(tmp_path):
    log = tmp_path / "a.lcmlog"
    done = run(log, "--hil", 1, "--free-run", "--realtime-factor", 1, "--behavior", "milling")
    assert done.returncode == 0, done.stderr
    robot = [t for t in telemetry(log) if t.robot_id == 0]
    # The table's two rows, and none before the first answer.
    assert {tuple(sorted(t.wheel_duty_pct)) for t in robot[20:]} == {(37, 37, 100, 100)}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--hil", 3], "only 2 robots"),
        (["--hil", 1, "--firmware", "/nonexistent"], "no program"),
        (["--hil", 1, "--firmware", shutil.which("false")], "has ended before"),
    ],
)
def test_mistakes_end_in_one_sentence_and_no_file(tmp_path, arguments, words):
    done = run(tmp_path / "a.lcmlog", *arguments)
    assert done.returncode == 1
    assert words in done.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []
