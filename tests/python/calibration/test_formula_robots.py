# SPDX-License-Identifier: Apache-2.0
"""Models with a formula predict other drives of robots that have what no effect says.

The robots are no twin: each hides something of its own, written here in NumPy over whole motions.
"""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.explain import Explanation, explain
from twinmill.diagnosis.formula import Number
from twinmill.diagnosis.taking import taken
from twinmill.diagnosis.trials import with_base
from twinmill.fitting.compare import compare
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_names, effect_parameters
from twinmill_lab.challenge.cases import Case, draw, draw_robots, make_log
from twinmill_lab.challenge.command import base_of

STEP_S = 1 / 480  # of the robot


def followed(goal: np.ndarray, lag_s: float) -> np.ndarray:
    """(K, n) what goes to (K, n) with a first-order lag, from 0."""
    found, now = np.empty_like(goal), np.zeros(goal.shape[1])
    for k, to in enumerate(goal):
        now = now + STEP_S / lag_s * (to - now)
        found[k] = now
    return found


def gripping_after_rests(motion: np.ndarray) -> np.ndarray:
    """Less way after each start, as on tyres that have to be warm."""
    moves = (np.abs(motion).max(axis=1, keepdims=True) > 0.01) * 1.0
    return motion * (0.75 + 0.25 * followed(moves, 0.8))


def resonant(motion: np.ndarray) -> np.ndarray:
    """A quarter less around 0.2 m/s."""
    speed = np.hypot(motion[:, 0], motion[:, 1])
    share = 1 - 0.25 * np.exp(-(((speed - 0.2) / 0.05) ** 2))
    return motion * np.column_stack([share, share, np.ones(len(share))])


def creeping(motion: np.ndarray) -> np.ndarray:
    """A fifth of each speed comes late, whatever moves: as wheels do on soft gears."""
    return 0.8 * motion + 0.2 * followed(motion, 0.6)


def switched(motion: np.ndarray) -> np.ndarray:
    """A tenth less while something else takes power, every 16 s of the run."""
    t_s = np.arange(len(motion)) * STEP_S
    return motion * (1 - 0.1 * (np.sin(2 * np.pi * t_s / 16 - 1.0) > 0.3))[:, None]


def switched_for_a_while(motion: np.ndarray) -> np.ndarray:
    """An eighth less every 16 s, until 46 s; then no more."""
    t_s = np.arange(len(motion)) * STEP_S
    away = (np.sin(2 * np.pi * t_s / 16 - 1.0) > 0.3) & (t_s < 46)
    return motion * (1 - 0.12 * away)[:, None]


def oiled(motion: np.ndarray) -> np.ndarray:
    """Turning loses with its square, as in oil."""
    turn = motion[:, 2]
    return np.column_stack([motion[:, :2], turn - 0.15 * turn * np.abs(turn)])


def heated(motion: np.ndarray) -> np.ndarray:
    """Turning loses with heat that turning makes and 12 s carry away."""
    heat = followed(np.abs(motion[:, [2]]), 12.0)
    return np.column_stack([motion[:, :2], motion[:, 2] * (1 - 0.4 * heat[:, 0])])


def windblown(motion: np.ndarray) -> np.ndarray:
    """Pushed along 40 degrees of the room by a tenth of its speed."""
    toward = 0.7 - np.cumsum(motion[:, 2]) * STEP_S
    push = 0.1 * np.hypot(motion[:, 0], motion[:, 1])
    return motion + push[:, None] * np.column_stack([np.cos(toward), np.sin(toward), 0 * toward])


@pytest.fixture
def hiding(tanh_robot):
    """A robot whose motion is hindered so."""

    def make(hindered):
        class Hiding(tanh_robot):
            def hindered(self, motion):
                return hindered(motion)

        return Hiding()

    return make


@pytest.fixture
def explained(measure, hiding, one_clock_base, tmp_path):
    """Result of `explain` for drives of 80 s each."""

    def make(hindered, *seeds) -> Explanation:
        logs = [measure(hiding(hindered), seed, 80.0) for seed in seeds]
        return explain(logs, one_clock_base, out=tmp_path / "explained.toml", command="")

    return make


@pytest.mark.parametrize(
    "hindered", [gripping_after_rests, resonant, creeping, oiled, heated, windblown]
)
def test_a_model_with_the_formula_predicts_a_drive_that_nobody_fitted(
    explained, hiding, measure, one_clock_base, hindered
):
    """Errors over the log's own noise: 1 is all that can be had."""
    result = explained(hindered, 101)
    assert result.formula and result.formula.kept
    other = [measure(hiding(hindered), 77, 60.0)]
    with_it = compare(other, ModelFile.load(str(result.path))).score
    assert with_it < 1.1 < 1.3 < compare(other, one_clock_base).score


def test_a_form_that_is_nearly_a_gain_is_told_as_it_is(explained):
    """The base's gain takes most of a square; the rest looks like a loss from some speed on."""
    result = explained(oiled, 101)
    (form,) = result.formula.formula.forms
    (number,) = result.formula.numbers
    assert form.texts == ("omega*abs(omega)",)
    assert number.value == pytest.approx(-0.15, rel=0.1)


def test_heat_of_one_axis_is_told_with_its_time(explained):
    (form,) = explained(heated, 101).formula.formula.forms
    assert form.texts == ("s*omega",)
    assert 12 / 1.5 < form.constant < 12 * 1.5  # as the square, too, makes nearly that heat


def test_a_push_that_grows_with_speed_stands_in_the_place_of_one_that_does_not(explained):
    result = explained(windblown, 101)
    instead_of = set(result.formula.formula.instead_of)
    assert "floor_tilt" in instead_of
    assert not instead_of & {*effect_names(ModelFile.load(str(result.path)).model)}
    east, north = (n.value for n in result.formula.numbers)
    assert np.hypot(east, north) == pytest.approx(0.1, rel=0.1)
    assert np.arctan2(north, east) == pytest.approx(0.7, abs=0.1)


def explained_case(seed: int, number: int, folder) -> tuple[Case, Explanation]:
    """A case of the exam, whose plant shares no code, and what `explain` makes of it."""
    robots = draw_robots(seed)
    case = draw(number, seed, robots, 90.0)
    base = base_of(folder, case.robot, robots[case.robot], seed=seed, duration_s=90.0)
    make_log(case, folder / "run.lcmlog")
    logs = load_measurements([folder / "run.lcmlog"])
    out = folder / "explained.toml"
    return case, explain(logs, ModelFile.load(str(base)), out=out, command="")


def test_tiles_are_told_and_no_patch_that_takes_most_of_what_they_do(tmp_path):
    case, result = explained_case(2041, 59, tmp_path)
    (tiles,) = case.hidden
    assert tiles.name == "tiles" and result.formula.kept
    assert "floor_patch" not in effect_names(ModelFile.load(str(result.path)).model)
    (form,) = result.formula.formula.forms
    assert 2 * np.pi / form.constant == pytest.approx(tiles.values["length_m"], rel=0.02)


def test_a_formula_needs_no_more_evidence_than_the_effects_that_it_stands_for_did(tmp_path):
    """Two effects of a compass together do along one heading what turning by heading does."""
    case, result = explained_case(2402, 39, tmp_path)
    (turning,) = case.hidden
    assert turning.name == "turn by heading" and result.formula.kept
    assert {*result.formula.formula.instead_of} == {"heading_bias", "compass_deviation"}
    east, north = (n.value for n in result.formula.numbers)
    assert np.hypot(east, north) == pytest.approx(turning.values["share"], rel=0.05)


def test_a_doubtful_effect_that_says_nothing_beside_the_formula_goes(explained):
    """The floor that the robot drives on is level."""
    result = explained(resonant, 101)
    state = result.diagnosis.search.last.state
    models = [m.copy() for m in state.models]
    for model in models:
        model.add_effect("floor_tilt")
    tilt = effect_parameters(models[0], "floor_tilt", fresh=True)
    fit = ScoreFit(state.datasets, models, [*state.begun(), *tilt]).fit()
    formula = result.formula.formula
    whole = taken(fit, formula, beside=(), runs=1)
    less = taken(fit, formula, beside=("floor_tilt",), runs=1)
    assert "floor_tilt" in effect_names(whole.fit.models[0])
    assert "floor_tilt" not in effect_names(less.fit.models[0])
    assert less.formula.instead_of == (*formula.instead_of, "floor_tilt") and less.kept


def test_a_number_that_is_nothing_is_no_number_of_the_formula(explained):
    """A second term that is zero all the time had been written, with -5e-26 before it."""
    result = explained(resonant, 101)
    formula, state = result.formula.formula, result.diagnosis.search.last.state
    fit = ScoreFit(state.datasets, state.models, [*state.begun()]).fit()
    idle = replace(formula.forms[0], shapes=("0*vx",), state=None, constant=0.0, sizes=(1.0,))
    first, *others = formula.numbers
    numbers = (first, Number("p1", -5e-26, -1.0, 1.0, "1"), *others)
    more = replace(formula, forms=(*formula.forms, idle), numbers=numbers)
    found = taken(fit, more, beside=(), runs=1)
    assert len(found.numbers) == len(formula.numbers)
    assert [f.shapes for f in found.formula.forms] == [f.shapes for f in formula.forms]


def test_a_formula_that_is_a_gain_of_the_base_gains_nothing_beside_it(explained):
    """Where the base had been held, such a formula had been proven."""
    result = explained(resonant, 101)
    formula, last = result.formula.formula, result.diagnosis.search.last
    whole, _ = with_base(last, result.diagnosis.base_names)
    turning = replace(
        formula.forms[0],
        **{"adds_to": "omega_radps", "shapes": ("omega",), "constant": 0.0, "sizes": (1.0,)},
    )
    gain = replace(formula, forms=(turning,), numbers=formula.numbers[:1], instead_of=())
    assert taken(whole, gain, beside=(), runs=1).gains_nothing


def test_no_formula_is_credited_with_what_a_refit_of_the_base_takes(explained):
    """The score without it is that of all that was found with the base refitted beside it."""
    result = explained(resonant, 101)
    assert result.formula.after < result.formula.before <= result.diagnosis.steps[-1][1]


def test_what_is_switched_is_told_with_its_period_its_moments_and_its_size(explained):
    """An eighth less for 7 s of every 20."""

    def there(t_s):
        return np.sin(2 * np.pi * t_s / 20 + 2.0) > 0.4

    def at_times(motion):
        return motion * (1 - 0.12 * there(np.arange(len(motion)) * STEP_S))[:, None]

    formula = explained(at_times, 101).diagnosis.rest.proven
    (form,), (number,) = formula.forms, formula.numbers
    t_s = np.arange(0, 80, 0.1)
    told = eval(form.texts[0], {"sin": np.sin, "t": t_s})
    assert np.mean(told == there(t_s)) > 0.97
    assert number.value == pytest.approx(-0.12, rel=0.1)


def test_what_does_not_go_on_by_its_clock_is_told_and_not_taken(explained):
    """A swing that one part of the run lacks, another run lacks too."""
    result = explained(switched_for_a_while, 101)
    proven = result.diagnosis.rest.proven
    assert proven.names_time and not proven.goes_on
    assert "one run" in result.formula.why_not and not result.formula.kept
    assert result.formula.to_json()["share"] is None
    assert result.sentence == result.diagnosis.sentence
    assert "equation" not in effect_names(ModelFile.load(str(result.path)).model)


def test_moments_that_two_runs_share_are_taken(explained):
    result = explained(switched, 101, 102)
    assert result.formula.kept
    assert result.sentence.startswith("The model now has the formula motion += ")
    assert result.sentence.endswith(result.diagnosis.sentence)
    assert "equation" in effect_names(ModelFile.load(str(result.path)).model)
