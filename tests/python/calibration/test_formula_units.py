# SPDX-License-Identifier: Apache-2.0
"""Units of formulas: by dimensions."""

import numpy as np
import pytest

from twinmill.formulas.forms import Form, names_of, own_forms
from twinmill.formulas.units import units_of


def test_units_agree_in_every_form_and_are_told_of_its_numbers():
    """A number in front of v |v| that gives a speed is in s/m."""
    random = np.random.default_rng(1)
    t_s = np.arange(0.0, 60.0, 0.1)
    motion, place = random.normal(size=(len(t_s), 3)), random.normal(size=(len(t_s), 2))
    names = names_of(motion, place, random.normal(size=len(t_s)), t_s)
    forms = own_forms(names, True, True)
    assert len(forms) > 100 and all(units_of(form) for form in forms)
    assert units_of(Form("vx_mps", ("vx*abs(vx)",), "speed")) == ["s/m"]
    assert units_of(Form("travel", ("(vx*vx + vy*vy)",), "speed")) == ["s^2/m^2"]
    with pytest.raises(ValueError, match="is added"):
        units_of(Form("vx_mps", ("(vx + x)",), "speed"))
