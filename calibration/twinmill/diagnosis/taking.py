# SPDX-License-Identifier: Apache-2.0
"""Takes a proven formula into the fitted model, if left-out data are then better predicted.

Its constants are fitted with all the rest: numbers fitted beside constants that stand still would
be told too narrowly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.finding import Finding
from twinmill.diagnosis.formula import Formula, Number
from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.score_fit import ScoreFit
from twinmill.formulas.forms import LEAST_DAMPED, MOST_DAMPED, MOST_NUMBERS, Form, tunable
from twinmill.model.covariance import Covariance
from twinmill.model.parameters import (
    NORMAL_95,
    UNKNOWN,
    Parameter,
    ParameterEstimate,
    catalogue,
    effect_names,
    effect_parameters,
    instance_of,
    is_local,
    newest_instance,
    phases,
    with_role,
)
from twinmill.predict.datasets import ErrorDataset, Trajectory, total_score

EFFECT = "equation"
SEVERAL = 2  # runs that tell of a moment that they share
STEP = 0.05  # of finite differences, times the number at which a shape adds what is typical
FINER = 4.0  # times which errors of what swings may be below the floor
CONSTANT_STEP, CONSTANT_STD = 0.01, 0.5  # shares of a constant
STEP_OF_SPREAD = 1 / 16  # of the share of a constant within which a better one may lie
FAR_OFF = 3.0  # times which a constant may differ from the one that was proven
DIGITS = {"constant": ".4g", "damping": ".3g"}


@dataclass(frozen=True)
class Taken:
    """A formula in the model, all of it refitted together.

    Attributes:
        formula: as it was proven.
        fit: with it, and without the findings that it stands for.
        numbers: as they are in this fit.
        estimates: of what all data sets share, but for the formula's constants.
        covariance: of these, whatever the constants are.
        before: held-out score without it.
        after: with it.
        share: of the squared held-out error above the floor that it takes away.
        evidence: fall of the held-out cost, and the same without the block with the most.
        runs: logs that bear it out.
        replaced: effects in its place that the fit had against which it was judged.
        outdone: the model as given predicts left-out data as well.
    """

    formula: Formula
    fit: ScoreFit
    numbers: tuple[Number, ...]
    estimates: tuple[ParameterEstimate, ...]
    covariance: Covariance
    before: float
    after: float
    share: float
    evidence: tuple[float, float]
    runs: int
    replaced: int
    outdone: bool = False

    @property
    def kept(self) -> bool:
        """True if the model has it."""
        return not self.why_not

    @property
    def why_not(self) -> str:
        """Reason that keeps it out of the model; empty if none does."""
        if self.formula.passing and self.runs < SEVERAL:
            return "it names the time of one run, and nothing shows that another run shares it"
        return self.gains_nothing

    @property
    def gains_nothing(self) -> str:
        """Why left-out data do not bear it out once all is refitted; empty if they do."""
        if self.outdone or self.after >= self.before:
            return "refitted with the rest, it predicts left-out data no better"
        # The best of so many forms falls by 2 ln of their number more than one of them would; so
        # does each effect that it replaced, of all effects.
        effects = self.replaced * log(len(catalogue()))
        chosen = 2 * max(log(self.formula.tried) - effects, 0.0)
        least = SETTINGS.evidence + chosen, SETTINGS.without_best
        if any(own < enough for own, enough in zip(self.evidence, least, strict=True)):
            return "refitted with the rest, it has less evidence than an effect needs"
        return ""

    @property
    def note(self) -> str:
        """Remark on a formula's part in the model that no other log shares, or empty."""
        if not (self.kept and any(form.recurs for form in self.formula.forms)):
            return ""
        return (
            "It comes back by the clock: the model keeps its period, and at which moment of it a "
            "log begins is found anew in each log."
        )

    @property
    def added(self) -> Formula:
        """As the model has it."""
        return replace(self.formula, numbers=self.numbers)

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {
            "kept": self.kept,
            "why_not": self.why_not,
            "note": self.note,
            "effect": EFFECT,
            "equation": self.formula.equation,
            "text": self.added.equals,
            "numbers": [n.to_json() for n in self.numbers],
            "share": self.share if self.kept else None,
            "score_heldout_without": self.before,
            "score_heldout": self.after,
            "instead_of": list(self.formula.instead_of),
            "holds": {name: list(span) for name, span in self.formula.holds.items()},
        }


def taken(
    fit: ScoreFit,
    formula: Formula,
    *,
    beside: Sequence[str],
    runs: int,
    passing: Sequence[str] = (),
    given: float = 1.0,
) -> Taken:
    """The fit with a formula added, and without the findings that it stands for.

    Of terms with moments of one run alone the model of other runs has none, where others are left.

    Args:
        fit: of all that was found; stays as it is.
        formula: proven on these data.
        beside: findings beside it; those that bring nothing any more go. What is at a place or for
            a while was fitted to all of it, and has to bring more.
        runs: logs that these are.
        passing: of these the doubtful ones of a moment of one run, which no other shares; they go
            where the formula takes nearly as much without them.
        given: squared error over the floor of the model as given.
    """
    formula = formula.lasting if runs < SEVERAL else formula
    found = _added(fit, formula, runs)
    lost = SETTINGS.formula_alike * (given - 1)

    def without_passing(names: Sequence[str]) -> Taken:
        gone = (*found.formula.instead_of, *names)
        less = _added_to_less(fit, replace(formula, instead_of=gone), runs)
        least = min(found.fit.held_square, fit.held_square)
        return less if less.kept and less.fit.held_square <= least + lost else found

    if passing and not found.kept:
        found = without_passing(passing)
    for name in beside if found.kept else ():
        if name in found.formula.instead_of:
            continue
        if name in passing:
            found = without_passing([name])
            continue
        gone = (*found.formula.instead_of, name)
        less = _added(fit, replace(formula, instead_of=gone), runs)
        enough = SETTINGS.passing if is_local(name) else SETTINGS.tie
        if less.kept and found.fit.against(less.fit)[0] <= enough:
            found = less
    return _without_nothing(fit, found, runs)


def _without_nothing(fit: ScoreFit, found: Taken, runs: int) -> Taken:
    """Without numbers that may be zero, and are worth less on left-out data than a number costs."""
    for k in reversed(range(len(found.numbers))):
        number = found.numbers[k]
        may_be_zero = number.name and number.low <= 0 <= number.high
        formula = found.formula.without(k) if may_be_zero else None
        less = _added(fit, formula, runs) if formula else None
        if less and found.fit.against(less.fit)[0] <= SETTINGS.each:
            found = less
    return found


def doubtful_moments(findings: Sequence[Finding], formula: Formula) -> list[str]:
    """Doubtful findings of a moment of one run, but for those that a formula stands for."""
    own = [f.effect for f in findings if f.certainty == "doubtful"]
    return [n for n in own if with_role(n, "moment") and n not in formula.instead_of]


def needless(fit: ScoreFit, formula: Formula, local: Sequence[str], runs: int) -> list[str]:
    """Sure findings at a place or for a while that bring nothing beside a formula."""
    if not local:
        return []
    found = taken(fit, formula, beside=local, runs=runs)
    return [name for name in local if found.kept and name in found.formula.instead_of]


def _added(fit: ScoreFit, formula: Formula, runs: int) -> Taken:
    """The fit with a formula, and without those in the place of which it is."""
    found, told = _refitted(fit, formula, fit.datasets)
    above = max(fit.held_square - 1, fit.held_square - found.held_square, 1e-9)
    share = (fit.held_square - found.held_square) / above
    fall, without_best, _ = found.against(fit)
    estimates, covariance = _told_by(found, told)
    return Taken(
        formula=told,
        fit=found,
        numbers=told.numbers,
        estimates=estimates,
        covariance=covariance,
        before=total_score(fit.held_scores),
        after=total_score(found.held_scores),
        share=share,
        evidence=(fall, without_best),
        runs=runs,
        replaced=len(formula.instead_of),
    )


def _added_to_less(fit: ScoreFit, formula: Formula, runs: int) -> Taken:
    """Formula judged against a fit without both: a dropped finding tells of no other run."""
    models = [_without(m, formula.instead_of) for m in fit.models]
    free = _still_free(fit, models[0])
    bare = ScoreFit(fit.datasets, models, free, fit.by_channel).fit()
    alone = _added(bare, replace(formula, instead_of=()), runs)
    return replace(alone, formula=replace(alone.formula, instead_of=formula.instead_of))


def tuned(fit: ScoreFit, formula: Formula) -> Formula:
    """With all numbers of what swings as the plant fits them, its rate and damping among them.

    The forms that were tried take speeds at a few moments, which is crude for what swings fast. The
    floor may have a sway in it, below which errors would tell nothing: they are told over less.

    Args:
        fit: of all that was found; stays as it is.
        formula: proven on these data.
    """
    if len(formula.forms) > 1 or not formula.forms[0].damping:
        return formula
    datasets = [d.over(d.floor / FINER) if isinstance(d, Trajectory) else d for d in fit.datasets]
    return _refitted(fit, formula, datasets)[1]


def _refitted(
    fit: ScoreFit, formula: Formula, datasets: Sequence[ErrorDataset]
) -> tuple[ScoreFit, Formula]:
    """A fit with a formula in it, and the formula as it came out.

    Its constants stand still where the equation has no numbers left for them, or where these data
    drive them far off.
    """
    if any(f.searched for f in formula.forms) and _count(formula.forms) <= MOST_NUMBERS:
        models, free = _with_equation(fit, formula, tunable(formula.forms))
        datasets = _with_own_start(datasets, models)
        fresh = _begun(models[0], formula)
        constants = _constants(models[0], formula.forms)
        found = ScoreFit(datasets, models, [*free, *fresh, *constants], fit.by_channel).fit()
        estimates = {e.name: e for e in found.shared_estimates()}
        own = [estimates[p.name] for p in constants]
        if all(p.min < e.value < p.max for p, e in zip(constants, own, strict=True)):
            told = _as_fitted(formula, [estimates[p.name] for p in fresh], own)
            return found, _with_phases(told, found.models[0])
    models, free = _with_equation(fit, formula, formula.equation)
    datasets = _with_own_start(datasets, models)
    fresh = _begun(models[0], formula)
    found = ScoreFit(datasets, models, [*free, *fresh], fit.by_channel).fit()
    estimates = {e.name: e for e in found.shared_estimates()}
    told = _as_fitted(formula, [estimates[p.name] for p in fresh], None)
    return found, _with_phases(told, found.models[0])


def _with_phases(formula: Formula, model: native.Model) -> Formula:
    """With the phases of a model that has it, as those of its forms."""
    values = iter([model.get(name) for name in _phases_of(model)])
    forms = [replace(f, phase=next(values)) if f.recurs else f for f in formula.forms]
    return replace(formula, forms=tuple(forms))


def _count(forms: Sequence[Form]) -> int:
    return sum(form.places + len(form.searched) for form in forms)


def _with_own_start(
    datasets: Sequence[ErrorDataset], models: Sequence[native.Model]
) -> list[ErrorDataset]:
    pairs = zip(datasets, models, strict=True)
    return [d.with_own_start(m) if isinstance(d, Trajectory) else d for d, m in pairs]


def _as_fitted(
    formula: Formula,
    shapes: Sequence[ParameterEstimate],
    constants: Sequence[ParameterEstimate] | None,
) -> Formula:
    """With numbers and 95 % intervals of a fit; None: constants stand as they were proven.

    Beside those nothing is narrower than where all was told together.
    """
    own, others = formula.numbers[: len(shapes)], formula.numbers[len(shapes) :]
    stds = [e.std for e in shapes]
    if constants is None and others:
        stds = [max(s, (n.high - n.low) / 2 / NORMAL_95) for s, n in zip(stds, own, strict=True)]
    numbers = [_around(n, e.value, s) for n, e, s in zip(own, shapes, stds, strict=True)]
    if constants is None:
        return replace(formula, numbers=(*numbers, *others))
    values, forms = iter(constants), []
    for form in formula.forms:
        new = {name: float(f"{next(values).value:{DIGITS[name]}}") for name in form.searched}
        forms.append(replace(form, **new))
    exact = [getattr(form, name) for form in forms for name in form.searched]
    for number, value, e in zip(others, exact, constants, strict=True):
        numbers.append(_around(number, value, e.std))
    return replace(formula, forms=tuple(forms), numbers=tuple(numbers))


def _told_by(fit: ScoreFit, formula: Formula) -> tuple[tuple[ParameterEstimate, ...], Covariance]:
    """Estimates of a model with a formula, as wide as the formula's numbers are told."""
    own = newest_instance(fit.models[0], EFFECT)
    stds = {f"{own}.{n.name}": (n.high - n.low) / 2 / NORMAL_95 for n in formula.numbers if n.name}
    estimates = [
        replace(e, std=stds.get(e.name, e.std))
        for e in fit.shared_estimates()
        if e.name in stds or not e.name.startswith(f"{own}.")
    ]
    covariance = fit.shared_covariance().of([e.name for e in estimates])
    before = np.sqrt(np.diag(covariance.values))
    wider = [stds.get(n, s) / s for n, s in zip(covariance.names, before, strict=True)]
    values = covariance.values * np.outer(wider, wider)
    return tuple(estimates), Covariance(covariance.names, values)


def _around(number: Number, value: float, std: float) -> Number:
    """With a 95 % interval."""
    half = NORMAL_95 * std
    return replace(number, value=value, low=value - half, high=value + half)


def _with_equation(
    fit: ScoreFit, formula: Formula, texts: dict[str, str]
) -> tuple[list[native.Model], list[Parameter]]:
    """Models of a fit with a formula, without what it stands for, and what else was free."""
    models = [_without(m, formula.instead_of) for m in fit.models]
    free = _still_free(fit, models[0])
    for model in models:
        model.add_effect(EFFECT, texts)
        for name, value in zip(_phases_of(model), _phases_in(formula), strict=True):
            model.set(name, value)
    return models, free


def _phases_of(model: native.Model) -> list[str]:
    """Names of those of the newest formula."""
    instance = newest_instance(model, EFFECT)
    return [p.name for p in phases(model) if instance_of(p.name) == instance]


def _phases_in(formula: Formula) -> list[float]:
    return [form.phase for form in formula.forms if form.phase is not None]


def _still_free(fit: ScoreFit, less: native.Model) -> list[Parameter]:
    """Parameters free both in a fit and in a model that lacks some of its effects."""
    lost = {*effect_names(fit.models[0])} - {*effect_names(less)}
    return [p for p in fit.shared_values if instance_of(p.name) not in lost]


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
        replace(
            p,
            value=value,
            step=STEP * strength,
            std=max(p.std, UNKNOWN * max(strength, abs(value))),
        )
        for p, value, strength in zip(own[: len(values)], values, strengths, strict=True)
    ]


def _constants(model: native.Model, forms: Sequence[Form]) -> list[Parameter]:
    """The forms' constants as numbers of the equation, begun where they were proven."""
    own = effect_parameters(model, newest_instance(model, EFFECT), fresh=True)
    own = iter(own[sum(len(f.shapes) for f in forms) :])
    return [_constant(next(own), form, name) for form in forms for name in form.searched]


def _constant(p: Parameter, form: Form, name: str) -> Parameter:
    at = getattr(form, name)
    damping = name == "damping"
    step = CONSTANT_STEP if damping else min(CONSTANT_STEP, STEP_OF_SPREAD * form.spread)
    return replace(
        p,
        value=at,
        usual=at,
        std=CONSTANT_STD * at,
        step=step * at,
        central=True,
        min=LEAST_DAMPED if damping else at / FAR_OFF,
        max=MOST_DAMPED if damping else at * FAR_OFF,
    )
