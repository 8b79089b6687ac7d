# SPDX-License-Identifier: Apache-2.0
"""The robot's program in the place of the twin's robot: same bits, same duties, byte for byte.

The twin's world is that of its built-in decisions. As long as each answer of the guest is the
twin's own, the next frame is the one that the guest's drive leads to: the loop is closed.
"""

import itertools
import os
import statistics
import subprocess

import lcm
import pytest
import turbopi
from robot import GREEN, RED, SIGNS, Robot

TWIN_RUN = os.environ.get("TWIN_RUN")
DURATION_S = 12
# The host may think as long before the program takes the camera for frozen.
PATIENT = ("--set", "frame_timeout_ms=3000")


def twin_robot(folder):
    """Runs a mill in the twin. Returns the decisions of the robot whose bit changes most often."""
    log = folder / "twin.lcmlog"
    subprocess.run(
        [TWIN_RUN, *f"--plant planar --n 8 --duration-s {DURATION_S} --seed 3 --log".split(), log],
        check=True,
        capture_output=True,
    )
    robots = {}
    for event in lcm.EventLog(str(log), "r"):
        if event.channel.endswith("_TELEMETRY"):
            robots.setdefault(event.channel, []).append(turbopi.telemetry_t.decode(event.data))

    def changes(said):
        return sum(a.detected != b.detected for a, b in itertools.pairwise(said))

    return max(robots.values(), key=changes)


@pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the twin's program")
def test_duties_are_those_of_the_twin_byte_for_byte(rig, tmp_path):
    twin = twin_robot(tmp_path)
    assert {t.detected_raw for t in twin} == {t.detected for t in twin} == {0, 1}
    delays_s = []
    with Robot(rig, "--start", *PATIENT) as robot:
        # What it saw before the first frame that counts is forgotten.
        rig.wait(lambda: any(t.frame_utime_us for t in robot.telemetry()))
        rig.wait(lambda: not robot.telemetry()[-1].frame_utime_us)
        for frame, wanted in enumerate(twin, 1):
            shown_s = robot.show(GREEN if wanted.detected_raw else RED)
            rig.wait(lambda frame=frame: robot.telemetry()[-1].frame_seq >= frame)
            said = robot.telemetry()[-1]
            assert said.frame_seq == frame, "a frame was lost"
            duties = tuple(wanted.wheel_duty_pct)
            assert (said.detected_raw, said.detected) == (wanted.detected_raw, wanted.detected)
            assert tuple(s * d for s, d in zip(SIGNS, duties, strict=True)) == robot.wire(), frame
            delays_s.append(rig.duties[-1].t_s - shown_s)
    print(
        f"hil: {len(twin)} frames answered; frame to last motor byte:"
        f" median {1e3 * statistics.median(delays_s):.1f} ms, most {1e3 * max(delays_s):.1f} ms"
    )
