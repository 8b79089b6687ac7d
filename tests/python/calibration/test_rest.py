# SPDX-License-Identifier: Apache-2.0
"""Kinds of rest: errors that come again at their place, irregular motion, single wheels."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import twinmill_native as native

from twinmill.diagnosis import rest
from twinmill.diagnosis.columns import Columns
from twinmill.diagnosis.finding import Finding
from twinmill.diagnosis.findings import with_stale_numbers
from twinmill.diagnosis.library import SHAPES, _wheel_terms
from twinmill.diagnosis.moments import Events, Moment
from twinmill.diagnosis.notes import _no_more_than_left, irregularity, is_random
from twinmill.diagnosis.place import HORIZON, comes_again
from twinmill.diagnosis.rest import (
    FIRM,
    FOLDS,
    MOMENTS,
    Dependence,
    Products,
    Rest,
    _standing_out,
    _tested,
)
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT
from twinmill.diagnosis.verdict import VerdictInputs
from twinmill.diagnosis.wander import Wander
from twinmill.formulas.term import Term
from twinmill.model.parameters import ParameterEstimate
from twinmill.predict.noise import ChannelNoise, Noise
from twinmill.predict.windows import HORIZONS_S

EVERY_S, WINDOWS, BLOCK_S = 0.25, 400, 8.0


def wander(seed, gain_at, half_m=1.0, turn_at=None):
    """A log of a robot that wanders over a square; its ways are longer by `gain_at` (x, y, t).

    And it turns by `turn_at` (x, y, t), rad, more than the model says.
    """
    random = np.random.default_rng(seed)
    t_s = EVERY_S * np.arange(WINDOWS + 2)
    heading = np.cumsum(random.normal(0, 0.5, len(t_s)))
    step_m = 0.05
    at = np.zeros((len(t_s), 2))
    for k in range(1, len(t_s)):
        ahead = at[k - 1] + step_m * np.array([np.cos(heading[k]), np.sin(heading[k])])
        if np.abs(ahead).max() > half_m:
            heading[k:] += np.pi - 0.3
            ahead = at[k - 1] + step_m * np.array([np.cos(heading[k]), np.sin(heading[k])])
        at[k] = ahead
    starts = np.arange(WINDOWS)
    way = np.zeros((WINDOWS, len(HORIZONS_S), 3))
    way[:, HORIZON, 0] = 2 * step_m
    middle = (at[starts] + at[starts + 2]) / 2
    errors = random.normal(0, 0.003, way.shape)
    errors[:, HORIZON, 0] += 2 * step_m * gain_at(*middle.T, t_s[starts])
    if turn_at:
        errors[:, HORIZON, 2] += turn_at(*middle.T, t_s[starts])
    block = np.repeat((t_s[starts] // BLOCK_S).astype(int), way[0].size)
    ends = np.tile((starts + 2)[:, None], (1, len(HORIZONS_S)))
    track = SimpleNamespace(pose=np.column_stack([at, heading]))
    data = SimpleNamespace(
        start_s=t_s[starts], errors=lambda model: errors, measured=way + errors,
        keep=np.ones(WINDOWS, bool),
        block=block, windows=SimpleNamespace(starts=starts, ends=ends),
        measurement=SimpleNamespace(track=track),
    )  # fmt: skip
    response = SimpleNamespace(unboosted=errors)
    return SimpleNamespace(trajectory=data, data=data, response=response)


def test_joints_between_tiles_come_again_at_their_places():
    def tiles(x, y, t):
        return 0.1 * np.sign(np.sin(2 * np.pi * x / 0.6) * np.sin(2 * np.pi * y / 0.6))

    # A gain of +- 0.1 on ways of 0.1 m beside noise of 3 mm: what repeats is less, since the kernel
    # and the ways are as wide as a part of a tile.
    assert 0.1 < comes_again([wander(1, tiles)], [None]) < 0.1**2 / (0.1**2 + 0.03**2)


@pytest.mark.parametrize("seed", range(5))
def test_strips_across_a_large_room_come_again_though_few_spots_do(seed):
    def strips(x, y, t):
        return 0.05 * np.sin(2 * np.pi * y / 0.6)

    assert comes_again([wander(seed, strips, half_m=3.0)], [None]) > 0.1


def test_a_strip_that_turns_robots_comes_again():
    def none(x, y, t):
        return 0 * x

    def strip(x, y, t):
        return 0.01 * (np.abs(x - 0.3) < 0.2)

    assert comes_again([wander(2, none, turn_at=strip)], [None]) > 0.1


@pytest.mark.parametrize("seed", range(5))
def test_what_comes_with_time_or_by_chance_has_no_place(seed):
    assert not comes_again([wander(seed, lambda x, y, t: 0 * x)], [None])
    assert not comes_again([wander(seed, lambda x, y, t: 0.1 * np.sin(t / 3))], [None])


def test_what_noise_moves_in_a_time_is_the_integral_of_its_disturbance():
    """Ornstein-Uhlenbeck velocities stepped by hand, 4000 of them."""
    random, step_s = np.random.default_rng(2), 0.005
    noise = ChannelNoise(sensor=0.001, drive=0.02, memory_s=0.3)
    velocity, moved = noise.drive * random.normal(size=4000), 0.0
    for _ in range(round(1.0 / step_s)):
        moved = moved + step_s * velocity
        kick = np.sqrt(2 * step_s / noise.memory_s) * noise.drive
        velocity = velocity * (1 - step_s / noise.memory_s) + kick * random.normal(size=4000)
    readings = np.subtract(*random.normal(0, noise.sensor, (2, 4000)))
    (expected,) = noise.displaced(np.array([1.0]))
    assert np.var(moved + readings) == pytest.approx(expected, rel=0.1)


def test_a_floor_as_the_noise_makes_it_is_regular_and_one_three_times_as_high_is_not():
    model = native.Model.load("turbopi.toml")
    channels = [
        ChannelNoise(s, model.get(f"noise.{d}"), model.get(f"noise.{m}"))
        for s, d, m in ((3e-4, "drive_mps", "drive_s"), (2e-3, "drive_radps", "drive_turn_s"))
    ]
    along, turn = (np.sqrt(c.displaced(np.array(HORIZONS_S))) for c in channels)
    data = SimpleNamespace(measured=np.zeros((10, len(HORIZONS_S), 3)))
    floor = np.column_stack([along, along, turn])
    for times in (1.0, 3.0):
        own = SimpleNamespace(
            trajectory=data, data=data, known_floor=SimpleNamespace(rms=times * floor)
        )
        found = irregularity(own, Noise(*channels), model)
        assert found == pytest.approx(times)
        assert (found > SETTINGS.irregular) == (times > 1)


@pytest.mark.parametrize(
    ("speed_mps", "told_mps", "usual"), [(0.4, 0.2, 2), (0.1, 0.2, 1), (0.4, 0, 1)]
)
def test_a_robot_that_drives_faster_than_the_model_was_told_slips_more(speed_mps, told_mps, usual):
    """Wheels slip by a share of their way; of one that drives slower, no less is taken as usual."""
    model = native.Model.load("turbopi.toml")
    channels = [
        ChannelNoise(0.0, usual * model.get(f"noise.{d}"), model.get(f"noise.{m}"))
        for d, m in (("drive_mps", "drive_s"), ("drive_radps", "drive_turn_s"))
    ]
    along, turn = (np.sqrt(c.displaced(np.array(HORIZONS_S))) for c in channels)
    data = SimpleNamespace(measured=np.zeros((10, len(HORIZONS_S), 3)))
    own = SimpleNamespace(
        trajectory=data,
        data=data,
        known_floor=SimpleNamespace(rms=np.column_stack([along, along, turn])),
    )
    silent = ChannelNoise(0.0, 0.0, 0.1)
    found = irregularity(own, Noise(silent, silent, speed_mps), model, told_mps)
    assert found == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("score", "random", "told"),
    [(1.02, False, []), (1.06, False, ["heading"]), (1.02, True, ["heading"])],
)
def test_what_is_no_more_than_the_noise_depends_on_nothing(score, random, told, monkeypatch):
    found = Rest(0.0, False, ["heading"])
    monkeypatch.setattr(rest, "_dependences", lambda *_, there: found)
    monkeypatch.setattr(rest, "_firm", lambda *_: False)
    for name, nothing in (("events_of", Events()), ("comes_again", 0.0), ("wandering", None)):
        monkeypatch.setattr(rest, name, lambda *_, nothing=nothing, **__: nothing)
    fit, first = SimpleNamespace(held_square=score**2, models=[]), SimpleNamespace(held_square=1.1)
    formulas = SimpleNamespace(logs=[], seen=[], proven=lambda _: None)
    of = rest.rest_of(formulas, fit, first, known={}, whole=[], random=random)
    assert of.depends_on == told


def test_at_few_commands_little_that_depends_on_speed_is_the_base():
    """A mill has two commands; its wheels' speeds there are as well known as a base is."""
    rest = Rest(1.0, False, ["speed", "command of the left wheels", "heading"], little=True)
    assert rest.at_few_commands().depends_on == ["heading"]
    assert replace(rest, little=False).at_few_commands().depends_on == rest.depends_on


@pytest.mark.parametrize(("group", "kept"), [("speed", False), ("heading", True)])
def test_at_few_commands_no_formula_is_offered_for_what_is_called_noise(group, kept):
    proven = SimpleNamespace(depends_on=[group])
    left = Rest(0.07, False, [group], little=True, proven=proven).at_few_commands()
    assert bool(left.proven) == kept == (left.certainty == FIRM)


def test_what_was_proven_is_firm_where_no_score_tells_of_it():
    """Two or three short gusts in minutes leave the score at 1."""
    left = Rest(0.0, False, ["time"], proven=SimpleNamespace(depends_on=["time"]))
    assert left.certainty == FIRM != replace(left, proven=None).certainty


@pytest.mark.parametrize("noise", [[], ["far less regular"]])
@pytest.mark.parametrize("likely", [["place"], ["speed", "time"], []])
def test_what_is_likely_is_named_before_single_moments(likely, noise):
    moments = tuple(Moment("run", 1, 10.0 * k**2, 0.4, "less") for k in range(1, 5))
    left = Rest(1.0, False, [*likely, MOMENTS], likely=True, wanders=True, events=Events(moments))
    told = VerdictInputs(*[1.2] * 4, [], left, [], [], noise, 1.0)
    assert told.verdict == "outside_catalogue"
    before, after = told.sentence.split("At 4 moments")
    assert "10.0, 40.0, 90.0 s and 1 more" in after
    assert ("single moments alone" in before) != bool(likely)
    assert all(name in before for name in likely)


def test_what_grows_beside_a_noisy_sensor_shows_at_the_longest_horizon():
    """A sensor of 5 mm hides what is five times the disturbance, but for the last horizon."""
    model = native.Model.load("turbopi.toml")
    position, heading = (
        ChannelNoise(s, model.get(f"noise.{d}"), model.get(f"noise.{m}"))
        for s, d, m in ((5e-3, "drive_mps", "drive_s"), (2e-3, "drive_radps", "drive_turn_s"))
    )
    along, turn = (np.sqrt(c.displaced(np.array(HORIZONS_S))) for c in (position, heading))
    more = replace(position, drive=5 * position.drive)
    ahead = np.sqrt(more.displaced(np.array(HORIZONS_S)))
    data = SimpleNamespace(measured=np.zeros((10, len(HORIZONS_S), 3)))
    own = SimpleNamespace(
        trajectory=data,
        data=data,
        known_floor=SimpleNamespace(rms=np.column_stack([ahead, along, turn])),
    )
    found = irregularity(own, Noise(position, heading), model)
    assert found == pytest.approx(ahead[-1] / along[-1])
    assert np.exp(np.log(ahead / along).mean()) < SETTINGS.irregular < found


@pytest.mark.parametrize("curved", [False, True])
def test_a_heading_that_wanders_leads_the_robot_across_its_way_in_curves_too(curved):
    """Half a turn ends where it began but for two radii aside: an error of the heading moves it on.

    By brute force: many runs at one speed, with a heading that wanders as the model says.
    """
    model, random = native.Model.load("turbopi.toml"), np.random.default_rng(1)
    model.set("noise.drive_mps", 1e-4)
    position, heading = (
        ChannelNoise(s, model.get(f"noise.{d}"), model.get(f"noise.{m}"))
        for s, d, m in ((1e-4, "drive_mps", "drive_s"), (1e-4, "drive_radps", "drive_turn_s"))
    )
    step_s, count = 0.005, round(max(HORIZONS_S) / 0.005)
    keep, wander = np.exp(-step_s / heading.memory_s), np.zeros(2000)
    turned, place, found = np.zeros(2000), np.zeros((2, 2000)), {}
    for k in range(count):
        wander = keep * wander + np.sqrt(1 - keep**2) * heading.drive * random.normal(size=2000)
        turned = turned + (wander + curved * np.pi / 2) * step_s
        place = place + 0.3 * step_s * np.array([np.cos(turned), np.sin(turned)])
        found[round((k + 1) * step_s, 3)] = (*place, turned)
    ends = np.array([found[h] for h in HORIZONS_S])  # (H, 3, runs)
    data = SimpleNamespace(measured=np.moveaxis(ends, 2, 0))
    own = SimpleNamespace(
        trajectory=data, data=data, known_floor=SimpleNamespace(rms=ends.std(axis=2))
    )
    assert irregularity(own, Noise(position, heading), model) == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize(
    ("score", "scatter", "random"), [(1.1, 2.5, False), (1.1, 4.0, True), (1.0, 4.0, False)]
)
def test_scatter_far_beyond_the_models_noise_is_something_random(score, scatter, random):
    noise = ["the unexplained scatter is far above the noise"]
    assert is_random([1.0, scatter], score) == random
    weighed = VerdictInputs(*[score] * 4, [], Rest(1.0, False, []), [], [], noise, 1.0, (), random)
    assert weighed.verdict == "cannot_tell"
    assert ("random" in weighed.sentence) == random


@pytest.mark.parametrize(
    ("last", "firm", "verdict", "words"),
    [
        (1.02, False, "cannot_tell", "as well as these logs allow, but the motion is disturbed"),
        (1.2, False, "cannot_tell", "almost as well as these logs allow"),
        (1.4, False, "outside_catalogue", "Something random disturbs the motion"),
        (1.4, True, "outside_catalogue", "it wanders by itself, or no formula"),
    ],
)
def test_where_all_that_is_left_is_random_no_physics_is_called_missing(last, firm, verdict, words):
    left, by = Rest(1.0, firm, [], wanders=True), "by about 0.05 rad/s for 2 s at a time"
    told = VerdictInputs(
        *[last] * 4, [], left, [], [], ["irregular"], 1.0, random=True, disturbed_by=by
    )
    assert told.verdict == verdict
    assert words in told.sentence
    assert (by in told.sentence) == (verdict == "cannot_tell")


@pytest.mark.parametrize(
    ("score", "doubtful", "verdict"),
    [
        (1.4, False, "cannot_tell"),
        (2.0, False, "cannot_tell"),
        (1.4, True, "cannot_tell"),
        (1.1, False, "model_adequate"),
    ],
)
def test_what_wanders_by_itself_is_random_and_told_by_its_size(score, doubtful, verdict):
    """Nothing of the commands, place or time explains it: at no score is that physics."""
    found = [Finding("scrub", None, (), 0.2, "doubtful", "why")] if doubtful else []
    left = Rest(0.8, False, ["time"], likely=True, wanders=True, by_itself=Wander(0.04, 3.0))
    told = VerdictInputs(*[score] * 4, found, left, [], [], [], 1.0)
    assert told.verdict == verdict
    assert ("4 % of the way for 3 s" in told.sentence) == (verdict == "cannot_tell")
    assert ("scrub" in told.sentence) == doubtful
    assert left.certainty != FIRM


@pytest.mark.parametrize(("depends_on", "certain"), [([], True), (["way driven"], False)])
def test_a_wander_is_certain_where_nothing_else_stands_out(depends_on, certain):
    """A texture of the floor wanders along the way, too: a second drive would tell."""
    likely = bool(depends_on)
    left = Rest(1.0, False, depends_on, likely=likely, wanders=True, by_itself=Wander(0.04, 3.0))
    told = VerdictInputs(*[2.0] * 4, [], left, [], [], [], 1.0)
    assert told.verdict == "cannot_tell"
    assert ("is random" in told.sentence) == certain
    assert ("By the same commands once more" in told.sentence) != certain
    assert all(name in told.sentence for name in depends_on)


def test_a_wander_that_hardly_shows_is_told_where_nothing_is_missing():
    left = Rest(1.0, False, [], by_itself=Wander(0.02, 3.0))
    told = VerdictInputs(*[1.2] * 4, [], left, [], [], [], 1.08)
    assert told.verdict == "model_adequate"
    assert "wanders by itself, by about 2 % of the way for 3 s at a time" in told.sentence


def test_a_wander_is_told_of_a_robot_that_a_controller_steers():
    left = Rest(1.0, True, ["speed"], likely=True, by_itself=Wander(0.02, 3.0)).as_answers()
    assert left.by_itself and not left.depends_on


def test_what_wanders_beside_an_effect_is_told_beside_it():
    found = [Finding("scrub", None, (), 0.7, "sure", "")]
    left = Rest(0.3, False, [], wanders=True, by_itself=Wander(turn_radps=0.05, turn_s=2.0))
    told = VerdictInputs(1.8, 1.8, 1.8, 1.4, found, left, [], [], [], 1.0)
    assert told.verdict == "effect_missing"
    assert "seems to wander by itself, by about 0.05 rad/s for 2 s at a time" in told.sentence


def test_what_reaches_into_a_stretch_left_out_is_no_random_scatter():
    """Commands are lost from 31 s to 37 s; of that 32 s to 36 s are left out, errors 50 fold."""
    start_s = np.arange(0.0, 70.0, EVERY_S)
    lost = (start_s > 30.5) & (start_s < 37.5)
    keep = ~((start_s > 32) & (start_s < 36))
    errors = np.random.default_rng(3).normal(size=(len(start_s), len(HORIZONS_S), 3))
    errors[lost] *= 50
    data = SimpleNamespace(keep=keep, start_s=start_s, errors=lambda _: errors)
    over = Over(data, Floor(np.full(errors.shape[1:], 20.0)))
    assert _no_more_than_left(over).floor.rms == pytest.approx(1.0, abs=0.2)


@dataclass(frozen=True)
class Floor:
    rms: np.ndarray


@dataclass(frozen=True)
class Over:
    data: SimpleNamespace
    floor: Floor
    model: None = None

    @property
    def trajectory(self) -> SimpleNamespace:
        return self.data

    @property
    def known_floor(self) -> Floor:
        return self.floor


@pytest.mark.parametrize(("depends_on", "likely"), [([], True), (["heading"], False)])
def test_what_a_doubtful_finding_depends_on_is_likely(depends_on, likely):
    found = Rest(0.4, False, depends_on).with_first(["time"])
    assert (found.depends_on, found.likely) == (["time", *depends_on], likely)


@pytest.mark.parametrize(
    ("share", "again", "firm"), [(0.0, 0, False), (0.0, 0.2, True), (0.3, 0, True)]
)
def test_nothing_is_not_firm(share, again, firm):
    """But what comes again at its place, which no score shows."""
    assert (Rest(share, False, ["place"], again=again).certainty == FIRM) == firm


def test_a_round_wheel_is_not_named_for_what_an_oval_one_does():
    """Another wheel's formula is another formula; errors follow the left one's."""
    left, right, noise = np.random.default_rng(4).normal(size=(3, 800))
    terms = [
        Term(f"angle of the {side} wheels", "rim_mps", "cos(2*wheel_rad)*rim", 1.0, "angle")
        for side in ("left", "right")
    ]
    blocks = np.repeat(np.arange(16), 50)
    columns = np.column_stack([left, right])
    alike = {"weight": np.ones(len(left)), "free": np.zeros((len(left), 0))}
    products = Products(Columns([columns]), left + 0.3 * noise, blocks, **alike)
    assert {d.group: d.sure for d in _tested(terms, products)} == {
        "angle of the left wheels": True,
        "angle of the right wheels": False,
    }


def test_each_wheel_with_a_command_of_its_own_has_its_formulas():
    """They are taken by `equation`; on a mecanum robot one wheel's command turns it."""
    model = native.Model.load("turbopi.toml")
    track = SimpleNamespace(command=np.ones((3, 4)))
    own = SimpleNamespace(track=track)
    terms = _wheel_terms([own], model)
    assert len({t.group for t in terms}) == 4
    assert len(terms) == 4 * len(SHAPES)
    for term in terms:
        assert term.addable
        model.copy().add_effect("equation", {"adds_to": "rim_mps", "formula": f"p0*{term.formula}"})


@pytest.mark.parametrize(
    ("lag_s", "known_s", "effect"),
    [
        *((0.1, 0.0133, REFIT), (0.1, 0.001, "motor_lag")),
        *((0.2, 0.0, REFIT), (0.05, 0.0, "motor_lag"), (0.0, 0.0, "motor_lag")),  # known to 5 %
    ],
)
def test_a_lag_within_the_models_own_error_is_a_stale_number(lag_s, known_s, effect):
    model = native.Model.load("turbopi.toml")
    model.set("base.motor_lag_s", lag_s)
    extra = ParameterEstimate("motor_lag.extra_s", -0.0108, 0.0028, "s", False, True)
    lag = Finding("motor_lag", None, [extra], 0.6, "sure")
    found = with_stale_numbers([lag], model, lag_std_s=known_s, clock_std_s=0.0, stds={}, slight={})
    assert [f.effect for f in found] == [effect]
    if effect == REFIT:
        (lag,) = found[0].parameters
        assert lag.name == "base.motor_lag_s"
        assert lag.value == pytest.approx(model.get("base.motor_lag_s") - 0.0108)


@pytest.mark.parametrize(("known", "effect"), [(0.05, REFIT), (0.01, "heading_bias")])
def test_an_effect_that_changed_within_the_models_own_error_is_a_stale_number(known, effect):
    model = native.Model.load("turbopi.toml")
    own = ParameterEstimate("heading_bias#2.bias_rad", 0.05, 0.01, "rad", False, True)
    again = Finding("heading_bias", None, [own], 0.6, "sure", again=True)
    stds = {"heading_bias.bias_rad": known}
    found = with_stale_numbers([again], model, lag_std_s=0.0, clock_std_s=0.0, stds=stds, slight={})
    assert [f.effect for f in found] == [effect]


@pytest.mark.parametrize(
    ("known_s", "group", "effect"),
    [
        (0.0075, ("input_delay", "clock_offset", "second_order_lag"), REFIT),  # 1.7 of its errors
        (0.0075, None, REFIT),
        (0.004, None, "input_delay"),
        (0.0, None, "input_delay"),  # clocks are one
        (0.0075, ("input_delay", "speed_slip"), "input_delay"),
    ],
)
def test_a_delay_within_the_error_of_the_clocks_is_a_stale_number(known_s, group, effect):
    """Clocks that another log told: 13 ms later is a delay, or their offset is so much larger."""
    model = native.Model.load("turbopi.toml")
    model.set("clock.offset_s", -0.127)
    own = ParameterEstimate("input_delay.delay_s", 0.0134, 0.002, "s", False, True)
    late = Finding("input_delay", group, [own], 0.8, "group" if group else "sure")
    (found,) = with_stale_numbers(
        [late], model, lag_std_s=0.0, clock_std_s=known_s, stds={}, slight={}
    )
    assert found.effect == effect
    if effect == REFIT:
        (offset,) = found.parameters
        assert offset.name == "clock.offset_s"
        assert offset.value == pytest.approx(-0.127 + 0.0134)


@pytest.mark.parametrize(("known", "words"), [(1.0, "a little more than"), (1.2, "as it did")])
def test_a_model_that_misses_as_before_is_not_said_to_miss_anew(known, words):
    weighed = VerdictInputs(1.21, 1.21, 1.21, 1.21, [], Rest(1.0, False, []), [], [], [], known)
    assert weighed.verdict == "model_adequate"
    assert words in weighed.sentence


@pytest.mark.parametrize(
    ("last", "verdict", "words"),
    [(1.05, "refit_enough", "a refit is enough"), (1.22, "cannot_tell", "most of the error")],
)
def test_a_refit_is_not_enough_where_more_than_the_noise_is_left(last, verdict, words):
    found = [Finding(REFIT, None, [], 0.8, "sure")]
    weighed = VerdictInputs(1.9, 1.9, last, last, found, Rest(0.2, False, []), [], [], [], 1.0)
    assert weighed.verdict == verdict
    assert words in weighed.sentence


def test_where_stretches_are_judged_nowhere_the_sentence_says_so():
    calm = VerdictInputs(1.0, 1.0, 1.0, 1.0, [], Rest(1.0, False, []), [], [], [], 1.0)
    held = replace(calm, disturbed=("R01: at 4.0 to 9.0 s it moved unlike all the rest.",))
    assert (calm.verdict, held.verdict) == ("model_adequate", "model_adequate")
    assert "left out" in held.sentence and "left out" not in calm.sentence


@pytest.mark.parametrize(("last", "verdict"), [(1.17, "cannot_tell"), (1.4, "outside_catalogue")])
def test_a_little_that_follows_from_something_unknown_is_not_told_why(last, verdict):
    weighed = VerdictInputs(last, last, last, last, [], Rest(1.0, True, []), [], [], [], 1.0)
    assert weighed.verdict == verdict
    assert "Nothing is missing" not in weighed.sentence


@pytest.mark.parametrize(
    ("falls", "named"),
    [
        ([20.0, 10.0, 2.0], 1),
        ([13.4, 11.6, 10.5, 6.4], 3),
        ([13.0, 12.0, 11.0, 10.0], 0),  # so many may be it that no one is told anything
        ([8.0, 1.0], 0),
        ([], 0),
    ],
)
def test_of_what_chance_could_make_the_data_prefer_some(falls, named):
    groups = [Dependence(str(k), fall, False, np.ones(1, bool)) for k, fall in enumerate(falls)]
    assert [g.group for g in _standing_out(groups)] == [str(k) for k in range(named)]


@pytest.mark.parametrize(
    ("last", "random", "verdict", "words"),
    [
        (1.17, False, "cannot_tell", "do not tell why"),
        (1.05, True, "cannot_tell", "random"),
    ],
)
def test_what_is_likely_is_told_as_such_and_makes_no_verdict(last, random, verdict, words):
    rest = Rest(1.0, last > 1.1, ["starts", "time"], likely=True, little=last < 1.1)
    noise = ["far less regular"] if random else []
    weighed = VerdictInputs(last, last, last, last, [], rest, [], [], noise, 1.0, (), random)
    assert weighed.verdict == verdict
    assert words in weighed.sentence
    assert "depends most likely on starts or time" in weighed.sentence
    assert (rest.certainty == FIRM) == (last > 1.1)


@pytest.mark.parametrize(
    ("left", "verdict", "firm"),
    [
        (Rest(0.3, False, ["place"]), "outside_catalogue", True),
        (Rest(0.3, True, []), "outside_catalogue", True),
        (Rest(0.3, True, []), "model_adequate", False),
        (Rest(0.3, False, ["place"]), "refit_enough", False),
        (Rest(0.3, False, []), "ambiguous", False),
    ],
)
def test_the_word_for_what_is_left_says_firm_where_the_flag_does(left, verdict, firm):
    """`firm: false` had stood beside the word `firm` in one of two diagnoses with a rest."""
    empty = SimpleNamespace(to_json=dict)
    found = Diagnosis(
        verdict, "", SimpleNamespace(score=1.5, robots=[], warnings=[]), 1.5, [], [], [], left,
        None, SimpleNamespace(stopped=False, settings=SETTINGS, passes=1, last=empty),
        [], [], [], [], None,
    ).to_json()["rest"]  # fmt: skip
    assert found["firm"] == firm == (found["certainty"] == FIRM)


def test_what_a_model_missed_before_is_no_news_where_it_misses_less():
    """Fitted at 1.6, here 1.4: what depends on the place did so there."""
    rest = Rest(1.0, True, ["place"])
    known, last = 1.6, [1.4] * 4
    news = VerdictInputs(*last, [], rest, [], [], [], known)
    before = replace(news, rest=rest.as_before())
    assert (news.verdict, before.verdict) == ("outside_catalogue", "cannot_tell")
    assert "as it did on the logs that it was fitted to" in before.sentence
    assert before.rest.old == ("place",)


@pytest.mark.parametrize(("score", "verdict"), [(1.2, "cannot_tell"), (1.6, "outside_catalogue")])
def test_a_little_that_a_doubtful_effect_half_takes_is_not_called_outside(score, verdict):
    why = "more is left than it takes"
    found = [Finding("lateral_slip", None, [], 0.5, "doubtful", why, wrong_form=True)]
    weighed = VerdictInputs(score, score, score, 1.12, found, Rest(0.54, False, []), [], [], [], 1)
    assert weighed.verdict == verdict
    assert "lateral_slip" in weighed.sentence and "Nothing is missing" not in weighed.sentence


@pytest.mark.parametrize(
    ("takes", "certainty", "left", "verdict"),
    [
        (0.3, "doubtful", 0.4, "outside_catalogue"),
        (0.3, "doubtful", 0.2, "outside_catalogue"),
        (0.3, "doubtful", 0.05, "effect_missing"),
        (0.3, "sure", 0.4, "effect_missing"),
        (0.9, "doubtful", 0.2, "effect_missing"),
    ],
)
def test_much_that_is_left_and_depends_on_something_outweighs_a_doubtful_effect(
    takes, certainty, left, verdict
):
    found = [Finding("heading_bias", None, [], takes, certainty, "it changes with heading")]
    rest = Rest(left, True, ["heading"])
    weighed = VerdictInputs(4.2, 4.2, 3.6, 2.8, found, rest, [], [], [], 1.0)
    assert weighed.verdict == verdict
    assert "heading_bias" in weighed.sentence and "heading" in weighed.sentence


@pytest.mark.parametrize(
    ("certainty", "instead_of", "verdict"),
    [
        ("doubtful", ("heading_bias", "wheel_gain"), "outside_catalogue"),
        ("sure", ("heading_bias", "wheel_gain"), "effect_missing"),
        ("doubtful", ("heading_bias",), "effect_missing"),
        ("doubtful", (), "effect_missing"),
    ],
)
def test_a_formula_in_place_of_all_that_is_doubtful_is_told_first(certainty, instead_of, verdict):
    """A robot that crabs by the square of its speed: two effects make up 0.1 vx |vx| between them.

    Nothing is left beside them, so that what is left outweighs none of them.
    """
    equals = "vy_mps += 0.1*vx*abs(vx)"
    found = [
        Finding("heading_bias", None, [], 0.65, certainty, "a formula takes more"),
        Finding("wheel_gain", None, [], 0.34, "doubtful", "a formula takes more"),
    ]
    proven = SimpleNamespace(equals=equals, instead_of=instead_of)
    rest = Rest(0.01, False, ["speed"], proven=proven)
    weighed = VerdictInputs(1.75, 1.75, 1.75, 1.01, found, rest, [], [], [], 1.0)
    assert weighed.verdict == verdict
    outside = f"Something outside the catalogue is there: {equals}; it depends on speed."
    assert weighed.sentence.startswith(outside) == (verdict == "outside_catalogue")
    assert all(f.effect in weighed.sentence for f in found)


@pytest.mark.parametrize(("share", "first"), [(0.96, True), (0.4, False)])
def test_what_took_most_is_told_first_with_its_numbers(share, first):
    """A refit took nearly all, and "something outside the catalogue" had stood before it."""
    gain = ParameterEstimate("base.yaw_gain", 0.785, 0.003, "1", False, True)
    stale = Finding(REFIT, None, [gain], share, "sure")
    rest = Rest(1 - share, True, ["place"])
    weighed = VerdictInputs(8.1, 8.1, 1.8, 1.8, [stale], rest, [], [], [], 1.0)
    assert weighed.verdict == "outside_catalogue" and "place" in weighed.sentence
    begin = "Most of the squared error is taken by stale numbers of the base (yaw_gain 0.785"
    assert weighed.sentence.startswith(begin) == first
    assert weighed.sentence.startswith("Something outside the catalogue") != first


@pytest.mark.parametrize(("share", "first"), [(0.96, True), (0.3, False)])
def test_gains_that_took_most_before_anything_was_looked_for_are_told_with_their_values(
    share, first
):
    gain = ParameterEstimate("base.forward_gain", 0.7, 0.003, "1", False, True)
    drift = Finding(REFIT, None, [gain], share, "sure")
    found = [Finding("transient_loss", None, [], 1.0, "sure")]
    weighed = VerdictInputs(
        *(8.1, 2.0, 2.0, 1.0), found, Rest(0.0, False, []), [], [], [], 1.0, drift=drift
    )
    assert ("forward_gain 0.7 take 96 % of the squared error" in weighed.sentence) == first
    assert "Missing: transient_loss (100 %)." in weighed.sentence


@pytest.mark.parametrize(
    ("takes", "wrong_form", "verdict"),
    [
        (0.99, False, "effect_missing"),
        (0.99, True, "outside_catalogue"),
        (0.6, False, "outside_catalogue"),
    ],
)
def test_a_formula_for_nearly_all_that_one_effect_takes_is_a_form_of_it(takes, wrong_form, verdict):
    """A compass that errs by an odd wave of its heading: once a turn takes most of it."""
    why = "it changes with heading"
    found = [Finding("compass_deviation", None, [], takes, "doubtful", why, wrong_form=wrong_form)]
    proven = SimpleNamespace(
        equals="theta_rad += 0.03*cos(theta)", instead_of=("compass_deviation",)
    )
    rest = Rest(1 - takes, False, ["heading"], proven=proven)
    weighed = VerdictInputs(1.5, 1.5, 1.5, 1.01, found, rest, [], [], [], 1.0)
    assert weighed.verdict == verdict
    assert "compass_deviation" in weighed.sentence


@pytest.mark.parametrize(
    ("of_base", "of_effect", "verdict"),
    [
        (0.55, 0.43, "effect_missing"),  # together they take all that was above the noise
        (0.3, 0.3, "outside_catalogue"),
        (0.0, 0.3, "outside_catalogue"),
    ],
)
def test_noise_outweighs_a_name_that_leaves_much(of_base, of_effect, verdict):
    stale = Finding(REFIT, None, [], of_base, "sure")
    found = [*([stale] if of_base else []), Finding("carpet_grain", None, [], of_effect, "sure")]
    rest = Rest(1 - of_base - of_effect, False, [])
    noise = ["the unexplained scatter is 4.2 times the noise in the model file"]
    weighed = VerdictInputs(2.0, 2.0, 1.4, 0.9, found, rest, [], [], noise, 1.0)
    assert weighed.verdict == verdict
    assert "carpet_grain" in weighed.sentence


@pytest.mark.parametrize(
    ("score", "certainty", "within_told", "verdict"),
    [
        (1.05, "doubtful", False, "model_adequate"),
        (1.4, "doubtful", False, "effect_missing"),
        (1.4, "doubtful", True, "cannot_tell"),
        (1.6, "doubtful", True, "effect_missing"),
        (1.05, "sure", False, "effect_missing"),
    ],
)
def test_a_doubtful_effect_is_not_missing_where_nothing_is_missed(
    score, certainty, within_told, verdict
):
    why = "its size may be nothing"
    found = [Finding("speed_curve", None, [], 0.9, certainty, why, within_told=within_told)]
    weighed = VerdictInputs(score, score, score, 1.0, found, Rest(0.0, False, []), [], [], [], 1.0)
    assert weighed.verdict == verdict
    assert "speed_curve" in weighed.sentence


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.34, "effect_missing"), (0.02, "outside_catalogue")]
)
def test_what_is_sure_and_takes_much_is_missing_beside_what_has_another_form(share, verdict):
    """Robots with a limit of their speed, beside whose lag something else is late, too."""
    late = Finding("motor_lag", None, [], 0.5, "doubtful", "much is left", wrong_form=True)
    found = [Finding("speed_limit", None, [], share, "sure"), late]
    rest = Rest(0.27, True, ["place"])
    weighed = VerdictInputs(2.9, 2.9, 2.3, 1.5, found, rest, [], [], [], 1.0)
    assert weighed.verdict == verdict
    assert "speed_limit" in weighed.sentence and "place" in weighed.sentence


@pytest.mark.parametrize(("score", "words"), [(4.4, "too few stretches"), (1.4, "may be noise")])
def test_errors_of_many_times_the_noise_are_not_called_noise(score, words):
    """A robot that drove for three of thirty seconds: too little to be firm, and too much."""
    found = [Finding("coulomb_friction", None, [], 0.1, "doubtful", "much is left")]
    rest = Rest(0.9, False, [], far=score > SETTINGS.no_noise)
    sentence = VerdictInputs(6, 7, 5, score, found, rest, [], [], [], 1.0).sentence
    assert "90 % is left" in sentence and words in sentence


def test_products_are_those_of_what_is_left_beside_what_is_free():
    """Truth: residuals of a regression of all rows on what is free, block by block."""
    rng = np.random.default_rng(6)
    pieces, left = [rng.normal(size=(60, 3)), rng.normal(size=(60, 2))], rng.normal(size=60)
    weight, free = rng.uniform(0.5, 2.0, 60), rng.normal(size=(60, 2))
    pieces[1][:, 1] = free[:, 0] / weight  # of which nothing is left
    blocks = np.repeat(np.arange(6), 10)
    products = Products(Columns(pieces), left, blocks, weight=weight, free=free)
    rows = weight[:, None] * np.hstack(pieces)
    rows -= free @ np.linalg.lstsq(free, rows, rcond=None)[0]
    assert products.seen.tolist() == [True] * 4 + [False]
    own = np.array([0, 2, 3])
    for k, grams in enumerate(products.grams(own[None]).blocks[0]):
        here = blocks == k
        assert grams == pytest.approx(rows[here][:, own].T @ rows[here][:, own])
        assert products.moments[k, :4] == pytest.approx(left[here] @ rows[here][:, :4])
        assert products.energy[k, :4] == pytest.approx((rows[here][:, :4] ** 2).sum(0))
    assert not products.energy[:, 4].any() and not products.moments[:, 4].any()


def test_columns_of_several_logs_stand_one_log_after_the_other():
    random = np.random.default_rng(8)
    logs = [[random.normal(size=(rows, width)) for width in (2, 3)] for rows in (4, 6)]
    columns = Columns.beside(iter(logs), 10)
    assert np.array_equal(columns.some(np.arange(5)), np.vstack([np.hstack(own) for own in logs]))
    wide = random.normal(size=(4, 100))
    assert Columns.beside(iter([[wide, *logs[0]]]), 4).pieces[0] is wide  # of one log no copy


@pytest.mark.parametrize("count", [1, 3, 8])
def test_gains_are_those_on_folds_that_columns_were_not_fitted_to(count):
    """Truth: ridge regressions of the rows themselves, on all other blocks, or all other folds."""
    rng = np.random.default_rng(count)
    blocks, ridge = 7, 0.5
    every = np.arange(blocks)
    fold = every % FOLDS
    x, left = rng.normal(size=(2, blocks, 9, count)), rng.normal(size=(blocks, 9))
    signs = rng.choice([-1.0, 1.0], (9, blocks))
    grams = np.swapaxes(x, 2, 3) @ x
    folds = np.stack([grams[:, fold == k].sum(axis=1) for k in range(FOLDS)], axis=1)
    moments = np.hstack([np.einsum("brk,br->bk", own, left) for own in x])
    places = np.arange(2 * count).reshape(2, count)
    found = native.held_out(moments, places, grams, folds, signs, ridge)
    for own, gains in zip(x, found, strict=True):

        def fitted(pushes, kept, own=own):
            rows = own[kept].reshape(-1, count)
            return np.linalg.solve(rows.T @ rows + ridge * np.eye(count), pushes[kept].sum(axis=0))

        pushes = np.einsum("brk,br->bk", own, left)
        after = [left[b] - own[b] @ fitted(pushes, every != b) for b in every]
        scatter = np.einsum("brk,br->bk", own, after)
        for pushed, gain in zip([pushes, *(signs[..., None] * scatter)], gains, strict=True):
            numbers = [fitted(pushed, fold != k) for k in fold]
            made = np.einsum("brk,bk->br", own, numbers)
            assert gain == pytest.approx(2 * np.sum(numbers * pushed) - np.sum(made**2))
