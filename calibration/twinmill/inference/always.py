# SPDX-License-Identifier: Apache-2.0
"""What a model always misses: its discrepancy in the log that it was fitted to.

A fitted base is of another form than the robot. What it leaves in its own log (effects that a fit
of the base's numbers leaves out, a coupling of turns, a slow wander, single moments) is no news in
the next one. It is found by the same evidence that judges later logs: the likeliest set of effects,
then kernel after kernel while the posterior odds rise. It enters
their prior: a function of speed, heading or the past with its weights, one of time or place with
its size alone (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from twinmill.data.measurement import Measurement
from twinmill.inference import moments
from twinmill.inference.discrepancy import CHANCE, SIZES, Kernel
from twinmill.inference.hypothesis import Hypothesis
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Noise
from twinmill.inference.prior import Always, weight_labels
from twinmill.inference.problem import Problem, View, problem_of
from twinmill.inference.search import Search, evidence
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import WORTH, noise_of
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import catalogue, catalogue_name, is_local, with_role

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


def always_of(measurements: Sequence[Measurement], model_file: ModelFile) -> Always:
    """What a model misses in the logs that it was fitted to.

    Args:
        measurements: one robot in those logs.
        model_file: as fitted.
    """
    p = problem_of(measurements, model_file, sheet=True)
    search = Search(p).run()
    h = search.fitted[next(filter(_lasts, search.likely()))].hypothesis
    noise = noise_of(h, p)
    noises = [p.noise, replace(noise, weight=p.noise.weight)]
    best = max((_grown(p, h, p.view(n)) for n in noises), key=lambda g: g.log_evidence)
    return _conditioned(p, h, best)


def _lasts(effects: tuple[str, ...]) -> bool:
    """Whether all of a set are of the robot: none of a place, a while or the clocks."""
    return not any(
        is_local(name) or with_role(name, "moment") or catalogue()[name]["needs"] == "clocks"
        for name in map(catalogue_name, effects)
    )


def _grown(p: Problem, h: Hypothesis, view: View) -> _Grown:
    words = len({k.depends_on for k in p.kernels}) + 1
    linear = bare = h.linear(view.fitter.whiten)
    found: list[tuple[Kernel, float]] = []
    prior = 0.0
    while len(found) < MOST:
        own = evidence(h, view, bare.with_columns(_white(view, found)))
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


def _white(view: View, found: list[tuple[Kernel, float]]) -> np.ndarray:
    """(K, R) white columns of kernels at their sizes."""
    size = {k.name: s for k, s in found}
    own = [size[k.name] * view.white(f) for f, k in enumerate(view.kernels) if k.name in size]
    return np.concatenate([view.stacked[:0], *own])


def _conditioned(p: Problem, h: Hypothesis, grown: _Grown) -> Always:
    """The base's and the effects' numbers and the lasting weights, given the base's own log."""
    size = {k.name: s for k, s in grown.kernels}
    there = [k for k in p.kernels if k.name in size]
    labels = [*h.labels, *(label for k in there for label in weight_labels(k))]
    lasting = {label for k in there if k.lasting for label in weight_labels(k)}
    view = p.view(grown.noise)
    linear = h.linear(view.fitter.whiten).with_columns(_white(view, grown.kernels))
    weights = len(labels) - len(h.labels)
    root = block_diag(np.linalg.cholesky(h.cov), np.eye(weights))
    mean = np.r_[h.mean, np.zeros(weights)] + root @ linear.mean
    mean[: len(h.labels)] = np.clip(mean[: len(h.labels)], h.low, h.high)
    cov = root @ linear.covariance @ root.T
    kept = [k for k, n in enumerate(labels) if k < len(h.labels) or n in lasting]
    noise = grown.noise
    return Always(
        effects=h.effects,
        labels=tuple(labels[k] for k in kept),
        mean=mean[kept],
        cov=cov[np.ix_(kept, kept)],
        kernels=tuple(size.items()),
        rate=grown.rate,
        usual=p.motion.usual,
        top=p.motion.top,
        noise=np.array([noise.sensor, noise.drive, noise.memory_s]),
    )
