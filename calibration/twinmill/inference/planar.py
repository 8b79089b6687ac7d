# SPDX-License-Identifier: Apache-2.0
"""Robots that drive on a floor, ready for inference."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.estimation.opened import coarse_floor, opened_over
from twinmill.inference import candidates, discrepancy, moments
from twinmill.inference.candidate import Candidate
from twinmill.inference.differ import SPREAD
from twinmill.inference.discrepancy import Kernel
from twinmill.inference.duties import refined
from twinmill.inference.hypothesis import Fitter, Guess, Hypothesis
from twinmill.inference.lasting import Lasting
from twinmill.inference.noise import FINEST, Course, Noise, Usual, first_noise
from twinmill.inference.prior import Always, Prior, base_prior, labels_of, with_always
from twinmill.inference.problem import Kinds, Missed, Problem, flexible_noise
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion, Steps, StepsOfLog, motion_of
from twinmill.inference.swings import swing
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    CLOCK,
    HEADING,
    LAG,
    WHERE_OR_WHEN,
    beginning_at_a_moment,
    catalogue,
    effect_names,
    is_local,
    newest_instance,
    of_each_log,
)

CLOCK_GRID_S = np.arange(-1.0, 1.01, 0.05)  # half of the shortest time between two commands
FINE_GRID_S = np.arange(-0.05, 0.0501, 0.002)  # about that, where logs are set side by side
CLOCK_REACH_S = 0.3  # about the best of the grid
NO_LAG_S = 1e-3
SPREAD_OF_KIND = "idiosyncrasy.theta_a1_std"  # as a model file may state it; 0: it does not
UNSEEN = 0.01  # variance of a column over that of noise: it moves the evidence by a 200th
TOLD_BY = {  # what a thing depends on that is mistaken for an effect, by what its card needs
    "steady_speed": ("speed", "coupling of turns"),
    "poses": ("coupling of turns",),
    "changes": ("past",),
    "clocks": ("past", "time"),
    "history": ("time", "moments"),
    "battery": ("time",),
    "room": ("place", "heading"),
    "heading": ("heading",),
    "wheel_angle": ("past", "place", "time"),
}


@dataclass(frozen=True)
class PlanarProblem(Problem):
    """A robot that drives on a floor, in one log or several.

    Attributes:
        motion: as the base predicts it.
        always: what the base misses in its own log; None where that is not known.
        same_clock: the offset of the clocks is known.
    """

    steps: Steps
    motion: Motion
    always: Always | None
    same_clock: bool

    def candidate(self, name: str, model: native.Model) -> Candidate:
        """Change by an effect of the twin's catalogue beside a model."""
        return candidates.candidate(name, model, self.steps)

    def forms(self, change: np.ndarray) -> tuple[np.ndarray, ...]:
        """Shapes by which an effect's formula may be wrong: of speed, time, place and heading."""
        return discrepancy.forms_of(change, self.motion)

    def always_there(
        self, h: Hypothesis, effects: Sequence[str]
    ) -> tuple[Hypothesis, float] | None:
        """With the numbers that the base's own log gives."""
        if self.always is None or not self.always.hidden.knows(effects):
            return None
        return self.always.hidden.explained(h, effects, self._known(self.always))

    def lasting(self, kernel: str) -> Lasting | None:
        """As the model's file keeps it."""
        return None if self.always is None else self.always.lasting.get(kernel)

    def in_own_log(self, slopes: np.ndarray) -> np.ndarray:
        """Numbers that this log has not, such as weights of no use in it, have no slopes."""
        if self.always is None:
            return slopes
        known = self._known(self.always)
        return slopes[known] * (known >= 0)[:, None]

    def _known(self, always: Always) -> np.ndarray:
        """(N,) places of the own log's numbers among those of this log; -1 where it has none."""
        labels = labels_of(self.prior, always, self.kernels)
        return np.array([labels.index(n) if n in labels else -1 for n in always.labels])

    def of_moments(self) -> np.ndarray:
        """Gains of travel and turning, and two pushes, up to each of the bins."""
        return moments.columns(self.motion)


def planar_kinds() -> Kinds:
    """Kinds of effects in the twin's catalogue."""
    sized = [
        name
        for name, card in catalogue().items()
        if not any(p["role"] in (*WHERE_OR_WHEN, "limit") for p in card["parameters"])
    ]
    return Kinds(
        {
            name: TOLD_BY[card["needs"]]
            for name, card in catalogue().items()
            if card["needs"] in TOLD_BY  # others show only to cameras
        },
        frozenset(filter(is_local, catalogue())),
        frozenset(beginning_at_a_moment()),
        frozenset(sized),
    )


def problem_of(
    measurements: Sequence[Measurement],
    model_file: ModelFile,
    always: Always | None = None,
    sheet: bool = False,
    *,
    without: Collection[str] = (),
    of_a_kind: bool = False,
) -> PlanarProblem:
    """Prepares the logs of a robot.

    Args:
        measurements: of one robot, one for each log.
        model_file: its base model.
        always: what the model misses in the log that it was fitted to.
        sheet: nothing of the base is known but a data sheet.
        without: effects that do not compete.
        of_a_kind: the base is that of several robots, whose numbers differ.
    """
    measurements = [m.punctual() for m in measurements]
    whole = model_file.model
    if whole.drive == "duty":
        whole = refined(model_file).model
    model = whole.for_robot(measurements[0].track.robot_id)
    bare = model.copy()
    for name in always.effects if always else ():
        model.add_effect(name)
    known = model.clock_known and not any(
        m.log_sha256 in model_file.clock_logs for m in measurements
    )
    one_clock = all(m.same_clock for m in measurements)
    if one_clock and not known:
        model.set(CLOCK, 0.0)
    declared = one_clock or model.clock_same
    same_clock = (known or declared) and all(m.lateness is None for m in measurements)
    logs = [StepsOfLog(m, own=own) for m, own in _of_each_log(measurements, model_file)]
    prior = base_prior(
        model,
        model_file,
        same_clock=same_clock,
        known=known,
        effects=always.effects if always else (),
    )
    if sheet:
        prior = prior.before_any_log()
    if not same_clock:
        prior, logs = _with_clock(prior, model, logs)
    steps = Steps(logs)
    if always is not None:
        _set_to(model, prior, always)
    bare.set(CLOCK, model.get(CLOCK))
    motion = _motion(steps, bare, always)  # as in its own log: weights belong to these columns
    found = discrepancy.kernels(motion)
    noise = _begin_noise(steps, motion, model_file, always)
    usual = always.noise if always is not None else Usual.about(noise)
    kinds, missed = planar_kinds(), []
    if always is not None:
        prior = with_always(prior, always, found, same_clock=same_clock)
        changes = _changes(steps, model, always.effects)
        missed = [
            *(Missed(kinds.told_by[n], c) for n, c in zip(always.effects, changes, strict=True)),
            *_missed_by_kernels(prior, always, found),
        ]
        prior = prior.with_columns(_seen(_missed_by_formulas(changes, motion), noise))
    if of_a_kind:
        prior = prior.of_a_kind(model.get(SPREAD_OF_KIND) or SPREAD)
    base = Fitter(steps, noise, prior.columns).fit(Guess.of_base(model, prior))
    every = candidates.candidates(model, [m.track for m in measurements], same_clock, declared)
    names = [name for name in every if name not in without]
    rate = always.rate if always else None
    wander = {k: discrepancy.in_another_log(p) for k, p in always.wander.items()} if always else {}
    rough = PlanarProblem(
        steps,
        prior,
        base,
        found,
        names,
        rate,
        usual,
        noise,
        wander,
        kinds,
        tuple(missed),
        motion,
        always,
        same_clock,
    )
    noise = flexible_noise(rough)
    fitter = Fitter(steps, noise, prior.columns)
    base = fitter.fit(base)
    swings = swing(motion, base, fitter)
    return replace(rough, noise=noise, base=base, kernels=[*found, *([swings] if swings else [])])


def _of_each_log(
    measurements: Sequence[Measurement], model_file: ModelFile
) -> list[tuple[Measurement, dict[str, float]]]:
    """Each log with what no other log tells.

    Wheels' angles at its start, phases of formulas, and a heading that was held and not recorded.
    """
    held = [HEADING] if any(not m.track.has_heading for m in measurements) else []
    if not (held or of_each_log(model_file.model)):
        return [(m, {}) for m in measurements]
    found = [opened_over(m, model_file, k, coarse_floor) for k, m in enumerate(measurements)]
    names = [[*held, *(p.name for p in of_each_log(o.model))] for o in found]
    values = [{n: o.model.get(n) for n in own} for o, own in zip(found, names, strict=True)]
    return [*zip(measurements, values, strict=True)]


def _changes(steps: Steps, model: native.Model, effects: Sequence[str]) -> np.ndarray:
    """(E, W, 3) change of the prediction by each effect of a model."""
    whole, found = steps.predicted(model), []
    for name in effects:
        less = model.copy()
        less.remove_effect(effect_names(less).index(newest_instance(less, name)))
        found.append(whole - steps.predicted(less))
    return np.array(found).reshape(-1, *whole.shape)


def _missed_by_kernels(prior: Prior, always: Always, found: list[Kernel]) -> Iterator[Missed]:
    """Change by each kernel of the base's discrepancy, at the mean of its weights."""
    sizes, first = dict(always.kernels), 0
    for kernel in found:
        if kernel.name in sizes:
            at = slice(first, first + len(kernel.columns))
            weights, first = prior.mean[len(prior.names) :][at], at.stop
            yield Missed((kernel.depends_on,), np.tensordot(weights, prior.columns[at], 1))


def _missed_by_formulas(changes: np.ndarray, motion: Motion) -> np.ndarray:
    """(K, W, 3) columns of what the formulas of (E, W, 3) effects may miss, of usual size.

    An effect is off in one of its forms by a size that is exponentially distributed; of this
    mixture the normal distribution has the variance.
    """
    found = [changes[:0]]
    for change in changes:
        forms = discrepancy.forms_of(change, motion)
        found += [np.sqrt(2 / len(forms)) * PRIORS.form * f for f in forms]
    return np.concatenate(found)


def _seen(columns: np.ndarray, noise: Noise) -> np.ndarray:
    """(K', W, 3) fewer columns of a Gaussian process: its principal components that noise leaves.

    Karhunen-Loeve expansion; Rasmussen and Williams 2006, ch. 4.3.
    """
    white = noise.whiten(columns)
    variance, ways = np.linalg.eigh(white @ white.T)
    return np.tensordot(ways.T[variance > UNSEEN], columns, 1)


def _set_to(model: native.Model, prior: Prior, always: Always) -> None:
    """Sets a model to the numbers that the base's own log gave, but for its clock."""
    known = dict(zip(always.labels, always.mean, strict=True))
    for name, low, high in zip(prior.names, prior.low, prior.high, strict=True):
        if name in known and not name.startswith("clock."):
            model.set(name, float(np.clip(known[name], low, high)))


def _with_clock(
    prior: Prior, model: native.Model, logs: list[StepsOfLog]
) -> tuple[Prior, list[StepsOfLog]]:
    """The prior about the offset of the first log's clocks, and each log with its own beside it."""
    each = [_least_s(model, log, CLOCK_GRID_S + model.get(CLOCK)) for log in logs]
    best = each[0]
    if len(logs) > 1:
        each = [_least_s(model, log, at + FINE_GRID_S) for log, at in zip(logs, each, strict=True)]
        best = each[0]
        late = zip(logs, each, strict=True)
        logs = [StepsOfLog(log.measurement, at - best, log.own) for log, at in late]
    k = prior.names.index(CLOCK)
    mean, low, high = prior.mean.copy(), prior.low.copy(), prior.high.copy()
    mean[k], low[k], high[k] = best, best - CLOCK_REACH_S, best + CLOCK_REACH_S
    model.set(CLOCK, best)
    return replace(prior, mean=mean, low=low, high=high), logs


def _least_s(model: native.Model, log: StepsOfLog, grid_s: np.ndarray) -> float:
    """Offset of the clocks at which the errors of a log are least."""
    errors = log.errors(model, [CLOCK], grid_s[:, None])
    size = np.sqrt((errors**2).mean(axis=(0, 1)))
    size = np.where(size > 0, size, 1.0)
    return float(grid_s[np.argmin(((errors / size) ** 2).sum(axis=(1, 2)))])


def _motion(steps: Steps, model: native.Model, always: Always | None) -> Motion:
    moved = steps.predicted(model)
    instant = moved
    if model.get(LAG) > 0:
        quick = model.copy()
        quick.set(LAG, NO_LAG_S)
        instant = steps.predicted(quick)
    return motion_of(steps, moved, instant, (always.usual, always.top) if always else None)


def _begin_noise(
    steps: Steps, motion: Motion, model_file: ModelFile, always: Always | None
) -> Noise:
    course = Course(float(np.median(steps.step_s)), steps.stretches, motion.pace)
    if always is not None:
        sensor, drive, gain, memory_s = np.exp(always.noise.logs)
        return Noise(sensor, drive, gain, memory_s, course, finest=FINEST)
    return first_noise(course, model_file.recorded_noise)
