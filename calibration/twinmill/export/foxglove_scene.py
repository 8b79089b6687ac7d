# SPDX-License-Identifier: Apache-2.0
"""Scene for Foxglove's 3D panel: where robots are, where they came from, and their view."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.timestamp_pb2 import Timestamp
from matplotlib.colors import to_rgb

from twinmill.data.log import heading_rad
from twinmill.model.outlines import BLIND, SEES, Body

WORLD = "world"
PATH_S = 10.0  # of the path behind a robot
PATH_EVERY_S = 0.1
COLORS = {"": "#0072b2", "TWIN_": "#d55e00"}  # by channel prefix; Okabe and Ito (2008)


@dataclass
class RobotScene:
    """Follows one robot's messages; each may give messages of Foxglove's types.

    Attributes:
        name: of its frame, R<nn> with the channel prefix.
        color: of body and path.
        body: size and view.
    """

    name: str
    color: str
    body: Body
    _sees: int | None = None
    _path: deque = field(default_factory=deque)
    _drawn_us: float = -np.inf

    def on_pose(self, pose: Any, stamp_us: int) -> Iterator[tuple[str, Any]]:
        """(topic, message): the robot's frame, and its path from time to time."""
        w, x, y, z = pose.orientation_wxyz
        if not pose.valid or not abs(w * w + x * x + y * y + z * z - 1) < 0.1:
            return
        moved = FrameTransform(
            timestamp=_time(stamp_us), parent_frame_id=WORLD, child_frame_id=self.name
        )
        x_m, y_m, _ = pose.position_m
        # On the floor: markers' height is no robot's.
        moved.translation.x, moved.translation.y = x_m, y_m
        half_rad = heading_rad(np.array([pose.orientation_wxyz]))[0] / 2
        moved.rotation.w, moved.rotation.z = np.cos(half_rad), np.sin(half_rad)
        yield "/tf", moved
        if stamp_us - self._drawn_us < 1e6 * PATH_EVERY_S:
            return
        self._drawn_us = stamp_us
        self._path.append((stamp_us, Point3(x=x_m, y=y_m)))
        while self._path[0][0] < stamp_us - 1e6 * PATH_S:
            self._path.popleft()
        yield "/scene", self._scene(stamp_us, "path", WORLD, [self._path_line()])
        if self._sees is None:  # drawn without the bit where there is no telemetry
            yield "/scene", self._body(stamp_us)

    def on_telemetry(self, telemetry: Any, stamp_us: int) -> Iterator[tuple[str, Any]]:
        """(topic, message): body and view, whenever the bit changes."""
        recorded = telemetry.detected or telemetry.frame_utime_us > 0  # else no camera was
        if recorded and telemetry.detected != self._sees:
            self._sees = telemetry.detected
            yield "/scene", self._body(stamp_us)

    def _body(self, stamp_us: int) -> SceneUpdate:
        lines = [
            _line(self.body.outline(), self.color, 3),
            _line(self.body.nose(), self.color, 3),
        ]
        if self._sees is not None:
            lines.append(_line(self.body.view(), SEES if self._sees else BLIND, 1.5))
        update = self._scene(stamp_us, "robot", self.name, lines)
        text = update.entities[0].texts.add(
            text=self.name, billboard=True, font_size=12, scale_invariant=True
        )
        text.pose.position.z, text.pose.orientation.w = self.body.radius_m, 1.0
        text.color.CopyFrom(_color(self.color))
        return update

    def _scene(self, stamp_us: int, what: str, frame: str, lines: list) -> SceneUpdate:
        update = SceneUpdate()
        entity = update.entities.add(
            timestamp=_time(stamp_us), frame_id=frame, id=f"{self.name} {what}", frame_locked=True
        )
        entity.lines.extend(lines)
        return update

    def _path_line(self) -> LinePrimitive:
        line = _line(np.empty((0, 2)), self.color, 2)
        line.points.extend(point for _, point in self._path)
        return line


def _line(points: np.ndarray, color: str, width_px: float) -> LinePrimitive:
    line = LinePrimitive(
        type=LinePrimitive.Type.LINE_STRIP,
        thickness=width_px,
        scale_invariant=True,
        color=_color(color),
        points=[Point3(x=x, y=y) for x, y in points],
    )
    line.pose.orientation.w = 1.0
    return line


def _color(text: str) -> Color:
    r, g, b = to_rgb(text)
    return Color(r=r, g=g, b=b, a=1.0)


def _time(utime_us: int) -> Timestamp:
    return Timestamp(seconds=utime_us // 1_000_000, nanos=utime_us % 1_000_000 * 1000)
