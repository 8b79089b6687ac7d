# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies of a NatNet stream as poses of robots, and what is wrong where they are not."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import turbopi
from natnet import DataFrame

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.importers.motive import number_of
from twinmill.data.importers.series import multiply, with_z_up
from twinmill.data.natnet_stream import Stream

TURNED_RAD = 0.2  # a body that turned by so much shows which axis is up
UNIT_OFF = 0.05  # of a quaternion's length
TRACKED = 0.9  # share of the frames, below which the cameras are asked about
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class View:
    """How bodies are taken for robots.

    Attributes:
        up: "y" or "z", as Motive streams.
        robots: robot_id by name of a body; others have the last digits of their names.
        heading_offset_rad: from the body's x axis to the robot's front, left positive.
    """

    up: str = "y"
    robots: dict[str, int] = field(default_factory=dict)
    heading_offset_rad: float = 0.0


@dataclass(frozen=True)
class Check:
    """One question of the self-test; `ok` is None where nothing was seen that tells."""

    what: str
    ok: bool | None
    words: str


def _is_pose(position_m: tuple, orientation: np.ndarray) -> bool:
    """True if these are numbers and a turn; Motive sends zeros for a body it never saw."""
    unit = abs(np.linalg.norm(orientation) - 1) < UNIT_OFF
    return bool(unit and np.isfinite(position_m).all())


class Robots:
    """Takes frames in, and gives poses.

    Attributes:
        frames: how many.
        tracked: frames in which a body was, by its number in the stream; `seen` counts the others,
            too.
        poses: valid ones, by robot.
    """

    def __init__(self, stream: Stream, view: View) -> None:
        self.stream, self.view = stream, view
        self.frames = 0
        self.seen: Counter[int] = Counter()
        self.tracked: Counter[int] = Counter()
        self.poses: Counter[int] = Counter()
        self._first: dict[int, np.ndarray] = {}
        self._turned_about: Counter[str] = Counter()

    def take(self, stamp_s: float, frame: DataFrame) -> Iterator[turbopi.pose_t]:
        """A pose of each body that is a robot's; not valid while it is not tracked."""
        self.frames += 1
        numbers = self.numbers([body.id_num for body in frame.rigid_bodies])
        for body in frame.rigid_bodies:
            orientation = np.array([body.rot[3], *body.rot[:3]])
            tracked = body.tracking_valid is not False and _is_pose(body.pos, orientation)
            self.seen[body.id_num] += 1
            if tracked:
                self.tracked[body.id_num] += 1
                self._look(body.id_num, orientation)
            if (number := numbers[body.id_num]) >= 0:
                self.poses[number] += tracked
                pose = (np.array(body.pos), orientation) if tracked else None
                yield self._pose(number, stamp_s, frame.prefix.frame_number, pose)

    def numbers(self, bodies: list[int]) -> dict[int, int]:
        """robot_id by body; -1 while its name has not come, gives none, or another's, too."""
        names = self.stream.names
        found = {b: number_of(names[b], self.view.robots) if b in names else -1 for b in bodies}
        often = Counter(found.values())
        return {body: number if often[number] == 1 else -1 for body, number in found.items()}

    def _look(self, body: int, orientation: np.ndarray) -> None:
        """About which axis a body turned, by the vector part of the turn from its first pose."""
        conjugate = self._first.setdefault(body, orientation) * [1, -1, -1, -1]
        vector = multiply(orientation[None], conjugate)[0, 1:]
        if np.linalg.norm(vector) > np.sin(TURNED_RAD / 2):
            self._turned_about[AXES[int(np.argmax(np.abs(vector)))]] += 1

    def _pose(
        self, number: int, stamp_s: float, frame: int, pose: tuple[np.ndarray, np.ndarray] | None
    ) -> turbopi.pose_t:
        message = turbopi.pose_t()
        message.utime_us, message.robot_id, message.seq = round(1e6 * stamp_s), number, frame
        message.valid = int(pose is not None)
        position, orientation = pose or (np.full(3, np.nan), np.full(4, np.nan))
        position, orientation = with_z_up(position[None], orientation[None], self.view.up)
        half = self.view.heading_offset_rad / 2
        turned = multiply(orientation, np.array([np.cos(half), 0, 0, np.sin(half)]))
        message.position_m, message.orientation_wxyz = position[0].tolist(), turned[0].tolist()
        return message

    def checks(self) -> list[Check]:
        """Results of the checks, good and bad, in the order in which to mend them."""
        server = self.stream.server
        how = (
            f"multicast to {server.group}:{server.data_port}"
            if self.stream.multicast
            else "unicast"
        )
        found = [
            Check(
                "server",
                True,
                f"{server.name}, NatNet {server.protocol}, at {server.address}, asked from "
                f"{server.local}; it streams by {how}",
            ),
            self._frames(how),
        ]
        if self.stream.broken:
            found.append(
                Check(
                    "packets",
                    False,
                    f"{counted(self.stream.broken, 'packet')} cannot be read: another program "
                    f"sends to this port, or NatNet {server.protocol} is not one of 3.0 to 4.2",
                )
            )
        return found + (self._bodies() if self.frames else [])

    def _frames(self, how: str) -> Check:
        server = self.stream.server
        if self.frames:
            return Check("frames", True, counted(self.frames, "frame"))
        if others := sorted(self.stream.strangers):
            mend = f"give {option('server', others[0])}: that is who streams here"
        elif not self.stream.multicast:
            mend = (
                f"let UDP from {server.address} through this machine's firewall; or Motive streams "
                f"by multicast, which {option('multicast', True)} hears"
            )
        else:
            mend = (
                f"see that Motive's Local Interface is the network of {server.local} (else give "
                f"{option('local')}), let UDP {server.data_port} through this machine's firewall, "
                "and know "
                "that wireless networks and managed switches often carry no multicast: set Motive "
                "to unicast"
            )
        words = (
            f"the server answers, but no frame comes by {how}: is Motive live, or playing a take? "
            f"If so, {mend}"
        )
        return Check("frames", False, words)

    def _bodies(self) -> list[Check]:
        if not self.seen:
            words = (
                "the frames hold no rigid body: make one for each robot, and turn Rigid Bodies on "
                "under Settings, Streaming"
            )
            return [Check("rigid bodies", False, words)]
        unknown = "body {} (the server has not told its name)"
        names = {body: self.stream.names.get(body, unknown.format(body)) for body in self.seen}
        numbers = self.numbers(list(self.seen))
        taken = ", ".join(f"{names[b]} is robot {n}" for b, n in numbers.items() if n >= 0)
        strange = [names[body] for body, number in numbers.items() if number < 0]
        found = [Check("rigid bodies", bool(taken), taken or "none is a robot's")]
        if strange:
            words = (
                f"{', '.join(strange)}: no number of its own in 0..99; give "
                f"{option('robot', {'NAME': 'ID'})}"
            )
            found.append(Check("numbers", False, words))
        for body, count in self.seen.items():
            share = self.tracked[body] / count
            if share < TRACKED:
                words = (
                    f"{names[body]} is tracked in {share:.0%} of the frames: see whether its "
                    "markers are hidden, or too like another's"
                )
                found.append(Check("tracked", False, words))
        return [*found, self._up()]

    def _up(self) -> Check:
        if not self._turned_about:
            words = "not seen: turn a robot on the floor by hand while this listens"
            return Check("up axis", None, words)
        axis, count = self._turned_about.most_common(1)[0]
        if axis == self.view.up:
            return Check("up axis", True, f"{axis}: bodies turn about it")
        words = (
            f"bodies turn about {axis} ({counted(count, 'frame')}), but {self.view.up} is taken to "
            "be up: "
            + (
                f"say {option('up', axis)}"
                if axis in "yz"
                else "make the rigid bodies anew, lying level"
            )
        )
        return Check("up axis", False, words)
