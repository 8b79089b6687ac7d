# SPDX-License-Identifier: Apache-2.0
"""What the screening promises of an effect, against what its fit takes."""

import pytest

from twinmill.diagnosis.diagnose import first_state
from twinmill.diagnosis.screening import screen
from twinmill.diagnosis.trials import cross_validate, fitted
from twinmill.fitting.opening import judged, open_measurements, with_own_gains

DUTIES, GAP_RAD = 1, 0.9


@pytest.fixture(scope="module")
def worn_gears(drawn):
    """The first state of a search over a log of a robot whose gears have nine times usual play."""
    hidden = ("backlash", "plain", "gap_rad")
    _, run, base = drawn(DUTIES, 1, "joystick", hidden, GAP_RAD)
    opened = with_own_gains(judged(open_measurements([run], base)))
    return fitted(first_state(opened, base, ()))


def test_much_play_promises_what_it_takes(worn_gears):
    """A strong play is no multiple of a weak one, which alone promises a tenth of it."""
    (promised,) = screen(worn_gears, names=["backlash"])
    takes = cross_validate(worn_gears, ("backlash",)).evidence
    assert promised.gain > takes / 4
