# SPDX-License-Identifier: Apache-2.0
"""Formulas whose numbers are far from one: a robot ten times slower than the usual one.

It loses speed with heat, written here in NumPy, so that the loss per squared speed is a hundred.
"""

import pytest
from scipy.signal import lfilter

from twinmill.fitting.add import add
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

from .conftest import STEP_S

LOSS_S2_PER_M2, MEMORY_S = 160.0, 15.0
SLOW = {"top_mps": 0.06, "sensor_m": 6e-5, "sensor_rad": 3.5e-4}
SLOW |= {"drive_mps": 6e-4, "drive_radps": 6e-3}
HEAT = "((vx*vx + vy*vy) - s)*(1/15)"


def warming(motion):
    """All speeds fall with the heat of the way."""
    load = (motion[:, :2] ** 2).sum(axis=1)
    heat = lfilter([STEP_S / MEMORY_S], [1, STEP_S / MEMORY_S - 1], load)
    return motion * (1 - LOSS_S2_PER_M2 * heat)[:, None]


def test_a_number_of_hundreds_is_fitted_as_any_other(
    tanh_robot, changed, measure, model_file, tmp_path
):
    guess, path = model_file(extra="[clock]\nsame = true\n"), tmp_path / "base.toml"
    fit([measure(tanh_robot(**SLOW), 1, 60.0)], guess, path, "")
    log, base = measure(changed(motion=warming, **SLOW), 101, 100.0), ModelFile.load(str(path))
    texts = {"adds_to": "motion", "formula": "p0*s", "state_rate": HEAT}
    found = add("equation", [log], base, out=tmp_path / "added.toml", command="", texts=texts)
    (number,) = found.added
    assert number.value == pytest.approx(-LOSS_S2_PER_M2, rel=0.1)
    assert number.seen and not number.at_bound
    assert found.heldout_after.score < 1.2 < found.heldout_refit.score
