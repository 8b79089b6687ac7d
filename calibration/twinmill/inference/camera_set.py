# SPDX-License-Identifier: Apache-2.0
"""A set of effects that cameras lack, fitted to the bits that they reported, with its evidence."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import twinmill_native as native
from scipy.special import logsumexp

from twinmill.estimation.detection_fit import MOST_FRAMES, REACH, is_count, maximised, starts
from twinmill.inference.candidate import size_std
from twinmill.inference.hypothesis import ROUNDS, SETTLED
from twinmill.inference.laplace import Laplace, Prior, laplace
from twinmill.inference.settings import PRIORS
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    CAMERA_STAGES,
    Parameter,
    all_effect_parameters,
    effect_parameters,
    is_of_camera,
    key_of,
    newest_instance,
    stated_names,
)
from twinmill.predict.detections import Detections

GRAIN = 1e-3  # to which numbers are found, times their usual strength
SEEN_AS = "sensor_delay"  # how a camera shows that the clock's offset holds a delay of the robot

Label = tuple["Lack | None", str]  # whose number it is, and its name there


@dataclass(frozen=True)
class Lack:
    """An effect that all cameras lack, or that of one robot alone."""

    effect: str
    robot: int | None = None

    def __str__(self) -> str:
        return self.effect if self.robot is None else f"{self.effect} (R{self.robot:02d})"


@dataclass(frozen=True)
class Number:
    """A number of a set.

    Attributes:
        parameter: of the catalogue; its usual value is the prior's mean.
        std: of the prior.
        lack: whose it is; None of what the given model has.
        names: of it in the cameras' models, by place of the camera.
    """

    parameter: Parameter
    std: float
    lack: Lack | None
    names: dict[int, str]

    @property
    def label(self) -> Label:
        """Whose number it is, and its name there."""
        return self.lack, key_of(self.parameter.name) if self.lack else self.parameter.name


@dataclass(frozen=True)
class CameraSet:
    """A set at its best numbers, to which the cameras' models are set.

    Attributes:
        lacks: effects.
        models: of each camera.
        numbers: N of them.
        value: (N,).
        laplace: of those that have a slope, in their order.
        counts: of whole numbers, by place: values (V,), and log likelihood (V,) over the best's.
    """

    lacks: tuple[Lack, ...]
    models: list[native.Model]
    numbers: list[Number]
    value: np.ndarray
    laplace: Laplace
    counts: dict[int, tuple[np.ndarray, np.ndarray]] = field(repr=False)

    @property
    def values(self) -> dict[Label, float]:
        """The best numbers."""
        return {n.label: float(v) for n, v in zip(self.numbers, self.value, strict=True)}

    def log_evidence(self, dispersion: float = 1.0) -> float:
        """With all numbers integrated; whole ones are summed over."""
        sums = [float(logsumexp(self._weights(k, dispersion))) for k in self.counts]
        return self.laplace.log_evidence(dispersion) + sum(sums)

    def estimates(self, dispersion: float = 1.0) -> dict[Label, tuple[float, float]]:
        """Posterior mean and standard deviation of each number."""
        smooth = [n.label for k, n in enumerate(self.numbers) if k not in self.counts]
        own = zip(*(rows.tolist() for rows in self.laplace.posterior(dispersion)), strict=True)
        found = dict(zip(smooth, own, strict=True))
        for k, (values, _) in self.counts.items():
            logs = self._weights(k, dispersion)
            share = np.exp(logs - logsumexp(logs))
            mean = float(share @ values)
            found[self.numbers[k].label] = mean, float(np.sqrt(share @ (values - mean) ** 2))
        return found

    def _weights(self, k: int, dispersion: float) -> np.ndarray:
        """(V,) log posterior of the values of a whole number, up to a constant."""
        values, told = self.counts[k]
        prior = -0.5 * ((values - self.numbers[k].parameter.usual) / self.numbers[k].std) ** 2
        return prior - logsumexp(prior) + told / dispersion


class Likelihood:
    """Log likelihood of each camera's bits at some numbers; what did not move is not asked anew."""

    def __init__(
        self, cameras: Sequence[Detections], models: list[native.Model], numbers: Sequence[Number]
    ) -> None:
        self.cameras, self.models, self.numbers = cameras, models, numbers
        self.pick = slice(None)
        self._last: dict[int, tuple[object, float]] = {}

    def __call__(self, x: np.ndarray, of: Collection[int] | None = None) -> np.ndarray:
        """(C,) at (N,) numbers; of cameras that are not asked 0."""
        told = np.zeros(len(self.cameras))
        for c in range(len(self.cameras)) if of is None else of:
            own = [(n, float(v)) for n, v in zip(self.numbers, x, strict=True) if c in n.names]
            key = self.pick.step, tuple(v for _, v in own)
            if self._last.get(c, (None, 0.0))[0] != key:
                for n, v in own:
                    self.models[c].set(
                        n.names[c], float(np.clip(v, n.parameter.min, n.parameter.max))
                    )
                each = self.cameras[c].likelihood(self.models[c], self.pick)
                self._last[c] = key, float(np.nansum(each)) * (self.pick.step or 1)
            told[c] = self._last[c][1]
        return told


class CameraFitter:
    """Fits sets of effects to the bits of cameras of one kind.

    Args:
        cameras: frames with poses, of one robot or several.
        model_file: the model; its own effects of the camera are known as a data sheet's numbers.
    """

    def __init__(self, cameras: Sequence[Detections], model_file: ModelFile) -> None:
        self.cameras = list(cameras)
        self.given = [model_file.model.for_robot(c.robot_id) for c in cameras]
        self._known = self._known_numbers(model_file)
        count = sum(len(c.frames.t_s) for c in cameras)
        raw = all(c.frames.has_raw for c in cameras)  # else few frames count as it is
        self._thin = slice(None, None, max(1, -(-count // MOST_FRAMES)) if raw else 1)

    def fit(self, lacks: Sequence[Lack], begin: CameraSet | None = None) -> CameraSet:
        """A set with all numbers at their best; they begin where another set has them."""
        told, x, _ = self._begun(lacks, begin)
        return self._at(lacks, told, self._maximised(told, x, range(len(x))), None)

    def with_more(self, begin: CameraSet, lack: Lack) -> CameraSet:
        """A set with an effect more, from the best of a grid of each number on; all others stay."""
        lacks = (*begin.lacks, lack)
        told, x, fresh = self._begun(lacks, begin)
        for k in fresh:
            x[k] = max(starts([told.numbers[k].parameter]), key=self._worth(told, x, [k]))[0]
        return self._at(lacks, told, self._maximised(told, x, fresh), begin)

    def _begun(
        self, lacks: Sequence[Lack], begin: CameraSet | None
    ) -> tuple["Likelihood", np.ndarray, list[int]]:
        """Likelihood of a set, (N,) numbers where another set has them, and which it has not."""
        models = [m.copy() for m in self.given]
        numbers = [*self._known, *(n for lack in lacks for n in self._added(lack, models))]
        known = begin.values if begin else {}
        x = np.array([known.get(n.label, n.parameter.usual) for n in numbers])
        fresh = [k for k, n in enumerate(numbers) if n.label not in known]
        return Likelihood(self.cameras, models, numbers), x, fresh

    def _maximised(self, told: Likelihood, x: np.ndarray, free: Sequence[int]) -> np.ndarray:
        """(N,) numbers of which some are moved to the best posterior; whole ones stay."""
        free = [k for k in free if not is_count(told.numbers[k].parameter)]
        worth, parameters = self._worth(told, x, free), [told.numbers[k].parameter for k in free]
        own, best = x[free], worth(x[free])
        reach = np.array([0.99 * REACH * abs(p.strength) for p in parameters])
        for _ in range(ROUNDS):
            begun, before = own, best
            own = maximised(worth, own, parameters, GRAIN)
            best = worth(own)
            within = len(free) < 2 and np.all(np.abs(own - begun) < reach)  # one search finds it
            if within or best < before + SETTLED:
                break
        found = x.copy()
        found[free] = own
        return found

    def _worth(
        self, told: Likelihood, x: np.ndarray, free: Sequence[int]
    ) -> Callable[[np.ndarray], float]:
        """Log posterior at (F,) some of (N,) numbers, up to a constant; of every Nth frame."""
        mean = np.array([n.parameter.usual for n in told.numbers])
        std = np.array([n.std for n in told.numbers])
        told.pick = self._thin

        def worth(own: np.ndarray) -> float:
            at = x.copy()
            at[free] = own
            return float(told(at).sum() - 0.5 * np.sum(((at - mean) / std) ** 2))

        return worth

    def _at(
        self, lacks: Sequence[Lack], told: Likelihood, x: np.ndarray, begin: CameraSet | None
    ) -> CameraSet:
        """A set at (N,) numbers; those that another set has keep its slopes and curvatures."""
        told.pick, numbers = slice(None), told.numbers
        smooth = [k for k, n in enumerate(numbers) if not is_count(n.parameter)]
        own = [numbers[k] for k in smooth]
        prior = Prior(
            np.array([n.parameter.usual for n in own]),
            np.array([n.std for n in own]),
            np.array([n.parameter.min for n in own]),
            np.array([n.parameter.max for n in own]),
            np.array([abs(n.parameter.strength) for n in own]),
            [{*n.names} for n in own],
        )

        def at(values: np.ndarray, of: Collection[int] | None) -> np.ndarray:
            moved = x.copy()
            moved[smooth] = values
            return told(moved, of)

        found = laplace(at, x[smooth], prior, begin.laplace if begin else None)
        counts = {}
        for k in {*range(len(numbers))} - {*smooth}:
            (values,) = np.array(starts([numbers[k].parameter])).T
            rows = np.tile(x, (len(values), 1))
            rows[:, k] = values
            logs = np.array([told(row).sum() for row in rows])
            counts[k] = values, logs - found.log_likelihood
        told(x)  # the models keep what was asked last
        return CameraSet(tuple(lacks), told.models, list(numbers), x, found, counts)

    def _added(self, lack: Lack, models: list[native.Model]) -> list[Number]:
        """Numbers of an effect, which the models of its cameras get."""
        own = [k for k, c in enumerate(self.cameras) if lack.robot in (None, c.robot_id)]
        acts_as = acting(lack.effect)
        for k in own:
            models[k].add_effect(acts_as)
        scratch = models[own[0]].copy()
        scratch.add_effect(lack.effect)
        parameters = effect_parameters(scratch, newest_instance(scratch, lack.effect), fresh=True)

        def name(k: int, p: Parameter) -> str:
            return f"{newest_instance(models[k], acts_as)}.{key_of(p.name)}"

        return [Number(p, size_std(p), lack, {k: name(k, p) for k in own}) for p in parameters]

    def _known_numbers(self, model_file: ModelFile) -> list[Number]:
        """Numbers of the effects that the model has, as well known as a fit told and they drift."""
        stated = [
            stated_names(m, c.robot_id) for m, c in zip(self.given, self.cameras, strict=True)
        ]
        parameters = all_effect_parameters(model_file.model, CAMERA_STAGES)
        fitted = model_file.covariance.of([p.name for p in parameters])
        told = dict(zip(fitted.names, np.sqrt(np.diag(fitted.values)), strict=True))
        found = []
        for p in parameters:
            std = float(np.hypot(told.get(p.name, 0.0), PRIORS.sheet * p.value))
            names = {k: p.name for k, own in enumerate(stated) if p.name not in own}
            if std > 0 and names:
                found.append(Number(replace(p, usual=p.value), std, None, names))
        return found


def acting(effect: str) -> str:
    """Effect of the camera by which a camera shows another one, or itself."""
    return effect if is_of_camera(effect) else SEEN_AS
