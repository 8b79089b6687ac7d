# SPDX-License-Identifier: Apache-2.0
"""The robot's program under a real kernel: it drives by what it sees and as a person says."""

import statistics

from rig import BATTERY_REGISTER, PACK_MV, ZERO
from robot import FRAME_PERIOD_S, GREEN, LEFT, RED, RIGHT, SIGNS, Robot

# BCM lines of the vendor's board.
DETECTED_LINE, RUNNING_LINE, BUZZER_LINE = 16, 26, 6
EMPTY_MV = 6800


def level(rig, line):
    """Level that the program drives a line to now."""
    values = [change.value for change in rig.levels if change.line == line]
    return values[-1] if values else 0


def test_green_turns_left_and_red_turns_right(rig):
    with Robot(rig, "--start") as robot:
        robot.drive_until(LEFT)
        robot.view = RED
        robot.drive_until(RIGHT)
        robot.view = GREEN
        robot.drive_until(LEFT)


def test_button_starts_and_stops(rig):
    with Robot(rig) as robot:
        robot.show_until(lambda: len(robot.telemetry()) > 20)
        assert {duties.wire for duties in robot.since(0)} == {ZERO}
        robot.press()
        assert robot.wire() == LEFT and level(rig, RUNNING_LINE) == 1
        robot.press()
        assert robot.wire() == ZERO and level(rig, RUNNING_LINE) == 0


def test_light_shows_what_is_seen(rig):
    with Robot(rig) as robot:
        robot.show_until(lambda: level(rig, DETECTED_LINE) == 1)
        robot.view = RED
        robot.show_until(lambda: level(rig, DETECTED_LINE) == 0)


def test_telemetry_tells_what_the_board_was_told(rig):
    with Robot(rig, "--start", "--set", "robot_id=7") as robot:
        robot.drive_until(LEFT)
        robot.show_until(lambda: any(t.battery_V > 0 for t in robot.telemetry()))
        said = robot.telemetry()[-1]
        assert said.robot_id == 7 and said.detected and said.mode == said.MODE_TABLE
        assert tuple(s * d for s, d in zip(SIGNS, said.wheel_duty_pct, strict=True)) == LEFT
        assert abs(said.battery_V - PACK_MV / 1000) < 1e-6
        assert [t.seq for t in robot.telemetry()] == list(range(len(robot.telemetry())))


def test_empty_battery_stops_for_good_and_sounds(rig):
    with Robot(rig, "--start") as robot:
        robot.drive_until(LEFT)
        rig.board(b"R", BATTERY_REGISTER, *EMPTY_MV.to_bytes(2, "little"))
        robot.show_until(lambda: level(rig, BUZZER_LINE) == 1)
        assert robot.wire() == ZERO
        rig.mend()
        robot.press()
        assert robot.wire() == ZERO


def test_duties_follow_a_frame_within_the_time_of_one(rig):
    """From the frame's first byte into the driver to the fourth wheel's register, guest's clock."""
    patience = ("--set", "frame_timeout_ms=10000", "--set", "vote_frames=1")
    with Robot(rig, "--start", *patience) as robot:
        robot.drive_until(LEFT)
        delays_s = []
        for i in range(200):
            view, wire = ((RED, RIGHT), (GREEN, LEFT))[i % 2]
            shown_s = robot.show(view)
            rig.wait(lambda wire=wire: robot.wire() == wire)
            delays_s.append(rig.duties[-1].t_s - shown_s)
    delays_ms = sorted(1e3 * delay_s for delay_s in delays_s)
    median_ms, rare_ms = statistics.median(delays_ms), delays_ms[int(0.99 * len(delays_ms))]
    print(f"\nhil: frame to last motor byte: median {median_ms:.1f} ms, 99 %: {rare_ms:.1f} ms")
    assert median_ms < 1e3 * FRAME_PERIOD_S
