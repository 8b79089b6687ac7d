# SPDX-License-Identifier: Apache-2.0
"""Several models by how well they predict what they were not fitted to.

The expected log predictive density (elpd) of each block of the logs, from fits that leave its
part out, is compared block by block (Vehtari, Gelman and Gabry 2017). Weights are those of stacking
(Yao, Vehtari, Simpson and Gelman 2018). The best of many leads by chance, too: a lead is judged by
the largest of as many correlated t as there are other models (Dunnett 1955).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.estimation.score_fit import LEAST_SQUARE, ScoreFit
from twinmill.fitting.fit import base_names, effects_free, fitted
from twinmill.fitting.heldout import HeldOut
from twinmill.fitting.opening import judged, open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import base_parameters
from twinmill.predict.datasets import PARTS

CORRECTION = "Dunnett: the largest of the differences of all other models, jointly t distributed"
SEED = 1  # of the integration of a distribution


@dataclass(frozen=True)
class Predicted:
    """Predictions of one model for left-out parts.

    Attributes:
        score: held-out, of all data sets.
        elpd: (B,) log predictive density of each block.
    """

    score: float
    elpd: np.ndarray


@dataclass(frozen=True)
class Standing:
    """One model among several.

    Attributes:
        score_heldout: root mean square of held-out errors over their floors.
        elpd: sum over blocks; larger is better.
        elpd_diff: of the best model less that of this one.
        dse: standard error of the difference.
        weight: of this model in the mixture that predicts best.
        p_chance: chance of such a lead of the best of all, were none of them better than this one.
    """

    score_heldout: float
    elpd: float
    elpd_diff: float
    dse: float
    weight: float
    p_chance: float


def predicted(
    measurements: Sequence[Measurement | SteadyTable], models: Sequence[ModelFile], refit: bool
) -> list[Predicted]:
    """Each model on the same data, over the same floors.

    Args:
        measurements: of all models.
        models: the first one's clock is where the others' are looked for.
        refit: to the parts that are not left out; False: models predict as they are.

    Raises:
        LogError: no measurement can be judged.
    """
    opened = open_measurements(measurements, models[0])
    found = []
    for file in models:
        own = opened if file is models[0] else [o.aligned(file.model) for o in opened]
        base = base_parameters(file.model, base_names(file.model, judged(own)))
        free = [*base, *effects_free(file.model, judged(own))] if refit else []
        _, fit = fitted(own, free)
        found.append(Predicted(HeldOut.of(fit).score, _elpd(fit)))
    return found


def _elpd(fit: ScoreFit) -> np.ndarray:
    """(B,) of all data sets: Gaussian, its scale from the parts that the block is not in."""
    found = []
    for data, rows in zip(fit.datasets, fit.held_out, strict=True):
        _, first, block = np.unique(data.block, return_index=True, return_inverse=True)
        square, share = np.bincount(block, rows**2), np.bincount(block, data.judged)
        part, number = data.part[first], data.n_eff.sum() * share / max(share.sum(), 1e-12)
        in_part = [np.bincount(part, own, PARTS) for own in (square, share)]
        others, seen = ((own.sum() - own)[part] for own in in_part)
        scale = np.maximum(others / np.maximum(seen, 1e-12), LEAST_SQUARE)
        mean = square / np.maximum(share, 1e-12)
        found.append(-number / 2 * (np.log(2 * np.pi * scale) + mean / scale))
    return np.concatenate(found)


def standings(models: Sequence[Predicted]) -> list[Standing]:
    """How the models stand, in their order."""
    elpd = np.column_stack([m.elpd for m in models])
    count, total = len(elpd), elpd.sum(axis=0)
    best, weight = int(total.argmax()), stacked(elpd)
    found = []
    for k, model in enumerate(models):
        lead = elpd[:, best] - elpd[:, k]
        dse = float(np.sqrt(count * np.var(lead, ddof=1))) if count > 1 else float("nan")
        chance = chance_of_lead(elpd, k)
        found.append(
            Standing(model.score, float(total[k]), float(lead.sum()), dse, float(weight[k]), chance)
        )
    return found


def chance_of_lead(elpd: np.ndarray, k: int) -> float:
    """That the best of the others leads model k so far, were all as good; by (B, K) of all."""
    lead = elpd - elpd[:, [k]]
    spread = lead.std(axis=0, ddof=1) * np.sqrt(len(lead)) if len(lead) > 1 else np.zeros(0)
    differ = np.flatnonzero(spread > 1e-12)
    if not len(differ):
        return 1.0
    t = float((lead.sum(axis=0)[differ] / spread[differ]).max())
    if t <= 0:
        return 1.0
    if len(differ) == 1:
        return float(stats.t.sf(t, len(lead) - 1))
    together = np.corrcoef(lead[:, differ].T)
    joint = stats.multivariate_t(shape=together, df=len(lead) - 1, allow_singular=True, seed=SEED)
    return float(np.clip(1 - joint.cdf(np.full(len(differ), t)), 0.0, 1.0))


def stacked(elpd: np.ndarray) -> np.ndarray:
    """(K,) weights, not negative and of sum 1, of the mixture with the best (B, K) densities."""
    density = np.exp(elpd - elpd.max(axis=1, keepdims=True))
    count = density.shape[1]
    done = optimize.minimize(
        lambda w: -np.sum(np.log(density @ w)),
        np.full(count, 1 / count),
        jac=lambda w: -(density / (density @ w)[:, None]).sum(axis=0),
        bounds=[(0.0, 1.0)] * count,
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1, "jac": np.ones_like},
        method="SLSQP",
        options={"ftol": 1e-10, "maxiter": 500},
    )
    weight = np.clip(done.x, 0.0, None)
    return weight / weight.sum()
