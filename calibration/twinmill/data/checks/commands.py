# SPDX-License-Identifier: Apache-2.0
"""Commands against poses: kind, signs, columns, axes, units, exchanged names."""

from dataclasses import replace

import numpy as np
import twinmill_native as native

from twinmill.arguments import option, options
from twinmill.counted import counted
from twinmill.data.checks.alternatives import (
    OWN,
    Alternative,
    Explained,
    Search,
    alike_left,
    far_better,
    pose_alternatives,
    wheel_alternatives,
)
from twinmill.data.checks.axle import at_axle
from twinmill.data.checks.clocks import FAR_S, shift_s, stepped
from twinmill.data.checks.finding import CheckedTrack, InputFinding, Remedy
from twinmill.data.checks.foreign import foreign_stretches
from twinmill.data.checks.motion import Motion
from twinmill.data.checks.rolling import factor_words
from twinmill.data.checks.senders import check_senders
from twinmill.data.checks.settings import CHECKS
from twinmill.data.checks.words import described
from twinmill.data.log import KINDS, CommandKind
from twinmill.data.track import Track, continuous

OMNI = 3  # wheels of the only robots with an odd number
OTHER_DRIVE = "take a model of this robot, or import the commands that the model is driven by"
OTHER_WHEELS = ", or, if the columns are right, check base.wheels and the sizes of the model"
DRIVEN_BY = {
    "duty": "duties",
    "wheel_speed": "wheel speeds",
    "twist": "velocities of the body",
    "steering": "steering angles",
}
# Measured over commanded speed, what it says, and columns under their right names.
Units = tuple[tuple[tuple[float, float], str, dict[str, str]], ...]
POSES_IN = (
    ((300.0, 3000.0), "the positions are in millimetres", {"x_m": "x_mm", "y_m": "y_mm"}),
    ((63.0, 300.0), "the positions are in centimetres", {"x_m": "x_cm", "y_m": "y_cm"}),
    (  # up to halfway, by ratio, from 39.4 inches in a metre to 100 cm
        (30.0, 63.0),
        "the positions are in inches, or in centimetres and the robot is slower than told",
        {"x_m": "x_inch", "y_m": "y_inch"},
    ),
)
SMALL_POSES_IN: Units = (  # a unit in a name is taken at its word: the name is to change
    (
        (1 / 300, 1 / 30),
        "the positions are 100 times too small, as if metres were taken for centimetres",
        {},
    ),
    (
        (1 / 3000, 1 / 300),
        "the positions are 1000 times too small, as if metres were taken for millimetres",
        {},
    ),
)
SPEEDS_IN = (
    (
        (1 / 3000, 1 / 300),
        "the commanded speeds are in millimetres per second",
        {"vx_mps": "vx_mmps", "vy_mps": "vy_mmps"},
    ),
    (
        (1 / 300, 1 / 30),
        "the commanded speeds are in centimetres per second",
        {"vx_mps": "vx_cmps", "vy_mps": "vy_cmps"},
    ),
)
# As above; but a gain of ten may be the robot's own, where shares of its speed are told.
TENFOLD = ((7.0, 14.0), (1 / 14, 1 / 7))
GAINS = (0.05, 5.0)  # bounds of base.forward_gain: what is beyond them no fit makes good
HEADINGS_IN = (((25.0, 130.0), "the headings are in degrees", {"theta_rad": "theta_deg"}),)
TURNS_IN = (
    (
        (1 / 130, 1 / 25),
        "the commanded turns are in degrees per second",
        {"omega_radps": "omega_degps"},
    ),
)
IN_ROOM = {"vx_mps": "vx_world_mps", "vy_mps": "vy_world_mps"}


DUTY, WHEEL_RADPS = 1.0, 5.0  # at which one wheel alone is tried


def body_by_command(model: native.Model | None, kind: CommandKind) -> np.ndarray | None:
    """(3, 4) forward m/s, left m/s, turn rad/s by unit of each column of a log's commands.

    Velocity commands need no wheels. None where the model is for another kind of command.
    """
    if kind == "twist":
        return np.eye(3, 4)
    if model is None or model.drive != kind:
        return None
    size = DUTY if kind == "duty" else WHEEL_RADPS
    steady = native.steady(model, np.ascontiguousarray(size * np.eye(4)), [], np.empty((0, 0)))
    return steady.reshape(4, -1)[:, :3].T / size


def columns_in_use(body: np.ndarray) -> int:
    """How many columns move the robot: four wheels, or three where the fourth is unused."""
    return 3 if not np.any(body[:, 3]) else 4


def check_drive(track: Track, model: native.Model, label: str) -> list[InputFinding]:
    """A finding where the commands are of another kind than the model is driven by."""
    told = track.command_kind
    if told not in KINDS or told == model.drive:
        return []
    return [
        InputFinding(
            f"the commands are {DRIVEN_BY[told]}, and the model is driven by "
            f"{DRIVEN_BY[model.drive]}",
            f'the log says {told}, the model drive = "{model.drive}"',
            OTHER_DRIVE
            if model.drive in KINDS
            else 'take drive = "twist": logs hold steering angles as the velocities they ask for',
            True,
            label,
            track.robot_id,
        )
    ]


def check_wheels(track: Track, model: native.Model, label: str) -> list[InputFinding]:
    """A finding where the wheels that are commanded are not those that the model has.

    Of two wheels the columns of both axles may tell the same; of three omni wheels the fourth is 0.
    """
    if track.command_kind not in ("duty", "wheel_speed") or track.command_kind != model.drive:
        return []
    words = [wheel["words"] for wheel in model.wheels()]
    told: list[bool] = (track.command[:, : len(words)] != 0).any(axis=0).tolist()
    if len(words) == OMNI and track.command[:, OMNI:].any():
        return [
            InputFinding(
                "a fourth wheel is commanded, and the model has three",
                "the fourth column is not 0, as where left and right are told",
                "give one column for each omni wheel, or another model",
                False,
                label,
                track.robot_id,
            )
        ]
    idle = [word for word, own in zip(words, told, strict=True) if not own]
    if not idle or not any(told):
        return []
    those = " and ".join(filter(None, [", ".join(idle[:-1]), idle[-1]]))
    return [
        InputFinding(
            f"no command drives {those}, which the model has among its {len(words)} driven wheels",
            f"its commands are 0 throughout, and those of {counted(sum(told), 'wheel')} not",
            "if the robot has two wheels, give the model half_wheelbase_m = 0 in [robot]; if each "
            "motor drives a side, log its command for both wheels there",
            False,
            label,
            track.robot_id,
        )
    ]


def check_commands(
    checked: CheckedTrack,
) -> tuple[list[InputFinding], Search | None, Explained | None]:
    """Findings of one robot, and how well its commands explain its motion; None if too short."""
    track = checked.track
    if not track.has_heading and (turns := _turning_share(checked)) > CHECKS.turns:
        return [_no_heading(checked, turns)], None, None
    motion = Motion.of(track)
    if len(motion.t_s) < CHECKS.fewest_poses or motion.block.max() + 1 < CHECKS.fewest_blocks:
        return [], None, None
    body = checked.body if track.has_heading else checked.body * np.array([[1], [1], [0]])
    search = Search(motion, body)
    own = search.own()
    if not track.has_heading:  # held at an angle that nobody recorded, which is no mistake
        held = [a for a in pose_alternatives() if a.is_turn]
        own = min([own, *search.best(held)], key=lambda e: e.left)
    speed_mps = float(np.sqrt(np.mean(np.abs(motion.world_mps) ** 2)))
    if speed_mps < CHECKS.least_mps and np.abs(motion.turn_radps).max() < CHECKS.least_radps:
        return [], search, own
    if own.left >= CHECKS.good and track.has_heading:  # else no turn shows a lever
        search = at_axle(search, [OWN, *_alternatives(checked)])
        own = search.own()
    if own.left < CHECKS.good:
        return _units(checked, own), search, own
    return _mistakes(checked, search, own), search, own


def _alternatives(checked: CheckedTrack) -> list[Alternative]:
    """Mistakes of signs, columns and axes that are tried on one robot's log."""
    poses = pose_alternatives() if checked.track.has_heading else []
    return wheel_alternatives(columns_in_use(checked.body)) + poses


def _shows(a: Alternative, track: Track) -> bool:
    """True if a mistake can be told from a robot that is held at an unknown angle.

    Without a heading the turn shows nothing, and velocities that are a quarter or half a turn off
    are no mistake.
    """
    if track.has_heading or track.command_kind != "twist":
        return True
    return a.place[2] == 2 and a.sign[2] == 1 and not _is_rotation(a)


def _is_rotation(a: Alternative) -> bool:
    """True if forward and left are turned together: its determinant is 1 (a mirror's is -1)."""
    swapped = a.place[:2] == (1, 0)
    return a.sign[0] * a.sign[1] == (-1 if swapped else 1)


def _mistakes(checked: CheckedTrack, search: Search, own: Explained) -> list[InputFinding]:
    track = checked.track
    tried = [e for e in search.best(_alternatives(checked)) if not _is_bias(e)]
    found = [e for e in tried if _shows(e.alternative, track)]
    best = min(found, key=lambda e: e.left)
    for mistake in (_in_room, _of_quaternion, _shifted, stepped):
        if mistaken := mistake(checked, search, own, best):
            return [mistaken]
    if not far_better(best, own):
        least = min(own.left, *(e.left for e in tried))
        if least > CHECKS.unrelated:
            return [_unrelated(checked, least)]
        return _units(checked, own) if own.left < CHECKS.explained else []
    alike = [e for e in found if e.left < alike_left([best.left])]
    alike.sort(key=lambda e: (e.alternative.steps, e.left))
    most = alike[0].alternative.steps + CHECKS.steps
    simplest = [e for e in alike if e.alternative.steps < most][:3]
    words = [described(e.alternative, track.command_kind, e.turned_rad) for e in simplest]
    of_columns = not all(e.alternative.of_poses for e in simplest)
    return [
        checked.finding(
            ", or ".join(dict.fromkeys(what for what, _ in words)),
            f"the commands explain {1 - own.left:.0%} of the motion as it is, and "
            f"{1 - simplest[0].left:.0%} without that mistake",
            lambda robot: (
                "correct it where the log is made, or import anew with "
                + ", or ".join(dict.fromkeys(options(mend, robot) for _, mend in words))
                + (OTHER_WHEELS if of_columns and track.command_kind != "twist" else "")
            ),
        ),
        *_units(checked, simplest[0]),
    ]


def _in_room(
    checked: CheckedTrack, search: Search, own: Explained, best: Explained
) -> InputFinding | None:
    """Velocities along the room's axes that were taken for the body's."""
    if checked.track.command_kind != "twist" or not checked.track.has_heading:
        return None
    room = Search(search.motion.told_in_room(), search.wheels).own()
    if room.left > alike_left([best.left]) or not far_better(room, own):
        return None
    return checked.finding(
        "the velocities are along the room's axes, not the body's",
        f"the commands explain {1 - own.left:.0%} of the motion as the body's, and "
        f"{1 - room.left:.0%} as the room's",
        anew_with(IN_ROOM),
    )


def _of_quaternion(
    checked: CheckedTrack, search: Search, own: Explained, best: Explained
) -> InputFinding | None:
    """The z of a quaternion, which is the sine of half the heading, that was taken for it."""
    track = checked.track
    if not track.has_heading or np.nanmax(np.abs(track.pose[:, 2])) > 1:
        return None
    pose = track.pose.copy()
    pose[:, 2] = 2 * np.arcsin(track.pose[:, 2])
    motion = Motion.of(replace(track, pose=continuous(pose, track.segment)))
    turned = at_axle(Search(motion, search.wheels), [OWN]).own()
    if turned.left > alike_left([best.left]) or not far_better(turned, own):
        return None
    return checked.finding(
        "the headings are no angles, but the z of a quaternion",
        f"the commands explain {1 - own.left:.0%} of the motion as they are, and "
        f"{1 - turned.left:.0%} as those of which z is the sine of half",
        "take the whole quaternion, in columns qw and qz, or its angle, 2 atan2(z, w)",
    )


def _shifted(
    checked: CheckedTrack, search: Search, own: Explained, best: Explained
) -> InputFinding | None:
    """Poses by far later or sooner than the commands, where that explains more than any mistake.

    Args:
        checked: one robot's track.
        search: of its mistakes.
        own: how well the commands explain the motion at shifts of usual delays and clocks.
        best: the best mistake of signs, columns and axes.
    """
    at_end = own.late_s in (search.lates_s[0], search.lates_s[-1])
    if own.left < CHECKS.poor and not at_end:
        return None
    every = [OWN, *_alternatives(checked)]
    far = at_axle(search.of(lates_s=FAR_S), every)
    found = far.best(every)
    alike = alike_left([e.left for e in found])
    simplest = min(
        (e for e in found if e.left < alike), key=lambda e: (e.alternative.steps, e.left)
    )
    if search.lates_s[0] < simplest.late_s < search.lates_s[-1] or _is_bias(simplest):
        return None
    if simplest.left > alike_left([best.left]) or not far_better(simplest, own):
        return None
    late_s = shift_s(far.without(simplest, far.lates_s), simplest.late_s)
    late = "late" if late_s > 0 else "early"
    what, mend = described(simplest.alternative, checked.track.command_kind, simplest.turned_rad)
    mend = {"pose_shift_s": round(float(-late_s), 3), **mend}
    return checked.finding(
        f"the poses come {abs(late_s):.2f} s {late} against the commands"
        + (f", and {what}" if what else ""),
        f"the commands explain {max(1 - own.left, 0.0):.0%} of the motion as it is stamped, and "
        f"{1 - simplest.left:.0%} with that shift" + (" and without that mistake" if what else ""),
        lambda robot: (
            "stamp both with one clock, or import anew with "
            f"{options(mend, robot)}; a constant delay of the robot is in that shift"
        ),
    )


def _is_bias(e: Explained) -> bool:
    """A heading that is off by no more than an effect of physics makes it."""
    return e.alternative.is_turn and abs(e.turned_rad) < CHECKS.turned_rad


def _unrelated(checked: CheckedTrack, left: float) -> InputFinding:
    if not checked.track.command.any():
        return checked.finding(
            "the robot moves, and all commands are zero",
            f"{len(checked.track.command)} of them",
            "record what drove it, or name the right columns and import anew",
        )
    return checked.finding(
        "the commands do not explain the motion",
        f"under no order and sign of the columns and no turn of the axes more than "
        f"{max(0.0, 1 - left):.0%}",
        "check that commands and poses are of the same robot and run, and shifted by less than "
        f"twelve seconds against each other ({option('pose_shift_s')})",
    )


def _turning_share(checked: CheckedTrack) -> float:
    """Share of the time in which the commands turn the robot."""
    t_s, command = checked.track.command_t_s, checked.track.command
    if len(t_s) < 2:
        return 0.0
    moving = np.abs(command @ checked.body.T)
    turning = (moving[:, 2] > 0.05)[:-1]
    return float(np.sum(np.diff(t_s)[turning]) / (t_s[-1] - t_s[0]))


def _no_heading(checked: CheckedTrack, share: float) -> InputFinding:
    return checked.finding(
        "the heading is not recorded, and the commands turn the robot",
        f"in {share:.0%} of the time",
        "positions alone tell only of a robot that holds it: record the heading, or import with "
        f"{option('heading_from_path', True)}, which takes it from the path while the robot "
        "drives ahead",
    )


def _units(checked: CheckedTrack, e: Explained) -> list[InputFinding]:
    """Speeds that are off by what a unit makes, where the commands explain the motion well."""
    if e.left > CHECKS.explained:
        return []
    if mixed := check_senders(checked, e):
        return mixed
    speed, turn = (float(gain) for gain in e.gain)
    turn = turn if checked.track.has_heading else 0.0
    (window, what, names), *_ = HEADINGS_IN
    if window[0] < turn < window[1]:  # speeds along axes of a wrong heading tell nothing
        return [checked.finding(what, _pace(turn), anew_with(names))]
    found = [
        checked.finding(what, _pace(ratio), anew_with(names))
        for ratio, units in _ratios(checked.track.command_kind, speed, turn)
        for (low, high), what, names in units
        if low < ratio < high
    ]
    wheels = turn or speed  # poses of another unit change the drive alone
    if checked.track.command_kind == "wheel_speed" and (words := factor_words(wheels)):
        found.append(checked.finding(words[0], _pace(wheels), words[1]))
    return found or _no_gain(checked, speed)


def _ratios(kind: CommandKind, speed: float, turn: float) -> list[tuple[float, Units]]:
    """Measured over commanded, with the units that may make it so.

    Wheels that are told too much drive and turn too much; of positions only the drive is off.
    """
    if kind == "twist":
        return [(speed, POSES_IN), (speed, SPEEDS_IN), (turn, TURNS_IN)]
    drive = speed / turn if turn else speed
    return [(drive, POSES_IN), (drive, SMALL_POSES_IN)]


def _no_gain(checked: CheckedTrack, speed: float) -> list[InputFinding]:
    """A factor between commands and motion that no unit explains, and no number of a model."""
    tenfold = checked.track.command_kind == "twist" and any(a < speed < b for a, b in TENFOLD)
    if not speed or not (tenfold or not GAINS[0] < speed < GAINS[1]):
        return []
    as_if = "ten, as if of mm and cm one was taken for the other" if tenfold else "a large factor"
    return [
        checked.finding(
            f"lengths are off by {as_if}",
            _pace(speed),
            "correct the units or the factors of positions and speeds, and import anew",
            fatal=False,
        )
    ]


def anew_with(names: dict[str, str]) -> Remedy:
    """Remedy for columns that have other units or meanings than their names say."""
    if not names:
        return "correct it where the log is made, or the unit in the names of its columns"
    return lambda robot: (
        f"correct it where the log is made, or import anew with {option('rename', names, robot)}"
    )


def _pace(ratio: float) -> str:
    return f"the robot is {ratio:.3g} times as fast as its commands and its model say"


def check_lever(checked: CheckedTrack, search: Search, own: Explained) -> list[InputFinding]:
    """A tracked point so far from where the robot turns that it was taken out to judge the rest."""
    led_m = search.motion.led_m
    if not led_m or own.left > CHECKS.explained:
        return []
    x_m, y_m = led_m.imag, -led_m.real  # a turn to the left leads what is ahead to the left
    told = checked.finding(
        f"the tracked point is {abs(led_m):.2f} m from the point that the robot turns about, "
        f"x {x_m:.2f} m and y {y_m:.2f} m",
        f"the commands explain {1 - own.left:.0%} of the motion with that",
        'say so in the model (an [[effect]] with name = "marker_offset", '
        f"x_m = {x_m:.3f}, y_m = {y_m:.3f}), which a fit makes exact, or move the tracked "
        "body's origin",
        fatal=False,
    )
    return [replace(told, lever_m=(x_m, y_m))]


def check_foreign(checked: CheckedTrack, search: Search, own: Explained) -> list[InputFinding]:
    """Whiles whose commands are not those of the motion; they are to be cut out."""
    found = foreign_stretches(checked.track, search, own)
    if not found:
        return []
    when = " and ".join(f"from {begin_s:.1f} to {end_s:.1f} s" for begin_s, end_s in found)
    told = checked.finding(
        f"the commands {when} do not belong to the motion",
        "the robot moves, and by no share of what it is told",
        "it is not judged; look whether these commands were recorded in the order and of the robot "
        "that drove them",
        fatal=False,
    )
    return [replace(told, cut_s=tuple(found))]


def check_exchange(
    judged: list[tuple[CheckedTrack, Search, Explained]],
) -> tuple[list[InputFinding], set[int]]:
    """Findings about the robots of one log, and who is exchanged.

    Only shifts in time near those at which a robot's own commands fit best are tried.
    """
    n = len(judged)
    if n < 2 or all(own.left < CHECKS.good for _, _, own in judged):
        return [], set()
    lates_s = sorted({round(own.late_s, 3) for _, _, own in judged} | {0.0, 0.06, 0.12})
    table = [[_explained(j, i, lates_s) for j in judged] for i in judged]
    if not any(far_better(e, row[i]) for i, row in enumerate(table) for e in row):
        return [], set()
    from scipy.optimize import linear_sum_assignment  # most logs do not get here

    left = np.array([[e.left for e in row] for row in table])
    poses, commands = linear_sum_assignment(left)
    ids = [checked.track.robot_id for checked, _, _ in judged]
    found, who = [], set()
    for p, c in zip(poses, commands, strict=True):
        if p == c or not far_better(table[p][c], table[p][p]):
            continue
        checked, other = judged[p][0], judged[c][0]
        who.add(checked.track.robot_id)
        found.append(
            checked.finding(
                f"its name is exchanged with that of robot {other.track.robot_id}",
                f"the commands of robot {other.track.robot_id} explain {1 - left[p, c]:.0%} of its "
                f"motion, its own {max(0.0, 1 - left[p, p]):.0%}",
                f"import anew with {_exchanging(ids, list(commands), int(p))}",
            )
        )
    return found, who


def _exchanging(ids: list[int], commands: list[int], one: int) -> str:
    """Options that give each of those robots its poses that are exchanged with this one.

    Args:
        ids: of all robots.
        commands: whose commands explain the poses of each; a permutation.
        one: of them.
    """
    around = [one]
    while (following := int(commands[around[-1]])) != one:
        around.append(following)
    begin = around.index(min(around))
    first, *others = (ids[k] for k in around[begin:] + around[:begin])
    return option("exchange", [(first, other) for other in others])


def _explained(
    of_commands: tuple[CheckedTrack, Search, Explained],
    of_poses: tuple[CheckedTrack, Search, Explained],
    lates_s: list[float],
) -> Explained:
    """How well the commands of one explain the poses of another."""
    return of_commands[1].of(of_poses[1].motion, np.array(lates_s)).own()
