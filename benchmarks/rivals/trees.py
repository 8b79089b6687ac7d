# SPDX-License-Identifier: Apache-2.0
"""Boosted trees on what the base misses, and what they lose without each group of features."""

from collections.abc import Mapping

import numpy as np
import sklearn
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.model_selection import GroupKFold

from rivals.protocol import DOCUMENTED, TUNED, Answer, Problem, Rival, predicted_by
from rivals.residual import Steps, corrected, scale

STEP_S = 0.1
FOLDS = 5
REPEATS = 3
LEAST_GAIN = 0.02  # see README
OPTIONS: Mapping[str, dict] = {
    DOCUMENTED: {},
    TUNED: {"learning_rate": 0.05, "max_iter": 80, "max_leaf_nodes": 8, "min_samples_leaf": 40},
}


def answers(problem: Problem) -> dict[str, Answer]:
    """By the defaults, and tuned."""
    steps = Steps.of(problem.measurement, problem.model, STEP_S)
    limits = {DOCUMENTED: 0.0, TUNED: LEAST_GAIN}
    return {s: _answer(problem, steps, OPTIONS[s], limit) for s, limit in limits.items()}


def _answer(problem: Problem, steps: Steps, options: dict, limit: float) -> Answer:
    by = scale(steps.missed)
    x, y = steps.features, steps.missed / by
    gain, lost = _held_out(steps, x, y, options)
    told = gain > limit
    if not told:
        return Answer(False, gain, predicted_by(problem.model))
    models = [HistGradientBoostingRegressor(random_state=0, **options).fit(x, c) for c in y.T]

    def missed(features: np.ndarray) -> np.ndarray:
        return np.column_stack([m.predict(features) for m in models]) * by

    on = tuple(sorted((g for g in lost if lost[g] > 0), key=lambda g: -lost[g]))
    return Answer(True, gain, corrected(problem.model, STEP_S, missed), depends_on=on)


def _held_out(
    steps: Steps, x: np.ndarray, y: np.ndarray, options: dict
) -> tuple[float, dict[str, float]]:
    """Share of the squared residual of left-out blocks that is taken, and lost by group."""
    random, taken = np.random.default_rng(0), 0.0
    lost = dict.fromkeys(dict.fromkeys(steps.groups), 0.0)
    for fit, held in GroupKFold(FOLDS).split(x, groups=steps.block):
        for channel in y.T:
            model = HistGradientBoostingRegressor(random_state=0, **options)
            model.fit(x[fit], channel[fit])
            left = _square(model, x[held], channel[held])
            taken += np.square(channel[held]).sum() - left
            for group in lost:
                own, mixed = steps.of_group(group), x[held].copy()
                for _ in range(REPEATS):
                    mixed[:, own] = x[held][random.permutation(len(held))][:, own]
                    lost[group] += (_square(model, mixed, channel[held]) - left) / REPEATS
    return float(taken / np.square(y).sum()), lost


def _square(model: HistGradientBoostingRegressor, x: np.ndarray, y: np.ndarray) -> float:
    return float(np.square(y - model.predict(x)).sum())


RIVAL = Rival(
    name="boosted trees",
    source=f"scikit-learn {sklearn.__version__}",
    settings={
        DOCUMENTED: "HistGradientBoostingRegressor(), GroupKFold over blocks of 8 s; told if "
        "left-out blocks lose any of the squared residual; groups of features permuted there",
        TUNED: f"80 trees of 8 leaves with 40 steps each, rate 0.05; told from "
        f"{100 * LEAST_GAIN:g} %",
    },
    lacks=dict.fromkeys(("name", "wrong"), "trees have no names"),
    answers=answers,
)
