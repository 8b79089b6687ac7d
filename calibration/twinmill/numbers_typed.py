# SPDX-License-Identifier: Apache-2.0
"""Numbers as people type them: Python's own `int` and `float` read more than a person means.

They take `1_2`, a slip for 1,2, as twelve; digits of all scripts; blanks, which a paste may hold,
on both sides; and `nan` and `inf`, which pass some comparisons with a limit and fail others.
"""

import re

WHOLE = re.compile(r"[+-]?[0-9]+")
REAL = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")


def typed_int(text: str) -> int:
    """A number of digits 0-9 alone, and its sign.

    Raises:
        ValueError: it is none.
    """
    if not WHOLE.fullmatch(text):
        raise ValueError(f"{text!r}: is no whole number in digits 0-9.")
    return int(text)


def typed_float(text: str) -> float:
    """A finite number in digits 0-9 with at most one point, as 12, 0.5 or 1e-3.

    Raises:
        ValueError: it is none.
    """
    value = float(text) if REAL.fullmatch(text) else float("inf")
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"{text!r}: is no finite number in digits 0-9 with a point.")
    return value
