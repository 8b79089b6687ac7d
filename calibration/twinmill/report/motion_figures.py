# SPDX-License-Identifier: Apache-2.0
"""Figures of motion: measured against predicted, and where on the floor they differ."""

import numpy as np
import twinmill_native as native
from matplotlib.ticker import MaxNLocator

from twinmill.data.track import Track
from twinmill.fitting.compare import RobotComparison
from twinmill.predict.regimes import HORIZON
from twinmill.predict.residual import body_velocity, rotate
from twinmill.predict.windows import HORIZONS_S
from twinmill.report.canvas import MEASURED, PREDICTED, draw, legend_above
from twinmill.report.html import Figure

STRETCH_S = 20.0  # that can be looked at without getting lost
RESTART_S = 2.0  # predictions start anew from the measured pose
EVERY_S = 0.05  # points of a drawn line
SMOOTH_S = 0.05  # half width of the measured velocity's window
CELLS = 9  # of the floor map along its longer side


def path(robot: RobotComparison) -> Figure:
    """A stretch of path with predictions that start from measured poses."""
    track = robot.scene.measurement.track
    index = _stretch(robot)
    starts, ends = _restarts(track, index)
    ahead = native.windows(robot.scene.model, robot.scene.measurement.played, starts, ends)
    measured = _broken_line(track, index[:: max(1, round(EVERY_S / track.timing.pose_period_s))])

    def paint(axes) -> None:
        axes.plot(
            measured[:, 0], measured[:, 1], color=MEASURED, lw=2.5, alpha=0.5, label="measured"
        )
        for k, (start, end, predicted) in enumerate(zip(starts, ends, ahead, strict=True)):
            line = np.vstack([track.pose[start, :2], predicted[end >= 0, :2]])
            axes.plot(*line.T, color=PREDICTED, lw=1.3, label="predicted" if k == 0 else None)
        axes.plot(
            *track.pose[starts, :2].T, "o", ms=3.5, color=MEASURED, label="start of a prediction"
        )
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", adjustable="datalim")
        axes.xaxis.set_major_locator(MaxNLocator(6))
        legend_above(axes, 3)

    t_s = track.pose_t_s[index]
    return Figure(
        draw(4.4, paint),
        "Measured and predicted path",
        f"Seen from above, the {STRETCH_S:g} s of the log in which the model misses most, from "
        f"{t_s[0]:.0f} s on. Every {RESTART_S:g} s the model is told where the robot is and must "
        "say on its own where it goes from there. The better the model, the closer the thin "
        "lines lie on the thick one.",
    )


def speeds(robot: RobotComparison) -> Figure:
    """Velocities in the body frame over the same stretch."""
    scene, track = robot.scene, robot.scene.measurement.track
    index = _stretch(robot)
    inside = np.isin(scene.grid.source, index)
    predicted = body_velocity(scene.measurement, scene.grid, scene.model)[inside]
    t_s = scene.grid.t_s[inside]
    measured = _measured_velocity(track, index)
    thin = max(1, round(0.02 / track.timing.pose_period_s))
    panels_of = (
        ("forward (m/s)", 0, 1.0),
        ("left (m/s)", 1, 1.0),
        ("turn (°/s)", 2, np.degrees(1)),
    )

    def paint(panels) -> None:
        for (label, axis, factor), axes in zip(panels_of, panels, strict=True):
            axes.plot(
                track.pose_t_s[index][::thin],
                factor * measured[::thin, axis],
                color=MEASURED,
                lw=2.2,
                alpha=0.5,
                label="measured",
            )
            axes.plot(
                t_s[::thin],
                factor * predicted[::thin, axis],
                color=PREDICTED,
                lw=1.2,
                label="predicted",
            )
            axes.set_ylabel(label)
        low = min(-0.05, *panels[1].get_ylim())
        panels[1].set_ylim(low, max(0.05, panels[1].get_ylim()[1]))
        legend_above(panels[0], 2)
        panels[-1].set_xlabel("time in the log (s)")
        panels[-1].xaxis.set_major_locator(MaxNLocator(6, integer=True))

    return Figure(
        draw(5.2, paint, nrows=3, sharex=True),
        "Measured and predicted speed",
        "The same seconds: speed forward, to the left, and turning (counter-clockwise is "
        "positive). Wrong heights are wrong gains; edges that come late or are too round are "
        "delays and lags.",
    )


def floor_map(robot: RobotComparison) -> Figure:
    """Mean signed error of predictions half a second ahead, by place."""
    track, starts = robot.scene.measurement.track, robot.windows.starts
    heading_rad = track.heading_smooth[starts]
    error = robot.errors[:, HORIZON]
    world = np.column_stack(rotate(error[:, 0], error[:, 1], heading_rad))
    known = np.isfinite(world).all(axis=1)
    place, mean, count = _cells(track.pose[starts[known], :2], world[known])
    length = np.hypot(*mean.T)
    largest = max(float(length.max(initial=0)), 1e-9)
    span = max(float(np.ptp(place, axis=0).max(initial=0)), 0.2)
    scale = 0.9 * span / CELLS / largest

    def paint(axes) -> None:
        tip = place + scale * mean
        axes.scatter(*place.T, s=4 + 2 * np.sqrt(count), color="#bbbbbb", zorder=2)
        axes.quiver(
            *place.T,
            *(tip - place).T,
            angles="xy",
            scale_units="xy",
            scale=1,
            color=PREDICTED,
            width=0.006,
            zorder=3,
        )
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", adjustable="datalim")
        axes.margins(0.15)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.set_title(f"longest arrow: {1000 * largest:.3g} mm", loc="left", color=PREDICTED)

    return Figure(
        draw(4.4, paint),
        "Where on the floor it fails",
        f"An arrow shows which way, on average, the robot ended up from its prediction "
        f"{HORIZONS_S[HORIZON]:g} s ahead. Arrows that all point one way are a tilted or grained "
        "floor; arrows in one corner are a patch; arrows that point anywhere are noise.",
    )


def _stretch(robot: RobotComparison) -> np.ndarray:
    """Indices of the poses of the 20 s in which predictions miss most."""
    track, starts = robot.scene.measurement.track, robot.windows.starts
    square = np.nansum((robot.errors / robot.floor.rms)[:, HORIZON] ** 2, axis=1)
    total = np.concatenate([[0], np.cumsum(square)])
    t_s = track.pose_t_s[starts]
    begins = np.flatnonzero(t_s <= max(t_s[0], t_s[-1] - STRETCH_S))
    finish = np.searchsorted(t_s, t_s[begins] + STRETCH_S)
    from_s = t_s[begins[np.argmax(total[finish] - total[begins])]]
    inside = (track.pose_t_s >= from_s) & (track.pose_t_s <= from_s + STRETCH_S)
    return np.flatnonzero(inside & (track.segment >= 0))


def _broken_line(track: Track, index: np.ndarray) -> np.ndarray:
    """(N, 3) poses with a row of NaN between stretches."""
    breaks = np.flatnonzero(np.diff(track.segment[index])) + 1
    return np.insert(track.pose[index], breaks, np.nan, axis=0)


def _restarts(track: Track, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts (K,) every 2 s, and the poses (K, L) on the way to the next; -1 beyond a break."""
    every = max(1, round(EVERY_S / track.timing.pose_period_s))
    starts = index[
        np.searchsorted(
            track.pose_t_s[index],
            np.arange(track.pose_t_s[index[0]], track.pose_t_s[index[-1]], RESTART_S),
        )
    ]
    offsets = np.arange(every, round(RESTART_S / track.timing.pose_period_s) + 1, every)
    ends = starts[:, None] + offsets
    inside = ends <= index[-1]
    ends = np.where(inside, ends, 0)
    ends[~inside | (track.segment[ends] != track.segment[starts][:, None])] = -1
    ends[np.cumsum(ends < 0, axis=1) > 0] = -1
    return starts.astype(np.int64), np.ascontiguousarray(ends, np.int64)


def _measured_velocity(track: Track, index: np.ndarray) -> np.ndarray:
    """(N, 3) forward, left, turn by central differences; NaN beside a break."""
    half = max(1, round(SMOOTH_S / track.timing.pose_period_s))
    behind = np.maximum(index - half, 0)
    ahead = np.minimum(index + half, len(track.pose) - 1)
    span_s = (track.pose_t_s[ahead] - track.pose_t_s[behind])[:, None]
    rate = (track.pose[ahead] - track.pose[behind]) / span_s
    forward, left = rotate(rate[:, 0], rate[:, 1], -track.heading_smooth[index])
    broken = (track.segment[behind] != track.segment[index]) | (
        track.segment[ahead] != track.segment[index]
    )
    velocity = np.column_stack([forward, left, rate[:, 2]])
    velocity[broken] = np.nan
    return velocity


def _cells(place: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean place, mean error and count of windows in square cells of the floor."""
    size_m = max(float(np.ptp(place, axis=0).max(initial=0)), 0.2) / CELLS
    _, cell = np.unique(np.floor((place - place.min(0)) / size_m), axis=0, return_inverse=True)
    count = np.bincount(cell.ravel())
    mean = [np.bincount(cell.ravel(), values) / count for values in (*place.T, *error.T)]
    return np.column_stack(mean[:2]), np.column_stack(mean[2:]), count
