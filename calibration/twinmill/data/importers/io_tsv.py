# SPDX-License-Identifier: Apache-2.0
"""The `io.tsv` that George Mason University's TurboPi programs write: one row per control pass."""

import ast
import csv
import re
from pathlib import Path

import numpy as np
import turbopi

from twinmill.arguments import option
from twinmill.data.importers.series import CommandSeries
from twinmill.data.log import LogError
from twinmill.data.measurement_table import open_text
from twinmill.model.mixing import duties_from_vendor_move

COLUMNS = ("time_ns", "detected", "smoothed_detected", "moves")


def read_io_tsv(path: Path, robot_id: int | None) -> CommandSeries:
    """One robot's decisions and duties.

    The last move of each pass counts: (v, d, w), d = 90 forward, w clockwise. Sideways moves are in
    the duties alone, because inputs have none.

    Args:
        path: the file, `.gz` too.
        robot_id: whose it is; None: the digits that end the name of its folder, as in
            `251205-150749-Milling-turbopi-01`.

    Raises:
        LogError: unreadable or empty file, wrong header, wrong value (its row is named), unsorted
            time, or no robot_id.
    """
    if robot_id is None:
        robot_id = _id_of_folder(path)
    times, seen, moves = [], [], []
    with open_text(path) as text:
        reader = csv.reader(text, delimiter="\t")
        header = [cell.split(" ")[0] for cell in next(reader, [])]
        if tuple(header) != COLUMNS:
            raise LogError(
                f"{path.name}: the header is {header}, but an io.tsv has "
                f"{', '.join(COLUMNS)}, parted by tabs; check that it is the right "
                "file."
            )
        for row in filter(None, reader):
            time_ns, detected, move = _parsed(row, f"{path.name}: row {reader.line_num}")
            if times and time_ns // 1000 <= times[-1]:
                raise LogError(
                    f"{path.name}: row {reader.line_num}: time_ns {time_ns} is not "
                    "later than the row before, as when the clock is set back; cut the "
                    "file there."
                )
            times.append(time_ns // 1000)
            seen.append(detected)
            moves.append(move)
    if not times:
        raise LogError(
            f"{path.name}: has no rows, so there is nothing to import; check that the "
            "robot was started."
        )
    v, d, w = np.array(moves).T
    sideways = np.count_nonzero(np.abs(v * np.cos(np.radians(d))) > 1e-6)
    warnings = (
        [f"{path.name}: {sideways} moves go sideways; the duties have it, the inputs cannot."]
        if sideways
        else []
    )
    return CommandSeries(
        robot_id=robot_id,
        utime_us=np.array(times),
        kind="duty",
        value=np.array([duties_from_vendor_move(*move) for move in moves], float),
        repeat=False,
        inputs=np.column_stack([v * np.sin(np.radians(d)), -w]),
        detected=np.array(seen),
        mode=turbopi.telemetry_t.MODE_TABLE,
        warnings=warnings,
    )


def _parsed(
    row: list[str],
    where: str,
) -> tuple[int, tuple[int, int], tuple[float, float, float]]:
    try:
        time_ns, raw, smoothed, moves = row
        v, d, w = ast.literal_eval(moves)[-1]
        move = (float(v), float(d), float(w))
        if not np.isfinite(move).all():
            raise ValueError(moves)
        return int(time_ns), (_bit(raw), _bit(smoothed)), move
    except (ValueError, SyntaxError, TypeError, IndexError, KeyError):
        raise LogError(
            f"{where}: {row} is not a time in ns, two bits and a list of moves "
            "[(v, d, w), ...]; correct or remove the row."
        ) from None


def _bit(cell: str) -> int:
    return {"0": 0, "False": 0, "1": 1, "True": 1}[cell.strip()]


def _id_of_folder(path: Path) -> int:
    digits = re.search(r"(\d{1,2})$", path.absolute().parent.name)
    if not digits:
        raise LogError(
            f"{path}: neither its folder's name ends in a robot's number nor is "
            f"{option('robot_id')} given; give it."
        )
    return int(digits[1])
