# SPDX-License-Identifier: Apache-2.0
"""The exam draws what it says, its plants obey algebra, and it cannot be passed by cheating."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native

from twinmill.experiment.drives import drive
from twinmill.model.parameters import catalogue
from twinmill_lab.challenge import command
from twinmill_lab.challenge.cases import CASES, LEAST, Floors, draw, draw_robots, seal
from twinmill_lab.challenge.intervals import SETS, coverage, draw_known, errors
from twinmill_lab.challenge.physics import STEP_S, Signals, catalogue_forms, outside_forms, slow
from twinmill_lab.challenge.robots import KINDS
from twinmill_lab.challenge.rollers import drive_by_forces
from twinmill_lab.challenge.run import Plan, play
from twinmill_lab.challenge.scoring import BARS, rate, scored, summary

SEED, SECONDS = 7, 40
ROBOTS = draw_robots(SEED)
DRAWN = [draw(number, SEED, ROBOTS, SECONDS) for number in range(24)]
NAMES = sorted(set(catalogue()) - {"equation"})


def found(*names, groups=(), verdict="effect_missing", rest=(), parameters=()):
    """A diagnosis that finds these names, each sure, or in a group of that position."""
    findings = [
        {
            "effect": name,
            "group": groups[k] if k < len(groups) else None,
            "parameters": list(parameters),
            "certainty": "group" if k < len(groups) and groups[k] else "sure",
        }
        for k, name in enumerate(names)
    ]
    told = {"share": 0.3 if rest else 0.0, "depends_on": list(rest), "formula": None}
    return {"verdict": verdict, "findings": findings, "rest": told}


def case_of(kind):
    return next(case for case in DRAWN if case.kind == kind)


def test_same_seed_same_sealed_answers_and_another_seed_others():
    again = [draw(number, SEED, draw_robots(SEED), SECONDS) for number in range(6)]
    other = [draw(number, SEED + 1, draw_robots(SEED + 1), SECONDS) for number in range(6)]
    assert seal(again) == seal(DRAWN[:6])
    assert seal(other) != seal(DRAWN[:6])


def test_no_two_logs_share_their_noise():
    assert len({case.plan.seed for case in DRAWN}) == len(DRAWN)


def test_every_kind_of_case_and_every_robot_is_drawn():
    assert {case.kind for case in DRAWN} == set(CASES)
    assert {case.robot for case in DRAWN} == set(range(len(KINDS)))
    assert {r.plant for r in ROBOTS} == {"planar", "mujoco", "rollers"}
    assert {r.drive for r in ROBOTS} == {"duty", "wheel_speed", "twist"}


def test_what_is_hidden_shows():
    for case in DRAWN:
        assert len(case.hidden) == {"none": 0, "two": 2}.get(case.kind, 1)
        assert all(adds >= LEAST for adds in case.adds_floors)


def test_plain_forms_have_the_catalogues_names_and_numbers():
    for robot in ROBOTS:
        for h in catalogue_forms(robot, np.random.default_rng(1)):
            card = catalogue()[h.name]
            if h.kind == "plain":
                names = {p["name"] for p in card["parameters"]}
                assert set(h.values) <= names | {"moment"}  # a share of the log, not yet a time
                for p in card["parameters"]:
                    value = h.values.get(p["name"], p["neutral"])
                    assert p["min"] <= value <= p["max"]


def test_what_is_hidden_in_two_wheels_is_the_same_for_both_of_a_side():
    """A robot on two wheels has each twice in the plants: its poses tell their mean alone."""
    robot = next(r for r in ROBOTS if r.wheels == "differential" and r.drive == "duty")
    for h in catalogue_forms(robot, np.random.default_rng(1)):
        front = {k[1:]: v for k, v in h.values.items() if k.startswith(("fl", "fr"))}
        rear = {k[1:]: v for k, v in h.values.items() if k.startswith(("rl", "rr"))}
        assert front == rear


def test_what_is_outside_is_not_in_the_catalogue_and_says_what_it_depends_on():
    for robot in ROBOTS:
        for h in outside_forms(robot, np.random.default_rng(1)):
            assert h.name not in catalogue()
            assert h.depends_on


@pytest.mark.parametrize("wheels", ["mecanum", "differential", "omni3"])
def test_wheels_that_roll_as_told_move_the_body_as_told(wheels):
    robot = next(r for r in ROBOTS if r.wheels == wheels)
    twist = np.array([0.2, 0.1 * robot.sideways, 0.5])
    assert robot.to_body @ (robot.to_wheels @ twist) == pytest.approx(twist)


def test_a_steady_turn_is_a_circle():
    """At v = 0.3 m/s and w = 0.6 rad/s the radius is v/w = 0.5 m."""
    robot = replace(ROBOTS[5], top_mps=0.3, gains=(1.0, 1.0, 1.0), drive="twist", lag_s=0.01)
    motion = play(Plan(robot, [(20.0, np.array([1.0, 0, 0.3]))], 1), calm=True)
    late = motion.pose[round(2 / STEP_S) :, :2]
    middle = 0.5 * (late.max(axis=0) + late.min(axis=0))
    assert np.hypot(*(late - middle).T) == pytest.approx(0.5, rel=0.002)


def test_a_lag_is_behind_a_ramp_by_its_time():
    """Settled, y = t - T: a step has its mean; its end would be half a step early."""
    ramp_s = STEP_S * np.arange(1000)
    assert slow(ramp_s, 0.1)[-1] == pytest.approx(ramp_s[-1] - 0.1, abs=1e-5)


def test_a_marker_beside_the_middle_moves_only_in_turns():
    robot = ROBOTS[0]
    marker = next(
        h for h in catalogue_forms(robot, np.random.default_rng(1)) if h.name == "marker_offset"
    )
    still = np.zeros((3, 3))
    still[:, 2] = [0, np.pi / 2, np.pi]
    none = Signals(robot, still, still[:, 0], still, np.random.default_rng(1))
    seen = marker.act(still, {"x_m": 0.1, "y_m": 0.0}, none)
    assert seen[:, :2] == pytest.approx(np.array([[0.1, 0], [0, 0.1], [-0.1, 0]]), abs=1e-12)


@pytest.mark.parametrize(("plant", "least"), [("mujoco", 0.93), ("rollers", 0.8)])
def test_robots_of_forces_go_about_as_far_as_rolling_ones(plant, least):
    """Wheels that slip and rollers that drag lose a share; none is gained."""
    robot = replace(next(r for r in ROBOTS if r.plant == plant), gains=(1.0, 1.0, 1.0))
    plan = Plan(robot, [(3.0, np.array([0.6, 0, 0]))], 1)
    rolls, pushed = (play(plan, forces=f, calm=True).pose[-1, 0] for f in (False, True))
    assert least < pushed / rolls < 1.01


def test_an_effect_twice_as_large_adds_about_twice_as_much():
    linear = ("marker_offset", "wheel_gain", "input_delay", "reverse_asymmetry")
    case = next(c for c in DRAWN if c.hidden and c.hidden[0].name in linear)
    floors = Floors(case.plan)
    one, two = (floors.adds(case.hidden[0].scaled(by)) for by in (0.5, 1.0))
    assert two / one == pytest.approx(2, rel=0.2)


def test_the_right_name_alone_is_right():
    case = case_of("one")
    result = scored(case, found(case.hidden[0].name))
    assert result["outcome"]["clean"] and not result["outcome"]["wrong_and_sure"]


def test_a_doubtful_name_is_right_but_not_beyond_doubt():
    case = case_of("one")
    answer = found(case.hidden[0].name)
    answer["findings"][0]["certainty"] = "doubtful"
    outcome = scored(case, answer)["outcome"]
    assert outcome["first"] and outcome["named"]
    assert not outcome["verdict_right"] and not outcome["clean"]
    silent = scored(case, answer | {"verdict": "outside_catalogue"})["outcome"]
    assert silent["first"] and not silent["named"]
    nothing = scored(case_of("none"), answer)["outcome"]
    assert nothing["alarm"] and not nothing["wrong_and_sure"]


@pytest.mark.parametrize("certainty", ["sure", "doubtful"])
def test_what_every_robot_of_forces_has_is_no_alarm(certainty):
    """Mass drifts outward in arcs, whether or not the log is sure of it."""
    case = next(c for c in DRAWN if c.kind == "none" and c.plan.robot.plant != "planar")
    answer = found("lateral_slip")
    answer["findings"][0]["certainty"] = certainty
    assert not scored(case, answer)["outcome"]["alarm"]


def test_all_names_in_one_group_are_wrong():
    case = case_of("one")
    outcome = scored(case, found(case.hidden[0].name, groups=[NAMES], verdict="ambiguous"))[
        "outcome"
    ]
    assert not outcome["first"] and not outcome["clean"] and not outcome["all"]


def test_a_group_of_four_with_the_right_name_is_right():
    case = case_of("one")
    group = [case.hidden[0].name, *[n for n in NAMES if n != case.hidden[0].name][:3]]
    outcome = scored(case, found(group[1], groups=[group], verdict="ambiguous"))["outcome"]
    assert outcome["clean"] and not outcome["wrong_and_sure"]


def test_wrong_names_beside_the_right_one_cost():
    case = case_of("one")
    wrong = [n for n in NAMES if n != case.hidden[0].name and n != "clock_offset"][:4]
    outcome = scored(case, found(case.hidden[0].name, *wrong))["outcome"]
    assert outcome["first"] and not outcome["clean"]
    assert outcome["others"] == wrong and outcome["wrong_and_sure"]


def test_finding_nothing_and_saying_outside_passes_no_other_row():
    said_outside = found(verdict="outside_catalogue", rest=["heading"])
    rows = summary([scored(case, said_outside) for case in DRAWN])
    assert rows["right_first"]["hits"] == rows["both_of_two"]["hits"] == 0
    assert rows["false_alarm"]["hits"] == rows["false_alarm"]["of"] > 0


def test_outside_counts_only_with_the_right_dependence():
    case = case_of("outside")
    words = (case.hidden[0].depends_on[0], "battery")
    told = [scored(case, found(rest=[w], verdict="outside_catalogue")) for w in words]
    assert [r["outcome"]["depends"] for r in told] == [True, False]


@pytest.mark.parametrize(
    ("verdict", "right_word", "hits"),
    [("outside_catalogue", True, 1), ("outside_catalogue", False, 0), ("model_adequate", True, 0)],
)
def test_a_cousin_may_be_outside_with_what_it_depends_on(verdict, right_word, hits):
    """Its formula is none of the catalogue's, so that both are true of it."""
    case = case_of("cousin")
    word = case.hidden[0].depends_on[0] if right_word else "battery"
    rows = summary([scored(case, found(rest=[word], verdict=verdict))])
    assert rows["cousins"]["hits"] == hits


def test_estimates_are_held_against_the_truth():
    case = next(c for c in DRAWN if c.kind == "one")
    name, value = next(iter(case.hidden[0].values.items()))
    full = f"{case.hidden[0].name}.{name}"
    of_numpy = replace(case.hidden[0], values={name: np.float64(value)})
    case = replace(case, hidden=[of_numpy])
    for off, within in ((1.9, True), (2.1, False)):
        parameter = {"name": full, "value": value + off * 0.01, "std": 0.01}
        result = scored(case, found(case.hidden[0].name, parameters=[parameter]))
        assert [e["within"] for e in json.loads(json.dumps(result))["estimates"]] == [within]


def test_every_bar_is_a_row():
    rows = summary([scored(case, found()) for case in DRAWN])
    assert all({"hits", "of", "low", "high"} <= set(rows[bar.key]) for bar in BARS)


def test_cases_are_spread_over_kinds():
    assert Counter(CASES) == {"one": 3, "cousin": 2, "none": 2, "outside": 2, "two": 1}


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    [(0, 40, 0.0, 1 - 0.025 ** (1 / 40)), (40, 40, 0.025 ** (1 / 40), 1.0), (0, 0, 0.0, 1.0)],
)
def test_intervals_of_none_and_all_are_clopper_and_pearsons(hits, of, low, high):
    found = rate([True] * hits + [False] * (of - hits))
    assert (found["hits"], found["of"]) == (hits, of)
    assert found["low"] == pytest.approx(low)
    assert found["high"] == pytest.approx(high)


def test_a_known_drives_truth_are_numbers_of_the_model_that_it_is_fitted_with():
    for number in range(len(SETS)):
        known = draw_known(number, 1, 30)
        model = native.Model.from_toml(known.sheet, "known.toml")
        for name, value in known.truth.items():
            model.set(name, value)  # refuses what is out of bounds, or no quantity
        assert {name.split(".")[0] for name in known.truth} == {"base", *SETS[number]}
        assert [h.name for h in known.hidden] == list(SETS[number])
    assert draw_known(3, 1, 30).sheet == draw_known(3, 1, 30).sheet != draw_known(3, 2, 30).sheet


@pytest.mark.parametrize(("wide", "share"), [(1.0, 0.95), (2.0, 0.99991), (0.5, 0.673)])
def test_coverage_of_right_and_wrong_standard_errors_is_the_normals(wide, share):
    """P(|z| <= 1.96 wide) of a normal; quantities whose truth is not known do not count."""
    known = draw_known(0, 1, 30)
    random, truth = np.random.default_rng(5), known.truth["base.yaw_gain"]
    rows = [
        row
        for value in truth + 0.01 * random.standard_normal(4000)
        for row in errors(known, {"parameters": [
            {"name": "base.yaw_gain", "value": value, "std": 0.01 * wide},
            {"name": "theta_a1", "value": 1.0, "std": 0.1}]})
    ]  # fmt: skip
    (quantity,) = coverage(rows)
    assert quantity["name"] == "base.yaw_gain" and quantity["of"] == 4000
    assert quantity["hits"] / 4000 == pytest.approx(share, abs=4 * np.sqrt(0.25 / 4000))
    assert quantity["rms"] == pytest.approx(1 / wide, rel=0.05)


@pytest.mark.parametrize("number", range(len(KINDS)))
def test_every_form_can_be_played_by_every_robot_that_can_have_it(number):
    robot, random = ROBOTS[number], np.random.default_rng(2)
    legs = drive("mixed", 20, robot.sideways, random)
    plan = Plan(robot, legs, 1)
    for h in catalogue_forms(robot, random) + outside_forms(robot, random):
        moved = play(plan, [h], calm=True).pose
        assert np.isfinite(moved).all() and np.ptp(moved[:, 2]) > 0.1, h.name


@pytest.mark.parametrize("plant", ["mujoco", "rollers"])
@pytest.mark.parametrize("name", ["second_order_lag", "yaw_lag"])
def test_a_lag_hidden_in_a_robot_of_forces_comes_to_its_own_once(plant, name):
    """A first-order lag answers a ramp late by its time constant, before whatever comes next."""
    robot = next(r for r in ROBOTS if r.plant == plant)
    slow = next(h for h in catalogue_forms(robot, np.random.default_rng(1)) if h.name == name)
    axis = 2 if name == "yaw_lag" else 0
    legs = [(0.05, 0.01 * k * np.eye(3)[axis]) for k in range(60)]
    (late_s,) = slow.scaled(3).values.values()
    usual, late = (
        np.diff(play(Plan(robot, legs, 1), hidden, forces=True, calm=True).pose[:, axis]) / STEP_S
        for hidden in ((), (slow.scaled(3),))
    )
    end = slice(int(1.5 / STEP_S), int(2.9 / STEP_S))
    slope = np.polyfit(np.arange(len(usual))[end] * STEP_S, usual[end], 1)[0]
    assert np.mean(usual[end] - late[end]) / slope == pytest.approx(late_s, rel=0.15)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("plant", ["mujoco", "rollers"])
def test_a_robot_of_forces_has_no_dry_friction(plant, axis):
    """It would take the same speed away at all speeds: v = g u - loss, of two speeds u."""
    robot = next(r for r in ROBOTS if r.plant == plant)
    asked_mps = np.array([0.1, 0.3])
    rims = [robot.to_wheels @ (u * np.eye(3)[axis]) for u in asked_mps]
    slow_mps, fast_mps = (
        drive_by_forces(robot, np.tile(rim, (2500, 1)))[1000:].mean(axis=0)[axis] for rim in rims
    )
    loss_mps = (asked_mps[0] * fast_mps - asked_mps[1] * slow_mps) / np.ptp(asked_mps)
    assert abs(loss_mps) < 2e-3


@pytest.mark.parametrize("plant", ["mujoco", "rollers"])
def test_a_robot_of_forces_drifts_outward_in_arcs_as_its_mass_asks(plant):
    """So a lateral slip that is named there is no mistake."""
    robot = next(r for r in ROBOTS if r.plant == plant)
    lever_m = robot.half_wheelbase_m + robot.half_track_m
    ahead, turn = 0.5, 0.2 * robot.top_mps / lever_m
    rims = [robot.to_wheels @ [ahead * robot.top_mps, 0, k * turn] for k in (-1, 0, 1)]
    right, straight, left = (
        drive_by_forces(robot, np.tile(rim, (1500, 1)))[1000:].mean(axis=0) for rim in rims
    )
    outward = (left[1] - right[1]) / 2
    assert abs(straight[1]) < 1e-3
    assert outward < -0.01 * left[0] * left[2]  # s times the centripetal acceleration


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
def test_one_ctrl_c_ends_all_processes_and_keeps_what_was_done(tmp_path):
    """A terminal sends it to all processes of its session at once."""
    words = ["challenge", "--intervals", "6", "--duration-s", "30", "--workers", "2", "--out", "c"]
    process = subprocess.Popen(
        [sys.executable, "-m", "twinmill_cli.main", *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    begin_s = time.monotonic()
    while not (kept := list((tmp_path / "c/done").glob("*.json"))):
        assert process.poll() is None and time.monotonic() - begin_s < 100
        time.sleep(0.05)
    stopped_s = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert time.monotonic() - stopped_s < 5  # on a busy machine; a case takes several seconds
    assert (process.returncode, out) == (130, "") and "Traceback" not in err
    assert all(path.exists() for path in kept)
    time.sleep(0.5)
    assert not [p for p in living() if p == process.pid]


def living():
    """Sessions of all processes that run."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, session, *_ = stat.read_text().rpartition(")")[2].split()
            if state != "Z":
                yield int(session)


def test_no_base_model_is_kept_of_a_fit_that_was_stopped(tmp_path, monkeypatch):
    """A command that Ctrl-C stopped gives 130, and may have written its file."""

    def stopped(words):
        Path(words[words.index("-o") + 1]).write_text("half a model")
        return 130

    monkeypatch.setattr(command, "play", lambda *_, **__: None)
    monkeypatch.setattr(command, "write_log", lambda plan, played, path: path.write_text("a log"))
    monkeypatch.setattr(command, "run", stopped)
    with pytest.raises(KeyboardInterrupt):
        command.base_of(tmp_path, 1, ROBOTS[1], seed=SEED, duration_s=SECONDS)
    assert [path.name for path in tmp_path.iterdir()] == ["sheet_1.toml"]
