# SPDX-License-Identifier: Apache-2.0
"""Moments at which a robot did what neither its commands nor what was found explain.

Where both the smooth response of the noise floor and the final model miss by far more than usually,
something happened that is not there all the time: a push, or a drop-out. Such moments are told one
by one, since no effect that acts all the time is like that.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.later import Later, later_from
from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.floor import ARM_M, is_far
from twinmill.fitting.opening import Opened
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import HORIZONS_S

ARM = (1.0, 1.0, ARM_M)  # of displacements: all as ways, m
APART_S = 1.0  # between the starts of windows of two moments
LEAST_S = 1.0  # between the first and the last window of a stretch that is worth a sentence
SEEN = 2  # windows overlap, so that more than one sees what lasts
HORIZON = HORIZONS_S.index(0.5)
LESS, MORE = 0.9, 1.1  # of the predicted way
BACK = -0.1  # of it: noise of a robot that is held is less
STANDS = 0.1  # of the usual way: where less is predicted, no share of it means anything
TOLD = 0.5  # of the usual way: where as much is predicted and it stands, a robot is held ...
HELD_S = 2.0  # ... if that lasts
HARDLY = 0.05  # share of the way: events that all change it by less must be twice as many

NEAR_S = 0.3  # from a change of the command ...
CHANGES = 0.2  # ... of so much of the largest command: a moment is at it

EVEN = 4  # moments, of which the times between are a few tenths of a second from one period
EVEN_S = 0.4

What = Literal["less", "back", "more", "elsewhere", "unasked"]
DID: dict[What, str] = {
    "less": "it went {way} the predicted way in half a second",
    "back": "it drove backwards, {way} the predicted way in half a second",
    "more": "it went {way} the predicted way in half a second",
    "elsewhere": "it went elsewhere, or turned",
    "unasked": "it moved where it was told to stand",
}
AS_WHERE: dict[What, str] = {
    "less": "a motor or the supply drops out, or wheels slip or are held",
    "back": "it is pushed back, or a command was lost",
    "more": "it is pushed, rolls on after a command, or a command was not recorded",
    "elsewhere": "a command was lost or came late",
    "unasked": "it is pushed, or a command to stand was lost",
}


@dataclass(frozen=True)
class Moment:
    """One event.

    Attributes:
        log: its name.
        robot_id: of the robot.
        t_s: capture's clock, when it begins.
        way: share of the predicted way that was gone in the half second within it that is farthest
            off; negative if backwards, NaN where hardly any was predicted.
        at_change: it is one of moments that all are at changes of the command.
        what: it went "less" or "more" of the way, "back", "elsewhere" if more of the miss is across
            the way than along it, or moved "unasked".
    """

    log: str
    robot_id: int
    t_s: float
    way: float
    what: What
    at_change: bool = False

    def to_json(self) -> dict[str, Any]:
        """Fields of JSON output."""
        return vars(self)


@dataclass(frozen=True)
class Stretch:
    """One that the floor left out as disturbed: from when to when, s, and what a moment says."""

    begin_s: float
    end_s: float
    way: float
    what: What

    @property
    def words(self) -> str:
        """When, and what the robot did."""
        return f"{self.begin_s:.1f} to {self.end_s:.1f} s {did(self.what, self.way)}"


@dataclass(frozen=True)
class Events:
    """Errors that the final model leaves at some times alone.

    Attributes:
        moments: single ones, of all logs that have several, in the order of time.
        later: lasting changes of when commands act, which only look like moments.
    """

    moments: tuple[Moment, ...] = ()
    later: tuple[Later, ...] = ()

    @property
    def at_changes(self) -> bool:
        """All moments are at changes of the command: what acts at each of these may be them."""
        return bool(self.moments) and all(m.at_change for m in self.moments)

    @property
    def sentence(self) -> str:
        """Event in words for people; empty if there was none."""
        told = [change.sentence for change in self.later]
        return " ".join([*told, *([sentence(self.moments)] if self.moments else [])])


def events_of(opened: Sequence[Opened], models: Sequence[native.Model]) -> Events:
    """Events of all logs.

    Args:
        opened: measurements over their floors; tables have no moments.
        models: with what was found, one for each.
    """
    moments, later = [], []
    for own, model in zip(opened, models, strict=True):
        if own.floor is None:
            continue
        errors = own.trajectory.errors(model)
        events = _several(own, errors)
        if events and (change := later_from(own, model)) and not _several(own, change[1]):
            later.append(change[0])
        elif events:
            moments += _of_log(own, errors, events)
    return Events(tuple(moments), tuple(later))


def _several(own: Opened, errors: np.ndarray) -> list[np.ndarray]:
    """Windows of each event, where these are so many that they are no accident; else none."""
    data, floor = own.trajectory, own.known_floor
    moved = data.measured - errors
    missed = np.flatnonzero(
        is_far(errors, data.floor, SETTINGS.far, moved)
        & (is_far(floor.across, data.floor, SETTINGS.far, moved) | ~floor.keep)
    )
    events = _events(missed, data.start_s)
    return events if _weight(events, data.start_s) >= SETTINGS.several else []


def _of_log(own: Opened, errors: np.ndarray, events: Sequence[np.ndarray]) -> list[Moment]:
    data = own.trajectory
    every = _ways(data, errors)
    faint = all(abs(np.nanmedian(every[event]) - 1) < HARDLY for event in events)
    if faint and _weight(events, data.start_s) < 2 * SETTINGS.several:
        return []
    name, robot_id = data.measurement.log_name, data.measurement.track.robot_id
    begins_s = [_begin_s(data, errors, e) for e in events]
    at = _at_changes(own, np.array(begins_s))
    return [
        Moment(name, robot_id, begin_s, *_done(data, errors, e), at)
        for begin_s, e in zip(begins_s, events, strict=True)
    ]


def _at_changes(own: Opened, begins_s: np.ndarray) -> bool:
    """True if all events begin at changes of the command, by more than chance.

    Args:
        own: the log.
        begins_s: of events, capture's clock.
    """
    track = own.trajectory.measurement.track
    share = track.command / np.maximum(np.abs(track.command).max(axis=0), 1e-9)
    way = np.cumsum(np.abs(np.diff(share, axis=0, prepend=share[:1])).max(axis=1))

    def near(t_s: np.ndarray) -> np.ndarray:
        first, last = (np.searchsorted(track.command_t_s, t_s + s) - 1 for s in (-NEAR_S, NEAR_S))
        return way[last.clip(0)] - way[first.clip(0)] > CHANGES

    usual = near(np.arange(track.command_t_s[0], track.command_t_s[-1], NEAR_S / 2)).mean()
    at = near(begins_s - own.known_floor.offset_s)
    return bool(at.all() and usual ** len(begins_s) < SETTINGS.dependence_chance)


def _begin_s(data: Trajectory, errors: np.ndarray, event: np.ndarray) -> float:
    """When an event begins: what most of the predictions that see it agree on.

    Each is right up to one horizon and far at the next, so that it begins between these. Those two
    seconds ahead see it long before it begins, and those that start within it see only its end.
    """
    far = np.stack([_far_at(data, errors, h) for h in range(len(HORIZONS_S))], 1)[event]
    event, far = event[far.any(axis=1)], far[far.any(axis=1)]
    if not len(event):
        return float("nan")
    edges_s = np.array([0.0, *HORIZONS_S])
    first = far.argmax(axis=1)
    after_s, until_s = (data.start_s[event] + edges_s[k] for k in (first, first + 1))
    agree = (after_s <= after_s[:, None]) & (after_s[:, None] < until_s)
    most = agree.sum(axis=1)
    return float(after_s[most == most.max()].min())


def _far_at(data: Trajectory, errors: np.ndarray, horizon: int) -> np.ndarray:
    """(W,) predictions that are far off at one horizon; none where it is not judged."""
    floor = data.floor[[horizon]]
    seen = np.isfinite(errors[:, horizon]).any(axis=0) & np.isfinite(floor[0]) & (floor[0] > 0)
    if not seen.any():
        return np.zeros(len(errors), bool)
    return is_far(errors[:, [horizon]], floor, SETTINGS.far, (data.measured - errors)[:, [horizon]])


def _done(data: Trajectory, errors: np.ndarray, event: np.ndarray) -> tuple[float, What]:
    """Way, and what the robot did, in the half second of an event that is farthest off."""
    with np.errstate(invalid="ignore"):
        over = np.nan_to_num(errors[event, HORIZON] / data.floor[HORIZON])
    at = event[np.sum(over**2, axis=1).argmax()]
    measured, missed = (np.nan_to_num(d[:, HORIZON]) * ARM for d in (data.measured, errors))
    predicted = measured - missed
    size = np.linalg.norm(predicted, axis=1)
    usual = float(np.sqrt(np.mean(size**2)))
    if size[at] < STANDS * usual:
        return float("nan"), "unasked"
    along = predicted[at] / size[at]
    way = float(measured[at] @ along / size[at])
    across = np.linalg.norm(missed[at] - (missed[at] @ along) * along) / size[at]
    if across > abs(1 - way) or LESS <= way <= MORE:
        return way, "elsewhere"
    return way, "back" if way < BACK else "less" if way < LESS else "more"


def _events(missed: np.ndarray, start_s: np.ndarray) -> list[np.ndarray]:
    """Windows that miss, those of each event together.

    Args:
        missed: (N,) numbers of windows, rising.
        start_s: (W,) of all windows.
    """
    clusters = np.split(missed, 1 + np.flatnonzero(np.diff(start_s[missed]) > APART_S))
    return [c for c in clusters if len(c) >= SEEN]


def _weight(events: Sequence[np.ndarray], start_s: np.ndarray) -> int:
    """How many events these are worth: one that lasts is as little an accident as two."""
    return sum(2 if _lasts(event, start_s) else 1 for event in events)


def _lasts(event: np.ndarray, start_s: np.ndarray) -> bool:
    return bool(start_s[event[-1]] - start_s[event[0]] >= LEAST_S)


def left_out(own: Opened) -> list[Stretch]:
    """Stretches of a second or more that the floor left out as disturbed, and the model misses."""
    gone = np.flatnonzero(~own.known_floor.keep)
    if not len(gone):
        return []
    data = own.trajectory
    errors, found = data.errors(own.model), []
    missed = is_far(errors, data.floor, SETTINGS.far, data.measured - errors)
    for part in _events(gone, data.start_s):
        if _lasts(part, data.start_s) and missed[part].any():
            first_s, end_s = data.start_s[part[[0, -1]]]
            begin_s = _begin_s(data, errors, part)
            begin_s = begin_s if begin_s < end_s else float(first_s)
            found.append(Stretch(begin_s, float(end_s), *_done(data, errors, part)))
    return found


def held(own: Opened) -> list[tuple[float, float]]:
    """From when to when, s, a robot stood that was told to drive; whiles of HELD_S or more."""
    data = own.trajectory
    measured, missed = (
        np.nan_to_num(d[:, HORIZON]) * ARM for d in (data.measured, data.errors(own.model))
    )
    size, went = (np.linalg.norm(way, axis=1) for way in (measured - missed, measured))
    usual = float(np.sqrt(np.mean(size**2)))
    told = np.flatnonzero(size > TOLD * usual)
    stood = went[told] < STANDS * usual
    runs = np.split(told, np.flatnonzero(np.diff(stood)) + 1) if len(told) else []
    whiles = [
        (float(data.start_s[run[0]]), float(data.start_s[run[-1]] + HORIZONS_S[HORIZON]))
        for run in runs
        if went[run[0]] < STANDS * usual
    ]
    return [(begin_s, end_s) for begin_s, end_s in whiles if end_s - begin_s > HELD_S]


def _ways(data: Trajectory, errors: np.ndarray) -> np.ndarray:
    """(W,) share of the predicted way that was gone along it in half a second."""
    measured, missed = (np.nan_to_num(d[:, HORIZON]) * ARM for d in (data.measured, errors))
    predicted = measured - missed
    return np.sum(measured * predicted, axis=1) / np.maximum(np.sum(predicted**2, axis=1), 1e-12)


def sentence(moments: Sequence[Moment]) -> str:
    """Events in words for people: their common effect, if most of them have one."""
    most, count = Counter(m.what for m in moments).most_common(1)[0]
    told = "it did something else each time"
    if 2 * count > len(moments):
        way = float(np.median([m.way for m in moments if m.what == most]))
        told = f"{did(most, way)}, as where {AS_WHERE[most]}"
    at = f"At {len(moments)} moments ({_listed(moments)})"
    period_s = every_s(moments)
    at += f", one every {period_s:.1f} s as by a clock," if period_s else ""
    missed = f"{at} the robot did not follow its commands: {told}."
    if not Events(tuple(moments)).at_changes:
        return missed
    return (
        f"{missed} All are at changes of the command: what is late or lost at each of these, and "
        "more where the robot is faster, may be there instead."
    )


def every_s(moments: Sequence[Moment]) -> float:
    """The period at which moments of one log come back; 0 where they do not.

    Four or more, each a whole number of periods after the one before, most of them one.
    """
    apart_s = np.diff([m.t_s for m in moments])
    if len({m.log for m in moments}) != 1 or len(moments) < EVEN or not np.isfinite(apart_s).all():
        return 0.0
    period_s = float(np.median(apart_s))
    count = np.round(apart_s / max(period_s, 1e-9))
    even = np.abs(apart_s - count * period_s) < EVEN_S
    shortest = period_s > EVEN * EVEN_S
    return period_s if shortest and even.all() and np.all(count >= 1) else 0.0


def to_look_at(moments: Sequence[Moment]) -> str:
    """Advice before another drive, in a clause; empty where the robot just went less."""
    asked = [m for m in moments if m.what != "less"]
    if 2 * len(asked) < max(len(moments), 1):
        return ""
    return (
        "look into the robot's own record whether the commands about "
        f"{_listed(asked)} arrived, and when: lost, late or mixed up they look like that"
    )


def _listed(moments: Sequence[Moment]) -> str:
    listed = ", ".join(f"{m.t_s:.1f}" for m in moments[:3])
    return listed + (f" s and {len(moments) - 3} more" if len(moments) > 3 else " s")


def did(what: What, way: float) -> str:
    """Robot's deed in a clause: a share of the way, or so many times that."""
    size = abs(way)
    return DID[what].format(way=f"{100 * size:.0f} % of" if size <= 1 else f"{size:.1f} times")
