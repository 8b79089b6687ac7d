# SPDX-License-Identifier: Apache-2.0
"""`next --for`: where one number decides what the swarm does, the run tells that number."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import twinmill_native as native
from scipy.optimize import least_squares
from scipy.stats import chi2

from twinmill.data.measurement import load_measurements
from twinmill.experiment.design import Limits
from twinmill.experiment.moves import duty_axes, family
from twinmill.experiment.played import Played
from twinmill.fitting.fit import fitted
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import base_parameters
from twinmill.swarm import narrowing
from twinmill.swarm.narrowing import Spread, _without_clock, design_for
from twinmill_cli.main import run

NAMES = ["base.forward_gain", "base.yaw_gain", "sensor.range_m"]
STDS = np.array([0.1, 0.1, 0.05])
ERRORS = """
[base.std]
forward_gain = 0.1
yaw_gain = 0.1
[sensor.std]
range_m = 0.05
"""
LIMITS = Limits(20.0, (3.0, 3.0), 1.0)


@pytest.fixture(scope="module")
def file(brief_coasting_robot):
    """The model that the log was made with."""
    return ModelFile.load(str(brief_coasting_robot.true_model))


@pytest.fixture(scope="module")
def modelled(brief_coasting_robot, file):
    """Log and the model that it was made with."""
    (opened,) = open_measurements(load_measurements([brief_coasting_robot.log], file.model), file)
    return opened.modelled()


def spread(slope):
    return Spread(NAMES, np.diag(STDS**2), np.array([0.2, 0.8]), np.array(slope, float))


def turning(found):
    """Share of the driven duty that turns the robot on the spot."""
    duty = np.vstack([m.command for m in found.moves])
    turn = np.abs(duty @ [-1, 1, -1, 1])
    return turn.sum() / (turn + np.abs(duty.sum(axis=1))).sum()


def test_the_slope_is_that_of_a_planted_line():
    random = np.random.default_rng(1)
    slope = np.array([2.0, -1.0, 0.0])
    samples = random.normal(size=(400, 3)) * STDS
    shares = 0.5 + samples @ slope + 0.02 * random.normal(size=400)
    quantities = [
        SimpleNamespace(name=name, std=std, source="std")
        for name, std in zip(NAMES, STDS, strict=True)
    ]
    known = SimpleNamespace(quantities=quantities, samples=samples, covariance=np.diag(STDS**2))
    found = Spread.of(known, shares)
    np.testing.assert_allclose(found.slope, slope, atol=4 * 0.02 / STDS.min() / 20)
    assert found.std(known.covariance) == pytest.approx(np.hypot(0.2, 0.1), rel=0.05)
    assert next(iter(found.parts())) == NAMES[0]  # 4 of 5 parts of the variance


@pytest.mark.parametrize(("slope", "known"), [(0.0, False), (0.6, True)])
def test_a_slope_that_is_chance_is_told_from_one_that_is_not(slope, known):
    """Shares of 40 models by 20 runs each: binomial alone, or by the first of eight numbers."""
    random, count = np.random.default_rng(7), 0
    quantities = [SimpleNamespace(name=f"q{k}", std=0.1, source="std") for k in range(8)]
    for _ in range(200):
        samples = 0.1 * random.normal(size=(40, 8))
        p = np.clip(0.6 + 4 * slope * samples[:, 0], 0, 1)
        drawn = SimpleNamespace(quantities=quantities, samples=samples, covariance=np.eye(8) / 100)
        count += Spread.of(drawn, random.binomial(20, p) / 20).foretold > 0
    assert count > 190 if known else count < 30


def test_what_a_known_number_takes_is_what_conditioning_leaves():
    """Normal numbers: the variance of the outcome less that given one of them (Schur)."""
    columns = np.random.default_rng(4).normal(size=(3, 3))
    covariance, slope = columns @ columns.T, np.array([1.0, -2.0, 0.5])
    found = Spread(NAMES, covariance, np.array([0.2, 0.8]), slope)
    for i, name in enumerate(NAMES):
        given = covariance - np.outer(covariance[:, i], covariance[i]) / covariance[i, i]
        left = (slope @ given @ slope) / (slope @ covariance @ slope)
        assert found.known_takes()[name] == pytest.approx(1 - left)


def test_a_clock_that_must_be_found_takes_away_what_the_inverse_says():
    """The block of an inverse is the inverse of the Schur complement."""
    columns = np.random.default_rng(2).normal(size=(50, 5))
    gram = columns.T @ columns
    told = _without_clock(gram, 3)
    np.testing.assert_allclose(np.linalg.inv(told), np.linalg.inv(gram)[:3, :3], rtol=1e-6)


def test_the_run_tells_the_number_that_decides(modelled, file):
    forward = design_for(
        spread([3, 0, 0]), "milling", file=file, modelled=modelled, limits=LIMITS, excess=1.0
    )
    yaw = design_for(
        spread([0, 3, 0]), "milling", file=file, modelled=modelled, limits=LIMITS, excess=1.0
    )
    assert turning(yaw) > 0.6 > 0.4 > turning(forward)
    assert forward.untold == 0 and forward.rows.end_s <= LIMITS.duration_s
    for own, other in ((forward, yaw), (yaw, forward)):
        before, after = own.stds
        assert before == pytest.approx(0.3)
        assert after < 0.2 * before and after <= own.spread.std(other.covariance)
        assert own.spread.std(own.bound) < after


def test_what_no_drive_shows_is_said(modelled, file):
    found = design_for(
        spread([3, 0, 6]), "milling", file=file, modelled=modelled, limits=LIMITS, excess=1.0
    )
    assert found.untold == pytest.approx(0.5)
    assert found.stds[1] == pytest.approx(0.3, rel=0.05)  # what the range leaves open stays
    with pytest.raises(ValueError, match=r"sensor.range_m.*no drive of one robot shows"):
        design_for(
            spread([0, 0, 6]), "milling", file=file, modelled=modelled, limits=LIMITS, excess=1.0
        )


@pytest.fixture
def planted(brief_coasting_robot, tmp_path, monkeypatch):
    """Swarms mill where the robots turn quickly enough, whatever else they do."""
    text = brief_coasting_robot.true_model.read_text()
    (tmp_path / "m.toml").write_text(text + "[sensor]\nrange_m = 1.1\n" + ERRORS)
    monkeypatch.chdir(tmp_path)

    def ends(request, worlds):
        mills = request.model.get("base.yaw_gain") > 1
        return {"class": ["milling" if mills else "cluster" for _ in worlds]}

    monkeypatch.setattr(narrowing, "run_part", ends)
    return ["next", str(brief_coasting_robot.log), "--model", "m.toml", "--for", "milling"]


def test_the_command_writes_the_script_and_says_why(planted, capsys):
    run([*planted, "--draws", "30", "--duration-s", "20", "--floor-m", "3x3", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert next(iter(found["parts"])) == "base.yaw_gain" and found["parts"]["base.yaw_gain"] > 0.8
    assert found["std_after"] < 0.5 * found["std_before"]
    with open("script.csv") as script:
        assert next(script).startswith("t_s,fl_pct")


def test_where_all_draws_end_alike_there_is_nothing_to_narrow(planted, monkeypatch):
    monkeypatch.setattr(
        narrowing, "run_part", lambda r, worlds: {"class": ["milling"] * len(worlds)}
    )
    with pytest.raises(ValueError, match=r"end alike \(100% to 100%"):
        run([*planted, "--draws", "6"])


def refit(modelled, moves, gains, seed):
    """Both gains from one drive of a robot that has `gains`: by ways over a quarter of a second.

    Nothing of the design's: the twin drives with its noise, SciPy fits the ways that it went.
    """
    played = Played.of([moves], modelled)
    stride = round(0.25 / modelled.measurement.track.timing.pose_period_s)

    def ways(pose):
        d = pose[stride:] - pose[:-stride]
        c, s = np.cos(pose[:-stride, 2]), np.sin(pose[:-stride, 2])
        return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], 0.1 * d[:, 2]], 1)

    def model(values):
        made = modelled.model.copy()
        for name, value in zip(NAMES, values, strict=False):
            made.set(name, float(value))
        return made

    start = np.zeros((len(played.part), 3))
    seen = ways(native.replica(model(gains), played._track(start), seed))
    prior = STDS[:2]

    def off(values):
        ways_off = (ways(played.path(model(values), start[0])) - seen).ravel() / 1e-3
        return np.concatenate([ways_off, (values - 1) / prior])

    return least_squares(off, np.ones(2), diff_step=1e-3).x


def test_a_refit_knows_the_outcome_best_after_the_run_that_was_designed_for_it(modelled, file):
    """Runs as long: that for the other gain, and moves at random. The outcome is planted."""
    random = np.random.default_rng(3)
    truths = 1 + STDS[:2] * random.normal(size=(40, 2))
    slope = np.array([0.3, 3.0])
    limits = Limits(13.0, (3.0, 3.0), 1.0)
    own = design_for(
        spread([*slope, 0]), "milling", file=file, modelled=modelled, limits=limits, excess=1.0
    )
    other = design_for(
        spread([3, 0, 0]), "milling", file=file, modelled=modelled, limits=limits, excess=1.0
    )
    moves = family(duty_axes(1.0))
    runs = {"own": own.moves, "other": other.moves}
    for k in range(3):
        order = [moves[i] for i in random.permutation(len(moves))]
        ends_s = np.cumsum([m.duration_s for m in order])
        runs[f"random {k}"] = order[: int(np.searchsorted(ends_s, 11.0))]
    left = {
        name: np.sqrt(
            np.mean([(slope @ (refit(modelled, run, t, k) - t)) ** 2 for k, t in enumerate(truths)])
        )
        for name, run in runs.items()
    }
    assert left["own"] == min(left.values())
    assert left["own"] < 0.2 * own.stds[0]


def test_fits_to_the_run_come_as_near_as_was_promised(modelled, file):
    """Robots with gains drawn from the errors drive it, and the tool's own fit is asked.

    Errors are squared over what was promised: chi squared, if the promise is no better than true.
    """
    slope = np.array([0.3, 3.0])
    own = design_for(
        spread([*slope, 0]), "milling", file=file, modelled=modelled, limits=LIMITS, excess=1.0
    )
    planned = narrowing.driven(own.moves, modelled)
    truths = 1 + STDS[:2] * np.random.default_rng(5).normal(size=(6, 2))
    off = []
    for k, truth in enumerate(truths):
        made = modelled.model.copy()
        for name, value in zip(NAMES, truth, strict=False):
            made.set(name, float(value))
        seen = planned.with_pose(native.replica(made, planned.played, 100 + k))
        opened = open_measurements([seen], file)
        _, found = fitted(opened, base_parameters(file.model, NAMES[:2]))
        told = {e.name: e.value for e in found.shared_estimates()}
        off.append(np.dot(slope, [told[n] - v for n, v in zip(NAMES, truth, strict=False)]))
    print("promised", own.stds, "bound", own.spread.std(own.bound), "came", np.std(off))
    assert np.sum(np.square(off)) / own.stds[1] ** 2 < chi2.ppf(0.999, len(off))
