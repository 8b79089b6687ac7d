# SPDX-License-Identifier: Apache-2.0
"""Effects of the catalogue that a model may lack, and what each would change in a log."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import twinmill_native as native

from twinmill.data.track import Track
from twinmill.inference.candidate import Candidate, Where, with_limits, with_sizes
from twinmill.inference.steps import Steps
from twinmill.model.parameters import (
    DURATION,
    LAG,
    MOTION_STAGES,
    WHERE_OR_WHEN,
    Parameter,
    beginning_at_a_moment,
    catalogue_of,
    drives_sideways,
    effect_parameters,
    making_late,
    needing,
    newest_instance,
)

RADII = (0.12, 0.2, 0.35, 0.6)  # of a place, times the floor's side
LEAST_RADIUS_M = 0.15  # a robot's length
MOMENTS, LEAST_S = 40, 4.0  # of a log, at which a while may begin or end; its least length


def candidates(
    model: native.Model, tracks: Sequence[Track], same_clock: bool, declared: bool
) -> list[str]:
    """Effects that this robot can have and these logs can show.

    Args:
        model: of the base.
        tracks: of the logs; what begins or ends at a moment is looked for in a single one.
        same_clock: the offset of the clocks is known, so that a delay shows.
        declared: one clock stamps all, so that neither offset nor rate can be missing.
    """
    excluded: set[str] = set()
    if not same_clock:
        excluded |= {*needing("clocks"), *making_late("delay")}
    elif declared:
        excluded |= set(needing("clocks"))
    if model.get(LAG) == 0:
        excluded |= set(making_late("lag"))
    if any(np.isnan(track.battery_V).all() for track in tracks):
        excluded |= set(needing("battery"))
    if not all(track.has_heading for track in tracks):
        excluded |= set(needing("heading"))
    if len(tracks) > 1:
        excluded |= set(beginning_at_a_moment())
    names = []
    for name, card in catalogue_of(model).items():
        sideways = {*card["identify"]} and {*card["identify"]} <= {"strafe", "diagonal"}
        if sideways and not drives_sideways(model):
            continue
        if card["stage"] in MOTION_STAGES and not card["texts"] and name not in excluded:
            names.append(name)
    return names


def candidate(name: str, model: native.Model, steps: Steps) -> Candidate:
    """Change by an effect beside a model.

    Raises:
        ValueError: the effect cannot be added to this model.
    """
    model = model.copy()
    model.add_effect(name)
    parameters = effect_parameters(model, newest_instance(model, name), fresh=True, gradual=True)
    roles = [p.role for p in parameters]
    if "limit" in roles:
        return with_limits(name, parameters, model, steps)
    grid = None
    on = np.array([p.usual for p in parameters])
    where = [k for k, r in enumerate(roles) if r in WHERE_OR_WHEN and r != DURATION]
    if where:
        grid = _places(steps) if "place" in roles else _whiles(steps, len(where))
        on[where] = _everywhere([parameters[k] for k in where], steps)
        at_once_s = on[[k for k, r in enumerate(roles) if r == DURATION]]
        at = np.column_stack([grid.at, np.tile(at_once_s, (len(grid.at), 1))])
        grid = replace(grid, at=at)
    return with_sizes(name, parameters, model, steps, on=on, where=grid)


def _everywhere(where: list[Parameter], steps: Steps) -> list[float]:
    """Values at which an effect of a place or a while acts in the whole log."""
    if where[0].role == "place":
        return [*steps.place.mean(axis=0), where[2].max]
    return [0.0, where[-1].max][: len(where)]


def _places(steps: Steps) -> Where:
    """Circles on the floor, and (G, 3) their centres and radii in m.

    They overlap by half, and reach into the floor from outside, too.
    """
    low, high = np.quantile(steps.place, (0.03, 0.97), axis=0)
    side_m = float(np.max(high - low))
    at = np.array(
        [
            (x, y, r)
            for r in sorted({max(LEAST_RADIUS_M, f * side_m) for f in RADII})
            for x, y in product(
                *(np.arange(a - r, b + r, r) for a, b in zip(low, high, strict=True))
            )
        ]
    )
    x, y = steps.place.T
    inside = np.hypot(x - at[:, :1], y - at[:, 1:2]) < at[:, 2:]
    used = inside.any(axis=1)
    return Where(inside[used].astype(float), at[used])


def _whiles(steps: Steps, count: int) -> Where:
    """Times from a moment on, or between two, and (G, count) these in s."""
    t_s, begin_s = steps.t_s, steps.logs[0].measurement.track.command_t_s[0]
    grid_s = np.linspace(t_s[0], t_s[-1], MOMENTS + 2)[1:-1]
    masks = (t_s >= grid_s[:, None]).astype(float)
    if count == 1:
        return Where(masks, (grid_s - begin_s)[:, None])
    ends = np.column_stack(np.triu_indices(len(grid_s), 1))
    ends = ends[grid_s[ends[:, 1]] - grid_s[ends[:, 0]] >= LEAST_S]
    return Where(masks, grid_s[ends] - begin_s, ends)
