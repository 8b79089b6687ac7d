# SPDX-License-Identifier: Apache-2.0
"""Moments at which a robot did what neither its commands nor what was found explain.

Where both the smooth response of the noise floor and the final model miss by far more than usually,
something happened that is not there all the time: a push, or a drop-out. Such moments are told one
by one, since no effect that acts all the time is like that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.floor import ARM_M, is_far
from twinmill.fitting.opening import Opened
from twinmill.predict.windows import HORIZONS_S

APART_S = 1.0  # between the starts of windows of two moments
LEAST_S = 1.0  # between the first and the last window of a stretch that is worth a sentence
SEEN = 2  # windows overlap, so that more than one sees what lasts
HORIZON = HORIZONS_S.index(0.5)
LESS, MORE = 0.9, 1.1  # of the predicted way
HARDLY = 0.05  # share of the way: events that all change it by less must be twice as many


@dataclass(frozen=True)
class Moment:
    """One event.

    Attributes:
        log: its name.
        robot_id: of the robot.
        t_s: capture's clock, about a quarter of a second before it.
        way: share of the predicted way that was gone in half a second.
    """

    log: str
    robot_id: int
    t_s: float
    way: float

    def to_json(self) -> dict:
        """Fields of JSON output."""
        return vars(self)


def moments_of(opened: Sequence[Opened], models: Sequence[native.Model]) -> list[Moment]:
    """Events of all logs that have several, in the order of time.

    Args:
        opened: measurements over their floors; tables have no moments.
        models: with what was found, one for each.
    """
    found = []
    for own, model in zip(opened, models, strict=True):
        if own.floor is not None:
            found += _of_log(own, model)
    return found


def _of_log(own: Opened, model: native.Model) -> list[Moment]:
    data = own.data
    missed = np.flatnonzero(
        is_far(data.errors(model), data.floor, SETTINGS.far)
        & (is_far(own.floor.across, data.floor, SETTINGS.far) | ~own.floor.keep)
    )
    events = _events(missed, data.start_s)
    enough = _weight(events, data.start_s)
    if enough < SETTINGS.several:
        return []
    every = _ways(own, model)
    ways = [float(np.nanmedian(every[event])) for event in events]
    faint = all(abs(way - 1) < HARDLY for way in ways)
    if faint and enough < 2 * SETTINGS.several:
        return []
    name, robot_id = data.measurement.log_name, data.measurement.track.robot_id
    return [
        Moment(name, robot_id, float(data.start_s[event[-1]]), way)
        for event, way in zip(events, ways, strict=True)
    ]


def _events(missed: np.ndarray, start_s: np.ndarray) -> list[np.ndarray]:
    """Windows that miss, those of each event together.

    Args:
        missed: (N,) numbers of windows, rising.
        start_s: (W,) of all windows.
    """
    clusters = np.split(missed, 1 + np.flatnonzero(np.diff(start_s[missed]) > APART_S))
    return [c for c in clusters if len(c) >= SEEN]


def _weight(events: Sequence[np.ndarray], start_s: np.ndarray) -> int:
    """How many events these are worth: one that lasts is as little an accident as two."""
    return sum(2 if _lasts(event, start_s) else 1 for event in events)


def _lasts(event: np.ndarray, start_s: np.ndarray) -> bool:
    return bool(start_s[event[-1]] - start_s[event[0]] >= LEAST_S)


def left_out(own: Opened) -> list[tuple[float, float, float]]:
    """Stretches that the floor left out as disturbed: starts of the first and the last window, s.

    And the share of the predicted way that was gone there in half a second.
    """
    gone = np.flatnonzero(~own.floor.keep)
    if not len(gone):
        return []
    start_s, way = own.data.start_s, _ways(own, own.model)
    parts = [p for p in _events(gone, start_s) if _lasts(p, start_s)]
    return [
        (float(start_s[p[0]]), float(start_s[p[-1]]), float(np.nanmedian(way[p]))) for p in parts
    ]


def _ways(own: Opened, model: native.Model) -> np.ndarray:
    """(W,) share of the predicted way that was gone in half a second."""
    predicted = own.data.windows.predicted(own.measurement, model)
    return _way(own.data.measured[:, HORIZON], predicted[:, HORIZON])


def _way(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """(W,) measured way along the predicted one, over that, of (W, 3) displacements."""
    m, p = (np.nan_to_num(d) * (1, 1, ARM_M) for d in (measured, predicted))
    return np.sum(m * p, axis=1) / np.maximum(np.sum(p * p, axis=1), 1e-12)


def sentence(moments: Sequence[Moment]) -> str:
    """What happened, for people."""
    listed = ", ".join(f"{m.t_s:.1f}" for m in moments[:3])
    more = f" s and {len(moments) - 3} more" if len(moments) > 3 else " s"
    way = float(np.median([m.way for m in moments]))
    what = "it did something else"
    if way < LESS:
        what = (
            f"it went {100 * max(way, 0):.0f} % of the predicted way in half a second, as where a "
            "motor or the supply drops out, or wheels slip or are held"
        )
    elif way > MORE:
        what = "it went further, as where it is pushed or a command was not recorded"
    at = f"At {len(moments)} moments ({listed}{more})"
    return f"{at} the robot did not follow its commands: {what}."
