# SPDX-License-Identifier: Apache-2.0
"""One robot of several that is off is named, with what was planted in it; like robots are not."""

import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.better_fleet import better_of_fleet
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.fleet import REFIT, Differs
from twinmill.experiment.rich_script import write_rich_script
from twinmill.fitting.compare import MISSING, compare
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.report.judged import sentence, to_json
from twinmill.report.robot_words import in_words

ROOT = Path(__file__).resolve().parents[3]
TWIN_RUN = os.environ.get("TWIN_RUN", str(ROOT / "build/bin/twin_run"))
ROBOTS, DURATION_S = 3, 30
NOISE = """
[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
drive_mps = 0.003
drive_radps = 0.03
drive_s = 0.15
drive_turn_s = 0.15
"""
REAL = f"{NOISE}[idiosyncrasy]\ntheta_a1_std = 0.02\ntheta_a2_std = 0.02\n"
WHEELS = "[[effect]]\nname = 'wheel_gain'\nfl = 0\nfr = 0\nrl = 0\nrr = 0\n"


@pytest.fixture
def logged(tmp_path, model_text):
    """Measurements of robots that a model with planted effects drives, and the plain model."""

    def make(planted: str, seed: int = 5, usual: str = REAL):
        script, model, log = (tmp_path / n for n in ("s.csv", "real.toml", "run.lcmlog"))
        write_rich_script(script, DURATION_S, 3)
        plain_text = model_text("plain")
        model.write_text(plain_text + usual + planted)
        plain = tmp_path / "plain.toml"
        plain.write_text(plain_text)
        command = [TWIN_RUN, "--plant", "planar", "--model", model, "--n", ROBOTS, "--seed", seed]
        command += ["--script", script, "--spread-m", 6, "--duration-s", DURATION_S, "--log", log]
        command.append("--force")
        subprocess.run([str(c) for c in command], check=True, capture_output=True)
        return load_measurements([log]), ModelFile.load(str(plain))

    return make


def off(found) -> list[tuple[int, str]]:
    return [(one.robot_id, one.name) for one in found.differs if one.is_effect or one.name == REFIT]


def named(found) -> list[str]:
    return [f.effect for f in found.answer.findings if f.certainty == "sure"]


def better(found, model, path):
    return better_of_fleet(found, model, path, command="test").file


def test_robots_with_gains_of_their_own_are_not_off(logged):
    """They scatter by 2 %, as the model says."""
    found = diagnose(*logged(""))
    assert off(found) == [] and named(found) == []
    assert found.answer.verdict == "model_adequate"


WEAK_R01 = WHEELS + "[robots.R01]\nwheel_gain.fl = -0.1\n"


def contrast(numbers: dict[str, tuple[float, float]], wheel: str) -> float:
    """A common change of all wheels is the robot's own speed: the difference counts."""
    gains = {name.split(".")[1]: value for name, (value, _) in numbers.items()}
    return gains.pop(wheel) - sum(gains.values()) / 3


def test_of_two_robots_the_one_that_the_model_misses_is_odd(logged):
    """The model is the truth of R00, so that it tells which of the two is the weak one."""
    measurements, plain = logged(WEAK_R01, usual=NOISE)
    found = diagnose(measurements[:2], plain)
    assert off(found) == [(1, "wheel_gain")]
    assert contrast(found.differs[0].numbers, "fl") == pytest.approx(-0.1, abs=0.02)
    assert named(found) == []


def test_a_weak_robot_does_not_make_the_numbers_of_the_others_stale(logged):
    """The model is the truth of R00 and R02."""
    measurements, plain = logged(WEAK_R01, usual=NOISE)
    found = diagnose(measurements, plain)
    assert off(found) == [(1, "wheel_gain")]
    assert found.answer.verdict == "model_adequate"
    told = sentence(found)
    assert (
        told.startswith("R01: front left wheel 1")
        and "Nothing is missing that all robots lack" in told
    )
    compared = compare(measurements, plain)
    assert compared.verdict.startswith(f"Missed: {measurements[1].label} ")
    assert "All others: as good as" in compared.verdict


def pushed(measurement, at_s, move_m, turn_rad):
    """The measurement of a robot that somebody shoved and turned within 1.5 s."""
    track = measurement.track
    t_s, pose = track.pose_t_s - track.pose_t_s[0] - at_s, track.pose.copy()
    share = np.clip(t_s / 1.5, 0, 1) ** 2 * (3 - 2 * np.clip(t_s / 1.5, 0, 1))
    begin, after = pose[np.searchsorted(t_s, 0)].copy(), t_s >= 0
    way = (pose[:, :2] - begin[:2]) @ [1, 1j] * np.exp(1j * turn_rad * share) + move_m * share
    pose[after, :2] = begin[:2] + np.column_stack([way.real, way.imag])[after]
    pose[:, 2] += turn_rad * share
    return measurement.with_pose(pose)


def test_a_robot_that_is_slower_ahead_alone_is_told_by_that_axis(
    tanh_robot, measure, one_clock_base, tmp_path
):
    class Slower(tanh_robot):
        def hindered(self, motion):
            return motion * (0.94, 1, 1)

    robots = [
        replace(own := measure(robot, 380 + k, 30.0), track=replace(own.track, robot_id=k))
        for k, robot in enumerate((tanh_robot(), tanh_robot(), Slower(), tanh_robot()))
    ]
    found = diagnose(robots, one_clock_base)
    assert off(found) == [(2, REFIT)]
    assert "R02: drives 6 % slower ahead than the model" in sentence(found)
    ((name, (value, std)),) = found.differs[0].numbers.items()
    assert name == "base.forward_gain" and abs(value - 0.94) < max(3 * std, 0.015)
    # The new file has speeds of that robot's own, and predicts it better.
    model = better(found, one_clock_base, tmp_path / "own.toml")
    own = [model.model.for_robot(k).get("theta_a1") for k in range(4)]
    assert own[2] < 1 and own[0] == own[1] == own[3] == 1
    assert compare(robots, model).score < compare(robots, one_clock_base).score


def test_a_push_is_left_out_of_the_score_and_is_no_trait(logged):
    measurements, plain = logged("")
    (calm,) = open_measurements(measurements[2:], plain)
    assert np.count_nonzero(~calm.floor.keep) <= 0.02 * len(calm.floor.keep)
    shoved = pushed(measurements[2], 13.0, 0.3, 0.8)
    (opened,) = open_measurements([shoved], plain)
    left_out_s = opened.data.start_s[~opened.floor.keep] - shoved.track.pose_t_s[0]
    # Predictions look two seconds ahead; the push lasts for 1.5 s, moments for half seconds.
    assert len(left_out_s) >= 4
    assert np.all((left_out_s > 11.0 - 0.3) & (left_out_s < 14.5 + 0.6))
    assert opened.score == pytest.approx(calm.score, rel=0.25)
    found = diagnose([*measurements[:2], shoved], plain)
    assert off(found) == [] and named(found) == []


def test_a_wheel_of_one_robot_is_named_beside_what_all_lack(logged, tmp_path):
    planted = "[[effect]]\nname = 'dead_zone'\nwidth = 0.08\n" + WHEELS
    measurements, plain = logged(planted + "[robots.R01]\nwheel_gain.fl = -0.1\n")
    found = diagnose(measurements, plain)
    assert named(found) == ["dead_zone"]
    assert off(found) == [(1, "wheel_gain")]
    told = to_json(found)["robots_off"][0]
    assert told["score_after"] < 0.7 * told["score_before"]
    own = {e["name"]: (e["value"], e["std"]) for e in told["parameters"]}
    assert contrast(own, "fl") == pytest.approx(-0.1, abs=0.02)
    assert "front left wheel" in told["sentence"] and "weak" in told["sentence"]
    # The new file has both, the wheel as that robot's own, and predicts all robots.
    model = better(found, plain, tmp_path / "own.toml")
    assert model.model.get("dead_zone.width") == pytest.approx(0.08, abs=0.01)
    gains = [model.model.for_robot(k).get("wheel_gain.fl") for k in range(ROBOTS)]
    assert gains[1] < -0.05 and gains[0] == gains[2] == 0.0
    assert compare(measurements, model).score < MISSING


def test_a_late_robot_is_told_and_the_verdict_is_on_the_others(logged, tmp_path):
    late = "[[effect]]\nname = 'motor_lag'\nextra_s = 0\n[robots.R02]\nmotor_lag.extra_s = 0.1\n"
    measurements, plain = logged(late)
    found = diagnose(measurements, plain)
    assert [one.robot_id for one in found.differs] == [2]
    assert found.answer.verdict in ("model_adequate", "refit_enough") and not named(found)
    assert sentence(found).startswith("R02: ")
    model = better(found, plain, tmp_path / "own.toml")
    lag_s = [
        model.model.for_robot(i).get("base.motor_lag_s")
        + model.model.for_robot(i).get("motor_lag.extra_s")
        for i in range(ROBOTS)
    ]
    assert lag_s[2] - lag_s[0] == pytest.approx(0.1, abs=0.015)


def test_a_robot_of_noisier_poses_is_as_the_others(logged):
    """White noise of 3 mm and 17 mrad on one robot, ten times that of the sensor of all."""
    measurements, plain = logged("")
    rng = np.random.default_rng(3)
    pose = measurements[1].track.pose
    noisy = measurements[1].with_pose(pose + rng.normal(size=pose.shape) * [0.003, 0.003, 0.017])
    found = diagnose([measurements[0], noisy, measurements[2]], plain)
    assert off(found) == [] and named(found) == []


def test_a_robot_of_one_command_takes_the_clock_of_the_others(tanh_robot, measure, model_file):
    robot = tanh_robot(offset_s=0.06)
    lively = measure(robot, 1, 30.0)
    circling = measure(robot, 2, script_pct=np.tile([50, 100, 50, 100], (1440, 1)))
    circling = replace(circling, track=mute(circling.track))
    (alone,) = open_measurements([circling], model_file())
    assert alone.data is None and "never change" in alone.floor.reason
    together = [lively, replace(circling, log_sha256=lively.log_sha256)]
    first, second = open_measurements(together, model_file())
    own, taken = (o.model.get("clock.offset_s") for o in (first, second))
    # The guessed lag is 0.04 s too short, of which the clock takes up what it can.
    assert taken == own and 0.055 < own < 0.105
    assert "clock" in second.measurement.warnings[-1]


def test_a_robot_that_stands_is_no_hindrance_to_what_others_tell(tanh_robot, measure, model_file):
    robot = tanh_robot(offset_s=0.06)
    lively = measure(robot, 1, 30.0)
    still = measure(robot, 2, script_pct=np.zeros((1440, 4)))
    alone = compare([lively], model_file())
    for order in ([lively, still], [still, lively]):
        both = compare(order, model_file())
        assert both.score == alone.score
        assert any("commands never change" in w for w in both.warnings)


def test_what_is_said_of_all_robots_of_a_log_is_said_once(tanh_robot, measure, model_file):
    robots = [measure(tanh_robot(offset_s=0.06), seed, 30.0) for seed in (1, 2)]
    told = [
        replace(m, warnings=["frames were lost.", f"{k} was late."]) for k, m in enumerate(robots)
    ]
    assert compare(told, model_file()).warnings == [
        f"{told[0].log_name}: frames were lost.",
        *(f"{m.label}: {k} was late." for k, m in enumerate(told)),
    ]


def mute(track):
    """The track without the rests at its ends."""
    return replace(track, command=np.tile(track.command[100], (len(track.command), 1)))


def test_wheels_are_told_by_the_group_that_is_weaker():
    def words(**gains):
        numbers = {f"wheel_gain.{wheel}": (v, 0.01) for wheel, v in gains.items()}
        return in_words(Differs(3, "wheel_gain", 0.99, numbers, (), True, (2.0, 1.0), 1.0))

    assert words(fl=-0.08, fr=0.0, rl=-0.08, rr=0.0) == "left wheels 8 % weaker than the right ones"
    # Speed of its own hides how much each side lacks: the difference is what is told.
    assert words(fl=0.02, fr=-0.05, rl=0.02, rr=-0.05).startswith("right wheels 7 % weaker")
    assert words(fl=0.0, fr=0.0, rl=0.0, rr=-0.07).startswith("rear right wheel 7 % weaker")
    odd = words(fl=-0.0965, fr=0.0257, rl=0.0306, rr=0.0302)
    assert odd == "front left wheel 13 % weaker than the others"
