# SPDX-License-Identifier: Apache-2.0
"""Lasting errors of a model: its discrepancy in the log that it was fitted to.

A fitted base is of another form than the robot. What it leaves in its own log (effects that a fit
of the base's numbers leaves out, a coupling of turns, a slow wander, single moments) is no news in
the next one. It is found by the same evidence that judges later logs: the likeliest set of effects,
then kernel after kernel while the posterior odds rise. It enters their prior: a function of speed,
heading or the past with its weights, one of time or place with its size alone, and both with the
probability of each size, so that what is too small to be sure of here is half expected there
(Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import expit, logsumexp

from twinmill.data.measurement import Measurement
from twinmill.inference import moments
from twinmill.inference.discrepancy import CHANCE, SIZES, Kernel, dependence_of
from twinmill.inference.hidden import Hidden
from twinmill.inference.hypothesis import Hypothesis
from twinmill.inference.lasting import Lasting
from twinmill.inference.moments import Rate
from twinmill.inference.noise import usual_after
from twinmill.inference.planar import PlanarProblem, problem_of
from twinmill.inference.prior import Always, weight_labels
from twinmill.inference.problem import View
from twinmill.inference.search import Search, evidence, log_prior_of_effects
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import BEYOND, WORTH, noise_of
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import catalogue, catalogue_name, is_local, with_role

MOST = 8  # kernels: more are parts of each other
NEGLIGIBLE = np.exp(-BEYOND)  # probability that decides nothing


@dataclass(frozen=True)
class _Grown:
    """Kernels that the base's own log asks for, under one noise.

    Attributes:
        kernels: each with its size.
        rate: of moments.
        log_evidence: with them.
        view: of that noise.
    """

    kernels: list[tuple[Kernel, float]]
    rate: Rate
    log_evidence: float
    view: View


@dataclass(frozen=True)
class _Lack:
    """A set of effects with the kernels that its own log asks for beside it.

    Attributes:
        h: with the effects.
        each: kernels under each noise.
        grown: those of the likeliest.
        log_posterior: of the set with these, up to a constant.
    """

    h: Hypothesis
    each: list[_Grown]
    grown: _Grown
    log_posterior: float

    @classmethod
    def of(cls, p: PlanarProblem, view: View, h: Hypothesis) -> "_Lack":
        """Three noises: a first one, what the set leaves alone, and with its kernels."""
        each = [_grown(p, h, view), _grown(p, h, p.view(noise_of(h, p)))]
        if beside := each[0].kernels:
            each.append(_grown(p, h, p.view(noise_of(h, p, _columns(beside)))))
        grown = max(each, key=lambda g: g.log_evidence)
        price = log_prior_of_effects(len(h.effects), len(p.names))
        return cls(h, each, grown, grown.log_evidence + price)


def always_of(measurements: Sequence[Measurement], model_file: ModelFile) -> Always:
    """Lasting errors of a model, told by the logs that it was fitted to.

    Args:
        measurements: one robot in those logs.
        model_file: as fitted.
    """
    p = problem_of(measurements, model_file, sheet=True)
    search = Search(p).run()
    h = search.fitted[next(filter(_lasts, search.likely()))].hypothesis
    best = _Lack.of(p, search.view, h)
    while own := best.h.effects:
        fewer = [_Lack.of(p, search.view, search.without(own, name)) for name in own]
        likely = max(fewer, key=lambda lack: lack.log_posterior)
        if likely.log_posterior <= best.log_posterior:
            break
        best = likely
    h, grown = best.h, best.grown
    return _conditioned(p, h, grown, _chances(p, h, best.each, _sizes(p, h, grown)))


def _columns(found: list[tuple[Kernel, float]]) -> np.ndarray | None:
    """(K, W, 3) of kernels at their sizes; None if there is none."""
    return np.concatenate([size * kernel.columns for kernel, size in found]) if found else None


def _lasts(effects: tuple[str, ...]) -> bool:
    """True if all of a set are of the robot: none of a place, a while or the clocks."""
    return not any(
        is_local(name) or with_role(name, "moment") or catalogue()[name]["needs"] == "clocks"
        for name in map(catalogue_name, effects)
    )


def _grown(p: PlanarProblem, h: Hypothesis, view: View) -> _Grown:
    linear = bare = h.linear(view.fitter)
    found: list[tuple[Kernel, float]] = []
    prior, odds = 0.0, np.array([_odds(p, kernel) for kernel in p.kernels])
    while len(found) < MOST:
        own = evidence(h, view, bare.with_columns(_white(view, found)))
        gains = own.gains + np.log(odds)
        f, s = np.unravel_index(gains.argmax(), gains.shape)
        linear = own.linear
        if gains[f, s] <= 0:
            break
        prior += float(np.log(odds[f, s]))
        found.append((p.kernels[f], float(SIZES[s])))
    let_in = moments.find(linear, *view.moments, WORTH)
    there = PRIORS.outside / _count_words(p)
    of_moments = let_in.log_evidence(Rate(there))
    total = linear.log_evidence + prior + of_moments - view.log_size
    return _Grown(found, let_in.after(there), total, view)


def _odds(p: PlanarProblem, kernel: Kernel) -> np.ndarray:
    """(S,) prior odds of a kernel with each size."""
    forms = sum(k.depends_on == kernel.depends_on for k in p.kernels)
    return PRIORS.outside / _count_words(p) / forms * CHANCE


def _count_words(p: PlanarProblem) -> int:
    return len({k.depends_on for k in p.kernels}) + 1  # and moments


def _white(view: View, found: list[tuple[Kernel, float]]) -> np.ndarray:
    """(K, R) white columns of kernels at their sizes."""
    size = {k.name: s for k, s in found}
    own = [size[k.name] * view.white(f) for f, k in enumerate(view.kernels) if k.name in size]
    return np.concatenate([view.stacked.columns[:0], *own])


def _chances(
    p: PlanarProblem, h: Hypothesis, each: Sequence[_Grown], sizes: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """(S,) shares of each kernel and size in the probability of its dependence."""
    found: dict[str, np.ndarray] = {}
    for word in dict.fromkeys(map(dependence_of, sizes)):
        own = {name: chance for name, chance in sizes.items() if dependence_of(name) == word}
        there, whole = _probability(p, h, each, word), sum(c.sum() for c in own.values())
        found |= {name: there * chance / whole for name, chance in own.items()}
    return found


def _sizes(p: PlanarProblem, h: Hypothesis, grown: _Grown) -> dict[str, np.ndarray]:
    """(S,) posterior probabilities of the sizes of each kernel.

    A dependence may have several forms: each is as probable as not before, beside all others found.
    """
    found, view = {k.name for k, _ in grown.kernels}, grown.view

    def gains(without: str) -> np.ndarray:
        rest = [(k, size) for k, size in grown.kernels if k.name != without]
        return evidence(h, view, h.linear(view.fitter).with_columns(_white(view, rest))).gains

    beside, out = gains(""), {}
    for f, kernel in enumerate(p.kernels):
        own = gains(kernel.name)[f] if kernel.name in found else beside[f]
        logs = np.log(CHANCE) + own
        out[kernel.name] = np.exp(logs - logsumexp([0.0, *logs]))
    return out


def _probability(p: PlanarProblem, h: Hypothesis, each: Sequence[_Grown], word: str) -> float:
    """Posterior probability of a dependence, each hypothesis under its best noise."""
    none, some = [], []
    at = [f for f, kernel in enumerate(p.kernels) if kernel.depends_on == word]
    for grown in each:
        view = grown.view
        rest = [(k, size) for k, size in grown.kernels if k.depends_on != word]
        linear = h.linear(view.fitter).with_columns(_white(view, rest))
        own = evidence(h, view, linear)
        prior = sum(float(np.log(_odds(p, k)[size == SIZES][0])) for k, size in rest)
        none.append(own.alone - view.log_size + prior)
        some.append(none[-1] + logsumexp(own.gains[at] + np.log(CHANCE / len(at))))
    there = PRIORS.outside / _count_words(p)
    return float(expit(np.log(there / (1 - there)) + max(some) - max(none)))


def _conditioned(
    p: PlanarProblem, h: Hypothesis, grown: _Grown, chances: dict[str, np.ndarray]
) -> Always:
    """The base's and the effects' numbers and the lasting weights, given the base's own log."""
    size = {k.name: s for k, s in grown.kernels}
    there = [k for k in p.kernels if k.name in size]
    labels = [*h.labels, *(label for k in there for label in weight_labels(k))]
    lasting = {label for k in there if k.lasting for label in weight_labels(k)}
    view = grown.view
    linear = h.linear(view.fitter).with_columns(_white(view, grown.kernels))
    weights = len(labels) - len(h.labels)
    root = block_diag(np.linalg.cholesky(h.cov), np.eye(weights))
    mean = np.r_[h.mean, np.zeros(weights)] + root @ linear.mean
    mean[: len(h.labels)] = np.clip(mean[: len(h.labels)], h.low, h.high)
    cov = root @ linear.covariance @ root.T
    hidden = Hidden.of(p.columns(h), linear, view.fitter.whiten, root)
    kept = [k for k, n in enumerate(labels) if k < len(h.labels) or n in lasting]
    unseen = {
        k.name: Lasting.of(chances[k.name], view.white(f), linear, root)
        for f, k in enumerate(p.kernels)
        if k.lasting and k.name not in size and chances[k.name].max() > NEGLIGIBLE
    }
    return Always(
        effects=h.effects,
        labels=tuple(labels[k] for k in kept),
        mean=mean[kept],
        cov=cov[np.ix_(kept, kept)],
        kernels=tuple((k.name, size[k.name]) for k in there if not k.log_share),
        wander={k.name: chances[k.name] for k in p.kernels if not k.lasting},
        lasting={n: replace(of, shift=of.shift[kept]) for n, of in unseen.items()},
        rate=grown.rate,
        usual=p.motion.usual,
        top=p.motion.top,
        noise=usual_after(*h.about_mean(_columns(grown.kernels)), view.fitter.noise),
        hidden=replace(hidden, shift=hidden.shift[kept]),
    )
