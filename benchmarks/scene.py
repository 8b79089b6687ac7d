# SPDX-License-Identifier: Apache-2.0
"""Pictures of a floor as the robot's camera sends them: 640x480 pixels, YUYV."""

import numpy as np

WIDTH_PX, HEIGHT_PX = 640, 480
# sRGB (0, 128, 0) in BT.601 studio range: the sheet of green on a robot's back.
GREEN_YUV = (81, 91, 81)
# Wood, cardboard, blue plastic, red plastic, white paper.
CLUTTER_YUV = ((110, 110, 145), (140, 105, 142), (70, 165, 110), (80, 105, 190), (220, 128, 128))


def floor(seed: int, robot_radius_px: int = 0) -> np.ndarray:
    """A textured grey floor with clutter and the sensor's noise; perhaps a robot's green disc.

    Returns:
        (480, 640, 2) uint8: Y of every pixel; U of even and V of odd ones.
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    yuv = np.empty((HEIGHT_PX, WIDTH_PX, 3))
    yuv[..., 0] = 120 + 20 * np.sin(x / 17) * np.sin(y / 23)
    yuv[..., 1:] = 128
    for colour in CLUTTER_YUV:
        left, top = rng.integers(0, WIDTH_PX - 120), rng.integers(0, HEIGHT_PX - 90)
        yuv[top : top + 80, left : left + 110] = colour
    if robot_radius_px:
        middle_x = rng.integers(robot_radius_px, WIDTH_PX - robot_radius_px)
        middle_y = rng.integers(robot_radius_px, HEIGHT_PX - robot_radius_px)
        yuv[(x - middle_x) ** 2 + (y - middle_y) ** 2 < robot_radius_px**2] = GREEN_YUV
    yuv += rng.normal(0, 3, yuv.shape)
    return pack(yuv)


def noise(seed: int) -> np.ndarray:
    """Random bytes: pixels of every colour everywhere, the most work there can be."""
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (HEIGHT_PX, WIDTH_PX, 2), np.uint8)


def pack(yuv: np.ndarray) -> np.ndarray:
    """(H, W, 3) numbers as (H, W, 2) bytes of YUYV; U and V of each pair of pixels are averaged."""
    packed = np.empty((*yuv.shape[:2], 2))
    packed[..., 0] = yuv[..., 0]
    chroma = (yuv[:, 0::2, 1:] + yuv[:, 1::2, 1:]) / 2
    packed[:, 0::2, 1], packed[:, 1::2, 1] = chroma[..., 0], chroma[..., 1]
    return np.clip(packed.round(), 0, 255).astype(np.uint8)
