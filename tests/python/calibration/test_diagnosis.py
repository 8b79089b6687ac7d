# SPDX-License-Identifier: Apache-2.0
"""Diagnosis of logs that another program made; the answers are in their README."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis import ties
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.diagnosis.finding import Finding
from twinmill.diagnosis.findings import lateness
from twinmill.diagnosis.first_sight import at_first_sight
from twinmill.diagnosis.rounds import Round, Search
from twinmill.diagnosis.screening import Screened
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.ties import canonical_correlation, ties_of
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelFile

TABLE = """
[base]
duty_pct = [0, 12.5, 25, 37.5, 50, 75, 100]
wheel_speed_mps = [0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4]
"""


@pytest.fixture(scope="module")
def calibrated(data_dir, tmp_path_factory):
    """The base model, fitted to the log of the robot as it normally is."""
    folder = tmp_path_factory.mktemp("diagnosis")
    (folder / "table.toml").write_text(TABLE)
    log = data_dir / "hidden_effects/calibration.lcmlog"
    parent = ModelFile.load(str(folder / "table.toml"))
    fit(load_measurements([log]), parent, folder / "base.toml", "test")
    return ModelFile.load(str(folder / "base.toml"))


@pytest.fixture(scope="module")
def case(data_dir):
    """Measurements of a case by its letter."""
    return lambda letter: load_measurements([data_dir / f"hidden_effects/case_{letter}.lcmlog"])


@pytest.fixture(scope="module")
def explained(calibrated, case, tmp_path_factory):
    """Case f, whose explanation begins with its diagnosis."""
    return explain(
        case("f"), calibrated, out=tmp_path_factory.mktemp("f") / "explained.toml", command="test"
    )


@pytest.fixture(scope="module")
def diagnosed(calibrated, case, explained):
    """The diagnosis of a case by its letter, made once."""
    made = {"f": explained.diagnosis}

    def make(letter):
        if letter not in made:
            made[letter] = diagnose(case(letter), calibrated)
        return made[letter]

    return make


# Parameter, truth of the README, tolerance: a tenth for the other form of that robot's effects.
ANSWERS = {
    "a": ("dead_zone", "dead_zone.width", 0.05),
    "b": ("motor_lag", "motor_lag.extra_s", -0.03),  # the logs' lags are 0.120 and 0.090 s
    "c": ("floor_tilt", "floor_tilt.drift_x_mps", 0.008),
    "f": ("battery_sag", "battery_sag.strength", 0.9),
}


@pytest.mark.parametrize("letter", ANSWERS)
def test_the_one_hidden_effect_is_named_with_its_strength(diagnosed, letter):
    effect, parameter, truth = ANSWERS[letter]
    found = diagnosed(letter)
    assert found.verdict == "effect_missing" and found.found == [effect]
    (top,) = [f for f in found.findings if f.effect == effect]
    estimate = next(e for e in top.parameters if e.name == parameter)
    assert estimate.value == pytest.approx(truth, abs=max(0.1 * abs(truth), 2 * estimate.std))
    assert estimate.std < 0.2 * abs(truth)
    assert found.ranking[0].effect == effect and found.ranking[0].p_value < 0.01
    assert found.steps[-1][1] < 1.3
    assert found.rest.formula is None


@pytest.mark.parametrize("letter", "bcf")
def test_the_hidden_effect_stands_out_at_first_sight(calibrated, case, letter):
    name, _, _ = ANSWERS[letter]
    assert name in at_first_sight(case(letter), calibrated).split(" or ")


def test_a_marker_off_by_6_mm_is_found_though_it_hardly_matters(diagnosed):
    found = diagnosed("d")
    assert found.found == ["marker_offset"]
    offset_m = [e.value for e in found.findings[0].parameters]
    assert np.hypot(*offset_m) == pytest.approx(0.006, rel=0.15)


def test_nothing_is_named_where_nothing_is_hidden(diagnosed):
    found = diagnosed("e")
    assert found.verdict == "model_adequate" and found.found == []
    assert found.rest.formula is None


def test_what_the_catalogue_may_not_name_is_called_outside_it(calibrated, case):
    """A creep along a fixed direction of the room can be no other effect of the drive."""
    without = ("floor_tilt", "carpet_grain", "gain_slope", "floor_patch")
    found = diagnose(case("c"), calibrated, excluded=without)
    assert found.verdict == "outside_catalogue"
    assert found.rest.depends_on == ["heading"]


def test_one_score_for_one_log_and_model(calibrated, case, diagnosed, tmp_path):
    """`compare`, `fit`, `add` and `diagnose` say the same of the model as given."""
    logs = case("d")
    told = [
        compare(logs, calibrated).score,
        fit(logs, calibrated, tmp_path / "f.toml", "").before.score,
        add("marker_offset", logs, calibrated, out=tmp_path / "a.toml", command="").before.score,
        diagnosed("d").to_json()["score"],
    ]
    assert told == pytest.approx([told[0]] * 4, rel=0.01)


def test_explain_writes_a_model_that_predicts_the_log(case, explained):
    again = ModelFile.load(str(explained.path))
    assert again.model.effects == ["battery_sag"]
    assert compare(case("f"), again).score == pytest.approx(explained.after.score, rel=0.01)
    steps = explained.to_json()["steps"]
    assert steps[0]["effect"] is None and steps[-1]["effect"] == "battery_sag"
    scores = [s["score_heldout"] for s in steps]
    assert scores == sorted(scores, reverse=True)
    assert scores[-1] < 1.3


@pytest.mark.parametrize(("behind", "tied"), [(1.0, True), (200.0, False)])
def test_what_can_do_all_that_another_does_stands_in_one_group_with_it(behind, tied):
    """Canonical correlation of columns (Hotelling 1936): a line lies in a plane: both are one."""
    plane = np.eye(6)[:, :2]
    line = plane @ [[1.0], [1.0]]
    assert canonical_correlation(line, plane) == pytest.approx(1)
    assert canonical_correlation(np.eye(6)[:, [3]], plane) == pytest.approx(0)
    # cos of the angle between (1, 1, 0) and the plane's own e1 alone.
    assert canonical_correlation(line, np.eye(6)[:, [0]]) == pytest.approx(np.sqrt(0.5))
    squares = np.array([1.0, 1.1, 0.9, 1.05])

    class FitOf(SimpleNamespace):
        against, least_against = ScoreFit.against, ScoreFit.least_against

    def fit_of(cost, factor):
        return FitOf(
            held_cost=cost,
            x=np.zeros(3),
            block_costs=lambda _: squares * factor,
            own_block_costs=squares * factor,
            without_own_blocks=cost - squares,
        )

    trials = [
        SimpleNamespace(names=(name,), fit=fit_of(cost, factor), held_score=2 * factor)
        for name, cost, factor in (
            ("line", 100.0, 1.0),
            ("plane", 100.0 + behind, np.exp(behind / 100)),
        )
    ]
    screened = [
        Screened(name, columns, 50.0, 20.0) for name, columns in (("line", line), ("plane", plane))
    ]
    before = SimpleNamespace(state=SimpleNamespace(told_speeds=False))
    this = Round(before, screened, trials, accepted=trials[0])
    assert [t.names[0] for t in ties_of(this, SETTINGS)] == (["plane"] if tied else [])


@pytest.mark.parametrize(
    ("rival", "left", "evidence", "tied"),
    [
        ("wheel_gain", 1.1, 80.0, True),  # on free rollers such gains were a mass offset, surely
        ("wheel_gain", 1.1, 60.0, False),
        ("wheel_gain", 1.2, 80.0, False),
        ("yaw_lever", 1.1, 80.0, False),  # of the floor as well
    ],
)
def test_a_wheel_that_does_most_of_what_a_floor_does_stands_beside_it(
    rival, left, evidence, tied, monkeypatch
):
    fit = SimpleNamespace(against=lambda _: (40.0, 20.0, 5.0), x=np.zeros(3))
    names = ("mass_offset", rival)
    trials = [
        SimpleNamespace(names=(name,), fit=fit, held_score=score, evidence=own)
        for name, score, own in zip(names, (1.05, left), (100.0, evidence), strict=True)
    ]
    screened = [Screened(n, np.eye(6)[:, [k]], 50.0, 20.0) for k, n in enumerate(names)]
    monkeypatch.setattr(ties, "in_common", lambda *_: 1.0)
    before = SimpleNamespace(state=SimpleNamespace(told_speeds=False))
    this = Round(before, screened, trials, accepted=trials[0])
    assert [t.names[0] for t in ties_of(this, SETTINGS)] == ([rival] if tied else [])


@pytest.mark.parametrize(
    ("apart", "told", "tied"),
    [(0.006, True, True), (0.006, False, False), (0.012, True, False), (0.02, True, False)],
)
def test_bends_that_differ_by_an_error_of_the_told_speeds_are_one(apart, told, tied, monkeypatch):
    """The better one changes the way by 8 %, and speeds of another log are known to 1.5 %."""
    fit = SimpleNamespace(against=lambda _: (40.0, 20.0, 5.0), x=np.zeros(3))
    before = SimpleNamespace(state=SimpleNamespace(told_speeds=told))
    curve, zone = (
        SimpleNamespace(names=(name,), fit=fit, held_score=1.0)
        for name in ("speed_curve", "dead_zone")
    )
    screened = [
        Screened(name, np.eye(6)[:, [k]], 50.0, 20.0)
        for k, name in enumerate(("speed_curve", "dead_zone"))
    ]
    monkeypatch.setattr(ties, "way_apart", lambda one, _: 0.08 if one is before else apart)
    monkeypatch.setattr(ties, "in_common", lambda *_: 1.0)
    this = Round(before, screened, [curve, zone], accepted=curve)
    assert [t.names[0] for t in ties_of(this, SETTINGS)] == (["dead_zone"] if tied else [])


def stopping_at(words: str):
    """Progress that is interrupted once these words come."""

    def tell(said: str) -> None:
        if words in said:
            raise KeyboardInterrupt

    return tell


def test_stopped_it_tells_what_was_found_so_far(calibrated, case, diagnosed):
    """The first round finds the larger of two effects; the second round is not run."""
    whole = diagnosed("a")
    found = diagnose(case("a"), calibrated, progress=stopping_at("round 2: "), stoppable=True)
    assert found.search.stopped and found.to_json()["stopped"]
    assert found.found and found.found[0] in whole.found
    assert found.sentence.startswith("Stopped before all was tried. So far: ")


def test_stopped_with_nothing_found_it_does_not_say_that_nothing_is_missing(calibrated, case):
    found = diagnose(case("e"), calibrated, progress=stopping_at("round 1: trying"), stoppable=True)
    assert found.verdict == "cannot_tell" and found.found == []
    assert "nothing had been found" in found.sentence


def test_stopped_before_it_has_tried_anything_it_tells_nothing(calibrated, case):
    with pytest.raises(KeyboardInterrupt):
        diagnose(case("e"), calibrated, progress=stopping_at("round 1: screening"), stoppable=True)


def test_who_calls_it_from_a_program_is_interrupted_as_by_any_other(calibrated, case):
    """An exam's worker must not take half a search for a whole one."""
    with pytest.raises(KeyboardInterrupt):
        diagnose(case("e"), calibrated, progress=stopping_at("round 1: trying"))


def late_trial(model_file, effect, **numbers):
    """A fit of the base with one effect that makes it late."""
    model = model_file().model.copy()
    model.add_effect(effect)
    for name, value in numbers.items():
        model.set(f"{effect}.{name}", value)
    known = SimpleNamespace(parameter=SimpleNamespace(name=f"{effect}.{next(iter(numbers))}"))
    covariance = np.array([[0.01**2]])
    fit = SimpleNamespace(unknowns=[known], covariance=covariance, x=np.zeros(1))
    state = SimpleNamespace(model=model, models=[model])
    return SimpleNamespace(names=(effect,), state=state, fit=fit, held_score=1.0)


def test_a_lateness_is_as_unsure_as_what_stands_in_for_it_differs(model_file):
    """0.2 s of delay known to 10 ms, or 0.3 s of lag: the interval holds both."""
    delay = late_trial(model_file, "input_delay", delay_s=0.2)
    lag = late_trial(model_file, "motor_lag", extra_s=0.3)
    only = Round(delay, [], [delay, lag], accepted=delay, tied=[lag])
    done = Search(delay.state, [only], delay, [], SETTINGS)
    found = Finding("input_delay", ("input_delay", "motor_lag"), [], 1.0, "group")
    late = lateness(done, [found], same_clock=True)
    assert late.sum_s == pytest.approx(delay.state.model.get("base.motor_lag_s") + 0.2)
    assert 1.96 * late.sum_std_s == pytest.approx(np.hypot(1.96 * 0.01, 0.1))
    alone = lateness(done, [replace(found, group=None)], same_clock=True)
    assert alone.sum_std_s == pytest.approx(0.01)
