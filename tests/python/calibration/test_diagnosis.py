# SPDX-License-Identifier: Apache-2.0
"""Diagnosis of logs that another program made; the answers are in their README."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.diagnosis.ranking import rank
from twinmill.diagnosis.screen import Screened, Screening
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

TABLE = """
[base]
duty_pct = [0, 12.5, 25, 37.5, 50, 75, 100]
wheel_speed_mps = [0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4]
"""


@pytest.fixture(scope="module")
def calibrated(data_dir, tmp_path_factory):
    """The base model, fitted to the log of the robot as it normally is."""
    folder = tmp_path_factory.mktemp("diagnosis")
    (folder / "table.toml").write_text(TABLE)
    log = data_dir / "hidden_effects/calibration.lcmlog"
    parent = ModelFile.load(str(folder / "table.toml"))
    fit(load_measurements([log]), parent, folder / "base.toml", "test")
    return ModelFile.load(str(folder / "base.toml"))


@pytest.fixture(scope="module")
def case(data_dir):
    """Measurements of a case by its letter."""
    return lambda letter: load_measurements([data_dir / f"hidden_effects/case_{letter}.lcmlog"])


# Parameter, truth of the README, tolerance: a tenth for the other form of that robot's effects.
ANSWERS = {
    "a": ("dead_zone", "dead_zone.width", 0.05),
    "b": ("motor_lag", "motor_lag.extra_s", -0.03),  # the logs' lags are 0.120 and 0.090 s
    "c": ("floor_tilt", "floor_tilt.drift_x_mps", 0.008),
    "f": ("battery_sag", "battery_sag.strength", 0.9),
}


@pytest.mark.parametrize("letter", ANSWERS)
def test_the_one_hidden_effect_is_named_with_its_strength(calibrated, case, letter):
    effect, parameter, truth = ANSWERS[letter]
    found = diagnose(case(letter), calibrated)
    assert found.verdict == "effect_missing" and found.found == [effect]
    top = found.ranking[0]
    estimate = next(e for e in top.parameters if e.name == parameter)
    assert estimate.value == pytest.approx(truth, rel=0.1)
    assert top.p_value < 0.01 and top.score_heldout < 1.15
    assert not found.omnibus.significant


def test_a_marker_off_by_6_mm_is_found_though_it_hardly_matters(calibrated, case):
    found = diagnose(case("d"), calibrated)
    assert found.found == ["marker_offset"]
    offset_m = [e.value for e in found.ranking[0].parameters]
    assert np.hypot(*offset_m) == pytest.approx(0.006, rel=0.1)


def test_nothing_is_named_where_nothing_is_hidden(calibrated, case):
    found = diagnose(case("e"), calibrated)
    assert found.verdict == "model_adequate" and found.found == []


def test_what_the_catalogue_may_not_name_is_called_outside_it(calibrated, case):
    """A creep along a fixed direction of the room can be no other effect of the drive."""
    found = diagnose(case("c"), calibrated, barred=("floor_tilt", "carpet_grain", "gain_slope"))
    assert found.verdict == "outside_catalogue"
    assert [g.group for g in found.omnibus.groups] == ["heading"]


def test_explain_writes_a_model_that_predicts_the_log(calibrated, case, tmp_path):
    told = explain(case("f"), calibrated, tmp_path / "explained.toml", "test")
    assert told.after.score < 1.15
    again = ModelFile.load(str(tmp_path / "explained.toml"))
    assert again.model.effects == ["battery_sag"]
    steps = told.to_json()["steps"]
    assert [s["effect"] for s in steps] == [None, "refit", "battery_sag"]
    scores = [s["score_heldout"] for s in steps]
    assert scores == sorted(scores, reverse=True)


@pytest.mark.parametrize(("behind", "tied"), [(1.0, True), (20.0, False)])
def test_an_effect_that_can_do_all_that_another_can_is_not_named_before_it(behind, tied):
    """Four directions of noise and a trace in the first: by algebra the first alone fits as well.

    What the four fit besides the trace is noise, so the one cannot imitate all of it.
    """
    many = np.eye(4)
    left = many @ [5.0, 3.0, -3.0, 3.0]  # noise of size 3 but for the trace
    signatures = [many, many[:, :1]]
    screened = [
        Screened(SimpleNamespace(effect=name), 52.0, 1.0, s.T @ left, 20.0, 0.001)
        for name, s in zip(("many", "one"), signatures, strict=True)
    ]
    held = SimpleNamespace(over=lambda _: 1.0)
    judged = [
        SimpleNamespace(
            trial=SimpleNamespace(effects=(name,), chi2=chi2, estimates=[], held=held),
            evidence=9.0,
            p_value=0.001,
        )
        for name, chi2 in (("many", 100.0), ("one", 100.0 + behind))
    ]
    this = SimpleNamespace(
        before=SimpleNamespace(chi2=130.0),
        screening=Screening(screened, signatures, left),
        judged=judged,
        accepted=judged[0],
    )
    ranking = rank(SimpleNamespace(rounds=[this]), ["many"], 30.0, [])
    assert [r.group for r in ranking] == ([1, 1] if tied else [None, None])
