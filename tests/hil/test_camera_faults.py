# SPDX-License-Identifier: Apache-2.0
"""The robot's program and a camera whose driver fails as real ones do.

It is the kernel's own test camera, vivid: it gives thirty pictures a second by itself, in sizes of
a webcam.
"""

import errno

import pytest
import turbopi
from rig import BUILD, KERNEL, SUITE, ZERO
from robot import LEFT, RIGHT, VIVID, Robot

SLACK_S = 1.0
CAMERA_LOST = turbopi.telemetry_t.STATUS_CAMERA_LOST
FRAME_TIMEOUT_S = 0.2


def control(rig, name, value="1"):
    """Sets one of the camera's controls. Returns when (guest, s)."""
    result, t_s = rig.words("c", VIVID, name, value)
    assert result == 0, name
    return t_s


def plug(rig):
    """Makes the camera show plain green."""
    control(rig, "OSD Text Mode", "None")
    control(rig, "Test Pattern", "100% Green")


@pytest.fixture
def driving(rig):
    plug(rig)
    with Robot(rig, "--start", camera=VIVID) as robot:
        rig.wait(lambda: robot.wire() == LEFT)
        yield robot


def test_picture_of_a_webcam_is_understood(rig, driving):
    control(rig, "Test Pattern", "100% Red")
    rig.wait(lambda: driving.wire() == RIGHT)
    control(rig, "Test Pattern", "100% Green")
    rig.wait(lambda: driving.wire() == LEFT)


def test_damaged_frame_does_not_stop_the_robot(rig, driving):
    damaged_s = control(rig, "Inject V4L2_BUF_FLAG_ERROR")
    later = len(driving.telemetry()) + 15
    rig.wait(lambda: len(driving.telemetry()) > later)
    assert {d.wire for d in driving.since(damaged_s)} == {LEFT}


def test_camera_that_sends_nothing_stops_the_robot(rig, driving):
    frozen_s = control(rig, "Percentage of Dropped Buffers", "100")
    rig.wait(lambda: driving.wire() == ZERO)
    assert driving.stopped_s(frozen_s) - frozen_s < FRAME_TIMEOUT_S + SLACK_S
    control(rig, "Percentage of Dropped Buffers", "0")
    rig.wait(lambda: driving.wire() == LEFT)


@pytest.mark.parametrize("calls", [[], ["REQBUFS"], ["QBUF"], ["STREAMON"]])
def test_camera_that_fails_for_good_is_opened_until_it_works(rig, driving, calls):
    faults = [*(f"VIDIOC_{call}" for call in calls), "Fatal Streaming"]
    failed_s = min([control(rig, f"Inject {fault} Error") for fault in faults])
    rig.wait(lambda: driving.wire() == ZERO)
    assert driving.stopped_s(failed_s) - failed_s < FRAME_TIMEOUT_S + SLACK_S
    rig.wait(lambda: driving.wire() == LEFT)


def test_camera_is_unplugged_and_plugged_in_again(rig, driving):
    gone_s = control(rig, "Disconnect")
    rig.wait(lambda: driving.wire() == ZERO)
    assert driving.stopped_s(gone_s) - gone_s < FRAME_TIMEOUT_S + SLACK_S
    # The driver goes only when nobody has its camera open.
    rig.wait(lambda: rig.words("u", "vivid")[0] == 0)
    assert rig.words("c", VIVID, "Brightness", "0")[0] == -errno.ENOENT
    later = len(driving.telemetry()) + 8
    rig.wait(lambda: len(driving.telemetry()) > later)
    assert driving.has(CAMERA_LOST) and driving.wire() == ZERO

    order = (BUILD / f"{KERNEL}.{SUITE}.root/modules/order").read_text().splitlines()
    parameters = next(line for line in order if line.startswith("vivid.ko ")).partition(" ")[2]
    assert rig.words("l", "/modules/vivid.ko", parameters)[0] == 0
    plug(rig)
    rig.wait(lambda: driving.wire() == LEFT)
