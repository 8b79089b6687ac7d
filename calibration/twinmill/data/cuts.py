# SPDX-License-Identifier: Apache-2.0
"""Cuts a track where it breaks: at gaps, and at jumps that no wheels make."""

from dataclasses import dataclass

import numpy as np

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.log import RobotLog

GAP_S = 0.05  # four frames at 100 Hz, in which a TurboPi moves at most 20 mm
GAP_PERIODS = 4  # the same for slower cameras
LOSSY_GAP_S = 0.25  # and for captures that lose frames all the time; a pick-up takes longer
USUAL_MPS, USUAL_RADPS = 1.5, 12.0  # below which no step is a jump: four times a TurboPi's
JUMP_NOISE_M, JUMP_NOISE_RAD = 0.005, 0.05  # ten times the noise of a motion capture
JUMP_SIGMA = 8  # times the noise of a camera that is worse than that
JUMP_FACTOR = 3  # times as fast as just before or after: no wheels do that between two frames
BESIDE = 3  # steps that tell how fast the robot is just before, or just after
FAST_S = 0.5  # over which speeds are told where stamps jitter
MARGIN_S = 0.1  # frames beside a pick-up show the hand or half a marker body
SHORTEST_S = 0.1  # shortest horizon that is predicted: a segment below it is of no use


def find_segments(
    robot: RobotLog, usable: np.ndarray, usual: tuple[float, float], notes: list[str]
) -> np.ndarray:
    """Numbers the unbroken stretches of a track.

    Args:
        robot: its log.
        usable: (N,) bool: poses that are measurements of a robot on the floor.
        usual: m/s and rad/s below which no step is a jump.
        notes: sentences on each cut are added.

    Returns:
        (N,) number of the stretch; -1 where unusable.
    """
    limits = Limits.of(robot, usable, *usual)
    usable = usable & ~_excursions(robot, usable, limits, notes)
    turned = _turned_by_tracker(robot, usable, limits, notes)
    index, begins = _cuts(robot, usable, limits, notes, turned=turned)
    return _segments(robot, index, begins, notes)


def longest_gap_s(robot: RobotLog, used: np.ndarray | None = None) -> float:
    """Longest time between poses over which the track goes on.

    A capture that loses frames all the time may lose several in a row, and so do poses that are
    left out one at a time all the time.

    Args:
        robot: its log.
        used: (N,) bool; None: all that are valid.
    """
    spacing_s = np.diff(robot.pose_t_s[robot.valid if used is None else used])
    usual_s = max(GAP_S, GAP_PERIODS * float(np.median(np.diff(robot.pose_t_s))))
    lossy_s = 2 * float(np.quantile(spacing_s, 0.99)) if len(spacing_s) else 0.0
    return max(usual_s, min(LOSSY_GAP_S, lossy_s))


@dataclass(frozen=True)
class Limits:
    """Largest steps of one robot's poses that noise alone, or speeds it may have, can make.

    Attributes:
        usual: m/s, rad/s.
        fastest: m/s, rad/s that it has nowhere in its log.
        noise: m, rad.
        own_radps: faster than it turns by far, however slow it is.
        period_s: time from pose to pose.
    """

    usual: tuple[float, float]
    fastest: tuple[float, float]
    noise: tuple[float, float]
    own_radps: float
    period_s: float

    @classmethod
    def of(cls, robot: RobotLog, usable: np.ndarray, *usual: float) -> "Limits":
        """With the noise that second differences of the poses show: motion is smooth beside it.

        Stamps that jitter are noise as well: the way in the time that they are off. Quarter turns
        of the heading are none, be they many: a square tag whose front flickers makes them.
        """
        pose = robot.pose[usable]
        pose[:, 2] = np.unwrap(pose[:, 2], period=np.pi / 2)
        fast = _fast(robot.pose_t_s[usable], pose)
        late = JUMP_SIGMA * _jitter_s(robot.pose_t_s[usable]) * fast
        bend = np.abs(np.diff(np.nan_to_num(pose), n=2, axis=0))
        sigma = np.median(bend, axis=0) / 0.6745 / np.sqrt(6) if len(bend) else np.zeros(3)
        mps, radps = np.maximum(usual, JUMP_FACTOR * fast)
        return cls(
            usual,
            (float(mps), float(radps)),
            (
                max(JUMP_NOISE_M, JUMP_SIGMA * float(sigma[:2].max()), float(late[0])),
                max(JUMP_NOISE_RAD, JUMP_SIGMA * float(sigma[2]), float(late[1])),
            ),
            JUMP_FACTOR * float(fast[1]),
            float(np.median(np.diff(robot.pose_t_s))),
        )

    def far(
        self, dt_s: np.ndarray, step: np.ndarray, left_out_s: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(K,) bool: a robot does not go so far, or turn so, in such times; step (K, 3).

        Poses that are left out may be part of the times: their tracker had not lost the robot.
        """
        moved_m, turn_rad = np.hypot(*step[:, :2].T), np.abs(np.nan_to_num(_short_way(step[:, 2])))
        most_rad = self._most_rad(np.float64(self.fastest[1]), dt_s, left_out_s)
        return (moved_m > self.fastest[0] * dt_s + self.noise[0]) | (turn_rad > most_rad)

    def possible(self, speed: np.ndarray, dt_s: np.ndarray) -> np.ndarray:
        """(K,) m, longest step by the speeds before and after it."""
        return np.maximum(self.usual[0], JUMP_FACTOR * _beside(speed)) * dt_s + self.noise[0]

    def possible_rad(
        self, speed: np.ndarray, dt_s: np.ndarray, left_out_s: np.ndarray
    ) -> np.ndarray:
        """(K,) rad, widest turn likewise, at most pi."""
        fastest = np.maximum(self.usual[1], JUMP_FACTOR * _beside(speed))
        return np.minimum(self._most_rad(fastest, dt_s, left_out_s), np.pi)

    def _most_rad(
        self, fastest_radps: np.ndarray, dt_s: np.ndarray, left_out_s: np.ndarray | float
    ) -> np.ndarray:
        """(K,) rad: as fast as that, and over poses that are left out as this robot turns.

        A usual rate is none that a robot keeps: over some poses it would be a turn to anywhere.
        """
        own_radps = np.minimum(self.own_radps, fastest_radps)
        return fastest_radps * (dt_s - left_out_s) + own_radps * left_out_s + self.noise[1]


def _jitter_s(t_s: np.ndarray) -> float:
    """Standard deviation of stamps about an even beat; 0 where most are even."""
    steps_s = np.diff(t_s)
    off_s = np.abs(steps_s - np.median(steps_s)) if len(steps_s) else np.zeros(1)
    return float(np.median(off_s)) / 0.6745 / np.sqrt(2)


def _fast(t_s: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """m/s and rad/s that a robot seldom exceeds, over FAST_S: jitter hardly shows in these.

    Of turns the middle one of each while: headings that flicker, by whatever angle, are none.
    """
    after = np.searchsorted(t_s, t_s + FAST_S)
    first = np.flatnonzero(after < len(t_s))
    if not len(first):
        return np.zeros(2)
    rate = np.nan_to_num(pose[after[first], :2] - pose[first, :2]) / FAST_S
    turns = np.nan_to_num(np.diff(pose[:, 2]) / np.diff(t_s))
    count = int(np.median(after[first] - first))
    whiles = turns[: len(turns) // count * count].reshape(-1, count)
    turn = np.abs(np.median(whiles, axis=1))
    return np.array([np.quantile(np.hypot(*rate.T), 0.95), np.quantile(turn, 0.95)])


def _beside(speed: np.ndarray) -> np.ndarray:
    """(K,) median of the BESIDE steps before each, or of those after it if that is more."""
    a, b, c = np.lib.stride_tricks.sliding_window_view(np.pad(speed, BESIDE), BESIDE).T
    medians = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
    return np.maximum(medians[: len(speed)], medians[BESIDE + 1 :])


def _jumps(robot: RobotLog, index: np.ndarray, limits: Limits) -> tuple[np.ndarray, np.ndarray]:
    """(len(index) - 1,) bool each: steps and turns between these poses that no robot makes."""
    dt_s = np.diff(robot.pose_t_s[index])
    step = np.diff(robot.pose[index, :2], axis=0)
    moved_m, turn_rad = np.hypot(*step.T), np.abs(_turns_rad(robot, index))
    left_out_s = np.where(_lost(robot, index), 0, np.maximum(dt_s - limits.period_s, 0))
    most_rad = limits.possible_rad(turn_rad / dt_s, dt_s, left_out_s)
    return moved_m > limits.possible(moved_m / dt_s, dt_s), turn_rad > most_rad


def _lost(robot: RobotLog, index: np.ndarray) -> np.ndarray:
    """(len(index) - 1,) bool: between these poses there are none, or none that are valid."""
    seen = np.diff(np.cumsum(robot.valid)[index]) == np.diff(index)
    return ~seen | (np.diff(index) == 1)


def _turns_rad(robot: RobotLog, index: np.ndarray) -> np.ndarray:
    """(len(index) - 1,) turns between these poses, the short way round; 0 without headings."""
    return np.nan_to_num(_short_way(np.diff(robot.pose[index, 2])))


def _short_way(angle_rad: np.ndarray) -> np.ndarray:
    return np.remainder(angle_rad + np.pi, 2 * np.pi) - np.pi


def _excursions(
    robot: RobotLog, usable: np.ndarray, limits: Limits, notes: list[str]
) -> np.ndarray:
    """(N,) bool: poses off the way that those around them go, as when markers are mixed up.

    Where so many are that the track goes on over longer gaps, it is looked for over these, too.
    """
    index, outlier = np.flatnonzero(usable), np.zeros(len(usable), bool)
    gap_s, left_s = 0.0, longest_gap_s(robot)
    while left_s > gap_s:
        gap_s = left_s
        outlier[:] = False
        outlier[np.setdiff1d(index, index[_longest_way(_links(robot, index, limits, gap_s))])] = (
            True
        )
        left_s = longest_gap_s(robot, usable & ~outlier)
    if outlier.any():
        notes.append(
            f"{counted(np.count_nonzero(outlier), 'pose')} from {robot.pose_t_s[outlier][0]:.3f} s "
            "on, away and back in a jump; left out."
        )
    return outlier


def _links(robot: RobotLog, index: np.ndarray, limits: Limits, gap_s: float) -> list[np.ndarray]:
    """Possible ways from each pose to later ones within a gap: for each reach (K - reach,) bool.

    Poses are left out between a jump away and one back alone: a step that lasts is none of these.
    Over a gap in time a robot may go anywhere.
    """
    t_s, pose, links = robot.pose_t_s[index], robot.pose[index], []
    for reach in range(1, len(index)):
        dt_s = t_s[reach:] - t_s[:-reach]
        left_out_s = np.maximum(dt_s - limits.period_s, 0) if links else 0.0
        far = limits.far(dt_s, pose[reach:] - pose[:-reach], left_out_s)
        within = dt_s <= gap_s
        if links:
            jumps = ~links[0]
            links.append(within & ~far & jumps[: 1 - reach] & jumps[reach - 1 :])
        else:
            links.append(~(within & far))
        if links[0].all() or not within.any():
            break
    return links


def _longest_way(links: list[np.ndarray]) -> np.ndarray:
    """Poses, by their number, of the way through most of them (Bellman 1957).

    A step that no robot makes costs as much as all poses within a gap, so that as many are left
    out to spare two of them.

    Args:
        links: as of `_links`.
    """
    count, cut = len(links[0]) + 1 if links else 0, len(links)
    if not links or links[0].all():
        return np.arange(count)
    cost, before, near = list(range(count)), [-1] * count, [link.tolist() for link in links]
    for k in range(1, count):
        for reach in range(1, min(k, cut) + 1):
            j = k - reach
            linked = near[reach - 1][j]
            if not linked and reach > 1:
                continue
            new = cost[j] + reach - 1 + (0 if linked else cut)
            if new < cost[k] or (before[k] < 0 and new <= cost[k]):
                cost[k], before[k] = new, j
    k = min(range(max(0, count - cut), count), key=lambda k: cost[k] + count - 1 - k)
    way = []
    while k >= 0:
        way.append(k)
        k = before[k]
    return np.array(way[::-1])


def _turned_by_tracker(
    robot: RobotLog, usable: np.ndarray, limits: Limits, notes: list[str]
) -> np.ndarray:
    """(N,) bool: poses between a turn that no robot makes and the next one, which undoes it.

    A tracker that takes other markers for those of the front has the robot turned for a while, so
    that it seems to drive backwards. What lasts for most of the track may be the right heading.
    """
    turned = np.zeros(len(usable), bool)
    index = np.flatnonzero(usable)
    turns_rad, t = _turns_rad(robot, index), robot.pose_t_s[index]
    meanwhile_s = np.where(_lost(robot, index), limits.period_s, np.diff(t))
    own_rad = limits.own_radps * meanwhile_s + limits.noise[1]
    jumps = np.flatnonzero(_jumps(robot, index, limits)[1]).tolist()
    for first, last, k, how in _whiles_turned(t, turns_rad, own_rad, jumps):
        turned[index[first + 1 : last + 1]] = True
        notes.append(
            f"from {t[first + 1]:.3f} to {t[last]:.3f} s the tracker has the robot turned by "
            f"{np.degrees(abs(turns_rad[k])):.0f} degrees, from one pose to the next {how}; "
            "left out."
        )
    return turned


def _whiles_turned(
    t_s: np.ndarray, turns_rad: np.ndarray, own_rad: np.ndarray, jumps: list[int]
) -> list[tuple[int, int, int, str]]:
    """Whiles from a turn to the one that undoes it, and those at the ends of the same turn.

    Args:
        t_s: (K,) of the poses.
        turns_rad: (K - 1,) from each pose to the next.
        own_rad: (K - 1,) of them, that the robot may make by itself.
        jumps: steps that no robot makes.

    Returns:
        Step before the first pose and behind the last, a step of the turn, and words on its end.
    """

    def apart(a_rad: float, b_rad: float, steps: list[int]) -> bool:
        return abs(_short_way(a_rad - b_rad)) > own_rad[steps].sum()

    def lasts(first: int, last: int) -> bool:
        return t_s[last] - t_s[first + 1] > np.ptp(t_s) / 2

    found, k = [], 0
    while k + 1 < len(jumps):
        first, last = pair = jumps[k : k + 2]
        undone = not (lasts(*pair) or apart(turns_rad[first], -turns_rad[last], pair))
        if undone:
            found.append((first, last, first, "and back"))
        k += 2 if undone else 1
    sizes, paired = np.abs(turns_rad), {step for row in found for step in row[:2]}
    ends = [(-1, j, j, "as later") for j in jumps[:1]]
    ends += [(j, len(turns_rad), j, "as before") for j in jumps[-1:]]
    return found + [
        (*end, j, how)
        for *end, j, how in ends
        if not (j in paired or lasts(*end))
        and any(not apart(sizes[j], sizes[i], [i, j]) for _, _, i, _ in found)
    ]


def _cuts(
    robot: RobotLog, usable: np.ndarray, limits: Limits, notes: list[str], *, turned: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Usable poses without the margins, and which of them begin a segment: (K,) int, (K,) bool.

    Of poses that the tracker turned, (N,) bool, all was said.
    """
    used = usable & ~turned
    index = np.flatnonzero(used)
    t = robot.pose_t_s[index]
    moves, turns = _jumps(robot, index, limits)
    jump = moves | turns
    gap = np.diff(t) > longest_gap_s(robot, used)
    lost = gap & (np.diff(index) > 1)
    keep = np.ones(len(index), bool)
    for k in np.flatnonzero(jump | gap):
        if not turned[index[k] + 1]:
            notes.append(_of_cut(robot, index[k : k + 2], gap=gap[k], lost=lost[k], moves=moves[k]))
        if jump[k] or lost[k]:
            keep &= (t < t[k] - MARGIN_S) | (t > t[k + 1] + MARGIN_S)
    begins = np.concatenate([[0], np.cumsum(jump | gap)])[: len(index)]
    index, begins = index[keep], begins[keep]
    return index, np.diff(begins, prepend=-1) > 0


def _of_cut(robot: RobotLog, ends: np.ndarray, *, gap: bool, lost: bool, moves: bool) -> str:
    """A sentence on a cut between two poses; where the robot does not move it only turns."""
    begin_s, end_s = robot.pose_t_s[ends]
    if not (gap or moves):
        turn_deg = np.degrees(_turns_rad(robot, ends)[0])
        return (
            f"cut at {begin_s:.3f} s: the heading steps by {turn_deg:.0f} degrees from one pose to "
            "the next, and the place does not: the tracker's body was turned or made anew, so "
            "import what lies before and after as logs of their own, each with its "
            f"{option('heading_offset_deg')}."
        )
    moved_m = np.hypot(*(robot.pose[ends[1], :2] - robot.pose[ends[0], :2]))
    what = "not tracked" if lost else "no poses" if gap else "the robot jumps"
    return f"cut at {begin_s:.3f} s: {what} for {end_s - begin_s:.3f} s, then {moved_m:.3f} m away."


def without(segment: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """(N,) numbers of the stretches that are left of those of a track, without poses that are cut.

    Args:
        segment: (N,) as in Track.
        cut: (N,) bool.
    """
    kept = np.where(cut, -1, segment)
    begins = (kept >= 0) & (np.diff(kept, prepend=-1) != 0)
    return np.where(kept >= 0, np.cumsum(begins) - 1, -1)


def _segments(
    robot: RobotLog, index: np.ndarray, begins: np.ndarray, notes: list[str]
) -> np.ndarray:
    """(N,) numbers of segments, short ones dropped."""
    segment, number = np.full(len(robot.pose_t_s), -1), 0
    for part in np.split(index, np.flatnonzero(begins)):
        if len(part) < 2 or np.ptp(robot.pose_t_s[part]) < SHORTEST_S:
            continue
        segment[part] = number
        number += 1
    if not number:
        notes.append("no stretch of the track is long enough to predict anything.")
    return segment
