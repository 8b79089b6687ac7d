# SPDX-License-Identifier: Apache-2.0
"""Candidates for a robot's velocity to depend on, beside its commands of the last moments.

Each dependence is a group of features of the three velocities of the body. It may scale a velocity
(a gain that changes with time, place, heading or way), turn one motion into another, drift by
itself while the robot moves, bend the curve of a speed, or follow an event: a start, a reversal, a
rise of the speed. Physics that is known is one more group each: what the effects of the catalogue
would change in a robot that lacks them.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.filters import faded, filtered
from twinmill.fitting.wheel_angles import Wheel
from twinmill.model.parameters import (
    MOTION_STAGES,
    WHERE_OR_WHEN,
    effect_names,
    effect_parameters,
)

SHORTEST_S = 4.0  # period of a gain that changes with time
SLOW_S = 8.0  # the same of a push
SHORTEST_M = 0.7  # the same with the way driven
MOST_WAVES = 36
PLACES = 5  # along each side of the floor that was driven
STRIPS = 12
CURVE = 12  # nodes over a speed
TURNED = 8  # nodes over the angle turned
FADES_S = (0.05, 0.15, 0.4, 1.0)  # how long an event is felt
STILL = 0.03  # share of the largest speed
MOVES = 0.1  # the same: from here on something drifts as much as it will
WOUND = ((0.01, 0.03, 0.1), (0.01, 0.03, 0.1), (0.03, 0.1, 0.3))  # m, m, rad: until it is whole
HELD = (0.1, 0.2, 0.35, 0.55, 0.8, 1.2)  # least change that is taken, over the usual speed
INSTANT_S = 1e-3
LAGS = (0.4, 1.2, 4.0)  # times the usual one
STRENGTHS = (1.0, 0.35)  # of a known effect, times its usual one


@dataclass(frozen=True)
class Motion:
    """A robot's motion at N points of a log.

    Attributes:
        velocity: (N, 3) of the body as the commands make it, m/s and rad/s.
        base: (N, 3) of a model of the robot.
        pose: (N, 3) measured.
        heading_rad: (N,) in the middle of the step to each point.
        t_s: (N,) robot's clock.
        step_s: (N,) from the point before; 0 where a stretch begins.
        moved: (N, 3) measured, from the point before, in axes of the body.
    """

    velocity: np.ndarray
    base: np.ndarray
    pose: np.ndarray
    heading_rad: np.ndarray
    t_s: np.ndarray
    step_s: np.ndarray
    moved: np.ndarray

    @cached_property
    def each(self) -> tuple[np.ndarray, ...]:
        """(N, 1) velocities: forward, left, turning."""
        return tuple(own[:, None].copy() for own in self.velocity.T)

    @cached_property
    def room(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) forward and left parts of a way along each of the room's axes."""
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return np.column_stack([c, s]), np.column_stack([-s, c])

    @property
    def speed_mps(self) -> np.ndarray:
        """(N,) of the model, whatever the direction."""
        return np.hypot(self.base[:, 0], self.base[:, 1])

    @cached_property
    def where(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, k) bells over the floor, and hats along each of its sides."""
        bells, strips = [], []
        for axis in self.pose[:, :2].T:
            low, high = np.quantile(axis, (0.03, 0.97))
            middles = np.linspace(low, high, PLACES)
            width_m = max(middles[1] - middles[0], 0.1)
            bells.append(np.exp(-(((axis[:, None] - middles) / width_m) ** 2)))
            strips.append(hats(axis, low, high, STRIPS))
        x, y = bells
        return (x[:, :, None] * y[:, None, :]).reshape(len(axis), -1), np.hstack(strips)

    @cached_property
    def moves(self) -> np.ndarray:
        """(N,) 0 at rest, 1 in motion."""
        relative = np.abs(self.base) / np.maximum(np.abs(self.base).max(axis=0), 1e-9)
        return np.clip(relative.max(axis=1) / MOVES, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Product:
    """(N, m k) columns: each of m signals times each of k gains.

    They are made where they are wanted: the features of all groups would be a hundred megabytes,
    and few are chosen.

    Attributes:
        gains: (N, k).
        signals: (N, m).
    """

    gains: np.ndarray
    signals: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the matrix."""
        return len(self.gains), self.gains.shape[1] * self.signals.shape[1]

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        """The columns themselves."""
        return (self.signals[:, :, None] * self.gains[:, None]).reshape(self.shape)


Features = Sequence[np.ndarray | Product]  # (N, f) forward, left, turning
Group = Sequence[Features]  # fitted together; groups may share features


def dependences(motion: Motion) -> Iterator[Group]:
    """Groups of features, one of each dependence that is tried."""
    yield from ([features] for features in _single(motion))
    way = _way_m(motion)
    for along, shortest in ((motion.t_s - motion.t_s.min(), SHORTEST_S), (way, SHORTEST_M)):
        yield from pairwise([_scaled(motion, wave) for wave in _waves(along, shortest)])
    waves = _waves(motion.t_s - motion.t_s.min(), SLOW_S)
    yield from pairwise([_pushes(motion, wave) for wave in waves])


def _single(motion: Motion) -> Iterator[Features]:
    """Those of them that share no features."""
    head = _harmonics(motion.heading_rad)
    always = np.hstack([np.ones((len(head), 1)), head])
    turned = np.cumsum(motion.base[:, 2] * motion.step_s)
    hours = hats(motion.t_s, motion.t_s.min(), motion.t_s.max(), _count(motion.t_s, 6.0, 24))
    yield from _by_place(motion)
    yield from _courses(motion)
    for gain in (head, hours, hats(turned, turned.min(), turned.max(), TURNED)):
        yield _scaled(motion, gain)
    for gain in (always, *motion.where, hours):
        yield from _drifts(motion, gain)
    for gain in (always, *motion.where):
        yield _crossed(motion, gain)
    yield from _curves(motion)
    yield _leans(motion)
    yield from _unwinding(motion)
    yield from _events(motion)


def place_gains(motion: Motion) -> Iterator[Group]:
    """Those of `dependences` that scale the velocities, as fitted so far, by the place."""
    yield from ([features] for features in _by_place(motion))


def _by_place(motion: Motion) -> Iterator[Features]:
    for gain in motion.where:
        yield _scaled(motion, gain)


def known_physics(
    base: native.Model,
    velocity: np.ndarray,
    predict: Callable[[Sequence[native.Model]], np.ndarray],
) -> Iterator[Group]:
    """Change by each effect of the catalogue, but those that are somewhere or sometimes.

    Args:
        base: a model without effects.
        velocity: (N, 3) that it predicts.
        predict: (B, N, 3) the same of other models.
    """
    names = [card["name"] for card in native.catalogue() if _is_everywhere(card)]
    models = [m for name in names for m in _with_strengths(base, name)]
    changes = predict([base, *models])[1:] - velocity
    for own in changes.reshape(-1, len(STRENGTHS), *velocity.shape):
        if np.abs(own[0]).max() > 1e-9:
            forward, left, turning = np.ascontiguousarray(own.transpose(2, 1, 0))
            yield [(forward, left, turning)]


def _is_everywhere(card: dict[str, Any]) -> bool:
    roles = {p["role"] for p in card["parameters"]}
    return not roles & set(WHERE_OR_WHEN) and card["stage"] in MOTION_STAGES


def _with_strengths(base: native.Model, name: str) -> list[native.Model]:
    """The model with an effect at STRENGTHS; none if such a robot cannot have it."""
    models = []
    for strength in STRENGTHS:
        model = base.copy()
        try:
            model.add_effect(name)
        except ValueError:
            return []
        for p in effect_parameters(model, effect_names(model)[-1], fresh=True):
            model.set(p.name, p.usual + strength * (p.value - p.usual))
        models.append(model)
    return models


def _way_m(motion: Motion) -> np.ndarray:
    """(N,) way driven, measured along the direction in which the model drives."""
    c, s = np.cos(motion.heading_rad), np.sin(motion.heading_rad)
    forward, left = motion.base[:, 0], motion.base[:, 1]
    along = np.column_stack([c * forward - s * left, s * forward + c * left])
    along /= np.maximum(motion.speed_mps, 1e-9)[:, None]
    step_m = np.diff(motion.pose[:, :2], axis=0, prepend=motion.pose[:1, :2])
    ahead_m = np.sum(step_m * along, axis=1)
    return np.cumsum(np.where((motion.step_s > 0) & (motion.moves > 0), ahead_m, 0.0))


def _scaled(motion: Motion, gain: np.ndarray) -> Features:
    """Each velocity times (N, k) gains."""
    return tuple(Product(gain, own) for own in motion.each)


def _crossed(motion: Motion, gain: np.ndarray) -> Features:
    """Turning added to driving and driving to turning, times (N, k) gains."""
    turning = Product(gain, motion.each[2])
    return turning, turning, Product(gain, motion.velocity[:, :2].copy())


def _courses(motion: Motion) -> Iterator[Features]:
    """Driving made quicker, and led aside, by the direction in the room in which it goes."""
    forward, left, _ = motion.velocity.T[..., None]
    course = motion.heading_rad + np.arctan2(motion.base[:, 1], motion.base[:, 0])
    for waves in (_harmonics(course), _harmonics(4 * course)[:, :2]):
        along, aside = waves * forward, waves * left
        yield np.hstack([along, -aside]), np.hstack([aside, along]), np.zeros((len(waves), 0))


def wheel_angles(motion: Motion, wheels: Sequence[Wheel]) -> Iterator[Group]:
    """Each wheel's rolling made quicker and slower by its own angle."""
    for wheel in wheels:
        waves = wheel.waves(motion.moved) * (motion.velocity @ wheel.rate)[:, None]
        forward, left, turning = (part * waves for part in wheel.body)
        yield [(forward, left, turning)]


def beat(motion: Motion, rate_radps: float) -> Iterator[Group]:
    """Gains and drifts that swing in time at a rate; nothing where it is 0."""
    if rate_radps:
        angle = rate_radps * motion.t_s[:, None]
        wave = np.hstack([np.cos(angle), np.sin(angle)])
        swinging = (_scaled(motion, wave), *_drifts(motion, wave), _along_the_body(motion, wave))
        yield from ([features] for features in swinging)


def _along_the_body(motion: Motion, gain: np.ndarray) -> Features:
    """Pushes ahead and aside while the robot moves, times (N, k) gains."""
    push = motion.moves[:, None] * gain
    return push, push, np.zeros((len(gain), 0))


def _drifts(motion: Motion, gain: np.ndarray) -> Iterator[Features]:
    """Motion along the room's axes, and turning, while the robot moves, times (N, k) gains."""
    along, aside, none = _pushes(motion, gain)
    yield along, aside, along.gains
    yield none, none, Product(gain, motion.speed_mps[:, None])


def _pushes(motion: Motion, gain: np.ndarray) -> tuple[Product, Product, np.ndarray]:
    """Motion along the room's axes while the robot moves, times (N, k) gains."""
    drift, (along, aside) = gain * motion.moves[:, None], motion.room
    return Product(drift, along), Product(drift, aside), np.zeros((len(gain), 0))


def _curves(motion: Motion) -> Iterator[Features]:
    """Each velocity bent over its own speed, and scaled over the speed of the other motion."""
    base = motion.base
    yield tuple(_levels(np.abs(own)) * np.sign(own)[:, None] for own in base.T)
    spin, speed = _levels(np.abs(base[:, 2])), _levels(motion.speed_mps)
    forward, left, turning = motion.each
    yield Product(spin, forward), Product(spin, left), Product(speed, turning)
    yield spin, spin, np.hstack([speed, speed * np.sign(base[:, :1])])


def _leans(motion: Motion) -> Features:
    """A marker that stands off by the acceleration, as on a mast that bends."""
    base, step_s = motion.base, motion.step_s
    leans = (in_curves(base, step_s), while_speeding_up(base, step_s))
    moved = np.stack([led_by(lean, base, step_s) for lean in leans], axis=-1)
    return moved[:, 0], moved[:, 1], np.zeros((len(base), 0))


def in_curves(velocity: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """(N, 2) m/s^2 by which a body of (N, 3) velocity is led round, in its axes."""
    return _turning(velocity[:, :2], velocity)


def while_speeding_up(velocity: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """(N, 2) m/s^2 by which the speeds of a body change, in its axes."""
    return rates(velocity[:, :2], step_s)


def led_by(off: np.ndarray, velocity: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """(N, 2) velocity of a point whose place in the body's axes, (N, 2) `off`, changes."""
    return rates(off, step_s) + _turning(off, velocity)


def _turning(vectors: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """(N, 2) how fast vectors that are fixed in the body turn with it."""
    return velocity[:, [2]] * np.column_stack([-vectors[:, 1], vectors[:, 0]])


def rates(values: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """(N, k) of (N, k) per second; 0 where a stretch begins."""
    change = np.diff(values, axis=0, prepend=values[:1])
    return change / np.where(step_s > 0, step_s, np.inf)[:, None]


def _unwinding(motion: Motion) -> Iterator[Features]:
    """Less is driven while something gives way in a new direction, or swings round on it."""
    ways = (motion.base * motion.step_s[:, None]).T
    turned = [
        np.column_stack([wound(way, most) for most in widths])
        for way, widths in zip(ways, WOUND, strict=True)
    ]
    gives = zip(motion.velocity.T, ways, turned, strict=True)
    forward, left, turning = (v[:, None] * (1 - np.sign(w)[:, None] * t) for v, w, t in gives)
    yield forward, left, turning
    none = np.zeros((len(motion.t_s), 0))
    pairs = zip(ways[:2], turned[:2], strict=True)
    yield none, none, np.hstack([(w != 0)[:, None] * (1 - t**2) for w, t in pairs])


def small_changes(
    told: np.ndarray, lag_s: float, motion: Motion, wheels: Sequence[Wheel]
) -> Iterator[Group]:
    """Changes of a command below a least one are not taken: of each wheel alike, or of each axis.

    Args:
        told: (N, 3) velocity of the body as it is told, m/s and rad/s, without the motors' lag.
        lag_s: of the motors.
        motion: of the robot.
        wheels: that are told their speeds; none if the body is.
    """
    axes = np.eye(3)
    parts = [(w.rate, w.body) for w in wheels] or [(axis, axis) for axis in axes]
    rims = [told @ rate for rate, _ in parts]
    usual = [np.std(rim) for rim in rims] if not wheels else [np.std(rims)] * len(rims)
    missed = [
        lagged(missing(rim, size), lag_s, motion.step_s)
        for rim, size in zip(rims, usual, strict=True)
    ]
    added = [[body[k] * m for k in range(3)] for (_, body), m in zip(parts, missed, strict=True)]
    for features in [np.sum(added, axis=0)] if wheels else added:
        yield [tuple(f if f.any() else f[:, :0] for f in features)]


def lags_that_change(told: np.ndarray, lag_s: float, motion: Motion) -> Iterator[Group]:
    """Each velocity lags by one time at rest and by another at full speed of the robot.

    Or where it is right and where it is farthest behind, or as it rises and as it falls. Between
    the two the logarithm of the time is a straight line.

    Args:
        told: (N, 3) velocity of the body as it is told, m/s and rad/s, without the motors' lag.
        lag_s: of the motors.
        motion: of the robot.
    """
    base = motion.base
    speed = np.repeat(motion.speed_mps[:, None], 3, axis=1)
    sizes = [speed, np.abs(told - base), (np.abs(told) < np.abs(base)).astype(float)]
    shares = np.stack([s / np.maximum(s.max(axis=0), 1e-9) for s in sizes], axis=1)
    least, most = np.log(lag_s * np.array(list(product(LAGS, LAGS)))).T
    times_s = np.exp(least + (most - least) * shares[..., None])  # (N, sizes, 3, pairs)
    keep = np.exp(-even_step_s(motion.step_s) / times_s)
    behind = faded(keep, (1 - keep) * told[:, None, :, None]) - base[:, None, :, None]
    for own in behind.swapaxes(0, 1):
        forward, left, turning = np.ascontiguousarray(own.swapaxes(0, 1))
        yield [(forward, left, turning)]


def missing(told: np.ndarray, usual: float) -> np.ndarray:
    """(N, k) by which (N,) told values are missed where changes below some HELD are not taken."""
    return np.column_stack([held(told, share * usual) - told for share in HELD])


def lagged(values: np.ndarray, lag_s: float, step_s: np.ndarray) -> np.ndarray:
    """(N, k) values behind a lag, on steps that are taken to be even."""
    keep = np.exp(-even_step_s(step_s) / max(lag_s, INSTANT_S))
    return filtered([1 - keep], [1.0, -keep], values)


def held(values: np.ndarray, least: float) -> np.ndarray:
    """Signal after a dead band on its changes: it keeps its value until a change is large enough.

    Args:
        values: (N,) signal.
        least: a new value is taken where it differs by more than this from the one that is kept.

    Returns:
        (N,) in the unit of `values`; it begins at 0.
    """
    return native.held(np.ascontiguousarray(values), least)


def wound(way: np.ndarray, most: float) -> np.ndarray:
    """State of play or a spring that has to be taken up after each change of direction.

    It follows the way that is driven and saturates: u[k] = clip(u[k - 1] + way[k] / most, -1, 1).

    Args:
        way: (N,) way driven in each step, m or rad, with its sign.
        most: way from the middle to either end, in the same unit.

    Returns:
        (N,) -1 to 1; at an end while the robot has driven far enough in one direction.
    """
    return native.wound(np.ascontiguousarray(way), most)


def _events(motion: Motion) -> Iterator[Features]:
    """Features that fade after speeds rose or fell, after reversals, and after starts from rest."""
    base, step_s = motion.base, motion.step_s
    largest = np.maximum(np.abs(base).max(axis=0), 1e-9)
    change = np.diff(np.abs(base), axis=0, prepend=np.abs(base[:1]))
    rises = np.maximum(change, 0) * np.sign(base)
    falls = np.maximum(-change, 0) * np.sign(np.vstack([base[:1], base[:-1]]))
    ways = np.where(np.abs(base) > MOVES * largest, np.sign(base), 0.0)
    reversals = np.column_stack([_reversals(way) for way in ways.T])
    for event in (rises, falls, reversals):
        felt = np.hstack([fading(event, fade_s, step_s) for fade_s in FADES_S])
        yield felt, felt, felt
    still = (np.abs(base) < STILL * largest).all(axis=1)
    starts = np.flatnonzero(~still & np.r_[True, still[:-1]])
    last = np.searchsorted(starts, np.arange(len(base)), side="right") - 1
    since_s = np.full(len(base), np.inf)
    begun = last >= 0
    since_s[begun] = motion.t_s[begun] - motion.t_s[starts[last[begun]]]
    lately = np.exp(-since_s[:, None] / FADES_S)
    slow = Product(base, lately)
    yield slow, slow, slow
    yield lately, lately, lately  # a kick, whatever the robot is told


def _reversals(way: np.ndarray) -> np.ndarray:
    """(N,) the new sign where the last one that was not 0 was the other, else 0."""
    moving = np.flatnonzero(way)
    turned = moving[1:][way[moving[1:]] != way[moving[:-1]]]
    out = np.zeros(len(way))
    out[turned] = way[turned]
    return out


def fading(events: np.ndarray, fade_s: float, step_s: np.ndarray) -> np.ndarray:
    """Trace that events leave: each counts in full at its step, then decays exponentially.

    y[k] = events[k] + exp(-dt / fade_s) y[k - 1], from rest. For all steps dt is the median of
    `step_s`, and a gap between stretches of a log counts as one step.

    Args:
        events: (N,) or (N, n) size of each of n kinds of event at N steps, such as the rise of a
            speed in m/s; 0 where nothing happens.
        fade_s: time in which a trace falls to 1/e.
        step_s: (N,) length of the step that ends at each point; 0 where a stretch begins.

    Returns:
        y, of the shape and in the unit of `events`.
    """
    return filtered([1.0], [1.0, -np.exp(-even_step_s(step_s) / fade_s)], events, axis=0)


def even_step_s(step_s: np.ndarray) -> float:
    """Length of (N,) steps that are taken to be even; of those of no length stretches begin."""
    return float(np.median(step_s[step_s > 0]))


def _harmonics(angle: np.ndarray) -> np.ndarray:
    """(N, 4) of an angle."""
    return np.stack([np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)], axis=-1)


def _count(along: np.ndarray, shortest: float, most: int) -> int:
    return int(np.clip(1.1 * np.ptp(along) / shortest, 2, most))


def _waves(along: np.ndarray, shortest: float) -> Iterator[np.ndarray]:
    """(N, 2) of each frequency; two neighbours together match one between them."""
    slowest = np.exp(1j * np.pi * along / max(1.1 * np.ptp(along), 1e-9))
    wave = slowest
    for _ in range(2, 2 * _count(along, shortest, MOST_WAVES) + 1):
        wave = wave * slowest  # quicker than a cosine and a sine of each
        yield np.column_stack([wave.real, wave.imag])


def _levels(size: np.ndarray) -> np.ndarray:
    """(N, CURVE - 1) hats over a speed, 0 at rest."""
    return hats(size, 0.0, max(size.max(), 1e-9), CURVE)[:, 1:]


def hats(values: np.ndarray, low: float, high: float, count: int) -> np.ndarray:
    """(..., count) weights of linear interpolation between even nodes."""
    last = count - 1
    place = np.clip((values - low) * (last / max(high - low, 1e-9)), 0, last)
    return np.maximum(1 - np.abs(place[..., None] - np.arange(count)), 0)
