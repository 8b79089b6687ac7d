# SPDX-License-Identifier: Apache-2.0
"""Formulas of two states, where a robot that is not the twin swings after its commands change.

The oscillators are exact filters of SciPy, of a frequency and a damping that the formula must tell.
"""

import io
import json
import re
import subprocess
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.fitting.compare import compare
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_names
from twinmill.programs import find_program
from twinmill_cli.main import run

STEP_S = 1 / 480  # of the robot
HZ, DAMPING, PART = 1.3, 0.15, 0.5


def swung(speeds: np.ndarray, hz: float, damping: float, lead: float = 0.0) -> np.ndarray:
    """(K, n) speeds as an oscillator follows them, held over each step; `lead` of its damper."""
    w = 2 * np.pi * hz
    ahead = np.trim_zeros([lead * 2 * damping * w, w**2])
    system = (ahead, [1, 2 * damping * w, w**2])
    ahead, back, _ = cont2discrete(system, STEP_S)
    return lfilter(ahead.ravel(), back, speeds, axis=0)


@pytest.fixture(scope="module")
def overshooting(tanh_robot) -> type:
    """Half of the speed of all wheels swings."""

    class Overshooting(tanh_robot):
        def wheels_mps(self, duty):
            speeds = super().wheels_mps(duty)
            return speeds + PART * (swung(speeds, HZ, DAMPING) - speeds)

    return Overshooting


@pytest.fixture(scope="module")
def swaying(tanh_robot) -> type:
    """A marker on a mast: it lags behind in part when the robot speeds up, and swings back."""

    class Swaying(tanh_robot):
        def poses(self, duty, seed):
            seen = super().poses(duty, seed)
            step = np.diff(seen[:, :2], axis=0, prepend=seen[:1, :2])
            seen[:, :2] += 0.4 * np.cumsum(swung(step, HZ, 0.06, lead=1.0) - step, axis=0)
            return seen

    return Swaying


def said_by(words: list[str]) -> dict:
    """The JSON that a command prints."""
    said = io.StringIO()
    with redirect_stdout(said):
        run([*words, "--json"])
    return json.loads(said.getvalue())


@pytest.fixture(scope="module")
def log(overshooting, run_log) -> Path:
    """Drive of the robot that overshoots."""
    return run_log(overshooting(), 101, 60.0)


@pytest.fixture(scope="module")
def explained(log, one_clock_base, tmp_path_factory) -> dict:
    """JSON of an explanation of that drive, as several robots are explained."""
    out = tmp_path_factory.mktemp("explained") / "swings.toml"
    return explain(load_measurements([log]), one_clock_base, out=out, command="").to_json()


def constants(numbers: list[dict]) -> list[dict]:
    """The rate and the damping."""
    return [n for n in numbers if not n["name"]]


def test_an_overshoot_is_proven_with_its_frequency_and_damping(explained):
    proven = explained["rest"]["proven"]
    assert explained["verdict"] == "outside_catalogue"
    assert proven["equation"]["adds_to"] == "rim_mps" and proven["equation"]["state_rate"] == "r"
    assert "an overshoot of the speed loop or a spring (all wheels)" in proven["like"]
    rate, damping = (n["value"] for n in constants(proven["numbers"]))
    assert rate == pytest.approx(2 * np.pi * HZ, rel=0.03)
    assert damping == pytest.approx(DAMPING, rel=0.2)


def test_by_probabilities_it_is_an_oscillator_of_that_frequency(
    log, overshooting, run_log, one_clock_base, tmp_path
):
    """The frequency is one of a grid, of which each is a seventh more than the last."""
    out = tmp_path / "swings.toml"
    words = ["explain", str(log), "--model", str(one_clock_base.path), "-o", str(out)]
    proven = said_by(words)["rest"]["proven"]
    assert proven["equation"]["adds_to"] == "rim_mps" and proven["equation"]["state_rate"] == "r"
    (rate,) = {float(n) for n in re.findall(r"([\d.]+)\*\1\*", proven["equation"]["second_rate"])}
    assert rate == pytest.approx(2 * np.pi * HZ, rel=1 / 7)
    other = [load_measurements([run_log(overshooting(), 77, 60.0)])[0]]
    with_it = compare(other, ModelFile.load(str(out))).score
    assert with_it < 1.3 < 2 < compare(other, one_clock_base).score


def test_explain_tunes_it_by_the_plant(explained):
    part, rate, damping = explained["formula"]["numbers"]
    assert explained["formula"]["kept"]
    assert part["value"] == pytest.approx(PART, rel=0.06)
    assert rate["value"] == pytest.approx(2 * np.pi * HZ, rel=0.01)
    assert damping["value"] == pytest.approx(DAMPING, rel=0.1)
    assert all(n["low"] < n["value"] < n["high"] for n in (part, rate, damping))


def test_its_part_is_known_no_better_than_with_its_constants(explained, log, tmp_path):
    """Among variances the marginal one is the larger; in the model file the constants are text."""
    words = ["fit", str(log), "--model", explained["model"], "-o", str(tmp_path / "again.toml")]
    beside_text = {p["name"]: p["std"] for p in said_by(words)["parameters"]}["equation.p0"]
    written = ModelFile.load(explained["model"]).effect_stds["equation.p0"]
    told = explained["formula"]["numbers"][0]
    assert told["high"] - told["value"] == pytest.approx(1.96 * written, rel=0.01)
    assert written > 1.4 * beside_text


def test_its_model_predicts_another_drive(explained, overshooting, run_log, one_clock_base):
    other = [load_measurements([run_log(overshooting(), 77, 60.0)])[0]]
    with_it = compare(other, ModelFile.load(explained["model"])).score
    assert with_it < 1.2 < compare(other, one_clock_base).score


def test_its_model_moves_on_both_plants(explained, tmp_path):
    assert "equation" in effect_names(ModelFile.load(explained["model"]).model)
    words = [str(find_program("twin_run")), "--model", explained["model"], "--n", "1"]
    for plant in ("planar", "mujoco"):
        log = tmp_path / f"{plant}.lcmlog"
        rest = ["--duration-s", "1", "--json", "--plant", plant, "--log", str(log)]
        subprocess.run([*words, *rest], check=True)
        assert log.stat().st_size > 0


def test_a_marker_that_sways_is_told_from_the_robot(swaying, run_log, one_clock_base):
    log = run_log(swaying(), 102, 60.0)
    proven = diagnose(load_measurements([log]), one_clock_base).to_json()["rest"]["proven"]
    assert proven["equation"]["adds_to"] == "room_mps" and "sways" in proven["like"]
    rate, damping = (n["value"] for n in constants(proven["numbers"]))
    assert rate == pytest.approx(2 * np.pi * HZ, rel=0.03) and damping < 0.1
    along = [n["value"] for n in proven["numbers"] if n["name"]]
    assert along == pytest.approx([0.4, 0.4], rel=0.15)


@pytest.mark.parametrize("lag_s", [0.05, 0.14])
def test_a_plain_lag_stays_one(lag_s, tanh_robot, run_log, one_clock_base):
    log = run_log(tanh_robot(lag_s=lag_s), 103, 60.0)
    said = said_by(["diagnose", str(log), "--model", str(one_clock_base.path)])
    assert said["rest"]["proven"] is None
