# SPDX-License-Identifier: Apache-2.0
"""From beliefs to an answer: verdict, findings with their certainty, what the rest depends on."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np

from twinmill.defaults import Certainty, Verdict
from twinmill.inference.discrepancy import NODES
from twinmill.inference.posterior import Belief, beliefs
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import Numbers, Table
from twinmill.model.parameters import WHERE_OR_WHEN, catalogue, catalogue_name, instance_of

Set = TypeVar("Set", tuple[str, ...], frozenset[str])  # of effects

LIKELY = 0.5  # probability from which something is said: likelier than not
PASSES: tuple[Verdict, Verdict] = "model_adequate", "refit_enough"
LARGEST_GROUP = 4  # names: more help nobody
OF_SIZE = PRIORS.form / np.sqrt(NODES)  # error of an effect's size where its formula is off


def units_of(effect: str) -> dict[str, str]:
    """Units of an effect's parameters, on TurboPi's wheels; none of what is not the catalogue's."""
    return {p["name"]: p["unit"] for p in catalogue().get(effect, {}).get("parameters", ())}


@dataclass(frozen=True)
class Named:
    """One effect that is missing.

    Attributes:
        effect: its name.
        probability: that it is missing.
        group: names one of which is missing, itself first; empty if it stands alone.
        group_probability: that one of the group is.
        certainty: sure, group or doubtful.
        share: squares of the change that it alone makes to the predicted steps, in the likeliest
            model with the set of effects that is told, over the excess: what the base, refitted
            without a new effect, leaves beyond the noise's own squares. Errors are counted in
            standard deviations of the noise. At most 1.
        numbers: parameter -> (value, standard deviation); NaN where that is not known.
    """

    effect: str
    probability: float
    group: tuple[str, ...]
    group_probability: float
    certainty: Certainty
    share: float
    numbers: dict[str, tuple[float, float]]

    def to_json(self) -> dict[str, Any]:
        """Fields of `findings` of the interface."""
        units = units_of(self.effect)
        return {
            "effect": self.effect,
            "probability": self.probability,
            "group": list(self.group) if self.certainty == "group" else None,
            "group_probability": self.group_probability,
            "certainty": self.certainty,
            "share": self.share,
            "parameters": [
                {"name": name, "value": value, "std": std, "unit": units.get(name, "")}
                for name, (value, std) in self.numbers.items()
            ],
        }


@dataclass(frozen=True)
class Answer:
    """Verdict of a log on a model.

    Attributes:
        verdict: model_adequate, refit_enough, effect_missing, ambiguous, outside_catalogue or
            cannot_tell.
        findings: effects that are sure, the one worth most first, then the others by probability.
        nothing, outside: probabilities that nothing is missing, and that something nameless is.
        stale: probability that the base is known no better than a data sheet.
        effects: probability of each effect that was fitted, likeliest first.
        depends_on: what is left depends on, likeliest first, each with its probability.
        share: squares by which the likeliest dependence lowers what these effects leave, over the
            same excess as the share of an effect. Effects and dependences that change the same
            motion overlap, so that these shares do not add up to 1.
        added: the likeliest set of effects of the catalogue that are missing, each kind once.
    """

    verdict: Verdict
    findings: list[Named]
    nothing: float
    outside: float
    stale: float
    effects: dict[str, float]
    depends_on: dict[str, float]
    share: float
    added: tuple[str, ...]

    def with_stale(self, chance: float) -> Self:
        """With another probability that the base's numbers are stale, and the verdict by it."""
        verdict = self.verdict
        if verdict in PASSES:
            verdict = PASSES[chance > 0.5]
        return replace(self, stale=chance, verdict=verdict)

    @property
    def sure_words(self) -> list[str]:
        """Dependences of the rest that are sure, else the likeliest; none if there is none."""
        sure = [word for word, p in self.depends_on.items() if p >= PRIORS.sure]
        return sure or [*self.depends_on][:1]

    @property
    def open(self) -> list[str]:
        """Effects that are neither sure nor ruled out, likeliest first."""
        return [name for name, p in self.effects.items() if PRIORS.member <= p < PRIORS.sure]

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        findings = [f.to_json() for f in self.findings]
        group = next((f.group for f in self.findings if f.certainty == "group"), ())
        return {
            "verdict": self.verdict,
            "findings": findings,
            "found": [f.effect for f in self.findings],
            "ranking": ranking(self.effects, self.findings),
            "confusable_with": [*group[1:]],
            "probability": {
                "nothing": self.nothing,
                "outside": self.outside,
                "stale": self.stale,
                "effects": self.effects,
            },
            "rest": {
                "share": self.share,
                "depends_on": list(self.depends_on),
                "probability": self.depends_on,
                "formula": None,
            },
            "unexplained": {"depends_on": list(self.depends_on), "share": self.share},
        }


def ranking(
    effects: dict[str, float], findings: list[Named], first: int = 1
) -> list[dict[str, Any]]:
    """All effects that were fitted, likeliest first; a p value is of another statistics.

    Args:
        effects: probability of each.
        findings: those that are told.
        first: number of the first group.
    """
    of_finding = {f.effect: f.to_json() for f in findings}
    groups = [f.group for f in findings if f.certainty == "group"]
    rows = []
    for name, probability in effects.items():
        found = of_finding.get(name)
        rows.append(
            {
                "effect": name,
                "probability": probability,
                "score_heldout": None,
                "share_explained": found["share"] if found else None,
                "p_value": None,
                "parameters": found["parameters"] if found else [],
                "group": next((k for k, g in enumerate(groups, first) if name in g), None),
            }
        )
    return rows


@dataclass(frozen=True)
class RobotAnswer(Answer):
    """Verdict of one robot's log on a model, with the numbers of two of its models.

    Attributes:
        numbers: of the likeliest model that has what is added.
        refit: of the base with nothing that is missing.
    """

    numbers: Numbers
    refit: Numbers


def answer(table: Table, every: list[Belief] | None = None) -> RobotAnswer:
    """The answer with the least to explain away: the likeliest verdict, then the likeliest set.

    Args:
        table: evidence of all hypotheses.
        every: their probabilities; None: by this table alone.
    """
    every = beliefs(table) if every is None else every
    nothing = sum(b.probability for b in every if b.nothing)
    outside = sum(b.probability for b in every if b.outside)
    something = nothing <= 1 - PRIORS.sure
    best = _likeliest(every, lambda b: tuple(sorted(b.fitted))) if something else ()
    findings = told([_named(name, best, every, table) for name in _by_worth(best, table)])
    stale = sum(b.probability for b in every if b.entry.stale)
    refit = sum(b.probability for b in every if b.nothing and b.entry.stale) > nothing / 2
    words, share = _rest(best, every, table) if something else ({}, 0.0)
    verdict = verdict_of(nothing, _worth_unnamed(findings, share, every), findings, refit=refit)
    added = _likeliest(every, lambda b: tuple(sorted(b.effects)))
    own = max((b for b in every if tuple(sorted(b.effects)) == added), key=lambda b: b.probability)
    return RobotAnswer(
        verdict,
        findings,
        nothing,
        outside,
        stale,
        _of_each(every),
        words,
        share,
        added,
        table.numbers[own.entry.effects],
        table.numbers[()],
    )


def told(named: list[Named]) -> list[Named]:
    """Effects that are worth a word: those that are sure in the order given, then the likeliest."""
    likely = [f for f in named if f.probability >= PRIORS.member]
    return sorted(likely, key=lambda f: -min(f.probability, PRIORS.sure))


def verdict_of(nothing: float, unnamed: float, findings: list[Named], *, refit: bool) -> Verdict:
    """Nothing, a name that is sure, or the expectation of which is worth most: a name or none.

    Args:
        nothing: probability that nothing is missing.
        unnamed: expected share of what has no name.
        findings: effects that are told.
        refit: the base's numbers are stale if nothing is missing.
    """
    if nothing > 1 - PRIORS.sure:
        return PASSES[refit] if nothing >= 0.5 else "cannot_tell"
    doubtful = all(f.certainty == "doubtful" for f in findings)
    if doubtful and unnamed >= max((f.group_probability * f.share for f in findings), default=0.0):
        return "outside_catalogue"
    return "ambiguous" if findings[0].certainty == "group" else "effect_missing"


def _worth_unnamed(findings: list[Named], share: float, every: list[Belief]) -> float:
    """Expected share of the excess that causes without a name take.

    They are behind what is left, and in the place of effects that look like them.
    """
    own = {f.effect: f.share for f in findings}
    each = (
        b.probability * min(1.0, bool(b.words) * share + sum(own.get(n, 0.0) for n in b.mimicked))
        for b in every
    )
    return float(sum(each))


def _of_each(every: list[Belief]) -> dict[str, float]:
    names = dict.fromkeys(name for b in every for name in b.effects)
    p = {name: sum(b.probability for b in every if name in b.effects) for name in names}
    return dict(sorted(p.items(), key=lambda item: -item[1]))


def _likeliest(every: list[Belief], key: Callable[[Belief], tuple[str, ...]]) -> tuple[str, ...]:
    total = summed((key(b), b.probability) for b in every)
    return max(total, key=total.__getitem__)


def summed(rows: Iterable[tuple[Set, float]]) -> dict[Set, float]:
    """Probability of each of the sets that rows are of, in their order."""
    total: dict[Set, float] = {}
    for key, p in rows:
        total[key] = total.get(key, 0.0) + p
    return total


def _by_worth(best: tuple[str, ...], table: Table) -> list[str]:
    """Effects of a set, the one without which the evidence is least first."""

    def without(name: str) -> float:
        return max(e.log_evidence for e in table.entries if name not in e.effects)

    return sorted(best, key=without)


def _named(name: str, best: tuple[str, ...], every: list[Belief], table: Table) -> Named:
    sets = [(frozenset(b.effects), b.probability) for b in every]
    return Named(
        name,
        *certain_of(name, best, sets),
        _share(name, best, every, table),
        _averaged(name, every, table),
    )


def certain_of(
    name: str, best: Collection[str], sets: Iterable[tuple[frozenset[str], float]]
) -> tuple[float, tuple[str, ...], float, Certainty]:
    """Probability of an effect, its group with that of one of the group, and its certainty.

    Args:
        name: of the effect.
        best: set that is told, which has it.
        sets: of missing effects, with their probabilities.
    """
    sets = list(sets)
    p = sum(chance for effects, chance in sets if name in effects)
    rest = frozenset(best) - {name}
    instead: dict[str, float] = {}
    for effects, chance in sets:
        if name not in effects and rest <= effects:
            for other in effects - rest:
                instead[other] = instead.get(other, 0.0) + chance
    likely = sorted(
        (n for n, v in instead.items() if v >= PRIORS.member), key=lambda n: -instead[n]
    )
    group = (name, *likely)[:LARGEST_GROUP]
    total = sum(chance for effects, chance in sets if effects & set(group))
    if p >= PRIORS.sure:
        return p, (name,), total, "sure"
    return p, group, total, "group" if total >= PRIORS.sure and len(group) > 1 else "doubtful"


def _share(name: str, best: tuple[str, ...], every: list[Belief], table: Table) -> float:
    """Part of the excess squares that an effect takes in the likeliest model with that set."""
    likely = max((b for b in every if tuple(sorted(b.fitted)) == best), key=lambda b: b.probability)
    effects = likely.entry.effects
    takes = zip(effects, table.takes[effects].tolist(), strict=True)
    own = sum(squares for n, squares in takes if catalogue_name(n) == name)
    return float(np.clip(own / table.excess, 0, 1))


def _averaged(name: str, every: list[Belief], table: Table) -> dict[str, tuple[float, float]]:
    """Numbers of an effect and their standard deviations, over all sets of effects that hold it.

    The spread between sets counts, too: which others are missing is not known for certain. So does
    what a real robot's physics differ from the formula: over a log the size of an effect is the
    mean of errors that are independent at NODES speeds.
    """
    weight: dict[tuple[str, ...], float] = {}
    for b in every:
        if name in b.fitted:
            weight[b.entry.effects] = weight.get(b.entry.effects, 0.0) + b.probability
    sets = list(weight)
    shares = np.array(list(weight.values())) / sum(weight.values())
    each = [table.numbers[e].of_effects() for e in sets]
    own = [k for k in each[0] if catalogue_name(k) == name]
    own = [k for k in own if instance_of(k) == instance_of(own[0])]
    found = {}
    for label in own:
        values, stds = np.array([numbers[label] for numbers in each]).T
        mean = float(shares @ values)
        spread = float(np.hypot(np.sqrt(shares @ (stds**2 + (values - mean) ** 2)), OF_SIZE * mean))
        found[label.split(".", 1)[1]] = mean, spread
    likely = table.numbers[sets[int(np.argmax(shares))]].model
    return _where(name, instance_of(own[0]), likely) | found


def _where(name: str, instance: str, model: Any) -> dict[str, tuple[float, float]]:
    """Numbers that say where or when an effect acts, as fitted; their errors are not known."""
    cards = catalogue().get(name, {}).get("parameters", ())
    keys = [p["name"] for p in cards if p["role"] in (*WHERE_OR_WHEN, "limit")]
    return {key: (float(model.get(f"{instance}.{key}")), float("nan")) for key in keys}


def _rest(
    best: tuple[str, ...], every: list[Belief], table: Table
) -> tuple[dict[str, float], float]:
    """Words with their probabilities given the set, likeliest first, and the share of the first."""
    own = [b for b in every if tuple(sorted(b.fitted)) == best]
    whole = sum(b.probability for b in own)
    if sum(b.probability for b in own if b.words) <= 0.5 * whole:
        return {}, 0.0
    words: dict[str, float] = {}
    for b in own:
        for word in b.words:
            words[word] = words.get(word, 0.0) + b.probability / whole
    order = sorted((w for w in words if words[w] > PRIORS.member), key=lambda w: -words[w])
    falls = [b.entry.fall for b in own if b.words[:1] == (order[0],)]
    return {w: words[w] for w in order}, float(np.clip(max(falls) / table.excess, 0, 1))
