# SPDX-License-Identifier: Apache-2.0
"""Pictures as the robot's camera sends them, from files, a camera here, or a robot's."""

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from twinmill.arguments import option
from twinmill.robots.remote import Remote

RAW = {".yuyv", ".yuv", ".raw"}
# Studio range from 8-bit R, G, B: ITU-R BT.601-7, 2.5.
BT601 = np.array(
    [[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]
) / 255  # fmt: skip
SKIPPED_FRAMES = 15  # while the camera adjusts itself


@dataclass(frozen=True)
class Picture:
    """One frame.

    Attributes:
        name: for the user.
        yuyv: (H, 2 W) bytes, without padding.
    """

    name: str
    yuyv: np.ndarray

    @property
    def yuv(self) -> np.ndarray:
        """(H, W, 3): each pixel's Y, and the U and V that it shares with its neighbour."""
        height, bytes_a_row = self.yuyv.shape
        pairs = self.yuyv.reshape(height, bytes_a_row // 4, 4)
        yuv = np.empty((height, bytes_a_row // 2, 3), np.uint8)
        yuv[:, 0::2, 0], yuv[:, 1::2, 0] = pairs[..., 0], pairs[..., 2]
        for k, byte in ((1, 1), (2, 3)):
            yuv[:, 0::2, k] = yuv[:, 1::2, k] = pairs[..., byte]
        return yuv

    @property
    def rgb(self) -> np.ndarray:
        """(H, W, 3) bytes to look at."""
        return np.clip((self.yuv - [16.0, 128, 128]) @ np.linalg.inv(BT601).T, 0, 255).astype(
            np.uint8
        )

    def in_light(self, times: float) -> "Picture":
        """Scene in more or less light."""
        zero = np.tile([16, 128], self.yuyv.shape[1] // 2)
        yuyv = np.clip(np.rint(zero + times * (self.yuyv - zero)), 0, 255).astype(np.uint8)
        return Picture(f"{self.name} in {times:g} times the light", yuyv)


def from_rgb(name: str, rgb: np.ndarray) -> Picture:
    """A picture from (H, W, 3) bytes of sRGB; an odd last column is left out."""
    rgb = rgb[:, : rgb.shape[1] // 2 * 2]
    yuv = rgb @ BT601.T + [16, 128, 128]
    yuyv = np.empty((*rgb.shape[:2], 2))
    yuyv[..., 0] = yuv[..., 0]
    pairs = (yuv[:, 0::2, 1:] + yuv[:, 1::2, 1:]) / 2
    yuyv[:, 0::2, 1], yuyv[:, 1::2, 1] = pairs[..., 0], pairs[..., 1]
    return Picture(name, np.rint(yuyv).astype(np.uint8).reshape(rgb.shape[0], -1))


def read_pictures(paths: list[Path], size_px: tuple[int, int]) -> list[Picture]:
    """Reads PNG, JPEG and the like, or raw YUYV frames, any number in a file.

    Args:
        paths: the files.
        size_px: width and height of raw frames.

    Raises:
        ValueError: a file holds no picture.
    """
    pictures = []
    for path in paths:
        if path.suffix.lower() in RAW:
            pictures += split_frames(path.name, path.read_bytes(), size_px)
            continue
        try:
            with Image.open(path) as image:
                pictures.append(from_rgb(path.name, np.asarray(image.convert("RGB"))))
        except UnidentifiedImageError as error:
            raise ValueError(
                f"{path}: is no picture; raw YUYV frames must be named *.yuyv."
            ) from error
    return pictures


def split_frames(name: str, raw: bytes, size_px: tuple[int, int]) -> list[Picture]:
    """Raw YUYV frames, one after the other.

    Raises:
        ValueError: not a whole number of frames.
    """
    width, height = size_px
    frame_bytes = 2 * width * height
    if not raw or len(raw) % frame_bytes:
        raise ValueError(
            f"{name}: {len(raw)} bytes are no whole number of frames of {width}x{height} YUYV; "
            f"give {option('size')}."
        )
    frames = np.frombuffer(raw, np.uint8).reshape(-1, height, 2 * width)
    return [Picture(f"{name} #{k}", frame) for k, frame in enumerate(frames)]


def from_camera(device: str, count: int, size_px: tuple[int, int]) -> list[Picture]:
    """Takes frames with v4l2-ctl: the camera's own bytes.

    Raises:
        ValueError: there is no such camera, or it gives no YUYV of this size.
    """
    if not shutil.which("v4l2-ctl"):
        raise ValueError("--camera: v4l2-ctl is not installed: install v4l-utils.")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "frames"
        width, height = size_px
        done = subprocess.run(
            [
                *("v4l2-ctl", f"--device={device}", "--stream-mmap", f"--stream-to={target}"),
                f"--set-fmt-video=width={width},height={height},pixelformat=YUYV",
                *(f"--stream-skip={SKIPPED_FRAMES}", f"--stream-count={count}"),
            ],
            capture_output=True,
            text=True,
            timeout=60,
        )
        if done.returncode != 0 or not target.exists():
            last = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["no frames"]
            raise ValueError(f"{option('camera', device)}: {last[0]}.")
        return split_frames(device, target.read_bytes(), size_px)


def from_robot(remote: Remote, count: int, size_px: tuple[int, int]) -> list[Picture]:
    """Takes pictures on a robot, whose program stands aside meanwhile.

    Raises:
        ValueError: as from_camera, or the robot cannot be reached.
    """
    sizes = (str(number) for number in (*size_px, count, SKIPPED_FRAMES))
    path = remote.run("frames", *sizes)["frames"]
    return split_frames(remote.host, remote.fetch(path), size_px)
