# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies from a CSV export of OptiTrack Motive (format versions 1.21 to 1.25).

Line 1 holds pairs of key and value; then rows of types, names, identifiers and components stand
over the row `Frame,Time (Seconds),...` that names the axes. Columns are found by these rows, in
capital letters or small ones, since their order and number vary (markers, mean errors, time codes).
(docs.optitrack.com, "Data Export: CSV".) Euler angles are degrees about axes that turn with the
body, in the order that the rotation type names (help.naturalpoint.com, "Changes in Motive's
Reported Euler Angles").
"""

import csv
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path

import numpy as np

from twinmill.arguments import option
from twinmill.data.importers.series import PoseSeries, with_z_up
from twinmill.data.log import LogError
from twinmill.data.measurement_table import open_text

UNIT_M = {"Meters": 1.0, "Centimeters": 0.01, "Millimeters": 0.001}
HEADER_ROWS = 10  # more than any version has above the first frame
CAPTURE_TIME = "%Y-%m-%d %I.%M.%S.%f %p"
TIMES = ("TIME (SECONDS)", "TIME")  # from format 1.22 on, and before
QUATERNION = "Quaternion"
BODY = "rigid body"
UNNAMED = "XYZ"  # angles of a file that does not name their order
ROTATIONS = (QUATERNION, "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


@dataclass(frozen=True)
class _Header:
    """Metadata from the rows above the first frame."""

    fields: dict[str, str]
    rotation: str  # one of ROTATIONS
    bodies: dict[str, list[int]]  # name: columns of position and rotation
    time_column: int


def read_motive(
    path: Path, robots: dict[str, int], up: str, *, absolute: bool, only: int | None = None
) -> list[PoseSeries]:
    """Poses of all rigid bodies.

    Args:
        path: the export, `.gz` too, in global coordinates.
        robots: robot_id by name of the rigid body; bodies not named here get the last digits in
            their name.
        up: the axis that the export calls up, "y" by Motive's default.
        only: robot_id of the only rigid body.
        absolute: stamps since the epoch, the capture start taken as UTC; else since the start.

    Raises:
        LogError: unreadable, no Motive export, or exported in a way that holds no such poses.
    """
    with open_text(path) as text:
        first = text.readline()
        delimiter = max(",;\t", key=first.count)  # a spreadsheet writes it anew in its own way
        reader = csv.reader(chain([first], text), delimiter=delimiter)
        header = _header(reader, path.name)
        numbers = [
            _row(row, header, f"{path.name}: row {reader.line_num}") for row in filter(None, reader)
        ]
    if not numbers:
        raise LogError(f"{path.name}: has no frames; export the take again.")
    values = np.array(numbers)
    start_us = _capture_start_us(header, path.name) if absolute else 0
    utime_us = start_us + np.round(values[:, 0] * 1e6).astype(np.int64)
    if (np.diff(utime_us) <= 0).any():
        raise LogError(
            f"{path.name}: frame {np.argmax(np.diff(utime_us) <= 0) + 1} is not later "
            "than the one before; export the take again."
        )
    scale = _unit_m(header, path.name)
    blocks = np.split(values[:, 1:], len(header.bodies), axis=1)
    poses = {
        body: with_z_up(block[:, :3] * scale, _quaternion(block[:, 3:], header.rotation), up)
        for body, block in zip(header.bodies, blocks, strict=True)
    }
    return robots_of(poses, utime_us, robots, path.name, only=only)


def robots_of(
    poses: dict[str, tuple[np.ndarray, np.ndarray]],
    utime_us: np.ndarray,
    robots: dict[str, int],
    name: str,
    *,
    only: int | None = None,
) -> list[PoseSeries]:
    """The bodies that are robots and were seen; the others are named in a warning.

    Args:
        poses: (N, 3) m in W and (N, 4) quaternion, w first, of each body; NaN where it was lost.
        utime_us: (N,) ascending.
        robots: robot_id by body; others get the last digits in their names.
        name: of the file.
        only: number of the only body.

    Raises:
        LogError: no body is a robot or was seen, or two have one number.
    """
    series: dict[int, PoseSeries] = {}
    left_out = []
    for body, (position_m, quaternion) in poses.items():
        alone = len(poses) == 1 and only is not None
        number = only if alone else number_of(body, robots)
        if number in series:
            raise LogError(
                f"{name}: rigid body '{body}' gives the number {number}, which another has; give "
                f"it its own in 0..99 with {option('robot', {body: 'ID'})}."
            )
        own = _pose_series(number, utime_us, position_m, quaternion)
        if number < 0:
            left_out.append(
                f"rigid body '{body}' gives no robot_id in 0..99; give it with "
                f"{option('robot', {body: 'ID'})}"
            )
        elif not own.valid.any():
            left_out.append(f"rigid body '{body}' is never tracked; export it solved")
        else:
            series[number] = replace(own, called=body)
    if not series:
        raise LogError(f"{name}: {left_out[0]}.")
    told = [f"{name}: {reason}; it is left out." for reason in left_out]
    return [replace(s, warnings=told if k == 0 else []) for k, s in enumerate(series.values())]


def _header(reader, name: str) -> _Header:
    rows: list[list[str]] = []
    for row in reader:
        rows.append([cell.strip() for cell in row])
        if [cell.lower() for cell in rows[-1][:1]] == ["frame"]:
            break
        if len(rows) > HEADER_ROWS:
            break
    ends = [row[0].lower() for row in (*rows[:1], *rows[-1:]) if row]
    if ends != ["format version", "frame"]:
        raise LogError(
            f"{name}: does not begin with 'Format Version' and a row 'Frame,Time "
            f"(Seconds)', so it is no Motive export; use {option('poses')} for plain CSV."
        )
    fields = dict(zip(map(str.title, rows[0][::2]), rows[0][1::2], strict=False))
    for key, good in (("Rotation Type", ROTATIONS), ("Coordinate Space", ("Global",))):
        if fields.get(key, good[0]).lower() not in map(str.lower, good):
            raise LogError(
                f"{name}: {key} is '{fields[key]}', but must be {' or '.join(good)}; export "
                "again with that setting."
            )
    named = [cell.upper() for cell in rows[-1]]
    time = next((k for k, cell in enumerate(named) if cell in TIMES), None)
    if time is None:
        raise LogError(
            f"{name}: has no column {' or '.join(map(str.title, TIMES))}; export the take again."
        )
    rotation = fields.get("Rotation Type", QUATERNION if "W" in named else UNNAMED)
    rotation = next(known for known in ROTATIONS if known.lower() == rotation.lower())
    axes = "WXYZ" if rotation == QUATERNION else "XYZ"
    return _Header(fields, rotation, _bodies(rows, axes, name), time)


def _bodies(rows: list[list[str]], turned_about: str, name: str) -> dict[str, list[int]]:
    """Columns of each rigid body: position, then rotation."""
    wanted = [("Position", axis) for axis in "XYZ"]
    wanted += [("Rotation", axis) for axis in turned_about]
    kinds = [[cell.lower() for cell in row] for row in rows]
    types = next((k for k, row in enumerate(kinds) if BODY in row), None)
    if types is None:
        raise LogError(
            f"{name}: has no rigid body; define one in Motive and export again with rigid bodies."
        )
    names = rows[types + 1]
    components, axes = map(str.title, rows[-2]), map(str.upper, rows[-1])
    places: dict[str, dict[tuple[str, str], int]] = {}
    for k, (kind, *column) in enumerate(zip(kinds[types], components, axes, strict=False)):
        if kind == BODY:
            places.setdefault(names[k], {})[tuple(column)] = k
    for body, columns in places.items():
        if missing := [" ".join(c) for c in wanted if c not in columns]:
            raise LogError(
                f"{name}: rigid body '{body}' lacks {missing[0]}; export positions and rotations."
            )
    return {body: [columns[c] for c in wanted] for body, columns in places.items()}


def _row(row: list[str], header: _Header, where: str) -> list[float]:
    """Time, then the components of each body; empty cells are NaN."""
    columns = [column for body in header.bodies.values() for column in body]
    row = [cell.replace(",", ".") for cell in row]  # of numbers alone, where commas are decimal
    try:
        return [
            float(row[header.time_column]),
            *(float(row[k]) if k < len(row) and row[k].strip() else np.nan for k in columns),
        ]
    except (ValueError, IndexError) as error:
        raise LogError(
            f"{where}: holds no number where one must be ({error}); export the take again."
        ) from None


def _quaternion(turned: np.ndarray, rotation: str) -> np.ndarray:
    """(N, 4) w, x, y, z as they are, or of (N, 3) degrees about X, Y and Z in that order."""
    if rotation == QUATERNION:
        return turned
    quaternion = np.full((len(turned), 4), np.nan)
    known = np.isfinite(turned).all(axis=1)
    ordered = turned[known][:, ["XYZ".index(axis) for axis in rotation]]
    from scipy.spatial.transform import Rotation  # 28 MB, and most exports have quaternions

    about = Rotation.from_euler(rotation, ordered, degrees=True)
    quaternion[known] = about.as_quat(scalar_first=True)
    return quaternion


def _pose_series(
    robot_id: int, utime_us: np.ndarray, position_m: np.ndarray, quaternion_wxyz: np.ndarray
) -> PoseSeries:
    """Poses; not valid where a number is missing or a quaternion is far from length 1."""
    norm = np.linalg.norm(quaternion_wxyz, axis=1)
    valid = np.isfinite(position_m).all(axis=1) & (np.abs(norm - 1) < 0.05)
    unit = quaternion_wxyz / np.where(valid, norm, np.nan)[:, None]
    return PoseSeries(robot_id, utime_us, np.where(valid[:, None], position_m, np.nan), unit, valid)


def number_of(body: str, robots: dict[str, int]) -> int:
    """robot_id of a rigid body: as `robots` says, else the last digits in its name; -1 if none."""
    digits = re.findall(r"\d+", body)
    number = robots.get(body, int(digits[-1]) if digits else -1)
    return number if 0 <= number <= 99 else -1


def _unit_m(header: _Header, name: str) -> float:
    unit = header.fields.get("Length Units", "").title()
    if unit not in UNIT_M:
        raise LogError(
            f"{name}: Length Units is '{unit}', not one of {', '.join(UNIT_M)}; export "
            "again in metres, or add `,Length Units,` and what they are to line 1."
        )
    return UNIT_M[unit]


def _capture_start_us(header: _Header, name: str) -> int:
    stamp = header.fields.get("Capture Start Time", "")
    try:
        start = datetime.strptime(stamp, CAPTURE_TIME).replace(tzinfo=UTC)
    except ValueError:
        raise LogError(
            f"{name}: Capture Start Time '{stamp}' is no time like 2025-12-05 "
            "03.07.49.123 PM; correct line 1."
        ) from None
    return round(start.timestamp() * 1e6)
