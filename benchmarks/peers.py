# SPDX-License-Identifier: Apache-2.0
"""Decision from one picture by OpenCV: as TurboPi robots usually make it, and as an expert would.

The published sequence is in GMU-ASRC/turbopi-root,
hiwonder_common/src/hiwonder_common/camera_binary_program.py, and in the vendor's Camera.py. Left
out, to their advantage: preview, text, logging, LEDs and motors.
"""

from collections import deque

import cv2
import numpy as np
from scene import HEIGHT_PX, WIDTH_PX

SIZE = (WIDTH_PX, HEIGHT_PX)
# The vendor's lab_config.yaml, green.
LAB_MIN, LAB_MAX = (0, 48, 94), (252, 109, 207)
MIN_BLOB_PX = 300
VOTE_FRAMES = 10
# The vendor's calibration_param.npz.
CAMERA = np.array([[619.5, 0, 287.7], [0, 622.2, 218.7], [0, 0, 1]])
FISHEYE = np.array([-0.0200, -0.1708, -0.2568, 0.9651])
KERNEL = np.ones((3, 3), np.uint8)


class Peer:
    """One robot's camera thread and loop, without their hand-over."""

    def __init__(self) -> None:
        self._maps = cv2.fisheye.initUndistortRectifyMap(
            CAMERA, FISHEYE, np.eye(3), CAMERA, SIZE, cv2.CV_32FC1
        )
        self._bits: deque[bool] = deque(maxlen=VOTE_FRAMES)

    def capture(self, yuyv: np.ndarray) -> np.ndarray:
        """The camera thread: a frame as the driver gives it to an undistorted BGR picture."""
        bgr = cv2.cvtColor(yuyv, cv2.COLOR_YUV2BGR_YUY2)
        resized = cv2.resize(bgr, SIZE, interpolation=cv2.INTER_NEAREST)
        return cv2.remap(resized, *self._maps, cv2.INTER_LINEAR)

    def sees(self, bgr: np.ndarray) -> bool:
        """The loop up to the bit of this frame."""
        resized = cv2.resize(bgr.copy(), SIZE, interpolation=cv2.INTER_NEAREST)
        blurred = cv2.GaussianBlur(resized, (3, 3), 3)
        lab = cv2.cvtColor(blurred, cv2.COLOR_BGR2LAB)
        mask = cv2.inRange(lab, LAB_MIN, LAB_MAX)
        opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, KERNEL)
        closed = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, KERNEL)
        contours = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[-2]
        largest_px = max((abs(cv2.contourArea(contour)) for contour in contours), default=0)
        return largest_px > MIN_BLOB_PX

    def vote(self, seen: bool) -> bool:
        """The moving mean of the last passes."""
        self._bits.append(seen)
        return sum(self._bits) / len(self._bits) > 0.5


# What three usual chains look for, from the limits of the green that robots ship with
# (firmware/core/threshold.c), and in HSV from the usual ones of a saturated green.
HSV_MIN, HSV_MAX = (35, 60, 30), (85, 255, 255)
YUYV_MIN, YUYV_MAX = (40, 0, 40, 0), (235, 124, 235, 108)


def sees_hsv_640(yuyv: np.ndarray) -> bool:
    """HSV at the camera's own size."""
    bgr = cv2.cvtColor(yuyv, cv2.COLOR_YUV2BGR_YUY2)
    mask = cv2.inRange(cv2.cvtColor(bgr, cv2.COLOR_BGR2HSV), HSV_MIN, HSV_MAX)
    return _has_blob(mask, MIN_BLOB_PX)


def sees_hsv_320(yuyv: np.ndarray) -> bool:
    """HSV at half the width and height, every second pixel of both."""
    bgr = cv2.cvtColor(yuyv, cv2.COLOR_YUV2BGR_YUY2)
    small = cv2.resize(bgr, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_NEAREST)
    mask = cv2.inRange(cv2.cvtColor(small, cv2.COLOR_BGR2HSV), HSV_MIN, HSV_MAX)
    return _has_blob(mask, MIN_BLOB_PX / 4)


def sees_yuyv(yuyv: np.ndarray) -> bool:
    """No conversion: limits on the bytes as they come, two pixels as one of four channels."""
    mask = cv2.inRange(yuyv.reshape(HEIGHT_PX, WIDTH_PX // 2, 4), YUYV_MIN, YUYV_MAX)
    return _has_blob(mask, MIN_BLOB_PX / 2)


def _has_blob(mask: np.ndarray, at_least_px: float) -> bool:
    statistics = cv2.connectedComponentsWithStats(mask)[2]
    return len(statistics) > 1 and statistics[1:, cv2.CC_STAT_AREA].max() > at_least_px


CHAINS = {
    "HSV 640x480": sees_hsv_640,
    "HSV 320x240": sees_hsv_320,
    "inRange on YUYV": sees_yuyv,
}
