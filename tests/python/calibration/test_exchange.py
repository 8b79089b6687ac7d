# SPDX-License-Identifier: Apache-2.0
"""An effect that was found early is weighed again beside those found later."""

import pytest

from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose

TOLD_VELOCITIES, LOSS = 5, 0.25
MEAN_LOSS = 3 / 8 * LOSS  # mean of sin^4 over all directions


@pytest.fixture(scope="module")
def on_carpet(drawn):
    """A robot told velocities on a carpet that brakes by LOSS sin^4 of the way to its grain.

    That is a mean loss, and parts of the second and fourth order. In the first round the loss of
    the faster drives looks like a slip that grows with speed.
    """
    hidden = ("carpet_grain", "cousin", "loss")
    robot, run, base = drawn(TOLD_VELOCITIES, 5, "mixed", hidden, LOSS, forces=True)
    return diagnose([run], base), base, robot


def test_a_mean_loss_beside_a_grain_is_a_gain_and_no_curve(on_carpet, tmp_path):
    found, base, robot = on_carpet
    answer = found.answer
    assert "carpet_grain" in answer.effects or next(iter(answer.depends_on)) == "heading"
    assert not [f for f in answer.findings if f.certainty == "sure" and f.effect != "carpet_grain"]
    model = better(found, base, tmp_path / "better.toml", "").file.model
    gain = model.get("base.forward_gain") / robot.gains[0]
    assert gain == pytest.approx(1 - MEAN_LOSS, abs=0.03)
