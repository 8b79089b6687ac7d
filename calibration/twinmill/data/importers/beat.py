# SPDX-License-Identifier: Apache-2.0
"""Stamps that jitter: a camera takes its frames at an even beat, whatever a busy machine wrote."""

import numpy as np

FEWEST = 50  # rows that tell a beat
JITTERS = 0.5  # of a period, standard deviation
HEAPED, SHORT = 0.1, 0.1  # share of the steps that are shorter than that share of a period, or back
WANDERS = 1.0  # of a period, of medians over MIDDLE_S: frames are missing, or the beat is none
MIDDLE_S = 2.0  # a stamp that is further off is none of a frame that was only written late


def at_even_beat(utime_us: np.ndarray, where: str) -> tuple[np.ndarray, list[str]]:
    """Stamps at the even beat that jittering ones are about, and what is to be said of it.

    Those that do not jitter stay as they are; so do those of which frames are missing, since the
    numbers of the rows tell no times then.

    Args:
        utime_us: (N,) int, in the order of the frames.
        where: the file, the robot, the topic.
    """
    found = _beat(utime_us)
    if not found:
        return utime_us, []
    beat_us, jitter_s = found
    return beat_us, [
        f"{where}: the stamps jitter by {1e3 * jitter_s:.0f} ms about a beat of "
        f"{1e6 / np.diff(beat_us).mean():.3g} Hz, which is taken for the frames' times; stamp "
        "frames when they are taken, since what is late in all of them cannot be seen."
    ]


def _beat(utime_us: np.ndarray) -> tuple[np.ndarray, float] | None:
    """(N,) int ascending, and the standard deviation of the jitter, s.

    Frames that wait for a busy machine come late in a heap, and those behind them as soon as ever:
    the median of a stretch, unlike its mean, does not tell how long the longest of them waited.
    """
    if len(utime_us) < FEWEST:
        return None
    frame = np.arange(len(utime_us))
    t_s = (utime_us - utime_us[0]) * 1e-6
    period_s, first_s = np.polyfit(frame, t_s, 1)
    off_s = t_s - (first_s + period_s * frame)
    jitter_s = float(off_s.std())
    if period_s <= 0 or np.abs(off_s).max() > MIDDLE_S or jitter_s < JITTERS * period_s:
        return None
    if np.mean(np.diff(t_s) < SHORT * period_s) < HEAPED:
        return None
    count = max(1, round(MIDDLE_S / period_s))
    stretches = np.array_split(off_s, -(-len(off_s) // count))
    wanders_s = np.abs([np.median(stretch) for stretch in stretches] - np.median(off_s)).max()
    if wanders_s > WANDERS * period_s + 3 * jitter_s / np.sqrt(count):
        return None
    beat_us = utime_us[0] + np.round(1e6 * (first_s + period_s * frame)).astype(np.int64)
    return beat_us, jitter_s
