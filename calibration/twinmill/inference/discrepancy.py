# SPDX-License-Identifier: Apache-2.0
"""Nameless dependences: what a model may lack as a function of time, place, heading, speed, past.

Each dependence has several kernels (smooth or quick; of gains, pushes or turns). A kernel is a
Gaussian process in a small basis: columns over the steps, and the share of the prior variance that
each has, so that a size of one is a gain error of one (Rasmussen and Williams 2006, ch. 2.7 and 4).
A kernel's size is integrated over SIZES.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion

TIME = "time"  # the word for what comes and goes
SIZES = np.array([0.01, 0.03, 0.1, 0.3])  # from barely seen to a third of the way, relative
CHANCE = np.array([0.6, 0.25, 0.1, 0.05])  # that a dependence has each: small ones are common
STEP = float(np.sqrt(SIZES[1] / SIZES[0]))  # half the distance of two sizes, as a factor
# Chance that the relative error of a formula has each: an exponential distribution, of those with a
# known mean the one that says least; the rest is too small to be seen, or too large for a formula.
BINS = np.r_[SIZES[0] / STEP, np.sqrt(SIZES[1:] * SIZES[:-1]), SIZES[-1] * STEP]
OF_FORM = -np.diff(np.exp(-BINS / PRIORS.form))
WITHIN = 20  # points within a bin of sizes: fine beside PRIORS.sheet
ORDERS = np.arange(1, 5)  # of a smooth function of heading, of a length scale of 1 rad
OF_ORDERS = (1.0 + ORDERS**2) ** -1.5 / np.sum((1.0 + ORDERS**2) ** -1.5)
NODES = 7  # of a curve over speed: as a table of duties has
LATEST = 10  # steps that a response to a command may last
FADING = np.exp(-np.arange(LATEST + 1) / 4.0) / 3.5  # variance shares: it decays over 0.4 s


@dataclass(frozen=True)
class Kernel:
    """One form of a dependence.

    Attributes:
        depends_on: the word that an answer says.
        name: unique among all.
        columns: (K, W, 3) in m and rad, for a gain of one, scaled by the share of the variance.
        lasting: the function holds for other logs, too (of speed, heading, past); else only its
            size does (of time, place).
        log_share: of its prior odds, less than those of the other forms if it is one of many.
    """

    depends_on: str
    name: str
    columns: np.ndarray = field(repr=False)
    lasting: bool
    log_share: float = 0.0


def in_another_log(own: np.ndarray) -> np.ndarray:
    """(S,) probabilities of the sizes of a robot's wander in a log, from (S,) those in its own.

    A size stands for a bin of the grid, uniform in its logarithm, and differs a little between
    logs.
    """
    within = (np.arange(WITHIN) + 0.5) / WITHIN - 0.5
    own_logs = np.log(SIZES)[:, None] + 2 * np.log(STEP) * within
    below = ndtr((np.log(BINS) - own_logs[..., None]) / PRIORS.sheet)
    return own @ np.diff(below, axis=2).mean(axis=1)


def kernels(m: Motion, among: Collection[str] | None = None) -> list[Kernel]:
    """All forms of dependences that compete, of the motion of one log.

    Args:
        m: the motion.
        among: dependences that it can show; None for all.
    """
    found = []
    families = {
        TIME: (_of_time, False),
        "place": (_of_place, False),
        "heading": (_of_heading, True),
        "speed": (_of_speed, True),
        "coupling of turns": (_of_coupling, True),
        "past": (_of_past, True),
    }
    for word, (family, lasting) in families.items():
        if among is not None and word not in among:
            continue
        for name, columns, share in family(m):
            scaled = columns * np.sqrt(np.broadcast_to(share, len(columns)))[:, None, None]
            # all columns stay, those of no use in this log too: another log's have the same places
            if np.abs(scaled).max(initial=0.0) > 1e-9:
                found.append(Kernel(word, f"{word}: {name}", scaled, lasting))
    return found


def dependence_of(kernel: str) -> str:
    """Word of the dependence that a kernel of this name is a form of."""
    return kernel.split(":")[0]


def forms_of(change: np.ndarray, m: Motion) -> tuple[np.ndarray, ...]:
    """Arrays (K, W, 3): what an effect's formula may miss, each for a relative error of one.

    The effect's own change, times a smooth function of how fast the robot is along its fastest
    axis, of how fast it travels or turns, of time, place or heading, or as it comes later; without
    its size, which is the effect's own number.

    Args:
        change: (W, 3) of the prediction by the effect, m and rad.
        m: the motion.
    """
    in_time, of_time = waves(m.t_s, 6.0, 3.0)
    in_place, of_place = _over_floor(m, 6)
    forms = (
        *forms_of_speed(m),
        np.sqrt(of_time)[:, None] * in_time,
        np.sqrt(of_place)[:, None] * in_place,
        np.sqrt(np.repeat(OF_ORDERS, 2) / 2)[:, None] * harmonics(m.heading, ORDERS),
    )
    late = np.array([_later(change, n) for n in range(1, LATEST + 1)])
    each = *(f[:, :, None] * change for f in forms), np.sqrt(FADING[1:, None, None]) * late
    return without_size(each, change)


def forms_of_speed(m: Motion) -> tuple[np.ndarray, ...]:
    """(K, W) smooth functions of how fast the robot is along its fastest axis, travels, turns."""
    return (
        hats((np.abs(m.moved) / m.top[:3]).max(axis=1), 1.0, NODES),
        hats(np.hypot(m.moved[:, 0], m.moved[:, 1]), m.top[3], NODES),
        hats(np.abs(m.moved[:, 2]), m.top[4], NODES),
    )


def without_size(each: Iterable[np.ndarray], change: np.ndarray) -> tuple[np.ndarray, ...]:
    """Arrays (K, W, C) without the part that is (W, C) the change itself."""
    unit = change / max(np.sqrt(np.sum(change**2)), 1e-300)
    return tuple(c - np.tensordot(c, unit, 2)[:, None, None] * unit for c in each)


Form = tuple[str, np.ndarray, np.ndarray | float]


def _of_time(m: Motion) -> Iterator[Form]:
    for name, shortest_s, smooth_s in (("slow", 12.0, 8.0), ("quick", 3.0, 1.5)):
        w, share = waves(m.t_s, shortest_s, smooth_s, most=120)  # those of a log of three minutes
        yield f"{name} gain", gains(m, w, "all"), share
        yield f"{name} gain of travel", gains(m, w, "travel"), share
        yield f"{name} gain of turns", gains(m, w, "turn"), share
        if name == "slow":
            yield f"{name} way aside", way_aside(m, w), share
    w, share = waves(m.t_s, 8.0, 4.0)
    yield "push", pushes(m, w, "room"), np.tile(share, 2)
    yield "turning", pushes(m, w, "turn"), share


def _of_place(m: Motion) -> Iterator[Form]:
    w, share = _over_floor(m, 6)
    yield "gain of travel", gains(m, w, "travel"), share
    yield "gain of all", gains(m, w, "all"), share
    yield "gain of turns", gains(m, w, "turn"), share
    yield "push", pushes(m, w, "room"), np.tile(share, 2)
    yield "push of the body", pushes(m, w, "body"), np.tile(share, 2)
    yield "turning", pushes(m, w, "turn"), share
    yield "way aside", way_aside(m, w), share
    (wx, share_x), (wy, share_y) = (waves(p, 0.4, 0.12) for p in m.place.T)
    both = np.concatenate([share_x, share_y]) / 2
    strips = np.concatenate([wx, wy])
    yield "strips both ways", gains(m, strips, "travel"), both
    yield "strips both ways, of all", gains(m, strips, "all"), both
    yield "push of the body by strips", pushes(m, strips, "body"), np.tile(both, 2)
    yield "turning by strips", pushes(m, strips, "turn"), both
    yield "strips along x", gains(m, wx, "travel"), share_x
    yield "strips along y", gains(m, wy, "travel"), share_y


def _of_heading(m: Motion) -> Iterator[Form]:
    low, high = harmonics(m.heading, (1, 2)), harmonics(m.heading, (3, 4))
    yield "gain of travel", gains(m, low, "travel"), 1 / 4
    yield "gain of turns", gains(m, low, "turn"), 1 / 4
    yield "compass, twice a turn", _compass(m, (2,)), 1 / 2
    yield "compass", _compass(m, (1, 2, 3)), np.repeat((0.5, 0.25, 0.1), 2)
    yield "push of the body", pushes(m, low, "body"), 1 / 4
    yield "turning", pushes(m, low, "turn"), 1 / 4
    yield "gain, up to four times a turn", gains(m, np.concatenate([low, high]), "all"), 1 / 8
    course = m.heading + np.arctan2(m.moved[:, 1], m.moved[:, 0])
    yield "gain by course", gains(m, harmonics(course, (1, 2, 4)), "travel"), 1 / 6
    yield "way aside by course", way_aside(m, harmonics(course, (1, 2, 4))), 1 / 6


def _of_speed(m: Motion) -> Iterator[Form]:
    axes = np.eye(3)
    speed = np.hypot(m.moved[:, 0], m.moved[:, 1])
    curves = [
        hats(np.abs(m.moved[:, k]), m.top[k], NODES)[1:, :, None] * (m.moved * axes[k])
        for k in range(3)
    ]
    for name, curve in zip(("forward", "left", "turn"), curves, strict=True):
        yield f"curve of {name}", curve, 1.0
    plane = hats(speed, m.top[3], NODES)[1:, :, None] * (m.moved * (1, 1, 0))
    yield "curve of travel", plane, 1.0
    yield "curve of each axis", np.concatenate(curves), 1.0
    signed = [
        hats(np.abs(m.moved[:, k]), m.top[k], 4)[1:, :, None] * (np.abs(m.moved) * axes[k])
        for k in range(3)
    ]
    yield "curve that differs backwards", np.concatenate(signed), 1 / 4
    fast = hats(speed, m.top[3], NODES)[1:]
    yield "push of the body", pushes(m, fast, "body"), 1 / 4
    yield "turning", pushes(m, fast, "turn"), 1 / 4


def _of_coupling(m: Motion) -> Iterator[Form]:
    forward, left, turn = (m.moved / m.usual).T
    linear = ((turn, 0), (turn, 1), (forward, 1), (forward, 2), (left, 0), (left, 2))
    products = (
        (np.abs(turn), 0), (np.abs(forward), 2), (forward * turn, 1),
        (left * turn, 0), (forward * np.abs(turn), 0), (left * np.abs(turn), 1),
    )  # fmt: skip
    yield "linear", _terms(linear, m.usual), 1 / 4
    yield "products", _terms(products, m.usual), 1 / 4
    spin = hats(np.abs(m.moved[:, 2]), m.top[4], NODES)[1:, :, None]
    yield "travel by rate of turn", spin * (m.moved * (1, 1, 0)), 1.0
    speed = hats(np.hypot(m.moved[:, 0], m.moved[:, 1]), m.top[3], NODES)[1:, :, None]
    yield "turns by speed", speed * (m.moved * (0, 0, 1)), 1.0


def _of_past(m: Motion) -> Iterator[Form]:
    axes = np.eye(3)
    late = [
        np.array([(_later(m.instant[:, k], n) - m.moved[:, k])[:, None] * axes[k]
                  for n in range(LATEST + 1)])
        for k in range(3)
    ]  # fmt: skip
    yield "response of each axis", np.concatenate(late), np.tile(FADING, 3)
    yield "response of the plane", np.concatenate(late[:2]), np.tile(FADING, 2)
    yield "response of turns", late[2], FADING
    size = np.abs(m.instant)
    change = np.diff(size, axis=0, prepend=size[:1])
    way = np.sign(m.instant + m.moved)
    events = [
        _later(what[:, k] * way[:, k], n)[:, None] * axes[k]
        for what in (np.maximum(change, 0), np.maximum(-change, 0))
        for k in range(3)
        for n in (0, 1, 2, 4, 7)
    ]
    yield "after a rise or a fall", np.array(events), 0.3
    back = [
        np.exp(-_way_since_back(m.moved[:, k]) / (n * m.top[k]))
        for n in (0.7, 2)
        for k in (0, 1, 2)
    ]
    own = [b[:, None] * m.moved * axes[k % 3] for k, b in enumerate(back)]
    yield "after turning back", np.array(own), 1 / 2
    yield "turning after turning back", pushes(m, np.array(back), "turn"), 1 / 6


def _terms(terms: Sequence[tuple[np.ndarray, int]], usual: np.ndarray) -> np.ndarray:
    """(K, W, 3) of pairs of a unitless term (W,) and the axis that it moves."""
    out = np.zeros((len(terms), len(terms[0][0]), 3))
    for k, (term, axis) in enumerate(terms):
        out[k, :, axis] = term * usual[axis]
    return out


def _way_since_back(moved: np.ndarray) -> np.ndarray:
    """(W,) way along an axis since it was driven the other way, in the unit of `moved`."""
    way, sign = np.zeros(len(moved)), np.sign(moved)
    for k in range(1, len(moved)):
        back = sign[k] and sign[k] != sign[k - 1]
        sign[k] = sign[k] or sign[k - 1]
        way[k] = 0.0 if back else way[k - 1] + abs(moved[k - 1])
    return way


def _later(values: np.ndarray, steps: int) -> np.ndarray:
    """(W, ...) values so many steps later, zero before."""
    moved = np.roll(values, steps, axis=0)
    moved[:steps] = 0
    return moved


def gains(m: Motion, waves: np.ndarray, which: str) -> np.ndarray:
    """(K, W, 3) displacements scaled by (K, W) waves: of travel, turns, or all alike."""
    on = {"travel": (1, 1, 0), "turn": (0, 0, 1), "all": (1, 1, 1)}[which]
    return waves[:, :, None] * (m.moved * on)


def way_aside(m: Motion, waves: np.ndarray) -> np.ndarray:
    """(K, W, 3) displacements led aside by (K, W) waves: a heading that is off does the same."""
    return waves[:, :, None] * np.column_stack([-m.moved[:, 1], m.moved[:, 0], 0 * m.t_s])


def pushes(m: Motion, waves: np.ndarray, frame: str) -> np.ndarray:
    """(K', W, 3) displacements while the robot moves: along the room, the body, or a turn."""
    c, s, zero = np.cos(m.heading), np.sin(m.heading), np.zeros(len(m.heading))
    ways = {
        "room": [(c, -s, zero), (s, c, zero)],
        "body": [(zero + 1, zero, zero), (zero, zero + 1, zero)],
        "turn": [(zero, zero, zero + 1)],
    }[frame]
    on = (waves * m.moves)[:, :, None]
    return np.concatenate([on * np.column_stack(way) * m.usual for way in ways])


def _compass(m: Motion, orders: Iterable[int]) -> np.ndarray:
    """(2 K, W, 3) of a heading that is read wrong by harmonics of itself."""
    out = []
    for n in orders:
        for wave, slope in ((np.cos, lambda a: -np.sin(a)), (np.sin, np.cos)):
            off, turn = wave(n * m.heading), n * slope(n * m.heading)
            ways = off * m.moved[:, 1], -off * m.moved[:, 0], turn * m.moved[:, 2]
            out.append(np.column_stack(ways))
    return np.array(out)


def waves(
    along: np.ndarray, shortest: float, smooth: float, most: int = 60
) -> tuple[np.ndarray, np.ndarray]:
    """(K, W) cosines over a span, and the variance shares of a Matern 3/2 of that length scale.

    Args:
        along: (W,) positions.
        shortest: wave, in their unit; longer where more than `most` waves would be needed.
        smooth: length scale, in their unit.
        most: so many waves at most.
    """
    span = max(np.ptp(along), 1e-9)
    k = np.arange(1, int(np.clip(2 * span / shortest, 3, most)) + 1)
    waves = np.sqrt(2) * np.cos(np.pi * k[:, None] * (along - along.min()) / span)
    share = (1 + (np.pi * k / span * smooth) ** 2) ** -1.5
    return waves, share / share.sum()


def harmonics(angle_rad: np.ndarray, orders: Iterable[int]) -> np.ndarray:
    """(2 K, W) sines and cosines of an angle, of mean square one."""
    each = [(np.cos(n * angle_rad), np.sin(n * angle_rad)) for n in orders]
    return np.sqrt(2) * np.concatenate(each)


def hats(values: np.ndarray, top: float, count: int) -> np.ndarray:
    """(count, W) linear interpolation between even nodes from 0 to top."""
    at = np.clip(values / max(top, 1e-9), 0, 1) * (count - 1)
    return np.maximum(1 - np.abs(at - np.arange(count)[:, None]), 0)


def _over_floor(m: Motion, orders: int) -> tuple[np.ndarray, np.ndarray]:
    """(K, W) products of cosines over the floor, and their variance shares."""
    x, y = ((p - p.min()) / max(np.ptp(p), 1e-9) for p in m.place.T)
    pairs = [(i, j) for i in range(orders) for j in range(orders) if 0 < i + j <= orders]
    waves = [
        (np.sqrt(2) if i else 1) * (np.sqrt(2) if j else 1)
        * np.cos(np.pi * i * x) * np.cos(np.pi * j * y)
        for i, j in pairs
    ]  # fmt: skip
    share = np.array([(1 + (i * i + j * j) / 4) ** -1.5 for i, j in pairs])
    return np.array(waves), share / share.sum()
