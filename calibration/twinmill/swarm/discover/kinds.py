# SPDX-License-Identifier: Apache-2.0
"""Measures that tell behaviours apart, and the names of those that are known."""

import numpy as np
import twinmill_native as native

from twinmill.swarm.classes import COLORS

COLUMNS = list(native.OUTCOMES)
# Name, bounds and cells of each measure. Circliness and scatter are decimal logarithms; the last
# cell of odd_ratio is for swarms without odd robots.
MEASURES = {
    "circliness": (-2.0, 1.0, 8),
    "rotation": (-1.0, 1.0, 5),
    "scatter": (-2.0, 2.0, 8),
    "groups": (1.0, 5.0, 4),
    "odd_ratio": (0.0, 2.5, 5),
}
NO_ODD = 2.25
KIND_COLORS = {
    "bull's-eye": "#cc79a7",
    "milling": COLORS["milling"],
    "diffusion": "#0072b2",
    "aggregation": "#e69f00",
    "dispersal": "#4c4c9d",
} | {name: color for name, color in COLORS.items() if name != "milling"}
KIND_WORDS = {
    "bull's-eye": "odd robots inside a ring that turns",
    "milling": "one steady ring",
    "diffusion": "nobody can reach another's view, and all stay near",
    "aggregation": "one group in a third of the start's scatter",
    "dispersal": "all leave, each for itself",
}


def measures(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measures of candidates, from their runs.

    Args:
        rows: (candidates, seeds, COLUMNS) metrics of the last 10 s.

    Returns:
        (candidates, MEASURES) medians, and (candidates,) how alike the seeds are: 1 minus the mean
        standard deviation in units of each measure's range.
    """
    at = {name: rows[..., k] for k, name in enumerate(COLUMNS)}
    with np.errstate(divide="ignore"):
        parts = [
            np.log10(np.nan_to_num(at["circliness"], nan=np.inf)),
            at["rotation"],
            np.log10(at["scatter_m2"]),
            at["groups"],
            np.where(np.isnan(at["odd_ratio"]), NO_ODD, np.minimum(at["odd_ratio"], 1.99)),
        ]
    low, high = np.array([bounds[:2] for bounds in MEASURES.values()]).T
    values = np.clip(np.stack(parts, axis=-1), low, high)
    alike = 1 - np.mean(values.std(axis=1) / (high - low), axis=-1)
    return np.median(values, axis=1), alike


def kinds(rows: np.ndarray, start_scatter_m2: float, range_m: float) -> list[str]:
    """Name of each run, a row of COLUMNS: a known behaviour, else its class."""
    at = {name: rows[:, k] for k, name in enumerate(COLUMNS)}
    turns = (np.abs(at["rotation"]) > 0.9) & (at["contacts"] < 0.5)
    apart, near = at["least_diffusion"] > 1, at["scatter_m2"] < (2 * range_m) ** 2
    classes = np.array(native.classify(np.ascontiguousarray(rows)))
    return np.select(
        [
            (at["odd_ratio"] < 0.8) & (at["circliness"] < 0.5) & turns,
            classes == "milling",
            apart & near,
            apart,
            (at["groups"] < 1.5) & (at["scatter_m2"] < start_scatter_m2 / 3),
        ],
        ["bull's-eye", "milling", "diffusion", "dispersal", "aggregation"],
        classes,
    ).tolist()
