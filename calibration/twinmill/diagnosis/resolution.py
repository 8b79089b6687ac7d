# SPDX-License-Identifier: Apache-2.0
"""How small a difference of one robot from its model its logs would have shown."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import twinmill_native as native

from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import State
from twinmill.fitting.opening import Opened, wide_gains
from twinmill.model.parameters import BASE_GAINS, GAINS, Parameter, drives_sideways


@dataclass(frozen=True)
class Resolution:
    """Smallest visible differences of one robot in all its logs.

    Attributes:
        robot_id: whose.
        speed, turn: smallest differences of its speed and of its rate of turn from the model's that
            would have been beyond doubt, as shares; None where its drive does not tell.
        ahead, sideways: the same of its speed along one axis alone; None as well of a robot that
            cannot drive sideways, of which ahead is all its speed.
    """

    robot_id: int
    speed: float | None
    turn: float | None
    ahead: float | None
    sideways: float | None

    def to_json(self) -> dict[str, Any]:
        """All fields."""
        return asdict(self)


def resolutions(opened: Sequence[Opened]) -> list[Resolution]:
    """Resolution of each robot that logs tell of, by its number.

    Args:
        opened: logs and tables, with the model that is asked about.
    """
    logs = [o for o in opened if o.floor and o.data is not None]
    ids = sorted({o.track.robot_id for o in logs})
    return [_of_robot([o for o in logs if o.track.robot_id == i]) for i in ids]


def _of_robot(logs: Sequence[Opened]) -> Resolution:
    """By the spread that a fit of both gains would have, beside the clock of each log."""
    models = [o.model.copy() for o in logs]
    for model in models:
        for name in GAINS:
            model.set(name, 1.0)
    speed, turn = _shown(logs, models, GAINS)
    axes = _shown(logs, models, BASE_GAINS) if drives_sideways(models[0]) else (None, None)
    return Resolution(logs[0].track.robot_id, speed, turn, *axes[:2])


def _shown(
    logs: Sequence[Opened], models: Sequence[native.Model], names: Sequence[str]
) -> tuple[float | None, ...]:
    """Smallest difference of each gain that would be beyond doubt, as a share of it."""
    free = wide_gains(models[0], names)
    data = [replace(o.trajectory, own=_clock(o)) for o in logs]
    own = [m.copy() for m in models]
    fit = State(data, own, free).fit_of(free).fit()
    estimates = {e.name: e for e in fit.estimates}
    return tuple(
        SETTINGS.resolved * estimates[n].std / models[0].get(n) if estimates[n].seen else None
        for n in names
    )


def _clock(own: Opened) -> tuple[Parameter, ...]:
    """Clock that its log leaves free beside the gains, begun where it is."""
    return tuple(p.at(own.model.get(p.name)) for p in own.trajectory.own if p.name not in GAINS)
