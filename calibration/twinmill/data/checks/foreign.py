# SPDX-License-Identifier: Apache-2.0
"""Whiles in which the motion has nothing to do with the commands, beside a log that follows them.

Commands that were mixed up, or of another run, are no physics: the robot goes, but neither as it is
told nor by any share of that. A robot that slips, is held or is weak still goes by some share.
"""

from dataclasses import dataclass

import numpy as np

from twinmill.data.checks.alternatives import Explained, Search
from twinmill.data.checks.settings import CHECKS
from twinmill.data.track import Track

ROUNDS = 3  # in which gains are fitted to what was not far off in the round before
FEEL_S = 0.5  # after a command that is followed again, in which the motion still shows the last


@dataclass(frozen=True)
class Compared:
    """Measured velocities beside those that the commands tell, (K, 3), turns as ways at a lever."""

    t_s: np.ndarray
    moved: np.ndarray
    told: np.ndarray

    @classmethod
    def of(cls, search: Search, own: Explained) -> "Compared":
        """With the gains of the half of the log that follows its commands best."""
        moved, shapes = search.beside(own)
        near = np.ones(len(moved), bool)
        for _ in range(ROUNDS):
            power = np.sum(shapes[near] ** 2, axis=0)
            along = np.sum(shapes[near] * moved[near, None], axis=0)
            gains = np.maximum(along, 0) / np.maximum(power, 1e-12)  # (SHAPES, 3)
            best = np.argmax(gains * along, axis=0)
            channels = np.arange(3)
            told = gains[best, channels] * shapes[:, best, channels]
            left = np.sum((moved - told) ** 2, axis=1)
            near = left <= np.median(left)
        return cls(search.motion.t_s, moved, told)

    def left(self, part: slice | np.ndarray) -> float:
        """Share of the squared motion of a part that no gain of its commands explains."""
        moved, told = self.moved[part], self.told[part]
        along, power = np.sum(moved * told, axis=0), np.sum(told**2, axis=0)
        total = max(float(np.sum(moved**2)), 1e-12)
        return 1 - float(np.sum(along**2 / np.maximum(power, 1e-12))) / total

    def worst(self, free: np.ndarray) -> slice:
        """The stretch of those that are `free` (K,) in which most is lost by the commands."""
        lost = np.sum((self.moved - self.told) ** 2, axis=1)
        lost -= CHECKS.foreign_loses * np.sum(self.moved**2, axis=1)
        return _largest_rise(np.where(free, lost, -1e9 * (1 + np.abs(lost).max())))


def _largest_rise(values: np.ndarray) -> slice:
    """The run of neighbours with the largest sum (Bentley 1984)."""
    best, best_sum, begin, so_far = slice(0, 0), 0.0, 0, 0.0
    for k, value in enumerate(values.tolist()):
        if so_far <= 0:
            begin, so_far = k, 0.0
        so_far += value
        if so_far > best_sum:
            best, best_sum = slice(begin, k + 1), so_far
    return best


def foreign_stretches(track: Track, search: Search, own: Explained) -> list[tuple[float, float]]:
    """Stretches in which the robot moves by other commands than those that the log has.

    So does one that is carried, or that somebody else commands. A stretch is reported where the
    robot moves much, for long and over many changes of the command, and no scale factor of the
    commands explains that; and only if it follows the commands in most of the log.

    Args:
        track: of the log.
        search: measured motion against the commands, by lateness.
        own: how the commands are read, with the gain and the lateness at which they then explain
            the motion best.

    Returns:
        Begin and end of each, s on the capture's clock, in their order: from the last change of the
        command before it to the first after it.
    """
    compared, changes_s = Compared.of(search, own), _changes_s(track) + own.late_s  # as felt
    t_s, free, found = compared.t_s, np.ones(len(compared.t_s), bool), []
    for _ in range(CHECKS.foreign_most):
        part = compared.worst(free)
        if part.stop <= part.start:
            break
        free[part] = False
        begin_s, end_s = t_s[part.start], t_s[part.stop - 1]
        within = int(np.count_nonzero((changes_s > begin_s) & (changes_s < end_s)))
        if _is_foreign(compared, part, within):
            found.append(_between_commands(changes_s, begin_s, end_s))
    follows = np.ones(len(t_s), bool)
    for begin_s, end_s in found:
        follows &= (t_s < begin_s) | (t_s > end_s)
    most = follows.mean() > 0.5
    return sorted(found) if found and most and compared.left(follows) < CHECKS.poor else []


def _is_foreign(compared: Compared, part: slice, changes: int) -> bool:
    """True if the robot moves, for long and by many commands, and by no share of them."""
    moved, told = (np.sum(a[part] ** 2) for a in (compared.moved, compared.told))
    return (
        compared.t_s[part.stop - 1] - compared.t_s[part.start] >= CHECKS.foreign_s
        and changes >= CHECKS.foreign_commands
        and moved > CHECKS.foreign_moves * told
        and compared.left(part) > CHECKS.foreign
    )


def _changes_s(track: Track) -> np.ndarray:
    """Robot's clock, when a command is not the one before."""
    return track.command_t_s[1:][(np.diff(track.command, axis=0) != 0).any(axis=1)]


def _between_commands(changes_s: np.ndarray, begin_s: float, end_s: float) -> tuple[float, float]:
    """From the change of the command at or before a stretch to the one at or after it."""
    before, after = changes_s[changes_s <= begin_s], changes_s[changes_s >= end_s]
    first_s = before[-1] if len(before) else begin_s
    last_s = after[0] if len(after) else end_s
    return float(first_s), float(last_s + FEEL_S)
