# SPDX-License-Identifier: Apache-2.0
"""Physics that no effect of the catalogue says: on what it depends, and its formula.

The robots are those of `conftest.py`; what hinders them is written here over whole motions.
"""

import re
import subprocess

import numpy as np
import pytest

from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.compare import MISSING, compare
from twinmill.programs import find_program

from .conftest import STEP_S


def swinging(motion: np.ndarray) -> np.ndarray:
    """A tank of 1.3 Hz, damped by 8 %, whose liquid pushes forward by its own speed."""
    rate_radps, damping, share = 2 * np.pi * 1.3, 0.08, 0.12
    kept, at_m, now_mps = motion.copy(), 0.0, 0.0
    change = np.diff(motion[:, 0], prepend=motion[0, 0])
    for k, jump_mps in enumerate(change):
        now_mps -= share * jump_mps
        now_mps -= STEP_S * (rate_radps**2 * at_m + 2 * damping * rate_radps * now_mps)
        at_m += STEP_S * now_mps
        kept[k, 0] += now_mps
    return kept


def dipping(motion: np.ndarray) -> np.ndarray:
    """Forward and back, 10 % are missing near a speed of 0.29 m/s, and nowhere else."""
    kept = motion.copy()
    kept[:, 0] *= 1 - 0.1 * np.exp(-(((np.abs(motion[:, 0]) - 0.29) / 0.03) ** 2))
    return kept


def turned_by_strips(motion: np.ndarray) -> np.ndarray:
    """Every second strip of floor of 0.35 m turns whatever drives over it by 0.12 rad/s."""
    drives = np.abs(motion).max(axis=1) > 0.005
    kept, x_m, heading = motion.copy(), 0.0, 0.0
    for k in range(len(motion)):
        kept[k, 2] += 0.12 * (drives[k] and int(np.floor(x_m / 0.35)) % 2)
        x_m += STEP_S * (np.cos(heading) * kept[k, 0] - np.sin(heading) * kept[k, 1])
        heading += STEP_S * kept[k, 2]
    return kept


def course(motion: np.ndarray) -> np.ndarray:
    """(K,) direction in the room in which it drives, rad."""
    return np.cumsum(motion[:, 2]) * STEP_S + np.arctan2(motion[:, 1], motion[:, 0])


def blown(motion: np.ndarray) -> np.ndarray:
    """A wind: 6 % quicker with it, slower against it."""
    return motion * (1 + 0.06 * np.cos(course(motion) - 0.7)[:, None] * (1, 1, 0))


def leaning(motion: np.ndarray) -> np.ndarray:
    """A marker on a soft mast stands off by 20 mm for each m/s^2 with which a curve pulls."""
    kept, turn = motion.copy(), motion[:, 2]
    off_m = 0.02 * np.column_stack([turn * motion[:, 1], -turn * motion[:, 0]])
    kept[:, :2] += np.gradient(off_m, STEP_S, axis=0)
    kept[:, :2] += np.column_stack([-turn * off_m[:, 1], turn * off_m[:, 0]])
    return kept


def swung_round(motion: np.ndarray) -> np.ndarray:
    """A castor swings round over the first 60 mm that it drives the other way, and turns it."""
    kept, place = motion.copy(), 1.0
    for k, way in enumerate(motion[:, 0] * STEP_S / 0.03):
        place = min(max(place + way, -1.0), 1.0)
        kept[k, 2] += 0.25 * (1 - place**2) * (way != 0)
    return kept


@pytest.mark.parametrize(
    ("hindrance", "depends_on"),
    [
        (dipping, "speed"),
        (turned_by_strips, "place"),
        (leaning, "coupling of turns"),
        (swung_round, "past"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_dependence_is_told_where_no_effect_is_known(
    hindrance, depends_on, changed, measure, known_base
):
    found = diagnose([measure(changed(motion=hindrance), 101, 80.0)], known_base).answer
    assert found.verdict == "outside_catalogue"
    assert next(iter(found.depends_on)) == depends_on
    assert not [f for f in found.findings if f.certainty == "sure"]


def test_heading_that_the_capture_lets_drift_depends_on_time(measure, known_base):
    def spoil(pose, valid):
        t_s = np.arange(len(pose)) / 120
        return pose + 0.12 * np.sin(2 * np.pi * t_s / 43)[:, None] * (0, 0, 1), valid

    found = diagnose([measure(seed=102, duration_s=80.0, spoil=spoil)], known_base).answer
    assert found.verdict == "outside_catalogue"
    assert next(iter(found.depends_on)) == "time"


@pytest.fixture
def mended(changed, measure, known_base, tmp_path):
    """The formula for a hindrance, and scores of another log without and with the new model.

    That is written as `better.toml`.
    """

    def make(hindrance):
        robot = changed(motion=hindrance)
        found = diagnose([measure(robot, 101, 80.0)], known_base)
        written = better(found, known_base, tmp_path / "better.toml", "").file
        written.write()
        other = [measure(robot, 77, 60.0)]
        return found.formula, compare(other, known_base).score, compare(other, written).score

    return make


def size_and_angle(formula) -> tuple[float, float]:
    """Size and angle, rad, of a formula p0 cos + p1 sin."""
    return np.hypot(*formula.values), np.arctan2(*formula.values[::-1])


def test_a_wind_is_told_with_its_strength_and_direction(mended):
    formula, before, after = mended(blown)
    assert formula.texts["formula"] == "p0*cos(course) + p1*sin(course)"
    size, angle_rad = size_and_angle(formula)
    assert size == pytest.approx(0.06, rel=0.1)
    assert angle_rad == pytest.approx(0.7, abs=0.1)
    assert after < MISSING < before


def test_a_tank_that_swings_is_told_with_its_rate_and_damping(mended):
    formula, before, after = mended(swinging)
    assert formula.form.adds_to == "vx_mps" and formula.holds
    rate_radps, damping = formula.form.constant, formula.form.damping
    assert rate_radps == pytest.approx(2 * np.pi * 1.3, rel=0.05)
    assert damping == pytest.approx(0.08, rel=0.5)
    assert formula.values[0] == pytest.approx(0.12, rel=0.1)
    assert after < before


REACH_RAD = 0.08


def stored(motion: np.ndarray) -> np.ndarray:
    """Turning of which each reversal first stores 0.08 rad, as Dahl's friction (1968) does."""
    kept, s = motion.copy(), 0.0
    for k, w in enumerate(motion[:, 2]):
        change = w - abs(w) * s / REACH_RAD
        s += STEP_S * change
        kept[k, 2] = w - change
    return kept


def test_way_that_reversals_store_is_found_with_its_reach(mended, tmp_path):
    """The formula stores its number times its reach at each reversal; both plants move by it."""
    formula, before, after = mended(stored)
    assert formula.form.adds_to == "omega_radps" and formula.holds
    (reach_rad,) = {float(n) for n in re.findall(r"0\.\d+", formula.texts["state_rate"])}
    assert -formula.values[0] * reach_rad == pytest.approx(REACH_RAD, rel=0.1)  # a lag rounds it
    assert after < MISSING < before
    words = [str(find_program("twin_run")), "--model", str(tmp_path / "better.toml")]
    for plant in ("planar", "mujoco"):
        log = tmp_path / f"{plant}.lcmlog"
        words_of_run = ["--n", "1", "--duration-s", "1", "--plant", plant, "--log", str(log)]
        subprocess.run([*words, *words_of_run], check=True, capture_output=True)
        assert log.stat().st_size > 0


def oiled(motion: np.ndarray) -> np.ndarray:
    """Turning loses with its square, as in oil."""
    turn = motion[:, 2]
    return np.column_stack([motion[:, :2], turn - 0.15 * turn * np.abs(turn)])


def test_a_form_that_is_nearly_a_gain_is_told_as_it_is(mended):
    """The base's gain takes most of a square where it is free."""
    formula, before, after = mended(oiled)
    assert formula.texts["formula"] == "p0*omega*abs(omega)"
    assert formula.values[0] == pytest.approx(-0.15, rel=0.1)
    assert after < 0.2 * before
