# SPDX-License-Identifier: Apache-2.0
"""Effects at some times or in some places alone are found, wherever these are.

Truth: a robot that shares no code with the twin, with something done to it where and when is known.
"""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.estimation.score_fit import ScoreFit
from twinmill.fitting.add import add
from twinmill.fitting.opening import open_measurements
from twinmill.fitting.starts import Left, starts_of
from twinmill.model.parameters import catalogue_of, effect_parameters

EULER_S = 1 / 480  # step of the robots here


def weaker(robot, low_s, high_s, share):
    """The robot with wheels that bring less by a share between two times."""

    class Weaker(robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            weak = (at_s > low_s) & (at_s < high_s)
            return super().wheels_mps(duty) * (1 - share * weak)[:, None]

    return Weaker()


def first_of(found) -> tuple[str, dict[str, tuple[float, float]]]:
    """The likeliest finding, and its numbers."""
    return found.answer.findings[0].effect, found.answer.findings[0].numbers


@pytest.mark.parametrize(("low_s", "high_s"), [(17.0, 24.0), (61.0, 67.0)])
def test_a_loss_of_some_seconds_is_named(low_s, high_s, tanh_robot, measure, true_model):
    effect, told = first_of(
        diagnose([measure(weaker(tanh_robot, low_s, high_s, 0.2), 4, 90.0)], true_model)
    )
    assert effect == "transient_loss"
    assert told["loss"][0] == pytest.approx(0.2, abs=3 * told["loss"][1])
    assert told["from_s"][0] == pytest.approx(low_s, abs=1.0)
    assert told["until_s"][0] == pytest.approx(high_s, abs=1.0)


def test_a_loss_whose_end_is_hardly_in_the_log_may_be_for_good(tanh_robot, measure, true_model):
    found = diagnose([measure(weaker(tanh_robot, 60.0, 87.5, 0.2), 4, 90.0)], true_model)
    assert {"abrupt_loss", "transient_loss"} & set(found.answer.findings[0].group)


def test_a_loss_in_the_one_stretch_that_was_driven_elsewhere_may_be_of_the_floor(
    tanh_robot, measure, true_model
):
    """Twenty seconds of legs about one place, twenty about one 2 m ahead, where it is weaker."""

    def about(seed):
        random, legs = np.random.default_rng(seed), []
        for _ in range(10):  # there and back, so that it stays where it is
            a, b = random.choice((50, 75, 100)), random.choice((-1, 1))
            leg = [(a, a, a, a), (a, -a, a, -a), (-a, a, a, -a)][random.integers(3)]
            legs += [b * np.array(leg)] * 48 + [-b * np.array(leg)] * 48
        return legs

    away = [np.array((75, 75, 75, 75))] * 300
    script_pct = np.array([*about(1), *away, *about(2), *[-leg for leg in away], *about(3)])
    low_s = 0.5 + (960 + 300) / 48  # commands come 48 times a second, after half a second
    run = measure(weaker(tanh_robot, low_s, low_s + 20, 0.15), 4, script_pct=script_pct)
    found = diagnose([run], true_model).answer
    assert {"transient_loss", "floor_patch"} & {f.effect for f in found.findings}


@pytest.mark.parametrize(
    ("effect", "low_s", "high_s"), [("transient_loss", 20.0, 40.0), ("abrupt_loss", 35.0, 99.0)]
)
@pytest.mark.parametrize("robot_id", [None, 3])  # the log's
def test_a_loss_that_is_added_begins_where_it_was(
    effect, low_s, high_s, robot_id, tanh_robot, measure, true_model, tmp_path
):
    """Truth: when the robot was weaker, and by how much."""
    run = measure(weaker(tanh_robot, low_s, high_s, 0.25), 4, 60.0)
    path = tmp_path / "m.toml"
    found = add(effect, [run], true_model, out=path, command="", robot_id=robot_id)
    told = {e.name.split(".")[1]: e for e in found.added}
    assert told["loss"].value == pytest.approx(0.25, abs=2 * told["loss"].std + 0.005)
    assert told["from_s"].value == pytest.approx(low_s, abs=1.0)
    if effect == "transient_loss":
        assert told["until_s"].value == pytest.approx(high_s, abs=1.0)
    assert found.heldout_after.score < 1.3 < found.heldout_refit.score / 2
    assert found.notes == []


def test_a_heading_that_errs_once_a_turn_is_named(tanh_robot, measure, true_model):
    """0.07 rad times the sine of the heading and a radian: coefficients by the sum of angles."""

    def deviate(pose, valid):
        heading = pose[:, 2]
        return np.column_stack([pose[:, :2], heading + 0.07 * np.sin(heading + 1)]), valid

    found = diagnose([measure(tanh_robot(), 4, 90.0, spoil=deviate)], true_model)
    effect, told = first_of(found)
    assert found.answer.verdict == "effect_missing" and effect == "compass_deviation"
    for key, truth in (("cos_rad", 0.07 * np.sin(1)), ("sin_rad", 0.07 * np.cos(1))):
        assert told[key][0] == pytest.approx(truth, abs=3 * told[key][1])
        assert told[key][1] < 0.02


@pytest.fixture(scope="module")
def opened(tanh_robot, measure, true_model):
    """A run of the robot as it is."""
    return open_measurements([measure(tanh_robot(), 5, 60.0)], true_model)[0]


def left_by(opened, errors):
    """Rest if errors (R,) were all of it, and nothing else is free."""
    return Left([np.ones(len(errors))], [errors], [np.zeros((len(errors), 0))])


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("abrupt_loss", {"loss": 0.08, "from_s": 31.0}),
        ("transient_loss", {"loss": 0.15, "from_s": 21.0, "until_s": 27.0}),
        ("floor_patch", {"strength": 0.2, "radius_m": 0.25}),
    ],
)
def test_one_pass_with_it_always_on_finds_where_it_is_on(name, values, opened):
    """Truth: what the plant itself changes with the effect at that time or place."""
    data, model = opened.data, opened.model.copy()
    rows = data.rows(model, ["clock.offset_s"], np.array([[model.get("clock.offset_s")]]))[0]
    starts = starts_of(name, [opened.model], [data], [rows])
    if name == "floor_patch":
        pose = data.measurement.track.pose
        centre = np.nanmedian(pose[:, :2], axis=0)
        values = values | {"x_m": centre[0], "y_m": centre[1]}
    model.add_effect(name)
    for key, value in values.items():
        model.set(f"{name}.{key}", value)
    errors = rows - data.rows(model, ["clock.offset_s"], np.array([[0.0]]))[0]
    best = starts.best(left_by(opened, errors))
    for key, value in best.items():
        near = 0.15 if key.endswith("_m") else 2.0
        assert value == pytest.approx(values[key.split(".")[1]], abs=near), best


@pytest.mark.parametrize("free", [0, 4])
def test_products_of_shares_are_those_of_the_columns_that_they_make(free):
    rng = np.random.default_rng(1)
    sizes, windows, horizons, starts = 2, (7, 5), 3, 6
    rows = [w * horizons * 3 for w in windows]
    weights, rests = ([rng.random(r) for r in rows] for _ in range(2))
    left = Left(weights, rests, [rng.normal(size=(r, free)) for r in rows])
    changes = [rng.normal(size=(sizes, r)) for r in rows]
    shares = [rng.random((starts, w, horizons)) for w in windows]
    moment, gram = left.products_of_shares(changes, shares)
    for s in range(starts):
        columns = np.hstack(
            [
                c * w * np.repeat(on[s].ravel(), 3)
                for c, w, on in zip(changes, weights, shares, strict=True)
            ]
        )
        along = columns @ np.vstack(left.bases)
        assert moment[s] == pytest.approx(columns @ np.concatenate(rests))
        assert gram[s] == pytest.approx(columns @ columns.T - along @ along.T)


def test_no_search_begins_beyond_the_bounds_of_a_limit(opened):
    """Fast robots have their limits, and their duties that do nothing, far from the usual ones."""
    card = catalogue_of(opened.model)["stiction"]["parameters"][0]
    name = f"stiction.{card['name']}"
    rows = opened.data.rows(opened.model, ["clock.offset_s"], np.zeros((1, 1)))
    found = starts_of("stiction", [opened.model], [opened.data], list(rows)).starts
    values = [start[name] for start in found]
    assert card["min"] < min(values) < card["default"] < max(values) == card["max"]


@pytest.mark.parametrize("edge", [0.29, 0.33, 0.37, 0.48, 0.57])
def test_a_limit_is_found_from_where_nothing_reaches_it(edge, opened):
    """Wheels stand below a duty: truth is the plant's own; few duties lie near it."""
    model = opened.model.copy()
    model.add_effect("stiction")
    model.set("stiction.below", edge)
    predicted = opened.data.windows.predicted(opened.measurement, model)
    data = replace(opened.data, measured=predicted)
    model.set("stiction.below", 0.0)
    missed = data.score(model)
    for begin in (0.05, 0.1, 0.68):
        free = [p.at(begin) for p in effect_parameters(model, "stiction")]
        fit = ScoreFit([data], [model], free)
        fit.begin_at_best(free)
        assert fit.fit().scores[0] < 0.1 * missed
