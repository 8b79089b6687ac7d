# SPDX-License-Identifier: Apache-2.0
"""Two senders on a topic of commands, of which one is idle and the robot obeys the other."""

from dataclasses import replace

import numpy as np

from twinmill.data.checks.alternatives import Explained, Search, alike_left
from twinmill.data.checks.finding import CheckedTrack, InputFinding
from twinmill.data.checks.motion import Motion
from twinmill.data.checks.settings import CHECKS
from twinmill.data.track import Track


def check_senders(checked: CheckedTrack, own: Explained) -> list[InputFinding]:
    """A finding where the robot is as fast as told only without the zeros between its commands.

    A robot that obeys both is as fast as their mean, and needs no word.

    Args:
        checked: one robot's track.
        own: how well all its commands explain the motion.
    """
    track = checked.track
    idle = _zeros_between(track)
    if not idle.any() or _is_as_told(own):
        return []
    told = replace(track, command_t_s=track.command_t_s[~idle], command=track.command[~idle])
    alone = Search(Motion.of(told), checked.body).own()
    if not _is_as_told(alone) or alone.left > max(CHECKS.good, alike_left([own.left])):
        return []
    return [
        checked.finding(
            "zeros stand between its commands, as of a second sender that is idle",
            f"{idle.mean():.0%} of all rows; the robot is {own.gain.max():.3g} times as fast as "
            f"all say, and {alone.gain.max():.3g} times as the others say",
            "record the topic that reaches the motors, or take the zeros between out, and import "
            "anew",
        )
    ]


def _is_as_told(e: Explained) -> bool:
    """True if drive and turn, as far as the commands have them, are about as fast as told."""
    gain = e.gain[e.gain != 0]
    return bool(np.all(np.abs(np.log(np.abs(gain))) < np.log(CHECKS.unit_off)))


def _zeros_between(track: Track) -> np.ndarray:
    """(M,) bool, commands to stand with others before and behind them, sooner than a robot stops.

    Sooner is CHECKS.back_s, in which none is driven to and fro.
    """
    t_s = track.command_t_s
    moving = np.flatnonzero(track.command.any(axis=1))
    if not len(moving):
        return np.zeros(len(t_s), bool)
    behind = np.searchsorted(moving, np.arange(len(t_s)))
    idle = (behind > 0) & (behind < len(moving)) & ~track.command.any(axis=1)
    before_s = t_s[moving[np.maximum(behind - 1, 0)]]
    behind_s = t_s[moving[np.minimum(behind, len(moving) - 1)]]
    return idle & (behind_s - before_s < CHECKS.back_s)
