# SPDX-License-Identifier: Apache-2.0
"""By how much and how long speed and turning wander: of Ornstein-Uhlenbeck processes, by steps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from twinmill.diagnosis.wander import Wander, wandering
from twinmill.predict.windows import EVERY_S, HORIZONS_S

STEP_S, SPAN_S = 0.05, 1500.0
COUNT = round(SPAN_S / STEP_S)
SENSOR_M, SENSOR_RAD = 5e-4, 2e-3


def wander(random, size, time_s):
    """(COUNT,) of a first-order process, step by step."""
    keep = np.exp(-STEP_S / time_s)
    return lfilter([size * np.sqrt(1 - keep**2)], [1, -keep], random.normal(size=COUNT))


def held(random, values):
    """(COUNT,) one of some values for a second and a half each."""
    return np.repeat(random.choice(values, COUNT), round(1.5 / STEP_S))[:COUNT]


def log(seed, *, gain=0.0, gain_s=1.0, turn_radps=0.0, turn_s=1.0, shown_s=SPAN_S):
    """The first of a robot that drives on and back and turns, and the errors of a right model."""
    random = np.random.default_rng(seed)
    speed_mps = held(random, [-0.3, 0.0, 0.15, 0.3])
    turning_radps = held(random, [-1.0, 0.0, 1.0])
    more_m = np.cumsum(STEP_S * speed_mps * wander(random, gain, gain_s))
    more_rad = np.cumsum(STEP_S * wander(random, turn_radps, turn_s))
    seen = random.normal(size=(COUNT, 3)) * (SENSOR_M, SENSOR_M, SENSOR_RAD)
    off = seen + np.column_stack([more_m, np.zeros(COUNT), more_rad])
    way = STEP_S * np.column_stack([speed_mps, np.zeros(COUNT), turning_radps]).cumsum(axis=0)
    last = round((shown_s - HORIZONS_S[-1]) / STEP_S) - 1
    starts = np.arange(0, last, round(EVERY_S / STEP_S))
    ends = starts[:, None] + np.rint(np.array(HORIZONS_S) / STEP_S).astype(int)
    errors, measured = (v[ends] - v[starts][:, None] for v in (off, way + off))
    start_s = starts * STEP_S
    data = SimpleNamespace(measured=measured, start_s=start_s, covered_s=len(starts) * EVERY_S)
    return data, errors


@pytest.mark.parametrize(("gain", "gain_s"), [(0.04, 2.0), (0.08, 5.0)])
def test_a_gain_that_wanders_is_told_by_its_size_and_duration(gain, gain_s):
    found = wandering([log(1, gain=gain, gain_s=gain_s)])
    assert found.way == pytest.approx(gain, rel=0.2)
    assert found.way_s == pytest.approx(gain_s, rel=0.4)
    assert found.turn_radps == 0


def test_a_heading_that_wanders_is_told_in_rad_per_second():
    found = wandering([log(2, turn_radps=0.05, turn_s=3.0)])
    assert found.turn_radps == pytest.approx(0.05, rel=0.2)
    assert found.turn_s == pytest.approx(3.0, rel=0.4)
    assert found.way == 0
    assert found.words.startswith("by about 0.05 rad/s for ")


def test_logs_together_tell_one_wander():
    parts = [log(seed, gain=0.05, gain_s=3.0) for seed in (3, 4)]
    alone = [wandering([part]).way for part in parts]
    assert wandering(parts).way == pytest.approx(np.mean(alone), rel=0.03)


def test_the_noise_of_a_sensor_does_not_wander():
    """Each of four correlations is beyond two standard errors on one side by 2.3 %."""
    assert sum(wandering([log(seed)]) is not None for seed in range(20)) <= 6


@pytest.mark.parametrize("from_s", [0, 30, 75])
def test_what_lasts_for_a_while_and_ends_does_not_wander(from_s):
    """For 20 s of 100 the robot turns by 0.1 rad/s more, once."""
    for seed in range(6):
        data, errors = log(seed, shown_s=100.0)
        begins_s = data.start_s[:, None]
        ends_s = begins_s + HORIZONS_S
        lasts_s = np.minimum(ends_s, from_s + 20) - np.maximum(begins_s, from_s)
        errors[:, :, 2] += 0.1 * np.maximum(lasts_s, 0)
        found = wandering([(data, errors)])
        assert found is None or not found.turn_radps


def test_what_wanders_across_alone_has_no_size_in_words():
    assert Wander().words == ""
