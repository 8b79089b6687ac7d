# SPDX-License-Identifier: Apache-2.0
"""Dependences without a name: forces that are smooth functions of time, position, speed or past.

Each is a Gaussian process in a small basis (see `twinmill.inference.discrepancy`): a force on one
joint, relative to the joint's usual load, or a gain of its actuator.
"""

from collections.abc import Iterator

import numpy as np

from twinmill.inference.discrepancy import Kernel, harmonics, hats, waves
from twinmill.inference.moments import BIN_S
from twinmill.inference.settings import PRIORS
from twinmill.joints.effects.effect import plain
from twinmill.joints.plant import Plant

NODES = 7  # of a curve
FAST = 10  # steps of the quickest wave over time: it has five either way
TURNED = 0.1  # of a joint's reach, over which what a reversal leaves fades

Form = tuple[str, np.ndarray, np.ndarray | float]


def kernels(plant: Plant) -> list[Kernel]:
    """All dependences that compete, joint by joint."""
    found = []
    for d, joint in enumerate(plant.mjcf.joints):
        for word, forms, lasting in (
            ("time", _of_time(plant, d), False),
            ("position", _of_position(plant, d), True),
            ("speed", _of_speed(plant, d), True),
            ("command", _of_command(plant, d), True),
            ("past", _of_past(plant, d), True),
            ("other joints", _of_others(plant, d), True),
        ):
            depends_on = f"{word} of {plain(joint)}"
            for name, force, share in forms:
                scaled = force * np.sqrt(np.broadcast_to(share, len(force)))[:, None]
                columns = momentum(plant, d, scaled)
                if np.abs(columns).max(initial=0.0) > 0:
                    found.append(Kernel(depends_on, f"{depends_on}: {name}", columns, lasting))
    return found


def momentum(plant: Plant, d: int, force: np.ndarray) -> np.ndarray:
    """(K, W, J) momentum that (K, n) forces on a joint add, where friction lets it move."""
    given, slides = force * plant.usual.gives[:, d], plant.usual.slides[:, d]
    out = np.zeros((len(force), len(plant.series.block), plant.series.q.shape[1]))
    out[:, :, d] = (plant.series.weights @ given.T).T * slides
    return out


def of_base(plant: Plant) -> np.ndarray:
    """(K, W, J) what the base's equations may miss, for a relative error of one.

    Friction as a curve over the speed of each joint, and the actuators' force as one over that
    force; without their sizes, which are numbers of the base.
    """
    model, v, parts = plant.mjcf.model, plant.series.v, []
    for d in range(v.shape[1]):
        speed = np.abs(v[:, d])
        friction = model.dof_frictionloss[d] + speed * (
            model.dof_damping[d] + speed * model.dof_dampingpoly[d, 0]
        )
        torque = plant.usual.torque[:, d]
        for by, force in ((speed, plant.usual.sign(v, d) * friction), (np.abs(torque), torque)):
            if force.any():
                curve = hats(by, float(by.max()), NODES)
                curve = curve - ((curve @ force**2) / np.sum(force**2))[:, None]
                parts.append(momentum(plant, d, force * curve))
    return np.concatenate([np.zeros((0, len(plant.series.block), v.shape[1])), *parts])


def forms_of(plant: Plant, change: np.ndarray) -> tuple[np.ndarray, ...]:
    """Columns of errors that an effect's formula may have, each for a relative error of one.

    The effect's own change, times a smooth function of the speed of the joint that it changes most,
    of time, position or the actuator's force; without its size, which is the effect's own number.

    Args:
        plant: the robot in a log.
        change: (W, J) of the prediction by the effect.
    """
    s, usual = plant.series, plant.usual
    d = int(np.argmax((change**2).sum(axis=0) / usual.load**2))
    v, q, torque = (x[s.at, d] for x in (s.v, s.q, usual.torque))
    in_time, of_time = waves(s.mid_s, 6.0, 3.0)
    in_place, of_place = waves(q, usual.reach[d] / 4, usual.reach[d] / 4)
    forms = (
        hats(np.abs(v), np.abs(v).max(), NODES),
        hats(np.abs(torque), np.abs(torque).max(), NODES),
        np.sqrt(of_time)[:, None] * in_time,
        np.sqrt(of_place)[:, None] * in_place,
    )
    weight = (change**2).sum(axis=1) / max(np.sum(change**2), 1e-300)
    return tuple((f - (f @ weight)[:, None])[:, :, None] * change for f in forms)


def moments(plant: Plant) -> np.ndarray:
    """(B + 1, 2 J, W, J) change by a gain or a push of usual size up to each of the bins."""
    s, usual = plant.series, plant.usual
    number = np.floor((s.mid_s - s.mid_s[0]) / BIN_S).astype(int)
    joints = range(s.q.shape[1])
    gains = [momentum(plant, d, usual.torque[:, d][None])[0] for d in joints]
    pushes = [momentum(plant, d, np.full((1, len(s.t_s)), usual.load[d]))[0] for d in joints]
    ways = PRIORS.sudden * np.array([*gains, *pushes])
    bins = np.unique(number)
    before = number[None] < np.r_[bins, bins[-1] + 1][:, None]
    return before[:, None, :, None] * ways


def _of_time(plant: Plant, d: int) -> Iterator[Form]:
    load, torque = plant.usual.load[d], plant.usual.torque[:, d]
    sign = plant.usual.sign(plant.series.v, d)
    for name, shortest_s, smooth_s in (("slow", 12.0, 8.0), ("quick", 3.0, 1.5)):
        w, share = waves(plant.series.t_s, shortest_s, smooth_s)
        yield f"{name} force", load * w, share
        if np.any(torque):
            yield f"{name} gain", torque * w, share
        yield f"{name} friction", load * sign * w, share
    fast_s = FAST * float(plant.series.step_s[0])
    w, share = waves(plant.series.t_s, fast_s, fast_s / 2)
    yield "fast force", load * w, share


def _of_position(plant: Plant, d: int) -> Iterator[Form]:
    load, reach = plant.usual.load[d], plant.usual.reach[d]
    sign = plant.usual.sign(plant.series.v, d)
    for name, shortest in (("smooth", 0.5), ("quick", 0.1)):
        w, share = waves(plant.series.q[:, d], shortest * reach, shortest * reach / 2)
        yield f"{name} force", load * w, share
        yield f"{name} friction", load * sign * w, share
    if plant.mjcf.units[d] == "rad":
        w = harmonics(plant.series.q[:, d], range(1, 13))
        yield "force in a turn", load * w, 1 / len(w)


def _of_speed(plant: Plant, d: int) -> Iterator[Form]:
    v, load = plant.series.v[:, d], plant.usual.load[d]
    sign = plant.usual.sign(plant.series.v, d)
    curve = hats(np.abs(v), float(np.abs(v).max()), NODES)
    yield "friction", load * sign * curve, 1.0
    yield "friction that differs backwards", load * np.abs(sign) * curve, 1 / 2
    slow = hats(np.abs(v), float(plant.usual.speed[d]) / 2, NODES)[:-1]
    yield "friction at low speed", load * sign * slow, 1.0


def _of_command(plant: Plant, d: int) -> Iterator[Form]:
    torque, load = plant.usual.torque[:, d], plant.usual.load[d]
    if not np.any(torque):
        return
    curve = hats(np.abs(torque), float(np.abs(torque).max()), NODES)
    yield "gain", torque * curve[1:], 1.0
    yield "force", load * np.sign(torque) * curve, 1.0
    yield "friction", load * plant.usual.sign(plant.series.v, d) * curve, 1.0


def _of_past(plant: Plant, d: int) -> Iterator[Form]:
    torque, load = plant.usual.torque[:, d], plant.usual.load[d]
    if np.any(torque):
        late = np.array([_later(torque, n) - torque for n in (1, 2, 4, 8, 16, 32)])
        yield "response", late, 1 / 3
        size = np.abs(torque)
        change = np.diff(size, prepend=size[:1])
        events = [_later(what * np.sign(torque), n)
                  for what in (np.maximum(change, 0), np.maximum(-change, 0))
                  for n in (1, 4, 16)]  # fmt: skip
        yield "after a rise or a fall", np.array(events), 1 / 3
    since = _way_since_back(plant.series.q[:, d], plant.series.v[:, d])
    back = np.exp(-since / (TURNED * plant.usual.reach[d]))
    sign = plant.usual.sign(plant.series.v, d)
    yield "after turning back", load * np.array([back * sign, back]), 1 / 2


def _of_others(plant: Plant, d: int) -> Iterator[Form]:
    load, s, usual = plant.usual.load[d], plant.series, plant.usual
    others = [k for k in range(s.q.shape[1]) if k != d]
    if others:
        speed = [load * s.v[:, k] / usual.speed[k] for k in others]
        force = [load * usual.torque[:, k] / usual.load[k] for k in others]
        place = [load * 2 * (s.q[:, k] - s.q[:, k].mean()) / usual.reach[k] for k in others]
        yield "linear", np.array([*speed, *force, *place]), 1 / (3 * len(others))
        curves = [load * usual.sign(s.v, k) * _hats(np.abs(s.v[:, k])) for k in others]
        yield "by speed", np.concatenate(curves), 1 / len(others)
        bent = np.concatenate([_hats(s.q[:, k] - s.q[:, k].min()) for k in others])
        yield "by position", load * bent, 1 / len(others)
        yield "friction by position", load * usual.sign(s.v, d) * bent, 1 / len(others)


def _hats(values: np.ndarray) -> np.ndarray:
    """(K, n) of a curve over all that values reach."""
    return hats(values, float(values.max()), NODES)


def _way_since_back(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(n,) way since a joint last turned back."""
    turns = np.flatnonzero(np.diff(np.sign(v))) + 1
    last = np.zeros(len(q), int)
    last[turns] = turns
    return np.abs(q - q[np.maximum.accumulate(last)])


def _later(values: np.ndarray, states: int) -> np.ndarray:
    """(n,) values so many states later, zero before."""
    moved = np.roll(values, states)
    moved[:states] = 0
    return moved
