# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies from a CSV export of OptiTrack Motive (format versions 1.21 to 1.24).

Line 1 holds pairs of key and value; then rows of types, names, identifiers and components stand
over the row `Frame,Time (Seconds),...` that names the axes. Columns are found by these rows, since
their order and number vary (markers, mean errors, time codes).
(docs.optitrack.com, "Data Export: CSV".)
"""

import csv
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from twinmill.data.importers.series import PoseSeries
from twinmill.data.log import LogError
from twinmill.data.measurement_table import open_text

UNIT_M = {"Meters": 1.0, "Centimeters": 0.01, "Millimeters": 0.001}
HEADER_ROWS = 10  # more than any version has above the first frame
CAPTURE_TIME = "%Y-%m-%d %I.%M.%S.%f %p"
COMPONENTS = [("Position", axis) for axis in "XYZ"] + [("Rotation", axis) for axis in "WXYZ"]


@dataclass(frozen=True)
class _Header:
    """What the rows above the first frame say."""

    fields: dict[str, str]
    bodies: dict[str, list[int]]  # name: columns of COMPONENTS
    time_column: int


def read_motive(path: Path, robots: dict[str, int], up: str, absolute: bool) -> list[PoseSeries]:
    """Poses of all rigid bodies.

    Args:
        path: the export, `.gz` too, with quaternions and global coordinates.
        robots: robot_id by name of the rigid body; bodies not named here get the last digits in
            their name.
        up: "y", Motive's default, or "z": the axis that the export calls up. Y up is turned by
            x, y, z -> x, -z, y.
        absolute: stamps since the epoch, the capture start taken as UTC; else since the start.

    Raises:
        LogError: unreadable, no Motive export, or exported in a way that holds no such poses.
    """
    with open_text(path) as text:
        reader = csv.reader(text)
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
    series = []
    for k, (name, number) in enumerate(_numbered(header, robots, path.name).items()):
        block = values[:, 1 + 7 * k : 8 + 7 * k]
        series.append(_pose_series(number, utime_us, block[:, :3] * scale, block[:, 3:], up))
        if not series[-1].valid.any():
            raise LogError(f"{path.name}: rigid body '{name}' is never tracked; export it solved.")
    return series


def _header(reader, name: str) -> _Header:
    rows: list[list[str]] = []
    for row in reader:
        rows.append([cell.strip() for cell in row])
        if rows[-1][:1] == ["Frame"]:
            break
        if len(rows) > HEADER_ROWS:
            break
    if not rows or rows[0][:1] != ["Format Version"] or rows[-1][:1] != ["Frame"]:
        raise LogError(
            f"{name}: does not begin with 'Format Version' and a row 'Frame,Time "
            "(Seconds)', so it is no Motive export; use --poses for plain CSV."
        )
    fields = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    for key, needed in (("Rotation Type", "Quaternion"), ("Coordinate Space", "Global")):
        if fields.get(key, needed) != needed:
            raise LogError(
                f"{name}: {key} is '{fields[key]}', but {needed} is needed; export "
                "again with that setting."
            )
    return _Header(fields, _bodies(rows, name), rows[-1].index("Time (Seconds)"))


def _bodies(rows: list[list[str]], name: str) -> dict[str, list[int]]:
    """Columns of each rigid body in the order of COMPONENTS."""
    types = next((k for k, row in enumerate(rows) if "Rigid Body" in row), None)
    if types is None:
        raise LogError(
            f"{name}: has no rigid body; define one in Motive and export again with rigid bodies."
        )
    names, components, axes = rows[types + 1], rows[-2], rows[-1]
    places: dict[str, dict[tuple[str, str], int]] = {}
    for k, kind in enumerate(rows[types]):
        if kind == "Rigid Body":
            places.setdefault(names[k], {})[components[k], axes[k]] = k
    for body, columns in places.items():
        if missing := [" ".join(c) for c in COMPONENTS if c not in columns]:
            raise LogError(
                f"{name}: rigid body '{body}' lacks {missing[0]}; export positions and quaternions."
            )
    return {body: [columns[c] for c in COMPONENTS] for body, columns in places.items()}


def _row(row: list[str], header: _Header, where: str) -> list[float]:
    """Time, then the seven components of each body; empty cells are NaN."""
    columns = [column for body in header.bodies.values() for column in body]
    try:
        return [
            float(row[header.time_column]),
            *(float(row[k]) if k < len(row) and row[k].strip() else np.nan for k in columns),
        ]
    except (ValueError, IndexError) as error:
        raise LogError(
            f"{where}: holds no number where one must be ({error}); export the take again."
        ) from None


def _pose_series(
    robot_id: int, utime_us: np.ndarray, position_m: np.ndarray, quaternion: np.ndarray, up: str
) -> PoseSeries:
    position_m, quaternion = with_z_up(position_m, quaternion, up)
    norm = np.linalg.norm(quaternion, axis=1)
    valid = np.isfinite(position_m).all(axis=1) & (np.abs(norm - 1) < 0.05)
    unit = quaternion / np.where(valid, norm, np.nan)[:, None]
    return PoseSeries(robot_id, utime_us, np.where(valid[:, None], position_m, np.nan), unit, valid)


def with_z_up(
    position_m: np.ndarray, quaternion_wxyz: np.ndarray, up: str
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) and (N, 4) as they are, or with y up turned by x, y, z -> x, -z, y."""
    if up == "z":
        return position_m, quaternion_wxyz
    return position_m[:, [0, 2, 1]] * [1, -1, 1], quaternion_wxyz[:, [0, 1, 3, 2]] * [1, 1, -1, 1]


def number_of(body: str, robots: dict[str, int]) -> int:
    """robot_id of a rigid body: as `robots` says, else the last digits in its name; -1 if none."""
    digits = re.findall(r"\d+", body)
    number = robots.get(body, int(digits[-1]) if digits else -1)
    return number if 0 <= number <= 99 else -1


def _numbered(header: _Header, robots: dict[str, int], name: str) -> dict[str, int]:
    """robot_id by body, in the order of the columns."""
    if unknown := set(robots) - set(header.bodies):
        raise LogError(
            f"{name}: has no rigid body '{min(unknown)}' (it has "
            f"{', '.join(header.bodies)}); correct --robot."
        )
    numbered = {}
    for body in header.bodies:
        number = number_of(body, robots)
        if number < 0 or number in numbered.values():
            raise LogError(
                f"{name}: rigid body '{body}' gives no robot_id of its own in 0..99; "
                f"give it with --robot '{body}=ID'."
            )
        numbered[body] = number
    return numbered


def _unit_m(header: _Header, name: str) -> float:
    unit = header.fields.get("Length Units", "")
    if unit not in UNIT_M:
        raise LogError(
            f"{name}: Length Units is '{unit}', not one of {', '.join(UNIT_M)}; export "
            "again in metres."
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
