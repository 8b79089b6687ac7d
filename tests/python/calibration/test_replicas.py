# SPDX-License-Identifier: Apache-2.0
"""Logs that the twin itself drove, noise and all: the model that made them is right by making.

It must score one whatever the rate, the length and the drive; nothing is missing; and what is put
in besides is found.
"""

from dataclasses import replace

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import make_track
from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.compare import compare
from twinmill.model.model_file import ModelFile

NOISE = """
[noise]
sensor_m = 0.0005
sensor_rad = 0.002
drive_mps = 0.004
drive_radps = 0.03
drive_s = 0.15
drive_turn_s = 0.15
"""
DUTY = """
[base]
drive = "duty"
duty_pct = [0, 25, 50, 75, 100]
wheel_speed_mps = [0, 0.12, 0.22, 0.3, 0.36]
motor_lag_s = 0.08
control_period_s = 0.0222
"""
TWIST = """
[base]
drive = "twist"
wheels = "none"
forward_gain = 0.9
motor_lag_s = 0.15
control_period_s = 0.0222
"""
KINDS = {"duty": DUTY, "twist": TWIST}
LEGS = {
    "duty": [(1, 1, 1, 1), (-1, 1, 1, -1), (-1, 1, -1, 1), (0.5, 1, 0.5, 1), (1, 0.25, 1, 0.25)],
    "twist": [(0.3, 0, 0, 0), (0, 0.3, 0, 0), (0, 0, 1.2, 0), (0.2, 0, 0.8, 0), (0.2, -0.2, 0, 0)],
}
SIZES = (-1.0, -0.75, -0.5, 0.0, 0.5, 0.75, 1.0)
ASYMMETRY = {"asymmetry": 0.1}

pytestmark = pytest.mark.usefixtures("asked_once")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A model file of a kind of drive, with text put behind."""
    folder = tmp_path_factory.mktemp("models")

    def make(kind, extra="", noise=NOISE):
        path = folder / f"{kind}{len(extra)}.toml"
        path.write_text(KINDS[kind] + noise + extra)
        return ModelFile.load(str(path))

    return make


@pytest.fixture(scope="module")
def replica(driven):
    """A log that a model drove: legs of half a second to two, drawn at random."""

    def make(model_file, kind, rate_Hz, seconds, seed, same_clock=True):
        robot, random = driven(seconds), np.random.default_rng(seed)
        rows = []
        while len(rows) < len(robot.command_t_s):
            leg = np.array(LEGS[kind][random.integers(len(LEGS[kind]))]) * random.choice(SIZES)
            rows += [leg] * int(random.integers(22, 90))
        command = np.ascontiguousarray(rows[: len(robot.command_t_s)])
        pose_t_s = np.arange(0.1, seconds - 0.1, 1 / rate_Hz)
        count = len(pose_t_s)
        played = native.Track(
            robot.command_t_s, command, robot.battery_V, pose_t_s, np.zeros((count, 3)),
            np.zeros(count, np.int64),
        )  # fmt: skip
        pose = native.replica(model_file.model, played, seed)
        log = replace(
            robot, command_kind=kind, command=command, pose_t_s=pose_t_s, pose=pose,
            z_m=np.zeros(count), valid=np.ones(count, bool), same_clock=same_clock,
        )  # fmt: skip
        measured = Measurement.live(make_track(log))
        return replace(measured, log_name=f"{kind} {rate_Hz:g} Hz", log_sha256=f"{kind}{seed}")

    return make


@pytest.mark.parametrize(
    ("kind", "rate_Hz", "seconds"),
    [
        ("duty", 120, 30),
        ("duty", 60, 90),
        ("duty", 25, 60),
        ("twist", 100, 30),
        ("twist", 30, 90),
        ("twist", 4, 60),
    ],
)
def test_the_right_model_scores_one_at_any_rate_and_length(kind, rate_Hz, seconds, model, replica):
    right = model(kind)
    scores = [compare([replica(right, kind, rate_Hz, seconds, s)], right).score for s in (1, 2)]
    assert 0.85 <= np.mean(scores) <= 1.1
    assert min(scores) >= 0.8 and max(scores) <= 1.2


def test_a_wrong_model_scores_more_than_the_right_one_on_every_log(model, replica):
    right = model("twist")
    wrong = ModelFile.load(str(right.path))
    wrong.model.set("base.motor_lag_s", 0.05)
    for seed in range(2):
        run = replica(right, "twist", 60, 30, 10 + seed)
        assert compare([run], wrong).score > 1.3 > compare([run], right).score


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_named_where_the_model_is_right(kind, model, replica):
    right = model(kind)
    found = diagnose([replica(right, kind, 60, 60, 21)], right)
    assert not [f for f in found.answer.findings if f.certainty == "sure"]
    assert found.answer.nothing > 0.1


def with_effect(effect, values) -> str:
    """Text of an effect in a model file."""
    return f'[[effect]]\nname = "{effect}"\n' + "".join(f"{k} = {v}\n" for k, v in values.items())


@pytest.mark.parametrize(
    ("kind", "effect", "values"),
    [
        ("twist", "input_delay", {"delay_s": 0.1}),
        ("twist", "turn_asymmetry", ASYMMETRY),
        ("duty", "coasting", {"deceleration_mps2": 0.7}),
        ("duty", "marker_offset", {"x_m": -0.03, "y_m": 0.02}),
    ],
)
def test_what_was_put_in_is_found_first_with_its_size(kind, effect, values, model, replica):
    true = model(kind, with_effect(effect, values))
    found = diagnose([replica(true, kind, 60, 60, 31)], model(kind))
    first = found.answer.findings[0]
    assert first.effect == effect and first.certainty == "sure"
    for name, value in values.items():
        told, std = first.numbers[name]
        assert told == pytest.approx(value, abs=3 * std)


def test_explained_model_predicts_another_log_better(model, replica, tmp_path):
    true, plain = model("twist", with_effect("turn_asymmetry", ASYMMETRY)), model("twist")
    found = diagnose([replica(true, "twist", 60, 60, 31)], plain)
    other = [replica(true, "twist", 60, 60, 42)]
    explained = compare(other, better(found, plain, tmp_path / "m.toml", "").file).score
    assert explained < 0.7 * compare(other, plain).score
    assert explained < 1.15


def test_explain_does_not_spoil_a_right_model(model, replica, tmp_path):
    right = model("twist")
    found = diagnose([replica(right, "twist", 60, 60, 21)], right)
    other = [replica(right, "twist", 60, 60, 52)]
    explained = compare(other, better(found, right, tmp_path / "m.toml", "").file).score
    assert explained <= 1.05 * compare(other, right).score
