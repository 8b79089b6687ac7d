# SPDX-License-Identifier: Apache-2.0
"""Numbers, their tones and refusals as the panels say them."""

import math
from pathlib import Path

from twinmill.fitting.compare import GOOD, MISSING


def check_free(path: Path) -> None:
    """Raises ValueError if a file is there, in words that do for a page: it has no --force."""
    if path.is_file():
        raise ValueError(f"{path}: exists; choose another name.")


def scored(score: float | None) -> str:
    """A score, or a dash."""
    return "-" if score is None or math.isnan(score) else f"{score:#.3g}".rstrip(".")


def tone(score: float | None) -> str:
    """CSS class of a score."""
    if score is None or not math.isfinite(score):
        return "soft"
    return "good" if score <= GOOD else "warn" if score <= MISSING else "bad"


def estimate(entry: dict) -> str:
    """A parameter as --json gives it: `deceleration 0.7 ± 0.02 m/s²`."""
    name = entry["name"].split(".", 1)[-1]
    unit = "" if entry["unit"] == "1" else f" {entry['unit'].replace('^2', '²')}"
    spread = f" ± {entry['std']:.1g}" if entry["std"] is not None else ""
    return f"{name} {entry['value']:.3g}{spread}{unit}"
