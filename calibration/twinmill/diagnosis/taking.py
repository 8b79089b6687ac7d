# SPDX-License-Identifier: Apache-2.0
"""Takes a proven formula into the fitted model, if left-out data are then better predicted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import twinmill_native as native

from twinmill.diagnosis.forms import LEAST_DAMPED, MOST_DAMPED, tunable
from twinmill.diagnosis.formula import Formula, Number
from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.score_fit import NORMAL_95, ScoreFit
from twinmill.model.parameters import Parameter, effect_names, effect_parameters, newest_instance
from twinmill.predict.datasets import Trajectory, total_score

EFFECT = "equation"
SEVERAL = 2  # runs that tell of a moment that they share
STEP = 0.05  # of finite differences, times the number at which a shape adds what is typical
FINER = 4.0  # times which errors of what swings may be below the floor
SWING_STEP, SWING_STD = 0.01, 0.5  # shares of the rate and the damping of what swings


@dataclass(frozen=True)
class Taken:
    """A formula in the model, all of it refitted together.

    Attributes:
        formula: as it was proven.
        fit: with it, and without the findings that it stands for.
        numbers: as they are in this fit.
        before: held-out score without it.
        after: with it.
        share: of the squared held-out error above the floor that it takes away.
        evidence: fall of the held-out cost, and the same without the block with the most.
        runs: logs that bear it out.
    """

    formula: Formula
    fit: ScoreFit
    numbers: tuple[Number, ...]
    before: float
    after: float
    share: float
    evidence: tuple[float, float]
    runs: int

    @property
    def kept(self) -> bool:
        """Whether the model has it."""
        return not self.why_not

    @property
    def why_not(self) -> str:
        """What keeps it out of the model; empty if nothing does."""
        if self.formula.names_time and self.runs < SEVERAL:
            return "it names the time of one run, and nothing shows that another run shares it"
        if self.after >= self.before:
            return "refitted with the rest, it predicts left-out data no better"
        # The best of so many forms falls by 2 ln of their number more than one of them would.
        chosen = 2 * log(self.formula.tried)
        least = SETTINGS.evidence + chosen, SETTINGS.without_best
        if any(own < enough for own, enough in zip(self.evidence, least, strict=True)):
            return "refitted with the rest, it has less evidence than an effect needs"
        return ""

    @property
    def added(self) -> Formula:
        """As the model has it."""
        return replace(self.formula, numbers=self.numbers)

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {
            "kept": self.kept,
            "why_not": self.why_not,
            "effect": EFFECT,
            "equation": self.formula.equation,
            "text": self.added.equals,
            "numbers": [n.to_json() for n in self.numbers],
            "share": self.share,
            "score_heldout_without": self.before,
            "score_heldout": self.after,
            "instead_of": list(self.formula.instead_of),
            "holds": {name: list(span) for name, span in self.formula.holds.items()},
        }


def taken(
    fit: ScoreFit, formula: Formula, *, before: float, doubtful: Sequence[str], runs: int
) -> Taken:
    """The fit with a formula added, and without the findings that it stands for.

    Args:
        fit: of all that was found; stays as it is.
        formula: proven on these data.
        before: held-out score without it, as it is told.
        doubtful: findings beside it; those that bring nothing any more go.
        runs: logs that these are.
    """
    found = _added(fit, formula, before, runs)
    for name in doubtful if found.kept else ():
        gone = (*found.formula.instead_of, name)
        less = _added(fit, replace(formula, instead_of=gone), before, runs)
        if less.kept and found.fit.against(less.fit)[0] <= SETTINGS.tie:
            found = less
    return found


def _added(fit: ScoreFit, formula: Formula, before: float, runs: int) -> Taken:
    """The fit with a formula, and without those in the place of which it is."""
    models, free = _with_equation(fit, formula.instead_of, formula.equation)
    fresh = _begun(models[0], formula)
    found = ScoreFit(fit.datasets, models, [*free, *fresh], fit.by_channel).fit()
    above = max(fit.held_square - 1, fit.held_square - found.held_square, 1e-9)
    share = (fit.held_square - found.held_square) / above
    fall, without_best, _ = found.against(fit)
    return Taken(
        formula=formula,
        fit=found,
        numbers=_numbers(found, fresh, formula),
        before=before,
        after=total_score(found.held_scores),
        share=share,
        evidence=(fall, without_best),
        runs=runs,
    )


def tuned(fit: ScoreFit, formula: Formula) -> Formula:
    """With all numbers of what swings as the plant fits them, its rate and damping among them.

    The forms that were tried take speeds at a few moments, which is crude for what swings fast. The
    floor may have a sway in it, below which errors would tell nothing: they are told over less.

    Args:
        fit: of all that was found; stays as it is.
        formula: proven on these data.
    """
    form = formula.forms[0]
    if len(formula.forms) > 1 or not form.damping:
        return formula
    models, free = _with_equation(fit, formula.instead_of, tunable(form))
    fresh = _begun(models[0], formula)
    own = effect_parameters(models[0], newest_instance(models[0], EFFECT), fresh=True)
    swing = [
        replace(p, value=at, usual=at, std=SWING_STD * at, step=SWING_STEP * at, central=True)
        for p, at in zip(own[len(fresh) :], (form.constant / 10, form.damping), strict=True)
    ]
    datasets = [d.over(d.floor / FINER) if isinstance(d, Trajectory) else d for d in fit.datasets]
    found = ScoreFit(datasets, models, [*free, *fresh, *swing], fit.by_channel).fit()
    estimates = {e.name: e for e in found.shared_estimates()}
    rate, damping = (estimates[p.name] for p in swing)
    if rate.value <= 0 or not LEAST_DAMPED <= damping.value < MOST_DAMPED:
        return formula
    form = replace(
        form, constant=float(f"{10 * rate.value:.4g}"), damping=float(f"{damping.value:.3g}")
    )
    *shapes, first, second = _numbers(found, fresh, formula)
    constants = (
        _around(first, form.constant, 10 * rate.std),
        _around(second, form.damping, damping.std),
    )
    return replace(formula, forms=(form,), numbers=(*shapes, *constants))


def _around(number: Number, value: float, std: float) -> Number:
    """With a 95 % interval."""
    half = NORMAL_95 * std
    return replace(number, value=value, low=value - half, high=value + half)


def _with_equation(
    fit: ScoreFit, gone: Sequence[str], texts: dict[str, str]
) -> tuple[list[native.Model], list[Parameter]]:
    """Models of a fit without some effects and with an equation, and what else was free."""
    models = [_without(m, gone) for m in fit.models]
    lost = {*effect_names(fit.models[0])} - {*effect_names(models[0])}
    for model in models:
        model.add_effect(EFFECT, texts)
    return models, [p for p in fit.shared_values if p.name.split(".")[0] not in lost]


def _without(model: native.Model, gone: Sequence[str]) -> native.Model:
    """A copy that lacks the last effect of each name."""
    less = model.copy()
    for name in gone:
        less.remove_effect(max(i for i, own in enumerate(less.effects) if own == name))
    return less


def _begun(model: native.Model, formula: Formula) -> list[Parameter]:
    """The numbers of the formula, begun where it was proven."""
    strengths = [abs(float(s)) for form in formula.forms for s in form.strengths]
    values = [n.value for n in formula.numbers if n.name]
    own = effect_parameters(model, newest_instance(model, EFFECT), fresh=True)
    return [
        replace(p, value=value, step=STEP * strength)
        for p, value, strength in zip(own[: len(values)], values, strengths, strict=True)
    ]


def _numbers(fit: ScoreFit, fresh: Sequence[Parameter], formula: Formula) -> tuple[Number, ...]:
    """As they came out, with 95 % intervals; constants stand as they were proven."""
    estimates = {e.name: e for e in fit.shared_estimates()}
    own = iter(estimates[p.name] for p in fresh)
    return tuple(
        _around(n, (e := next(own)).value, e.std) if n.name else n for n in formula.numbers
    )
