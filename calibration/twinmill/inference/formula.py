# SPDX-License-Identifier: Apache-2.0
"""A formula for a dependence without a name.

Equations of few numbers compete with all smooth functions of the same quantity, by their evidence
beside the likeliest set of effects. Each is an effect `equation` of the plant, so that what its
terms change in the log follows from a simulation. In advance it is as probable that one of them
holds as that none does (`Priors.alike`), and all are alike. Sizes have the prior that smooth
functions have: shares of the motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import expit, logsumexp

from twinmill.formulas.forms import (
    HEADING,
    MOST_NUMBERS,
    ROOM,
    Form,
    names_of,
    own_forms,
)
from twinmill.formulas.forms import STARTS as REST
from twinmill.formulas.term import CHANGE, COUPLING, PAST, PLACE, TIME, WAY, times
from twinmill.formulas.units import units_of
from twinmill.inference.discrepancy import CHANCE, SIZES
from twinmill.inference.discrepancy import TIME as OF_TIME
from twinmill.inference.evidence import Linear, gains_by_size
from twinmill.inference.search import Evidence, Search, evidence
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion
from twinmill.model.parameters import drives_sideways, newest_instance

TURNS = "turning rate"
GROUPS = {  # of forms, by the word of an answer
    OF_TIME: (TIME, WAY),
    "place": (PLACE,),
    "heading": (HEADING,),
    "speed": ("speed", TURNS),
    "coupling of turns": (COUPLING, TURNS),
    "past": (PAST, CHANGE, REST),
}
PAIRS = tuple((f"cos({times(n, 'theta')})", f"sin({times(n, 'theta')})") for n in (1, 2))
BESIDE = (  # forms beside those that follow from a motion
    Form("motion", ("t",), TIME),
    Form("omega_radps", ("t*omega",), TIME),
    Form("motion", ("x", "y"), PLACE),
    Form("theta_rad", ("x", "y"), PLACE),
    Form("omega_radps", ("x*omega", "y*omega"), PLACE),
    Form(ROOM, ("moves", "moves"), HEADING),
    *(Form("omega_radps", tuple(f"{wave}*moves" for wave in pair), HEADING) for pair in PAIRS),
    *(Form("motion", pair, HEADING) for pair in PAIRS),
    Form("vx_mps", ("vx*abs(vx)",), "speed"),
    Form("vx_mps", ("abs(vx)",), "speed"),
    Form("vy_mps", ("vy*abs(vy)",), "speed"),
    Form("vy_mps", ("abs(vy)",), "speed"),
    Form("omega_radps", ("omega*abs(omega)",), "speed"),
    Form("omega_radps", ("abs(omega)",), "speed"),
    Form("vx_mps", ("omega",), COUPLING),
    Form("vx_mps", ("abs(omega)",), COUPLING),
    Form("vy_mps", ("omega",), COUPLING),
    Form("vy_mps", ("vx*omega",), COUPLING),
    Form("vy_mps", ("vx",), COUPLING),
    Form("omega_radps", ("vx",), COUPLING),
    Form("omega_radps", ("vy",), COUPLING),
    Form("omega_radps", ("abs(vx)",), COUPLING),
    Form("omega_radps", ("omega*sqrt(vx*vx + vy*vy)",), COUPLING),
)
PROBE = 1e-4  # of each number: a formula is linear in them
NEARER = np.array([-1.0, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 1.0])  # of the step to a better one
SIDES = 1.96  # standard deviations: 95 %


@dataclass(frozen=True)
class Formula:
    """The likeliest equation for a dependence.

    Attributes:
        word: what it depends on.
        form: of the equation.
        values, stds: of its numbers p0 and so on, posterior mean and standard deviation.
        probability: that some equation of few numbers describes it as well as any function does.
    """

    word: str
    form: Form
    values: tuple[float, ...]
    stds: tuple[float, ...]
    probability: float

    @property
    def texts(self) -> dict[str, str]:
        """Texts of the effect `equation`."""
        return self.form.equation

    @property
    def units(self) -> list[str]:
        """Units of the numbers."""
        return units_of(self.form)

    @property
    def of_one_run(self) -> bool:
        """It names moments of the log."""
        return self.form.names_time

    @property
    def holds(self) -> bool:
        """True if an equation is likelier than that there is none."""
        return self.probability >= 0.5

    @property
    def text(self) -> str:
        """With its numbers in place of their names."""
        told = self.form.told([f"{value:.3g}" for value in self.values])
        return f"{self.form.adds_to} += {told}"

    @property
    def lasting(self) -> bool:
        """It holds, and in other logs, too."""
        return self.holds and not self.of_one_run

    @property
    def spans(self) -> list[dict[str, Any]]:
        """Name, value and 95 % interval of each number."""
        return [
            {
                "name": f"p{k}",
                "value": v,
                "low": v - SIDES * std,
                "high": v + SIDES * std,
                "unit": u,
            }
            for k, (v, std, u) in enumerate(zip(self.values, self.stds, self.units, strict=True))
        ]

    def to_json(self) -> dict[str, Any]:
        """Fields of `rest.proven`."""
        return {
            "equation": self.texts,
            "text": self.text,
            "depends_on": [self.word],
            "probability": self.probability,
            "numbers": self.spans,
        }


def formula_of(
    search: Search, own: Evidence, motion: Motion, words: Sequence[str]
) -> Formula | None:
    """The likeliest formula for the first of some dependences, beside the others.

    Args:
        search: that was answered.
        own: of the likeliest set of effects.
        motion: of its logs.
        words: dependences that are sure.
    """
    if not words or words[0] not in GROUPS:
        return None
    own = _where_they_hold(search, own, words)
    fitting = _Fitting(search, own, _beside(search, own, words[1:]), motion)
    forms = _forms(words[0], motion, own.hypothesis.model)
    tried = [t for form in forms if (t := fitting.tried(form)) is not None]
    if not tried:
        return None
    best = max(tried, key=lambda t: t.log_evidence)
    for name in best.form.searched:
        near = [t for f in best.form.near(name, NEARER) if (t := fitting.tried(f)) is not None]
        best = max([best, *near], key=lambda t: t.log_evidence)
    others = [t.log_evidence for t in tried if t.form is not best.form]
    listed = logsumexp([best.log_evidence, *others]) - np.log(len(tried))
    odds = np.log(PRIORS.alike / (1 - PRIORS.alike)) + listed - fitting.smooth(words[0])
    values, stds = fitting.numbers(best)
    return Formula(words[0], best.form, values, stds, float(expit(odds)))


def _where_they_hold(search: Search, own: Evidence, words: Sequence[str]) -> Evidence:
    """A set of effects, linear about the numbers that it has beside some dependences.

    Alone it may have numbers that stand in for them, where an equation changes something else.
    """
    h, fitter = own.hypothesis, search.view.fitter
    value, _ = h.posterior(_beside(search, own, words))
    there = fitter.at(replace(h, value=np.clip(value, h.low, h.high)))
    return evidence(there, search.view, there.linear(fitter))


def _beside(search: Search, own: Evidence, words: Sequence[str]) -> Linear:
    """The likeliest set with the likeliest form of each of some dependences."""
    linear = own.linear
    for word in words:
        at = [f for f, k in enumerate(search.problem.kernels) if k.depends_on == word]
        if at:
            f, s, _ = own.likeliest(at)
            linear = linear.with_columns(SIZES[s] * own.white(search.view, f))
    return linear


def _forms(word: str, m: Motion, model: Any) -> list[Form]:
    """Forms that depend on it."""
    names = names_of(m.moved / m.step_s[:, None], m.place, m.heading, m.t_s - m.t_s[0])
    sideways = drives_sideways(model)
    every = [*BESIDE, *own_forms(names, sideways, bool(model.wheels()))]
    return [f for f in every if f.group in GROUPS[word] and (sideways or f.adds_to != "vy_mps")]


@dataclass(frozen=True)
class _Tried:
    """A form, linear in its numbers.

    Attributes:
        form: with its constants.
        white: (k, R) columns of its numbers, each of the size of the motion.
        unit: (k,) of the numbers at that size.
        log_evidence: over the model without it.
        size: likeliest share of the motion.
    """

    form: Form
    white: np.ndarray
    unit: np.ndarray
    log_evidence: float
    size: float


@dataclass(frozen=True)
class _Fitting:
    """Fits forms beside a set of effects."""

    search: Search
    own: Evidence
    linear: Linear
    motion: Motion

    def tried(self, form: Form) -> _Tried | None:
        """A form with its evidence; None of one that changes nothing."""
        change = self._changes(form)
        fitter, span = self.search.view.fitter, self.own.span
        if not np.isfinite(change).all():
            return None
        white = fitter.whiten(change)
        white = white - (white @ span.T) @ span
        norm = np.linalg.norm(white, axis=1)
        if (norm == 0).any():
            return None
        unit = np.linalg.norm(fitter.whiten(self.motion.moved)) / norm / np.sqrt(len(norm))
        white = white * unit[:, None]
        gains, _ = gains_by_size(*self.linear.projected(white, white @ white.T), SIZES)
        logs = gains + np.log(CHANCE)
        return _Tried(form, white, unit, float(logsumexp(logs)), float(SIZES[logs.argmax()]))

    def _changes(self, form: Form) -> np.ndarray:
        """(k, W, 3) change of the prediction with each number of a form."""
        model = self.own.hypothesis.model.copy()
        model.add_effect("equation", form.equation)
        instance, count = newest_instance(model, "equation"), len(form.shapes)
        names = [f"{instance}.p{k}" for k in range(count)]
        points = np.concatenate([np.zeros((1, count)), PROBE * np.eye(count)])
        with np.errstate(all="ignore"):
            errors = self.search.problem.steps.errors(model, names, points)
            return np.array((errors[0] - errors[1:]) / PROBE)

    def smooth(self, word: str) -> float:
        """Log evidence of all functions of more numbers than an equation has, over none."""
        view = self.search.view
        own = [f for f, k in enumerate(view.kernels) if k.depends_on == word]
        at = [f for f in own if len(view.kernels[f].columns) > MOST_NUMBERS] or own
        each = []
        for f in at:
            white = self.own.white(view, f)
            gains, _ = gains_by_size(*self.linear.projected(white, white @ white.T), SIZES)
            each.append(gains + np.log(CHANCE))
        return float(logsumexp(each) - np.log(len(at)))

    def numbers(self, best: _Tried) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Posterior means and standard deviations of a form's numbers."""
        linear, count = self.linear.with_columns(best.size * best.white), len(best.unit)
        scale = best.size * best.unit
        mean = linear.mean[-count:] * scale
        std = np.sqrt(np.diag(linear.covariance)[-count:]) * scale
        return tuple(mean.tolist()), tuple(std.tolist())
