# SPDX-License-Identifier: Apache-2.0
"""Judges an answer to a case as right or wrong, and sums the figures over all cases.

Only what `twinmill diagnose --json` prints is looked at. A group of more than four names is as
wrong as a wrong name, and every name beside the right one that is not there is counted. A doubtful
finding is right if its name is; beyond doubt is a row of its own.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import binomtest

from twinmill.model.parameters import catalogue, key_of
from twinmill_lab.challenge.cases import Case
from twinmill_lab.challenge.physics import Hidden

LARGEST_GROUP = 4
WITHIN = 1.96  # standard errors: 95 %
TOLD_REST = 0.1  # share of the squared error from which a rest counts as told
BINS = (1.0, 1.5, 2.5, 4.0)  # lower ends of sizes, in floors
RELIABILITY = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)  # edges of bins of a name's probability
NAMED = ("effect_missing", "ambiguous")  # verdicts that name something
OF_FORCES = frozenset({"yaw_lag", "lateral_slip"})  # what every robot made of forces has


@dataclass(frozen=True)
class Bar:
    """A row of the exam: its key, what it says, the goal, whether more is better."""

    key: str
    words: str
    goal: float
    more: bool


BARS = (
    Bar("right_first", "one effect hidden: right first, or in its group", 0.95, True),
    Bar("named", "and the verdict right as well", 0.95, True),
    Bar("verdict_right", "and beyond doubt", 0.95, True),
    Bar("clean", "and no other name", 0.95, True),
    Bar("cousins", "its physics in another form: named, or outside by what it does", 0.90, True),
    Bar("rollers_first", "rollers: right first", 0.90, True),
    Bar("false_alarm", "nothing hidden: false alarms", 0.03, False),
    Bar("both_of_two", "both of two", 0.85, True),
    Bar("outside_said", "outside the catalogue: said so", 0.85, True),
    Bar("depends_right", "what it depends on is right", 0.85, True),
    Bar("named_wrongly", "named wrongly and surely, all cases", 0.0, False),
    Bar("within", "estimates within their 95 % intervals", 0.90, True),
)


@dataclass(frozen=True)
class Said:
    """One finding: its name, the names it cannot be parted from, and how certain it is."""

    effect: str
    group: frozenset[str]
    certainty: str
    parameters: tuple[dict, ...]

    @property
    def sure(self) -> bool:
        """True if the answer names this effect and nothing else."""
        return self.certainty == "sure"

    @property
    def names(self) -> frozenset[str]:
        """Effects that count as named: none if the group is too large to help."""
        return frozenset() if len(self.group) > LARGEST_GROUP else self.group | {self.effect}


def said(found: dict) -> list[Said]:
    """The findings of a diagnosis in their order; those of quantities of the base are left out.

    Args:
        found: the object of `twinmill diagnose --json`.
    """
    known = set(catalogue()) - {"equation"}
    if "findings" in found:
        rows = [
            (f["effect"], f.get("group") or (), f["certainty"], f.get("parameters") or ())
            for f in found["findings"]
        ]
    else:
        ranked = {r["effect"]: r for r in found["ranking"]}
        groups = {e: [n for n, r in ranked.items() if r["group"] == ranked[e]["group"]]
                  for e in ranked if ranked[e]["group"] is not None}  # fmt: skip
        rows = [
            (e, groups.get(e, ()), "group" if e in groups else "sure", ranked[e]["parameters"])
            for e in found["found"]
            if e in ranked
        ]
    return [
        Said(effect, frozenset(group), certainty, tuple(parameters))
        for effect, group, certainty, parameters in rows
        if effect in known
    ]


def scored(case: Case, found: dict) -> dict:
    """One case: what was hidden, what was said, whether that was right.

    Args:
        case: with its answer.
        found: the object of `twinmill diagnose --json`.
    """
    every, there = said(found), _there(case)
    findings = [f for f in every if f.effect not in there]
    firm = [f for f in findings if f.certainty != "doubtful"]
    right = [_accepted(h, case) for h in case.hidden if h.kind != "outside"]
    allowed = there.union(*right, *(h.kin for h in case.hidden))
    others = [f.effect for f in firm if not (f.names or {f.effect}) & allowed]
    verdict = found["verdict"]
    told = _rest(found)
    names = frozenset().union(*right)
    beyond_doubt = bool(firm and firm[0].names & names) and verdict in NAMED
    first = bool(findings and findings[0].names & names)
    outcome = {
        "first": first,
        "named": first and verdict in NAMED,
        "verdict_right": beyond_doubt,
        "clean": beyond_doubt and not others,
        "all": bool(right) and all(any(f.names & r for f in findings) for r in right),
        "alarm": any(not f.names & there for f in firm)
        or verdict in ("outside_catalogue", "bad_input")
        or (verdict in NAMED and bool(findings) and all(f.certainty == "doubtful" for f in every)),
        "told": verdict == "outside_catalogue" or told["share"] >= TOLD_REST,
        "depends": _depends(case.hidden, told),
        "others": others,
        "wrong_and_sure": any(f.sure and not (f.names or {f.effect}) & allowed for f in findings),
    }
    return case.to_json() | {
        "verdict": verdict,
        "said": [sorted(f.group | {f.effect}) for f in findings],
        "rest": told,
        "outcome": outcome,
        "estimates": [e for h in case.hidden for e in _estimates(h, firm)],
        "names": [
            {"probability": f["probability"], "right": f["effect"] in allowed}
            for f in found.get("findings", ())
            if "probability" in f and f["effect"] not in there
        ],
    }


def summary(results: list[dict]) -> dict:
    """The rows of the exam with their 95 % intervals, the bias, confusion, and power by size."""

    def of(*kinds: str, plant: str | None = None) -> list[dict]:
        return [r for r in results if r["kind"] in kinds and plant in (None, r["plant"])]

    def share(key: str, rows: list[dict]) -> dict:
        return rate([bool(r["outcome"][key]) for r in rows])

    single, outside = of("one", "cousin"), of("outside")
    estimates = [e for r in results for e in r["estimates"]]
    ratios = [e["value"] / e["truth"] for e in estimates if e["leads"]]
    confusion = Counter((_hidden_words(r), _said_words(r)) for r in results)
    rollers = of("one", "cousin", plant="rollers")
    return {
        "right_first": share("first", single),
        "named": share("named", single),
        "verdict_right": share("verdict_right", single),
        "clean": share("clean", single),
        "cousins": rate([_is_known(r) for r in of("cousin")]),
        "rollers_first": share("first", rollers),
        "false_alarm": share("alarm", of("none")),
        "both_of_two": share("all", of("two")),
        "outside_said": share("told", outside),
        "depends_right": rate([r["outcome"]["told"] and r["outcome"]["depends"] for r in outside]),
        "named_wrongly": share("wrong_and_sure", results),
        "within": rate([e["within"] for e in estimates]),
        "reliability": _reliability([n for r in results for n in r["names"]]),
        "bias": [float(q) for q in np.percentile(ratios, [25, 50, 75])] if ratios else None,
        "power": [{"from_floors": low, **_in_bin(single, low)} for low in BINS],
        "confusion": [
            {"hidden": h, "said": s, "cases": n} for (h, s), n in sorted(confusion.items())
        ],
        "lost": [r for r in results if lost(r)],
    }


def _reliability(names: list[dict]) -> list[dict]:
    """How often names are right, by bins of the probability that they were given."""
    found = []
    for low, high in pairwise(RELIABILITY):
        own = [n for n in names if low <= n["probability"] < high or n["probability"] == high == 1]
        if own:
            mean = float(np.mean([n["probability"] for n in own]))
            right = rate([n["right"] for n in own])
            found.append({"from": low, "to": high, "mean": mean, "right": right})
    return found


def _is_known(result: dict) -> bool:
    """True if another form was named, or it was called outside with its dependence right."""
    outcome = result["outcome"]
    outside = result["verdict"] == "outside_catalogue" and outcome["depends"]
    return outcome["named"] or (outside and not outcome["wrong_and_sure"])


def lost(result: dict) -> bool:
    """True if a case was not answered as it should be."""
    o = result["outcome"]
    return not {
        "none": not o["alarm"],
        "one": o["clean"],
        "cousin": o["clean"],
        "two": o["all"] and not o["others"],
        "outside": o["told"] and o["depends"] and not o["wrong_and_sure"],
    }[result["kind"]]


def rate(outcomes: list[bool]) -> dict:
    """Successes, trials, and the interval of the probability (Clopper and Pearson 1934)."""
    hits, trials = sum(outcomes), len(outcomes)
    if not trials:
        return {"hits": 0, "of": 0, "low": 0.0, "high": 1.0}
    interval = binomtest(hits, trials).proportion_ci()
    return {"hits": hits, "of": trials, "low": float(interval.low), "high": float(interval.high)}


def _accepted(hidden: Hidden, case: Case) -> frozenset[str]:
    """Names that are right: clocks that are not declared one leave delay and offset open."""
    if hidden.name == "input_delay" and not case.plan.robot.same_clock:
        return frozenset({"input_delay", "clock_offset"})
    if (hidden.name, hidden.kind) == ("motor_lag", "cousin"):
        return frozenset({"motor_lag", "second_order_lag"})
    if (hidden.name, hidden.kind) == ("dead_zone", "cousin"):  # it sticks
        return frozenset({"dead_zone", "stiction"})
    return frozenset({hidden.name})


def _there(case: Case) -> frozenset[str]:
    """Further effects that are present in a robot made of forces, in the base or not.

    It turns with another lag than it drives, and its mass drifts outward in arcs.
    """
    by_forces = case.plan.robot.plant != "planar"
    hidden = {h.name for h in case.hidden}
    return frozenset(OF_FORCES - hidden) if by_forces else frozenset()


def _rest(found: dict) -> dict:
    rest = found.get("rest") or found.get("unexplained") or {}
    depends_on = [str(d) for d in rest.get("depends_on") or []]
    share = float(rest.get("share") or 0) if depends_on or rest.get("formula") else 0.0
    return {"share": share, "depends_on": depends_on, "formula": rest.get("formula")}


def _depends(hidden: tuple[Hidden, ...], told: dict) -> bool:
    """True if the strongest dependence, or the formula, speaks of the right thing."""
    text = " ".join([*told["depends_on"][:2], str(told["formula"] or "")]).lower()
    words = "".join(c if c.isalpha() else " " for c in text).split()
    wanted = [w for h in hidden for w in h.depends_on]
    return any(word == w or (len(w) > 2 and word.startswith(w)) for w in wanted for word in words)


def _estimates(hidden: Hidden, findings: list[Said]) -> list[dict]:
    """Each number of a plain effect that was named first in its group, beside its truth."""
    mine = next((f for f in findings if f.effect == hidden.name), None)
    if mine is None or hidden.kind != "plain":
        return []
    values = {key_of(p["name"]): p for p in mine.parameters}
    truth = {name: v for name, v in hidden.values.items() if name in values}
    leading = max(truth, key=lambda name: abs(truth[name]), default=None)
    return [
        {
            "name": f"{hidden.name}.{name}",
            "truth": float(value),
            "value": values[name]["value"],
            "std": values[name]["std"],
            "within": bool(abs(values[name]["value"] - value) <= WITHIN * values[name]["std"]),
            "leads": name == leading,
        }
        for name, value in truth.items()
        if values[name]["std"] is not None
    ]


def _hidden_words(result: dict) -> str:
    names = [h["name"] + (" (cousin)" if h["kind"] == "cousin" else "") for h in result["hidden"]]
    return " + ".join(names) or "nothing"


def _said_words(result: dict) -> str:
    return " + ".join(" or ".join(names) for names in result["said"]) or result["verdict"]


def _in_bin(results: list[dict], low: float) -> dict:
    high = next((b for b in BINS if b > low), float("inf"))
    return rate([r["outcome"]["first"] for r in results if low <= min(r["adds_floors"]) < high])
