# SPDX-License-Identifier: Apache-2.0
"""Scores of rivals against the hidden truth: each rival, each setting, every column.

Names and dependence are judged by the rules of `twinmill lab challenge`; a rival's answer is put
into the form of `twinmill diagnose --json` for that.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from rivals.exam import AHEAD_S, Unseen
from rivals.protocol import Answer
from twinmill_lab.challenge.cases import Case
from twinmill_lab.challenge.scoring import rate, scored


@dataclass(frozen=True)
class Column:
    """One column of the table: its key, what it says, whether more is better."""

    key: str
    words: str
    more: bool


RATES = (
    Column("told", "told that something is missing", True),
    Column("alarm", "false alarms", False),
    Column("name", "right name or family", True),
    Column("depends", "right dependence", True),
    Column("wrong", "named wrongly, and surely", False),
    Column("within", "outside the catalogue: all errors within 1.3 of the truth's", True),
)
WITHIN = 1.3
ERRORS = tuple(
    Column(f"{label}_{ahead_s:g}", f"error at {ahead_s:g} s over the truth's, {words}", False)
    for label, words in (("same", "same kind of drive"), ("other", "another kind"))
    for ahead_s in AHEAD_S
)
TIME = Column("time_s", "processor time, s", False)


def judged(case: Case, answer: Answer, logs: Mapping[str, Unseen]) -> dict:
    """One answer: what was said, whether it was right, and the errors of its predictions."""
    result = scored(case, answer.said or _said(answer))
    errors = {
        f"{label}_{ahead_s:g}": ratio
        for label, log in logs.items()
        for ahead_s, ratio in zip(
            AHEAD_S, log.over_truth(answer.predict(log.measurement, log.windows)), strict=True
        )
    }
    outcome = result["outcome"]
    return {
        "evidence": answer.evidence,
        "said": result["said"],
        "depends_on": result["rest"]["depends_on"],
        "told": outcome["alarm"],
        "first": outcome["first"],
        "depends": outcome["told"] and outcome["depends"],
        "wrong": outcome["wrong_and_sure"],
        **errors,
    }


def _said(answer: Answer) -> dict:
    """An answer as `twinmill diagnose --json` would print it; who has no doubts is sure."""
    verdict = "effect_missing" if answer.names else "outside_catalogue"
    return {
        "verdict": verdict if answer.told else "model_adequate",
        "findings": [{"effect": n, "certainty": "sure"} for n in answer.names],
        "rest": {"share": float(answer.told), "depends_on": list(answer.depends_on)},
    }


def row(cases: Iterable[dict]) -> dict:
    """The columns of one rival in one setting.

    Args:
        cases: of `judged`, with the `kind` and `drawn` of each case.
    """
    cases = list(cases)
    there = [c for c in cases if c["kind"] != "none"]
    rates = {
        "told": rate([c["told"] for c in there]),
        "alarm": rate([c["told"] for c in cases if c["kind"] == "none"]),
        "name": rate([c["first"] for c in cases if c["kind"] in ("one", "cousin")]),
        "depends": rate([c["depends"] for c in cases if c["kind"] == "outside"]),
        "wrong": rate([c["wrong"] for c in cases]),
        "within": rate([_within(c) for c in cases if c["kind"] == "outside"]),
    }
    return rates | {c.key: middle([case[c.key] for case in there]) for c in ERRORS}


def _within(case: dict) -> bool:
    """True if every error of a case's predictions is near the truth's."""
    return all(case[column.key] <= WITHIN for column in ERRORS)


def middle(values: list[float]) -> dict:
    """The median and its 95 % interval by order statistics, which asks for no distribution.

    The interval from the k-th least to the k-th largest misses the median with twice the chance
    that a fair coin falls on its head less than k times (David and Nagaraja 2003, section 7.1).
    """
    ordered = np.sort([v for v in values if np.isfinite(v)])
    if not len(ordered):
        return {"median": None, "low": None, "high": None, "of": 0}
    k = max(int(binom.ppf(0.025, len(ordered), 0.5)), 1)
    return {
        "median": float(np.median(ordered)),
        "low": float(ordered[k - 1]),
        "high": float(ordered[-k]),
        "of": len(ordered),
    }
