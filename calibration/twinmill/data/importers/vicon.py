# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies from a CSV export of Vicon Tracker or Nexus: its part of Objects or of Segments.

A part has five rows over its frames: its name; frames a second; the bodies' names, each over its
first column; `Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ` (with RW where rotations are quaternions); units.
An empty row ends it. Three angles are a helical vector (Tracker) or Euler's, about X, the new Y and
the new Z; the file does not say which. A robot drives on its floor: the reading is taken by which
the floor's vertical stays where it is in the body's axes.
"""

import csv
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from twinmill.arguments import option
from twinmill.data.importers.motive import robots_of
from twinmill.data.importers.series import PoseSeries, with_z_up
from twinmill.data.log import LogError
from twinmill.data.measurement_table import open_text

PARTS = ("Objects", "Segments")
POSITION, ANGLES, QUATERNION = ("TX", "TY", "TZ"), ("RX", "RY", "RZ"), ("RW", "RX", "RY", "RZ")
UNIT_M = {"mm": 0.001, "cm": 0.01, "m": 1.0}
UNIT_RAD = {"deg": np.pi / 180, "rad": 1.0}
BEFORE_NAME = re.compile(r"^global angle\s+", re.IGNORECASE)
READINGS = (
    ("a helical vector", Rotation.from_rotvec),
    ("Euler's", partial(Rotation.from_euler, "XYZ")),
)
LAST = {"x": "zyx", "y": "zxy", "z": "yxz"}  # orders of turns whose last is about the one
APART_RAD = 0.01  # of headings, from which it matters which they are


@dataclass(frozen=True)
class _Part:
    """Objects or Segments of a file.

    Attributes:
        rate_hz: of its frames.
        bodies: of each, the column of each component.
        unit: of each column.
        rows: of frames; numbers as they stand, and None where there is none.
    """

    rate_hz: float
    bodies: dict[str, dict[str, int]]
    unit: list[str]
    rows: np.ndarray


def read_vicon(
    path: Path, robots: dict[str, int], up: str, only: int | None = None
) -> list[PoseSeries]:
    """Poses of all bodies, stamped from the capture's first frame on.

    Args:
        path: the export, `.gz` too.
        robots: robot_id by name of the body; others get the last digits in their names.
        up: the axis that the export calls up, "z" by Vicon's default.
        only: robot_id of the only body.

    Raises:
        LogError: unreadable, no such export, or nothing in it is a robot's.
    """
    with open_text(path) as text:
        lines = text.read().splitlines()
    part = _part(lines, path.name)
    t_s = (part.rows[:, 0] - 1) / part.rate_hz
    if (np.diff(t_s) <= 0).any():
        row = int(np.argmax(np.diff(t_s) <= 0))
        raise LogError(
            f"{path.name}: frame {part.rows[row + 1, 0]:g} comes after frame {part.rows[row, 0]:g};"
            " export the capture again, without sub frames."
        )
    poses, warnings = {}, []
    for body, columns in part.bodies.items():
        position_m, quaternion, warning = _pose(part, columns, up, f"{path.name}: '{body}'")
        poses[body] = with_z_up(position_m, quaternion, up)
        warnings += [warning] if warning else []
    utime_us = np.round(1e6 * t_s).astype(np.int64)
    series = robots_of(poses, utime_us, robots, path.name, only=only)
    series[0].warnings.extend(warnings)
    return series


def _part(lines: list[str], name: str) -> _Part:
    """The first part that has poses."""
    delimiter = max(",;\t", key="".join(lines[:10]).count)
    rows = [[c.strip() for c in row] for row in csv.reader(lines, delimiter=delimiter)]
    parts = [k for k, row in enumerate(rows) if row and row[0].strip("\ufeff") in PARTS]
    if not parts or len(rows) < parts[0] + 6:
        raise LogError(
            f"{name}: has no part 'Objects' or 'Segments' with frames, so it is no Vicon export of "
            f"rigid bodies; use {option('poses')} for plain CSV."
        )
    rate, bodies, axes, units, *frames = rows[parts[0] + 1 :]
    try:
        rate_hz = float(rate[0])
    except (IndexError, ValueError):
        rate_hz = 0.0
    if not rate_hz > 0 or axes[:1] != ["Frame"]:
        raise LogError(
            f"{name}: below '{rows[parts[0]][0]}' there must be the frames a second, the bodies' "
            "names and 'Frame,Sub Frame,RX,...'; export again as CSV."
        )
    end = next((k for k, row in enumerate(frames) if not any(row)), len(frames))
    numbers = _numbers(
        frames[:end], width=len(axes), delimiter=delimiter, first_row=parts[0] + 6, name=name
    )
    units += [""] * (len(axes) - len(units))
    return _Part(rate_hz, _bodies(bodies, axes, name), [u.lower() for u in units], numbers)


def _numbers(
    frames: list[list[str]], *, width: int, delimiter: str, first_row: int, name: str
) -> np.ndarray:
    """(N, width), NaN where a cell is empty."""
    if not frames:
        raise LogError(f"{name}: has no frames; export the capture again.")
    values = np.full((len(frames), width), np.nan)
    for k, row in enumerate(frames):
        for column, cell in enumerate(row[:width]):
            try:
                if cell:
                    values[k, column] = float(cell.replace(",", ".") if delimiter != "," else cell)
            except ValueError:
                raise LogError(
                    f"{name}: row {first_row + k}: '{cell}' is no number; export the capture again."
                ) from None
    if np.isnan(values[:, 0]).any():
        row = first_row + int(np.argmax(np.isnan(values[:, 0])))
        raise LogError(f"{name}: row {row} has no frame number; export the capture again.")
    return values


def _bodies(names: list[str], axes: list[str], name: str) -> dict[str, dict[str, int]]:
    """Columns of each body by component; a body's columns go on to the next name."""
    starts = [k for k, cell in enumerate(names[: len(axes)]) if cell]
    found = {}
    for first, end in zip(starts, [*starts[1:], len(axes)], strict=True):
        # `turtle3:turtle3`, or `Global Angle turtle3:turtle3`; a segment of another name counts.
        subject, _, segment = BEFORE_NAME.sub("", names[first]).partition(":")
        body = subject if segment in ("", subject) else f"{subject}:{segment}"
        columns = {axes[k].upper(): k for k in range(first, end) if axes[k]}
        if set(POSITION) | set(ANGLES) <= set(columns):
            found[body] = columns
    if not found:
        raise LogError(
            f"{name}: no body has RX, RY, RZ, TX, TY, TZ; export objects with rotations and "
            "translations."
        )
    return found


def _pose(
    part: _Part, columns: dict[str, int], up: str, who: str
) -> tuple[np.ndarray, np.ndarray, str]:
    """(N, 3) m, (N, 4) quaternion, w first, and which angles were taken, where it matters.

    Vicon writes zeros, or nothing, where a body is lost.
    """
    place = [columns[c] for c in POSITION]
    scale = _scale(part, columns["TX"], UNIT_M, who)
    at = [columns[c] for c in (QUATERNION if "RW" in columns else ANGLES)]
    seen = np.isfinite(part.rows[:, place + at]).all(axis=1) & part.rows[:, place].any(axis=1)
    position_m = np.where(seen[:, None], part.rows[:, place] * scale, np.nan)
    quaternion = np.full((len(seen), 4), np.nan)
    warning = ""
    if "RW" in columns:
        quaternion[seen] = part.rows[seen][:, at]
    elif seen.any():
        angles = _scale(part, columns["RX"], UNIT_RAD, who) * part.rows[seen][:, at]
        turned, warning = _read(angles, up, who)
        quaternion[seen] = turned.as_quat(scalar_first=True)
    return position_m, quaternion, warning


def _scale(part: _Part, column: int, known: dict[str, float], who: str) -> float:
    unit = part.unit[column]
    if unit not in known:
        raise LogError(
            f"{who}: has the unit '{unit}', not one of {', '.join(known)}; correct the row of "
            "units."
        )
    return known[unit]


def _read(angles_rad: np.ndarray, up: str, who: str) -> tuple[Rotation, str]:
    """The reading of (N, 3) angles by which the floor's vertical moves least in the body's axes.

    A body may be fixed to its robot at any tilt. With it which was chosen, if it matters.
    """
    vertical = np.eye(3)["xyz".index(up)]
    tilts_rad, headings_rad = [], []
    readings = [reading(angles_rad) for _, reading in READINGS]
    for turned in readings:
        tilts_rad.append(float(np.linalg.norm(turned.inv().apply(vertical).std(axis=0))))
        headings_rad.append(turned.as_euler(LAST[up])[:, 2])
    best = int(np.argmin(tilts_rad))
    apart_rad = np.angle(np.exp(1j * np.diff(headings_rad, axis=0)))
    if np.abs(apart_rad).max() < APART_RAD:
        return readings[best], ""
    sway, other = (np.degrees(tilts_rad[k]) for k in (best, 1 - best))
    return readings[best], (
        f"{who}: its angles were taken for {READINGS[best][0]}, by which it sways by {sway:.1f} "
        f"degrees (as {READINGS[1 - best][0]} by {other:.1f}): the file does not say what they are."
    )
