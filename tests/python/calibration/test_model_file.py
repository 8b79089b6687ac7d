# SPDX-License-Identifier: Apache-2.0
"""Model files that fits write: read by Python's own TOML reader, and by the twin's."""

import hashlib
import os
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from twinmill.model.child_file import Fitted, child_of
from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelError, ModelFile, write_whole
from twinmill.model.parameters import ParameterEstimate
from twinmill.predict.noise import ChannelNoise, Noise

NOISE = Noise(ChannelNoise(1e-4, 2e-3, 0.1), ChannelNoise(1e-3, 2e-2, 0.2))


@pytest.fixture
def parent(model_file):
    return model_file(extra='# my own words\n[[effect]]\nname = "dead_zone"\nwidth = 0.02\n')


@pytest.fixture
def fitted(parent):
    """Two table entries of four, the lag, and an effect."""
    model = parent.model.copy()
    model.add_effect("floor_tilt")
    values = {
        "base.wheel_speed_mps.2": (0.21, 0.002),
        "base.wheel_speed_mps.4": (0.41, 0.004),
        "base.motor_lag_s": (0.08, 0.001),
        "dead_zone.width": (0.03, 0.005),
        "floor_tilt.drift_x_mps": (0.007, 0.0007),
        "floor_tilt.drift_y_mps": (0.006, 0.0006),
    }
    for name, (value, _) in values.items():
        model.set(name, value)
    estimates = [ParameterEstimate(n, v, s, "", False, True) for n, (v, s) in values.items()]
    clock = ParameterEstimate("clock.offset_s", 0.06, 0.001, "s", False, True)
    return Fitted(model, estimates, {"run.lcmlog": "ab12"}, 4.5, 1.1, NOISE, {clock.name: clock})


@pytest.fixture
def child(parent, fitted, tmp_path):
    path = tmp_path / "child.toml"
    child_of(parent, fitted, path, "twinmill twin add").write()
    return path


@pytest.mark.parametrize("text", ["", "[robot]\nwheel_radius_m = 0.03\n"])
def test_a_model_that_says_nothing_of_its_base_is_refused(tmp_path, text):
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(ModelError, match=r"m\.toml: has no section \[base\]"):
        ModelFile.load(str(tmp_path / "m.toml"))


def test_child_holds_every_value_of_the_fit(child, parent, fitted):
    written, old = ModelFile.load(str(child)).model, parent.model
    told = {e.name: e.value for e in fitted.estimates} | {"clock.offset_s": 0.06}
    for name, value in told.items():
        assert written.get(name) == pytest.approx(value, rel=1e-5), name
    for entry in old.values():
        if entry["name"] not in told and not entry["name"].startswith("noise."):
            assert written.get(entry["name"]) == entry["value"], entry["name"]
    assert written.effects == ["dead_zone", "floor_tilt"]


def test_child_holds_what_the_log_hardly_tells_without_an_error(parent, fitted, tmp_path):
    """The score was told of a model that had it."""
    seen = [e for e in fitted.estimates if not e.name.startswith("base.")]
    child_of(parent, replace(fitted, estimates=seen), tmp_path / "child.toml", "").write()
    written = ModelFile.load(str(tmp_path / "child.toml"))
    assert written.model.get("base.wheel_speed_mps.4") == 0.41
    assert written.model.get("base.motor_lag_s") == 0.08
    assert not written.known_from_other_logs(["another"])


def test_child_says_where_it_comes_from(child, parent):
    data = tomllib.loads(child.read_text())
    assert data["parent"] == hashlib.sha256(parent.path.read_bytes()).hexdigest()
    assert data["created_by"] == "twinmill twin add"
    assert data["fit"] == {"logs": ["run.lcmlog"], "score_before": 4.5, "score_after": 1.1}
    assert data["noise"]["drive_mps"] == 2e-3 and data["noise"]["drive_turn_s"] == 0.2
    assert "# my own words" in child.read_text()


def test_child_records_standard_errors_beside_the_values(child):
    data = tomllib.loads(child.read_text())
    assert data["base"]["std"]["motor_lag_s"] == 0.001
    assert data["clock"]["std"] == {"offset_s": 0.001}
    tilt = data["effect"][1]
    assert tilt["std"] == {"drift_x_mps": 0.0007, "drift_y_mps": 0.0006}
    assert (tilt["error_before"], tilt["error_after"]) == (4.5, 1.1)
    assert "run.lcmlog" in tilt["fitted_on"]


def test_standard_errors_of_a_table_stand_at_their_own_speeds(child):
    data = tomllib.loads(child.read_text())
    std = data["base"]["std"]["wheel_speed_mps"]
    assert len(std) == len(data["base"]["wheel_speed_mps"]) == 5
    assert std[2] == 0.002 and std[4] == 0.004
    told = ModelFile.load(str(child)).known_from_other_logs(["another"])
    assert set(told) == {"base.wheel_speed_mps.2", "base.wheel_speed_mps.4", "base.motor_lag_s"}
    assert not ModelFile.load(str(child)).known_from_other_logs(["ab12"])


def test_parent_stays_as_it_is(parent, fitted, tmp_path):
    before = parent.path.read_bytes()
    child_of(parent, fitted, tmp_path / "child.toml", "").write()
    assert parent.path.read_bytes() == before
    assert sorted(os.listdir(tmp_path)) == ["child.toml"]


def test_grandchild_names_its_parent_and_keeps_its_effects_errors(child, fitted, tmp_path):
    file = ModelFile.load(str(child))
    path = tmp_path / "grandchild.toml"
    again = replace(fitted, model=file.model.copy(), score_before=1.1, score_after=1.0)
    child_of(file, again, path, "twinmill fit").write()
    data = tomllib.loads(path.read_text())
    assert data["parent"] == hashlib.sha256(child.read_bytes()).hexdigest()
    assert data["effect"][1]["error_after"] == 1.1
    assert ModelFile.load(str(path)).model.effects == ["dead_zone", "floor_tilt"]


def test_unknown_keys_are_refused_with_the_nearest_known_one(model_file):
    with pytest.raises(ModelError, match="motor_lag_s"):
        model_file(("motor_lag_s", "moter_lag_s"))
    with pytest.raises(ModelError, match="dead_zone"):
        model_file(extra='[[effect]]\nname = "ded_zone"\n')


@pytest.mark.parametrize("place", ["missing/child.toml", "file/child.toml", "folder"])
def test_a_place_that_cannot_be_written_is_told_in_one_sentence(place, tmp_path):
    (tmp_path / "file").write_text("I was here")
    (tmp_path / "folder").mkdir()
    with pytest.raises(ModelError, match=rf"{place}: (cannot be written: |is a folder; ).*\."):
        write_whole(tmp_path / place, "text")
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["file", "folder"]


def test_an_old_file_survives_a_write_that_fails(tmp_path, monkeypatch):
    path = tmp_path / "child.toml"
    path.write_text("old")

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(ModelError, match="No space left"):
        write_whole(path, "new")
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["child.toml"]


def test_a_covariance_is_kept_and_a_later_fit_replaces_its_own_part(parent, fitted, tmp_path):
    """The block of quantities that a later fit left alone stays; between both nothing is known."""
    first = Covariance(("base.motor_lag_s", "dead_zone.width"), np.array([[4.0, 1], [1, 9]]) * 1e-6)
    then = Covariance(
        ("dead_zone.width", "floor_tilt.drift_x_mps"), np.array([[16.0, -2], [-2, 1]])
    )
    path = tmp_path / "once.toml"
    child_of(parent, replace(fitted, covariance=first), path, "").write()
    once = ModelFile.load(str(path))
    assert once.covariance.names == first.names
    np.testing.assert_allclose(once.covariance.values, first.values, rtol=1e-5)
    child_of(once, replace(fitted, covariance=then), tmp_path / "twice.toml", "").write()
    twice = ModelFile.load(str(tmp_path / "twice.toml")).covariance
    assert twice.names == ("base.motor_lag_s", *then.names)
    np.testing.assert_allclose(twice.values, [[4e-6, 0, 0], [0, 16, -2], [0, -2, 1]], rtol=1e-5)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('names = ["a"]\nvalues = [[1, 2]]', "1 rows of 1 numbers"),
        ('names = ["a"]\nvalues = [["x"]]', "rows of numbers"),
        ('names = ["a", "b"]\nvalues = [[1, 0.5], [0.2, 1]]', "symmetric"),
        ('names = ["a", "b"]\nvalues = [[1, 2], [2, 1]]', "negative variance"),
    ],
)
def test_what_is_no_covariance_is_said_in_one_sentence(text, why, model_file):
    file = model_file(extra=f"[fit.covariance]\n{text}\n")
    with pytest.raises(ModelError, match=why):
        _ = file.covariance
