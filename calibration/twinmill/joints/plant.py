# SPDX-License-Identifier: Apache-2.0
"""Predictions of a log's steps by stock MuJoCo, from the states that were measured.

A candidate changes MuJoCo's own numbers, a command, a measured state, or adds a force. Errors are
changes of momentum, so that a friction of one joint shows in its channel alone.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from twinmill.inference.settings import PRIORS
from twinmill.joints.action import Action, Usual
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.series import Series
from twinmill.joints.states import Run, with_run
from twinmill.model.parameters import instance_of, key_of, numbered

CLOCK = "clock.offset_s"  # by which positions are stamped later than commands
STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
INPUT = int(mujoco.mjtState.mjSTATE_CTRL) | int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
NEUTRAL = {CLOCK: 0.0}  # numbers of the base that are no factors
SHARE = 0.1  # default strength of what adds to a force or scales a number: a tenth
SMALL = 0.05  # of a number or its default, by which a column is found: it is linear
CLOCK_NUDGE_S = 1e-3
KEPT = 200  # predictions that are kept, since searches ask for them again
HELD = 0.98  # share of a push that a joint takes, below which friction holds it
NUDGE = 1e-3  # of a joint's usual force, by which it is pushed to see whether it gives way


Act = Callable[[Action], None]


class JointModel:
    """Numbers of an MJCF and of effects beside it, by name: `base.damping@elbow`, `clock.offset_s`.

    Attributes:
        effects: names of effects, in the order in which they were added.
    """

    def __init__(self, catalogue: Mapping[str, Any], numbers: dict[str, float]) -> None:
        self.catalogue, self.effects = catalogue, list[str]()
        self._numbers = dict(numbers)

    @property
    def instances(self) -> list[str]:
        """Names of the effects in their order, each once: `coulomb@elbow`, `coulomb@elbow#2`."""
        return numbered(self.effects)

    def copy(self) -> "JointModel":
        """Another one that may be changed."""
        other = JointModel(self.catalogue, self._numbers)
        other.effects = list(self.effects)
        return other

    def add_effect(self, name: str) -> None:
        """Adds one of the catalogue at its default."""
        self.effects.append(name)
        instance = self.instances[-1]
        for p in self.catalogue[name].parameters:
            self._numbers[f"{instance}.{p.key}"] = p.value

    def remove_effect(self, index: int) -> None:
        """Takes the effect at that place out."""
        instance = self.instances[index]
        name = self.effects.pop(index)
        for p in self.catalogue[name].parameters:
            del self._numbers[f"{instance}.{p.key}"]

    def get(self, name: str) -> float:
        """One number."""
        return self._numbers[name]

    def set(self, name: str, value: float) -> None:
        """Changes one number."""
        self._numbers[name] = value

    def of(self, catalogue: Mapping[str, Any]) -> "JointModel":
        """With its numbers, and the effects of a catalogue."""
        other = self.copy()
        other.catalogue = catalogue
        return other

    def act(self, action: Action) -> None:
        """Changes MuJoCo's inputs by all of its numbers and effects."""
        action.late_s += self.get(CLOCK)
        for name in self._numbers:
            if instance_of(name) == "base":
                self.catalogue[name].act(action, {"value": self.get(name)})
        for instance in self.instances:
            own = {key_of(n): v for n, v in self.own(instance).items()}
            self.catalogue[instance.split("#")[0]].act(action, own)

    def own(self, instance: str, other: Mapping[str, float] | None = None) -> dict[str, float]:
        """Numbers of an effect, those of another mapping in their place."""
        every = {**self._numbers, **(other or {})}
        return {n: v for n, v in every.items() if instance_of(n) == instance}


def unchanged(_: Action) -> None:
    """The base as its file has it."""


@dataclass(frozen=True)
class Plant:
    """MuJoCo at the states of a log.

    Attributes:
        mjcf: the model.
        series: of the log, its states those by the run.
        run: of the model by the log's commands; None as it is made.
        act: makes that model of the base.
    """

    mjcf: Mjcf
    series: Series
    run: Run | None = None
    act: Act = field(default=unchanged, repr=False)

    @classmethod
    def of(cls, mjcf: Mjcf, series: Series) -> "Plant":
        """Runs the model by the commands of a log."""
        return cls(mjcf, series).about(unchanged)

    def about(self, act: Act) -> "Plant":
        """With the states of a run of the base once it is changed."""
        action = self.begin()
        act(action)
        return Plant(self.mjcf, *with_run(action, self.mjcf), act)

    def is_farther_than(self, other: "Plant") -> bool:
        """True if the run of this model is farther from some joint's log than another's."""
        assert self.run is not None and other.run is not None
        return not np.all(self.run.far <= other.run.far)

    def begin(self, usual: Usual | None = None) -> Action:
        """The base as it stands."""
        s = self.series
        return Action(
            s,
            usual,
            copy(self.mjcf.model),
            s.q.copy(),
            s.v.copy(),
            self.mjcf.delay_s.copy(),
            self.mjcf.lag_s.copy(),
            [],
            np.zeros_like(s.q),
        )

    def accelerations(self, action: Action) -> np.ndarray:
        """(n, J) at each state, by one step of MuJoCo."""
        n, data = len(action.q), mujoco.MjData(action.model)
        mujoco.mj_setConst(action.model, data)  # what depends on masses
        state = np.zeros((n, mujoco.mj_stateSize(action.model, STATE)))
        count = self.mjcf.model.nv
        state[:, 1 : 1 + count], state[:, 1 + count : 1 + 2 * count] = action.q, action.v
        given = np.concatenate([action.commands(), action.force], axis=1)[:, None]
        after, _ = rollout.rollout(action.model, data, state, given, control_spec=INPUT, nstep=1)
        gained = after[:, 0, 1 + count : 1 + 2 * count] - action.v
        return gained / float(action.model.opt.timestep)

    def errors(self, action: Action) -> np.ndarray:
        """(W, J) momentum that is measured, less that of the model that was run.

        What it does between its states is known of the run alone: the rest is how its forces differ
        where the robot is elsewhere.

        Args:
            action: that model in the states of the series.
        """
        assert self.run is not None
        s = self.series
        seen = replace(action, q=action.q + s.seen_q - s.q, v=action.v + s.seen_v - s.v)
        elsewhere = self.accelerations(seen) - self.accelerations(self.run.action)
        between = s.weights @ elsewhere + self.run.changes
        return np.einsum("wij,wj->wi", self.inertia, s.changes - between)

    def momenta(self, accelerations: np.ndarray) -> np.ndarray:
        """(W, J) momentum of each joint that is measured, less that of these accelerations."""
        error = self.series.changes - self.series.weights @ accelerations
        return np.einsum("wij,wj->wi", self.inertia, error)

    def momentum_of(self, force: np.ndarray) -> np.ndarray:
        """(W, J) that forces (n, J) add, where friction lets the joints slide."""
        return (self.series.weights @ (force * self.usual.gives)) * self.usual.slides

    @cached_property
    def inertia(self) -> np.ndarray:
        """(W, J, J) in the middle of each step."""
        model, data = self.mjcf.model, mujoco.MjData(self.mjcf.model)
        full = np.zeros((model.nv, model.nv))
        out = np.empty((len(self.series.at), model.nv, model.nv))
        for w, k in enumerate(self.series.at):
            data.qpos[:] = self.series.q[k]
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fullM(model, data, full)
            out[w] = full
        return out

    @cached_property
    def usual(self) -> Usual:
        """Motion and forces of the base, from one look at each state."""
        action, s = self.begin(), self.series
        self.act(action)
        model, data, ctrl = action.model, mujoco.MjData(action.model), action.commands()
        torque, inertial = np.empty_like(s.q), np.empty_like(s.q)
        for k in range(len(s.q)):
            data.qpos[:], data.qvel[:], data.ctrl[:] = action.q[k], s.v[k], ctrl[k]
            mujoco.mj_forward(model, data)
            torque[k] = data.qfrc_actuator
            inertial[k] = data.qfrc_bias
        load = np.sqrt((torque**2).mean(axis=0))
        load = np.where(load > 0, load, np.sqrt((inertial**2).mean(axis=0)))
        lead = ctrl - np.where(self.mjcf.servo, action.q[:, self.mjcf.moves], 0.0)
        speed = np.sqrt((s.v**2).mean(axis=0))
        return Usual(
            torque,
            np.maximum(load, 1e-9),
            np.maximum(speed, 1e-9),
            np.maximum(np.ptp(s.q, axis=0), 1e-9),
            np.maximum(np.sqrt((lead**2).mean(axis=0)), 1e-9),
            self._gives(load, 0.0),
            self._slides(load),
        )

    def _slides(self, load: np.ndarray) -> np.ndarray:
        """(W, J), see `Usual`."""
        held = self._gives(load, PRIORS.size * SHARE) < HELD
        touched = abs(self.series.weights) @ (held | _turns(self.series.v))
        return np.asarray(touched == 0, float)

    def _gives(self, load: np.ndarray, more: float) -> np.ndarray:
        """(n, J) by two pushes of each joint, over those without its own friction in that pose.

        Args:
            load: (J,) usual force.
            more: friction than the model's, over the load.
        """
        out = np.empty_like(self.series.q)
        for d, usual in enumerate(np.maximum(load, 1e-9)):
            own = float(self.mjcf.model.dof_frictionloss[d]) + more * usual
            free = np.maximum(self._yields(d, NUDGE * usual, 0.0), 1e-300)
            share = self._yields(d, NUDGE * usual, own) / free
            soft = 1 - self.mjcf.model.dof_solimp[d, 0]  # what MuJoCo's friction lets through
            out[:, d] = np.clip((share - soft) / (1 - soft), 0.0, 1.0)
        return out

    def _yields(self, d: int, nudge: float, friction: float) -> np.ndarray:
        """(n,) acceleration of a joint with some friction, over a small force on it."""
        each = []
        for sign in (1, -1):
            action = self.begin()
            action.model.dof_frictionloss[d] = friction
            action.force[:, d] = sign * nudge
            each.append(self.accelerations(action)[:, d])
        return np.asarray(each[0] - each[1]) / (2 * nudge)


class Steps:
    """Errors of a log's steps, as `twinmill.inference` asks for them; see its protocol.

    What is linear in a number (all of the base's, most effects) is predicted by MuJoCo once, and
    forces are added as such: MuJoCo runs again for delays, lags, limits, gains, inertias and zeros.

    Attributes:
        plant: MuJoCo at the states of the log.
        block: (W,) number of the block of time.
        observed: (J,) all joints are.
    """

    def __init__(self, plant: Plant, about: JointModel | None = None) -> None:
        """Prepares a log.

        Args:
            plant: MuJoCo at its states.
            about: the model that was run there; None for the base.
        """
        self.plant = plant
        self.about = about
        self.block = plant.series.block
        self.observed = np.ones(plant.series.q.shape[1], bool)
        self._columns: dict[str, np.ndarray] = {}
        self._known: dict[tuple[Any, ...], np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.block)

    def errors(
        self, model: JointModel, names: Sequence[str] = (), values: Any = None
    ) -> np.ndarray:
        """(B, W, J) momentum measured less predicted, for B rows of values of named numbers."""
        rows = np.zeros((1, 0)) if values is None else np.atleast_2d(values)
        return np.array(
            [self._errors(model, dict(zip(names, map(float, row), strict=True))) for row in rows]
        )

    def _errors(self, model: JointModel, other: Mapping[str, float]) -> np.ndarray:
        return self._given + self._change(model, other)

    @cached_property
    def _given(self) -> np.ndarray:
        """(W, J) errors of the base."""
        action = self.plant.begin(self.plant.usual)
        if self.about is None:
            return self.plant.errors(action) * self.plant.usual.slides
        self.about.act(action)
        own = self.plant.errors(action) * self.plant.usual.slides
        return np.asarray(own - self._change(self.about, {}))

    def _change(self, model: JointModel, other: Mapping[str, float]) -> np.ndarray:
        """(W, J) of the base's errors by numbers and effects."""
        found, exact = np.zeros((1, 1)), []
        forces: Action | None = None
        for name, value in {**model.own("base"), **model.own("clock"), **other}.items():
            if instance_of(name) in ("base", "clock"):
                found = found + (value - NEUTRAL.get(name, 1.0)) * self._column(model, name)
        for instance in model.instances:
            kind = instance.split("#")[0]
            own, effect = model.own(instance, other), model.catalogue[kind]
            if effect.changes == "force":
                forces = forces or self.plant.begin(self.plant.usual)
                effect.act(forces, {key_of(n): v for n, v in own.items()})
            elif effect.changes == "linear":
                for n, value in own.items():
                    found = found + value * self._column(model, f"{kind}.{key_of(n)}")
            else:
                exact.append((kind, tuple((key_of(n), v) for n, v in own.items())))
        if exact:
            found = found + self._exactly(model.catalogue, tuple(exact))
            found = found - self._exactly(model.catalogue, ())
        if forces is not None and forces.force.any():
            found = found - self.plant.momentum_of(forces.force)
        return np.broadcast_to(found, (len(self), len(self.observed)))

    def _exactly(self, catalogue: Mapping[str, Any], effects: tuple[Any, ...]) -> np.ndarray:
        """(W, J) errors of the base with some effects, but for how states of the base were seen."""
        if effects not in self._known:
            if len(self._known) >= KEPT:
                self._known.pop(next(iter(self._known)))
            action = self.plant.begin(self.plant.usual)
            for kind, own in effects:
                catalogue[kind].act(action, dict(own))
            self._known[effects] = self._run(action)
        return self._known[effects]

    def _column(self, model: JointModel, name: str) -> np.ndarray:
        """(W, J) change of the errors by a number, over the number."""
        if name not in self._columns:
            action, nudge = self.plant.begin(self.plant.usual), CLOCK_NUDGE_S
            if name == CLOCK:
                action.late_s += nudge
            elif instance_of(name) == "base":
                nudge = SMALL
                model.catalogue[name].act(action, {"value": 1 + nudge})
            else:
                card = model.catalogue[instance_of(name)]
                (nudge,) = [SMALL * p.value for p in card.parameters if p.key == key_of(name)]
                none = {p.key: 0.0 for p in card.parameters}
                card.act(action, {**none, key_of(name): nudge})
            change = self._run(action) - self._exactly(model.catalogue, ())
            self._columns[name] = change / nudge
        return self._columns[name]

    def _run(self, action: Action) -> np.ndarray:
        return self.plant.momenta(self.plant.accelerations(action)) * self.plant.usual.slides


def _turns(v: np.ndarray) -> np.ndarray:
    """(n, J) True of states between which and a neighbour a velocity changes its sign."""
    change = np.diff(np.sign(v), axis=0) != 0
    none = np.zeros((1, v.shape[1]), bool)
    return np.asarray(np.concatenate([change, none]) | np.concatenate([none, change]))
