# SPDX-License-Identifier: Apache-2.0
"""Recurring errors have their period in the model, and their moment in each log.

The robots are those of `conftest.py`; what takes power from them by the clock is written here.
"""

import numpy as np
import pytest

from twinmill.fitting.add import add
from twinmill.fitting.compare import GOOD, compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import all_effect_parameters, phases
from twinmill.report.comparisons import advice

STEP_S = 1 / 480  # of the robot
PERIOD_S = 16.0
LOSS = 0.1
BEGINS_RAD = (-1.0, 1.7)  # of two runs
TEXTS = {"adds_to": "motion", "formula": f"p0*(sin({2 * np.pi / PERIOD_S:.4f}*t + p1) > 0.3)"}


@pytest.fixture(scope="module")
def recurring(tanh_robot):
    """A robot that loses some of its way for a part of each period, begun at an angle of it."""

    def make(begins_rad: float):
        class Recurring(tanh_robot):
            def hindered(self, motion):
                t_s = np.arange(len(motion)) * STEP_S
                away = np.sin(2 * np.pi * t_s / PERIOD_S + begins_rad) > 0.3
                return motion * (1 - LOSS * away)[:, None]

        return Recurring()

    return make


@pytest.fixture(scope="module")
def two_runs(recurring, measure):
    """Two logs of it, which begin at two moments of its period."""
    return [measure(recurring(a), 101 + k, 80.0) for k, a in enumerate(BEGINS_RAD)]


@pytest.fixture(scope="module")
def explained(two_runs, one_clock_base, tmp_path_factory):
    """The model with what recurs, fitted to the first log alone."""
    out = tmp_path_factory.mktemp("explained") / "explained.toml"
    return add("equation", [two_runs[0]], one_clock_base, out=out, command="", texts=TEXTS).child


def apart(a_rad: float, b_rad: float) -> float:
    return abs(np.angle(np.exp(1j * (a_rad - b_rad))))


def test_what_recurs_in_one_log_predicts_another_that_begins_at_another_moment(
    two_runs, explained, one_clock_base
):
    """Errors over the log's own noise; held at the first log's moment they are more than twice."""
    (phase,) = phases(explained.model)
    assert apart(phase.value, BEGINS_RAD[0]) < 0.15
    other = compare([two_runs[1]], explained)
    (told,) = other.main.phases
    assert apart(told.value, BEGINS_RAD[1]) < 0.15 and told.seen
    assert apart(told.value, BEGINS_RAD[1]) < 4 * told.std
    assert other.score < 1.1 < 1.3 < compare([two_runs[1]], one_clock_base).score


def test_two_logs_share_what_recurs_and_not_its_moment(two_runs, explained, tmp_path):
    out = tmp_path / "both.toml"
    result = fit(two_runs, explained, out, "")
    (size,) = all_effect_parameters(ModelFile.load(str(out)).model)
    assert size.value == pytest.approx(-LOSS, abs=0.01)
    assert [r.score < GOOD for r in result.after.robots] == [True, True]


def test_a_formula_of_ones_own_gets_its_moment_in_each_log(two_runs, one_clock_base, tmp_path):
    out = tmp_path / "own.toml"
    found = add("equation", two_runs, one_clock_base, out=out, command="", texts=TEXTS)
    model = ModelFile.load(str(out)).model
    assert model.get("equation.p0") == pytest.approx(-LOSS, abs=0.01)
    for run, begins_rad in zip(found.after.robots, BEGINS_RAD, strict=True):
        assert apart(run.phases[0].value, begins_rad) < 0.15
    assert found.heldout_after.score < 1.1 < found.heldout_refit.score


def test_a_robot_without_it_gains_no_loss_by_the_freedom_of_the_moment(
    tanh_robot, measure, one_clock_base, tmp_path
):
    """Over left-out parts: the best of 24 moments of all parts would predict each a bit better."""
    ratios = []
    for seed in range(201, 207):
        log = measure(tanh_robot(), seed, 80.0)
        out = tmp_path / f"{seed}.toml"
        found = add("equation", [log], one_clock_base, out=out, command="", texts=TEXTS)
        assert abs(ModelFile.load(str(out)).model.get("equation.p0")) < 0.2 * LOSS
        assert any("does not show equation" in w for w in found.after.warnings)
        ratios.append(found.heldout_after.score / found.heldout_refit.score)
    assert np.mean(ratios) > 1.0


def test_a_log_that_does_not_show_what_recurs_says_so(explained, tanh_robot, measure):
    log = measure(tanh_robot(), 201, 80.0)
    found = compare([log], explained)
    (warning,) = [w for w in found.warnings if "recurs" in w]
    assert "does not show equation" in warning
    assert not any("always zero" in w for w in found.warnings)
    assert not any(p.seen for p in found.robots[0].phases)
    told = advice(found)
    assert "does not show equation" in told and "input_delay" not in told


@pytest.mark.parametrize(
    ("formula", "own"),
    [
        ("p0*sin(0.3*t + p1)", ["equation.p1"]),
        ("p0*(cos(t/5 - p2) > p1)", ["equation.p2"]),
        ("p0*t + p1", []),
        ("p0*sin(2*theta + p1)", []),
        ("p0*sin(0.3*t + p1) + p1*vx", []),
    ],
)
def test_a_phase_is_what_ends_the_angle_of_a_wave_of_time_and_does_nothing_else(
    one_clock_base, formula, own
):
    model = one_clock_base.model.copy()
    model.add_effect("equation", {"adds_to": "motion", "formula": formula})
    assert [p.name for p in phases(model)] == own
    assert not {p.name for p in all_effect_parameters(model)} & {*own}
