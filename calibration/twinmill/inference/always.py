# SPDX-License-Identifier: Apache-2.0
"""What a model always misses: its discrepancy in the log that it was fitted to.

A fitted base is of another form than the robot. What it leaves in its own log (a bend of the speed,
a coupling of turns, a slow wander, single moments) is no news in the next one. It is found by the
same evidence that judges later logs, kernel after kernel while the posterior odds rise, and enters
their prior: a function of speed, heading or the past with its weights, one of time or place with
its size alone (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63).
"""

from dataclasses import dataclass, replace

import numpy as np

from twinmill.data.measurement import Measurement
from twinmill.inference import moments
from twinmill.inference.discrepancy import CHANCE, SIZES, Kernel
from twinmill.inference.hypothesis import Fitter, Hypothesis
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Noise, fit_noise
from twinmill.inference.prior import Always, weight_labels
from twinmill.inference.problem import Problem, View, problem_of
from twinmill.inference.search import evidence
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import WORTH
from twinmill.model.model_file import ModelFile

MOST = 8  # kernels: more are parts of each other


@dataclass(frozen=True)
class _Grown:
    """Kernels that the base's own log asks for, under one noise.

    Attributes:
        kernels: each with its size.
        rate: of moments.
        log_evidence: with them.
        noise: under which.
    """

    kernels: list[tuple[Kernel, float]]
    rate: Rate
    log_evidence: float
    noise: Noise


def always_of(measurement: Measurement, model_file: ModelFile) -> Always:
    """What a model misses in the log that it was fitted to.

    Args:
        measurement: one robot in that log.
        model_file: as fitted.
    """
    p = problem_of(measurement, model_file, sheet=True)
    h = p.base
    columns = np.tensordot(np.linalg.cholesky(h.cov).T, h.slopes, 1)
    at_mean = h.errors + np.tensordot(h.value - h.mean, h.slopes, 1)
    of_base = fit_noise(at_mean, columns, p.steps.stretches, p.noise)
    noises = [p.noise, replace(of_base, weight=p.noise.weight)]
    best = max((_grown(p, p.view(noise)) for noise in noises), key=lambda g: g.log_evidence)
    return _conditioned(p, best)


def _grown(p: Problem, view: View) -> _Grown:
    words = len({k.depends_on for k in p.kernels}) + 1
    linear = p.base.linear(view.fitter.whiten)
    found: list[tuple[Kernel, float]] = []
    prior = 0.0
    while len(found) < MOST:
        own = evidence(p.base, view, None, _white(view, found))
        forms = np.array(
            [sum(k.depends_on == kernel.depends_on for k in p.kernels) for kernel in p.kernels]
        )
        odds = PRIORS.outside / words / forms[:, None] * CHANCE
        gains = own.gains + np.log(odds)
        f, s = np.unravel_index(gains.argmax(), gains.shape)
        linear = own.linear
        if gains[f, s] <= 0:
            break
        prior += float(np.log(odds[f, s]))
        found.append((p.kernels[f], float(SIZES[s])))
    let_in = moments.find(linear, *view.moments, WORTH)
    there = PRIORS.outside / words
    of_moments = let_in.log_evidence(Rate(there))
    total = linear.log_evidence + prior + of_moments - view.log_size
    return _Grown(found, let_in.after(there), total, view.fitter.noise)


def _white(view: View, found: list[tuple[Kernel, float]]) -> np.ndarray | None:
    """(K, R) white columns of kernels at their sizes."""
    size = {k.name: s for k, s in found}
    own = [size[k.name] * view.white(f) for f, k in enumerate(view.kernels) if k.name in size]
    return np.concatenate(own) if own else None


def _conditioned(p: Problem, grown: _Grown) -> Always:
    """The base's numbers and lasting weights, given its own log."""
    size = {k.name: s for k, s in grown.kernels}
    there = [k for k in p.kernels if k.name in size]
    columns = [size[k.name] * k.columns for k in there]
    weights = [label for k in there for label in weight_labels(k)]
    lasting = [label for k in there if k.lasting for label in weight_labels(k)]
    count = len(p.prior.mean)
    cov = np.eye(count + len(weights))
    cov[:count, :count] = p.prior.cov
    prior = replace(
        p.prior,
        mean=np.r_[p.prior.mean, np.zeros(len(weights))],
        cov=cov,
        columns=np.concatenate(columns) if columns else p.prior.columns,
    )
    fitter = Fitter(p.steps, grown.noise, prior.columns)
    h = Hypothesis.of_base(p.base.model, prior)
    h = fitter.fit(replace(h, value=np.r_[p.base.value, np.zeros(len(weights))]))
    _, spread = h.posterior(h.linear(fitter.whiten))
    labels = [*p.prior.names, *weights]
    kept = [k for k, n in enumerate(labels) if n in p.prior.names or n in lasting]
    noise = grown.noise
    return Always(
        labels=tuple(labels[k] for k in kept),
        mean=h.value[kept],
        cov=spread[np.ix_(kept, kept)],
        kernels=tuple(size.items()),
        rate=grown.rate,
        usual=p.motion.usual,
        top=p.motion.top,
        noise=np.array([noise.sensor, noise.drive, noise.memory_s]),
    )
