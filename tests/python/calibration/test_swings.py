# SPDX-License-Identifier: Apache-2.0
"""Formulas of two states, where a robot that is not the twin swings after its commands change.

The oscillators are exact filters of SciPy, of a frequency and a damping that the formula must tell.
"""

import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
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


def test_an_overshoot_is_a_dependence_on_the_past(log, one_clock_base):
    """Beside a lag of second order, which swings less; that the swing is one of time is less so."""
    answer = diagnose(load_measurements([log]), one_clock_base).answer
    assert next(iter(answer.depends_on)) == "past"
    assert not [f for f in answer.findings if f.certainty == "sure"]


def test_a_marker_that_sways_is_told_from_the_robot(swaying, run_log, one_clock_base):
    log = run_log(swaying(), 102, 60.0)
    answer = diagnose(load_measurements([log]), one_clock_base).answer
    assert answer.outside > 0.5


@pytest.mark.parametrize("lag_s", [0.05, 0.14])
def test_a_plain_lag_stays_one(lag_s, tanh_robot, run_log, one_clock_base):
    log = run_log(tanh_robot(lag_s=lag_s), 103, 60.0)
    said = said_by(["diagnose", str(log), "--model", str(one_clock_base.path)])
    assert said["rest"]["proven"] is None
