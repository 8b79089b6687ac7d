# SPDX-License-Identifier: Apache-2.0
"""The short moves that a script is put together from; each starts and ends at rest.

Effects that act when the command changes look alike under one kind of step: so there are steps from
rest and through zero, up and down, at several sizes and on all axes (Ljung 1999, ch. 13).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Forward, sideways and turn as duties of front-left, front-right, rear-left, rear-right.
AXES = {
    "straight": np.array([1.0, 1, 1, 1]),
    "strafe": np.array([-1.0, 1, 1, -1]),
    "spin": np.array([-1.0, 1, -1, 1]),
}
UNITS = {"straight": "m/s", "strafe": "m/s", "spin": "rad/s"}  # of robots told velocities
LEVELS = (0.25, 0.4, 0.6, 0.8, 1.0)
REST_S = 0.7  # a TurboPi that coasts stands after half a second
HOLD_S = 0.7  # six times its motor lag
RANDOM_MOVES = 12
RANDOM_HOLDS = 10

Steps = list[tuple[float, np.ndarray]]  # seconds, and shares of full drive along each axis


@dataclass(frozen=True)
class Axis:
    """A way to drive.

    Attributes:
        name: of AXES.
        full: (4,) command of full drive along it, as in a track: duties in -1..1, or velocities.
        unit: "%" of duties; else of the velocity.
    """

    name: str
    full: np.ndarray
    unit: str = "%"

    def size(self, level: float) -> str:
        """A share of full drive, for people."""
        size = level * float(np.abs(self.full).max())
        return f"{100 * size:.0f} %" if self.unit == "%" else f"{size:.2g} {self.unit}"


def duty_axes(max_duty: float, wheels: str = "mecanum") -> list[Axis]:
    """Axes of a robot told duties of at most `max_duty` (0..1); plain wheels do not go sideways."""
    names = [name for name in AXES if name != "strafe" or wheels != "differential"]
    return [Axis(name, max_duty * AXES[name]) for name in names]


def twist_axes(highest: np.ndarray) -> list[Axis]:
    """Axes of a robot told velocities, (3,) at most so large; without those of none."""
    commands = zip(UNITS.items(), np.diag([*highest, 0.0]), strict=False)
    return [Axis(name, full, unit) for (name, unit), full in commands if full.any()]


@dataclass(frozen=True)
class Move:
    """One move.

    Attributes:
        name: for people.
        hold_s: (K,) how long each command is held.
        command: (K, 4) as in a track; the last is zero.
    """

    name: str
    hold_s: np.ndarray
    command: np.ndarray

    @property
    def duration_s(self) -> float:
        """Seconds of the whole move with its rest."""
        return float(self.hold_s.sum())


def family(axes: Sequence[Axis]) -> list[Move]:
    """All moves along these axes, at most at full drive.

    Along several axes at once their shares add up to one at most, so that no wheel is asked for
    more than along one of them.
    """
    ways = dict(zip((a.name for a in axes), np.eye(len(axes)), strict=True))
    moves: list[tuple[str, Steps]] = []
    for axis in axes:
        way = ways[axis.name]
        for level in LEVELS:
            size = axis.size(level)
            moves += [*_steps(axis.name, size, level * way)]
            moves += [*_steps(f"{axis.name}, reversed", size, -level * way)]
        moves += [_stairs(axis.name, way), _stairs(f"{axis.name}, reversed", -way)]
    if {"straight", "spin"} <= set(ways):
        (straight,) = (a for a in axes if a.name == "straight")
        for side, word in ((1, "left"), (-1, "right")):
            for level in (0.5, 0.8):
                forward, spin = level * ways["straight"], 0.35 * side * ways["spin"]
                moves.append(_arc(f"arc {word}, {straight.size(level)}", forward, spin))
    random = np.random.default_rng(1)
    moves += [_random(random, len(axes)) for _ in range(RANDOM_MOVES)]
    return [_move(name, steps, axes) for name, steps in moves]


def _move(name: str, steps: Steps, axes: Sequence[Axis]) -> Move:
    """Move from shares of full drive along each axis, to whole percent or thousandths."""
    hold_s, shares = zip(*steps, (REST_S, np.zeros(len(axes))), strict=True)
    shares = np.array(shares) / np.maximum(1, np.abs(shares).sum(axis=1, keepdims=True))
    command = shares @ np.array([a.full for a in axes])
    return Move(name, np.array(hold_s), np.round(command, 2 if axes[0].unit == "%" else 3))


def _steps(name: str, size: str, out: np.ndarray) -> list[tuple[str, Steps]]:
    """Out and back, once with a stop between and once through zero."""
    rest = (REST_S, np.zeros(len(out)))
    return [
        (f"{name} from rest, {size}", [(HOLD_S, out), rest, (HOLD_S, -out)]),
        (f"{name} through zero, {size}", [(HOLD_S, out), (HOLD_S, -out)]),
    ]


def _stairs(name: str, way: np.ndarray) -> tuple[str, Steps]:
    """Up and down all levels, then back."""
    levels = [*LEVELS, *LEVELS[-2::-1]]
    return f"{name}, stairs", [(0.25, s * level * way) for s in (1, -1) for level in levels]


def _arc(name: str, forward: np.ndarray, spin: np.ndarray) -> tuple[str, Steps]:
    """An arc and back on it, then a piece of another."""
    return name, [(1.2, forward + spin), (1.2, -forward - spin), (0.6, forward - spin)]


def _random(random: np.random.Generator, axes: int) -> tuple[str, Steps]:
    """Random levels on all axes at once, each once forward and once, in another order, back."""
    mixes = random.choice([-1, 0, 1], (RANDOM_HOLDS // 2, axes)) * random.choice(
        LEVELS, (RANDOM_HOLDS // 2, axes)
    )
    mixes = np.concatenate([mixes, -random.permutation(mixes)])
    holds_s = np.rint(100 * random.uniform(0.2, 0.6, len(mixes) // 2)) / 100
    holds_s = np.concatenate([holds_s, random.permutation(holds_s)])
    return "random on all axes", list(zip(holds_s, mixes, strict=True))
