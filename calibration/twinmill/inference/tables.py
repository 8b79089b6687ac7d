# SPDX-License-Identifier: Apache-2.0
"""Tables of steady speeds, ready for inference.

A step is a reading: one value of one robot at one input. Nothing is known of time, place or
heading. Readings are independent, and how far each scatters about the model of its kind of robot is
known beforehand: by its floor. Beside it each of several robots has wheels of its own.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import twinmill_native as native
from scipy.linalg import block_diag

from twinmill.data.steady_table import LACKS, SteadyTable
from twinmill.inference import candidates, discrepancy
from twinmill.inference.candidate import Candidate, with_limits, with_sizes
from twinmill.inference.discrepancy import SIZES
from twinmill.inference.duties import off_by, refined
from twinmill.inference.evidence import log_evidence
from twinmill.inference.hypothesis import Fitter, Guess
from twinmill.inference.noise import HEAVY, Course, Noise, Usual, fit_noise
from twinmill.inference.planar import planar_kinds
from twinmill.inference.prior import Prior, base_prior
from twinmill.inference.problem import Problem, flexible
from twinmill.inference.readings import Readings
from twinmill.inference.search import Search
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    CLOCK,
    CLOCK_RATE,
    LAG,
    Parameter,
    base_parameters,
    catalogue,
    effect_parameters,
    gains_of,
    newest_instance,
)
from twinmill.predict.steady_states import SteadyStates

WORDS = ("speed", "coupling of turns")  # dependences that a table can show
OF_WHEELS = "wheel_gain"  # the effect by which robots of a kind differ
UNSEEN = 1e-6  # of a floor: noise beside that of the floors, or a change of readings
ROUNDS, SETTLED = 8, 0.1  # of looking for wrong readings; change of a weight that ends it, relative
CHI2_MEDIAN = 0.455  # of a squared normal variate


@dataclass(frozen=True)
class TableProblem(Problem):
    """Robots of one model in a table, or in several.

    Attributes:
        motion: at each reading, as the base predicts it.
    """

    steps: Readings
    motion: Motion

    def candidate(self, name: str, model: native.Model) -> Candidate:
        """Change by an effect of the twin's catalogue beside a model."""
        model = model.copy()
        model.add_effect(name)
        parameters = effect_parameters(model, newest_instance(model, name), fresh=True)
        if any(p.role == "limit" for p in parameters):
            return with_limits(name, parameters, model, self.steps)
        usual = np.array([p.usual for p in parameters])
        return with_sizes(name, parameters, model, self.steps, on=usual)

    def forms(self, change: np.ndarray) -> tuple[np.ndarray, ...]:
        """Shapes by which an effect's formula may be wrong: of speed alone."""
        by_speed = discrepancy.forms_of_speed(self.motion)
        return discrepancy.without_size((f[:, :, None] * change for f in by_speed), change)

    @property
    def has_moments(self) -> bool:
        """False: a table has no time."""
        return False

    def of_moments(self) -> np.ndarray:
        """(1, 2, R, 1) no bins."""
        return np.zeros((1, 2, len(self.steps), 1))


def searched(
    tables: Sequence[SteadyTable],
    model_file: ModelFile,
    sheet: ModelFile | None = None,
    progress: Callable[[str], None] = lambda _: None,
    *,
    without: Collection[str] = (),
) -> Search:
    """Search over what a model lacks in tables.

    Errors of typing and timing are common in them. What the likeliest hypothesis misses by far
    weighs as under Student's t, and the search is made again until no weight changes.

    Args:
        tables: one for each robot of each file.
        model_file: model of all of them.
        sheet: the model before it was fitted to these tables; None where others told it.
        progress: told in words what is being done.
        without: effects that do not compete.

    Raises:
        LogError: the model's drive is of no such table.
    """
    model = _model_of(model_file)
    steps = Readings([SteadyStates.of(t, model) for t in tables])
    weights = np.ones(len(steps))
    for _ in range(ROUNDS):
        problem = problem_of(steps.weighed(weights), model_file, sheet, without)
        search = Search(problem, progress).run()
        before, weights = weights, _weights(problem, search, weights)
        if np.all(np.abs(weights - before) <= SETTLED * before):
            break
        progress("wrong readings")
    return search


def problem_of(
    steps: Readings, model_file: ModelFile, sheet: ModelFile | None, without: Collection[str]
) -> TableProblem:
    """Prepares readings; the other arguments are those of `searched`."""
    model = _model_of(model_file)
    model = model if steps.several else model.for_robot(steps.tables[0].robot_id)
    prior = _prior(steps, model, model_file, sheet)
    motion, change = steps.motion(model)
    kernels = [
        replace(kernel, columns=(kernel.columns * change).sum(axis=2, keepdims=True))
        for kernel in discrepancy.kernels(motion, WORDS)
    ]
    kernels = [kernel for kernel in kernels if np.abs(kernel.columns).max() > UNSEEN]
    noise = _noise(steps)
    base = Fitter(steps, noise, prior.columns).fit(Guess.of_base(model, prior))
    usual, kinds = _usual(noise, steps.freedom), planar_kinds()
    p = TableProblem(steps, prior, base, kernels, [], None, usual, noise, {}, kinds, (), motion)
    p = replace(p, names=[name for name in _names(p, model) if name not in without])
    prior = prior.with_columns(_of_robots(p, model))
    base = Fitter(steps, noise, prior.columns).fit(Guess.of_base(model, prior))
    p = replace(p, prior=prior, base=base)
    noise = fit_noise(*flexible(p), noise, usual)
    return replace(p, noise=noise, base=Fitter(steps, noise, prior.columns).fit(base))


def _model_of(model_file: ModelFile) -> native.Model:
    return refined(model_file).model if model_file.model.drive == "duty" else model_file.model


def _weights(p: TableProblem, search: Search, before: np.ndarray) -> np.ndarray:
    """(R,) weights of readings by what the likeliest hypothesis leaves, of those `before`."""
    own = search.fitted[search.likely()[0]]
    f, s, gain = own.likeliest(range(len(p.kernels)))
    linear = own.with_kernel(search.view, f, float(SIZES[s])) if gain > 0 else own.linear
    left = np.abs(linear.residuals) * p.noise.drive / before
    size = np.sqrt(np.median(left[~p.steps.zero] ** 2) / CHI2_MEDIAN)
    return np.minimum(1.0, HEAVY * max(size, 1.0) / np.maximum(left, UNSEEN))


def _prior(
    steps: Readings, model: native.Model, model_file: ModelFile, sheet: ModelFile | None
) -> Prior:
    """Prior of the base, without lag and clocks, which no table tells.

    About a fit to these tables the base may as well be as its sheet says: an effect that is missing
    spoils the fit, to precise tables by far more than a sheet is off.
    """
    prior = base_prior(model, model_file, same_clock=True, known=True, effects=())
    prior = prior.without((LAG, CLOCK, CLOCK_RATE))
    if model.drive == "duty":
        bench = any(t.measurement.of_wheels for t in steps.tables)
        table = off_by(model_file, PRIORS.sheet, scale=bench)
        others = (prior.sheet * PRIORS.sheet * prior.mean)[len(table) :]
        prior = replace(prior, off=block_diag(table, np.diag(others)))
    if sheet is None:
        return prior
    prior, given = prior.before_any_log(), _model_of(sheet)
    moved = np.array([given.get(name) - model.get(name) for name in prior.names])
    return replace(prior, cov=prior.cov + np.outer(moved, moved))


def _of_robots(p: TableProblem, model: native.Model) -> np.ndarray:
    """(K, R, 1) change of a robot's readings by its own wheels, for each of several robots.

    All of its wheels are faster by something, and each by something more. By how much robots of the
    kind differ in either is told by the readings, whatever all of them lack.
    """
    steps = p.steps
    if not steps.several:
        return np.zeros((0, len(steps), 1))
    model, own = _with_wheels(model)
    value, step = np.array([q.value for q in own]), np.diag([q.step for q in own])
    both = steps.errors(model, [q.name for q in own], np.concatenate([value - step, value + step]))
    change = (both[: len(own)] - both[len(own) :]) / (2 * np.diag(step)[:, None, None])
    robots = (np.arange(steps.block.max() + 1)[:, None] == steps.block)[:, None, :, None]
    kinds = [(robots * of).reshape(-1, len(steps), 1) for of in (change.sum(axis=0), change)]
    errors, columns = map(p.noise.whiten, flexible(p))
    white = [p.noise.whiten(own) for own in kinds]

    def log(sizes: tuple[float, float]) -> float:
        sized = [size * rows for size, rows in zip(sizes, white, strict=True)]
        return log_evidence(errors, np.concatenate([columns, *sized]))

    sizes = max(product((0.0, *SIZES.tolist()), repeat=2), key=log)
    return np.concatenate([size * rows for size, rows in zip(sizes, kinds, strict=True)])


def _with_wheels(model: native.Model) -> tuple[native.Model, list[Parameter]]:
    """A model with a gain of each wheel, and these; where no wheel matters, with its own gains."""
    model = model.copy()
    if model.wheel_kind == "none":
        return model, base_parameters(model, gains_of(model))
    model.add_effect(OF_WHEELS)
    parameters = effect_parameters(model, newest_instance(model, OF_WHEELS))
    return model, [q.at(q.usual) for q in parameters]


def _names(p: TableProblem, model: native.Model) -> list[str]:
    """Effects that these tables can show, by what they need and by what they change."""
    every = candidates.candidates(model, [], same_clock=True, declared=True)
    able = p.columns(p.base, [n for n in every if catalogue()[n]["needs"] not in LACKS])
    changes = {n: c.columns if c.limits is None else c.limits.changes for n, c in able.items()}
    return [name for name, change in changes.items() if np.abs(change).max() > UNSEEN]


def _noise(steps: Readings) -> Noise:
    """White, of the floors; a reading of zero does not tell how others scatter."""
    alone = [slice(k, k + 1) for k in range(len(steps))]
    course = Course(1.0, alone, np.ones(len(steps)), ~steps.zero[None])
    return Noise(np.full(1, UNSEEN), np.ones(1), np.full(1, UNSEEN), np.ones(1), course)


def _usual(noise: Noise, freedom: int) -> Usual:
    """Knowledge of the noise's size: floors of n degrees of freedom tell it to 1 / sqrt(2 n)."""
    weak = Usual.about(noise)
    precision = np.linalg.inv(weak.cov)
    precision[:, 1, 1] += 2 * freedom
    return replace(weak, cov=np.linalg.inv(precision))
