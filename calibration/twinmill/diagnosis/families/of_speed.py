# SPDX-License-Identifier: Apache-2.0
"""Errors at some speeds alone: of the axis that has the speed, or of another."""

from collections.abc import Iterator

import numpy as np

from twinmill.diagnosis.families.family import MOST, Family, Humps
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import CHANNELS, COUPLING, SPEEDS, STILL, SWELL, TYPICAL, Term

TURN = TYPICAL["omega_radps"]


def of_speed(axis: int, speed: np.ndarray) -> Family:
    """One axis is faster or slower at some of its own speeds, (N,)."""
    name, to = SPEEDS[axis], CHANNELS[axis]
    humps = Humps.over(0.0, float(np.quantile(speed, MOST)))
    group = "turning rate" if name == "omega" else "speed"
    texts = [f"sign({name})*{text}" for text in humps.texts(f"abs({name})")]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        v = velocity[:, [axis]]
        return {axis: TYPICAL[to] * np.sign(v) * humps.of(np.abs(v))}

    return Family([Term(group, to, t, 1.0, f"at some {name}") for t in texts], values)


def across_axes(moving: np.ndarray) -> Iterator[Family]:
    """Coupling of turning into driving and of driving into turning, at some speeds of (N, 3)."""
    travel, turning = _travel(moving), np.abs(moving[:, [2]])
    if not (travel > STILL[0]).any():
        return
    of_travel = Humps.over(0.0, float(np.quantile(travel, MOST)))
    yield _veering(of_travel)
    if (turning > STILL[2]).any():
        of_turning = Humps.over(0.0, float(np.quantile(turning, MOST)))
        yield from (_turning(of_travel), _driving(of_turning), _on_the_spot(of_turning, of_travel))


def _travel(velocity: np.ndarray) -> np.ndarray:
    """(N, 1) m/s in whatever direction."""
    return np.hypot(velocity[:, [0]], velocity[:, [1]])


def _veering(humps: Humps) -> Family:
    """Driving turns the robot to one side."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        travel = _travel(velocity)
        return {2: TURN * humps.of(travel) * (travel > STILL[0])}

    texts = humps.texts("travel")
    return Family(
        [Term("speed", CHANNELS[2], t, 1.0, "veers at some speeds") for t in texts], values
    )


def _turning(humps: Humps) -> Family:
    """The robot turns more or less while it drives."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: SWELL * humps.of(_travel(velocity)) * velocity[:, [2]]}

    texts = [f"{text}*omega" for text in humps.texts("travel")]
    terms = [Term(COUPLING, CHANNELS[2], t, TURN / SWELL, "turns at some speeds") for t in texts]
    return Family(terms, values)


def _driving(humps: Humps) -> Family:
    """The robot drives more or less while it turns."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        gains = SWELL * humps.of(np.abs(velocity[:, [2]]))
        return {k: gains * velocity[:, [k]] for k in range(2)}

    size = TYPICAL["vx_mps"] / SWELL
    texts = [f"{text}*travel" for text in humps.texts("abs(omega)")]
    return Family(
        [Term(COUPLING, CHANNELS[0], t, size, "drives at some turns") for t in texts], values
    )


def _on_the_spot(humps: Humps, slow: Humps) -> Family:
    """The robot turns more or less where it hardly drives."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        turn = velocity[:, [2]]
        still = np.maximum(0.0, 1.0 - _travel(velocity) / (2 * slow.width))
        return {2: TURN * np.sign(turn) * humps.of(np.abs(turn)) * still}

    texts = [f"sign(omega)*{text}*spot" for text in humps.texts("abs(omega)")]
    return Family([Term(COUPLING, CHANNELS[2], t, 1.0, "turns on the spot") for t in texts], values)
