# SPDX-License-Identifier: Apache-2.0
"""Units in the names of columns: `theta_deg`, `X [mm]`, `Time (s)`."""

import math
import re
from datetime import UTC, datetime

OURS = ("m", "rad", "s", "mps", "radps", "pct")
UNITS = {  # unit in a name: that of ours, and the factor
    **{unit: (unit, 1.0) for unit in OURS},
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "km": ("m", 1e3),
    "ft": ("m", 0.3048),  # international, by definition, as the mile of 5280
    "inch": ("m", 0.0254),  # a twelfth of it
    "px": ("m", math.nan),  # no table says how wide a pixel is
    "deg": ("rad", math.pi / 180),
    "mmps": ("mps", 1e-3),
    "cmps": ("mps", 1e-2),
    **dict.fromkeys(("kmh", "kmph", "kph"), ("mps", 1 / 3.6)),
    "mph": ("mps", 5280 * 0.3048 / 3600),
    "degps": ("radps", math.pi / 180),
    "rpm": ("radps", math.pi / 30),
    "rps": ("radps", 2 * math.pi),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "unit": ("pct", 100.0),  # duties of -1 to 1
    "pwm": ("pct", 100 / 255),  # duties of -255 to 255
}
SYMBOLS = {  # as people write them in brackets, beside those above
    **dict.fromkeys(("sec", "secs", "seconds"), "s"),
    **dict.fromkeys(("\u00b5s", "\u03bcs"), "us"),  # the micro sign and the Greek letter
    **dict.fromkeys(("\u00b0", "degrees", "degree", "grad"), "deg"),
    **dict.fromkeys(("radians", "radian"), "rad"),
    **dict.fromkeys(("meters", "metres"), "m"),
    **dict.fromkeys(("in", "inches"), "inch"),
    **dict.fromkeys(("\u00b0/s", "deg/s"), "degps"),
    **{"%": "pct", "m/s": "mps", "cm/s": "cmps", "mm/s": "mmps", "km/h": "kmh", "rad/s": "radps"},
}
LATEST_S = 1e11  # in the year 5138; a later stamp has another unit
LONGEST_STEP_S = 2.0  # between rows of a log: those further apart count in another unit
SINCE_1970 = {"ms": 1e14, "us": 1e17}  # stamps of our days are smaller
BRACKETED = re.compile(r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]\s*")


def plain_name(column: str) -> str:
    """A name in small letters, with underscores for spaces and dots."""
    return re.sub(r"[\s.]+", "_", column.strip().lower())


def split_unit(column: str) -> tuple[str, str]:
    """The name without its unit, and the unit as in UNITS; empty if it has none."""
    if found := BRACKETED.fullmatch(column):
        unit = found[2].lower()
        unit = SYMBOLS.get(unit, unit)
        return plain_name(found[1]), unit if unit in UNITS else ""
    stem, _, unit = plain_name(column).rpartition("_")
    return (stem, unit) if stem and unit in UNITS else (plain_name(column), "")


def unit_of_stamps(largest: float) -> str:
    """Unit of stamps by their size: s, or that in which they count since 1970."""
    if largest <= LATEST_S:
        return "s"
    return next((unit for unit, top in SINCE_1970.items() if largest < top), "ns")


def unit_of_steps(step: float) -> str:
    """Unit of stamps by the time from row to row; empty where it fits none."""
    units = (unit for unit in ("s", "ms", "us", "ns") if step * UNITS[unit][1] < LONGEST_STEP_S)
    return next(units, "")


def date_of(utime_us: int) -> datetime | None:
    """Date of a stamp in us since 1970; None where the clock counted from another moment."""
    date = datetime.fromtimestamp(utime_us / 1e6, UTC)
    return date if date.year > 2000 else None
