# SPDX-License-Identifier: Apache-2.0
"""Where a model fails: prediction errors of half a second, sorted by what the robot was doing."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from twinmill.data.track import Track, command_at
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.residual import body_velocity
from twinmill.predict.windows import HORIZONS_S, Windows

HORIZON = HORIZONS_S.index(0.5)
FEWEST = 8  # windows, below which a regime says nothing
SETTLED_S = 0.7  # after it a robot with a lag of 0.1 s has reached 99.9 % of its speed
DUTY_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.001)
TURNING_RADPS, MOVING_MPS = 0.3, 0.02
QUARTERS = ("first", "second", "third", "last")


@dataclass(frozen=True)
class Regime:
    """One regime: share of all squared error (over floor), and RMS error over floor within it."""

    group: str
    regime: str
    share: float
    ratio: float
    windows: int

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return vars(self)


def where_it_fails(
    modelled: ModelledLog, windows: Windows, errors: np.ndarray, floor: np.ndarray
) -> list[Regime]:
    """Regimes with enough windows, by group; within a group the worst first."""
    over = (errors[:, HORIZON] / floor[HORIZON]) ** 2
    judged = np.isfinite(floor[HORIZON])  # a channel without a floor was not recorded, or is still
    if not judged.any():
        return []
    squares = over[:, judged].mean(axis=1)
    known = np.isfinite(squares)
    regimes = []
    for group, name, mask in regime_masks(modelled, windows):
        inside = mask & known
        if np.count_nonzero(inside) >= FEWEST:
            regimes.append(
                Regime(
                    group,
                    name,
                    float(squares[inside].sum() / squares[known].sum()),
                    float(np.sqrt(squares[inside].mean())),
                    int(inside.sum()),
                )
            )
    order = {group: i for i, group in enumerate(dict.fromkeys(r.group for r in regimes))}
    return sorted(regimes, key=lambda r: (order[r.group], -r.ratio))


def regime_masks(modelled: ModelledLog, windows: Windows) -> Iterator[tuple[str, str, np.ndarray]]:
    """(group, regime, (W,) bool): windows that lie in each regime."""
    track, starts = modelled.measurement.track, windows.starts
    t_s = track.pose_t_s[starts] - modelled.model.get("clock.offset_s")
    yield from _by_change(track, t_s)
    yield from _by_motion(modelled, starts)
    if track.command_kind == "duty":
        level = np.abs(
            command_at(t_s + HORIZONS_S[HORIZON] / 2, track.command_t_s, track.command)
        ).max(1)
        for low, high in pairwise(DUTY_EDGES):
            yield "duty", f"{100 * low:.0f} to {100 * high:.0f} %", (level > low) & (level <= high)
    edges = np.quantile(t_s, (0.25, 0.5, 0.75))
    for i, name in enumerate(QUARTERS):
        yield "time", f"{name} quarter", np.searchsorted(edges, t_s) == i
    x_m, y_m = track.pose[starts, 0], track.pose[starts, 1]
    east, north = x_m > np.median(x_m), y_m > np.median(y_m)
    for name, mask in (
        ("+x +y", east & north),
        ("-x +y", ~east & north),
        ("-x -y", ~east & ~north),
        ("+x -y", east & ~north),
    ):
        yield "place", name, mask


def _by_change(track: Track, t_s: np.ndarray) -> Iterator[tuple[str, str, np.ndarray]]:
    """By what the commands did from shortly before the window until its end."""
    grid = np.arange(-SETTLED_S, HORIZONS_S[HORIZON], 0.02)
    command = command_at((t_s[:, None] + grid).ravel(), track.command_t_s, track.command)
    command = command.reshape(len(t_s), len(grid), -1)
    zero = np.all(command == 0, axis=2)
    constant = np.all(command == command[:, :1], axis=(1, 2))
    still = zero.all(1)
    yield "phase", "standing", still
    yield "phase", "steady", constant & ~still
    yield "phase", "starting", ~constant & zero[:, 0] & ~zero[:, -1]
    yield "phase", "stopping", ~constant & ~zero[:, 0] & zero[:, -1]
    yield "phase", "changing", ~constant & (zero[:, 0] == zero[:, -1])


def _by_motion(modelled: ModelledLog, starts: np.ndarray) -> Iterator[tuple[str, str, np.ndarray]]:
    velocity = np.full((len(modelled.measurement.track.pose), 3), np.nan)
    velocity[modelled.grid.source] = body_velocity(
        modelled.measurement, modelled.grid, modelled.model
    )
    forward, left, turn = np.nan_to_num(velocity[starts]).T
    turning = np.abs(turn) > TURNING_RADPS
    yield "motion", "turning left", turning & (turn > 0)
    yield "motion", "turning right", turning & (turn < 0)
    yield "motion", "forward", ~turning & (forward > MOVING_MPS) & (forward > np.abs(left))
    yield "motion", "backward", ~turning & (forward < -MOVING_MPS) & (-forward > np.abs(left))
    yield (
        "motion",
        "sideways",
        ~turning & (np.abs(left) > MOVING_MPS) & (np.abs(left) >= np.abs(forward)),
    )
