# SPDX-License-Identifier: Apache-2.0
"""SINDy on what the base model misses: sparse regression on a library of terms (pysindy)."""

import warnings

import numpy as np
import pysindy as ps

from rivals.protocol import DOCUMENTED, TUNED, Answer, Problem, Rival, predicted_by
from rivals.residual import CHANGE, HEADING, PLACE, SPEED, TIME, Steps, corrected, scale

# Its own arrays of inputs, at each prediction.
warnings.filterwarnings("ignore", message=".* axes labeled for array", module="pysindy")

STEP_S = 0.1
FOLDS = 5
LIMITS = (0.02, 0.05, 0.1, 0.2, 0.3)  # of STLSQ, tried in turn
FIRST = (SPEED, CHANGE, HEADING, PLACE, TIME)  # what one would think of: 91 terms of degree 2
LEAST_GAIN = 0.02  # share of the squared residual that left-out blocks must lose; see README


def answers(problem: Problem) -> dict[str, Answer]:
    """By its defaults, and tuned."""
    steps = Steps.of(problem.measurement, problem.model, STEP_S)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of thresholds that leave nothing
        return {
            DOCUMENTED: _answer(problem, steps, Sparse(steps, _plain, ps.STLSQ()), None),
            TUNED: _tuned(problem, steps),
        }


class Sparse:
    """A fitted SINDy model of scaled residuals."""

    def __init__(self, steps: Steps, library, optimizer, rows=slice(None)):
        x = steps.features[rows]
        self._mean, self._std = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
        self._low, self._high = x.min(axis=0), x.max(axis=0)
        self._scale = scale(steps.missed)
        self.used = np.flatnonzero([g in FIRST or library is not _plain for g in steps.groups])
        self.model = ps.SINDy(optimizer=optimizer, feature_library=library(len(self.used)))
        scaled = self._scaled(x)
        self.model.fit(
            scaled[:, :3],
            t=steps.step_s,
            x_dot=steps.missed[rows] / self._scale,
            u=scaled[:, 3:],
            feature_names=[f"f{i}" for i in self.used],
        )

    @property
    def weight(self) -> np.ndarray:
        """(F,) what the terms that contain a feature add up to, squared."""
        size = (self.model.coefficients() ** 2).sum(axis=0)
        terms = [set(t.replace("^2", "").replace("|", " ").split()) for t in self.names]
        return np.array(
            [
                sum(s for s, t in zip(size, terms, strict=True) if f"f{i}" in t)
                for i in range(len(self._mean))
            ]
        )

    @property
    def names(self) -> list[str]:
        """Names of the library's terms, in the order of its columns."""
        return self.model.get_feature_names()

    def __call__(self, features: np.ndarray) -> np.ndarray:
        """(M, F) features to (M, 3) velocities missed."""
        scaled = self._scaled(features)
        return self.model.predict(scaled[:, :3], u=scaled[:, 3:]) * self._scale

    def _scaled(self, features: np.ndarray) -> np.ndarray:
        # Within what was seen: no formula is asked where it was never fitted.
        seen = np.clip(features, self._low, self._high)
        return ((seen - self._mean) / self._std)[:, self.used]


def _plain(count: int):
    return ps.PolynomialLibrary()


def _tuned_library(count: int):
    """Degree 1 of all; of the velocities also squares, products and sizes."""
    sizes = ps.CustomLibrary(
        [lambda a: np.abs(a), lambda a: a * np.abs(a)], [lambda a: f"|{a}|", lambda a: f"{a} |{a}|"]
    )
    velocities, others = [0, 1, 2], list(range(3, count))
    return ps.GeneralizedLibrary(
        [ps.PolynomialLibrary(degree=1), ps.PolynomialLibrary(include_bias=False), sizes],
        inputs_per_library=[others, velocities, velocities],
    )


def _firm(limit: float) -> ps.STLSQ:
    """Ridge that is kept at the end: drives that excite one axis at a time leave much open."""
    return ps.STLSQ(limit, alpha=1.0, unbias=False)


def _tuned(problem: Problem, steps: Steps) -> Answer:
    gains = {limit: _held_out(steps, limit) for limit in LIMITS}
    best = max(gains, key=gains.__getitem__)
    return _answer(problem, steps, Sparse(steps, _tuned_library, _firm(best)), gains[best])


def _held_out(steps: Steps, limit: float) -> float:
    """Share of the squared residual of left-out blocks that a threshold's model takes."""
    fold, y = steps.block % FOLDS, steps.missed / scale(steps.missed)
    left = 0.0
    for k in range(FOLDS):
        model = Sparse(steps, _tuned_library, _firm(limit), fold != k)
        predicted = model(steps.features[fold == k]) / scale(steps.missed)
        left += np.square(y[fold == k] - predicted).sum()
    return float(1 - left / np.square(y).sum())


def _answer(problem: Problem, steps: Steps, model: Sparse, gain: float | None) -> Answer:
    evidence = float(np.count_nonzero(model.model.coefficients())) if gain is None else gain
    told = evidence > (0 if gain is None else LEAST_GAIN)
    weight = {g: model.weight[steps.of_group(g)].sum() for g in dict.fromkeys(steps.groups)}
    on = tuple(sorted((g for g in weight if weight[g] > 0), key=lambda g: -weight[g]))
    predict = corrected(problem.model, STEP_S, model) if told else predicted_by(problem.model)
    return Answer(told, evidence, predict, depends_on=on if told else ())


RIVAL = Rival(
    name="SINDy",
    source=f"pysindy {ps.__version__}",
    settings={
        DOCUMENTED: "SINDy(): polynomials of degree 2 in velocity, its change, heading, place and "
        "time, STLSQ(threshold=0.1, alpha=0.05); told if a term stays",
        TUNED: "terms of degree 1, and of degree 2 in the velocities and their sizes; "
        "STLSQ(alpha=1, unbias=False), threshold by left-out blocks; "
        f"told if these lose {100 * LEAST_GAIN:g} % of the squared residual",
    },
    lacks=dict.fromkeys(("name", "wrong"), "a formula is no effect of a catalogue"),
    answers=answers,
)
