# SPDX-License-Identifier: Apache-2.0
"""The robot's program under a real kernel: whatever fails, the motors come to zero in time.

Times are the guest kernel's, stamped as the board is told. WATCHDOG_S is what the program promises;
SLACK_S is for a machine that emulates slowly while it does something else.
"""

import itertools
import signal

import pytest
import turbopi
from rig import ZERO
from robot import GREEN, LEFT, PROGRAM, SETTINGS, Robot

WATCHDOG_S, FRAME_TIMEOUT_S = 0.5, 0.2
SLACK_S = 1.0
REJECTED = turbopi.telemetry_t.STATUS_FRAME_REJECTED
BOARD_LOST = turbopi.telemetry_t.STATUS_BOARD_LOST
ALL = 255  # transfers, until told otherwise


@pytest.fixture
def driving(rig):
    """A robot that turns left and is not started again when it dies."""
    # The emulator may take as long as all tries together to come to the second.
    patience = ("--set", "restart_ms=-1", "--set", "board_retry_ms=100")
    with Robot(rig, "--start", *patience) as robot:
        robot.drive_until(LEFT)
        yield robot


@pytest.fixture
def blind(rig):
    """Robot under way that would drive on for ten seconds without a frame."""
    patience = ("--set", "frame_timeout_ms=10000", "--set", "watchdog_ms=300")
    with Robot(rig, "--start", "--set", "restart_ms=-1", *patience) as robot:
        robot.drive_until(LEFT)
        yield robot


def wait_for_zero(robot, since_s):
    """Waits until the board has four zeros. Returns how long it took."""
    robot.rig.wait(lambda: robot.wire() == ZERO, what="zero")
    return robot.stopped_s(since_s) - since_s


def test_kill_9_of_the_driving_process_stops_the_motors(blind):
    killed_s = blind.rig.kill(signal.SIGKILL, blind.driver())
    assert blind.wait_for_end().code == 1
    assert wait_for_zero(blind, killed_s) < WATCHDOG_S


def test_kill_9_of_the_parent_stops_the_motors(blind):
    killed_s = blind.rig.kill(signal.SIGKILL, blind.pid)
    assert blind.wait_for_end().code == -signal.SIGKILL
    assert wait_for_zero(blind, killed_s) < WATCHDOG_S


def test_hanging_process_is_killed_and_the_motors_stop(blind):
    stopped_s = blind.rig.kill(signal.SIGSTOP, blind.driver())
    assert blind.wait_for_end().code == 1
    assert wait_for_zero(blind, stopped_s) < WATCHDOG_S + SLACK_S


def test_stop_option_stops_what_a_threefold_kill_left(blind):
    pids = (blind.guard(), blind.pid, blind.driver())
    for number in (signal.SIGSTOP, signal.SIGKILL):
        blind.rig.kill(number, *pids)
    blind.wait_for_end()
    assert blind.wire() == LEFT
    assert blind.rig.run(PROGRAM, *SETTINGS, "--stop").code == 0
    assert blind.wire() == ZERO


def test_killed_program_gets_its_camera_and_board_back(rig):
    with Robot(rig, "--start", "--set", "restart_ms=100") as robot:
        robot.drive_until(LEFT)
        killed = robot.driver()
        killed_s = rig.kill(signal.SIGKILL, killed)
        rig.wait(lambda: robot.wire() == ZERO)
        assert robot.stopped_s(killed_s) - killed_s < WATCHDOG_S
        robot.drive_until(LEFT)
        assert robot.driver() != killed


def test_frozen_picture_stops_the_motors_after_200_ms(driving):
    frozen_s = driving.show(GREEN)
    assert FRAME_TIMEOUT_S <= wait_for_zero(driving, frozen_s) < FRAME_TIMEOUT_S + SLACK_S


def test_half_frames_are_no_frames(driving):
    whole_s = driving.show(GREEN)
    driving.view = GREEN[: len(GREEN) // 2]
    driving.drive_until(ZERO)
    assert driving.stopped_s(whole_s) - whole_s < FRAME_TIMEOUT_S + SLACK_S
    driving.show_until(lambda: driving.has(REJECTED))
    driving.view = GREEN
    driving.drive_until(LEFT)


def test_transfer_that_is_refused_is_tried_again(driving):
    before = len(driving.telemetry())
    for _ in range(10):
        driving.rig.board(b"N", 1)
        end = len(driving.telemetry()) + 2
        driving.show_until(lambda end=end: len(driving.telemetry()) >= end)
    assert {t.status_flags & BOARD_LOST for t in driving.telemetry()[before:]} == {0}
    driving.drive_until(LEFT)


def test_board_that_was_gone_hears_a_stop_first(driving):
    gone_s = driving.show(GREEN)
    driving.rig.board(b"N", ALL)
    driving.show_until(lambda: driving.has(BOARD_LOST))
    driving.rig.board(b"N", 0)
    driving.show_until(lambda: ZERO in [d.wire for d in driving.since(gone_s)])
    driving.drive_until(LEFT)
    heard = [d.wire for d in driving.since(gone_s)]
    # Wheel by wheel to zero, and only then on.
    for before, after in itertools.pairwise(heard[: heard.index(ZERO) + 1]):
        assert all(b in (a, 0) for a, b in zip(before, after, strict=True))
