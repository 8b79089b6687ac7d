# SPDX-License-Identifier: Apache-2.0
"""The screening's promise for an effect, against the gain of its fit."""

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import first_state
from twinmill.diagnosis.screening import Screened, _on_few, likely_pairs, screen
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import cross_validate, fitted
from twinmill.fitting.opening import judged, open_measurements, with_own_gains
from twinmill.model.model_file import ModelFile

DUTIES, GAP_RAD = 1, 0.9
HIDES = 10.0  # times what is missing, by which two signatures agree that part in it alone


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


@pytest.fixture(scope="module")
def turns_at_once(tanh_robot, measure, true_model, tmp_path_factory):
    """The first state for a robot that turns as it drives; its model says that it turns at once."""
    path = tmp_path_factory.mktemp("at_once") / "base.toml"
    sooner = f'[[effect]]\nname = "yaw_lag"\nextra_s = {-tanh_robot().lag_s}\n'
    path.write_text(f"{true_model.text}\n{sooner}")
    base = ModelFile.load(str(path))
    opened = with_own_gains(judged(open_measurements([measure(tanh_robot(), 3, 40.0)], base)))
    return fitted(first_state(opened, base, ()))


def test_a_turn_that_cannot_come_sooner_promises_what_it_takes_by_coming_later(turns_at_once):
    """Its usual size is sooner, which is no sooner than at once: there it does next to nothing."""
    (promised,) = screen(turns_at_once, names=["yaw_lag"])
    takes = cross_validate(turns_at_once, ("yaw_lag",)).evidence
    assert takes > SETTINGS.evidence
    assert promised.gain > takes / 4


def test_two_that_hide_each_other_are_tried_together(worn_gears):
    """As a late drive and a turn that is not: their difference is all that is missing.

    Each alone gains 1 / (1 + HIDES^2) of it, and a dozen others by themselves gain more.
    """
    few = _on_few(worn_gears.fit)
    missing, *_ = few.whitened(range(len(few.datasets)))
    random = np.random.default_rng(1)
    *others, shared = _orthogonal(random.standard_normal((len(missing), 13)), missing).T
    size = np.linalg.norm(missing)

    def alone(name: str, column: np.ndarray) -> Screened:
        gain = (column @ missing) ** 2 / (column @ column)
        return Screened(name, column[:, None], gain, 1.0)

    hidden = HIDES * size * shared
    decoys = [alone(f"decoy {k}", missing + 5 * size * own) for k, own in enumerate(others)]
    both = [alone("late", hidden + missing), alone("turns", hidden)]
    assert max(s.gain for s in both) < min(s.gain for s in decoys)
    first, *_ = likely_pairs(worn_gears, [*decoys, *both], SETTINGS)
    assert set(first) == {"late", "turns"}


def _orthogonal(columns: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Orthonormal columns, also to a vector."""
    return np.linalg.qr(np.column_stack([to, columns]))[0][:, 1:]
