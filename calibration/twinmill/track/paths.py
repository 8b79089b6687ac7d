# SPDX-License-Identifier: Apache-2.0
"""Paths of robots from the tags seen in a film: a tag is its robot; what cannot be is left out."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twinmill.arguments import option
from twinmill.files import replacing
from twinmill.track.detect import FAMILY, ROBOTS, Sightings, check_single
from twinmill.track.floor import View
from twinmill.track.locate import Squares, fit_squares, locate

SIZE_OFF = 0.07  # of the side: all tags together are of another size, or at another height
SIZE_ODD = 0.25  # one sighting is no tag of ours
ERROR_PX = 3.0
FASTEST_MPS, FASTEST_RADPS = 3.0, 20.0  # no small robot does both to a place and back in two frames
FEWEST = 3  # sightings of a robot that was not asked for


@dataclass(frozen=True)
class Tags:
    """Tags as printed on the robots.

    Attributes:
        size_m: side of the black square.
        height_m: over the floor.
        robots: which are there; None: all that are seen.
        family: of `detect.FAMILIES`.
    """

    size_m: float
    height_m: float
    robots: frozenset[int] | None = None
    family: str = FAMILY


@dataclass(frozen=True)
class RobotPath:
    """One robot over all frames of a film.

    Attributes:
        robot_id: its tag's number.
        t_s: (F,) middle of the exposure, at the tag's own row of the picture.
        pose: (F, 3) x_m, y_m, theta_rad in W; NaN where it was not seen.
        error_px: (F,) of the corners; NaN where it was not seen.
        scale_px_per_m: (F,) of the picture there.
        odd: sightings that were left out.
    """

    robot_id: int
    t_s: np.ndarray
    pose: np.ndarray
    error_px: np.ndarray
    scale_px_per_m: np.ndarray
    odd: int

    @property
    def valid(self) -> np.ndarray:
        """(F,) bool: whether the tag was found in that frame."""
        return np.isfinite(self.pose[:, 0])


def follow(stamp_s: np.ndarray, seen: Sightings, view: View, tags: Tags) -> list[RobotPath]:
    """Paths of all robots.

    Args:
        stamp_s: (F,) start of exposure of each frame's first row.
        seen: in these frames.
        view: the camera.
        tags: what is on the robots.

    Raises:
        ValueError: no tag was found, a robot never was, two have one number, or the tags are of
            another size.
    """
    counts = {n: int(np.sum(seen.number == n)) for n in np.unique(seen.number).tolist()}
    robots = _choose(counts, len(stamp_s), tags.robots)
    seen = seen.of(np.isin(seen.number, robots))
    squares = locate(view, seen.corners_px, tags.size_m, tags.height_m)
    _check_size(squares, tags)
    ratio = squares.side_m / np.nanmedian(squares.side_m)
    good = (np.abs(ratio - 1) < SIZE_ODD) & (squares.error_px < ERROR_PX)
    check_single(seen.of(good))
    return [
        _one(
            robot_id=n, stamp_s=stamp_s, seen=seen, squares=squares, good=good, view=view, tags=tags
        )
        for n in robots
    ]


def _choose(counts: dict[int, int], frames: int, wanted: frozenset[int] | None) -> list[int]:
    seen = [n for n in counts if n in ROBOTS]
    if not seen:
        raise ValueError(
            f"no robot's tag was found in {frames} frames; see that tags of `twinmill track tags` "
            "are in "
            "view, sharp, and at least 20 px wide."
        )
    if wanted is None:
        sure = [n for n in seen if counts[n] >= FEWEST]
        return sure or seen
    if missing := sorted(wanted - set(seen)):
        names = ", ".join(map(str, sorted(seen)))
        raise ValueError(
            f"{option('robots')}: tag {missing[0]} was in none of {frames} frames, those of "
            f"{names} were; "
            "see which tag is on which robot."
        )
    return sorted(wanted)


def _check_size(squares: Squares, tags: Tags) -> None:
    side_m = float(np.nanmedian(squares.side_m))
    if not abs(side_m / tags.size_m - 1) < SIZE_OFF:
        raise ValueError(
            f"{option('size', tags.size_m)}: the tags look {side_m:.3f} m wide at a height of "
            f"{tags.height_m:g} m; measure the black square's side, its height, and the floor."
        )


def _one(
    robot_id: int,
    stamp_s: np.ndarray,
    seen: Sightings,
    squares: Squares,
    *,
    good: np.ndarray,
    view: View,
    tags: Tags,
) -> RobotPath:
    """One robot: of two sightings of it in a frame the better, no impossible jumps, rows' times."""
    mine = np.flatnonzero(seen.number == robot_id)
    kept = mine[good[mine]]
    order = np.lexsort([squares.error_px[kept], seen.frame[kept]])
    kept = kept[order]
    kept = kept[np.append(True, np.diff(seen.frame[kept]) > 0)] if len(kept) else kept
    frame = seen.frame[kept]
    camera = view.camera
    row_px = seen.corners_px[kept].mean(axis=1)[:, 1]
    t_s = stamp_s + camera.exposure_s / 2 + camera.line_delay_s * camera.size_px[1] / 2
    t_s[frame] += camera.line_delay_s * (row_px - camera.size_px[1] / 2)
    pose = squares.pose[kept]
    if camera.line_delay_s and len(kept) > 2:
        pose = _unrolled(t_s[frame], pose, seen.corners_px[kept], view, tags=tags)
    sane = ~_jumps(t_s[frame], pose)
    frame, pose, kept = frame[sane], pose[sane], kept[sane]
    full = np.full((len(stamp_s), 3), np.nan)
    error_px, scale = np.full(len(stamp_s), np.nan), np.full(len(stamp_s), np.nan)
    full[frame], error_px[frame] = pose, squares.error_px[kept]
    scale[frame] = squares.scale_px_per_m[kept]
    return RobotPath(robot_id, t_s, full, error_px, scale, len(mine) - len(kept))


def _unrolled(
    t_s: np.ndarray, pose: np.ndarray, corners_px: np.ndarray, view: View, *, tags: Tags
) -> np.ndarray:
    """Poses from corners moved to the time of the tag's middle row: a shutter shears what moves."""
    straight = np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])])
    speed = np.gradient(straight, t_s, axis=0)
    met = view.on_plane(corners_px.reshape(-1, 2), tags.height_m).reshape(-1, 4, 2)
    late_s = view.camera.line_delay_s * (
        corners_px[..., 1] - corners_px[..., 1].mean(axis=1, keepdims=True)
    )
    arm = met - met.mean(axis=1, keepdims=True)
    turning = speed[:, 2, None, None] * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
    moved = met - late_s[..., None] * (speed[:, None, :2] + turning)
    return fit_squares(view, corners_px, moved, tags.size_m, height_m=tags.height_m).pose


def _jumps(t_s: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """(N,) bool: poses too far from the one before and the one after, which agree."""
    odd = np.zeros(len(pose), bool)
    if len(pose) < 3:
        return odd
    far = too_far(t_s[:-1], pose[:-1], t_s[1:], pose[1:])
    agree = ~too_far(t_s[:-2], pose[:-2], t_s[2:], pose[2:])
    odd[1:-1] = far[:-1] & far[1:] & agree
    return odd


def too_far(t0_s: np.ndarray, a: np.ndarray, t1_s: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) bool: no small robot goes from (..., 3) poses `a` to poses `b` in that time."""
    step = b - a
    turn = np.abs(np.angle(np.exp(1j * step[..., 2])))
    away = np.hypot(step[..., 0], step[..., 1])
    span_s = t1_s - t0_s
    return (away > FASTEST_MPS * span_s) | (turn > FASTEST_RADPS * span_s)


def write_poses(path: Path, paths: list[RobotPath], height_m: float, force: bool) -> None:
    """Writes the CSV that `twinmill import --poses` reads; lost poses are rows without numbers."""
    rows = sorted(
        (t, p.robot_id, *pose) for p in paths for t, pose in zip(p.t_s, p.pose, strict=True)
    )
    with replacing(path, force) as temporary, temporary.open("w") as file:
        file.write("t_s,robot_id,x_m,y_m,theta_rad,z_m,valid\n")
        for t_s, robot_id, x_m, y_m, theta_rad in rows:
            if np.isfinite(x_m):
                pose = f"{x_m:.6f},{y_m:.6f},{theta_rad:.6f},{height_m:g},1"
            else:
                pose = ",,,,0"
            file.write(f"{t_s:.6f},{robot_id},{pose}\n")
