# SPDX-License-Identifier: Apache-2.0
"""Scene in Rerun: robots and twins from above, their bits and scores over time."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import turbopi
from matplotlib.colors import to_rgb

from twinmill.data.lcm_log import decode
from twinmill.data.log import heading_rad
from twinmill.data.multi_log import TWIN
from twinmill.model.outlines import BLIND, SEES, Body
from twinmill.report.canvas import BEFORE, PREDICTED
from twinmill.watch.live_score import LiveScore

TIME = "time"
PATH_S, POINT_S = 10.0, 0.05  # of the path behind a robot: its length, and between its points
GROUPS = {"": "robots", TWIN: "twins"}
COLORS = {"": BEFORE, TWIN: PREDICTED}
WIDE, THIN = -2.5, -1.5  # of lines: below zero are pixels for Rerun
# Of each number of up to four bits.
WORDS = (
    "none",
    "sees",
    *(f"bits {'+'.join(str(i + 1) for i in range(4) if n >> i & 1)}" for n in range(2, 16)),
)


@dataclass
class Shown:
    """One robot's or twin's entities; times in s since the start.

    Attributes:
        to: where all goes.
        prefix, name: channel prefix; R<nn>.
        body: outlines.
    """

    to: rr.RecordingStream
    prefix: str
    name: str
    body: Body
    _bit: int | None = None
    _path: deque = field(default_factory=deque)

    def __post_init__(self):
        outlines = [self.body.outline(), self.body.nose()]
        strips = [_flat(points) for points in outlines]
        lines = rr.LineStrips3D(strips, colors=self.color, radii=WIDE)
        self.to.log(f"{self.entity}/body", lines, static=True)
        label = rr.Points3D([[0, 0, 0]], labels=self.label, colors=self.color, radii=-4)
        self.to.log(f"{self.entity}/name", label, static=True)
        colors = [_rgb(BLIND), *[_rgb(SEES)] * (len(WORDS) - 1)]
        states = rr.StateConfiguration(values=WORDS, labels=WORDS, colors=colors)
        self.to.log(f"bits/{self.label}", states, static=True)

    @property
    def entity(self) -> str:
        """Path of the robot's frame."""
        return f"{GROUPS[self.prefix]}/{self.name}"

    @property
    def label(self) -> str:
        """R<nn> with the channel prefix."""
        return self.prefix + self.name

    @property
    def color(self) -> list[int]:
        """Colour of all twins, or of all robots."""
        return _rgb(COLORS[self.prefix])

    def poses(self, t_s: np.ndarray, payloads: Sequence[bytes]) -> None:
        """Moves the robot; lost poses are left out."""
        pose = decode(payloads, turbopi.pose_t, f"{self.label}_POSE")
        known = (pose["valid"] != 0) & np.isfinite(pose["position_m"]).all(axis=1)
        if not known.any():
            return
        t_s, place_m = t_s[known], np.array(pose["position_m"][known], float)
        place_m[:, 2] = 0  # the floor: markers' height is no robot's
        half_rad = heading_rad(pose["orientation_wxyz"][known].astype(float)) / 2
        zero = np.zeros_like(half_rad)
        turned = np.column_stack([zero, zero, np.sin(half_rad), np.cos(half_rad)])  # x, y, z, w
        columns = rr.Transform3D.columns(translation=place_m, quaternion=turned)
        self.to.send_columns(self.entity, [rr.TimeColumn(TIME, duration=t_s)], columns)
        for at_s, place in zip(t_s.tolist(), place_m, strict=True):
            if not self._path or at_s >= self._path[-1][0] + POINT_S:
                self._path.append((at_s, place))
        while self._path[0][0] < t_s[-1] - PATH_S:
            self._path.popleft()

    def path(self, now_s: float) -> None:
        """Draws where it came from."""
        if len(self._path) > 1:
            line = rr.LineStrips3D([[p for _, p in self._path]], colors=self.color, radii=THIN)
            self._log(f"{GROUPS[self.prefix]}/paths/{self.name}", now_s, line)

    def telemetry(self, t_s: np.ndarray, payloads: Sequence[bytes]) -> None:
        """Draws the view once there is a bit, colours it, and marks when the bit changes."""
        said = decode(payloads, turbopi.telemetry_t, f"{self.label}_TELEMETRY")
        recorded = (said["frame_utime_us"] > 0) | (said["detected"] != 0)  # else no camera was
        bits = said["detected"][recorded].tolist()
        for at_s, bit in zip(t_s[recorded].tolist(), bits, strict=True):
            if bit != self._bit:
                self._bit = bit
                view = rr.LineStrips3D(
                    [_flat(self.body.view())], radii=THIN, colors=_rgb(SEES if bit else BLIND)
                )
                self._log(f"{self.entity}/view", at_s, view)
                self._log(f"bits/{self.label}", at_s, rr.StateChange(state=WORDS[bit]))

    def scored(self, now_s: float, found: LiveScore) -> None:
        """Its score, and where the model would have it go."""
        self._log(f"score/{self.label}", now_s, rr.Scalars(found.score))
        line = rr.LineStrips3D([_flat(found.predicted[:, :2])], colors=_rgb(PREDICTED), radii=WIDE)
        self._log(f"{GROUPS[self.prefix]}/predicted/{self.name}", now_s, line)

    def _log(self, entity: str, at_s: float, what: rr.AsComponents) -> None:
        self.to.set_time(TIME, duration=at_s)
        self.to.log(entity, what)


def layout(prefixes: Sequence[str]) -> rrb.Blueprint:
    """Robots beside twins, or alone; bits and scores below.

    Args:
        prefixes: of channels, those that are there.
    """
    above = rrb.EyeControls3D(
        position=(0.0, -0.01, 5.0), look_target=(0.0, 0.0, 0.0), eye_up=(0.0, 1.0, 0.0)
    )
    floors = [
        rrb.Spatial3DView(origin=f"/{GROUPS[p]}", name=GROUPS[p], eye_controls=above)
        for p in prefixes
    ]
    over_time = [
        rrb.StateTimelineView(origin="/bits", name="bits"),
        rrb.TimeSeriesView(origin="/score", name="score of the model, 1 = noise alone"),
    ]
    return rrb.Blueprint(
        rrb.Vertical(rrb.Horizontal(*floors), rrb.Horizontal(*over_time), row_shares=[3, 1]),
        rrb.TimePanel(timeline=TIME, state="collapsed"),
        collapse_panels=True,
    )


def _flat(points_m: np.ndarray) -> np.ndarray:
    """(K, 2) on the floor to (K, 3)."""
    return np.column_stack([points_m, np.zeros(len(points_m))])


def _rgb(color: str) -> list[int]:
    return [round(255 * part) for part in to_rgb(color)]
