# SPDX-License-Identifier: Apache-2.0
"""Rows of a table of steady drives as they were read, each a run at an input."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Readings:
    """N rows.

    Attributes:
        input_names, columns: of I inputs and of C values.
        robot: (N,) numbers.
        inputs: (N, I).
        values: (N, C); NaN where not measured.
        still: (N,) bool: a note says that one side of the robot stood still.
        as_zero: (C,) below which a value passes for none.
        unit: (C,) 1 of the unit that the file has, to whose digits its values are rounded.
        reading: (C,) standard deviation of a single one; repeated ones tell their own.
    """

    input_names: tuple[str, ...]
    columns: tuple[str, ...]
    robot: np.ndarray
    inputs: np.ndarray
    values: np.ndarray
    still: np.ndarray
    unit: tuple[float, ...]
    as_zero: tuple[float, ...]
    reading: tuple[float, ...]
