# SPDX-License-Identifier: Apache-2.0
"""Pictures of a log: paths, speeds, bits, commands; one painter per picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.ticker import MaxNLocator

from twinmill.data.camera_frames import frames_of
from twinmill.data.multi_log import TWIN, RecordedRobot
from twinmill.data.track import SILENCE_S
from twinmill.data.world_bodies import WorldBody
from twinmill.model.outlines import SEES
from twinmill.report.canvas import legend_above
from twinmill.swarm.metrics import SMOOTH, STEP_S, resample

# Colours of Okabe and Ito (2008), told apart by colour-blind readers.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#3c3c3c", "#b8a800")
WORDS = {"duty": "duty (%)", "wheel_speed": "wheel speed (rad/s)", "twist": "m/s, rad/s"}
ROWS = {"twist": ("vx", "vy", "ω")}
WHEELS = ("fl", "fr", "rl", "rr")
NOT_SEEN = "#e0e0e0"
UNSEEN = "#8a8a8a"  # bodies that no camera sees
CELL_S = 0.05  # of bits and commands over time


class Drawing:
    """Paints axes with the same robots, colours and time axis.

    Args:
        robots: whom to show; those without poses or telemetry are left out where they have nothing.
        bodies: what else is in the world.
    """

    def __init__(self, robots: list[RecordedRobot], bodies: Sequence[WorldBody] = ()):
        self._robots, self._bodies = robots, bodies
        many = colormaps["turbo"](np.linspace(0.05, 0.95, len(robots)))
        self._colors = COLORS if len(robots) <= len(COLORS) else many
        ends = [t[-1] for a in robots for t in (a.log.pose_t_s, a.log.command_t_s) if len(t)]
        self.end_s = float(max(ends))
        self.tracked = [k for k, a in enumerate(robots) if np.count_nonzero(a.log.valid) > SMOOTH]
        frames = {k: frames_of(recorded.log) for k, recorded in enumerate(robots)}
        self._frames = {k: seen for k, seen in frames.items() if seen is not None}
        self.telling = list(self._frames)
        self.bit_rows = sum(seen.told.shape[1] for seen in self._frames.values())
        self.driven = [k for k, a in enumerate(robots) if len(a.log.command_t_s)]
        self._motion = {k: _motion(robots[k]) for k in self.tracked}

    def paths(self, axes: Axes) -> None:
        """From above, dots at the ends with a line to the front; twins dashed."""
        paint_bodies(axes, self._bodies)
        for k in self.tracked:
            recorded, pose = self._robots[k], self._motion[k][1]
            color, dashed = self._colors[k], recorded.prefix == TWIN
            axes.plot(*pose[:, :2].T, color=color, lw=1, alpha=0.75, ls="--" if dashed else "-")
            x, y, theta_rad = pose[np.isfinite(pose[:, 0])][-1]
            axes.plot(x, y, "o", ms=6, color=color, zorder=3)
            front = (np.cos(theta_rad), np.sin(theta_rad))
            axes.quiver(x, y, *front, color=color, width=0.004, scale=18, zorder=3)
            axes.annotate(
                recorded.name,
                (x, y),
                xytext=(7, 5),
                textcoords="offset points",
                fontsize=8,
                color=color,
                fontweight="bold",
            )
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", adjustable="datalim")
        axes.xaxis.set_major_locator(MaxNLocator(8))

    def speed(self, axes: Axes) -> None:
        """Forward velocity of each robot over time, in m/s, from poses."""
        self._velocity(axes, 0, 1.0, "forward (m/s)")
        if len(self.tracked) > 1:
            width_in = axes.figure.bbox.width / axes.figure.dpi
            legend_above(axes, min(int(width_in), len(self.tracked)))

    def turn(self, axes: Axes) -> None:
        """Turn rate of each robot over time, in rad/s, counter-clockwise, from poses."""
        self._velocity(axes, 2, np.degrees(1), "turn (°/s)")

    def _velocity(self, axes: Axes, component: int, factor: float, label: str) -> None:
        for k in self.tracked:
            t_s, _, velocity = self._motion[k]
            axes.plot(
                t_s,
                factor * velocity[:, component],
                color=self._colors[k],
                lw=0.9,
                ls="--" if self._robots[k].prefix == TWIN else "-",
                label=self._robots[k].name,
            )
        axes.set(ylabel=label, xlim=(0, self.end_s))

    def bits(self, axes: Axes) -> None:
        """Voted bits of robots whose cameras were recorded, a row each: green where it is set."""
        rows, names = [], []
        for k, seen in self._frames.items():
            rows += list(self._held(k, seen.t_s, seen.told).T)
            count = seen.told.shape[1]
            name = self._robots[k].name
            names += [f"{name} bit {i + 1}" for i in range(count)] if count > 1 else [name]
        picture = np.ones((len(rows), len(rows[0]), 3))
        for bit, color in enumerate((NOT_SEEN, SEES)):
            picture[np.array(rows) == bit] = to_rgb(color)
        axes.imshow(picture, **self._strip(len(rows)))
        axes.set_title("green: sees a neighbour", loc="left", color=SEES)
        self._name_rows(axes, names)

    def commands(self, axes: Axes) -> None:
        """A row per wheel, blue back, red forward."""
        rows, names = [], []
        for k in self.driven:
            log = self._robots[k].log
            count = len(ROWS.get(log.command_kind, WHEELS))
            scale = 100 if log.command_kind == "duty" else 1
            rows += list(scale * self._held(k, log.command_t_s, log.command[:, :count]).T)
            names += self._row_names(k, count)
        kinds = sorted({self._robots[k].log.command_kind for k in self.driven})
        largest = 100 if kinds == ["duty"] else float(np.nanmax(np.abs(rows)))
        image = axes.imshow(
            rows, cmap="RdBu_r", vmin=-largest, vmax=largest, **self._strip(len(rows))
        )
        self._name_rows(axes, names)
        label = "; ".join(WORDS[kind] for kind in kinds)
        axes.figure.colorbar(image, ax=axes, label=label, pad=0.01, aspect=12)

    def _row_names(self, k: int, count: int) -> list[str]:
        name = self._robots[k].name
        if len(self.driven) > 2:  # one name to a robot's rows
            return [name if row == count // 2 else "" for row in range(count)]
        return [f"{name} {w}" for w in ROWS.get(self._robots[k].log.command_kind, WHEELS)]

    def _held(self, k: int, stamps_s: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(T, C) of (M, C) values at (M,), each held until the next, NaN where it is silent."""
        t_s = np.arange(CELL_S / 2, max(self.end_s, CELL_S), CELL_S)
        last = np.searchsorted(stamps_s, t_s, side="right") - 1
        silent_s = SILENCE_S if len(self._robots[k].log.detected) else np.inf
        unknown = (last < 0) | (t_s - stamps_s[np.maximum(last, 0)] > silent_s)
        return np.where(unknown[:, None], np.nan, values[np.maximum(last, 0)])

    def _strip(self, rows: int) -> dict[str, Any]:
        return {
            "aspect": "auto",
            "interpolation": "none",
            "extent": (0, self.end_s, rows - 0.5, -0.5),
        }

    def _name_rows(self, axes: Axes, names: list[str]) -> None:
        kept = [row for row, name in enumerate(names) if name]
        axes.set_yticks(kept, [names[row] for row in kept])
        axes.set(xlabel="time (s)", xlim=(0, self.end_s))
        axes.grid(False)
        axes.tick_params(left=False)


def paint_bodies(axes: Axes, bodies: Sequence[WorldBody]) -> None:
    """Bodies of a world where they were last, in their colours; dotted the ways they moved."""
    for body in bodies:
        color = body.colour or UNSEEN
        if body.moves:
            axes.plot(*body.from_m.T, color=color, lw=0.8, ls=":")
        axes.fill(*body.outline().T, color=color, alpha=0.6 if body.solid else 0.25, lw=0)


def _motion(recorded: RecordedRobot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, poses and body velocities on a regular grid; NaN where it was lost."""
    known_s = recorded.log.pose_t_s[recorded.log.valid]
    t_s = np.arange(known_s[0], max(known_s[-1], known_s[0] + SMOOTH * STEP_S), STEP_S)
    pose, velocity = resample(recorded.log, t_s)
    velocity[np.isnan(pose[:, 0])] = np.nan
    return t_s, pose, velocity
