# SPDX-License-Identifier: Apache-2.0
"""Whether what was said of a case is right, and the figures over all cases."""

from collections import Counter

from scipy.stats import binomtest

from twinmill.challenge.cases import Case
from twinmill.challenge.truth import Truth
from twinmill.diagnosis.result import Diagnosis

MATTERS = 1.0  # floors that an effect must add to the error at 2 s to be asked for
AS_GOOD = 1.15  # times the true model's score
BINS = (0.0, 0.3, 1.0, 3.0, 10.0)  # lower ends of strengths, in floors


def scored(case: Case, found: Diagnosis, truth: Truth) -> dict:
    """One case: what was hidden, what was said, whether that was right, what could be had."""
    hidden = {h.effect for h in case.hidden}
    first = found.ranking[0] if found.ranking else None
    leading = {
        r.effect
        for r in found.ranking
        if r is first or (r.group is not None and r.group == first.group)
    }
    groups = {r.group for r in found.ranking if r.effect in found.found and r.group is not None}
    named = {r.effect for r in found.ranking if r.effect in found.found or r.group in groups}
    right = {
        "none": found.verdict == "model_adequate" and not found.found,
        "one": bool(found.found) and bool(hidden & leading),
        "two": hidden <= named,
        "outside": found.verdict == "outside_catalogue",
    }[case.kind]
    after = found.steps[-1][1]
    return {
        "case": case.number,
        "plant": case.plant,
        "kind": case.kind,
        "strength": case.strength,
        "hidden": [h.label for h in case.hidden],
        "adds_floors": list(truth.adds),
        "matters": bool(truth.adds) and min(truth.adds) > MATTERS,
        "verdict": found.verdict,
        "found": found.found,
        "named": sorted(named),
        "right": bool(right),
        "score_before": found.before.score,
        "score_after": after,
        "score_true": truth.score,
        "as_good": bool(after <= AS_GOOD * truth.score),
    }


def summary(results: list[dict]) -> dict:
    """Rates with their 95 % intervals (Clopper and Pearson 1934), confusion, power by strength."""
    kinds = {kind: [r for r in results if r["kind"] == kind] for kind in ("none", "one", "two")}
    outside = [r for r in results if r["kind"] == "outside" and r["matters"]]
    asked = [r for kind in ("one", "two") for r in kinds[kind] if r["matters"]]
    confusion = Counter(
        (" + ".join(r["hidden"]) or "nothing", " + ".join(r["found"]) or r["verdict"])
        for r in results
    )
    return {
        "false_alarm": rate([not r["right"] for r in kinds["none"]]),
        "right_first": rate([r["right"] for r in kinds["one"] if r["matters"]]),
        "both_of_two": rate([r["right"] for r in kinds["two"] if r["matters"]]),
        "outside_called": rate([r["right"] for r in outside]),
        "as_good_as_true": rate([r["as_good"] for r in asked if r["right"]]),
        "power": {
            kind: [_in_bin(results, kind, low) for low in BINS]
            for kind in ("one", "two", "outside")
        },
        "confusion": [
            {"hidden": h, "said": s, "cases": n} for (h, s), n in sorted(confusion.items())
        ],
    }


def rate(outcomes: list[bool]) -> dict:
    """Successes, trials, and the interval of the probability."""
    hits, trials = sum(outcomes), len(outcomes)
    if not trials:
        return {"hits": 0, "of": 0, "low": 0.0, "high": 1.0}
    interval = binomtest(hits, trials).proportion_ci()
    return {"hits": hits, "of": trials, "low": float(interval.low), "high": float(interval.high)}


def _in_bin(results: list[dict], kind: str, low: float) -> dict:
    high = next((b for b in BINS if b > low), float("inf"))
    own = [r for r in results if r["kind"] == kind and low <= min(r["adds_floors"]) < high]
    return {"from_floors": low, **rate([r["right"] for r in own])}
