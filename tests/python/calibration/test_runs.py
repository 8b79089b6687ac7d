# SPDX-License-Identifier: Apache-2.0
"""Runs of one robot that differ are told to, and what is of one run is predicted into no other."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.diagnosis.finding import Finding, of_all, part_of_all
from twinmill.diagnosis.formula import Formula, Number
from twinmill.diagnosis.formula_telling import drives_back
from twinmill.diagnosis.moments import Moment, every_s, sentence
from twinmill.fitting.compare import compare
from twinmill.formulas.forms import Form, Motion
from twinmill.model.model_file import ModelFile

LAGS_S = (0.09, 0.12, 0.15, 0.18)  # the base has 0.09
RUN_S = 20.0
LEVELS_PCT = (25, 50, 75, 100)


@pytest.fixture(scope="module")
def slowed(tanh_robot):
    """One that drags a load from some moment of its run to another."""

    class Slowed(tanh_robot):
        def wheels_mps(self, duty):
            speeds = super().wheels_mps(duty)
            middle = slice(len(duty) // 3, 2 * len(duty) // 3)
            speeds[middle] *= 0.7
            return speeds

    return Slowed()


def test_runs_whose_lags_differ_are_told_as_such_before_place_or_time(
    tanh_robot, measure, one_clock_base, tmp_path
):
    runs = [measure(tanh_robot(lag_s=s), 300 + k, RUN_S) for k, s in enumerate(LAGS_S)]
    told = explain(runs, one_clock_base, out=tmp_path / "runs.toml", command="")
    found = told.diagnosis
    assert found.verdict == "outside_catalogue" and found.found == []
    assert found.sentence.startswith("Runs differ in motor lag (0.")
    assert "place" not in found.sentence and "time" not in found.sentence
    (lag,) = found.apart.numbers
    assert [*lag.values.values()] == pytest.approx(LAGS_S, abs=0.006)
    assert [*lag.values] == ["run.lcmlog", *(f"run.lcmlog ({k})" for k in (2, 3, 4))]
    # The model has their middle, as unsure as they differ, and no run's own.
    model = ModelFile.load(str(tmp_path / "runs.toml"))
    assert model.model.get("base.motor_lag_s") == pytest.approx(np.mean(LAGS_S), abs=0.004)
    assert "[robots" not in model.text and "motor_lag_s = 0.03" in model.text.split("[base.std]")[1]
    assert compare(runs, model).score < compare(runs, one_clock_base).score


def test_the_middle_of_runs_is_not_written_where_the_model_as_given_predicts_them_better(
    tanh_robot, measure, one_clock_base, tmp_path
):
    """Two runs of three have the base's lag: their middle suits none."""
    runs = [measure(tanh_robot(lag_s=s), 305 + k, RUN_S) for k, s in enumerate((0.09, 0.09, 0.17))]
    told = explain(runs, one_clock_base, out=tmp_path / "runs.toml", command="")
    assert told.diagnosis.apart.whose == "runs" and not told.gained
    written = ModelFile.load(str(tmp_path / "runs.toml"))
    assert written.model.get("base.motor_lag_s") == one_clock_base.model.get("base.motor_lag_s")
    before = compare(runs, one_clock_base).score
    assert compare(runs, written).score == pytest.approx(before) == told.after.score


@pytest.mark.parametrize(("at", "share"), [("top_mps", 0.8), ("yaw", 0.85)])
def test_two_runs_of_one_robot_whose_gains_differ_are_told_to(
    at, share, tanh_robot, measure, one_clock_base
):
    """Place had been blamed: both runs were never at the same one."""
    usual = tanh_robot()
    other = replace(usual, **{at: share * getattr(usual, at)})
    found = diagnose([measure(usual, 306, 40.0), measure(other, 307, 40.0)], one_clock_base)
    assert found.apart.whose == "runs" and found.sentence.startswith("Runs differ in ")
    gain = "theta_a1" if at == "top_mps" else "theta_a2"
    (number,) = [n for n in found.apart.numbers if n.name == gain]
    first, second = number.values.values()
    assert second / first == pytest.approx(share, rel=0.02)


def test_runs_that_differ_are_outside_the_catalogue_and_the_sentence_does_not_deny_it(
    tanh_robot, measure, one_clock_base
):
    """The second is slower and more sluggish; the base is that of the first."""
    other = replace(tanh_robot(lag_s=0.15), top_mps=0.9 * tanh_robot().top_mps)
    runs = [
        replace(measure(robot, 340 + k, 40.0), log_name=f"run{k}.lcmlog")
        for k, robot in enumerate((tanh_robot(), other))
    ]
    found = diagnose(runs, one_clock_base)
    assert found.verdict == "outside_catalogue" and found.apart.missed == ("run1.lcmlog",)
    assert "othing else is missing" not in found.sentence
    assert "misses run1.lcmlog" in found.sentence and "Within each run nothing" in found.sentence


def weaker(tanh_robot, shares):
    """The robot with so much of the speed of its wheels: front left, front right, rear ones."""

    class Weaker(tanh_robot):
        def wheels_mps(self, duty):
            return super().wheels_mps(duty) * shares

    return Weaker()


@pytest.mark.parametrize(
    ("shares", "words"),
    [
        ((1, 1, 0.94, 1), "rear left wheel"),
        ((0.9, 1, 1, 1), "front left wheel"),
        ((0.94, 1, 0.94, 1), "left wheels"),
    ],
)
def test_the_run_in_which_a_wheel_is_weaker_is_named_with_the_wheel_and_by_how_much(
    tanh_robot, measure, one_clock_base, shares, words
):
    """Common to both runs would be half of it, and is in neither."""
    runs = [
        replace(measure(robot, 350 + k, 40.0), log_name=f"run{k}.lcmlog")
        for k, robot in enumerate((tanh_robot(), weaker(tanh_robot, shares)))
    ]
    found = diagnose(runs, one_clock_base)
    (odd,) = found.runs_off
    assert odd.log_name == "run1.lcmlog" and odd.effect == "wheel_gain"
    values = [e.value for e in odd.parameters]
    assert values == pytest.approx(np.array(shares) - 1, abs=0.015)
    assert found.sentence.startswith(f"Run run1.lcmlog differs: {words}")
    assert found.found == [] and found.to_json()["runs_off"][0]["log"] == "run1.lcmlog"


def test_what_the_other_run_does_not_show_sets_no_run_apart(tanh_robot, measure, one_clock_base):
    """It is dragged along whenever it strafes, and the first run never does."""

    class Dragged(tanh_robot):
        def hindered(self, motion):
            return motion * (1, 0.75, 1)

    random = np.random.default_rng(358)
    legs = (
        random.choice((0, *LEVELS_PCT), 40)[:, None] * np.ones(4) * random.choice((-1, 1), (40, 1))
    )
    ahead = np.repeat(legs, 48, axis=0).astype(int)  # a second each
    runs = [measure(Dragged(), 358, script_pct=ahead), measure(Dragged(), 359, 40.0)]
    found = diagnose(runs, one_clock_base)
    assert found.runs_off == () and found.verdict != "model_adequate"


def fleet(measure, robots):
    """Measurements of robots by run, which each drive in each of them."""
    return [
        replace(
            own := measure(robot, 360 + 10 * run + k, 25.0),
            track=replace(own.track, robot_id=k),
            log_name=f"run{run}.lcmlog",
            log_sha256=str(run),
        )
        for run, row in enumerate(robots)
        for k, robot in enumerate(row)
    ]


def test_runs_of_four_robots_that_all_are_slower_in_the_second_are_told_to_differ(
    tanh_robot, measure, one_clock_base
):
    """As on a softer floor; each robot alone is as the others."""
    slower = replace(tanh_robot(), top_mps=0.85 * tanh_robot().top_mps)
    found = diagnose(fleet(measure, [[tanh_robot()] * 4, [slower] * 4]), one_clock_base)
    assert found.apart.whose == "runs" and found.robots_off == ()
    (speed,) = [n for n in found.apart.numbers if n.name == "theta_a1"]
    assert [*speed.values] == ["run0.lcmlog", "run1.lcmlog"]
    first, second = speed.values.values()
    assert second / first == pytest.approx(0.85, abs=0.01)


def test_robots_that_differ_alike_in_two_runs_are_told_to(tanh_robot, measure, one_clock_base):
    row = [tanh_robot(lag_s=s) for s in (0.08, 0.10, 0.12, 0.14)]
    found = diagnose(fleet(measure, [row, row]), one_clock_base)
    assert found.apart.whose == "robots" and found.robots_off == ()


def test_equal_runs_are_not_told_to_differ(tanh_robot, measure, one_clock_base):
    found = diagnose([measure(tanh_robot(), 310 + k, RUN_S) for k in range(4)], one_clock_base)
    assert found.apart is None and found.verdict == "model_adequate"


def test_equal_runs_at_other_speeds_do_not_differ_by_what_no_model_knows(
    tanh_robot, measure, one_clock_base
):
    """Left turns are faster than right ones by what no effect knows; runs turn more or less."""

    class Lopsided(tanh_robot):
        def wheels_mps(self, duty):
            speeds = super().wheels_mps(duty)
            spin = (speeds * (-1, 1, -1, 1)).mean(axis=1)
            return speeds + 0.1 * np.abs(spin)[:, None] * (-1, 1, -1, 1)

    found = diagnose([measure(Lopsided(), 320 + k, RUN_S) for k in range(4)], one_clock_base)
    assert found.apart is None


def test_a_load_of_one_run_is_predicted_into_no_other(
    slowed, tanh_robot, measure, one_clock_base, tmp_path
):
    path = tmp_path / "explained.toml"
    told = explain([measure(slowed, 330, 60.0)], one_clock_base, out=path, command="")
    assert told.diagnosis.found and told.diagnosis.lasting == []
    assert told.diagnosis.passing == told.to_json()["passing"] == told.diagnosis.found
    assert "may be of this run alone" in told.left_out
    other = [measure(tanh_robot(), 331, 40.0)]
    assert compare(other, ModelFile.load(str(path))).score <= compare(other, one_clock_base).score
    shares = [f.share for f in told.diagnosis.findings]
    assert sum(shares) + told.diagnosis.rest.share == pytest.approx(1.0)


@pytest.mark.parametrize(("size", "back"), [(-2.87, True), (-0.8, False)])
def test_a_formula_that_turns_a_speed_round_is_none(size, back):
    """At 0.055 m/s the first one leaves (1 - 2.87) times the speed: 0.10 m/s backwards."""
    speed_mps = np.linspace(-0.2, 0.2, 201)
    names = {"vx": speed_mps, "t": np.arange(201.0)}
    log = SimpleNamespace(response=SimpleNamespace(step_s=np.ones(201)))
    motion = Motion([log], np.column_stack([speed_mps] * 3), names, ())
    around = Form("vx_mps", ("vx*max(0, 1 - abs(abs(vx)/0.055 - 1)/0.4)",), "speed", sizes=(1.0,))
    number = Number("p0", size, size, size, "1")
    found = Formula((around,), (number,), 0.5, 0.001, 100, 1.0, {"vx": (-0.2, 0.2)}, None)
    assert drives_back(SimpleNamespace(motion=motion), found) == back


@pytest.mark.parametrize(
    ("times_s", "period_s"),
    [
        ([3.4, 18.4, 33.5, 48.4, 63.4], 15.0),
        ([3.4, 18.4, 48.4, 63.4, 78.3], 15.0),  # one of them was missed
        ([6.5, 20.3, 37.8, 42.9, 58.1], 0.0),  # of chance
        ([3.4, 18.4, 33.5], 0.0),
    ],
)
def test_moments_that_come_back_by_a_clock_are_told_with_their_period(times_s, period_s):
    moments = [Moment("run.lcmlog", 3, t_s, 0.6, "less") for t_s in times_s]
    assert every_s(moments) == pytest.approx(period_s, abs=0.1)
    assert ("one every 15.0 s as by a clock" in sentence(moments)) == (period_s > 0)


def test_shares_that_are_told_make_all_of_what_was_there():
    """30 and 0 % by two effects, 79 % left over: 109 % of one thing."""
    findings = [Finding(n, None, [], s, "sure") for n, s in (("motor_lag", 0.3), ("drag", 0.0))]
    told = [*(f.share for f in of_all(findings, 0.79)), 0.79 * part_of_all(findings, 0.79)]
    assert told == pytest.approx([30 / 109, 0.0, 79 / 109])
    assert part_of_all([], 0.4) == 1.0  # drifting gains took the rest
