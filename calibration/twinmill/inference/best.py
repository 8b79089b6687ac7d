# SPDX-License-Identifier: Apache-2.0
"""The best model found of one log: effects, the dependences and moments beside them, its noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from twinmill.inference import moments
from twinmill.inference.discrepancy import CHANCE, SIZES
from twinmill.inference.evidence import Linear, log_evidence
from twinmill.inference.hypothesis import Fitter, Hypothesis
from twinmill.inference.moments import BIN_S, Moment, Rate
from twinmill.inference.noise import Noise, fit_noise
from twinmill.inference.planar import PlanarProblem
from twinmill.inference.problem import View
from twinmill.inference.search import Search, evidence
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import StepsOfLog
from twinmill.inference.table import WORTH
from twinmill.model.parameters import catalogue_name, with_role

ROUNDS = 2  # of looking beside the effects, and for the noise of what is then left
FINE_S = np.arange(-BIN_S, BIN_S + 0.01, 0.02)  # the control period of a robot, about
MOST = 4  # dependences beside a set of effects


@dataclass(frozen=True)
class Best:
    """The best model found of a log.

    Attributes:
        h: its effects.
        beside: (K, W, 3) columns of dependences beside them.
        on: moments at which something else happened.
        calm: (W,) steps in which nothing did.
        noise: of these.
        log_prior: of dependences, moments and noise.
    """

    h: Hypothesis
    beside: np.ndarray
    on: Sequence[Moment]
    calm: np.ndarray
    noise: Noise
    log_prior: float

    def hidden_s(self, log: StepsOfLog) -> np.ndarray:
        """(K, 2) begin and end of the moments, on the capture's clock."""
        edges = np.array([(m.begin, m.end) for m in self.on]).reshape(-1, 2)
        return log.t_s[0] + BIN_S * edges

    def log_posterior(self, calm: np.ndarray) -> float:
        """Up to a constant, by (W,) some steps."""
        errors, columns = self.h.about_mean(self.beside)
        noise = _of_some(self.noise, calm)
        white = noise.whiten(np.concatenate([errors[None], columns]) * calm[:, None])
        sizes = noise.log_sizes(np.ones(errors.shape[1]))
        return log_evidence(white[0], white[1:]) - float(sizes.sum()) + self.log_prior


def best_effects(problem: PlanarProblem) -> tuple[Hypothesis, View]:
    """The best set of effects of one log, which has no base of its own, and where it was sought."""
    search = Search(problem).run()
    return _at_its_moments(search.polished(search.likely()[0]), search.view.fitter), search.view


def settled(
    h: Hypothesis, problem: PlanarProblem, first: View, *, sudden: bool
) -> list[tuple[Best, float]]:
    """Dependences and moments beside the best set of effects, and the noise then left.

    Args:
        h: the set.
        problem: the log.
        first: under its first noise.
        sudden: what happens at moments is no noise.

    Returns:
        One, or two with their probabilities: what comes and goes slowly is noise, or depends on
        time or place.
    """
    best = _settled(h, problem, first, MOST, sudden=sudden)
    if not len(best.beside):
        return [(best, 1.0)]
    bare = _settled(h, problem, first, 0, sudden=sudden)
    both = best.calm & bare.calm
    share = float(expit(best.log_posterior(both) - bare.log_posterior(both)))
    return [(best, share), (bare, 1 - share)]


def _at_its_moments(h: Hypothesis, fitter: Fitter) -> Hypothesis:
    """Effects that begin and end where they fit best; a search knows that to a bin."""
    model = h.model.copy()
    for effect in h.effects:
        for key in with_role(catalogue_name(effect), "moment"):
            name = f"{h.instance(effect)}.{key}"
            grid_s = np.maximum(model.get(name) + FINE_S, 0.0)
            white = fitter.whiten(fitter.steps.errors(model, [name], grid_s[:, None]))
            model.set(name, float(grid_s[np.argmin((white**2).sum(axis=1))]))
    return fitter.fit(replace(h, model=model))


def _settled(
    h: Hypothesis, problem: PlanarProblem, first: View, most: int, *, sudden: bool
) -> Best:
    """Moments, dependences beside a set of effects, at most so many, and the noise then left."""
    bins, noise = problem.of_moments(), problem.noise
    beside = nothing = h.errors[None][:0]
    for number in range(ROUNDS):
        view = problem.view(noise) if number else first
        linear = h.linear(view.fitter)
        found = moments.find(linear.with_columns(view.fitter.whiten(beside)), *view.moments, WORTH)
        on = found.on[: found.likeliest(Rate())] if sudden else ()
        there = np.concatenate([nothing, *(bins[m.end] - bins[m.begin] for m in on)])
        within = linear.with_columns(view.fitter.whiten(there))
        beside, log_prior = _dependences(h, view, within, most)
        calm = np.all(there == 0, axis=(0, 2))  # whatever happens at moments is no noise
        errors, free = (array * calm[:, None] for array in h.about_mean(beside))
        noise = noise.at(fit_noise(errors, free, _of_some(noise, calm), problem.usual).logs)
    log_prior += problem.usual.log_density(noise) + float(found.log_chance(Rate())[len(on)])
    return Best(h, beside, on, calm, noise, log_prior)


def _of_some(noise: Noise, steps: np.ndarray) -> Noise:
    """The noise where (W,) some steps alone say something."""
    seen = np.tile(steps, (len(noise.sensor), 1))
    return replace(noise, course=replace(noise.course, seen=seen))


def _dependences(h: Hypothesis, view: View, linear: Linear, most: int) -> tuple[np.ndarray, float]:
    """Columns (K, W, 3) of dependences that are likelier there than not, and their log prior."""
    found, log_prior = [h.errors[None][:0]], 0.0
    price = np.log(PRIORS.outside / (1 - PRIORS.outside)) - np.log(len(view.kernels))
    while len(found) <= most:
        own = evidence(h, view, linear)
        f, s, gain = own.likeliest(range(len(view.kernels)))
        if gain + price <= 0:
            break
        log_prior += float(price + np.log(CHANCE[s]) + view.log_shares[f])
        found.append(SIZES[s] * view.kernels[f].columns)
        linear = linear.with_columns(SIZES[s] * view.white(f))
    return np.concatenate(found), log_prior
