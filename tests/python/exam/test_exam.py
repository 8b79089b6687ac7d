# SPDX-License-Identifier: Apache-2.0
"""Eighteen sealed cases in every check, three of each robot: what was answered rightly stays so.

Right is said by what was hidden, not by an earlier answer: `twinmill lab challenge` draws the
robots, plays them by formulas of its own, by forces, or on free rollers, and scores. LOST are the
cases that are not answered yet, in logs of half the usual length. Every change is printed as a
warning; one case may be lost anew, since another processor rounds otherwise.
"""

import warnings

import pytest

from twinmill_lab.challenge.cases import draw, draw_robots
from twinmill_lab.challenge.command import base_of, diagnosed
from twinmill_lab.challenge.scoring import lost

SEED, SECONDS, CASES = 1, 45, 18
LOST = {2, 6, 13, 16}


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> list[dict]:
    folder, robots = tmp_path_factory.mktemp("exam"), draw_robots(SEED)
    found = []
    for number in range(CASES):
        case = draw(number, SEED, robots, SECONDS)
        how = {"seed": SEED, "duration_s": SECONDS}
        base = base_of(folder, case.robot, robots[case.robot], **how)
        found.append(diagnosed(base, case)[0])
    return found


def test_what_is_called_sure_is_there(results):
    assert not [r["case"] for r in results if r["outcome"]["wrong_and_sure"]]


def test_most_single_effects_are_named_first(results):
    """In half the usual length."""
    single = [r["outcome"]["first"] for r in results if r["kind"] in ("one", "cousin")]
    assert sum(single) >= 0.8 * len(single)


def test_what_was_answered_stays_so(results):
    now = {r["case"] for r in results if lost(r)}
    told = {
        r["case"]: f"hidden {r['hidden']}, said {r['said']}, verdict {r['verdict']}"
        for r in results
    }
    for number in sorted(now ^ LOST):
        way = "lost" if number in now else "answered now: take it out of LOST"
        warnings.warn(f"case {number} is {way} ({told[number]})", stacklevel=1)
    assert len(now - LOST) <= 1, [told[number] for number in sorted(now - LOST)]


def test_where_nothing_is_hidden_nothing_is_found(results):
    nothing = [r for r in results if r["kind"] == "none"]
    assert nothing
    assert not [r["case"] for r in nothing if r["outcome"]["alarm"]]


def test_hardly_a_name_is_wrong_and_sure(results):
    named = [r for r in results if r["kind"] != "outside" and r["outcome"]["others"]]
    assert len(named) <= 0.15 * len(results), [(r["case"], r["said"]) for r in named]
