# SPDX-License-Identifier: Apache-2.0
"""One robot, ready for inference: errors, prior, noise, and all that may be missing."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.inference import candidates, discrepancy, moments
from twinmill.inference.candidates import Candidate
from twinmill.inference.discrepancy import Kernel
from twinmill.inference.duties import refined
from twinmill.inference.evidence import Linear
from twinmill.inference.hypothesis import Fitter, Hypothesis
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Course, Noise, first_noise, fit_noise, weights_of
from twinmill.inference.prior import Always, Prior, base_prior, with_always
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion, Steps, StepsOfLog, motion_of
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import CLOCK, LAG, is_local

CLOCK_GRID_S = np.arange(-1.0, 1.01, 0.05)  # half of the shortest time between two commands
FINE_GRID_S = np.arange(-0.05, 0.0501, 0.002)  # about that, where logs are set side by side
CLOCK_REACH_S = 0.3  # about the best of the grid
FLEXIBLE = 0.05  # gain error of each kernel while noise is looked for first
NO_LAG_S = 1e-3


@dataclass(frozen=True)
class View:
    """What may be missing, as it looks under a noise.

    Attributes:
        fitter: of the log, under that noise.
        kernels: F nameless dependences.
        stacked: (sum of K, R) their white columns.
        parts: of each kernel in these.
        grams: of each kernel, (K, K) products.
        moments: white columns of moments, and their products, as `moments.find` takes them.
        log_sizes: (R,) of the noise, less a share of its log prior.
        block: (R,) number of the block of time of each white row.
    """

    fitter: Fitter
    kernels: list[Kernel]
    stacked: np.ndarray
    parts: list[slice]
    grams: list[np.ndarray]
    moments: tuple[np.ndarray, np.ndarray]
    log_sizes: np.ndarray
    block: np.ndarray

    @property
    def log_size(self) -> float:
        """What each log evidence under this noise is less by."""
        return float(self.log_sizes.sum())

    def white(self, f: int) -> np.ndarray:
        """(K, R) white columns of a kernel."""
        return self.stacked[self.parts[f]]


@dataclass(frozen=True)
class Problem:
    """One robot in one log or several.

    Attributes:
        steps: of the logs.
        motion: as the base predicts it.
        prior: of the base.
        base: fitted, nothing missing.
        kernels: nameless dependences that compete.
        names: of the effects that compete.
        rate: of moments, as the base's own log had them; None where that is not known.
        usual: noise as other logs had it.
        noise: what all flexible terms together leave.
        wander: dependences on time and place that are no news, and the probability of each size.
    """

    steps: Steps
    motion: Motion
    prior: Prior
    base: Hypothesis
    kernels: list[Kernel]
    names: list[str]
    rate: Rate | None
    usual: Noise
    noise: Noise
    wander: dict[str, np.ndarray]

    def view(self, noise: Noise) -> View:
        """What may be missing, under a noise."""
        fitter = Fitter(self.steps, noise, self.prior.columns)
        stacked = fitter.whiten(np.concatenate([k.columns for k in self.kernels]))
        edges = np.cumsum([0, *(len(k.columns) for k in self.kernels)])
        parts = [slice(a, b) for a, b in pairwise(edges)]
        at_moments = fitter.whiten(moments.columns(self.motion))
        flat = at_moments.reshape(-1, at_moments.shape[-1])
        return View(
            fitter,
            self.kernels,
            stacked,
            parts,
            [stacked[part] @ stacked[part].T for part in parts],
            (at_moments, flat @ flat.T),
            noise.log_sizes(self.steps.observed)
            - noise.log_odds(self.usual) / (3 * len(self.steps)),
            np.tile(self.steps.block, 3),
        )

    def told(self, h: Hypothesis) -> Hypothesis:
        """A hypothesis with the base's numbers at the prior's mean, which hardly knows clocks.

        Without an effect they may have gone far to stand in for it: what it would change, and what
        they would, are compared where neither has yet.
        """
        known = np.array([not n.startswith("clock.") for n in h.labels]) & ~h.of_effects
        value = np.where(known, np.clip(h.mean, h.low, h.high), h.value)
        fitter = Fitter(self.steps, self.noise, self.prior.columns)
        return fitter.at(replace(h, value=value, slopes=None))

    def columns(self, h: Hypothesis, names: Collection[str] | None = None) -> dict[str, Candidate]:
        """What each effect that a hypothesis lacks would change; of some effects, or of all.

        What acts at a place or for a while may be there more than once.
        """
        found = {}
        for name in self.names if names is None else names:
            if name not in h.effects or is_local(name):
                try:
                    found[name] = candidates.candidate(name, h.model, self.steps)
                except ValueError:  # this model cannot have it
                    continue
        return found


def problem_of(
    measurements: Sequence[Measurement],
    model_file: ModelFile,
    always: Always | None = None,
    sheet: bool = False,
) -> Problem:
    """Prepares the logs of a robot.

    Args:
        measurements: of one robot, one for each log.
        model_file: its base model.
        always: what the model misses in the log that it was fitted to.
        sheet: nothing of the base is known but a data sheet.
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
    logs = [StepsOfLog(m) for m in measurements]
    prior = base_prior(
        model,
        model_file,
        same_clock=same_clock,
        known=known,
        effects=always.effects if always else (),
    )
    if sheet:
        prior = replace(prior, cov=prior.stale)
    if not same_clock:
        prior, logs = _with_clock(prior, model, logs)
    steps = Steps(logs)
    if always is not None:
        _set_to(model, prior, always)
    bare.set(CLOCK, model.get(CLOCK))
    motion = _motion(steps, bare, always)  # as in its own log: weights belong to these columns
    found = discrepancy.kernels(motion)
    if always is not None:
        prior = with_always(prior, always, found)
    noise = _begin_noise(steps, motion, model_file, always)
    base = Fitter(steps, noise, prior.columns).fit(Hypothesis.of_base(model, prior))
    names = candidates.candidates(model, [m.track for m in measurements], same_clock, declared)
    rate = always.rate if always and always.rate.there > 0.5 else None  # likelier than not
    wander = {w: discrepancy.in_another_log(p) for w, p in always.wander.items()} if always else {}
    rough = Problem(steps, motion, prior, base, found, names, rate, noise, noise, wander)
    noise = _flexible_noise(rough)
    base = Fitter(steps, noise, prior.columns).fit(base)
    return replace(rough, noise=noise, base=base)


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
        logs = [StepsOfLog(log.measurement, at - best) for log, at in zip(logs, each, strict=True)]
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
        return Noise(*always.noise, course)
    return first_noise(course, model_file.recorded_noise)


def _flexible_noise(p: Problem) -> Noise:
    """The noise that all effects and all dependences together leave; far errors weigh less."""
    base = p.told(p.base)
    free = [np.tensordot(np.linalg.cholesky(base.cov).T, base.slopes, 1)]
    for c in p.columns(base).values():
        if c.masks is None and len(c.columns):
            free.append(PRIORS.size * c.columns)
    free += [FLEXIBLE * k.columns for k in p.kernels]
    columns = np.concatenate(free)
    noise = fit_noise(base.errors, columns, p.noise)
    white = noise.whiten(columns)
    y = noise.whiten(base.errors)
    left = Linear.of(y, white).residuals.reshape(3, -1)
    return replace(noise, weight=weights_of(left))
