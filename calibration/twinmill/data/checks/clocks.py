# SPDX-License-Identifier: Apache-2.0
"""Poses that come later or sooner against the commands within a log, as two clocks may make it too.

A clock that is set, clocks that run apart and commands that act later from a moment on shift the
same thing. A step and a straight line are told apart by how well each explains the motion, and
whose step it is by the beat of the stamps: a clock that is set leaves a gap or an overlap in it.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twinmill.arguments import option
from twinmill.data.checks.alternatives import Explained, Jump, Search, far_better, surely_better
from twinmill.data.checks.causality import precedence
from twinmill.data.checks.finding import CheckedTrack, InputFinding
from twinmill.data.checks.lateness import Lateness, lateness_of
from twinmill.data.checks.motion import BLOCK_S
from twinmill.data.checks.settings import CHECKS
from twinmill.data.clock import place_of_least
from twinmill.data.lost_commands import beat_s, keeps_beat

FAR_S = np.arange(-12.0, 12.0 + 1e-9, 0.06)
ABOUT_S = np.arange(-0.6, 0.6 + 1e-9, 0.02)  # about a shift that is far off
ANY_LAG_S = np.geomspace(0.004, 0.5, 13)
FINE_S = np.arange(-0.06, 0.06 + 1e-9, 0.01)  # about a shift of the coarse search
RATES_PPM = (-3000, -2000, -1000, -500, 0, 500, 1000, 2000, 3000)
OWN_CLOCKS = "stamp both with one clock or keep them in step (chrony, NTP)"
LOOK = "look at what sent the commands, its buffers and its link"


def stepped(
    checked: CheckedTrack, search: Search, own: Explained, best: Explained
) -> InputFinding | None:
    """A step of the poses against the commands, where it explains more than any other mistake."""
    late = search.once(lateness_of)
    if late and _is_no_clock(checked, late) and _left_moved(search, late) < best.left:
        return _of_lateness(checked, search, own, late)
    far = search.of(lates_s=FAR_S)
    jump = far.jump(own, CHECKS.fewest_blocks // 2)
    better = far_better(jump.explained, own) and jump.explained.left < best.left
    if abs(jump.by_s) < CHECKS.least_jump_s or not better:
        return None
    step = _refined(search, own, jump)
    rate, std = _rate(search, own)
    if _gained(_drifted(search, own, rate), step.explained) < -CHECKS.step_sure:
        return _with(late, _of_drift(checked, _in_words(search, rate, std), rate))
    return _with(late, _of_step(checked, own, step))


def shift_s(search: Search, coarse_s: float) -> float:
    """By how much the poses come late against the commands, to milliseconds.

    What a lag makes late is no shift: of lags that which explains most is taken, and between those
    that are tried their shifts are taken as they change.

    Args:
        search: of the motion, the columns as they are right.
        coarse_s: the shift, to some tenths of a second.
    """
    near_s, logs = coarse_s + ABOUT_S, np.log(ANY_LAG_S)
    shifts_s, left = np.array([s.best_shift(lag_s) for lag_s, s in _by_lag(search, near_s)]).T
    found_s = float(np.interp(place_of_least(logs, left), logs, shifts_s))
    return found_s - search.motion.ahead_s


def _by_lag(search: Search, lates_s: np.ndarray) -> Iterator[tuple[float, Search]]:
    """Searches of one lag each, at other shifts."""
    for lag_s in ANY_LAG_S:
        yield lag_s, search.of(lates_s=lates_s, lags_s=(lag_s,))


def _is_shifted(search: Search, late_s: float) -> bool:
    """True if a lag alone, of any length, surely explains less than one with about that shift.

    In a smooth drive a longer lag and poses that come sooner look alike.
    """
    at_s = np.array([0.0, late_s]) + search.motion.ahead_s
    alone, shifted = (
        min((s.own() for _, s in _by_lag(search, at_s[[k]])), key=lambda e: e.left) for k in (0, 1)
    )
    return surely_better(shifted, alone)


def _refined(search: Search, own: Explained, jump: Jump) -> Jump:
    """Jump sought again on a finer grid of shifts."""
    fine = search.of(lates_s=_about(jump))
    return fine.jump(own, CHECKS.fewest_blocks // 2)


def _about(jump: Jump) -> np.ndarray:
    """Shifts about both of a step, s."""
    return np.unique(np.round([jump.before_s + FINE_S, jump.after_s + FINE_S], 3))


def _of_step(checked: CheckedTrack, own: Explained, jump: Jump) -> InputFinding:
    """Whose step it is, by the beats of both series; a shorter one a diagnosis tells."""
    explained = (
        f"the commands explain {1 - own.left:.1%} of the motion as it is stamped, and "
        f"{1 - jump.explained.left:.1%} if poses from about {jump.t_s:.0f} s on come "
        f"{abs(jump.by_s):.2f} s {_sooner_or_later(jump)} than those before"
    )
    apart = "import what lies before and after that time as logs of their own"
    if _beat_breaks(checked, jump):
        return checked.finding("a clock was set within the log", explained, apart)
    far = abs(jump.by_s) > CHECKS.acting_later_s
    return checked.finding(
        f"the robot follows its commands {_sooner_or_later(jump)} from about {jump.t_s:.0f} s on",
        f"{explained}, and the beat of the poses has no gap or overlap there, so that their clock "
        "was not set",
        f"{LOOK}, or whether the clock that stamps them was set" + (f"; {apart}" if far else ""),
        fatal=far,
        steady=False,
    )


def _beat_breaks(checked: CheckedTrack, jump: Jump) -> bool:
    """True if stamps of poses or commands skip about the time of a step, or overlap."""
    track = checked.track
    if _skips(track.pose_t_s, jump.t_s, jump.by_s):
        return True
    return keeps_beat(track.command_t_s) and _skips(track.command_t_s, jump.t_s, -jump.by_s)


def _skips(t_s: np.ndarray, at_s: float, by_s: float) -> bool:
    """True if about a time as many stamps are missing, or too many, as come in a step of the clock.

    A step back that is sorted by stamps has both clocks' rows one beside the other.
    """
    first, last = np.searchsorted(t_s, (at_s - BLOCK_S - abs(by_s), at_s + BLOCK_S + abs(by_s)))
    within = t_s[first:last]
    if len(within) < 2:
        return True
    missing_s = np.ptp(within) - (len(within) - 1) * beat_s(t_s)
    return bool(missing_s * np.sign(by_s) > CHECKS.skips * abs(by_s))


def check_lateness(checked: CheckedTrack, search: Search, own: Explained) -> list[InputFinding]:
    """Commands that act later or sooner at some times than at others, or clocks that run apart."""
    if own.left > CHECKS.drift_left:
        return []
    late = search.once(lateness_of)
    if late and _is_no_clock(checked, late):
        return [_of_lateness(checked, search, own, late)]
    if checked.track.same_clock or np.ptp(search.motion.t_s) < CHECKS.drift_span_s:
        return []
    found = _of_two_clocks(checked, search, own)
    if not found and late and late.shape != "drift":
        return [_of_lateness(checked, search, own, late)]
    return [_with(late, f) for f in found]


def check_one_clock(
    checked: CheckedTrack, search: Search, own: Explained, *, delays: bool
) -> list[InputFinding]:
    """Poses that come before the commands that made them, though one clock is said to stamp both.

    Args:
        checked: one robot's track.
        search: of its motion, the columns as they are right.
        own: how well they explain it.
        delays: whether it is also told that they come later than any lag makes them.
    """
    track = checked.track
    if not (track.same_clock and track.has_heading) or own.left > CHECKS.drift_left:
        return []
    late_s = shift_s(search, own.late_s)
    spare_s = CHECKS.one_clock_s + track.timing.pose_period_s / 2
    if abs(late_s) < spare_s:
        return []
    without = f"import anew without {option('same_clock', True)}"
    if late_s < 0:
        t = precedence(track, checked.body, -late_s, spare_s)
        return [_of_precedence(checked, late_s, t, without)] if t > CHECKS.sure else []
    if not delays or not _is_shifted(search, late_s):
        return []
    return [
        checked.finding(
            f"the robot follows its commands {late_s:.2f} s after their stamps, beside its lag",
            f"the commands explain {1 - own.left:.1%} of the motion with that shift",
            "that is a delay of the robot (input_delay, or what diagnose names), if one clock "
            f"stamped both as it is declared; else {without}",
            fatal=False,
        )
    ]


def _of_precedence(checked: CheckedTrack, late_s: float, t: float, without: str) -> InputFinding:
    """Told, and no more: the user's word that there is one clock holds."""
    shift_by_s = round(float(-late_s), 3)
    told = checked.finding(
        f"the poses come about {-late_s:.2f} s before the commands that they follow, which one "
        f"clock does not do, as it is declared ({option('same_clock', True)})",
        f"the motion before a change of the command is that of the command after it (t = {t:.0f})",
        lambda own: (
            f"if that declaration is wrong, {without}, which estimates the offset, or with "
            f"{option('pose_shift_s', shift_by_s, own)}; until then it is kept"
        ),
        fatal=False,
    )
    return replace(told, two_clocks=True)


def _is_no_clock(checked: CheckedTrack, late: Lateness) -> bool:
    """True if a clock cannot cause it: one clock stamped all, or it is neither step nor drift."""
    return checked.track.same_clock or late.shape in ("while", "steps")


def _with(late: Lateness | None, finding: InputFinding) -> InputFinding:
    """A finding on commands that act later, with how that changes."""
    return finding if finding.steady or finding.fatal else replace(finding, lateness=late)


def _of_lateness(
    checked: CheckedTrack, search: Search, own: Explained, late: Lateness
) -> InputFinding:
    left = _left_moved(search, late)
    told = checked.finding(
        late.what,
        f"the commands explain {1 - own.left:.1%} of the motion as it is stamped, and "
        f"{1 - left:.1%} if they are moved by that",
        LOOK,
        fatal=False,
        steady=False,
    )
    return replace(told, lateness=late)


def _left_moved(search: Search, late: Lateness) -> float:
    """Share of the motion that commands leave that are moved by their lateness."""
    motion = search.motion
    moved = replace(motion, t_s=motion.t_s - late.at(motion.t_s))
    return search.of(moved).own().left


def _of_two_clocks(checked: CheckedTrack, search: Search, own: Explained) -> list[InputFinding]:
    """Clocks that run apart, by the rate at which the commands explain the motion best; or a step.

    A step is told as one where it explains more, and neither is where both explain as much. Of
    encoder logs, whose rows are often counted, `time_base.py` judges the rate.
    """
    rate, std = _rate(search, own)
    jump = _refined(search, own, search.jump(own, CHECKS.fewest_blocks // 2))
    drifts = abs(rate) > max(1e-6 * CHECKS.least_ppm, CHECKS.drift_sure * std)
    drifts &= checked.track.command_kind != "wheel_speed"
    if not drifts and not _is_step(search, own, jump):
        return []
    steps = _gained(_drifted(search, own, rate), jump.explained)
    if steps > CHECKS.step_sure or not np.isfinite(rate):
        return [_of_step(checked, own, jump)]
    drift = _in_words(search, rate, std)
    if steps < -CHECKS.step_sure:
        return [_of_drift(checked, drift, rate)]
    return [
        checked.finding(
            "the two clocks run apart, or the robot follows its commands "
            f"{_sooner_or_later(jump)} from about {jump.t_s:.0f} s on",
            f"{drift}, or {1e3 * abs(jump.by_s):.0f} ms in one step: both explain the motion alike",
            f"{OWN_CLOCKS} and log again, which rules the first out; or {LOOK}",
            fatal=False,
            steady=False,
        )
    ]


def _is_step(search: Search, own: Explained, jump: Jump) -> bool:
    """True if a step of surely that size leaves far less than one shift of the whole log does.

    Where a lag depends on the command a robot is late by how it is driven; a step by the mean of
    that leaves more than half.
    """
    if abs(jump.by_s) < CHECKS.least_step_s:
        return False
    steady = min(own.left, _drifted(search, own, 0.0).left)
    if jump.explained.left > CHECKS.step_leaves * steady:
        return False
    fine = search.of(lates_s=_about(jump))
    return abs(jump.by_s) > CHECKS.step_seen * fine.jump_std_s(jump)


def _of_drift(checked: CheckedTrack, drift: str, rate: float) -> InputFinding:
    """A rate that crystals have; at others several steps may be behind it, which look alike."""
    apart = "the two clocks run apart"
    ppm = round(1e6 * rate)

    def anew(own: int | None) -> str:
        return f"import anew with {option('pose_clock_ppm', ppm, own)}"

    if abs(rate) <= 1e-6 * CHECKS.most_ppm:
        return checked.finding(
            apart, drift, lambda own: f"{OWN_CLOCKS}, or {anew(own)}", fatal=False
        )
    later = "later and later" if rate > 0 else "sooner and sooner"
    return checked.finding(
        f"{apart}, or the robot follows its commands {later} by steps",
        f"{drift}, which is more than clocks do",
        lambda own: (
            f"{OWN_CLOCKS} and log again, which rules the first out; or {LOOK}; or, if "
            f"the clock that stamps the poses counts so, {anew(own)}"
        ),
        fatal=False,
        steady=False,
    )


def _in_words(search: Search, rate: float, std: float) -> str:
    over_s = abs(rate) * float(np.ptp(search.motion.t_s))
    return f"by {1e6 * rate:.0f} +- {1e6 * std:.0f} ppm, {1e3 * over_s:.0f} ms over the log"


def _sooner_or_later(jump: Jump) -> str:
    return "later" if jump.by_s > 0 else "sooner"


def _rate(search: Search, own: Explained) -> tuple[float, float]:
    """At which clocks that run apart explain the motion best, and its standard error; NaN: none."""
    rates = 1e-6 * np.array(RATES_PPM)
    by_block = np.array([search.at_rate(own, rate).by_block for rate in rates])
    left = by_block.sum(axis=1)
    k = int(np.clip(left.argmin(), 1, len(left) - 2))
    near = slice(k - 1, k + 2)
    without = _vertex(rates[near], left[near, None] - by_block[near])
    std = float(np.sqrt((len(without) - 1) * np.var(without)))  # jackknife, Efron and Stein 1981
    rate = float(_vertex(rates[near], left[near]))
    return (rate, std) if np.isfinite(std) else (np.nan, np.nan)


def _drifted(search: Search, own: Explained, rate: float) -> Explained:
    """A drift as fine as a step is, at the lag that suits it; without a rate, the best of none."""
    rate = np.nan_to_num(rate)
    found = []
    for lag_s in search.lags_s:
        shifted = replace(own, lag_s=lag_s, late_s=own.late_s + own.lag_s - lag_s)
        found.append(search.at_rate(shifted, rate, FINE_S))
    return min(found, key=lambda e: e.left)


def _gained(drift: Explained, step: Explained) -> float:
    """By how many standard errors over stretches a step explains more than a drift."""
    gained = drift.by_block - step.by_block
    return float(gained.sum() / max(gained.std() * np.sqrt(len(gained)), 1e-12))


def _vertex(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Places of the least of values (3, ...) at (3,) by parabolas through them; NaN without one."""
    first, last = (np.diff(y, axis=0).T / np.diff(x)).T
    bend = (last - first) / (x[2] - x[0])
    return (x[0] + x[1]) / 2 - first / (2 * np.where(bend > 0, bend, np.nan))
