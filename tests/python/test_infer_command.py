# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab infer` prints what to type next, for what is likeliest and lasts."""

from pathlib import Path

import pytest

from twinmill.inference.answer import Answer
from twinmill_cli.infer import _mending


def answer(verdict, *added):
    return Answer(verdict, [], 0.0, 0.1, 0.0, {}, {}, 0.0, added, None)


@pytest.mark.parametrize(
    ("said", "new"),
    [
        (answer("effect_missing", "dead_zone", "motor_lag"), "base_dead_zone_motor_lag.toml"),
        (answer("effect_missing", "abrupt_loss", "dead_zone"), "base_dead_zone.toml"),
        (answer("effect_missing", "abrupt_loss"), None),  # of this run alone
        (answer("refit_enough"), "base_fitted.toml"),
        (answer("model_adequate"), None),
    ],
)
def test_a_model_is_offered_that_has_what_lasts(said, new):
    typed = [c for _, c in _mending(said, "lab infer", [Path("run.lcmlog")], "base.toml")]
    assert typed == ([f"twinmill lab infer run.lcmlog --model base.toml -o {new}"] if new else [])
