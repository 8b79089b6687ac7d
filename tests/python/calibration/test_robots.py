# SPDX-License-Identifier: Apache-2.0
"""One robot of several that is off is named, with what was planted in it; like robots are not."""

import os
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.diagnosis.outliers import _stands_out, in_words
from twinmill.experiment.rich_script import write_rich_script
from twinmill.fitting.compare import MISSING, compare, of_others
from twinmill.fitting.fit import fit
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import ParameterEstimate
from twinmill.report.diagnosis import each_robot, found_models
from twinmill_cli.diagnose import _mending

ROOT = Path(__file__).resolve().parents[3]
TWIN_RUN = os.environ.get("TWIN_RUN", str(ROOT / "build/bin/twin_run"))
ROBOTS, DURATION_S = 3, 30
REAL = """
[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
drive_mps = 0.003
drive_radps = 0.03
drive_s = 0.15
drive_turn_s = 0.15
[idiosyncrasy]
theta_a1_std = 0.02
theta_a2_std = 0.02
"""
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


def test_robots_with_gains_of_their_own_are_not_off(logged):
    found = diagnose(*logged(""))
    assert found.robots_off == ()
    assert found.found == []


WEAK_R01 = WHEELS + "[robots.R01]\nwheel_gain.fl = -0.1\n"


def test_of_two_robots_the_one_that_the_model_misses_is_odd(logged):
    """The model is the truth of R00, so that it tells which of the two is the weak one."""
    measurements, plain = logged(WEAK_R01, usual="")
    found = diagnose(measurements[:2], plain)
    assert [(r.robot_id, r.effect) for r in found.robots_off] == [(1, "wheel_gain")]
    size = {e.name: e.value for e in found.robots_off[0].parameters}
    assert size["wheel_gain.fl"] == pytest.approx(-0.1, abs=0.02)
    assert found.found == []
    words = [row[1].text for row in each_robot(found).rows]
    assert words[0] == "as the model" and "weak" in words[1]


def test_a_weak_robot_does_not_make_the_numbers_of_the_others_stale(logged):
    """The model is the truth of R00 and R02."""
    measurements, plain = logged(WEAK_R01, usual="")
    found = diagnose(measurements, plain)
    assert [r.robot_id for r in found.robots_off] == [1]
    assert found.verdict == "model_adequate"
    assert found.sentence.startswith("R01: ") and "All others: nothing" in found.sentence
    words = [row[1].text for row in each_robot(found).rows]
    assert words[::2] == ["as the model"] * 2 and "weak" in words[1]
    compared = compare(measurements, plain)
    assert compared.verdict.startswith(f"Missed: {measurements[1].label} ")
    assert "All others: as good as" in compared.verdict


def test_what_the_others_lack_is_one_sentence_with_them():
    assert of_others(3, "Missing: coasting (90 %).") == "All others lack coasting (90 %)."
    assert of_others(1, "Missing: coasting (90 %).") == "The other lacks coasting (90 %)."


def test_of_two_robots_that_the_model_misses_none_is_said_to_be_as_the_other(logged):
    """Which of two is the odd one nothing tells, so a weak one must not stand there as like it."""
    both = "[[effect]]\nname = 'motor_lag'\nextra_s = 0.15\n"
    measurements, plain = logged(both + WEAK_R01)
    found = diagnose(measurements[:2], plain)
    assert found.robots_off == ()
    table = each_robot(found)
    assert [row[1].text for row in table.rows] == ["not compared"] * 2
    assert "a log of its own" in table.note


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
    told = explain(robots, one_clock_base, out=tmp_path / "own.toml", command="test")
    (off,) = told.diagnosis.robots_off
    assert off.sentence == "R02: drives 6 % slower ahead than the others."
    common = told.diagnosis.model
    own = {e.name: e.value / common.get(e.name) for e in off.parameters}
    assert own == pytest.approx(
        {"base.forward_gain": 0.94, "base.sideways_gain": 1, "base.yaw_gain": 1}, abs=0.015
    )
    # The new file has it as that robot's own, and predicts it.
    model = ModelFile.load(str(tmp_path / "own.toml"))
    ahead = [model.model.for_robot(k).get("base.forward_gain") for k in range(4)]
    assert ahead[2] / ahead[0] == pytest.approx(0.94, abs=0.015) and ahead[0] == ahead[3]
    assert compare(robots, model).score < compare(robots, one_clock_base).score


def test_a_push_is_left_out_of_the_score_and_is_no_trait(logged):
    measurements, plain = logged("")
    (calm,) = open_measurements(measurements[2:], plain)
    assert np.count_nonzero(~calm.floor.keep) <= 0.02 * len(calm.floor.keep)
    shoved = pushed(measurements[2], 13.0, 0.3, 0.8)
    (opened,) = open_measurements([shoved], plain)
    left_out_s = opened.data.start_s[~opened.floor.keep] - shoved.track.pose_t_s[0]
    # Predictions look two seconds ahead, and the push lasts for 1.5 s.
    assert len(left_out_s) >= 4
    assert np.all((left_out_s > 11.0 - 0.3) & (left_out_s < 14.5 + 0.3))
    assert opened.score == pytest.approx(calm.score, rel=0.25)
    found = diagnose([*measurements[:2], shoved], plain)
    assert found.robots_off == () and found.found == []


def test_a_wheel_of_one_robot_is_named_beside_what_all_lack(logged):
    planted = "[[effect]]\nname = 'dead_zone'\nwidth = 0.08\n" + WHEELS
    found = diagnose(*logged(planted + "[robots.R01]\nwheel_gain.fl = -0.1\n"))
    assert found.found == ["dead_zone"]
    assert [(r.robot_id, r.effect) for r in found.robots_off] == [(1, "wheel_gain")]
    off = found.to_json()["robots_off"][0]
    assert off["score_after"] < 0.7 * off["score_before"]
    assert off["p_value"] < 0.01
    own = {e["name"]: e["value"] for e in off["parameters"]}
    # A common change of all wheels is the robot's gain, which is known to 3 %: the contrast counts.
    others = sum(own[f"wheel_gain.{w}"] for w in ("fr", "rl", "rr")) / 3
    assert own["wheel_gain.fl"] - others == pytest.approx(-0.1, abs=0.01)
    # Its report draws the robot with its own wheel beside the model as given.
    (other, own_model, _) = [model for _, model in found_models(found)]
    assert own_model.get("wheel_gain.fl") == pytest.approx(own["wheel_gain.fl"], abs=1e-9)
    assert "wheel_gain" in own_model.effects and "wheel_gain" not in other.effects
    labels = [label for label, _ in found_models(found)]
    assert labels == [
        f"with dead_zone{with_own}" for with_own in ("", " and its own wheel_gain", "")
    ]
    # In plain words, with how small a difference this log would have shown.
    assert "R01" in found.sentence and "front left wheel" in found.sentence
    assert "weak" in found.sentence and off["smallest_shown"]


def test_explain_writes_the_difference_as_that_robots_own(logged, tmp_path):
    planted = "[[effect]]\nname = 'motor_lag'\nextra_s = 0\n"
    measurements, plain = logged(planted + "[robots.R02]\nmotor_lag.extra_s = 0.06\n")
    told = explain(measurements, plain, out=tmp_path / "own.toml", command="test")
    assert [r.robot_id for r in told.diagnosis.robots_off] == [2]
    model = ModelFile.load(str(tmp_path / "own.toml"))
    lag_s = [
        model.model.for_robot(i).get("base.motor_lag_s")
        + model.model.for_robot(i).get("motor_lag.extra_s")
        for i in range(ROBOTS)
    ]
    # Each clock is the log's own, and takes up a part of a lag.
    assert lag_s == pytest.approx([0.06, 0.06, 0.12], abs=0.01)
    assert lag_s[2] - lag_s[0] == pytest.approx(0.06, abs=0.005)
    # 30 s a robot tell the floor of each cell to some tenths.
    assert compare(measurements, model).score < MISSING


def test_a_robot_of_noisier_poses_is_told_and_is_as_the_others(logged):
    """White noise of 3 mm and 17 mrad on one robot, ten times that of the sensor of all."""
    measurements, plain = logged("")
    rng = np.random.default_rng(3)
    pose = measurements[1].track.pose
    noisy = measurements[1].with_pose(pose + rng.normal(size=pose.shape) * [0.003, 0.003, 0.017])
    found = diagnose([measurements[0], noisy, measurements[2]], plain)
    assert found.robots_off == () and found.found == []
    told = [note for note in found.notes if "as noisy" in note]
    assert len(told) == 2 and all(note.startswith("R01") for note in told)


def test_lags_that_differ_as_robots_do_are_no_effect(logged, tmp_path):
    """Lags of 46, 60 and 74 ms: each robot gets its own, and nothing is said to be missing."""
    lags_s = [0.046, 0.060, 0.074]
    planted = "".join(f"[robots.R0{k}]\nmotor_lag_s = {lag}\n" for k, lag in enumerate(lags_s))
    measurements, plain = logged(planted)
    on_one_clock = [replace(m, track=replace(m.track, same_clock=True)) for m in measurements]
    told = explain(on_one_clock, plain, out=tmp_path / "own.toml", command="test")
    found = told.diagnosis
    assert found.found == [] and found.robots_off == ()
    assert found.verdict in ("model_adequate", "refit_enough")
    assert any("motor lags differ by 1" in note for note in found.notes)
    model = ModelFile.load(str(tmp_path / "own.toml")).model
    own_s = np.array([model.for_robot(k).get("base.motor_lag_s") for k in range(ROBOTS)])
    assert np.diff(own_s) == pytest.approx(np.diff(lags_s), abs=0.004)


def test_what_diagnose_prints_gives_each_robot_the_lag_that_its_score_needs(
    tanh_robot, measure, one_clock_base, tmp_path
):
    """Lags of 60 to 120 ms under a base fitted to these very logs: no one lag predicts all."""
    lags_s = [0.062, 0.076, 0.095, 0.106, 0.12]
    runs = [measure(tanh_robot(lag_s=s), 340 + k, 20.0) for k, s in enumerate(lags_s)]
    robots = [replace(m, track=replace(m.track, robot_id=k)) for k, m in enumerate(runs)]
    fit(robots, one_clock_base, tmp_path / "fitted.toml", "test")
    fitted = ModelFile.load(str(tmp_path / "fitted.toml"))
    told = explain(robots, fitted, out=tmp_path / "own.toml", command="test")
    found = told.diagnosis
    assert found.sentence.startswith("Robots differ in motor lag (0.06")
    (_, command), *_ = _mending(found, [Path("run.lcmlog")], "fitted.toml")
    assert command.startswith("twinmill explain run.lcmlog")
    # The same command, by the library: its file predicts as well as the diagnosis says.
    after = compare(robots, ModelFile.load(str(tmp_path / "own.toml"))).score
    assert after < 1.05 * found.score_refit < 0.9 * compare(robots, fitted).score
    # How late a robot of these is, no one knows better than they differ.
    assert found.late.sum_s == pytest.approx(np.mean(lags_s), abs=0.01)
    assert found.late.sum_std_s == pytest.approx(np.std(lags_s, ddof=1), rel=0.2)


def test_explain_gives_an_odd_robot_the_score_that_it_promises(
    tanh_robot, measure, one_clock_base, tmp_path
):
    """The others' lags move the base after the odd robot was judged beside it."""

    class Weak(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(duty) * (0.85, 1, 0.85, 1)

    of_kind = [tanh_robot(lag_s=s) for s in (0.11, 0.15, 0.19)]
    runs = [measure(r, 350 + k, 40.0) for k, r in enumerate([*of_kind, Weak()])]
    robots = [replace(m, track=replace(m.track, robot_id=k)) for k, m in enumerate(runs)]
    told = explain(robots, one_clock_base, out=tmp_path / "own.toml", command="test")
    (off,) = told.diagnosis.robots_off
    assert off.robot_id == 3 and told.diagnosis.sentence.startswith(off.sentence)
    found = compare(robots, ModelFile.load(str(tmp_path / "own.toml")))
    assert found.robots[3].score < 1.05 * off.score_after
    assert off.score_after < MISSING
    # What is told of it is what is in the file.
    model = ModelFile.load(str(tmp_path / "own.toml")).model.for_robot(3)
    assert {e.name: model.get(e.name) for e in off.parameters} == pytest.approx(
        {e.name: e.value for e in off.parameters}, rel=1e-4
    )


def test_no_fault_of_one_robot_is_told_where_all_differ_in_lag(tanh_robot, measure, one_clock_base):
    """For the most sluggish play had been told: the others' lags made its own no difference."""
    lags_s = [0.06, 0.1, 0.15, 0.2]
    runs = [measure(tanh_robot(lag_s=s), 360 + k, 40.0) for k, s in enumerate(lags_s)]
    robots = [replace(m, track=replace(m.track, robot_id=k)) for k, m in enumerate(runs)]
    found = diagnose(robots, one_clock_base)
    assert not [r for r in found.robots_off if r.effect != "motor_lag"]
    (lags,) = [n.values for n in found.apart.numbers if n.name == "base.motor_lag_s"]
    own_s = [lags[f"R{k:02d}"] for k in range(4) if f"R{k:02d}" in lags]
    assert own_s == pytest.approx(lags_s[: len(own_s)], abs=0.005)


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


def test_wheels_of_a_side_are_one_thing_in_words():
    def words(**gains):
        unit = {"std": 0.02, "unit": "1", "at_bound": False, "seen": True}
        wheels = [ParameterEstimate(f"wheel_gain.{w}", v, **unit) for w, v in gains.items()]
        return in_words(wheels)

    assert words(fl=-0.08, fr=0.0, rl=-0.078, rr=0.002) == "left wheels 8 % weak"
    # Speed and turning of its own hide how much each side lacks: the difference is what is told.
    assert words(fl=0.02, fr=-0.05) == "right wheels 7 % weaker than the left ones"
    assert "left" not in words(fl=0.0, fr=0.0, rl=0.0, rr=-0.07)
    # The others' common part may as well be the robot's speed: how far the one is off is told.
    odd = words(fl=-0.0965, fr=0.0257, rl=0.0306, rr=0.0302)
    assert odd == "front left wheel 13 % weaker than the others"


def test_an_effect_of_several_numbers_is_said_once():
    same = {"std": 0.01, "at_bound": False, "seen": True}
    numbers = [
        ParameterEstimate("transient_loss.loss", 0.142, unit="1", **same),
        ParameterEstimate("transient_loss.from_s", 38.0, unit="s", **same),
    ]
    assert in_words(numbers).count("slower for a while") == 1
    assert "transient_loss.from_s 38 s" in in_words(numbers)


def test_the_verdict_is_on_the_robots_that_are_alike(logged):
    """One robot is late; nothing is missing in the model of the others."""
    late = "[[effect]]\nname = 'motor_lag'\nextra_s = 0\n[robots.R02]\nmotor_lag.extra_s = 0.1\n"
    found = diagnose(*logged(late))
    assert [r.robot_id for r in found.robots_off] == [2]
    assert found.verdict in ("model_adequate", "refit_enough") and not found.findings
    assert len(found.lines) == 2 and " ".join(found.lines) == found.sentence
    assert found.lines[0].startswith("R02: ")


@pytest.mark.parametrize(("after", "far"), [(3.97, True), (1.1, False)])
def test_what_leaves_a_robot_far_from_the_others_is_not_what_it_has(after, far):
    """Slower ahead alone had been more way on diagonals, surely; that left a score of 3.97."""
    alone = [SimpleNamespace(before=SimpleNamespace(held_score=s)) for s in (1.02, 1.0, 1.05, 6.5)]
    assert _stands_out(after, alone) == far
