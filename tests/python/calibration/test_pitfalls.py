# SPDX-License-Identifier: Apache-2.0
"""Traps for a diagnosis, each with a robot that is not the twin or with algebra."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from twinmill.diagnosis import doubts, moments
from twinmill.diagnosis.acceptance import proven
from twinmill.diagnosis.diagnose import diagnose, first_state
from twinmill.diagnosis.doubts import (
    _faster,
    _wanders,
    acted_on,
    beside_more,
    beside_stale,
    instead_in_family,
    instead_over_time,
    of_another_form,
    of_many,
    of_no_right_model,
    undone,
)
from twinmill.diagnosis.explain import explain
from twinmill.diagnosis.finding import Finding
from twinmill.diagnosis.moments import Events, _events
from twinmill.diagnosis.rest import Rest
from twinmill.diagnosis.screening import screen
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT, cross_validate
from twinmill.diagnosis.trials import fitted as fitted_state
from twinmill.fitting.add import add
from twinmill.fitting.compare import MISSING, compare
from twinmill.fitting.fit import base_names, fit
from twinmill.fitting.opening import open_measurements
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    ParameterEstimate,
    base_parameters,
    catalogue,
    catalogue_of,
    effect_parameters,
)
from twinmill.predict.datasets import Trajectory
from twinmill.report.diagnosis import each_robot


@pytest.fixture(scope="module")
def fitted(tanh_robot, measure, model_file, tmp_path_factory) -> ModelFile:
    """The base fitted to a log of the robot as it is, on clocks that later logs share."""
    path = tmp_path_factory.mktemp("pitfalls") / "fitted.toml"
    fit([measure(tanh_robot(), 1, 40.0)], model_file(), path, "")
    return ModelFile.load(str(path))


@pytest.fixture(scope="module")
def on_own_clock(fitted, tmp_path_factory) -> ModelFile:
    """Model without the log's word on the clocks."""
    text = Path(fitted.path).read_text()
    path = tmp_path_factory.mktemp("own_clock") / "fitted.toml"
    path.write_text(text[: text.index("[clock]")] + text[text.index("[fit]") :])
    return ModelFile.load(str(path))


KEPT = np.exp(-1 / 120 / 0.04)  # of a filter of 40 ms at 120 Hz
NOTHING_LEFT = Rest(0.0, False, [])
FLEXIBLE = "p0*sin(7*theta) + p1*cos(7*theta) + p2*sin(5*theta) + p3*cos(5*theta)"


def test_a_flexible_formula_wins_where_it_is_fitted_and_loses_where_it_is_not(
    tanh_robot, measure, fitted
):
    """Nothing is hidden. Wilks 1938: needless parameters lower the cost where they are fitted.

    A fit to some parts is as far off as chance takes it, so that the others are told worse.
    """
    gains, losses = [], []
    for seed in range(5):
        (opened,) = open_measurements([measure(tanh_robot(), 200 + seed, 20.0)], fitted)
        base = base_parameters(opened.model, base_names(opened.model, [opened], ()))
        poor = ScoreFit([opened.data], [opened.model], base).fit()
        richer = poor.models[0].copy()
        richer.add_effect("equation", {"adds_to": "vx_mps", "formula": FLEXIBLE})
        more = [p.at(richer.get(p.name)) for p in base] + effect_parameters(richer, "equation")
        rich = ScoreFit([opened.data], [richer], more).fit()
        gains.append(poor.scores[0] - rich.scores[0])
        losses.append(rich.held_scores[0] - poor.held_scores[0])
    assert min(gains) > 0
    assert np.mean(losses) > 0


def test_stale_gains_are_no_missing_effect(tanh_robot, measure, fitted):
    """Another battery and another floor: all speeds and turns are lower, nothing is new."""
    robot = tanh_robot()
    tired = replace(robot, top_mps=0.92 * robot.top_mps, yaw=0.9 * robot.yaw)
    found = diagnose([measure(tired, 8, 40.0)], fitted)
    assert found.verdict == "refit_enough" and found.found == []
    assert found.score_refit < 0.8 * found.before.score


@pytest.mark.parametrize("times", [0.45, 2.2])
def test_quite_another_speed_is_no_missing_effect(tanh_robot, measure, fitted, model_file, times):
    """So far off that poses 2 s ahead say little of which way is nearer.

    Nothing is new to a fitted model; the lag of the data sheet is not the robot's either.
    """
    robot = tanh_robot()
    run = measure(replace(robot, top_mps=times * robot.top_mps), 8, 40.0)
    found = diagnose([run], fitted)
    assert "numbers were stale" in found.sentence and found.found == []
    assert found.score_refit < 0.05 * found.before.score
    stale, *others = diagnose([run], model_file()).findings
    assert stale.effect == REFIT and stale.share > 0.99
    assert {f.effect for f in others} <= {"motor_lag"}


@pytest.mark.parametrize("times", [1.0, 2.0])
def test_wheels_that_stand_at_small_duties_and_go_as_usual_above(
    tanh_robot, measure, fitted, times
):
    """Duties are 25, 50, 75 and 100 %: the edge is told to lie between 50 and 75 %.

    A robot that is twice as fast besides is said to be.
    """

    class Sticks(tanh_robot):
        def speed_mps(self, duty):
            return np.where(np.abs(duty) > 0.6, super().speed_mps(duty), 0.0)

    robot = Sticks()
    run = measure(replace(robot, top_mps=times * robot.top_mps), 4, 60.0)
    found = diagnose([run], fitted)
    assert ("numbers were stale" in found.sentence) == (times > 1)
    first, *others = found.findings
    assert found.verdict == "effect_missing" and first.effect == "stiction"
    assert first.share > 0.98 and all(f.certainty == "doubtful" for f in others)
    (below,) = first.parameters
    assert 0.5 < below.value < 0.75


DELAY_S, MORE_LAG_S = 0.03, 0.05
EULER_S = 1 / 480


@pytest.fixture(scope="module")
def late(tanh_robot, measure):
    """Poses that come 30 ms later, of wheels that are slower by 50 ms."""
    robot = tanh_robot()
    return measure(replace(robot, offset_s=DELAY_S, lag_s=robot.lag_s + MORE_LAG_S), 10, 40.0)


@pytest.fixture(scope="module")
def lateness(late, fitted):
    """Verdict where the clocks are those of the log that the base was fitted to."""
    return diagnose([late], fitted)


def test_on_the_clocks_of_a_calibration_log_a_shift_in_time_is_a_delay(lateness):
    """T - d as a delayed command, or as a clock that is off: the same in every pose."""
    told = lateness.to_json()
    assert told["verdict"] == "effect_missing"
    assert set(told["found"]) == {"motor_lag", "input_delay"}
    delay = next(e for f in lateness.findings for e in f.parameters if e.name.startswith("input_d"))
    assert delay.value == pytest.approx(DELAY_S, abs=3 * delay.std + 2 * EULER_S)


def test_sum_of_delay_and_lag_is_told_beside_its_parts(lateness, tanh_robot):
    late = lateness.late
    truth_s = tanh_robot().lag_s + MORE_LAG_S + DELAY_S
    assert late.sum_s == pytest.approx(truth_s, abs=2 * late.sum_std_s + 2 * EULER_S)
    assert late.lag_s is None  # in so short a log a second pole may stand for the delay
    named = {e.name: e for f in lateness.findings for e in f.parameters}
    # What is reported of the lag is what it is beside the delay, not before that was found.
    lag = named["motor_lag.extra_s"]
    assert lag.value == pytest.approx(MORE_LAG_S, abs=2 * lag.std + EULER_S)


def test_of_many_predictions_every_third_start_tells_the_same(late, fitted, monkeypatch):
    """Predictions of 2 s from starts 0.25 s apart overlap."""
    few = replace(SETTINGS, starts=len(Trajectory.of(late).keep) // 3 + 1)
    monkeypatch.setattr("twinmill.diagnosis.diagnose.SETTINGS", few)
    found = diagnose([late], fitted)
    assert len(found.search.last.fit.datasets[0].keep) < 60 < len(found.opened[0].data.keep)
    named = {e.name: e for f in found.findings for e in f.parameters}
    lag, delay_s = named["motor_lag.extra_s"], named["input_delay.delay_s"].value
    assert lag.value == pytest.approx(MORE_LAG_S, abs=3 * lag.std)
    assert lag.value + delay_s == pytest.approx(MORE_LAG_S + DELAY_S, abs=0.01)


def test_on_a_clock_of_its_own_a_log_tells_no_delay_and_says_why(late, on_own_clock):
    found = diagnose([late], on_own_clock)
    assert "motor_lag" in found.found
    assert not {"input_delay", "clock_offset"} & set(found.found)
    hidden = dict(found.not_identifiable)
    assert "a delay cannot be told from the offset" in hidden["input_delay"]
    assert "calibration log on the same clocks" in hidden["input_delay"]
    assert not found.late.parted and found.late.delay_s is None


def test_a_clock_that_is_declared_one_names_the_delay(tanh_robot, measure, on_own_clock):
    """The robot is 80 ms late, in a log that says that one clock stamped all."""
    run = measure(replace(tanh_robot(), offset_s=0.08), 10, 40.0)
    declared = replace(run, track=replace(run.track, same_clock=True))
    found = diagnose([declared], on_own_clock)
    assert "input_delay" in found.found and "clock_offset" not in found.found
    (delay,) = (e for f in found.findings for e in f.parameters if e.name.startswith("input_delay"))
    assert delay.value == pytest.approx(0.08, abs=2 * delay.std + EULER_S)
    assert found.late.parted


def test_a_delay_of_half_a_second_is_found(tanh_robot, measure, on_own_clock):
    """Beyond any network, as cameras on another floor have it."""
    run = measure(replace(tanh_robot(), offset_s=0.5), 16, 40.0)
    for same in (False, True):
        own = replace(run, track=replace(run.track, same_clock=same))
        (opened,) = open_measurements([own], on_own_clock)
        if not same:
            assert opened.model.get("clock.offset_s") == pytest.approx(0.5, abs=0.01)
            assert opened.score < 1.2
        else:
            assert opened.floor.lateness_s == pytest.approx(0.5 + tanh_robot().lag_s, abs=0.03)
            assert opened.score > 3


def test_an_estimate_at_its_bound_is_said_to_be_doubtful(tanh_robot, measure, fitted):
    """The robot rolls on with 0.02 m/s^2; the catalogue's coasting ends at 0.05."""
    found = diagnose([measure(tanh_robot(coast_mps2=0.02), 13, 90.0)], fitted)
    assert "coasting" in found.found
    (doubt,) = (f for f in found.findings if f.effect == "coasting")
    drag = next(e for e in doubt.parameters if e.name == "coasting.deceleration_mps2")
    assert drag.at_bound
    assert doubt.certainty == "doubtful" and "at its bound" in doubt.why
    assert any(f"{drag.name} is at its bound" in note for note in found.notes)


def test_a_log_without_any_noise_tells_no_more_than_there_is(
    tanh_robot, measure, model_file, tmp_path
):
    """480 Hz Euler against the twin's own step leaves micrometres, and no physics."""
    silent = tanh_robot(sensor_m=0, sensor_rad=0, drive_mps=0, drive_radps=0)
    fit([measure(silent, 13, 30.0)], model_file(), tmp_path / "silent.toml", "")
    found = diagnose([measure(silent, 14, 30.0)], ModelFile.load(str(tmp_path / "silent.toml")))
    assert found.found == [] and found.rest.formula is None
    assert found.verdict in ("model_adequate", "refit_enough")


def test_a_patch_of_the_floor_wins_on_fit_and_is_no_evidence(tanh_robot, measure, fitted):
    """Nothing is hidden. A patch finds a place whose noise it fits, and tells nothing of it."""
    for seed in range(300, 304):
        opened = open_measurements([measure(tanh_robot(), seed, 20.0)], fitted)
        before = fitted_state(first_state(opened, fitted, ()))
        trial = cross_validate(before, ("floor_patch",))
        assert trial.fit.scores[0] <= before.fit.scores[0] + 1e-6
        assert trial.evidence < SETTINGS.evidence


ORIGIN_M = np.array([-40.0, 25.0])


def slowed_on(tanh_robot, square_m: float, at_m: tuple[float, float], origin_m=(0.0, 0.0)):
    """A robot that is 40 % slower on a square of this side, about a place from where it starts."""

    class Slowed(tanh_robot):
        def poses(self, duty, seed):
            """Retraces the free robot's steps, shorter where it stands on the square."""
            free = tanh_robot.poses(replace(self, sensor_m=0, sensor_rad=0), duty, seed)
            random = np.random.default_rng(seed + 1)
            pose = np.zeros_like(free)
            pose[0] = (*origin_m, 0)
            for k, step in enumerate(np.diff(free, axis=0)):
                c, s = np.cos(pose[k, 2] - free[k, 2]), np.sin(pose[k, 2] - free[k, 2])
                turned = np.array([c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]])
                on = np.all(np.abs(pose[k, :2] - origin_m - at_m) < square_m / 2)
                pose[k + 1] = pose[k] + (0.6 if on else 1.0) * turned
            sensor = np.array([self.sensor_m, self.sensor_m, self.sensor_rad])
            return pose + random.normal(size=pose.shape) * sensor

    return Slowed()


def test_a_patch_is_found_however_far_away_the_origin_is(tanh_robot, measure, fitted):
    """A hall's corner is the origin; on a square of 0.6 m the robot is 40 % slower.

    A round patch with a soft edge is not a square: its strength is not quite that.
    """
    robot = slowed_on(tanh_robot, 0.6, (-0.9, -0.3), ORIGIN_M)
    found = diagnose([measure(robot, 320, 150.0)], fitted)
    assert found.found[:1] == ["floor_patch"]
    values = {e.name.partition(".")[2]: e.value for e in found.findings[0].parameters}
    assert values["strength"] == pytest.approx(0.4, abs=0.15)
    assert values["x_m"] == pytest.approx(ORIGIN_M[0] - 0.9, abs=0.1)
    assert values["y_m"] == pytest.approx(ORIGIN_M[1] - 0.3, abs=0.1)


def test_a_patch_that_is_crossed_once_is_proven_by_that_time(tanh_robot, measure, fitted):
    """For 7 of 40 s it drives over 1.2 m where it is slower: parts of a log hold all of it or none.

    A loss of that time would do the same.
    """
    robot = slowed_on(tanh_robot, 1.2, (3.0, 0.0))
    levels = np.random.default_rng(5).choice((50, 75), 40)
    script_pct = np.repeat(levels, round(1.0 / 0.0208))[:, None].repeat(4, axis=1)
    opened = open_measurements([measure(robot, 322, script_pct=script_pct)], fitted)
    before = fitted_state(first_state(opened, fitted, ()))
    promised = {s.name: s for s in screen(before, names=("floor_patch", "transient_loss"))}
    patch, loss = (cross_validate(before, (n,), s.start) for n, s in sorted(promised.items()))
    assert proven(patch, before.held_score, SETTINGS)
    assert patch.evidence > 0.5 * loss.evidence


RAMP_S, PLAY_S = 0.1, 0.05


def slewed(duty: np.ndarray, ramp_s: float = RAMP_S) -> np.ndarray:
    """Duties that take 0.1 s, or so long, from 0 to 1."""
    now, limited = np.zeros(4), np.empty_like(duty)
    for k, wanted in enumerate(duty):
        now = now + np.clip(wanted - now, -EULER_S / ramp_s, EULER_S / ramp_s)
        limited[k] = now
    return limited


def with_play(duty: np.ndarray) -> np.ndarray:
    """Duties that wait for 0.05 s at zero where a wheel changes its direction."""
    played, side, left_s = np.empty_like(duty), np.zeros(4), np.zeros(4)
    for k, wanted in enumerate(duty):
        turned = (wanted * side < 0) & (wanted != 0)
        side = np.where(wanted != 0, np.sign(wanted), side)
        left_s = np.where(turned, PLAY_S, np.maximum(left_s - EULER_S, 0))
        played[k] = np.where(left_s > 0, 0, wanted)
    return played


def test_a_stale_lag_is_written_as_a_lag(tanh_robot, measure, fitted, tmp_path):
    """No effect that imitates the lag goes into the explained model."""
    robot = tanh_robot()
    run = measure(replace(robot, lag_s=robot.lag_s + 0.006), 12, 60.0)
    found = explain([run], fitted, out=tmp_path / "explained.toml", command="test")
    model = ModelFile.load(str(found.path)).model
    assert [f.effect for f in found.diagnosis.findings] == [REFIT] and not model.effects
    assert model.get("base.motor_lag_s") == pytest.approx(robot.lag_s + 0.006, abs=0.004)
    assert found.after.score < found.diagnosis.before.score


def test_stale_gains_beside_a_stale_lag_are_written_as_both(tanh_robot, measure, fitted, tmp_path):
    """A sheet of numbers that no log told: turning is 10 % off, and the lag 8 ms."""
    robot = tanh_robot()
    lines = Path(fitted.path).read_text().splitlines()
    kept = "\n".join(lines[: lines.index("[base.std]")])
    told = "\n".join(line for line in kept.splitlines() if not line.startswith("fitted_on"))
    sheet = tmp_path / "sheet.toml"
    sheet.write_text(f"{told}\n[clock]\nsame = true\n")
    off = ModelFile.load(str(sheet))
    off.model.set("base.yaw_gain", 0.9 * off.model.get("base.yaw_gain"))
    run = measure(replace(robot, lag_s=robot.lag_s + 0.008), 12, 60.0)
    found = explain([run], off, out=tmp_path / "explained.toml", command="test")
    assert found.diagnosis.search.found[0] == REFIT and len(found.diagnosis.search.found) == 2
    assert [f.effect for f in found.diagnosis.findings] == [REFIT]
    model = ModelFile.load(str(found.path)).model
    assert not model.effects
    assert model.get("base.motor_lag_s") == pytest.approx(robot.lag_s + 0.008, abs=0.004)


def test_a_heading_that_comes_late_is_no_slip(tanh_robot, measure, fitted):
    """A tracker that smooths the heading alone: 40 ms. Curves seem to drift to the inside."""

    def smoothed(pose, valid):
        heading = lfilter([1 - KEPT], [1, -KEPT], pose[:, 2] - pose[0, 2]) + pose[0, 2]
        return np.column_stack([pose[:, :2], heading]), valid

    sides = np.random.default_rng(5).choice((25, 50, 75, 100), (60, 2))
    script = np.repeat(sides[:, [0, 1, 0, 1]], 48, axis=0)
    found = diagnose([measure(tanh_robot(), 31, script_pct=script, spoil=smoothed)], fitted)
    assert {f.effect for f in found.findings} == {"yaw_lag", "lateral_slip"}
    assert all(f.certainty == "doubtful" for f in found.findings)
    assert found.verdict == "outside_catalogue" and "change of the command" in found.sentence


@pytest.mark.parametrize(("more_s", "effects"), [(0.006, {REFIT}), (0.011, {"motor_lag"})])
def test_a_lag_that_is_nearly_as_it_was_is_a_stale_number(
    more_s, effects, tanh_robot, measure, fitted
):
    """90 ms in the log that the model is of; a little more is how robots differ from day to day.

    A little more than that shows in so calm a log, and is told.
    """
    robot = tanh_robot()
    run = measure(replace(robot, lag_s=robot.lag_s + more_s), 12, 60.0)
    found = diagnose([run], fitted)
    assert {f.effect for f in found.findings} == effects
    if effects == {REFIT}:
        assert found.score_refit == found.search.last.held_score
        (lag,) = found.findings[0].parameters
        assert lag.value == pytest.approx(robot.lag_s + more_s, abs=2 * lag.std + EULER_S)


@pytest.mark.parametrize(
    ("spoilt", "name"), [(slewed, "slew_limit"), (with_play, "reversal_dead_time")]
)
def test_what_only_resembles_a_lag_is_not_surely_called_one(
    tanh_robot, measure, fitted, spoilt, name
):
    """With its own name unknown, a lag or a delay explains most, but is not surely the one."""

    class Odd(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(spoilt(duty))

    found = diagnose([measure(Odd(), 15, 30.0)], fitted, excluded=(name,))
    if found.verdict != "outside_catalogue":
        # By the score nothing is left, or what is left is said; and no surer name than a group's.
        assert found.steps[-1][1] < MISSING or found.rest.firm
        assert found.verdict == "ambiguous" or found.rest.firm


def test_dead_zone_and_curve_are_both_found_in_a_log(tanh_robot, measure, model_file):
    """Wheels stand below 0.2 of the duty and then rise as a root; the base is a straight line.

    Their lag is 0.09 s and the base's 0.05 s: that is a finding, too.
    """

    class Worn(tanh_robot):
        def speed_mps(self, duty):
            over = np.maximum(np.abs(duty) - 0.2, 0) / 0.8
            return np.sign(duty) * self.top_mps * np.sqrt(over)

    line = model_file(("[0, 25, 50, 75, 100]", "[0, 100]"), ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.4]"))
    found = diagnose([measure(Worn(), 12, 40.0)], line)
    assert set(found.found) == {"dead_zone", "speed_curve", "motor_lag"}
    (extra,) = next(f.parameters for f in found.findings if f.effect == "motor_lag")
    assert extra.value == pytest.approx(0.04, abs=2.5 * extra.std)
    for finding in found.findings:
        assert not set(finding.group or ()) & (set(found.found) - {finding.effect})
    assert found.steps[-1][1] < 0.4 * found.steps[0][1]


def test_a_kick_at_each_start_depends_on_starts(tanh_robot, measure, fitted):
    """Casters that swing round: half a radian a second for 0.2 s, whatever way it is told."""

    class Kicked(tanh_robot):
        def hindered(self, motion):
            moves = (np.abs(motion) > 0.02).any(axis=1)
            kicks = np.zeros(len(motion), bool)
            for k in np.flatnonzero(moves[1:] & ~moves[:-1]):
                kicks[k : k + int(0.2 / EULER_S)] = True
            return motion + np.outer(kicks, (0, 0, 0.5))

    random = np.random.default_rng(8)
    ways = np.array([(1, 1, 1, 1), (-1, 1, -1, 1), (-1, 1, 1, -1), (1, 0.4, 1, 0.4)])
    steps = random.choice([-1, 1], 30)[:, None] * ways[random.integers(0, 4, 30)]
    steps *= random.uniform(30, 80, 30)[:, None]
    legs = np.stack([steps, 0 * steps], axis=1).reshape(-1, 4).round().astype(int)
    found = diagnose([measure(Kicked(), 14, script_pct=np.repeat(legs, 48, axis=0))], fitted)
    assert found.verdict == "outside_catalogue"
    assert found.rest.depends_on[0] == "starts"


MOST_SUM = 0.45  # of the four duties' sizes, as a share of the most


def in_sum_limited(duty: np.ndarray) -> np.ndarray:
    """Duties as a supply of limited power leaves them."""
    size = np.abs(duty).mean(axis=1, keepdims=True)
    return duty * np.minimum(1, MOST_SUM / np.maximum(size, 1e-9))


def failing_at_32_s(duty: np.ndarray) -> np.ndarray:
    """Duties less a quarter from a moment on."""
    late = np.arange(len(duty)) * EULER_S > 32.5  # the script begins after half a second
    return np.where(late[:, None], 0.75 * duty, duty)


@pytest.mark.parametrize(
    ("limited", "last_pct", "surely"),
    [(in_sum_limited, (85, 90), False), (failing_at_32_s, (15, 45), True)],
)
def test_a_loss_is_sure_where_commands_are_as_before_it(
    tanh_robot, measure, fitted, limited, last_pct, surely
):
    """Commands are below the limit for 32 s; in the last 12 s above it, or as they were.

    Each leg is driven there and back, so that the place is as before, too.
    """

    class Weak(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(limited(duty))

    random = np.random.default_rng(3)
    ways = np.array([(1, 1, 1, 1), (-1, 1, -1, 1), (-1, 1, 1, -1), (1, 0.4, 1, 0.4)])
    legs = ways[random.integers(0, 4, 22)]
    sizes_pct = [*random.uniform(15, 45, 16), *random.uniform(*last_pct, 6)]
    legs *= np.array(sizes_pct)[:, None]
    steps = np.stack([legs, -legs], axis=1).reshape(44, 4)
    script = np.repeat(steps.round().astype(int), 48, axis=0)
    found = diagnose([measure(Weak(), 33, script_pct=script)], fitted)
    sure = [f.effect for f in found.findings if f.certainty == "sure"]
    assert ("abrupt_loss" in sure) == surely


FAILS_S, FOR_S = (8.0, 15.0, 22.0, 31.0), 0.4


def test_moments_without_power_are_told_one_by_one(tanh_robot, measure, fitted):
    """The wheels get no power for 0.4 s, four times; nothing else is new."""

    class Failing(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S - 0.5  # the script begins after half a second
            off = np.any([(at_s > t) & (at_s < t + FOR_S) for t in FAILS_S], axis=0)
            return super().wheels_mps(np.where(off[:, None], 0.0, duty))

    straight = np.full(((40 * 48), 4), 75)
    straight[::480] = 50  # something changes
    turns = np.where((np.arange(len(straight)) // 96 % 2)[:, None], (75, 25, 75, 25), straight)
    found = diagnose([measure(Failing(), 21, script_pct=turns)], fitted)
    assert found.verdict == "outside_catalogue" and found.found == []
    at_s = [m.t_s - 0.5 for m in found.rest.moments]
    assert at_s == pytest.approx(FAILS_S, abs=0.2)
    assert all(m.way < 0.5 and m.what == "less" for m in found.rest.moments)
    assert "4 moments" in found.sentence


@pytest.mark.parametrize(
    ("count", "way", "windows", "told"),
    [
        (4, 0.8, 3, 4),
        (4, 1.01, 3, 0),
        (8, 1.01, 3, 8),
        (3, 0.5, 3, 0),
        (2, 0.5, 5, 2),  # each lasts for a second
        (1, 0.5, 9, 0),  # somebody pushed it
    ],
)
def test_moments_that_hardly_change_the_way_must_be_many(count, way, windows, told, monkeypatch):
    """Events of the size of the noise's tails come by chance; those that stop a robot do not."""
    far = np.zeros(400, bool)
    far[np.arange(count)[:, None] * 40 + 20 + np.arange(windows)] = True
    monkeypatch.setattr(moments, "is_far", lambda *_: far)
    monkeypatch.setattr(moments, "_ways", lambda *_: np.full(400, way))
    monkeypatch.setattr(moments, "later_from", lambda *_: None)
    monkeypatch.setattr(moments, "_begin_s", lambda *_: 0.0)
    monkeypatch.setattr(moments, "_done", lambda *_: (way, "less"))
    monkeypatch.setattr(moments, "_at_changes", lambda *_: False)
    measurement = SimpleNamespace(log_name="run", track=SimpleNamespace(robot_id=1))
    nothing = np.zeros((400, 5, 3))
    data = SimpleNamespace(
        measurement=measurement,
        start_s=0.25 * np.arange(400),
        floor=None,
        measured=nothing,
        errors=lambda _: nothing,
    )
    floor = SimpleNamespace(across=None, keep=np.ones(400, bool))
    own = SimpleNamespace(trajectory=data, data=data, floor=floor, known_floor=floor)
    found = moments.events_of([own], [None])
    assert len(found.moments) == told


def _weak_left_from(robot, from_s: float):
    """The robot with left wheels that lose 12 % from a time of its log on."""

    class Weak(robot):
        def wheels_mps(self, duty):
            later = np.arange(len(duty)) * EULER_S > from_s
            weaker = np.where(later[:, None], (0.88, 1, 0.88, 1), 1.0)
            return super().wheels_mps(duty) * weaker

    return Weak()


def test_a_weakness_that_is_always_there_is_a_gain(tanh_robot, measure, fitted):
    found = diagnose([measure(_weak_left_from(tanh_robot, 0.0), 22, 40.0)], fitted)
    (gain,) = (f for f in found.findings if f.effect == "wheel_gain")
    assert gain.certainty == "sure"
    ((_, said, *_),) = each_robot(found).rows
    assert re.search(r"left wheels \d+ % weak", said.text)


def test_a_weakness_that_comes_later_is_told_with_its_moment(tanh_robot, measure, fitted):
    """12 % of the left wheels are 6 % of all and 6 % of their difference."""
    found = diagnose([measure(_weak_left_from(tanh_robot, 20.0), 22, 40.0)], fitted)
    (finding,) = found.findings
    assert (finding.effect, finding.certainty) == ("abrupt_loss", "sure")
    loss, side, from_s = finding.parameters
    for part in (loss, side):
        assert abs(part.value - 0.06) < 2 * part.std < 0.04
    assert from_s.value == pytest.approx(20.0, abs=0.5)


def test_what_begins_while_nothing_is_measured_is_known_to_that_gap(tanh_robot, measure, fitted):
    """From 12 to 20 s there are no poses: wherever within it begins, the rest is the same."""
    log = measure(_weak_left_from(tanh_robot, 20.0), 22, 40.0)
    at_s = log.track.command_t_s[0] + np.array([12.0, 20.0])
    found = diagnose([log.without([tuple(at_s)], "not measured")], fitted)
    finding = found.finding("abrupt_loss")
    (from_s,) = [p for p in finding.parameters if p.name == "abrupt_loss.from_s"]
    reach_s = 1.96 * from_s.std
    assert from_s.value - reach_s < 12.1 and from_s.value + reach_s > 19.9


def test_a_moment_of_one_log_is_not_looked_for_in_several(tanh_robot, measure, fitted):
    logs = [measure(_weak_left_from(tanh_robot, s), 22 + int(s), 20.0) for s in (0.0, 10.0)]
    why = dict(diagnose(logs, fitted).not_identifiable)["abrupt_loss"]
    assert why.startswith("it begins at a moment of one run")


def test_a_weakness_for_a_while_is_named_with_its_times(tanh_robot, measure, fitted):
    """A third of the speed is gone from 15 to 22 s, wherever the robot is then."""

    class Tired(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            tired = (at_s > 15) & (at_s < 22)
            return super().wheels_mps(duty) * np.where(tired, 0.67, 1.0)[:, None]

    found = diagnose([measure(Tired(), 23, 60.0)], fitted)
    (finding,) = found.findings
    assert finding.effect == "transient_loss"
    assert set(finding.group) == {"transient_loss", "floor_patch"}  # it was nowhere there before
    loss, from_s, until_s = finding.parameters
    assert abs(loss.value - 0.33) < 2 * loss.std < 0.15
    for moment, true_s in ((from_s, 15), (until_s, 22)):
        assert abs(moment.value - true_s) < min(3 * moment.std, 2.0)


def test_what_a_loss_for_a_while_scatters_is_no_noise_once_it_is_known(
    tanh_robot, measure, fitted, tmp_path
):
    """The noise is the robot's own, as in the first log; 35 % of the speed is gone for 20 s."""

    class Tired(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            tired = (at_s > 15) & (at_s < 35)
            return super().wheels_mps(duty) * np.where(tired, 0.65, 1.0)[:, None]

    log, path = measure(Tired(), 23, 60.0), tmp_path / "tired.toml"
    first = diagnose([log], fitted)
    add("transient_loss", [log], fitted, out=path, command="")
    again = diagnose([log], ModelFile.load(str(path)))
    for found in (first, again):
        assert not any("scatter" in note for note in found.notes)
    assert again.verdict == "model_adequate"


def test_an_effect_that_the_model_has_is_not_said_to_be_hidden(
    tanh_robot, measure, fitted, tmp_path
):
    """Beside a slew limit another one does nothing, which is no reason to drive for one."""

    class Slews(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(slewed(duty, 0.8))

    log, path = measure(Slews(), 15, 30.0), tmp_path / "slews.toml"
    assert explain([log], fitted, out=path, command="").diagnosis.found == ["slew_limit"]
    again = diagnose([log], ModelFile.load(str(path)))
    assert "slew_limit" in dict(again.search.without_trace)
    assert "slew_limit" not in dict(again.not_identifiable)
    assert "slew_limit" not in again.sentence


def test_the_lag_of_the_base_is_in_the_model_and_what_adds_to_it_says_so(
    tanh_robot, measure, model_file, true_model, tmp_path
):
    """Beside a lag that is fitted to the same log another one has no trace: it is not hidden."""
    log, later = measure(tanh_robot(), 41, 30.0), measure(tanh_robot(lag_s=0.2), 42, 30.0)
    fit([log], model_file(), tmp_path / "own.toml", "")
    own = ModelFile.load(str(tmp_path / "own.toml"))
    why = dict(diagnose([log], own).not_identifiable)["motor_lag"]
    assert why.startswith("in the model already, as base.motor_lag_s")
    lag_s = own.model.get("base.motor_lag_s")
    assert f"; adds to the base's own {lag_s:.3g} s)" in diagnose([later], own).sentence
    guessed = diagnose([later], true_model).sentence
    assert "; adds to the base's own 0.09 s, which no log told" in guessed


def test_a_weakness_that_comes_again_is_told_to_depend_on_time(tanh_robot, measure, fitted):
    """A quarter of the speed is gone from 12 to 20 s, and from 35 to 43 s: no effect is so."""

    class Weary(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            weary = ((at_s > 12) & (at_s < 20)) | ((at_s > 35) & (at_s < 43))
            return super().wheels_mps(duty) * np.where(weary, 0.75, 1.0)[:, None]

    found = diagnose([measure(Weary(), 22, 60.0)], fitted)
    assert found.verdict == "outside_catalogue"
    assert found.rest.depends_on[0] == "time"
    assert not [f.effect for f in found.findings if f.certainty == "sure"]


def test_a_small_weakness_that_comes_and_goes_is_told_to_depend_on_time(
    tanh_robot, measure, fitted
):
    """8 % of the speed is gone for 12 s of every 28 s: no one time stands out, all together do."""

    class Unsteady(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            weak = (at_s + 10) % 28 > 16
            return super().wheels_mps(duty) * np.where(weak, 0.92, 1.0)[:, None]

    found = diagnose([measure(Unsteady(), 24, 110.0)], fitted)
    assert found.verdict == "outside_catalogue"
    assert "time" in found.rest.depends_on
    assert not [f.effect for f in found.findings if f.certainty == "sure"]


def test_a_body_that_turns_sooner_than_it_drives_is_named(tanh_robot, measure, fitted):
    """Driving takes the robot's 0.09 s, turning 0.04 s: first orders by themselves, summed."""
    spin = np.array([-1, 1, -1, 1]) / 2

    def first_order(target, lag_s):
        part = EULER_S / lag_s
        return lfilter([part], [1, part - 1], target, axis=0)

    class Light(tanh_robot):
        def wheels_mps(self, duty):
            target = self.speed_mps(duty)
            turning = np.outer(target @ spin, spin)
            return first_order(target - turning, self.lag_s) + first_order(turning, 0.04)

    found = diagnose([measure(Light(), 24, 40.0)], fitted)
    first = found.findings[0]
    assert (first.effect, first.certainty) == ("yaw_lag", "sure")
    (extra,) = first.parameters
    assert extra.value == pytest.approx(-0.05, abs=2 * extra.std + EULER_S)


def test_wheels_behind_a_filter_are_no_delay(tanh_robot, measure, fitted):
    """A filter of 0.05 s before the robot's 0.09 s: both first orders, one after the other."""

    class Filtered(tanh_robot):
        def wheels_mps(self, duty):
            part = EULER_S / 0.05
            return lfilter([part], [1, part - 1], super().wheels_mps(duty), axis=0)

    found = diagnose([measure(Filtered(), 25, 40.0)], fitted)
    first = found.findings[0]
    assert first.effect == "second_order_lag"
    (second,) = first.parameters
    assert second.value == pytest.approx(0.05, abs=2 * second.std + EULER_S)
    assert found.late.lag_s == pytest.approx(0.14, abs=0.01)


def test_play_in_the_gears_is_no_weak_wheel(tanh_robot, measure, fitted):
    """Each wheel rests while its motor turns back by 0.15 rad, as a stop that is dragged along."""

    class Loose(tanh_robot):
        def wheels_mps(self, duty):
            way = np.cumsum(super().wheels_mps(duty), axis=0) * EULER_S
            wheel, gap_m = np.zeros_like(way), 0.15 * fitted.model.get("robot.wheel_radius_m")
            for k in range(1, len(way)):
                wheel[k] = np.clip(wheel[k - 1], way[k] - gap_m, way[k])
            return np.diff(wheel, axis=0, prepend=0.0) / EULER_S

    found = diagnose([measure(Loose(), 28, 40.0)], fitted)
    first = found.findings[0]
    assert (first.effect, first.certainty) == ("backlash", "sure")
    (gap,) = first.parameters
    assert gap.value == pytest.approx(0.15, abs=2 * gap.std + 0.005)


def test_an_effect_that_the_model_has_is_named_again_where_it_changed(
    tanh_robot, measure, fitted, tmp_path
):
    """The marker sat turned by 0.1 rad, and was put back turned by 0.3 rad."""

    def turned(bias_rad):
        return lambda pose, valid: (pose + np.array([0, 0, bias_rad]), valid)

    first = measure(tanh_robot(), 26, 40.0, spoil=turned(0.1))
    explain([first], fitted, out=tmp_path / "explained.toml", command="explain")
    model = ModelFile.load(str(tmp_path / "explained.toml"))
    assert model.model.effects == ["heading_bias"]
    found = diagnose([measure(tanh_robot(), 27, 40.0, spoil=turned(0.3))], model)
    assert found.motion == ["heading_bias"]
    (own,) = found.findings
    assert own.again and "beside the model's own" in found.sentence
    assert own.parameters[0].value == pytest.approx(0.2, abs=2 * own.parameters[0].std + 0.005)


def test_a_compass_that_errs_with_heading_is_no_turned_marker(tanh_robot, measure, fitted):
    """Iron in the floor: the heading is wrong by up to 6 degrees, to the left in the north."""

    def iron(pose, valid):
        x_m, y_m, heading_rad = pose.T
        return np.column_stack([x_m, y_m, heading_rad + 0.1 * np.sin(heading_rad + 0.5)]), valid

    found = diagnose([measure(tanh_robot(), 23, 40.0, spoil=iron)], fitted)
    assert found.verdict == "effect_missing" and found.motion == ["compass_deviation"]
    cos, sin = found.findings[0].parameters
    assert cos.value == pytest.approx(0.1 * np.sin(0.5), abs=2 * cos.std)
    assert sin.value == pytest.approx(0.1 * np.cos(0.5), abs=2 * sin.std)


def test_a_compass_that_errs_twice_a_turn_is_outside_the_catalogue(tanh_robot, measure, fitted):
    """Soft iron: no turned marker, and no error once a turn."""

    def iron(pose, valid):
        x_m, y_m, heading_rad = pose.T
        return np.column_stack([x_m, y_m, heading_rad + 0.1 * np.sin(2 * heading_rad)]), valid

    found = diagnose([measure(tanh_robot(), 23, 40.0, spoil=iron)], fitted)
    assert found.verdict == "outside_catalogue"
    assert not [f for f in found.findings if f.certainty == "sure" and f.effect != "refit"]
    assert "heading" in found.rest.depends_on


def test_where_two_levels_are_driven_a_dead_zone_may_be_behind_stale_gains(
    tanh_robot, measure, fitted
):
    """Milling knows two levels of the duty: other gains do what a dead zone does."""

    class Sticky(tanh_robot):
        def speed_mps(self, duty):
            return super().speed_mps(np.sign(duty) * np.maximum(np.abs(duty) - 0.04, 0))

    random = np.random.default_rng(3)
    sides = np.array([(75, 100, 75, 100), (100, 75, 100, 75)])
    script_pct = np.repeat(sides[random.integers(2, size=160)], 12, axis=0)
    found = diagnose([measure(Sticky(), 23, script_pct=script_pct)], fitted)
    assert found.verdict in ("cannot_tell", "ambiguous")
    assert "dead_zone" in found.sentence


ROBOTS, RANGE_M, HALF_CONE_RAD, LOOK_EVERY = 4, 1.5, 0.6, 12  # a new bit every quarter second
SIDES = np.array([(0.25, 1.0, 0.25, 1.0), (1.0, 0.25, 1.0, 0.25)])  # sees nobody, somebody


def milling(robot, start, seconds, seed):
    """(C, N, 4) duties and (120 Hz, N, 3) poses of robots that turn by whether they see another."""
    controls = round(seconds * 48)
    random = np.random.default_rng(seed)
    keep = np.exp(-EULER_S / robot.memory_s)
    drift = np.zeros((ROBOTS, 3))
    size = np.sqrt(1 - keep**2) * np.array([robot.drive_mps, robot.drive_mps, robot.drive_radps])
    pose, rims = start.copy(), np.zeros((ROBOTS, 4))
    duties, seen = [], []
    for control in range(controls):
        if control % LOOK_EVERY == 0:
            away = pose[None, :, :2] - pose[:, None, :2]
            bearing = np.arctan2(away[..., 1], away[..., 0]) - pose[:, None, 2]
            off = np.abs(np.remainder(bearing + np.pi, 2 * np.pi) - np.pi)
            near = np.hypot(*np.moveaxis(away, -1, 0)) < RANGE_M
            bits = np.any(near & (off < HALF_CONE_RAD) & ~np.eye(ROBOTS, dtype=bool), axis=1)
        duties.append(SIDES[bits.astype(int)] * (24 <= control < controls - 24))
        target = robot.speed_mps(duties[-1])
        for step in range(10):
            rims = rims + EULER_S / robot.lag_s * (target - rims)
            drift = keep * drift + size * random.normal(size=drift.shape)
            fl, fr, rl, rr = rims.T
            moving = rims.max(axis=1) > 1e-3
            forward = (fl + fr + rl + rr) / 4 + drift[:, 0] * moving
            left = robot.sideways * (-fl + fr + rl - rr) / 4 + drift[:, 1] * moving
            turn = robot.yaw * (-fl + fr - rl + rr) / 4 / robot.lever_m + drift[:, 2] * moving
            pose[:, 2] += turn * EULER_S
            c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
            pose[:, 0] += (c * forward - s * left) * EULER_S
            pose[:, 1] += (s * forward + c * left) * EULER_S
            if (10 * control + step) % 4 == 3:
                seen.append(pose.copy())
    return np.array(duties), np.array(seen)


def test_a_chaotic_swarm_is_judged_by_short_predictions(tanh_robot, measure, fitted):
    """Paths from a millimetre beside part fiftyfold, all noise the same; the model is right."""
    robot, seconds, beside_m = tanh_robot(), 40.0, 1e-3
    start = np.random.default_rng(12).normal(0, 0.4, (ROBOTS, 3)) * (1, 1, 4)
    moved = start + beside_m * np.array([1, 0, 0]) * np.eye(ROBOTS)[:, :1]
    duties, poses = milling(robot, start, seconds, 6)
    _, others = milling(robot, moved, seconds, 6)
    assert np.linalg.norm((others - poses)[-1, :, :2], axis=-1).max() > 50 * beside_m
    noise = (robot.sensor_m, robot.sensor_m, robot.sensor_rad)

    def filmed(pose, valid):
        return poses[:, 0] + np.random.default_rng(7).normal(size=pose.shape) * noise, valid

    script_pct = np.rint(100 * duties[24:-24, 0]).astype(int)
    run = measure(robot, 7, script_pct=script_pct, spoil=filmed)
    assert compare([run], fitted).score == pytest.approx(1, abs=0.3)


def test_a_wheel_that_is_far_weaker_than_is_usual_is_named_beyond_doubt(
    tanh_robot, measure, fitted
):
    """A quarter less is more than motors of a kind differ by, but nothing else does the same."""

    class Weak(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(duty) * (0.75, 1, 1, 1)

    (weak, *others) = diagnose([measure(Weak(), 23, 40.0)], fitted).findings
    assert weak.effect == "wheel_gain" and weak.certainty == "sure"
    assert not others
    size = next(e for e in weak.parameters if e.name == "wheel_gain.fl")
    assert size.value < -0.15


@pytest.mark.parametrize(
    ("effect", "depends_on", "certainty"),
    [
        ("gain_slope", ["place"], "doubtful"),
        ("gain_slope", ["speed"], "sure"),
        ("carpet_grain", ["heading"], "doubtful"),
        ("heading_bias", ["heading"], "doubtful"),
        ("speed_curve", ["place"], "sure"),
        ("refit", ["place"], "sure"),
    ],
)
def test_what_leaves_a_rest_of_its_own_kind_has_another_form(effect, depends_on, certainty):
    for share, outside in ((0.6, certainty == "doubtful"), (0.9, False)):  # nearly all is its own
        found = Finding(effect, None, [], share, "sure")
        (judged,) = of_another_form([found], Rest(0.1, False, depends_on))
        assert judged.certainty == certainty
        assert bool(judged.why) == (certainty == "doubtful")
        assert judged.wrong_form == outside


def test_a_loss_that_fades_from_the_start_is_no_sure_while(tanh_robot, measure, fitted):
    """Gears that run in: 25 % less at first, gone with a time constant of 8 s."""

    class RunsIn(tanh_robot):
        def wheels_mps(self, duty):
            left = 0.25 * np.exp(-np.arange(len(duty)) * EULER_S / 8)
            return super().wheels_mps(duty) * (1 - left)[:, None]

    found = diagnose([measure(RunsIn(), 23, 80.0)], fitted)
    assert found.verdict in ("effect_missing", "ambiguous", "outside_catalogue")
    assert not [f.effect for f in found.findings if f.certainty == "sure"]


@pytest.mark.parametrize(("near_m", "own"), [(0.25, True), (0.7, False)])
def test_a_place_is_its_own_though_other_ways_cross_its_ends(near_m, own, monkeypatch):
    """From 10 to 14 s along 1.6 m, to whose ends the robot comes at other times as well."""
    t_s = np.arange(0, 30, 0.25)
    there = (t_s >= 10) & (t_s < 14)
    x_m = np.where(t_s < 10, near_m * np.abs(np.sin(t_s)), 1.6 - near_m * np.abs(np.sin(t_s)))
    x_m[there] = 0.4 * (t_s[there] - 10)
    pose = np.column_stack([x_m, np.zeros((len(t_s), 2))])
    data = SimpleNamespace(
        measurement=SimpleNamespace(track=SimpleNamespace(pose=pose)),
        windows=SimpleNamespace(starts=np.arange(len(t_s))),
        start_s=t_s,
    )
    monkeypatch.setattr(doubts, "Trajectory", SimpleNamespace)
    monkeypatch.setattr(doubts, "when_s", lambda *_: [10.0, 14.0])
    last = SimpleNamespace(fit=SimpleNamespace(datasets=[data]))
    assert doubts._in_a_place_of_its_own(last, "transient_loss") is own
    monkeypatch.setattr(doubts, "when_s", lambda *_: [26.0])  # it has no end: at one of the ends
    assert not doubts._in_a_place_of_its_own(last, "abrupt_loss")


@pytest.mark.parametrize(("until_s", "certainty"), [(12.0, "doubtful"), (None, "sure")])
def test_a_loss_for_a_while_that_leaves_a_place_may_be_of_the_place(until_s, certainty):
    """A robot is somewhere for a while; one that is weak from a moment on goes everywhere so."""
    name = "transient_loss" if until_s else "abrupt_loss"
    found = _loss(name, 0.2, *(t for t in (5.0, until_s) if t))
    (judged,) = of_another_form([found], Rest(0.1, False, ["place"]))
    assert judged.certainty == certainty


@pytest.mark.parametrize(("taken", "certainty"), [(0.05, "sure"), (0.5, "doubtful")])
def test_a_rest_that_hardly_depends_on_what_an_effect_acts_by_leaves_it_its_form(taken, certainty):
    """A real robot's lag is never quite of first order; half of the rest at changes is another."""
    rest = Rest(0.4, True, ["change of the command"], left_over={"change of the command": taken})
    (judged,) = of_another_form([Finding("motor_lag", None, [], 0.5, "sure")], rest)
    assert judged.certainty == certainty


@pytest.mark.parametrize(
    ("name", "left", "on", "certainty"),
    [
        ("wheel_gain", 0.1, "speed", "doubtful"),
        ("wheel_gain", 0.03, "speed", "sure"),
        ("wheel_gain", 0.1, "heading", "sure"),
        ("marker_offset", 0.1, "coupling of the axes", "doubtful"),
        ("marker_offset", 0.1, "speed", "sure"),
    ],
)
def test_what_an_effect_cannot_do_is_not_left_beside_it_for_sure(name, left, on, certainty):
    """A bearing takes the same speed at all speeds; a weak wheel is weak by a share.

    A marker aside of the centre is led round by the same way in each turn, however the robot
    drives; one wheel that slips in turns moves the point about which it turns.
    """
    (judged,) = of_another_form([Finding(name, None, [], 0.9, "sure")], Rest(left, True, [on]))
    assert judged.certainty == certainty


@pytest.mark.parametrize(
    ("extra_s", "certainty"), [(-0.06, ["doubtful"] * 2), (0.06, ["sure", "doubtful"])]
)
def test_sooner_by_one_lag_and_later_by_another_is_no_lag(extra_s, certainty):
    """A body on a spring answers late and then fast; two lags in a row may be one of more order."""
    sizes = {"input_delay.delay_s": 0.07, "motor_lag.extra_s": extra_s}
    found = [
        Finding(
            name.split(".")[0],
            None,
            [ParameterEstimate(name, value, 0.01, "s", False, True)],
            0.4,
            "sure",
        )
        for name, value in sizes.items()
    ]
    assert [f.certainty for f in of_another_form(found, NOTHING_LEFT)] == certainty


@pytest.mark.parametrize(
    ("second", "certainty"),
    [("motor_lag", "doubtful"), ("yaw_lag", "sure"), ("coasting", "sure")],
)
def test_a_lag_that_hangs_on_the_duty_is_not_parted_from_another(second, certainty):
    """One lag of any form over the duty is some constant lag and some change over the duty.

    How a body turns and how it rolls on are motions that lag_by_duty alone does not make.
    """
    found = [Finding(n, None, [], 0.4, "sure") for n in ("lag_by_duty", second)]
    assert [f.certainty for f in of_another_form(found, NOTHING_LEFT)] == ["sure", certainty]


@pytest.mark.parametrize(
    ("group", "certainty"),
    [(("wheel_gain", "abrupt_loss"), "doubtful"), (("input_delay", "clock_offset"), "sure")],
)
def test_what_is_found_beside_one_of_two_hangs_on_which_it_is(group, certainty):
    """A weak wheel turns the robot, a loss from a moment on does not; all that is late is alike."""
    found = [
        Finding(group[0], group, [], 0.6, "group"),
        Finding("yaw_lever", None, [], 0.3, "sure"),
    ]
    assert of_another_form(found, NOTHING_LEFT)[1].certainty == certainty


@pytest.mark.parametrize(
    ("effect", "left", "firm", "certainty"),
    [
        ("input_delay", 0.1, True, "sure"),
        ("input_delay", 0.4, True, "doubtful"),  # something else is late
        ("input_delay", 0.2, False, "sure"),
        ("floor_tilt", 0.2, True, "sure"),
        ("floor_tilt", 0.4, False, "doubtful"),  # half of such names were wrong
        ("floor_tilt", 0.7, True, "doubtful"),  # more is left than it takes
    ],
)
def test_beside_a_rest_that_is_no_noise_a_name_is_doubtful(effect, left, firm, certainty):
    found = [Finding(effect, None, [], 0.6, "sure")]
    assert [f.certainty for f in beside_more(found, Rest(left, firm, []), catalogue())] == [
        certainty
    ]


@pytest.mark.parametrize(
    ("score", "left", "depends_on", "certainty"),
    [
        (1.05, 0.1, [], "sure"),
        (1.2, 0.01, [], "sure"),
        (1.2, 0.06, [], "doubtful"),
        (1.2, 0.06, ["place"], "sure"),  # that may be something else
    ],
)
def test_a_score_that_no_right_model_has_leaves_no_name_sure(score, left, depends_on, certainty):
    """Steel in the floor had been a heading that is off, surely."""
    found = [Finding("heading_bias", None, [], 0.9, "sure")]
    (judged,) = of_no_right_model(found, Rest(left, False, depends_on), score)
    assert judged.certainty == certainty


@pytest.mark.parametrize(("left", "certainty"), [(0.07, "doubtful"), (0.03, "sure")])
def test_numbers_of_the_base_that_take_less_than_is_left_are_doubtful(left, certainty):
    """A lag that grows with the speed had been a gain of 0.94 beside a lag, surely."""
    found = [Finding("motor_lag", None, [], 0.9, "sure"), Finding(REFIT, None, [], 0.05, "sure")]
    _, refit = beside_more(found, Rest(left, False, []), catalogue())
    assert refit.certainty == certainty


def test_beside_much_that_depends_on_something_a_name_is_doubtful():
    found = [Finding("turn_asymmetry", None, [], 0.1, "sure")]
    (judged,) = beside_more(found, Rest(0.3, False, ["time"]), catalogue())
    assert judged.certainty == "doubtful"


@pytest.mark.parametrize(
    ("effects", "rest", "certainty"),
    [
        ([], Rest(0.12, False, ["turning rate"]), "doubtful"),
        ([], Rest(0.3, True, []), "doubtful"),
        ([], Rest(0.3, False, []), "sure"),  # it may be noise
        (["floor_tilt"], Rest(0.12, False, ["turning rate"]), "sure"),
    ],
)
def test_numbers_that_alone_were_stale_may_stand_for_what_is_left(effects, rest, certainty):
    """Friction of turning takes a share of most turns, and gains that are free take that."""
    found = [Finding(REFIT, None, [], 0.8, "sure")]
    found += [Finding(e, None, [], 0.1, "sure") for e in effects]
    assert beside_more(found, rest, catalogue())[0].certainty == certainty


@pytest.mark.parametrize(
    ("degrees", "certainty"), [(90, "sure"), (60, "sure"), (105, "sure"), (120, "doubtful")]
)
def test_effects_that_undo_each_other_are_doubtful(degrees, certainty, monkeypatch):
    """Their changes of the predictions stand at an angle of so many degrees."""
    turned = np.radians(degrees)
    does = {"mass_offset": (3.0, 0.0), "marker_offset": (np.cos(turned), np.sin(turned))}
    monkeypatch.setattr(doubts, "newest_instance", lambda _, name: name)
    monkeypatch.setattr(doubts, "_change_by", lambda _, name: np.array(does[name]))
    found = [Finding(n, None, [], 0.4, "sure") for n in does]
    last = SimpleNamespace(state=SimpleNamespace(model=None))
    assert {f.certainty for f in undone(found, last)} == {certainty}


@pytest.mark.parametrize(
    ("beside", "depends_on", "certainty"),
    [
        ([], [], "sure"),
        ([], ["angle of the first wheel"], "doubtful"),
        (["wheel_eccentricity"], [], "doubtful"),
        (["marker_offset"], ["time"], "sure"),
    ],
)
def test_a_wheel_with_a_flat_place_is_not_surely_weak(beside, depends_on, certainty):
    """It rolls less far in all, and more so at some of its angles."""
    found = [Finding(n, None, [], 0.4, "sure") for n in ("wheel_gain", *beside)]
    weak, *_ = of_another_form(found, Rest(0.1, False, depends_on))
    assert weak.certainty == certainty


def test_what_undoes_each_other_is_one_of_another_form_by_what_both_act_by(monkeypatch):
    """A wind on a fin turns the robot to one heading, which a compass and a slope imitate."""
    does = {"compass_deviation": (3.0, 0.0), "floor_tilt": (-2.0, 1.0)}
    monkeypatch.setattr(doubts, "newest_instance", lambda _, name: name)
    monkeypatch.setattr(doubts, "_change_by", lambda _, name: np.array(does[name]))
    found = [Finding(n, None, [], 0.4, "sure") for n in does]
    judged = undone(found, SimpleNamespace(state=SimpleNamespace(model=None)))
    assert all(f.wrong_form and f.depends_on == "heading" for f in judged)


@pytest.mark.parametrize(
    ("effect", "stale", "certainty"),
    [
        ("yaw_lever", True, "doubtful"),  # both change steady turns, which two arcs tell twice
        ("yaw_lever", False, "sure"),
        ("motor_lag", True, "sure"),  # changes tell it, however few commands there are
    ],
)
def test_beside_stale_numbers_few_commands_tell_no_steady_effect(effect, stale, certainty):
    found = [Finding(effect, None, [], 0.2, "sure")]
    found += [Finding(REFIT, None, [], 0.8, "sure")] if stale else []
    assert beside_stale(found)[0].certainty == certainty


def _loss(effect: str, size: float, *when_s: float) -> Finding:
    keys = {"floor_patch": ("strength",)}.get(effect, ("loss", "from_s", "until_s"))
    numbers = zip(keys, (size, *when_s), strict=False)
    own = [ParameterEstimate(f"{effect}.{k}", v, 0.02, "", False, True) for k, v in numbers]
    return Finding(effect, None, own, 0.4, "sure")


@pytest.mark.parametrize(
    ("losses", "certainty"),
    [
        # As large here and then: the place may be where the robot was at another time.
        ([("floor_patch", 0.15), ("abrupt_loss", 0.13, 80.0)], ["doubtful", "doubtful"]),
        ([("floor_patch", 0.4), ("abrupt_loss", 0.13, 80.0)], ["sure", "sure"]),
        # Dust that is driven away: no place that is as it is takes what is less later.
        ([("floor_patch", 0.1), ("abrupt_loss", -0.14, 137.0)], ["doubtful", "doubtful"]),
        ([("transient_loss", 0.2, 10.0, 20.0), ("abrupt_loss", 0.2, 40.0)], ["doubtful"] * 2),
        # One that begins slowly: the second is the first one's rest.
        ([("abrupt_loss", 0.15, 33.2), ("transient_loss", 0.1, 29.4, 34.4)], ["sure", "doubtful"]),
    ],
)
def test_losses_here_and_then_may_be_one_that_comes_and_goes(losses, certainty):
    judged = of_another_form([_loss(*own) for own in losses], NOTHING_LEFT)
    assert [f.certainty for f in judged] == certainty


@pytest.mark.parametrize(
    ("effect", "size", "doubted"),
    [
        ("floor_patch", -0.35, True),
        ("floor_patch", 0.35, False),
        ("transient_loss", -0.2, True),
        ("transient_loss", -0.03, False),  # within its error of 0.02
        ("turn_asymmetry", -0.2, False),  # has no sign that is usual
        ("speed_slip", -0.2, True),
        ("strafe_loss", -0.2, False),  # the base's own loss may be too large
    ],
)
def test_a_fault_that_makes_a_robot_faster_is_doubtful(effect, size, doubted):
    estimate = ParameterEstimate(f"{effect}.size", size, 0.02, "", False, True)
    assert bool(_faster(effect, [estimate])) == doubted


@pytest.mark.parametrize(
    ("loss", "side", "doubted"), [(0.016, 0.0, True), (0.016, 0.06, False), (0.06, 0.0, False)]
)
def test_a_loss_as_small_as_what_batteries_do_is_doubtful(loss, side, doubted):
    """Gains of a calibrated robot wander by 4 % in a run."""
    values = {"loss": loss, "side": side, "from_s": 30.0}
    own = [
        ParameterEstimate(f"abrupt_loss.{k}", v, 0.005, "", False, True) for k, v in values.items()
    ]
    assert bool(_wanders(catalogue()["abrupt_loss"], own)) == doubted


def test_one_window_that_misses_is_no_event():
    """Two of three stretches are seen by windows that overlap."""
    events = _events(np.array([10, 40, 41, 80, 81, 82]), np.arange(100) * 0.25)
    assert [list(e) for e in events] == [[40, 41], [80, 81, 82]]


def test_three_effects_of_one_kind_are_one_of_another_form():
    """A body that rolls on in a way of its own is late, sooner and late again at each stop."""
    names = ("lag_by_duty", "slew_limit", "motor_lag", "wheel_gain")
    judged = of_another_form([Finding(n, None, [], 0.3, "sure") for n in names], NOTHING_LEFT)
    assert [f.certainty for f in judged] == ["doubtful", "doubtful", "doubtful", "sure"]


@pytest.mark.parametrize(
    ("certainties", "outside"),
    [
        (["doubtful"] * 3, True),
        (["doubtful"] * 2, False),
        (["doubtful", "sure", "doubtful"], False),
    ],
)
def test_many_effects_of_which_none_is_sure_are_none_of_them(certainties, outside):
    """So many faults at once are rarer than one that nobody wrote down."""
    names = ("compass_deviation", "gain_slope", "yaw_lever")
    pairs = zip(names, certainties, strict=False)
    judged = of_many([Finding(n, None, [], 0.3, c) for n, c in pairs])
    assert all(f.wrong_form == outside for f in judged)


@pytest.mark.parametrize(("second", "outside"), [("floor_patch", True), ("yaw_lever", False)])
def test_two_doubtful_effects_of_one_kind_are_none_of_them(second, outside):
    """A floor that slopes and has a patch, neither surely, has something else at some place."""
    judged = of_many([Finding(n, None, [], 0.3, "doubtful") for n in ("gain_slope", second)])
    assert all(f.wrong_form == outside for f in judged)


@pytest.mark.parametrize(
    ("doubtful", "left", "certainty"),
    [(0.25, 0.22, "doubtful"), (0.25, 0.05, "sure"), (0.1, 0.22, "sure")],
)
def test_an_effect_that_takes_less_than_is_left_or_doubtful_is_not_sure(doubtful, left, certainty):
    found = [Finding("yaw_lever", None, [], 0.45, "sure")]
    found += [Finding("yaw_lag", None, [], doubtful, "doubtful")]
    first, _ = beside_more(found, Rest(left, False, ["past motion"]), catalogue())
    assert first.certainty == certainty


@pytest.mark.parametrize(
    ("gain", "left", "certainty"),
    [(-0.26, 0.18, "doubtful"), (-0.26, 0.05, "sure"), (-0.06, 0.18, "sure")],
)
@pytest.mark.parametrize(("wheel", "wheels"), [("rr", "mecanum"), ("w1", "omni3")])
def test_a_size_beyond_what_is_usual_is_not_sure_beside_a_rest(
    gain, left, certainty, wheel, wheels, tmp_path
):
    """A duty that leaks to the next motor had been a wheel weak by 26 %, surely."""
    path = tmp_path / "robot.toml"
    path.write_text(
        f'name = "r"\n[robot]\nwheel_radius_m = 0.03\nhalf_wheelbase_m = 0.1\nhalf_track_m = 0.1\n'
        f'[base]\ndrive = "twist"\nwheels = "{wheels}"\n'
    )
    weak = ParameterEstimate(f"wheel_gain.{wheel}", gain, 0.01, "", False, True)
    found = [Finding("wheel_gain", None, [weak], 0.8, "sure")]
    rest = Rest(left, True, ["coupling of the axes"])
    cards = catalogue_of(ModelFile.load(str(path)).model)
    (judged,) = beside_more(found, rest, cards)
    assert judged.certainty == certainty


@pytest.mark.parametrize(
    ("beside", "share", "certainty"),
    [
        ("motor_lag", 0.46, "doubtful"),
        ("motor_lag", 0.1, "sure"),
        ("floor_tilt", 0.46, "sure"),
    ],
)
def test_beside_a_doubtful_effect_that_acts_on_the_same_none_is_sure(beside, share, certainty):
    """Wheels that start stiffly had been motors that coast, surely, and a lag at its bound."""
    found = [Finding("coasting", None, [], 0.54, "sure")]
    found += [Finding(beside, None, [], share, "doubtful")]
    first, _ = of_another_form(found, NOTHING_LEFT)
    assert first.certainty == certainty


@pytest.mark.parametrize(("loss", "outside"), [(-0.07, True), (0.07, False)])
def test_a_loss_that_makes_it_faster_stands_for_what_runs_in_or_warms_up(loss, outside):
    (judged,) = of_another_form([_loss("abrupt_loss", loss, 34.0)], NOTHING_LEFT)
    assert (judged.wrong_form, judged.depends_on) == ((True, "time") if outside else (False, ""))


@pytest.mark.parametrize(
    ("effect", "group", "certainty"),
    [
        ("second_order_lag", "past motion", "doubtful"),  # a ramp of the duty is late, too
        ("second_order_lag", "change of the command", "doubtful"),
        ("second_order_lag", "heading", "sure"),
        ("speed_curve", "past motion", "sure"),
    ],
)
def test_a_lag_that_leaves_what_depends_on_the_past_has_another_form(effect, group, certainty):
    (judged,) = of_another_form([Finding(effect, None, [], 0.9, "sure")], Rest(0.1, True, [group]))
    assert judged.certainty == certainty


@pytest.mark.parametrize(
    ("effect", "moments", "certainty"),
    [("floor_patch", 4, "doubtful"), ("floor_patch", 0, "sure"), ("floor_tilt", 4, "sure")],
)
def test_a_small_place_beside_single_moments_may_be_some_of_them(effect, moments, certainty):
    """Ridges of a floor stop it here and there."""
    loss = ParameterEstimate(f"{effect}.strength", 0.6, 0.05, "", False, True)
    rest = Rest(0.05, False, [], events=Events((None,) * moments))
    (judged,) = of_another_form([Finding(effect, None, [loss], 0.9, "sure")], rest)
    assert judged.certainty == certainty


@pytest.mark.parametrize(
    ("names", "depends_on"),
    [
        (("compass_deviation", "yaw_lever"), ["heading"]),
        (("abrupt_loss",), ["time"]),
        (("abrupt_loss", "gain_slope"), ["place"]),  # as time goes by it comes to other places
        (("marker_offset",), []),
    ],
)
def test_what_doubtful_findings_act_on_is_what_something_else_depends_on(names, depends_on):
    found = [Finding(n, None, [], 0.3, "doubtful") for n in names]
    found += [Finding("speed_curve", None, [], 0.3, "sure"), Finding("stiction", None, [], 0.1, "")]
    assert acted_on(found, 0.2) == depends_on


def test_two_curves_of_the_speed_over_the_command_may_be_one():
    """Any odd curve is some dead zone and some bend; a gain of a wheel is no part of it."""
    found = [Finding(n, None, [], 0.3, "sure") for n in ("dead_zone", "speed_curve", "wheel_gain")]
    judged = of_another_form(found, NOTHING_LEFT)
    assert [f.certainty for f in judged] == ["sure", "doubtful", "sure"]
    assert "dead_zone" in judged[1].why


@pytest.mark.parametrize(
    ("one", "other", "left", "at_bound", "found"),
    [
        ("battery_sag", "heat_gain", 1.15, True, True),
        ("battery_sag", "heat_gain", 1.15, False, False),
        ("battery_sag", "heat_gain", 1.0, True, True),
        ("battery_sag", "heat_gain", 1.0, False, False),
        ("speed_curve", "heat_gain", 1.07, False, True),
        ("heat_gain", "speed_curve", 1.07, False, True),
        ("speed_curve", "heat_gain", 1.0, False, False),
        ("speed_curve", "floor_tilt", 1.07, False, False),
    ],
)
def test_what_goes_with_the_time_stands_beside_what_does_the_same(
    one, other, left, at_bound, found, monkeypatch
):
    """In a drive sorted by its commands the voltage, the heat and the speed run alike.

    Heat at its bound had been a battery that sags, surely, heat on rollers a curve of the speed.
    A warm pack of which nothing is left was the same: at its bound heat could not take all of it.
    """

    def trial(name, score, bound=False):
        return SimpleNamespace(
            names=(name,), held_score=score, own=[SimpleNamespace(at_bound=bound)]
        )

    monkeypatch.setattr(doubts, "estimates_of", lambda one, _: one.own)
    monkeypatch.setattr(doubts, "in_common", lambda *_: 0.9)
    taken, beside = trial(one, left), trial(other, 1.05 * left, at_bound)
    this = SimpleNamespace(before=trial("", 1.94), accepted=taken, trials=[taken, beside])
    done = SimpleNamespace(last=taken, round_of=lambda _: this)
    assert instead_over_time(done, one) == ([other] if found else [])


@pytest.mark.parametrize(
    ("one", "other", "score", "found"),
    [
        ("acceleration_limit", "yaw_lag", 1.06, True),  # a turn that comes with the way
        ("acceleration_limit", "yaw_lag", 1.0, False),
        ("acceleration_limit", "compass_deviation", 1.06, False),
    ],
)
def test_a_form_that_leaves_something_is_not_surely_the_one_of_its_family(
    one, other, score, found, monkeypatch
):
    """Turns that build up over the way driven had been turn rates that are ramped, surely."""
    monkeypatch.setattr(doubts, "estimates_of", lambda one, _: one.own)
    monkeypatch.setattr(doubts, "in_common", lambda *_: 0.9)
    trials = [
        SimpleNamespace(names=(n,), held_score=s, own=[])
        for n, s in ((one, score), (other, 1.02 * score))
    ]
    this = SimpleNamespace(
        before=SimpleNamespace(held_score=1.49), accepted=trials[0], trials=trials
    )
    done = SimpleNamespace(last=trials[0], found=[one], round_of=lambda _: this)
    assert instead_in_family(done, one, 0.1) == ([other] if found else [])


def test_a_stretch_in_which_the_model_is_right_is_not_told():
    """A later found effect explains it: it is no push, though the floor left it out."""
    random = np.random.default_rng(5)
    start_s = 0.25 * np.arange(400)
    missed = random.normal(0, 1e-3, (400, 5, 3))
    floor, keep = np.full((5, 3), 1e-3), np.ones(400, bool)
    keep[100:120] = False
    errors = {"right": missed, "wrong": np.where(keep[:, None, None], missed, 0.05)}
    data = SimpleNamespace(
        start_s=start_s, measured=missed + 0.1, floor=floor, errors=errors.__getitem__
    )
    told = [
        len(
            moments.left_out(
                SimpleNamespace(
                    trajectory=data, data=data, model=m, known_floor=SimpleNamespace(keep=keep)
                )
            )
        )
        for m in errors
    ]
    assert told == [0, 1]


def test_a_stretch_that_is_left_out_is_told(tanh_robot, measure, fitted):
    """At the begin the robot has half its speed: that is left out of what is judged, and told."""
    until_s = 3.0

    class Slow(tanh_robot):
        def wheels_mps(self, duty):
            rims = super().wheels_mps(duty)
            rims[: round(until_s / EULER_S)] *= 0.5
            return rims

    found = diagnose([measure(Slow(), 57, 60.0)], fitted)
    (told,) = [note for note in found.notes if "left out, as a push" in note]
    begin_s, end_s = (float(t) for t in re.search(r"from ([\d.]+) to ([\d.]+) s", told).groups())
    assert 0 <= begin_s < end_s == pytest.approx(until_s, abs=0.75)
