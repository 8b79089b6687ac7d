# SPDX-License-Identifier: Apache-2.0
"""Rivals do what their textbooks say, and the yardstick of their predictions is right."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, f_oneway

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from rivals import exam
from rivals.lisdd import DOCUMENTED, SETTINGS, discoveries
from rivals.protocol import Answer, Problem, predicted_by
from rivals.residual import CHANGE, HEADING, PLACE, SPEED, TIME, Steps, corrected
from rivals.scoring import judged, middle, row
from rivals.stepwise import f_test, selected
from rivals.trees import OPTIONS, _held_out

from twinmill.experiment.drives import drive
from twinmill.predict.windows import HORIZONS_S
from twinmill_lab.challenge.cases import Case
from twinmill_lab.challenge.physics import catalogue_forms
from twinmill_lab.challenge.robots import draw_robot
from twinmill_lab.challenge.run import Plan, play, write_log

SECONDS = 40.0
STEPS = 900


@pytest.fixture
def random():
    return np.random.default_rng(5)


@pytest.fixture(scope="module")
def quiet():
    """A planar robot with another clock than its capture's, without any noise."""
    robot = draw_robot(0, np.random.default_rng(3))
    silent = {"sensor_m": 0.0, "sensor_rad": 0.0, "drive_mps": 0.0, "drive_radps": 0.0}
    return replace(robot, **silent, offset_s=0.1, same_clock=False)


def driven(robot, folder, hidden=(), style="mixed"):
    """A case of a robot, and its sheet as the base."""
    random = np.random.default_rng(8)
    plan = Plan(robot, drive(style, SECONDS, robot.sideways, random), 1)
    write_log(plan, play(plan, hidden), folder / "log.lcmlog")
    clock = f"\n[clock]\noffset_s = {robot.offset_s}\n"
    (folder / "sheet.toml").write_text(robot.sheet(np.random.default_rng(4)) + clock)
    case = Case(0, "one" if hidden else "none", 0, style, plan, tuple(hidden), ())
    return case, Problem(folder / "log.lcmlog", folder / "sheet.toml")


def planted(random, group, missed):
    """Steps without a robot: columns of standard deviation 1, and what is missed of them."""
    columns = {"forward": SPEED, "left": SPEED, "turn": SPEED, "change": CHANGE}
    columns |= {"time": TIME, "sin": HEADING, "cos": HEADING, "x": PLACE, "y": PLACE}
    x = random.standard_normal((STEPS, len(columns)))
    pose = np.column_stack([x[:, -2:], np.arctan2(x[:, -4], x[:, -3])])
    own = list(columns.values()).index(group)
    y = 0.1 * random.standard_normal((STEPS, 3))
    y[:, 0] += missed(x[:, own])
    t_s = 0.1 * np.arange(STEPS)
    names, groups = tuple(columns), tuple(columns.values())
    return Steps(0.1, t_s, pose, x[:, :3], y, x[:, :-4], names, groups)


def test_f_test_is_that_of_another_library(random):
    """Two groups of a one-way analysis of variance are one added column."""
    a, b = random.normal(0, 1, 30), random.normal(0.7, 1, 20)
    both = np.concatenate([a, b])
    before = np.square(both - both.mean()).sum()
    after = np.square(a - a.mean()).sum() + np.square(b - b.mean()).sum()
    assert f_test(before, after, 1, 48) == pytest.approx(f_oneway(a, b).pvalue, rel=1e-9)


def test_stepwise_enters_first_what_was_hidden(quiet, tmp_path):
    robot = replace(quiet, sensor_m=2e-4, sensor_rad=5e-4)
    forms = catalogue_forms(robot, np.random.default_rng(0))
    slip = next(h for h in forms if h.name == "lateral_slip" and h.kind == "plain")
    _, problem = driven(robot, tmp_path, [slip.scaled(3)])
    assert "lateral_slip" in [stage.effect for stage in selected(problem, 1e-6)]


def test_interval_of_the_median_is_that_of_the_tables():
    """Conover 1999, table A3: of 20 the 6th and the 15th, of 10 the 2nd and the 9th."""
    assert [middle(list(range(1, 21)))[k] for k in ("low", "high")] == [6, 15]
    assert [middle(list(range(1, 11)))[k] for k in ("low", "high")] == [2, 9]


def test_lisdd_finds_a_term_where_it_was_planted(random):
    x = random.standard_normal((3000, 5))
    y = random.standard_normal((3000, 3))
    y[:, 1] += 3 * x[:, 4] * (x[:, 3] > 0.84)  # the highest fifth of a normal variable
    found = discoveries(x, y, np.arange(3000) // 40, SETTINGS[DOCUMENTED])
    best = found[0]
    assert (best.channel, best.region.column) == (1, 3)
    assert 5 in best.terms  # a constant stands before the columns
    assert best.factors[best.terms.index(5)] == pytest.approx(3, rel=0.1)


def test_lisdd_seldom_finds_anything_in_noise():
    """Where every null is true, the false discovery rate is the chance of any: 5 %."""
    hits = 0
    for seed in range(60):
        random = np.random.default_rng(seed)
        x, y = random.standard_normal((600, 5)), random.standard_normal((600, 3))
        hits += bool(discoveries(x, y, np.arange(600) // 10, SETTINGS[DOCUMENTED]))
    assert binom.sf(hits - 1, 60, 0.05) > 1e-3


def test_sindy_finds_a_planted_linear_law(random):
    sindy = pytest.importorskip("rivals.sindy", reason="make rivals installs pysindy")
    steps = planted(random, PLACE, lambda x: 0.5 * x)
    model = sindy.Sparse(steps, sindy._tuned_library, sindy._firm(0.2))
    assert model(steps.features)[:, 0] == pytest.approx(0.5 * steps.features[:, -2], abs=0.05)
    weight = {g: model.weight[steps.of_group(g)].sum() for g in set(steps.groups)}
    assert max(weight, key=weight.__getitem__) == PLACE


def test_sysid_finds_gains_and_lag_of_a_known_robot(random):
    """Runs of a first-order robot, integrated here at a twentieth of the step."""
    pytest.importorskip("plotly", reason="make rivals installs what mujoco.sysid needs")
    sysid = pytest.importorskip("rivals.mujoco_sysid")
    gains, lag_s = np.array([0.9, 0.8, 1.1]), 0.11
    runs = [_first_order(random, gains, lag_s, sysid.STEP_S) for _ in range(15)]
    start = {"forward": 1.0, "sideways": 1.0, "yaw": 1.0, "lag_s": 0.08}
    found = sysid.sysid_fit.fit(runs, start, sysid.AXES, 0.4)["values"]
    assert [found[k] for k in ("forward", "sideways", "yaw")] == pytest.approx(gains, rel=0.02)
    assert found["lag_s"] == pytest.approx(lag_s, rel=0.03)


def _first_order(random, gains, lag_s, step_s, steps=200, parts=20):
    """A run as mujoco_sysid.stretches gives: s, speeds half a step ahead, poses, first speeds."""
    asked = np.repeat(random.uniform(-1, 1, (5, 3)) * [0.4, 0.4, 1.5], steps // 5 + 1, axis=0)
    fine = np.repeat(asked, parts, axis=0)
    dt, speed, rows = step_s / parts, random.uniform(-0.3, 0.3, 3), []
    for u in fine:
        speed = speed + (1 - np.exp(-dt / lag_s)) * (u - speed)
        rows.append(speed)
    v = np.array(rows) * gains
    heading = np.cumsum(v[:, 2]) * dt - v[:, 2] * dt / 2
    c, s = np.cos(heading), np.sin(heading)
    way = [c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1], v[:, 2]]
    pose = np.vstack([np.zeros(3), np.cumsum(np.column_stack(way), axis=0) * dt])
    ahead = fine[parts // 2 :][: steps * parts].reshape(steps, parts, 3).mean(axis=1)
    first = rows[parts // 2 - 1]
    return np.arange(steps) * step_s, ahead, pose[: steps * parts : parts], first


def test_trees_lose_most_without_what_was_planted(random):
    steps = planted(random, TIME, lambda x: np.where(x > 0, 0.5, 0.0))
    gain, lost = _held_out(steps, steps.features, steps.missed, OPTIONS[DOCUMENTED])
    total = np.square(steps.missed).sum()
    assert gain == pytest.approx(1 - 3 * STEPS * 0.01 / total, abs=0.1)
    assert max(lost, key=lost.__getitem__) == TIME


def test_truth_errs_by_nothing_where_nothing_disturbs(quiet, tmp_path):
    """Poses of a log are rounded to nothing but its clock's microseconds.

    A straight line over 50 ms misses a heading whose rate changes, by less than half a milliradian.
    """
    case, _ = driven(quiet, tmp_path)
    found = exam._unseen(case, case.plan, tmp_path / "same.lcmlog")
    assert found.floor[HORIZONS_S.index(2.0)] == pytest.approx(0, abs=5e-4)


def test_a_wrong_model_errs_by_its_error_over_the_truths(quiet, tmp_path):
    case, _ = driven(replace(quiet, sensor_m=1e-3, sensor_rad=3e-3), tmp_path)
    log = exam._unseen(case, case.plan, tmp_path / "same.lcmlog")
    measured = log.windows.measured(log.measurement)
    off = measured + 3 * log.floor
    assert log.over_truth(off) == pytest.approx([3, 3])


def test_corrections_of_nothing_leave_the_base_and_of_a_turn_add_it(quiet, tmp_path):
    _, problem = driven(quiet, tmp_path)
    log = exam.Windows.of(problem.measurement.track)
    base = predicted_by(problem.model)(problem.measurement, log)
    none = corrected(problem.model, 0.1, lambda f: np.zeros((len(f), 3)))
    assert none(problem.measurement, log) == pytest.approx(base, abs=1e-3, nan_ok=True)
    turned = corrected(problem.model, 0.1, lambda f: np.tile([0, 0, 0.1], (len(f), 1)))
    more = turned(problem.measurement, log)[..., 2] - none(problem.measurement, log)[..., 2]
    expected = np.broadcast_to(0.1 * np.array(HORIZONS_S), more.shape)
    assert more[np.isfinite(more)] == pytest.approx(expected[np.isfinite(more)], abs=1e-9)


def test_answers_are_judged_by_the_rules_of_the_challenge(quiet, tmp_path):
    forms = catalogue_forms(quiet, np.random.default_rng(0))
    slip = next(h for h in forms if h.name == "lateral_slip" and h.kind == "plain")
    case, problem = driven(quiet, tmp_path, [slip])
    right, silent = (
        judged(case, Answer(told, 1.0, predicted_by(problem.model), names), {})
        for told, names in ((True, ("lateral_slip", "backlash")), (False, ()))
    )
    assert (right["told"], right["first"], right["wrong"]) == (True, True, True)  # no backlash
    assert (silent["told"], silent["first"], silent["wrong"]) == (False, False, False)
    empty = dict.fromkeys(("same_0.5", "same_2", "other_0.5", "other_2"), 1.0)
    table = row([{"kind": "one", **right, **empty}, {"kind": "none", **silent, **empty}])
    assert (table["told"]["hits"], table["alarm"]["hits"], table["name"]["of"]) == (1, 0, 1)


def test_a_case_is_within_if_none_of_its_errors_is_far_from_the_truths():
    said = dict.fromkeys(("told", "first", "depends", "wrong"), True)
    near = {key: 1.3 for key in ("same_0.5", "same_2", "other_0.5", "other_2")}
    cases = [near, near | {"other_2": 1.31}]
    table = row({"kind": "outside", **said, **own} for own in cases)
    assert (table["within"]["hits"], table["within"]["of"]) == (1, 2)
