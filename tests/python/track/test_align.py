# SPDX-License-Identifier: Apache-2.0
"""`twinmill track --commands`: when a film began, from drives whose beginning is known."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.importers.series import CommandSeries
from twinmill.track.align import align
from twinmill.track.paths import RobotPath
from twinmill.track.together import on_clock

EPOCH_S = 1.7e9


def commands(seed, robot_id=1, duration_s=60.0, steps=None):
    """Duties of both sides, held for random times from 0.4 to 2 s, with stops between."""
    random = np.random.default_rng(seed)
    t_s = np.cumsum(random.uniform(0.4, 2.0, 400))
    t_s = t_s[t_s < duration_s]
    sides = random.choice([-80, -50, 50, 80], (len(t_s), 2))
    sides[::2] = 0
    sides = sides if steps is None else np.tile(steps, (len(t_s), 1))
    value = np.column_stack([sides, sides]).astype(float)
    nothing = np.full((len(t_s), 2), np.nan)
    stamps = np.round((EPOCH_S + t_s) * 1e6).astype(np.int64)
    return CommandSeries(robot_id, stamps, "duty", value, True, nothing, nothing, 2)


def driven(series, begin_s, duration_s, robot_id=1, hidden=()):
    """Film, begun at `begin_s` of the commands, of a robot that obeys at once."""
    t_s = np.arange(0, 80, 0.01)
    row = np.searchsorted(series.utime_us / 1e6 - EPOCH_S, t_s, side="right") - 1
    duty = np.where(row[:, None] >= 0, series.value[np.maximum(row, 0)], 0.0)
    left, right = 0.003 * duty[:, 0], 0.003 * duty[:, 1]
    heading = np.cumsum((right - left) / 0.25) * 0.01
    speed = (left + right) / 2
    place = np.cumsum(np.stack([speed * np.cos(heading), speed * np.sin(heading)]), axis=1) * 0.01
    film_s = np.arange(0, duration_s, 1 / 30)
    seen = [np.interp(film_s + begin_s, t_s, column) for column in (*place, heading)]
    pose = np.column_stack(seen)
    for a, b in hidden:
        pose[(film_s >= a) & (film_s < b)] = np.nan
    flat = np.zeros(len(film_s))
    return RobotPath(robot_id, film_s, pose, flat, flat, 0)


@pytest.mark.parametrize(
    ("begin_s", "duration_s"), [(12.3, 30.0), (0.0, 55.0), (-4.0, 50.0), (25.0, 50.0)]
)
def test_beginning_is_found_wherever_it_is(begin_s, duration_s):
    series = commands(1)
    path = driven(series, begin_s, duration_s, hidden=((3.0, 5.0),))
    shift_s = align([path], [series])
    assert shift_s == pytest.approx(EPOCH_S + begin_s, abs=0.05)
    (moved,) = on_clock([path], shift_s)
    assert moved.t_s[0] == shift_s and np.array_equal(moved.pose, path.pose, equal_nan=True)


def test_turns_and_speeds_weigh_alike_where_velocities_are_told():
    """Straights at 0.24 m/s between turns on the spot at 0.48 rad/s, hardly a move of the tag."""
    series = commands(7)
    ahead, around = [80, 80, 80, 80], [-20, 20, -20, 20]
    value = np.array([ahead, around] * len(series.value), float)[: len(series.value)]
    series = replace(series, value=value)
    left, right = 0.003 * series.value[:, 0], 0.003 * series.value[:, 1]
    nothing = np.zeros(len(left))
    value = np.column_stack([(left + right) / 2, nothing, (right - left) / 0.25, nothing])
    told = replace(series, kind="twist", value=value)
    assert align([driven(series, 6.0, 20.0)], [told]) == pytest.approx(EPOCH_S + 6.0, abs=0.05)


def test_robots_tell_together():
    both = [commands(2), commands(3, robot_id=2)]
    paths = [driven(series, 8.0, 20.0, series.robot_id) for series in both]
    assert align(paths, both) == pytest.approx(EPOCH_S + 8.0, abs=0.05)


def test_what_cannot_be_told_is_said():
    series = commands(4)
    with pytest.raises(ValueError, match="none is in both"):
        align([driven(series, 3.0, 20.0, robot_id=7)], [series])
    with pytest.raises(ValueError, match="cannot be found"):
        align([driven(commands(5), 3.0, 40.0)], [series])  # another drive
    steady = commands(6, steps=(50, 50))
    with pytest.raises(ValueError, match="cannot be found"):
        align([driven(steady, 10.0, 20.0)], [steady])
