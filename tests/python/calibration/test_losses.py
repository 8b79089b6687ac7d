# SPDX-License-Identifier: Apache-2.0
"""Losses of a part of a log: named by size, surely only where nothing else may be it."""

import numpy as np
import pytest

from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.compare import compare

from .conftest import times_s

BEGIN_S = 0.5  # of a script in its log


def sure(found) -> list[str]:
    return [f.effect for f in found.answer.findings if f.certainty == "sure"]


def weak_from(from_s, until_s=np.inf, share=(1.0, 1.0, 1.0, 1.0)):
    """Rim speeds times a share of each wheel within a time of the log."""

    def wheels(rims):
        t_s = times_s(rims)
        return rims * np.where(((t_s > from_s) & (t_s < until_s))[:, None], share, 1.0)

    return wheels


@pytest.mark.parametrize("seen", [True, False], ids=["measured", "in a gap"])
def test_left_wheels_that_get_weaker_are_a_loss_of_one_side(changed, measure, known_base, seen):
    """12 % of the left wheels are 6 % of all and 6 % of their difference, from 20 s on.

    Even if nothing was measured from 12 to 20 s.
    """
    log = measure(changed(wheels=weak_from(20.0, share=(0.88, 1, 0.88, 1))), 22, 40.0)
    if not seen:
        at_s = log.track.command_t_s[0] + np.array([12.0, 20.0])
        log = log.without([tuple(at_s)], "not measured")
    found = diagnose([log], known_base)
    assert sure(found) == ["abrupt_loss"]
    for name in ("loss", "side"):
        value, std = found.answer.findings[0].numbers[name]
        assert value == pytest.approx(0.06, abs=3 * std)
        assert std < 0.01


def test_a_load_of_one_run_is_predicted_into_no_other(
    changed, tanh_robot, measure, known_base, tmp_path
):
    """A third of the way through the log 30 % of the speed is gone, for 13 s."""
    loaded = changed(wheels=weak_from(13.0, 26.0, share=(0.7,) * 4))
    found = diagnose([measure(loaded, 330, 40.0)], known_base)
    assert sure(found) == ["transient_loss"]
    loss, std = found.answer.findings[0].numbers["loss"]
    assert loss == pytest.approx(0.3, abs=3 * std)
    written = better(found, known_base, tmp_path / "loaded.toml", "")
    assert not written.added and not found.lasting
    other = [measure(tanh_robot(), 331, 40.0)]
    assert compare(other, written.file).score < 1.1 * compare(other, known_base).score


MOST_SUM = 0.45  # of the four duties' sizes, as a share of the most


def in_sum_limited(duty):
    """Duties as a supply of limited power leaves them."""
    size = np.abs(duty).mean(axis=1, keepdims=True)
    return duty * np.minimum(1, MOST_SUM / np.maximum(size, 1e-9))


def failing_at_32_s(duty):
    """Duties less a quarter from a moment on."""
    return np.where((times_s(duty) > 32 + BEGIN_S)[:, None], 0.75 * duty, duty)


@pytest.mark.parametrize(
    ("duties", "last_pct", "surely"),
    [(in_sum_limited, (85, 90), False), (failing_at_32_s, (15, 45), True)],
)
def test_a_loss_is_sure_where_commands_are_as_before_it(
    changed, measure, known_base, duties, last_pct, surely
):
    """Commands are below the limit for 32 s; in the last 12 s above it, or as they were.

    Each leg is driven there and back, so that the place is as before, too.
    """
    random = np.random.default_rng(3)
    ways = np.array([(1, 1, 1, 1), (-1, 1, -1, 1), (-1, 1, 1, -1), (1, 0.4, 1, 0.4)])
    legs = ways[random.integers(0, 4, 22)]
    sizes_pct = [*random.uniform(15, 45, 16), *random.uniform(*last_pct, 6)]
    legs *= np.array(sizes_pct)[:, None]
    steps = np.stack([legs, -legs], axis=1).reshape(44, 4)
    script = np.repeat(steps.round().astype(int), 48, axis=0)
    found = diagnose([measure(changed(duties=duties), 33, script_pct=script)], known_base)
    assert ("abrupt_loss" in sure(found)) == surely


def test_moments_without_power_are_told_as_moments(changed, measure, known_base):
    """The wheels get no power for 0.4 s, four times; nothing else is new."""
    fails_s, for_s = np.array([8.0, 15.0, 22.0, 31.0]) + BEGIN_S, 0.4

    def failing(duty):
        at_s = times_s(duty)[:, None]
        return duty * ~np.any((at_s > fails_s) & (at_s < fails_s + for_s), axis=1)[:, None]

    straight = np.full((40 * 48, 4), 75)
    straight[::480] = 50  # something changes
    turns = np.where((np.arange(len(straight)) // 96 % 2)[:, None], (75, 25, 75, 25), straight)
    found = diagnose([measure(changed(duties=failing), 21, script_pct=turns)], known_base).answer
    assert found.verdict == "outside_catalogue" and not found.findings
    assert found.depends_on["moments"] > 0.9
