# SPDX-License-Identifier: Apache-2.0
"""Frames of a film or a camera, each with the time at which it began to be exposed."""

import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from twinmill.arguments import option

NEAR_S = 5.0  # a driver's stamp this near to the monotonic clock is one of it


class Film:
    """Frames of a file.

    Attributes:
        count: about how many there are, 0 if that is not known. Of Matroska and its like it is the
            duration times a nominal rate: half as many again where a webcam slows in the dark.
        duration_s: that the container says; 0 if it does not.
        turned_deg: by which the container says that pictures are to be turned, as they are.
        size_px: width and height, when turned.
        missing_s: from the end of the last frame that was read to the duration.
    """

    def __init__(self, path: Path, rate_hz: float | None = None):
        """Opens it.

        Args:
            path: whatever OpenCV reads.
            rate_hz: constant rate of the frames; None: the container's stamps.

        Raises:
            ValueError: it is no film.
        """
        self.path, self.rate_hz = path, rate_hz
        if not path.is_file():
            raise ValueError(f"{path}: no such file; name a video.")
        self._capture = _open(str(path))
        if not self._capture.isOpened() or not self._capture.get(cv2.CAP_PROP_FRAME_WIDTH):
            raise ValueError(f"{path}: is no video that can be read; MP4, AVI, MKV and MOV can be.")
        count, mean_hz = map(self._capture.get, (cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FPS))
        self.count = max(0, int(count))
        self.duration_s = self.count / mean_hz if mean_hz > 0 else 0.0
        self.turned_deg = round(self._capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
        self.size_px = _size_px(self._capture)
        self.missing_s = 0.0

    def frames(self) -> Iterator[tuple[float, np.ndarray]]:
        """Stamp in s from the film's start, and (H, W, 3) bytes.

        Raises:
            ValueError: it has no frames, or the container's stamps do not ascend.
        """
        k, before_s, at_s, step_s = 0, -np.inf, 0.0, 0.0
        while True:
            good, picture = self._capture.read()
            if not good:
                break
            contained_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            at_s, step_s = contained_s, contained_s - at_s
            stamp_s = k / self.rate_hz if self.rate_hz else contained_s
            if stamp_s <= before_s:
                raise ValueError(
                    f"{self.path}: frame {k} is stamped {stamp_s:.3f} s, not later than the one "
                    f"before; give the camera's rate with {option('rate_hz')}."
                )
            yield stamp_s, picture
            k, before_s = k + 1, stamp_s
        self._capture.release()
        self.missing_s = max(0.0, self.duration_s - at_s - step_s)
        if k == 0:
            raise ValueError(f"{self.path}: is no video with frames in it; record it again.")


class LiveCamera:
    """A camera on this machine; frames until it ends or the block is left."""

    def __init__(self, name: str, size_px: tuple[int, int]):
        """Opens it.

        Args:
            name: number, device, or an address that FFmpeg reads.
            size_px: asked for; a camera may give another.

        Raises:
            ValueError: it cannot be opened.
        """
        self._capture = _open(int(name) if name.isdigit() else name)
        if not self._capture.isOpened():
            raise ValueError(
                f"{option('camera', name)}: cannot be opened; see that it is plugged in and that "
                "no other "
                "program has it."
            )
        self._capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter_fourcc(*"MJPG"))
        for which, px in zip(
            (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT), size_px, strict=True
        ):
            self._capture.set(which, px)
        self.size_px = _size_px(self._capture)

    def frames(self) -> Iterator[tuple[float, np.ndarray]]:
        """Stamp in s since the Unix epoch, the driver's where it gives one, and the picture."""
        while True:
            good, picture = self._capture.read()
            if not good:
                return
            age_s = time.monotonic() - self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            yield time.time() - (age_s if 0 <= age_s < NEAR_S else 0.0), picture

    def close(self) -> None:
        """Ends the capture, so that other programs can open the camera."""
        self._capture.release()


def _open(source: str | int) -> cv2.VideoCapture:
    logging = cv2.utils.logging
    logging.setLogLevel(logging.LOG_LEVEL_SILENT)  # what is wrong is said in our words
    return cv2.VideoCapture(source)


def _size_px(capture: cv2.VideoCapture) -> tuple[int, int]:
    which = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
    return tuple(int(capture.get(property_id)) for property_id in which)
