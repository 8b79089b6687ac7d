# SPDX-License-Identifier: Apache-2.0
"""The demo says right or wrong by what was sealed."""

from types import SimpleNamespace

import pytest

from twinmill.model.parameters import ParameterEstimate
from twinmill_cli.demo import Hidden, judged

HIDDEN = [
    Hidden("coasting", "deceleration_mps2", 0.7),
    Hidden("wheel_gain", "fl", -0.1),
]


def explained(*found, groups=None, coasting=0.7, std=0.05):
    """A result that names these effects.

    Args:
        found: names.
        groups: names that one cannot be parted from.
        coasting: its size.
        std: of the sizes, as a share of them.
    """
    groups = groups or {}
    values = {"coasting.deceleration_mps2": coasting, "wheel_gain.fl": -0.1}
    parameters = [
        ParameterEstimate(name, value, std * abs(value), "1", at_bound=False, seen=True)
        for name, value in values.items()
        if name.split(".")[0] in found
    ]
    findings = [SimpleNamespace(effect=e, group=groups.get(e, ())) for e in found]
    told = SimpleNamespace(answer=SimpleNamespace(findings=findings))
    return SimpleNamespace(added=found, found=told, estimates=parameters)


def test_both_and_nothing_else_is_right():
    grade, words = judged(HIDDEN, explained("coasting", "wheel_gain"))
    assert grade == "right"
    assert "Both sizes lie within" in words


@pytest.mark.parametrize(("coasting", "std"), [(0.9, 0.05), (0.72, 0.01)])
def test_a_size_outside_its_interval_is_said(coasting, std):
    """However near it is: 0.72 +- 0.007 is not 0.7."""
    _, words = judged(HIDDEN, explained("coasting", "wheel_gain", coasting=coasting, std=std))
    assert "One of the two sizes lies within" in words


@pytest.mark.parametrize(("found", "grade", "words"), [
    (["coasting"], "in part", "wheel_gain was hidden and not found"),
    (["coasting", "wheel_gain", "heat_gain"], "in part", "heat_gain was found and not hidden"),
    (["heat_gain"], "wrong", "coasting was hidden and not found"),
    ([], "wrong", "wheel_gain was hidden and not found"),
])  # fmt: skip
def test_what_is_missed_or_too_much_is_said(found, grade, words):
    told = judged(HIDDEN, explained(*found))
    assert told[0] == grade
    assert words in told[1]


def test_one_of_a_group_is_right_in_part_and_no_wrong_name():
    groups = {"mass_offset": ("mass_offset", "wheel_gain")}
    grade, words = judged(HIDDEN, explained("coasting", "mass_offset", groups=groups))
    assert grade == "in part"
    assert "mass_offset was named, which this log cannot distinguish from it" in words
    assert "not hidden" not in words
