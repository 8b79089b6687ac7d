# SPDX-License-Identifier: Apache-2.0
"""An effect that was found early is weighed again beside those found later."""

import numpy as np
import pytest

from twinmill.challenge.cases import calibration
from twinmill.challenge.drives import drive
from twinmill.challenge.physics import catalogue_forms
from twinmill.challenge.robots import draw_robot
from twinmill.challenge.run import Plan, play, write_log
from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

TOLD_VELOCITIES, LOSS = 5, 0.25
MEAN_LOSS = 3 / 8 * LOSS  # mean of sin^4 over all directions


@pytest.fixture(scope="module")
def on_carpet(tmp_path_factory):
    """A robot told velocities on a carpet that brakes by LOSS sin^4 of the way to its grain.

    That is a mean loss, and parts of the second and fourth order. In the first round the loss of
    the faster drives looks like a slip that grows with speed.
    """
    folder, random = tmp_path_factory.mktemp("carpet"), np.random.default_rng(5)
    robot = draw_robot(TOLD_VELOCITIES, random)
    usual = calibration(robot, 5, 60.0)
    write_log(usual, play(usual, forces=True), folder / "usual.lcmlog")
    (folder / "sheet.toml").write_text(robot.sheet(random))
    plan = Plan(robot, drive("mixed", 80.0, True, random), 5)
    forms = catalogue_forms(robot, random)
    grain = next(f for f in forms if (f.name, f.kind) == ("carpet_grain", "cousin"))
    grain = grain.scaled(LOSS / grain.values["loss"])
    write_log(plan, play(plan, [grain]), folder / "run.lcmlog")
    sheet, base = ModelFile.load(str(folder / "sheet.toml")), folder / "base.toml"
    fit(load_measurements([folder / "usual.lcmlog"]), sheet, base, "")
    found = diagnose(load_measurements([folder / "run.lcmlog"]), ModelFile.load(str(base)))
    return found, robot


def test_a_mean_loss_beside_a_grain_is_a_gain_and_no_curve(on_carpet):
    found, robot = on_carpet
    assert set(found.found) == {"carpet_grain"}
    gain = found.model.get("base.forward_gain") / robot.gains[0]
    assert gain == pytest.approx(1 - MEAN_LOSS, abs=0.02)
