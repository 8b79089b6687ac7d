# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab infer` prints what to type next, for what is beyond doubt and lasts."""

from pathlib import Path

import pytest

from twinmill.inference.answer import Answer, Named
from twinmill_cli.infer import _mending


def named(effect, certainty):
    return Named(effect, 0.95, (effect,), 0.95, certainty, {})


def answer(verdict, *findings):
    return Answer(verdict, list(findings), 0.0, 0.1, 0.0, {}, {}, 0.0)


@pytest.mark.parametrize(
    ("said", "typed"),
    [
        (
            answer("effect_missing", named("dead_zone", "sure"), named("motor_lag", "group")),
            [
                "twinmill twin add dead_zone run.lcmlog --model base.toml -o base_dead_zone.toml",
                "twinmill twin add motor_lag run.lcmlog --model base_dead_zone.toml "
                "-o base_dead_zone_motor_lag.toml",
            ],
        ),
        (answer("effect_missing", named("dead_zone", "doubtful")), []),
        (answer("effect_missing", named("abrupt_loss", "sure")), []),  # of this run alone
        (
            answer("refit_enough"),
            ["twinmill fit run.lcmlog --model base.toml -o base_fitted.toml"],
        ),
        (answer("model_adequate"), []),
    ],
)
def test_what_is_sure_and_lasts_can_be_added_as_printed(said, typed):
    assert [c for _, c in _mending(said, [Path("run.lcmlog")], "base.toml")] == typed
