# SPDX-License-Identifier: Apache-2.0
"""Single moments are told when they begin, and by what the robot did within them."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.diagnosis import moments
from twinmill.diagnosis.diagnose import _after_a_look
from twinmill.diagnosis.doubts import undetermined
from twinmill.diagnosis.finding import Finding
from twinmill.diagnosis.later import later_from
from twinmill.diagnosis.moments import (
    Moment,
    _at_changes,
    _begin_s,
    _done,
    held,
    sentence,
    to_look_at,
)
from twinmill.diagnosis.notes import held_notes
from twinmill.model.parameters import ParameterEstimate
from twinmill.predict.windows import EVERY_S, HORIZONS_S

SPEED_MPS, NOISE_M = 0.2, 3e-4
BEGINS_S, LASTS_S = 20.1, 0.8


def log_of(event_mps: tuple[float, float]) -> SimpleNamespace:
    """A minute of a robot told to go ahead, which for a while goes otherwise."""
    random = np.random.default_rng(1)
    start_s = np.arange(0.0, 58.0, EVERY_S)
    end_s = start_s[:, None] + np.array(HORIZONS_S)
    until_s = BEGINS_S + LASTS_S
    within = np.clip(end_s, BEGINS_S, until_s) - np.clip(start_s, BEGINS_S, until_s)[:, None]
    predicted = np.zeros((*end_s.shape, 3))
    predicted[..., 0] = SPEED_MPS * (end_s - start_s[:, None])
    off_mps = np.array([event_mps[0] - SPEED_MPS, event_mps[1], 0.0])
    errors = within[..., None] * off_mps + random.normal(0, NOISE_M, predicted.shape)
    floor = np.full((len(HORIZONS_S), 3), NOISE_M)
    data = SimpleNamespace(start_s=start_s, measured=predicted + errors, floor=floor)
    return SimpleNamespace(
        trajectory=data, data=data, errors=errors, sees=np.flatnonzero(within.any(axis=1))
    )


@pytest.mark.parametrize(
    ("event_mps", "way", "what"),
    [
        ((0.0, 0.0), 0.0, "less"),
        ((-0.2, 0.0), -1.0, "back"),
        ((0.3, 0.0), 1.5, "more"),
        ((0.2, 0.15), 1.0, "elsewhere"),
        ((0.1, 0.2), 0.5, "elsewhere"),
    ],
)
def test_a_moment_is_told_by_what_happens_within_it(event_mps, way, what):
    """The half second within an event shows it; those that only see its end hardly do."""
    own = log_of(event_mps)
    begin_s = _begin_s(own.data, own.errors, own.sees)
    assert begin_s == pytest.approx(BEGINS_S, abs=HORIZONS_S[1] / 2 + 0.01)
    told_way, told = _done(own.data, own.errors, own.sees)
    assert told_way == pytest.approx(way, abs=0.05) and told == what


@pytest.mark.parametrize(
    ("event_mps", "lasts_s", "whiles"),
    [(0.0, 8.0, 1), (0.0, 1.0, 0), (0.1, 8.0, 0), (-0.2, 8.0, 0)],
    ids=["held", "shortly", "half as fast", "pushed back"],
)
def test_a_robot_that_stands_though_it_is_told_to_drive_was_held(
    monkeypatch, event_mps, lasts_s, whiles
):
    monkeypatch.setattr(f"{__name__}.LASTS_S", lasts_s)
    own = log_of((event_mps, 0.0))
    own.data.errors = lambda _: own.errors
    found = held(SimpleNamespace(trajectory=own.data, model=None))
    assert len(found) == whiles
    for begin_s, end_s in found:
        assert begin_s == pytest.approx(BEGINS_S, abs=0.15)
        assert end_s == pytest.approx(BEGINS_S + lasts_s, abs=0.15)


@pytest.mark.parametrize(("effect", "told"), [("transient_loss", True), ("motor_lag", False)])
def test_that_a_robot_was_held_is_said_beside_a_loss_for_a_while(monkeypatch, effect, told):
    monkeypatch.setattr(f"{__name__}.LASTS_S", 8.0)
    own = log_of((0.0, 0.0))
    own.data.errors = lambda _: own.errors
    log = SimpleNamespace(
        trajectory=own.data,
        data=own.data,
        model=None,
        floor=True,
        measurement=SimpleNamespace(label="a.lcmlog R01"),
    )
    notes = held_notes([log], [Finding("floor_patch", ("floor_patch", effect), [], 1.0, "group")])
    assert [n.startswith("a.lcmlog R01: from 20.") for n in notes] == [True] * told


def test_where_a_robot_is_told_to_stand_no_share_of_its_way_is_told():
    own = log_of((0.0, 0.0))
    data = own.data
    stands = (data.start_s > 15) & (data.start_s < 25)
    data.measured[stands], own.errors[stands] = 0.0, 0.0
    moves = stands & (data.start_s > 19.9) & (data.start_s < 20.7)
    data.measured[moves, :, 0] = own.errors[moves, :, 0] = 0.05
    way, what = _done(data, own.errors, np.flatnonzero(moves))
    assert np.isnan(way) and what == "unasked"


@pytest.mark.parametrize(
    ("done", "words"),
    [
        ([(0.0, "less")] * 3, "it went 0 % of the predicted way"),
        ([(-1.0, "back")] * 2 + [(0.5, "less")], "it drove backwards, 100 % of the predicted way"),
        ([(-2.5, "back")] * 3, "it drove backwards, 2.5 times the predicted way"),
        ([(2.98, "more")] * 3, "it went 3.0 times the predicted way in half a second"),
        ([(1.0, "elsewhere")] * 3, "it went elsewhere, or turned"),
        ([(0.1, "less"), (-1.0, "back"), (2.0, "more")], "it did something else each time"),
    ],
)
def test_the_sentence_says_what_most_moments_have_in_common(done, words):
    told = sentence([Moment("run", 1, 8.0 * k, way, what) for k, (way, what) in enumerate(done)])
    assert words in told


@pytest.mark.parametrize(
    ("begins_s", "told"),
    [
        ([4.1, 12.1, 20.2, 28.0], True),
        ([4.1, 12.1, 20.2, 29.5], False),  # one is not
        ([4.1, 12.1], False),  # which chance does: a sixth of the time is near a change
    ],
)
def test_moments_that_all_are_at_changes_of_the_command_may_be_what_acts_there(begins_s, told):
    """A lag that grows with the speed misses most at changes from one fast speed to another."""
    t_s = 4.0 * np.arange(20)
    command = np.tile([[0.2, 0, 0], [-0.2, 0, 0]], (10, 1))
    track = SimpleNamespace(command=command, command_t_s=t_s)
    data = SimpleNamespace(measurement=SimpleNamespace(track=track))
    own = SimpleNamespace(trajectory=data, data=data, known_floor=SimpleNamespace(offset_s=0.0))
    at = _at_changes(own, np.array(begins_s))
    assert at == told
    words = sentence([Moment("run", 1, b, 0.7, "less", at) for b in begins_s])
    assert ("at changes of the command" in words) == told


@pytest.mark.parametrize(("what", "asked"), [("elsewhere", True), ("back", True), ("less", False)])
def test_commands_that_may_not_have_arrived_are_looked_at_before_another_drive(what, asked):
    look = to_look_at([Moment("run", 1, 8.0 + k, 0.2, what) for k in range(4)])
    assert bool(look) == asked
    drive = _after_a_look({"why": "drive on", "separates": []}, look)
    assert drive["why"].startswith("first look") == asked and drive["why"].endswith("drive on")
    assert _after_a_look(None, look) is None


@pytest.mark.parametrize(("seen", "certainty"), [(False, "doubtful"), (True, "sure")])
def test_an_effect_of_which_no_number_is_determined_is_not_sure(seen, certainty):
    numbers = [ParameterEstimate(f"transient_loss.{n}", 1.0, 1.0, "1", False, seen) for n in "ab"]
    (found,) = undetermined([Finding("transient_loss", None, numbers, 1.0, "sure")])
    assert found.certainty == certainty


@pytest.mark.parametrize(
    ("later_s", "other_m", "told"),
    [
        (0.15, 0.0, True),
        (-0.1, 0.0, True),
        (0.24, 0.0, True),
        (0.0, 0.0, False),
        (0.15, 0.05, False),
    ],
)
def test_commands_that_act_later_from_a_moment_on_are_one_change(
    later_s, other_m, told, monkeypatch
):
    """A robot on another clock than its commands' is off where these change, each second window.

    Where something else makes most of the error, some lateness suits each part a little.
    """
    count, from_s = 200, 30.0
    start_s = EVERY_S * np.arange(count)
    late_s = np.where(start_s >= from_s, later_s, 0.0)
    changes = np.arange(count) % 2

    def errors(clock_s):
        off = SPEED_MPS * changes * np.abs(clock_s - late_s) + other_m * (1 - changes)
        return np.broadcast_to(off[:, None, None], (count, len(HORIZONS_S), 3))

    clock = {}
    model = SimpleNamespace(get=lambda _: 0.0, copy=lambda: model, set=clock.__setitem__)
    data = SimpleNamespace(
        start_s=start_s,
        keep=np.ones(count, bool),
        floor=np.ones((len(HORIZONS_S), 3)),
        over=lambda *_: data,
        rows=lambda _, __, values: np.array([errors(v).ravel() for v in values[:, 0]]),
        errors=lambda _: errors(clock["clock.offset_s"]),
        measurement=SimpleNamespace(log_name="run", track=SimpleNamespace(robot_id=1)),
    )
    floor = SimpleNamespace(across=None, keep=data.keep)
    own = SimpleNamespace(trajectory=data, data=data, floor=floor, known_floor=floor)
    found = later_from(own, model)
    assert bool(found) == told
    if found:
        change, left = found
        assert change.later_s == pytest.approx(later_s) and np.abs(left).max() < 1e-9
        assert change.from_s == pytest.approx(from_s, abs=2 * EVERY_S)
    # Where that change takes the events away, no single moments are told.
    data.errors = lambda _: np.ones(1)
    seen = iter([[np.arange(3)], [] if told else [np.arange(3)]])
    monkeypatch.setattr(moments, "_several", lambda *_: next(seen))
    monkeypatch.setattr(moments, "_of_log", lambda *_: ["moment"])
    monkeypatch.setattr(moments, "later_from", lambda *_: found)
    events = moments.events_of([own], [model])
    assert (len(events.later), len(events.moments)) == ((1, 0) if told else (0, 1))


def test_a_horizon_that_is_not_judged_tells_nothing_of_the_begin(recwarn):
    own = log_of((0.0, 0.0))
    own.data.floor[-1] = np.inf
    begin_s = _begin_s(own.data, own.errors, own.sees)
    assert begin_s == pytest.approx(BEGINS_S, abs=HORIZONS_S[1] / 2 + 0.01)
    assert not len(recwarn)
