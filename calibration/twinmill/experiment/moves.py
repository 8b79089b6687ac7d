# SPDX-License-Identifier: Apache-2.0
"""The short moves that a script is put together from; each starts and ends at rest.

Effects that act when the command changes look alike under one kind of step: so there are steps from
rest and through zero, up and down, at several duties and on all axes (Ljung 1999, ch. 13).
"""

from dataclasses import dataclass

import numpy as np

# Forward, sideways and turn as duties of front-left, front-right, rear-left, rear-right.
AXES = {
    "straight": np.array([1.0, 1, 1, 1]),
    "strafe": np.array([-1.0, 1, 1, -1]),
    "spin": np.array([-1.0, 1, -1, 1]),
}
LEVELS = (0.25, 0.4, 0.6, 0.8, 1.0)
REST_S = 0.7  # a TurboPi that coasts stands after half a second
HOLD_S = 0.7  # six times its motor lag
RANDOM_MOVES = 12
RANDOM_HOLDS = 10


@dataclass(frozen=True)
class Move:
    """One move.

    Attributes:
        name: for people.
        hold_s: (K,) how long each duty is held.
        duty: (K, 4) share of full duty, -1..1; the last is zero.
    """

    name: str
    hold_s: np.ndarray
    duty: np.ndarray

    @property
    def duration_s(self) -> float:
        """Of the whole move with its rest."""
        return float(self.hold_s.sum())


def family(max_duty: float) -> list[Move]:
    """All moves whose duties are at most `max_duty` (0..1)."""
    axes = {name: max_duty * axis for name, axis in AXES.items()}
    moves = []
    for name, axis in axes.items():
        for level in LEVELS:
            moves += [*_steps(name, axis, level), *_steps(f"{name}, reversed", -axis, level)]
        moves += [_stairs(name, axis), _stairs(f"{name}, reversed", -axis)]
    for side, word in ((1, "left"), (-1, "right")):
        for level in (0.5, 0.8):
            forward, spin = level * axes["straight"], 0.35 * side * axes["spin"]
            moves.append(_arc(f"arc {word}", forward, spin, max_duty))
    random = np.random.default_rng(1)
    moves += [_random(random, axes, max_duty) for _ in range(RANDOM_MOVES)]
    return [Move(m.name, m.hold_s, np.rint(100 * m.duty) / 100) for m in moves]


def _move(name: str, steps: list[tuple[float, np.ndarray]]) -> Move:
    hold_s, duty = zip(*steps, (REST_S, np.zeros(4)), strict=True)
    return Move(name, np.array(hold_s), np.array(duty))


def _steps(name: str, axis: np.ndarray, level: float) -> list[Move]:
    """Out and back, once with a stop between and once through zero."""
    out, rest = level * axis, (REST_S, np.zeros(4))
    percent = f"{100 * np.abs(out).max():.0f} %"
    return [
        _move(f"{name} from rest, {percent}", [(HOLD_S, out), rest, (HOLD_S, -out)]),
        _move(f"{name} through zero, {percent}", [(HOLD_S, out), (HOLD_S, -out)]),
    ]


def _stairs(name: str, axis: np.ndarray) -> Move:
    """Up and down all levels, then back."""
    levels = [*LEVELS, *LEVELS[-2::-1]]
    return _move(f"{name}, stairs", [(0.25, s * level * axis) for s in (1, -1) for level in levels])


def _arc(name: str, forward: np.ndarray, spin: np.ndarray, max_duty: float) -> Move:
    """An arc and back on it, then a piece of another."""
    steps = [(1.2, forward + spin), (1.2, -forward - spin), (0.6, forward - spin)]
    return _move(
        f"{name}, {100 * np.abs(forward).max():.0f} %",
        [(hold_s, np.clip(duty, -max_duty, max_duty)) for hold_s, duty in steps],
    )


def _random(random: np.random.Generator, axes: dict[str, np.ndarray], max_duty: float) -> Move:
    """Random levels on all axes at once, each once forward and once, in another order, back."""
    mixes = random.choice([-1, 0, 1], (RANDOM_HOLDS // 2, 3)) * random.choice(
        LEVELS, (RANDOM_HOLDS // 2, 3)
    )
    mixes = np.concatenate([mixes, -random.permutation(mixes)]) @ np.array(list(axes.values()))
    mixes /= np.maximum(1, np.abs(mixes).max(axis=1, keepdims=True) / max_duty)
    holds_s = np.rint(100 * random.uniform(0.2, 0.6, len(mixes) // 2)) / 100
    holds_s = np.concatenate([holds_s, random.permutation(holds_s)])
    return _move("random on all axes", list(zip(holds_s, mixes, strict=True)))
