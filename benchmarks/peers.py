# SPDX-License-Identifier: Apache-2.0
"""The same decision as TurboPi robots usually take it: the published sequence of OpenCV calls.

GMU-ASRC/turbopi-root, hiwonder_common/src/hiwonder_common/camera_binary_program.py, and the
vendor's Camera.py. Left out, to their advantage: preview, text, logging, LEDs and motors.
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
