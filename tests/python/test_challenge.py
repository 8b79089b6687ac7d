# SPDX-License-Identifier: Apache-2.0
"""The blind test draws what it says, with noise of its own, and counts right."""

from collections import Counter

import pytest

from twinmill.challenge.cases import KINDS, NOT_DRAWN, STRENGTHS, WITHHELD, draw, seal
from twinmill.challenge.scoring import rate
from twinmill.model.freedom import catalogue

KNOWN = {"planar": ("motor_lag",), "mujoco": ()}
CASES = [draw(number, 7, KNOWN) for number in range(200)]


def test_same_seed_same_sealed_answers_and_another_seed_others():
    again = [draw(number, 7, KNOWN) for number in range(200)]
    assert seal(again) == seal(CASES)
    assert seal([draw(number, 8, KNOWN) for number in range(200)]) != seal(CASES)


def test_no_two_logs_share_their_noise():
    other = [draw(number, 8, KNOWN) for number in range(200)]
    assert len({c.noise_seed for c in CASES + other}) == 400


def test_kinds_and_plants_are_balanced():
    count = Counter((c.kind, c.plant) for c in CASES)
    per_kind = Counter(KINDS)
    assert all(count[k, p] == 20 * per_kind[k] for k in per_kind for p in KNOWN)


def test_what_is_hidden_is_within_bounds_and_not_neutral():
    entries = catalogue()
    for case in CASES:
        assert len(case.hidden) == {"none": 0, "one": 1, "two": 2, "outside": 1}[case.kind]
        assert case.strength in STRENGTHS
        for hidden in case.hidden:
            if hidden.effect == "equation":
                assert case.kind == "outside"
                continue
            assert hidden.effect not in (*NOT_DRAWN, *KNOWN[case.plant])
            for p in entries[hidden.effect]["parameters"]:
                value = hidden.parameters[p["name"]]
                assert p["min"] <= value <= p["max"]
                assert value != p["neutral"]


def test_only_what_is_outside_is_withheld():
    for case in CASES:
        named = {h.effect for h in case.hidden} & set(WITHHELD)
        assert set(case.withheld) == (named if case.kind == "outside" else set())


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    [(0, 40, 0.0, 1 - 0.025 ** (1 / 40)), (40, 40, 0.025 ** (1 / 40), 1.0), (0, 0, 0.0, 1.0)],
)
def test_intervals_of_none_and_all_are_clopper_and_pearsons(hits, of, low, high):
    found = rate([True] * hits + [False] * (of - hits))
    assert (found["hits"], found["of"]) == (hits, of)
    assert found["low"] == pytest.approx(low)
    assert found["high"] == pytest.approx(high)
