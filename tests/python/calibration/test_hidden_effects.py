# SPDX-License-Identifier: Apache-2.0
"""Logs of a plant that is not ours, with the answers beside them.

Its wheels are not written as the twin's: with nothing hidden it scores up to 1.3, and no effect is
behind that. Tolerances: three standard errors, and a tenth of the value for what the other form of
that plant may shift: its wheels, losses and noise are not written as ours are.
"""

import numpy as np
import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.add import add
from twinmill.fitting.compare import MISSING, SUSPECT, compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

FORM = 0.1


@pytest.fixture(scope="module")
def folder(data_dir):
    path = data_dir / "hidden_effects"
    if not path.is_dir():
        pytest.skip(f"no recordings at {path}")
    return path


@pytest.fixture(scope="module")
def base(folder, model_file, tmp_path_factory):
    """The base fitted on the robot as it normally is, from rough speeds."""
    rough = model_file(
        ("[0, 25, 50, 75, 100]", "[0, 12.5, 25, 37.5, 50, 75, 100]"),
        ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.05, 0.1, 0.15, 0.2, 0.28, 0.36]"),
    )
    path = tmp_path_factory.mktemp("hidden") / "fitted.toml"
    found = fit(load_measurements([folder / "calibration.lcmlog"]), rough, path, "")
    return found, ModelFile.load(str(path))


@pytest.fixture
def added(folder, base, tmp_path):
    """Held-out score and estimates by name after an effect was added for a case."""

    def run(case, effect):
        logs = load_measurements([folder / f"case_{case}.lcmlog"])
        found = add(effect, logs, base[1], out=tmp_path / "added.toml", command="")
        return found.heldout_after.score, {
            e.name: e for e in found.parameters if e.name.startswith(effect)
        }

    return run


def test_noise_of_the_log_is_the_one_told(base):
    """README: 0.3 mm, 0.1 degree; 3 mm/s, 0.03 rad/s, 0.15 s, of which a log tells 10 and 40 %."""
    noise = base[0].after.robots[0].modelled.noise
    assert noise.position.sensor == pytest.approx(0.3e-3, rel=0.03)
    assert noise.heading.sensor == pytest.approx(np.radians(0.1), rel=0.03)
    assert noise.position.drive == pytest.approx(3e-3, rel=0.1)
    assert noise.heading.drive == pytest.approx(0.03, rel=0.1)
    assert noise.position.memory_s == pytest.approx(0.15, rel=0.4)
    assert noise.heading.memory_s == pytest.approx(0.15, rel=0.4)


def test_fitted_base_is_as_good_as_the_log_can_tell(base):
    found, _ = base
    assert found.before.score > 5
    assert SUSPECT < found.after.score < MISSING


def test_dead_zone(added):
    score, found = added("a", "dead_zone")
    width = found["dead_zone.width"]
    assert score < MISSING
    assert width.value == pytest.approx(0.05, abs=3 * width.std + FORM * 0.05)


def test_a_base_of_the_same_robot_is_not_called_far_off(folder, base):
    """Its gains would take a part of the dead zone, though nothing else changed."""
    found = diagnose(load_measurements([folder / "case_a.lcmlog"]), base[1])
    assert found.answer.findings[0].effect == "dead_zone"
    assert found.answer.findings[0].certainty == "sure"


def test_motor_lag(added):
    """The README says +0.03 s; the poses show wheels that are faster by as much.

    The base's time constant is 0.12 s in the calibration log, and 0.09 s fits case b. So only the
    size is asserted.
    """
    score, found = added("b", "motor_lag")
    extra = found["motor_lag.extra_s"]
    assert score < MISSING
    assert abs(extra.value) == pytest.approx(0.03, abs=3 * extra.std + FORM * 0.03)


def test_floor_tilt(added):
    score, found = added("c", "floor_tilt")
    assert score < MISSING
    for name, drift_mps in (("x", 8e-3), ("y", 6e-3)):
        drift = found[f"floor_tilt.drift_{name}_mps"]
        assert drift.value == pytest.approx(drift_mps, abs=3 * drift.std + FORM * drift_mps)


def test_marker_offset(added):
    score, found = added("d", "marker_offset")
    x, y = found["marker_offset.x_m"], found["marker_offset.y_m"]
    error_m = 3 * max(x.std, y.std) + FORM * 6e-3
    assert score < MISSING
    assert np.hypot(x.value, y.value) == pytest.approx(6e-3, abs=error_m)


def test_nothing_hidden_needs_nothing(folder, base):
    found = compare(load_measurements([folder / "case_e.lcmlog"]), base[1])
    assert 0.85 < found.score < MISSING


def test_battery_sag(added):
    score, found = added("f", "battery_sag")
    strength = found["battery_sag.strength"]
    assert score < MISSING
    assert strength.value == pytest.approx(0.9, abs=3 * strength.std + FORM * 0.9)
