# SPDX-License-Identifier: Apache-2.0
"""Checks of the poses alone: axes, units, headings that are none, how much there is."""

import numpy as np

from twinmill.arguments import option
from twinmill.data.checks.finding import InputFinding, Remedy, in_words
from twinmill.data.checks.settings import CHECKS
from twinmill.data.log import RobotLog
from twinmill.data.track import Track, command_at

# Commands from here on move any robot on a floor, and for how long they must: in all, and of it.
STRONG = {"duty": (0.3,) * 4, "wheel_speed": (2.0,) * 4, "twist": (0.05, 0.05, 0.3, np.inf)}
# Commands beyond these no robot on wheels follows: twenty times the fastest there are.
ABSURD = {"duty": (20.0,) * 4, "wheel_speed": (1e4,) * 4, "twist": (500.0, 500.0, 1e3, np.inf)}
LEAST_TOLD = 1e-5  # in any unit of commands: a hundredth of a mm/s, and no unit is so small
MOVED_M = 0.05  # more than a robot that stands seems to go
NAMES = {"twist": ("vx_mps", "vy_mps", "omega_radps")}  # of the others: wheels by their number
UNDER_ONE = "give each robot its own robot_id, in its poses and in its commands"
MOST_UNDER_ONE = 4  # robots under one number: after so many poses the first one is back
ARM_M = 0.1  # of headings, which part robots that meet
# Nothing moves within this much, nor within five times the noise where that is as little as this.
STANDS, STANDS_NOISY = np.array([0.005, 0.005, 0.035]), np.array([0.05, 0.05, 0.2])


def check_commanded(robot: RobotLog, label: str) -> list[InputFinding]:
    """A finding of a robot's commands as they were recorded."""
    return _absurd(robot, label) or _nothing_told(robot, label) or _under_one_number(robot, label)


def check_changes(robot: RobotLog, label: str) -> list[InputFinding]:
    """A finding where a robot is told one thing from its first pose to its last."""
    first_s, last_s = robot.pose_t_s[[0, -1]]
    told = robot.command[max(0, np.searchsorted(robot.command_t_s, first_s, "right") - 1) :]
    told = told[: max(1, len(told) - np.count_nonzero(robot.command_t_s > last_s))]
    if np.any(np.diff(told, axis=0)):
        return []
    return [
        InputFinding(
            "its command never changes",
            f"one is held for all {last_s - first_s:.0f} s of its poses",
            "check that all its commands are there, or drive it with several: how a robot follows "
            "them shows where they change, and hardly anything else of this one can be learned",
            False,
            label,
            robot.robot_id,
        )
    ]


def _under_one_number(robot: RobotLog, label: str) -> list[InputFinding]:
    """A finding where commands go to and fro faster than any robot follows.

    Detections that flicker switch between two commands as fast, but not with most commands.
    """
    command, t_s = robot.command, robot.command_t_s
    if len(t_s) < CHECKS.fewest_poses:
        return []
    leap, back = _to_and_fro(command)
    fast = t_s[2:] - t_s[:-2] < CHECKS.back_s
    share = float(np.mean(((leap > 0) & (back < leap / 5))[:-1] & fast))
    if share < CHECKS.back:
        return []
    return [
        InputFinding(
            "these commands are those of two robots or more under one number",
            f"{share:.0%} of them leap away, and the next ones are back",
            UNDER_ONE,
            True,
            label,
            robot.robot_id,
        )
    ]


def _absurd(robot: RobotLog, label: str) -> list[InputFinding]:
    """A finding where a command is beyond what any robot follows, and far beyond most others.

    Units that are wrong make most of those large that are not zero, and are told by the motion.
    """
    if robot.command_kind not in ABSURD or not len(robot.command_t_s):
        return []
    size = np.abs(robot.command)
    over = ~(size <= ABSURD[robot.command_kind])
    others = np.where(over, 0.0, size).max(axis=0)
    few = over.sum(axis=0) < np.count_nonzero(size, axis=0) / 2
    rows, columns = np.nonzero(over & few & ~(size <= CHECKS.absurd * others))
    if not len(rows):
        return []
    row, column = int(rows[0]), int(columns[0])
    names = NAMES.get(robot.command_kind, tuple(f"wheel {k}" for k in range(1, 5)))
    return [
        InputFinding(
            "a command is none that a robot could follow",
            f"{names[column]} is {robot.command[row, column]:.3g} at "
            f"{robot.command_t_s[row]:.3f} s, row {row + 1} of its commands, and "
            f"{others[column]:.3g} at most in the rows that make sense",
            "correct or delete such rows, and import anew",
            True,
            label,
            robot.robot_id,
        )
    ]


def _nothing_told(robot: RobotLog, label: str) -> list[InputFinding]:
    """A finding where a robot moves by next to nothing, as of a driver that mistook its clock."""
    most, seen = float(np.abs(robot.command).max(initial=0.0)), robot.pose[robot.valid, :2]
    moves = len(seen) > 0 and np.ptp(seen, axis=0).max() > MOVED_M
    if not (moves and 0 < most < LEAST_TOLD):
        return []
    return [
        InputFinding(
            "its commands are next to nothing",
            f"no number in them is above {most:.1g}",
            "look at the program that wrote them (speeds so small come from a time step in a wrong "
            "unit), or import anew with what it was really told",
            True,
            label,
            robot.robot_id,
        )
    ]


def check_poses(robot: RobotLog, label: str, own: int | None = None) -> list[InputFinding]:
    """Findings of a robot's poses as they were recorded.

    Args:
        robot: as it was read.
        label: name of its log.
        own: robot_id that options are to name; None where the log has no other robot.
    """
    t_s, pose, z_m = (a[robot.valid] for a in (robot.pose_t_s, robot.pose, robot.z_m))
    if len(t_s) < CHECKS.fewest_poses:
        return []

    def finding(what: str, evidence: str, remedy: Remedy) -> InputFinding:
        mend, of_all = in_words(remedy, own)
        whose = label, robot.robot_id
        return InputFinding(what, evidence, mend, True, *whose, remedy_of_all=of_all)

    if stands := _stands(robot, t_s, pose):
        return [
            finding(
                "the poses do not move although the robot is driven",
                stands,
                "check that the tracked body is this robot, and that its motors are on",
            )
        ]
    if apart_m := _goes_to_and_fro(pose[:, :2]):
        if back := _step_back(pose):
            first_s, last_s = t_s[list(back)]
            return [
                finding(
                    f"the stamps of the poses step back by {last_s - first_s:.1f} s",
                    f"those after {last_s:.1f} s begin again at {first_s:.1f} s, where the robot "
                    f"is already as at {last_s:.1f} s",
                    "add as much to all stamps after the step, or make two logs of the two parts",
                )
            ]
        return [
            finding(
                "these poses are those of two robots or more under one number",
                f"they go to and fro between places {apart_m:.2f} m apart",
                UNDER_ONE,
            )
        ]
    span_m = np.ptp(np.column_stack([pose[:, :2], z_m]), axis=0)
    x_m, y_m, height_m = (float(v) for v in span_m)
    fast_mps = _usual_top_speed(t_s, pose)
    flat_m, wide_m = sorted((x_m, y_m))
    is_flat = flat_m < CHECKS.flat_m < CHECKS.lies_share * wide_m
    if is_flat and height_m > max(CHECKS.up_m, 5 * flat_m):
        axis = "y" if y_m < x_m else "x"
        return [
            finding(
                f"{axis} is up in these poses, not z",
                f"z goes over {height_m:.2f} m and {axis} over {min(x_m, y_m) * 1000:.0f} mm",
                f"import anew with {option('up', 'x')}"
                if axis == "x"  # y is up in what Motive writes and in nothing else
                else f"import anew with the other {option('up')} (y or z)",
            )
        ]
    if fast_mps > 1000 * CHECKS.fastest_mps:  # in mm, too
        return [
            finding(
                "the positions are none of a robot in a room, in any unit",
                f"it drives at {fast_mps:.2g} m/s by them, over {max(x_m, y_m):.2g} m",
                "correct what wrote them, or name the right columns and import anew",
            )
        ]
    if fast_mps > CHECKS.fastest_mps:
        units = ("mm",) if fast_mps > CHECKS.mm_mps else ("cm", "mm")
        named = [{"x_m": f"x_{u}", "y_m": f"y_{u}"} for u in units]
        return [
            finding(
                f"the positions are in {' or '.join(units)}, not in m",
                f"the robot drives at {fast_mps:.0f} m/s by them, over {max(x_m, y_m):.0f} m",
                lambda own: (
                    "choose metres in the export, or import anew with "
                    + ", or with ".join(option("rename", names, own) for names in named)
                ),
            )
        ]
    if robot.has_heading and _heading_is_constant(robot, pose):
        return [
            finding(
                "the heading was not measured",
                f"it is {np.degrees(pose[0, 2]):.1f} degrees in all {len(pose)} poses, to the bit",
                f"record it, or import anew with {option('heading_from_path', True)}, which takes "
                "it from the path "
                "while the robot drives ahead",
            )
        ]
    return []


def check_track(track: Track, label: str, own: int | None = None) -> list[InputFinding]:
    """Remarks on a log that can be used all the same; arguments as of `check_poses`."""
    found = []

    def add(what: str, evidence: str, remedy: Remedy, fatal: bool = False) -> None:
        mend, of_all = in_words(remedy, own)
        whose = label, track.robot_id
        found.append(InputFinding(what, evidence, mend, fatal, *whose, remedy_of_all=of_all))

    timing = track.timing
    if timing.pose_lost_share > CHECKS.lost:
        add(
            "many poses are lost",
            f"{timing.pose_lost_share:.0%} of the frames while the robot is tracked",
            "look for hidden markers or a full network, since fewer poses show quick changes worse",
        )
    lost_s, told_s = np.diff(track.lost_s, axis=1).sum(), np.ptp(track.command_t_s)
    if lost_s > CHECKS.lost * told_s:
        add(
            "many commands are lost",
            f"{lost_s / told_s:.0%} of the time passes in {len(track.lost_s)} holes of their beat",
            "look for a full network or disk, since poses without their commands tell nothing; a "
            "robot that stands as long as it hears no command is imported with "
            f"{option('command_timeout_s', 0.5)}, its own time",
        )
    closed_loop = abs(timing.command_period_s / timing.pose_period_s - 1) < 0.2
    if timing.pose_period_s > CHECKS.slow_s and not closed_loop:
        add(
            "the poses come slowly",
            f"{1 / timing.pose_period_s:.1f} in a second",
            "record at 10 Hz or more, since lags, delays and starts cannot be judged from so few",
        )
    noise_rad = _heading_noise_rad(track) if track.has_heading else 0.0
    if noise_rad > CHECKS.nonsense_rad:
        add(
            "the headings make no sense",
            f"they jump by {np.degrees(noise_rad):.0f} degrees from pose to pose",
            lambda own: (
                "check the column; of degrees import anew with "
                f"{option('rename', {'theta_rad': 'theta_deg'}, own)}"
            ),
            fatal=True,
        )
    elif noise_rad > CHECKS.noisy_rad:
        add(
            "the headings are noisy",
            f"{np.degrees(noise_rad):.1f} degrees, which makes "
            f"{1000 * np.sin(noise_rad):.0f} mm of each metre",
            "set the markers further apart, or print larger tags",
        )
    return found


def check_length(tracks: list[tuple[str, Track]]) -> list[InputFinding]:
    """Too little to see each kind of motion twice, in all logs of a robot together."""
    total_s: dict[int, float] = {}
    for _, track in tracks:
        usable_s = np.count_nonzero(track.segment >= 0) * track.timing.pose_period_s
        total_s[track.robot_id] = total_s.get(track.robot_id, 0) + usable_s
    return [
        InputFinding(
            "the log is short",
            f"{seconds:.0f} s of usable poses",
            "drive for a minute or more: what is driven once is fitted, and nothing is left to "
            "judge it by",
            False,
            next(label for label, track in tracks if track.robot_id == robot_id),
            robot_id,
        )
        for robot_id, seconds in total_s.items()
        if seconds < CHECKS.short_s
    ]


def _usual_top_speed(t_s: np.ndarray, pose: np.ndarray) -> float:
    """Speed over half a second that is passed in a twentieth of the time."""
    after = np.searchsorted(t_s, t_s + 0.5)
    start = np.flatnonzero(after < len(t_s))
    after = after[start]
    near = t_s[after] - t_s[start] < 1
    if not near.any():
        return 0.0
    step = pose[after[near], :2] - pose[start[near], :2]
    speed = np.hypot(step[:, 0], step[:, 1]) / (t_s[after[near]] - t_s[start[near]])
    return float(np.quantile(speed, 0.95))


def _goes_to_and_fro(place: np.ndarray) -> float:
    """How far apart the places are to which poses come back after a leap; 0 if few leap so.

    Args:
        place: (N, 2).
    """
    leap_m, back_m = _to_and_fro(place)
    leaps = (leap_m > CHECKS.leap_m) & (back_m < leap_m / 5)
    return float(np.median(leap_m[leaps])) if leaps.mean() > CHECKS.leaps else 0.0


def _step_back(pose: np.ndarray) -> tuple[int, int] | None:
    """Where stamps that step back begin again, and the last before the step; None if none do.

    Sorted by stamp, two parts of one drive come in turn for as long as the step: the second begins
    where the first ends, and is there alone afterwards. Two robots are each on a way of its own.

    Args:
        pose: (N, 3) that goes to and fro.
    """
    ahead = np.column_stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])])
    place = np.column_stack([pose[:, :2], ARM_M * np.nan_to_num(ahead)])
    leap_m, back_m = _to_and_fro(place)
    leaps = np.flatnonzero((leap_m > CHECKS.leap_m) & (back_m < leap_m / 5))
    begin, end = leaps[0] + 1, leaps[-1] + 3  # the second part's first pose; both have ended
    if begin < CHECKS.fewest_poses or end > len(place) - CHECKS.fewest_poses:
        return None
    last = [begin - 1, begin]  # of either part
    for k in range(begin + 1, end):
        part = int(np.argmin(np.linalg.norm(place[last] - place[k], axis=1)))
        last[part] = k
    gap_m = np.linalg.norm(place[last[0]] - place[begin])
    joined = last[1] > last[0] and gap_m < np.median(leap_m[leaps]) / 5
    return (int(begin), last[0]) if joined else None


def _to_and_fro(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N - 1,) steps of (N, C) values, and how near one of the next ones is to where they began."""
    step = np.linalg.norm(np.diff(values, axis=0), axis=1)
    back = np.full(len(step), np.inf)
    for n in range(2, MOST_UNDER_ONE + 1):
        own = np.linalg.norm(values[n:] - values[:-n], axis=1)
        back[: len(own)] = np.minimum(back[: len(own)], own)
    return step, back


def _stands(robot: RobotLog, t_s: np.ndarray, pose: np.ndarray) -> str:
    """How long strong commands leave the poses within their noise; empty if they do not."""
    if robot.command_kind not in STRONG or not len(robot.command_t_s):
        return ""
    known = np.isfinite(pose).all(axis=0)
    span = np.ptp(np.quantile(pose[:, known], (0.01, 0.99), axis=0), axis=0)
    noise = _noise(np.diff(pose[:, known], n=2, axis=0))
    if (span > np.clip(5 * noise, STANDS[known], STANDS_NOISY[known])).any():
        return ""
    command = command_at(t_s, robot.command_t_s, robot.command)
    share = float((np.abs(command) > STRONG[robot.command_kind]).any(axis=1).mean())
    driven_s = share * float(np.ptp(t_s))
    if driven_s < CHECKS.driven_s or share < CHECKS.driven:
        return ""
    return f"they stay within {1000 * span[:2].max():.1f} mm in {driven_s:.0f} s of strong commands"


def _noise(bends: np.ndarray) -> np.ndarray:
    """Standard deviation of white noise with such second differences, by column."""
    return np.median(np.abs(bends), axis=0) / 0.6745 / np.sqrt(6)


def _heading_is_constant(robot: RobotLog, pose: np.ndarray) -> bool:
    """The heading never changes, though positions have noise: so it is no measurement."""
    bend = np.median(np.abs(np.diff(pose[:, :2], n=2, axis=0)))
    return bool(np.ptp(pose[:, 2]) < CHECKS.still_rad and bend > CHECKS.still_rad)


def _heading_noise_rad(track: Track) -> float:
    """Standard deviation from second differences; zero where motion alone would make them."""
    if track.timing.pose_period_s > CHECKS.slow_s:
        return 0.0
    index = np.flatnonzero(track.segment >= 0)
    if len(index) < CHECKS.fewest_poses:
        return 0.0
    bend = np.diff(track.pose[index, 2], n=2)
    same = np.diff(track.segment[index])
    bend = bend[(same[1:] == 0) & (same[:-1] == 0)]
    return float(_noise(bend)) if len(bend) else 0.0
