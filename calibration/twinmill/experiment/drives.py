# SPDX-License-Identifier: Apache-2.0
"""How people drive a robot for a log: by a ladder, at random, by hand, in arcs, as in a mill."""

from collections.abc import Callable, Iterator

import numpy as np

STYLES = ("mixed", "mixed", "mixed", "sorted", "joystick")
REST_S = 1.0
Leg = tuple[float, np.ndarray]  # how long, and forward, left, turn in -1..1


def drive(style: str, duration_s: float, sideways: bool, random: np.random.Generator) -> list[Leg]:
    """A plan of one kind; `mixed` is several kinds in a random order."""
    kinds = list(PARTS) if style == "mixed" else [style]
    if style == "mixed":
        random.shuffle(kinds)
    share_s = duration_s / len(kinds)
    legs: list[Leg] = []
    for kind in kinds:
        left_s = share_s
        for hold_s, axes in (PARTS | ALONE)[kind](share_s, random):
            if left_s <= REST_S:
                break
            legs.append((min(hold_s, left_s - REST_S), axes * [1, sideways, 1]))
            left_s -= hold_s
        legs.append((REST_S, np.zeros(3)))
    return legs


def sampled(legs: list[Leg], rate_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """(N,) s and (N, 3): the plan in rows of a control loop, from and to rest."""
    ends = np.cumsum([hold_s for hold_s, _ in legs])
    t_s = np.arange(0, ends[-1], 1 / rate_hz)
    leg = np.minimum(np.searchsorted(ends, t_s, side="right"), len(legs) - 1)
    return t_s, np.array([axes for _, axes in legs])[leg]


def _ladder(duration_s: float, random: np.random.Generator) -> Iterator[Leg]:
    del duration_s
    while True:
        for level in random.permutation([0.25, 0.4, 0.6, 0.8, 1.0]):
            yield 1.0, level * random.choice([-1, 1]) * np.eye(3)[random.integers(3)]
            yield 0.6, np.zeros(3)


def _random(duration_s: float, random: np.random.Generator) -> Iterator[Leg]:
    del duration_s
    while True:
        mix = random.choice([-1, 0, 1], 3) * random.choice([0.3, 0.55, 0.8, 1.0], 3)
        yield float(random.uniform(0.2, 0.9)), mix / max(1.0, np.abs(mix).sum())


def _arcs(duration_s: float, random: np.random.Generator) -> Iterator[Leg]:
    del duration_s
    while True:
        ahead, turn = random.uniform(0.35, 0.65), random.uniform(0.1, 0.35)
        yield float(random.uniform(1.5, 3)), np.array([ahead, 0, turn]) * random.choice([-1, 1], 3)


def _by_hand(duration_s: float, random: np.random.Generator) -> Iterator[Leg]:
    """A stick that follows a thumb: every second or so another aim, reached in 0.3 s."""
    step_s, at, aim = 0.05, np.zeros(3), np.zeros(3)
    for _ in range(int(duration_s / step_s)):
        if random.random() < step_s:
            aim = random.normal(0, [0.5, 0.5, 0.4]) * (random.random(3) < 0.7)
        at = at + step_s / 0.3 * (aim - at)
        moved = np.where(np.abs(at) < 0.03, 0, at)
        yield step_s, moved / max(1.0, np.abs(moved).sum())


def _sorted(duration_s: float, random: np.random.Generator) -> Iterator[Leg]:
    """As students write it: axis by axis, slow before fast, nothing twice."""
    levels = np.sort(random.choice([0.3, 0.45, 0.6, 0.8, 1.0], 4, replace=False))
    drives = [level * s * axis for level in levels for axis in np.eye(3) for s in (1, -1)]
    each_s = duration_s / len(drives)
    for axes in drives:
        yield 0.7 * each_s, axes
        yield 0.3 * each_s, np.zeros(3)


PARTS: dict[str, Callable[[float, np.random.Generator], Iterator[Leg]]] = {
    "ladder": _ladder,
    "random": _random,
    "arcs": _arcs,
}
ALONE = {"joystick": _by_hand, "sorted": _sorted}
