# SPDX-License-Identifier: Apache-2.0
"""What misleads a diagnosis, each with a robot that is not the twin or with algebra."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.evidence import State, attempt, fall
from twinmill.diagnosis.search import ALPHA
from twinmill.fitting.compare import compare, open_scenes
from twinmill.fitting.fit import fit, refit
from twinmill.fitting.heldout import held_out
from twinmill.fitting.solve import huber, solve
from twinmill.model.freedom import base_quantities, catalogue, effect_quantities
from twinmill.model.model_file import ModelFile
from twinmill.predict.folds import MARGIN_S, halves, step_mask

MEMORY_S = 0.15


@pytest.fixture(scope="module")
def fitted(tanh_robot, measure, model_file, tmp_path_factory) -> ModelFile:
    """The base fitted to a log of the robot as it is, on clocks that later logs share."""
    path = tmp_path_factory.mktemp("pitfalls") / "fitted.toml"
    fit([measure(tanh_robot(), 1, 40.0)], model_file(), path, "")
    return ModelFile.load(str(path))


@pytest.fixture(scope="module")
def on_own_clock(fitted, tmp_path_factory) -> ModelFile:
    """The same without what the log told of the clocks."""
    text = Path(fitted.path).read_text()
    path = tmp_path_factory.mktemp("own_clock") / "fitted.toml"
    path.write_text(text[: text.index("[clock]")] + text[text.index("[fit]") :])
    return ModelFile.load(str(path))


FLEXIBLE = "p0*sin(7*theta) + p1*cos(7*theta) + p2*sin(5*theta) + p3*cos(5*theta)"


def test_a_flexible_formula_wins_where_it_is_fitted_and_loses_where_it_is_not(
    tanh_robot, measure, fitted
):
    """Nothing is hidden. Wilks 1938: four needless parameters lower chi2 by 4 on average.

    A fit to one half is as far off as chance takes it, so that the other half is told worse: by as
    much as a fit to all gains, twice over for each of the two.
    """
    gains, losses = [], []
    for seed in range(5):
        scenes = open_scenes([measure(tanh_robot(), 200 + seed, 20.0)], fitted)
        base = base_quantities(fitted.model, ())
        refit(scenes, base)
        richer = fitted.model.copy()
        for name in (f.name for f in base):
            richer.set(name, scenes[0].model.get(name))
        richer.add_effect("equation", {"adds_to": "vx_mps", "formula": FLEXIBLE})
        grown = [s.with_model(richer) for s in scenes]
        free = base + effect_quantities(richer)
        solve(grown, free)
        floors = [np.ones((5, 3))]
        gains.append(huber(scenes[0].white_errors()) - huber(grown[0].white_errors()))
        losses.append(held_out(grown, free, floors).chi2 - held_out(scenes, base, floors).chi2)
    assert min(gains) > 0
    assert np.mean(losses) > 0


def explained_by_neighbours(noise, t_s, train, test) -> float:
    """Share of the test samples' energy that the mean of the training ones near them explains."""
    place = (t_s / 0.05).astype(int)
    sums, counts = (np.bincount(place[train], w) for w in (noise[train], None))
    size = place.max() + 1
    sums, counts = (np.pad(a, (0, size - len(a))) for a in (sums, counts))
    told = (sums / np.maximum(counts, 1))[place[test]]
    return 1 - np.sum((noise[test] - told) ** 2) / np.sum(noise[test] ** 2)


def test_samples_in_turn_leak_and_our_halves_do_not(tanh_robot, measure, fitted):
    """A first-order noise is all there is; neighbours of 1/120 s hang together by 0.95."""
    (scene,) = open_scenes([measure(tanh_robot(), 7, 40.0)], fitted)
    t_s = scene.grid.t_s
    keep = np.exp(-scene.grid.period_s / MEMORY_S)
    random, noise = np.random.default_rng(1), np.zeros(len(t_s))
    for k, fresh in enumerate(random.normal(size=len(t_s) - 1)):
        noise[k + 1] = keep * noise[k] + np.sqrt(1 - keep**2) * fresh
    odd = np.arange(len(t_s)) % 2 == 1
    assert explained_by_neighbours(noise, t_s, ~odd, odd) > 0.8
    half = halves(scene)
    own, other = (step_mask(scene, half, which) for which in (0, 1))
    assert abs(explained_by_neighbours(noise, t_s, own, other)) < 0.02
    assert np.exp(-MARGIN_S / MEMORY_S) ** 2 < 0.02  # of what a step tells of one a margin later


def test_stale_gains_are_no_missing_effect(tanh_robot, measure, fitted):
    """Another battery and another floor: all speeds and turns are lower, nothing is new."""
    robot = tanh_robot()
    tired = replace(robot, top_mps=0.92 * robot.top_mps, yaw=0.9 * robot.yaw)
    found = diagnose([measure(tired, 8, 40.0)], fitted)
    assert found.verdict == "refit_enough" and found.found == []
    assert found.score_refit < 0.8 * found.before.score


DELAY_S, MORE_LAG_S = 0.03, 0.05
EULER_S = 1 / 480


@pytest.fixture(scope="module")
def late(tanh_robot, measure):
    """Poses that come 30 ms later, of wheels that are slower by 50 ms."""
    robot = tanh_robot()
    return measure(replace(robot, offset_s=DELAY_S, lag_s=robot.lag_s + MORE_LAG_S), 10, 40.0)


@pytest.fixture(scope="module")
def lateness(late, fitted):
    """What is said where the clocks are those of the log that the base was fitted to."""
    return diagnose([late], fitted)


def test_on_the_clocks_of_a_calibration_log_a_shift_in_time_is_a_delay(lateness):
    """T - d as a delayed command, or as a clock that is off: the same in every pose."""
    told = lateness.to_json()
    assert told["verdict"] == "effect_missing"
    assert set(told["found"]) == {"motor_lag", "input_delay"}
    delay = next(e for r in lateness.ranking for e in r.parameters if e.name.startswith("input_de"))
    assert delay.value == pytest.approx(DELAY_S, abs=3 * delay.std + 2 * EULER_S)
    assert any("rests on the calibration log" in note for note in lateness.notes)


def test_sum_of_delay_and_lag_is_told_beside_its_parts(lateness, tanh_robot):
    (together,) = lateness.sums
    truth_s = tanh_robot().lag_s + MORE_LAG_S + DELAY_S
    assert together.value == pytest.approx(truth_s, abs=3 * together.std + 2 * EULER_S)
    named = {
        e.name: e for r in lateness.ranking if r.effect in lateness.found for e in r.parameters
    }
    # What is reported of the lag is what it is beside the delay, not before that was found.
    lag = named["motor_lag.extra_s"]
    assert lag.value == pytest.approx(MORE_LAG_S, abs=3 * lag.std + EULER_S)
    assert any("together" in note for note in lateness.notes)


def test_on_a_clock_of_its_own_a_log_tells_no_delay(late, on_own_clock):
    found = diagnose([late], on_own_clock)
    assert "motor_lag" in found.found
    assert not {"input_delay", "clock_offset"} & set(found.found)
    assert {"input_delay", "clock_offset"} <= {effect for effect, _ in found.not_identifiable}
    assert found.sums == []
    assert any("calibration log on the same clocks" in note for note in found.notes)


def test_an_estimate_at_its_bound_is_said_to_be_worth_little(tanh_robot, measure, fitted):
    """The robot rolls on with 0.02 m/s^2; the catalogue's coasting ends at 0.05."""
    found = diagnose([measure(tanh_robot(coast_mps2=0.02), 13, 30.0)], fitted)
    assert "coasting" in found.found
    drag = next(e for r in found.ranking for e in r.parameters if e.name.startswith("coasting.dec"))
    assert drag.at_bound
    assert any("at its bound" in note and drag.name in note for note in found.notes)
    assert f"{drag.name} is at its bound" in found.sentence


def test_a_log_without_any_noise_tells_no_more_than_there_is(
    tanh_robot, measure, model_file, tmp_path
):
    """What is left is 480 Hz Euler against the twin's own step: micrometres, and no physics."""
    silent = tanh_robot(sensor_m=0, sensor_rad=0, drive_mps=0, drive_radps=0)
    fit([measure(silent, 13, 30.0)], model_file(), tmp_path / "silent.toml", "")
    found = diagnose([measure(silent, 14, 30.0)], ModelFile.load(str(tmp_path / "silent.toml")))
    assert found.verdict in ("model_adequate", "refit_enough") and found.found == []


def test_a_patch_of_the_floor_wins_on_fit_and_is_no_evidence(tanh_robot, measure, fitted):
    """Nothing is hidden. A patch finds a place whose noise it fits, and tells nothing of it."""
    for seed in range(300, 304):
        scenes = open_scenes([measure(tanh_robot(), seed, 20.0)], fitted)
        base = base_quantities(fitted.model, fitted.told_by_others([]))
        refit(scenes, base)
        state = State(scenes, base, [np.ones((5, 3))])
        before, trial = attempt(state, ()), attempt(state, ("floor_patch",))
        assert trial.fitted_chi2 < before.fitted_chi2
        assert fall(before, trial) / 2 < np.log(len(catalogue()) / ALPHA)


RAMP_S, PLAY_S = 0.1, 0.05


def slewed(duty: np.ndarray) -> np.ndarray:
    """Duties that take 0.1 s from 0 to 1."""
    now, limited = np.zeros(4), np.empty_like(duty)
    for k, wanted in enumerate(duty):
        now = now + np.clip(wanted - now, -EULER_S / RAMP_S, EULER_S / RAMP_S)
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


@pytest.mark.parametrize(
    ("spoilt", "name"), [(slewed, "slew_limit"), (with_play, "reversal_dead_time")]
)
def test_what_only_resembles_a_lag_is_not_called_one(tanh_robot, measure, fitted, spoilt, name):
    """With its own name unknown, a lag or a delay explains most, but differs from step to step."""

    class Odd(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(spoilt(duty))

    found = diagnose([measure(Odd(), 15, 30.0)], fitted, barred=(name,))
    assert found.verdict == "outside_catalogue"
    assert "change of the command" in [g.group for g in found.omnibus.groups]


def test_dead_zone_and_curve_are_both_found_in_a_log(tanh_robot, measure, model_file):
    """Wheels stand below 0.2 of the duty and then rise as a root; the base is a straight line."""

    class Worn(tanh_robot):
        def speed_mps(self, duty):
            over = np.maximum(np.abs(duty) - 0.2, 0) / 0.8
            return np.sign(duty) * self.top_mps * np.sqrt(over)

    line = model_file(("[0, 25, 50, 75, 100]", "[0, 100]"), ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.4]"))
    found = diagnose([measure(Worn(), 12, 40.0)], line)
    assert set(found.found) == {"dead_zone", "speed_curve"}
    assert found.steps[-1][1] < 0.4 * found.steps[0][1]


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
