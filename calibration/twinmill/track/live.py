# SPDX-License-Identifier: Apache-2.0
"""Poses on the bus while cameras run, as motion capture would publish them."""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from queue import Empty, Queue
from typing import Any

import numpy as np
import turbopi

from twinmill.arguments import option
from twinmill.track.camera import Camera
from twinmill.track.detect import ROBOTS, Detector, Sightings, check_single, gather
from twinmill.track.floor import Floor, View, look
from twinmill.track.locate import locate
from twinmill.track.paths import ERROR_PX, SIZE_ODD, Tags, too_far
from twinmill.track.together import HOLD_S

FLOOR_FRAMES = 30  # from which the floor is found, before the first pose
FORGET_S = 0.5  # after it a robot may be anywhere
BURST_S = 0.1  # by which frames may come too soon after another, where no driver stamps them
LOOK_S = 0.02
AHEAD = 2  # frames that wait for each camera

Frames = Iterator[tuple[float, np.ndarray]]
Found = tuple[np.ndarray, np.ndarray]  # of Detector.find


@dataclass(frozen=True)
class FrameDetections:
    """Detections in one picture.

    Attributes:
        camera: which of them.
        stamp_s: start of its exposure, since the Unix epoch.
        picture: (H, W, 3) bytes.
        numbers, corners_px: of all tags in it, (K,) and (K, 4, 2).
        poses: (3,) of the robots that were published from it.
        lost: robots that this camera held and does not see.
    """

    camera: int
    stamp_s: float
    picture: np.ndarray
    numbers: np.ndarray
    corners_px: np.ndarray
    poses: dict[int, np.ndarray]
    lost: list[int]


@dataclass(frozen=True)
class LiveCount:
    """Counts of a live run so far.

    Attributes:
        frames: looked at.
        poses: valid ones published, by robot.
        sight: the last picture's.
    """

    frames: int
    poses: dict[int, int]
    sight: FrameDetections


@dataclass
class _Held:
    """Where a robot was last, and which camera follows it."""

    t_s: float
    pose: np.ndarray
    camera: int


def find_view(frames: Frames, camera: Camera, floor: Floor, family: str) -> View:
    """The camera over the floor, from the first frames.

    Raises:
        ValueError: as look; the camera gave no frames.
    """
    detector = Detector(family)
    found = [detector.find(picture) for _, picture in islice(frames, FLOOR_FRAMES)]
    if not found:
        raise ValueError(f"{option('camera')}: gave no frames; see whether another program has it.")
    return look(camera, floor, gather(found))


def publish(
    cameras: Sequence[Frames], views: Sequence[View], tags: Tags, say: Callable[[str, bytes], Any]
) -> Iterator[LiveCount]:
    """Publishes each robot's pose of each frame, and the counts after it.

    A robot that was seen before and now is not is said to be so: valid is 0. Where cameras overlap,
    one follows a robot until it loses it.

    Args:
        cameras: of each, stamps since the Unix epoch at the start of the exposure, and pictures.
        views: of each.
        tags: on the robots.
        say: channel and payload to the bus.

    Raises:
        ValueError: two tags of one number are in a picture.
    """
    published: dict[int, int] = {}
    last: dict[int, _Held] = {}
    for frame, detected in enumerate(_detected(_merged(cameras), tags.family)):
        k, stamp_s, picture, (numbers, corners) = detected
        seen = _seen(k, stamp_s, views[k], tags, found=(numbers, corners), last=last)
        camera = views[k].camera
        middle_s = stamp_s + camera.exposure_s / 2 + camera.line_delay_s * camera.size_px[1] / 2
        last |= seen
        mine = sorted(n for n, held in last.items() if held.camera == k)
        for robot_id in mine:
            held = seen.get(robot_id)
            at_s, pose = (held.t_s, held.pose) if held else (middle_s, None)
            message = _message(robot_id, frame, at_s, pose, height_m=tags.height_m)
            say(f"R{robot_id:02d}_POSE", message.encode())
            if held:
                published[robot_id] = published.get(robot_id, 0) + 1
        poses = {n: held.pose for n, held in seen.items()}
        lost = [n for n in mine if n not in seen]
        sight = FrameDetections(
            camera=k,
            stamp_s=stamp_s,
            picture=picture,
            numbers=numbers,
            corners_px=corners,
            poses=poses,
            lost=lost,
        )
        yield LiveCount(frame + 1, published, sight)


def _merged(cameras: Sequence[Frames]) -> Iterator[tuple[int, float, np.ndarray]]:
    """Frames of all cameras as they come, until the last camera ends."""
    if len(cameras) == 1:
        yield from ((0, *frame) for frame in cameras[0])
        return
    waiting: Queue = Queue(AHEAD * len(cameras))
    over = threading.Event()

    def read(k: int, frames: Frames) -> None:
        try:
            for frame in frames:
                waiting.put((k, *frame))
                if over.is_set():
                    return
        finally:  # a camera that breaks has ended, too
            waiting.put(None)

    readers = [threading.Thread(target=read, args=row, daemon=True) for row in enumerate(cameras)]
    for reader in readers:
        reader.start()
    left = len(cameras)
    try:
        while left:
            frame = waiting.get()
            left -= frame is None
            if frame is not None:
                yield frame
    finally:  # cameras are closed by others once nobody reads them
        over.set()
        for reader in readers:
            while reader.is_alive():
                with suppress(Empty):
                    waiting.get(timeout=LOOK_S)


def _detected(
    frames: Iterator[tuple[int, float, np.ndarray]], family: str
) -> Iterator[tuple[int, float, np.ndarray, Found]]:
    """Frames in their order with the tags in them, looked for on as many cores as there are."""
    own, workers = threading.local(), os.cpu_count() or 1

    def find(picture: np.ndarray) -> Found:
        if not hasattr(own, "detector"):
            own.detector = Detector(family)
        return own.detector.find(picture)

    with ThreadPoolExecutor(workers) as pool:
        waiting: deque = deque()
        for frame in frames:
            waiting.append((frame, pool.submit(find, frame[2])))
            while waiting and (len(waiting) >= workers or waiting[0][1].done()):
                frame, found = waiting.popleft()
                yield *frame, found.result()
        for frame, found in waiting:
            yield *frame, found.result()


def _seen(
    k: int, stamp_s: float, view: View, tags: Tags, *, found: Found, last: dict[int, _Held]
) -> dict[int, _Held]:
    """Robots that a picture of camera `k` shows, without those that another camera follows."""
    numbers, corners = found
    mine = [n in (ROBOTS if tags.robots is None else tags.robots) for n in numbers.tolist()]
    numbers, corners = numbers[mine], corners[mine]
    squares, camera = locate(view, corners, tags.size_m, tags.height_m), view.camera
    t_s = stamp_s + camera.exposure_s / 2 + camera.line_delay_s * corners.mean(axis=1)[:, 1]
    good = np.abs(squares.side_m / tags.size_m - 1) < SIZE_ODD
    good &= squares.error_px < ERROR_PX
    check_single(Sightings(np.zeros(np.count_nonzero(good), int), numbers[good], corners[good]))
    seen = {}
    for row in np.flatnonzero(good)[np.argsort(-squares.error_px[good])]:
        number, now = int(numbers[row]), _Held(float(t_s[row]), squares.pose[row], k)
        before = last.get(number)
        gap_s = now.t_s - before.t_s if before else np.inf
        if before and before.camera != k and gap_s < HOLD_S:
            continue
        if gap_s > FORGET_S or not too_far(before.t_s - BURST_S, before.pose, now.t_s, now.pose):
            seen[number] = now
    return seen


def _message(
    robot_id: int, seq: int, t_s: float, pose: np.ndarray | None, *, height_m: float
) -> turbopi.pose_t:
    message = turbopi.pose_t()
    message.utime_us, message.robot_id, message.seq = round(1e6 * t_s), robot_id, seq
    message.valid = int(pose is not None)
    x_m, y_m, theta_rad = [np.nan] * 3 if pose is None else pose.tolist()
    message.position_m = [x_m, y_m, height_m]
    message.orientation_wxyz = [np.cos(theta_rad / 2), 0.0 * x_m, 0.0 * x_m, np.sin(theta_rad / 2)]
    return message
