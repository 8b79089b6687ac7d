# SPDX-License-Identifier: Apache-2.0
"""Frames that were taken at an even beat, under stamps that a busy machine wrote."""

import numpy as np
import pytest

from twinmill.data.importers.beat import at_even_beat

RATE_HZ = 100.0
TAKEN_S = 5.0 + np.arange(6000) / RATE_HZ


def stamped(t_s):
    return np.round(1e6 * t_s).astype(np.int64)


@pytest.mark.parametrize("kind", ["about the truth", "in heaps of ten", "one stamp for ten"])
def test_jitter_of_50_ms_is_taken_out(kind):
    """Within a millisecond, but for the 45 ms that a heap is late on the average."""
    random = np.random.default_rng(1)
    late_s = 0.0
    if kind == "about the truth":
        stamps_s = TAKEN_S + random.uniform(-0.05, 0.05, len(TAKEN_S))
    else:
        late_s = 0.045
        stamps_s = 5.09 + np.floor((TAKEN_S - 5 + 1e-9) * 10) / 10
        stamps_s += 1e-5 * (np.arange(len(TAKEN_S)) % 10) * (kind == "in heaps of ten")
    utime_us, (said,) = at_even_beat(stamped(stamps_s), "p.csv")
    assert np.abs(1e-6 * utime_us - TAKEN_S - late_s).max() < 0.0015
    assert "a beat of 100 Hz" in said


def test_frames_that_wait_for_a_busy_machine_come_where_they_were_taken():
    """Each twentieth waits 50 to 90 ms, one 360 ms, and those behind them come in a heap."""
    random = np.random.default_rng(7)
    waits_s = random.uniform(0.05, 0.09, len(TAKEN_S)) * (random.random(len(TAKEN_S)) < 0.05)
    waits_s[2000] = 0.36
    stamps_s = np.maximum.accumulate(TAKEN_S + waits_s)
    utime_us, _ = at_even_beat(stamped(stamps_s), "p.csv")
    late_s = 1e-6 * utime_us - TAKEN_S
    assert np.abs(late_s - np.mean(stamps_s - TAKEN_S)).max() < 0.5 / RATE_HZ


def test_frames_under_whole_seconds_come_where_they_were_taken():
    """Within half a frame, but for the half second by which the seconds were cut."""
    stamps_s = np.floor(TAKEN_S + 0.4)
    utime_us, (said,) = at_even_beat(stamped(stamps_s), "p.csv")
    late_s = 1e-6 * utime_us - TAKEN_S
    assert np.abs(late_s - np.mean(stamps_s - TAKEN_S)).max() < 0.5 / RATE_HZ
    assert "a beat of 100 Hz" in said


@pytest.mark.parametrize(
    "stamps_s",
    [
        TAKEN_S + np.random.default_rng(1).normal(0, 0.001, len(TAKEN_S)),
        np.delete(TAKEN_S, np.arange(2000, 2100)),
        np.delete(TAKEN_S, slice(1000, 5000, 50)) + np.tile([0.03, -0.03], 2960),
        np.floor(np.delete(TAKEN_S, slice(2000, 2150))),
        np.random.default_rng(1).permutation(TAKEN_S),
        TAKEN_S + 0.1 * np.sin(TAKEN_S),
    ],
    ids=[
        "hardly",
        "a second is missing",
        "frames are missing",
        "whole, some are missing",
        "shuffled",
        "a clock that wavers",
    ],
)
def test_stamps_that_are_no_jittering_beat_stay(stamps_s):
    utime_us, said = at_even_beat(stamped(stamps_s), "p.csv")
    np.testing.assert_array_equal(utime_us, stamped(stamps_s))
    assert not said
