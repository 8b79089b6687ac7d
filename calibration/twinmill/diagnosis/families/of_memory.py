# SPDX-License-Identifier: Apache-2.0
"""Errors that depend on the way since a robot turned round, or on the last command it took.

Tyres and gears give way for the first degrees or millimetres of a new direction (Dahl 1968, "A
solid friction model"), and a castor swings round on them. A driver that takes no small change of
its command holds the last that was large enough.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from twinmill.diagnosis.families.family import Family
from twinmill.fitting.dependence import HELD, WOUND, lagged, missing, wound
from twinmill.fitting.floor import told_velocity_at
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import CHANNELS, PAST, SPEEDS, STILL, SWELL, TYPICAL, Term
from twinmill.model.parameters import LAG


def of_memory(opened: Sequence[Opened], velocities: Sequence[np.ndarray]) -> Iterator[Family]:
    """Families of each axis that moves, and of each quantity that is commanded.

    Args:
        opened: logs over their floors, of one kind of robot.
        velocities: (N, 3) of the body in each, m/s and rad/s, at the points of its response.
    """
    moving = np.concatenate(velocities)
    axes = [k for k in range(3) if np.abs(moving[:, k]).max() > STILL[k]]
    for axis in axes:
        yield _wound_up(axis)
        if axis < 2:
            yield _swung_round(axis)
    if opened[0].model.drive == "twist":
        yield from (_small_changes(k, max(float(np.std(moving[:, k])), STILL[k])) for k in axes)
    elif opened[0].response.wheels:
        yield _small_changes_of_wheels(opened[0], moving)


def _wound_up(axis: int) -> Family:
    """Less is driven while something gives way."""
    name, to = SPEEDS[axis], CHANNELS[axis]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        way = velocity[:, axis] * own.response.step_s
        gives = [1 - np.sign(way) * wound(way, most) for most in WOUND[axis]]
        return {axis: SWELL * velocity[:, [axis]] * np.column_stack(gives)}

    texts = [f"{name}*unwound({name}, {most:g})" for most in WOUND[axis]]
    terms = [Term(PAST, to, t, TYPICAL[to] / SWELL, f"{name} winds up") for t in texts]
    return Family(terms, values)


def _swung_round(axis: int) -> Family:
    """The robot turns while something swings round."""
    name = SPEEDS[axis]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        way = velocity[:, axis] * own.response.step_s
        swings = [(way != 0) * (1 - wound(way, most) ** 2) for most in WOUND[axis]]
        return {2: TYPICAL["omega_radps"] * np.column_stack(swings)}

    texts = [f"swings({name}, {most:g})" for most in WOUND[axis]]
    terms = [Term(PAST, CHANNELS[2], t, 1.0, f"swings round with {name}") for t in texts]
    return Family(terms, values)


def _small_changes(axis: int, usual: float) -> Family:
    """Small changes of a velocity that the robot is told are not taken."""
    name, to = SPEEDS[axis], CHANNELS[axis]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {axis: TYPICAL[to] / usual * _lagged(own, missing(_told(own)[:, axis], usual))}

    texts = [f"held({name}, {share * usual:.3g}) - {name}" for share in HELD]
    return Family([Term(PAST, to, t, usual, f"small changes of {name}") for t in texts], values)


def _small_changes_of_wheels(first: Opened, moving: np.ndarray) -> Family:
    """Small changes of a wheel's speed that the robot is told are not taken."""
    wheels = first.response.wheels
    usual = max(float(np.std(moving @ w.rate)) for w in wheels)

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        told = _told(own)
        missed = [(w, _lagged(own, missing(told @ w.rate, usual))) for w in wheels]
        return {k: SWELL * sum(w.body[k] * m for w, m in missed) for k in range(3)}

    texts = [f"held(wheel_radps, {share * usual:.3g}) - wheel_radps" for share in HELD]
    size = TYPICAL["rim_mps"] / SWELL
    terms = [Term(PAST, "rim_mps", t, size, "small changes of wheels") for t in texts]
    return Family(terms, values)


def _told(own: Opened) -> np.ndarray:
    return told_velocity_at(own.trajectory, own.model, own.response.points)


def _lagged(own: Opened, values: np.ndarray) -> np.ndarray:
    return lagged(values, own.model.get(LAG), own.response.step_s)
