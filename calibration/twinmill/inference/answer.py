# SPDX-License-Identifier: Apache-2.0
"""From beliefs to an answer: verdict, findings with their certainty, what the rest depends on."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from twinmill.defaults import Certainty, Verdict
from twinmill.inference.discrepancy import NODES
from twinmill.inference.posterior import Belief, beliefs
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import Numbers, Table
from twinmill.model.parameters import catalogue, catalogue_name, instance_of

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
        numbers: parameter -> (value, standard deviation).
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
        numbers: of the likeliest model that has these.
        refit: of the base with nothing that is missing.
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
    numbers: Numbers
    refit: Numbers

    def with_stale(self, chance: float) -> "Answer":
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
            "ranking": self._ranking(findings),
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

    def _ranking(self, findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """All effects that were fitted, likeliest first; a p value is of another statistics."""
        of_finding = {f["effect"]: f for f in findings}
        groups = [f.group for f in self.findings if f.certainty == "group"]
        rows = []
        for name, probability in self.effects.items():
            found = of_finding.get(name)
            rows.append(
                {
                    "effect": name,
                    "probability": probability,
                    "score_heldout": None,
                    "share_explained": found["share"] if found else None,
                    "p_value": None,
                    "parameters": found["parameters"] if found else [],
                    "group": next((k for k, g in enumerate(groups, 1) if name in g), None),
                }
            )
        return rows


def answer(table: Table) -> Answer:
    """The answer with the least to explain away: the likeliest verdict, then the likeliest set."""
    every = beliefs(table)
    nothing = sum(b.probability for b in every if b.nothing)
    outside = sum(b.probability for b in every if b.outside)
    something = nothing <= 1 - PRIORS.sure
    best = _likeliest(every, lambda b: tuple(sorted(b.fitted))) if something else ()
    named = [_named(name, best, every, table) for name in _by_worth(best, table)]
    told = [f for f in named if f.probability >= PRIORS.member]
    findings = sorted(told, key=lambda f: -min(f.probability, PRIORS.sure))
    stale = sum(b.probability for b in every if b.entry.stale)
    if not something:
        refit = sum(b.probability for b in every if b.nothing and b.entry.stale)
        verdict = PASSES[refit > nothing / 2]
        verdict = verdict if nothing >= 0.5 else "cannot_tell"
    elif outside >= 0.5 or not findings:
        verdict = "outside_catalogue"
    else:
        verdict = "ambiguous" if findings[0].certainty == "group" else "effect_missing"
    words, share = _rest(best, every, table) if something else ({}, 0.0)
    added = _likeliest(every, lambda b: tuple(sorted(b.effects)))
    own = max((b for b in every if tuple(sorted(b.effects)) == added), key=lambda b: b.probability)
    return Answer(
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


def _of_each(every: list[Belief]) -> dict[str, float]:
    names = dict.fromkeys(name for b in every for name in b.effects)
    p = {name: sum(b.probability for b in every if name in b.effects) for name in names}
    return dict(sorted(p.items(), key=lambda item: -item[1]))


def _likeliest(every: list[Belief], key: Callable[[Belief], tuple[str, ...]]) -> tuple[str, ...]:
    total: dict[tuple[str, ...], float] = {}
    for b in every:
        total[key(b)] = total.get(key(b), 0.0) + b.probability
    return max(total, key=total.__getitem__)


def _by_worth(best: tuple[str, ...], table: Table) -> list[str]:
    """Effects of a set, the one without which the evidence is least first."""

    def without(name: str) -> float:
        return max(e.log_evidence for e in table.entries if name not in e.effects)

    return sorted(best, key=without)


def _named(name: str, best: tuple[str, ...], every: list[Belief], table: Table) -> Named:
    p = sum(b.probability for b in every if name in b.effects)
    rest = set(best) - {name}
    instead: dict[str, float] = {}
    for b in every:
        if name not in b.effects and rest <= set(b.effects):
            for other in set(b.effects) - rest:
                instead[other] = instead.get(other, 0.0) + b.probability
    likely = sorted(
        (n for n, v in instead.items() if v >= PRIORS.member), key=lambda n: -instead[n]
    )
    group = (name, *likely)[:LARGEST_GROUP]
    total = sum(b.probability for b in every if set(group) & set(b.effects))
    certainty: Certainty = "doubtful"
    if p >= PRIORS.sure:
        certainty, group = "sure", (name,)
    elif total >= PRIORS.sure and len(group) > 1:
        certainty = "group"
    share = _share(name, best, every, table)
    return Named(name, p, group, total, certainty, share, _averaged(name, every, table))


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
    return found


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
