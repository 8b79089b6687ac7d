# SPDX-License-Identifier: Apache-2.0
"""firmware/app: SIGHUP reads the configuration anew, the wheels standing; a terminal's ends it."""

import os
import shlex
import signal
import time

import lcm
import pytest
import turbopi
from robot_process import HEIGHT_PX, LEFT, WIDTH_PX, ZERO, Robot, terminal, wait_until

TURBOPI = shlex.split(os.environ.get("TURBOPI", ""))
pytestmark = pytest.mark.skipif(not TURBOPI, reason="TURBOPI does not name the program")

# The program's promise, and what a machine that is busy with other tests may add.
LIMIT_S, SLACK_S = 0.5, 1.0


class Card:
    """A configuration file, and the log that it names."""

    def __init__(self, folder):
        self.path, self.log = folder / "turbopi.conf", folder / "a.lcmlog"
        self.folder = folder
        self.write()

    def write(self, *lines):
        """These lines, beside those that every test has."""
        always = {
            "lcm_url": f"file://{self.log}?mode=w",
            "camera": f"stub:unix:{self.folder}/camera",
            "board": f"stub:{self.folder}/board.csv",
            "run_dir": self.folder,
            "panel": "none",
            "width_px": WIDTH_PX,
            "height_px": HEIGHT_PX,
            "autostart": "true",
        }
        text = [f"{key} = {value}" for key, value in always.items()]
        self.path.write_text("\n".join([*text, *lines, ""]))

    def runs(self):
        """Run messages of the robot, by number of the robot."""
        events = lcm.EventLog(str(self.log), "r") if self.log.exists() else []
        runs = [turbopi.run_t.decode(e.data) for e in events if e.channel.endswith("_RUN")]
        return {run.robot_id: run for run in runs}


@pytest.fixture
def card(tmp_path):
    return Card(tmp_path)


@pytest.fixture
def driving(card, tmp_path):
    """A robot that has started by its configuration."""
    with Robot(TURBOPI, tmp_path, config=card.path) as robot:
        assert robot.wait_for(LEFT)
        yield robot


def hang_up(robot):
    """Returns how long the wheels turned on."""
    driver, begin_s = robot.children()[0], time.monotonic()
    robot.process.send_signal(signal.SIGHUP)
    assert wait_until(lambda: robot.children() not in ([], [driver]))
    assert wait_until(lambda: robot.rows()[-1][0] > begin_s) and robot.wait_for(ZERO)
    return next(t for t, d in robot.rows() if d == ZERO and t > begin_s) - begin_s


def test_configuration_is_read_anew_while_the_robot_stands(driving, card):
    card.write("robot_id = 5", "behavior = orbit")
    assert hang_up(driving) < LIMIT_S + SLACK_S
    assert wait_until(lambda: 5 in card.runs())
    assert card.runs()[5].behavior == "orbit" and "robot_id = 5" in card.runs()[5].config_toml
    assert 0 in card.runs()  # it goes on in its log
    # It waits for a person or a command, though it would start by itself.
    time.sleep(0.5)
    assert driving.duties() == ZERO and wait_until(driving.guards)
    driving.process.terminate()
    code, said = driving.end()
    assert code == 0 and "read anew" in said


def test_wrong_configuration_is_told_and_the_old_one_stays(driving, card):
    card.write("robot_id = 5", "behaviour = orbit")
    hang_up(driving)
    before = card.log.stat().st_size
    assert wait_until(lambda: card.log.stat().st_size > before + 1000)
    driving.process.terminate()
    code, said = driving.end()
    assert code == 0 and "'behaviour' is no key" in said and "stays as it was" in said
    assert set(card.runs()) == {0}


def test_again_and_again(driving, card):
    for robot_id in (1, 2, 3):
        card.write(f"robot_id = {robot_id}")
        hang_up(driving)
        assert wait_until(lambda: robot_id in card.runs())  # noqa: B023
    assert len(driving.guards()) == 1 and driving.duties() == ZERO


def test_board_that_was_changed_is_the_new_ones(driving, card, tmp_path):
    card.write(f"board = stub:{tmp_path}/other.csv")
    hang_up(driving)
    assert wait_until((tmp_path / "other.csv").exists)
    rows = len(driving.rows())
    time.sleep(0.3)
    assert len(driving.rows()) == rows  # nobody has the old one any more


@pytest.mark.parametrize("hangs_up", [True, False], ids=["closed", "kill -HUP"])
def test_terminal_that_is_closed_ends_the_program(tmp_path, hangs_up):
    with terminal() as (program, master):
        with Robot([*program, *TURBOPI], tmp_path, "--start") as robot:
            assert robot.wait_for(LEFT)
            begin_s = time.monotonic()
            if hangs_up:
                os.close(master)
            else:
                robot.process.send_signal(signal.SIGHUP)
            code, _ = robot.end()
        rows = [(t, duties) for t, duties in robot.rows() if t > begin_s]
    assert code == 0 and rows[-1][1] == ZERO
    assert next(t for t, duties in rows if duties == ZERO) - begin_s < LIMIT_S + SLACK_S
