# SPDX-License-Identifier: Apache-2.0
"""Poses on the bus while the camera runs, as motion capture would publish them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np
import turbopi

from twinmill.track.camera import Camera
from twinmill.track.detect import ROBOTS, Detector, Sightings, check_single, gather
from twinmill.track.floor import Floor, View, look
from twinmill.track.locate import locate
from twinmill.track.paths import ERROR_PX, SIZE_ODD, Tags, too_far

FLOOR_FRAMES = 30  # from which the floor is found, before the first pose
FORGET_S = 0.5  # after it a robot may be anywhere

Frames = Iterator[tuple[float, np.ndarray]]


@dataclass
class LiveCount:
    """What was done so far.

    Attributes:
        frames: looked at.
        poses: valid ones published, by robot.
    """

    frames: int = 0
    poses: dict[int, int] = field(default_factory=dict)


def find_view(frames: Frames, camera: Camera, floor: Floor) -> View:
    """The camera over the floor, from the first frames.

    Raises:
        ValueError: as look; the camera gave no frames.
    """
    detector = Detector()
    found = [detector.find(picture) for _, picture in islice(frames, FLOOR_FRAMES)]
    if not found:
        raise ValueError("--camera: gave no frames; see whether another program has it.")
    return look(camera, floor, gather(found))


def publish(
    frames: Frames, view: View, tags: Tags, say: Callable[[str, bytes], Any]
) -> Iterator[LiveCount]:
    """Publishes each robot's pose of each frame, and the counts after it.

    A robot that was seen before and now is not is said to be so: valid is 0.

    Args:
        frames: stamps since the Unix epoch at the start of the exposure.
        view: the camera.
        tags: on the robots.
        say: channel and payload to the bus.

    Raises:
        ValueError: two tags of one number are in a picture.
    """
    detector, count = Detector(), LiveCount()
    last: dict[int, tuple[float, np.ndarray]] = {}
    for stamp_s, picture in frames:
        numbers, corners = detector.find(picture)
        mine = [n in (ROBOTS if tags.robots is None else tags.robots) for n in numbers.tolist()]
        numbers, corners = numbers[mine], corners[mine]
        squares = locate(view, corners, tags.size_m, tags.height_m)
        camera = view.camera
        rows_px = corners.mean(axis=1)[:, 1]
        t_s = stamp_s + camera.exposure_s / 2 + camera.line_delay_s * rows_px
        good = np.abs(squares.side_m / tags.size_m - 1) < SIZE_ODD
        good &= squares.error_px < ERROR_PX
        in_frame = np.full(np.count_nonzero(good), count.frames)
        check_single(Sightings(in_frame, numbers[good], corners[good]))
        seen = {}
        for k in np.flatnonzero(good)[np.argsort(-squares.error_px[good])]:
            now = (float(t_s[k]), squares.pose[k])
            before = last.get(int(numbers[k]))
            if before is None or now[0] - before[0] > FORGET_S or not too_far(*before, *now):
                seen[int(numbers[k])] = now
        last |= seen
        middle_s = stamp_s + camera.exposure_s / 2 + camera.line_delay_s * camera.size_px[1] / 2
        for robot_id in sorted(last):
            at_s, pose = seen.get(robot_id, (middle_s, None))
            message = _message(robot_id, count.frames, at_s, pose, tags.height_m)
            say(f"R{robot_id:02d}_POSE", message.encode())
            if pose is not None:
                count.poses[robot_id] = count.poses.get(robot_id, 0) + 1
        count.frames += 1
        yield count


def _message(
    robot_id: int, seq: int, t_s: float, pose: np.ndarray | None, height_m: float
) -> turbopi.pose_t:
    message = turbopi.pose_t()
    message.utime_us, message.robot_id, message.seq = round(1e6 * t_s), robot_id, seq
    message.valid = int(pose is not None)
    x_m, y_m, theta_rad = [np.nan] * 3 if pose is None else pose.tolist()
    message.position_m = [x_m, y_m, height_m]
    message.orientation_wxyz = [np.cos(theta_rad / 2), 0.0 * x_m, 0.0 * x_m, np.sin(theta_rad / 2)]
    return message
