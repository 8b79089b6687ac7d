# SPDX-License-Identifier: Apache-2.0
"""What the screening promises of an effect, against what its fit takes."""

import numpy as np
import pytest

from twinmill.challenge.cases import calibration
from twinmill.challenge.drives import drive
from twinmill.challenge.physics import catalogue_forms
from twinmill.challenge.robots import draw_robot
from twinmill.challenge.run import Plan, play, write_log
from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import first_state
from twinmill.diagnosis.screening import screen
from twinmill.diagnosis.trials import cross_validate, fitted
from twinmill.fitting.fit import fit
from twinmill.fitting.opening import judged, open_measurements, with_own_gains
from twinmill.model.model_file import ModelFile

DUTIES, GAP_RAD = 1, 0.9


@pytest.fixture(scope="module")
def worn_gears(tmp_path_factory):
    """The first state of a search over a log of a robot whose gears have nine times usual play."""
    folder, random = tmp_path_factory.mktemp("play"), np.random.default_rng(1)
    robot = draw_robot(DUTIES, random)
    usual = calibration(robot, 1, 60.0)
    write_log(usual, play(usual), folder / "usual.lcmlog")
    (folder / "sheet.toml").write_text(robot.sheet(random))
    plan = Plan(robot, drive("joystick", 80.0, True, random), 1)
    forms = catalogue_forms(robot, random)
    play_of_gears = next(f for f in forms if (f.name, f.kind) == ("backlash", "plain"))
    play_of_gears = play_of_gears.scaled(GAP_RAD / play_of_gears.values["gap_rad"])
    write_log(plan, play(plan, [play_of_gears]), folder / "run.lcmlog")
    sheet, base = ModelFile.load(str(folder / "sheet.toml")), folder / "base.toml"
    fit(load_measurements([folder / "usual.lcmlog"]), sheet, base, "")
    model_file = ModelFile.load(str(base))
    run = load_measurements([folder / "run.lcmlog"])
    opened = with_own_gains(judged(open_measurements(run, model_file)))
    return fitted(first_state(opened, model_file, ()))


def test_much_play_promises_what_it_takes(worn_gears):
    """A strong play is no multiple of a weak one, which alone promises a tenth of it."""
    (promised,) = screen(worn_gears, names=["backlash"])
    takes = cross_validate(worn_gears, ("backlash",)).evidence
    assert promised.gain > takes / 4
