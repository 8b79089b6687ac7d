# SPDX-License-Identifier: Apache-2.0
"""A jointed robot, ready for inference."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from twinmill.inference.candidate import Candidate, with_limits, with_sizes
from twinmill.inference.hypothesis import Fitter, Guess
from twinmill.inference.noise import Course, Noise, Usual
from twinmill.inference.prior import Prior
from twinmill.inference.problem import Kinds, Problem, flexible_noise
from twinmill.inference.settings import PRIORS
from twinmill.joints import dependences
from twinmill.joints.always import Always, of_hook, with_always
from twinmill.joints.base import base_numbers
from twinmill.joints.effects import effects_of
from twinmill.joints.effects.effect import Effect, Number
from twinmill.joints.hook import hook_beside
from twinmill.joints.plant import CLOCK, JointModel, Plant, Steps
from twinmill.model.model_file import ModelError
from twinmill.model.parameters import EFFECT_STEP, Parameter, newest_instance

ROUNDS = 2  # of looking for the noise: what it begins with is a guess
FACTOR_STEP = 0.02  # of finite differences in a number of the base, relative


@dataclass(frozen=True)
class JointProblem(Problem):
    """A jointed robot in one log.

    Attributes:
        steps: of the log.
        plant: MuJoCo at its states.
        effects: the catalogue, by name.
        catalogue: effects, and factors of the base as `base.KEY`.
    """

    steps: Steps
    plant: Plant
    effects: Mapping[str, Effect]
    catalogue: Mapping[str, Any]

    def candidate(self, name: str, model: JointModel) -> Candidate:
        """Columns of an effect of the catalogue beside a model."""
        model = model.copy()
        model.add_effect(name)
        parameters = parameters_of(self.effects[name])
        if any(p.role == "limit" for p in parameters):
            return with_limits(name, parameters, model, self.steps)
        on = np.array([p.usual for p in parameters])
        return with_sizes(name, parameters, model, self.steps, on=on)

    def forms(self, change: np.ndarray) -> tuple[np.ndarray, ...]:
        """Errors of an effect's formula, by speed, force, time and position."""
        return dependences.forms_of(self.plant, change)

    def of_moments(self) -> np.ndarray:
        """A gain of each joint's actuator and a push, up to each of the bins."""
        return dependences.moments(self.plant)


def begun(
    plant: Plant, always: Always | None = None
) -> tuple[dict[str, Effect], JointModel, Prior]:
    """Effects that a robot may have in a log, its base's model, and what is known of that.

    Raises:
        ModelError: the hook of its MJCF has an effect that it cannot have.
    """
    effects, hook = effects_of(plant), plant.mjcf.hook
    if strange := [name for name, _ in hook if name not in effects]:
        raise ModelError(
            f"{hook_beside(plant.mjcf.path)}: has '{strange[0]}', which is no effect that this "
            "model can have; let `twinmill explain` write the hook again, or move it away."
        )
    base = {f"base.{key}": factor for key, factor in base_numbers(plant).items()}
    names = [CLOCK, *base]
    model = JointModel({**effects, **base}, {n: 0.0 if n == CLOCK else 1.0 for n in names})
    prior = _prior(names, plant)
    for known in (of_hook(hook), always):
        if known is not None:
            own = []
            for name in known.effects:
                model.add_effect(name)
                own += parameters_of(effects[name], newest_instance(model, name))  # type: ignore[arg-type]
            prior = with_always(model, prior, known, own)
    return effects, model, prior


def problem_of(
    plant: Plant, about: JointModel | None = None, always: Always | None = None
) -> JointProblem:
    """Prepares a log of a robot.

    Args:
        plant: MuJoCo at its states.
        about: the model that was run there; None for the base.
        always: what the model lacks in its own log, too; None where that is not known.
    """
    effects, model, prior = begun(plant, always)
    steps = Steps(plant, about and about.of(model.catalogue))
    noise = _begin_noise(steps, model)
    fitted = Fitter(steps, noise, prior.columns).fit(Guess.of_base(model, prior))
    kinds = Kinds({name: effect.words() for name, effect in effects.items()})
    found = dependences.kernels(plant)
    p = JointProblem(
        steps,
        prior,
        fitted,
        found,
        [*effects],
        None,
        Usual.about(noise),
        noise,
        {},
        kinds,
        (),
        plant,
        effects,
        model.catalogue,
    )
    for _ in range(ROUNDS):
        noise = flexible_noise(p)
        fitted = Fitter(steps, noise, prior.columns).fit(p.base)
        p = replace(p, noise=noise, usual=Usual.about(noise), base=fitted)
    return p


def _prior(names: list[str], plant: Plant) -> Prior:
    """Numbers of the base are as its file has them, give or take what drifts; or a data sheet's.

    Its equations of friction and actuators are as inexact as those of effects.
    """
    period_s, clock = plant.series.log.period_s, np.array([n == CLOCK for n in names])
    std = np.where(clock, period_s, PRIORS.gain_drift)
    columns = PRIORS.form * dependences.of_base(plant)
    more = len(columns)
    return Prior(
        names,
        np.r_[np.where(clock, 0.0, 1.0), np.zeros(more)],
        np.diag(np.r_[std**2, np.ones(more)]),
        np.where(clock, period_s / 4, FACTOR_STEP),
        np.where(clock, -10 * period_s, 0.01),
        np.where(clock, 10 * period_s, 100.0),
        columns,
        np.where(clock, 0, 1),
    )


def _begin_noise(steps: Steps, model: JointModel) -> Noise:
    """A third of the scatter between neighbouring steps is each of the three kinds of noise."""
    s = steps.plant.series
    pace = np.sqrt(((s.v[s.at] / steps.plant.usual.speed) ** 2).mean(axis=1))
    pace, seen = pace / np.sqrt((pace**2).mean()), steps.plant.usual.slides.T
    course = Course(float(s.step_s[0]), s.stretches, pace, seen)
    differences = np.abs(np.diff(steps.errors(model)[0], axis=0))
    slid = [own[on[1:] * on[:-1] > 0] for own, on in zip(differences.T, seen, strict=True)]
    usual = np.array([float(np.median(own)) if len(own) else 0.0 for own in slid])
    each = np.maximum(usual / 0.6745, 1e-12) / 3  # of a normal variate
    return Noise(each / np.sqrt(2), each, each, np.full(len(each), 2 * s.step_s[0]), course)


def parameters_of(effect: Effect, instance: str = "") -> list[Parameter]:
    """Numbers of an effect, as inference takes them, or of another instance of it."""
    return [_parameter(instance or effect.name, n) for n in effect.parameters]


def _parameter(name: str, n: Number) -> Parameter:
    usual = {"radius": n.value, "limit": n.high}.get(n.role, 0.0)
    strength = n.value - usual
    return Parameter(
        name=f"{name}.{n.key}",
        unit=n.unit,
        value=n.value,
        min=n.low,
        max=n.high,
        usual=usual,
        std=n.value / 2,
        step=n.step or EFFECT_STEP * abs(n.value),
        central=n.unit == "s",
        role=n.role,
        strength=strength,
    )
