# SPDX-License-Identifier: Apache-2.0
"""Meanings of other people's table columns: their names, their units, and some that mislead.

A unit in a name is believed and converted: `theta_deg`, `x_mm`, `t_ms`. A name without a unit is
never guessed silently: `explain` says what it looks like, a mapping file keeps what was decided.
"""

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from twinmill.arguments import option
from twinmill.data.importers.ros_messages import STAND_IN
from twinmill.data.importers.topics import APART, field_of, is_path, is_si
from twinmill.data.importers.turning import unit_of_heading
from twinmill.data.log import LogError
from twinmill.data.measurement_table import LOST, TIMES, Table, is_number
from twinmill.data.units import UNITS, plain_name, split_unit, unit_of_steps


@dataclass(frozen=True)
class Source:
    """Where one of our columns comes from: a column less `zero`, times a factor; or a constant."""

    column: str | None
    factor: float = 1.0
    value: float | None = None
    zero: float = 0.0


Mapping = dict[str, Source]


@dataclass(frozen=True)
class Guess:
    """Likely meaning of a file's column.

    Attributes:
        column: its name in the file; empty for a constant.
        targets: our columns; empty if it is left out.
        factor: to our unit.
        why: in words, with the values that speak for it.
        sure: its name says so; else a person must.
        note: what an import is to say about it.
        rival: the column before it that holds the same quantity.
        zero: what stands for nothing there.
    """

    column: str
    targets: tuple[str, ...]
    factor: float
    why: str
    sure: bool
    note: str = ""
    rival: str = ""
    zero: float = 0.0


def by_name(column: str, known: frozenset[str]) -> tuple[tuple[str, ...], float] | None:
    """Our columns and the factor, where a name with a unit says it all.

    The factor is NaN where a number is needed that no table has, as LACKS says.
    """
    if column in known:
        return (column,), 1.0
    stem, unit = split_unit(column)
    ours, factor = UNITS.get(unit, ("", 1.0))
    if f"{stem}_{ours}" in known:
        return (f"{stem}_{ours}",), factor
    if stem in WHEELS and ours in ("radps", "mps"):
        targets = tuple(f"w{k}_radps" for k in WHEELS[stem])
        factor = factor if ours == "radps" else math.nan
        return (targets, factor) if known.issuperset(targets) else None
    targets = USUAL[stem][0] if stem in USUAL else ()
    by_unit = ours and all(target.endswith(f"_{ours}") for target in targets)
    unitless = not unit and stem in ALWAYS
    if targets and known.issuperset(targets) and (by_unit or unitless):
        return targets, factor
    return None


def _time(values: np.ndarray) -> tuple[float, str]:
    steps = np.diff(np.unique(values))  # whatever the order of the rows
    step = float(np.median(steps)) if len(steps) else 0.0
    if unit := unit_of_steps(step):
        return UNITS[unit][1], f"rows are {step:g} apart, so it looks like {unit}"
    return 1.0, f"rows are {step:g} apart, which fits no unit"


def _length(values: np.ndarray) -> tuple[float, str]:
    span = float(np.ptp(values))
    if span > 100:
        return 1e-3, f"goes over {span:.0f}, so it looks like mm"
    if span > 20:
        return 1e-2, f"goes over {span:.0f}, so it looks like cm"
    return 1.0, f"goes over {span:.2f}, so it looks like m"


def _angle(values: np.ndarray) -> tuple[float, str]:
    top = float(np.abs(values).max())
    if top > 2 * math.pi + 0.1:
        return math.pi / 180, f"goes to {top:.0f}, so it looks like degrees"
    return 1.0, f"goes to {top:.2f}, so it looks like radians"


def _duty(values: np.ndarray) -> tuple[float, str]:
    top = float(np.abs(values).max())
    if top <= 1:
        return 100.0, f"goes to {top:g}, so it looks like a share of full duty"
    if top <= 100:
        return 1.0, f"goes to {top:g}, so it looks like percent"
    return 100 / 255, f"goes to {top:g}, so it looks like PWM of 255"


def _speed(values: np.ndarray) -> tuple[float, str]:
    top = float(np.abs(values).max())
    if top > 60:
        return 1e-3, f"goes to {top:.0f}, so it looks like mm/s"
    if top > 4:
        return 1e-2, f"goes to {top:.0f}, so it looks like cm/s"
    return 1.0, f"goes to {top:.2f}, so it looks like m/s"


def _turn(values: np.ndarray) -> tuple[float, str]:
    top = float(np.abs(values).max())
    if top > 20:
        return math.pi / 180, f"goes to {top:.0f}, so it looks like degrees/s"
    return 1.0, f"goes to {top:.2f}, so it looks like rad/s"


def _plain(values: np.ndarray) -> tuple[float, str]:
    return 1.0, f"goes from {values.min():g} to {values.max():g}"


# Standstill, and what goes to full duty from there: bytes, servos by angle and by pulse.
CENTRED = ((127.5, 127.5), (90.0, 90.0), (1500.0, 500.0))
AT_REST = 0.02  # of the latter
LOW_PULSE_US = 500.0  # no servo takes shorter ones


def _in_other_unit(column: str, targets: tuple[str, ...], values: np.ndarray) -> Guess | None:
    """Guess for duties whose values do not fit the unit in their name, as nobody drives so."""
    top = float(np.abs(values).max(initial=0.0))
    if 0 < top <= 1 and np.any(values % 1):
        factor, why = _duty(values)
        return Guess(column, targets, factor, why, False)
    if top > 255 and values.min() > LOW_PULSE_US:
        middle, span = CENTRED[-1]
        why = f"goes from {values.min():g} to {top:g}, so it looks like pulses about {middle:g} us"
        return Guess(column, targets, 100 / span, why, False, zero=middle)
    return None


def _centred(column: str, targets: tuple[str, ...], values: np.ndarray) -> Guess | None:
    """Guess for duties whose rest lies in the middle of their range."""
    for middle, span in CENTRED if len(values) else ():
        off, zero = (values - middle) / span, float(values[-1])
        within = np.all(np.abs(off) <= 1) and np.any(off < -AT_REST) and np.any(off > AT_REST)
        rests = np.count_nonzero(np.abs(off) <= AT_REST)
        if within and abs(off[-1]) <= AT_REST and rests >= np.count_nonzero(values == 0):
            why = (
                f"goes from {values.min():g} to {values.max():g} and ends at {zero:g}, so it looks "
                "as if that were standstill"
            )
            full = span + abs(zero - middle)
            return Guess(column, targets, 100 / full, why, False, zero=zero)
    return None


LEFT, RIGHT = ("fl_pct", "rl_pct"), ("fr_pct", "rr_pct")
ROBOT = ("robot", "agent", "robotid", "robot_name", "name")
UNITS_OF_ONE = tuple(f"{name}{axis}" for name in ("q", "q_rs_") for axis in "wxyz")
ALWAYS = frozenset((*ROBOT, *UNITS_OF_ONE))  # need no unit
WHEELS = {"left": (1, 3), "right": (2, 4), "fl": (1,), "fr": (2,), "rl": (3,), "rr": (4,)}
# Usual names without a unit: what they mean, and how their values tell the unit.
USUAL: dict[str, tuple[tuple[str, ...], Callable[[np.ndarray], tuple[float, str]]]] = {
    **dict.fromkeys(TIMES, (("t_s",), _time)),
    **dict.fromkeys((*ROBOT, "id"), (("robot_id",), _plain)),
    **dict.fromkeys(("x", "pos_x", "position_x", "px", "translation_x"), (("x_m",), _length)),
    **dict.fromkeys(("y", "pos_y", "position_y", "py", "translation_y"), (("y_m",), _length)),
    **dict.fromkeys(
        ("z", "pos_z", "position_z", "pz", "height", "translation_z"), (("z_m",), _length)
    ),
    **dict.fromkeys(("theta", "yaw", "heading", "psi", "phi", "angle"), (("theta_rad",), _angle)),
    **dict.fromkeys(("v", "vx", "linear_x", "speed"), (("vx_mps",), _speed)),
    **dict.fromkeys(("vy", "linear_y"), (("vy_mps",), _speed)),
    **dict.fromkeys(
        ("steering", "steering_angle", "steer", "steer_angle"), (("steering_rad",), _angle)
    ),
    **dict.fromkeys(("w", "omega", "angular_z", "wz", "yaw_rate"), (("omega_radps",), _turn)),
    **dict.fromkeys(("left", "pwm_left", "pwm_l", "u_l", "duty_left"), (LEFT, _duty)),
    **dict.fromkeys(("right", "pwm_right", "pwm_r", "u_r", "duty_right"), (RIGHT, _duty)),
    **{
        name: ((f"{wheel}_pct",), _duty)
        for wheel in ("fl", "fr", "rl", "rr")
        for name in (wheel, f"pwm_{wheel}", f"duty_{wheel}")
    },
    **{
        name: ((f"v{axis}_world_mps",), _speed)
        for axis in "xy"
        for name in (f"v{axis}_world", f"world_v{axis}", f"v{axis}_global", f"vel_{axis}_world")
    },
    **{q: ((q,), _plain) for q in ("qw", "qx", "qy", "qz")},
    **{
        name: ((f"q{axis}",), _plain)
        for axis in "wxyz"
        for name in (
            *(f"orientation_{axis}", f"rotation_{axis}", f"quat_{axis}", f"q_{axis}"),
            f"q_rs_{axis}",
        )
    },
    # Ground truth of EuRoC: of the body (S) in the frame R
    **{f"p_rs_r_{axis}": ((f"{axis}_m",), _length) for axis in "xyz"},
    # Trajectories of TUM
    **{f"t{axis}": ((f"{axis}_m",), _length) for axis in "xyz"},
    # German
    **dict.fromkeys(("zeit", "zeitstempel"), (("t_s",), _time)),
    **dict.fromkeys(("roboter", "roboter_id", "nummer"), (("robot_id",), _plain)),
    **dict.fromkeys(("h\u00f6he", "hoehe"), (("z_m",), _length)),
    **dict.fromkeys(
        ("winkel", "richtung", "ausrichtung", "orientierung"), (("theta_rad",), _angle)
    ),
    **dict.fromkeys(("geschwindigkeit", "tempo"), (("vx_mps",), _speed)),
    **dict.fromkeys(("drehrate", "winkelgeschwindigkeit"), (("omega_radps",), _turn)),
    "links": (LEFT, _duty),
    "rechts": (RIGHT, _duty),
    **{
        name: ((f"{wheel}_pct",), _duty)
        for name, wheel in (("vl", "fl"), ("vr", "fr"), ("hl", "rl"), ("hr", "rr"))
    },
    # French and Spanish
    **dict.fromkeys(("temps", "tiempo", "horodatage"), (("t_s",), _time)),
    **dict.fromkeys(("cap", "orientation", "angulo", "\u00e1ngulo"), (("theta_rad",), _angle)),
    **dict.fromkeys(("vitesse", "velocidad"), (("vx_mps",), _speed)),
    **dict.fromkeys(("vitesse_angulaire", "velocidad_angular"), (("omega_radps",), _turn)),
}
OF_ODOMETRY = re.compile(r"(^|[./])twist[./]twist[./]")  # with its covariance, as no command has
OF_PLOTJUGGLER = "__time"  # in s, always
OUR_DAYS_S = (1e9, 2.5e9)  # since 1970: the years 2001 to 2049
QUATERNIONS = (("qw", "qx", "qy", "qz"), ("qx", "qy", "qz", "qw"))  # orders of q0 to q3
NUMBERED = ("q0", "q1", "q2", "q3")
HALF_TURN_DEG = 180.0  # no robot turns so far from row to row: then it is the way back of degrees
LEVEL = 0.2  # x and y of the quaternion of a robot on a floor are smaller
DIRECTION = re.compile(r"(^|_)dir(ection)?(_|$)")  # of a wheel, beside a duty without a sign
COUNTER = re.compile(r"(frame|sample|image|index)_?(id|idx|index|no|nr|num|number|count)?")


def explain(
    table: Table,
    known: frozenset[str],
    rename: dict[str, str] | None = None,
    topic: str | None = None,
) -> list[Guess]:
    """Guesses for all columns, in the order of the file.

    Args:
        table: as it was read.
        known: our columns that this kind of table has.
        rename: column in the file to ours, as a person decided.
        topic: the one that is meant, in a table of several.

    Raises:
        LogError: several topics hold what is looked for, and none is named.
    """
    new = rename or {}
    others = _of_other_topics(table, known, new, topic)
    looks = [
        Guess(column, (), 1.0, "of another topic: left out", True)
        if column in others
        else _guess(table, column, known, new.get(column))
        for column in table.header
    ]
    guesses: list[Guess] = []
    holder: dict[str, str] = {}  # column that is each of ours
    for guess in _together(table, known, looks):
        column = guess.column
        taken = [target for target in guess.targets if target in holder]
        if taken:
            why = f"left out: {taken[0]} is column '{holder[taken[0]]}' already"
            guess = replace(guess, targets=(), why=why, sure=True, rival=holder[taken[0]])
        holder |= dict.fromkeys(guess.targets, column)
        guesses.append(guess)
    if is_never_sideways(holder):
        guesses.append(Guess("", ("vy_mps",), 0.0, "no sideways speed: 0", False))
    return guesses


def is_never_sideways(names: Collection[str]) -> bool:
    """True if columns tell velocities of a robot that is not told to drive sideways."""
    return {"vx_mps", "omega_radps"} <= {*names} and not {"vy_mps", "steering_rad"} & {*names}


def _together(table: Table, known: frozenset[str], guesses: list[Guess]) -> list[Guess]:
    """Guesses made consistent with each other: x and y share a unit, q0 to q3 have one order."""
    named = {plain_name(guess.column): guess.column for guess in guesses}
    changed: dict[str, Guess] = {}
    plane = [g for g in guesses if g.targets in (("x_m",), ("y_m",)) and not g.sure]
    if len(plane) == 2 and plane[0].factor != plane[1].factor:
        larger, other = sorted(plane, key=lambda g: g.factor)
        why = f"in the unit of '{larger.column}', which {larger.why}"
        changed[other.column] = replace(other, factor=larger.factor, why=why)
    changed |= _turning_as_the_path(table, guesses)
    changed |= _quaternion(table, known, named) | _beside_quaternion(table, guesses)
    told = {target for guess in guesses for target in guess.targets}
    for name, column in named.items():
        if DIRECTION.search(name) and told & {*LEFT, *RIGHT}:
            why = "is a direction, and our duties have signs: give them its sign, and take it out"
            changed[column] = Guess(column, (), 1.0, why, False)
    counter = next((column for name, column in named.items() if COUNTER.fullmatch(name)), None)
    times = {guess.column for guess in guesses if "t_s" in guess.targets}
    if counter and times <= {counter} and "t_s" in known:
        changed[counter] = Guess(counter, ("t_s",), math.nan, ", ".join(lacks("t_s")), False)
    return [changed.get(guess.column, guess) for guess in guesses]


def _turning_as_the_path(table: Table, guesses: list[Guess]) -> dict[str, Guess]:
    """The heading in the unit in which it turns as the path does, where its size alone misleads."""
    of = {g.targets[0]: g for g in guesses if len(g.targets) == 1}
    heading = of.get("theta_rad")
    if not heading or heading.sure or not {"x_m", "y_m"} <= of.keys():
        return {}
    try:
        x, y, theta = (
            table.numbers(of[name].column, empty_is_nan=True)
            for name in ("x_m", "y_m", "theta_rad")
        )
    except LogError:  # a cell is no number, which is told when it is read
        return {}
    robot = of.get("robot_id")
    ids = np.array(table.cells(robot.column)) if robot else np.zeros(len(theta))
    runs = [(ids == number) for number in np.unique(ids)]
    unit = unit_of_heading([(np.column_stack([x, y])[own], theta[own]) for own in runs])
    top = float(np.nanmax(np.abs(theta), initial=0.0))
    if unit:
        words = {"rad": "radians", "deg": "degrees"}[unit]
        why = f"goes to {top:.4g} and turns as the path does in {words}, so it looks like {words}"
        return {heading.column: replace(heading, factor=UNITS[unit][1], why=why)}
    jumps = [np.abs(np.diff(theta[own])) > HALF_TURN_DEG for own in runs]
    if heading.factor != 1 and not any(map(np.any, jumps)):
        why = f"{heading.why}, or like radians that go on beyond a whole turn"
        return {heading.column: replace(heading, why=why)}
    return {}


def _beside_quaternion(table: Table, guesses: list[Guess]) -> dict[str, Guess]:
    """Places without a unit that are in m: beside a quaternion, as TUM and EuRoC define it."""
    told = {target for guess in guesses if guess.sure for target in guess.targets}
    place = [g for g in guesses if g.targets in (("x_m",), ("y_m",), ("z_m",)) and not g.sure]
    if not told.issuperset(QUATERNIONS[0]) or any(g.factor != 1.0 for g in place):
        return {}
    names = ", ".join(g.column for g in place)
    note = f"{table.name}: {names} stand beside a quaternion, and are taken for m."
    return {g.column: replace(g, sure=True, note=note if g is place[0] else "") for g in place}


def _quaternion(table: Table, known: frozenset[str], named: dict[str, str]) -> dict[str, Guess]:
    """Order of q0 to q3, told by where x and y of a level robot are small."""
    if not (set(NUMBERED) <= set(named) and known.issuperset(QUATERNIONS[0])):
        return {}
    parts = [np.abs(_numbers(table, named[q])).max(initial=0.0) for q in NUMBERED]
    w_first, w_last = max(parts[1:3]) < LEVEL, max(parts[:2]) < LEVEL
    if w_first == w_last:
        return {}
    order = QUATERNIONS[0 if w_first else 1]
    why = "so it looks, since x and y are small where a robot is level"
    return {
        named[q]: Guess(named[q], (target,), 1.0, why, False)
        for q, target in zip(NUMBERED, order, strict=True)
    }


def _guess(table: Table, column: str, known: frozenset[str], new: str | None) -> Guess:
    """Guess for one column under the new name that a person gave it."""
    name = new or column
    if found := by_name(name, known):
        targets, factor = found
        centred = _centred(column, targets, _numbers(table, column))
        if split_unit(name)[1] == "pwm" and centred:
            return centred
        if math.isnan(factor):
            return Guess(column, targets, factor, ", ".join(lacks(targets[0])), False)
        other = _in_other_unit(column, targets, _numbers(table, column))
        if other and split_unit(name)[1] in ("pwm", "pct") and not new:
            return other
        note = ""
        if new:
            factor, note = _renamed(table.name, column, new, factor)
        why = "by its name" if factor == 1 else f"by its name, times {factor:.6g}"
        return Guess(column, targets, factor, why, True, note)
    usual = _usual(name)
    if usual and usual[0] == ("t_s",) and table.is_dated(column):
        return Guess(column, usual[0], 1.0, "holds dates or times of day", True)
    if usual and usual[0] == ("robot_id",) and not all(map(is_number, table.cells(column))):
        return Guess(column, usual[0], 1.0, "holds names", False)
    values = _numbers(table, column)
    if usual and known.issuperset(usual[0]) and _is_empty(table, column):
        return Guess(column, usual[0], 1.0, "holds no value", True)
    if not (usual and known.issuperset(usual[0]) and len(values)):
        span = f" ({_plain(values)[1]})" if len(values) else ""
        return Guess(column, (), 1.0, f"not known: left out{span}", True)
    targets, unit_of = usual
    if unit_of is _duty and (centred := _centred(column, targets, values)):
        return centred
    factor, why = unit_of(values)
    if targets == ("t_s",) and (unit := _since_1970(values)):
        factor, why = UNITS[unit][1], f"counts {unit} since 1970"
        return Guess(column, targets, factor, why, True)
    if is_si(name, field_of(name, USUAL)[1]) or plain_name(name) == OF_PLOTJUGGLER:
        why = "a field of a message: in m, rad, s (REP 103)"
        stands_in = targets == ("vx_mps",) and OF_ODOMETRY.search(name)
        note = f"{table.name}: {column} {STAND_IN}." if stands_in else ""
        return Guess(column, targets, 1.0, why, True, note)
    return Guess(column, targets, factor, why, False)


def _since_1970(values: np.ndarray) -> str:
    """Unit in which numbers count the time since then, by their size; empty if they do not."""
    for unit, per_s in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        if OUR_DAYS_S[0] * per_s < values.min() and values.max() < OUR_DAYS_S[1] * per_s:
            return unit
    return ""


WANTED = {  # what a topic holds that tells poses, or commands
    "poses": frozenset({"x_m", "y_m"}),
    "commands": frozenset({"vx_mps", "omega_radps"}),
}


def _of_other_topics(
    table: Table, known: frozenset[str], rename: dict[str, str], topic: str | None
) -> set[str]:
    """Columns of topics that are not the one that is meant.

    That is the one that was named, or the only one that tells what is looked for. Commands are told
    by odometry, which tells places as well, where nothing else tells them.
    """
    fields = {c: field_of(c, USUAL) for c in table.header if is_path(c) and c not in rename}
    targets: dict[str, set[str]] = {}
    for name, field in fields.values():
        if name:
            targets.setdefault(name, set()).update(USUAL[field][0] if field in USUAL else ())
    wanted = WANTED["poses" if "x_m" in known else "commands"]
    telling = [name for name, held in targets.items() if wanted <= held]
    chosen = _named_topic(topic, fields) if topic else None
    if topic and chosen is None:
        raise LogError(
            f"{table.name}: no column is of the topic {topic}; its topics are "
            f"{', '.join(f'/{name}' for name in targets) or 'none'}."
        )
    if chosen is None:
        asked = [name for name in telling if not WANTED["poses"] <= targets[name]]
        telling = telling if "x_m" in known else asked or telling
        if len(telling) > 1:
            of_pose = "pose" if "x_m" in known else "command"
            raise LogError(
                f"{table.name}: several topics tell what is looked for "
                f"({', '.join(f'/{name}' for name in telling)}); name one, as in "
                f"{option(of_pose, [f'/{telling[0]}'])}."
            )
        chosen = telling[0] if telling else None
    if chosen is None:
        return set()
    return {column for column, (name, _) in fields.items() if name not in ("", chosen)}


def _named_topic(topic: str, fields: dict[str, tuple[str, str]]) -> str | None:
    """A topic as `field_of` has it, which leaves out a `pose` that ends its name.

    Args:
        topic: its whole name, or that without its end; None is returned where it is not there.
        fields: of the columns, as `field_of` has them.
    """
    told = _path(topic)
    names = {_path(column): name for column, (name, field) in fields.items() if field in USUAL}
    if told in names.values():
        return told
    whole = (name for path, name in names.items() if path.startswith(f"{told}/"))
    return next((name for name in whole if told.startswith(name)), None)


def _path(name: str) -> str:
    """Words of a path in plain spelling."""
    return "/".join(plain_name(word) for word in APART.split(name) if word)


def _usual(name: str) -> tuple[tuple[str, ...], Callable] | None:
    """Our columns for a usual name, wherever it stands in a message of ROS; else None."""
    return USUAL.get(field_of(name, USUAL)[1])


def targets_of(name: str, known: frozenset[str]) -> tuple[str, ...]:
    """Our columns that a name, in any unit or a usual one, stands for; none where we know none."""
    usual = by_name(name, known) or _usual(name) or ((),)
    return usual[0] if known.issuperset(usual[0]) else ()


def is_usual(name: str, known: frozenset[str]) -> bool:
    """True if a name is one of ours in any unit, or a usual one for a quantity that we know."""
    return bool(targets_of(name, known))


LACKS = {  # what a column is whose factor no table has, and that factor, by what ours hold
    "radps": ("a speed of the wheel's rim", "1 / the wheel's radius in m"),
    "m": ("in pixels", "the metres on the floor that a pixel is wide"),
    "s": ("a count of frames", "1 / the frames of a second"),
}


def lacks(target: str) -> tuple[str, str]:
    """Quantity that a column holds but for a number from outside, and that number."""
    what, factor = LACKS[split_unit(target)[1]]
    return what, f"the factor is {factor}"


def _renamed(table: str, column: str, new: str, factor: float) -> tuple[float, str]:
    """Factor of a column under its new name, and what to say: a unit in its old name stays true.

    A new name in our unit says what the column is; one in another unit says what it holds.
    """
    old_unit, new_unit = split_unit(column)[1], split_unit(new)[1]
    if not old_unit or old_unit == new_unit or not new_unit:
        return factor, ""
    (ours, old_factor), (new_ours, _) = UNITS[old_unit], UNITS[new_unit]
    if ours != new_ours:
        raise LogError(
            f"{option('rename', {column: new})}: {old_unit} is no unit of what {new} holds; name "
            "the right "
            f"column, or say what it is in a {option('mapping')} file."
        )
    if new_unit == new_ours:
        return old_factor, f"{table}: {column} is in {old_unit} by its name: converted to {new}."
    return factor, f"{table}: {column} is read in {new_unit}, whatever its name says."


def _is_empty(table: Table, column: str) -> bool:
    return bool(table.rows) and all(cell.lower() in LOST for cell in table.cells(column))


def _numbers(table: Table, column: str) -> np.ndarray:
    try:
        values = table.numbers(column, empty_is_nan=True)
    except LogError:
        return np.empty(0)
    return values[np.isfinite(values)]


def mapping_of(guesses: list[Guess]) -> Mapping:
    """Where each of our columns comes from."""
    return {
        target: Source(g.column, g.factor, zero=g.zero)
        if g.column
        else Source(None, value=g.factor)
        for g in guesses
        for target in g.targets
    }


def to_toml(mappings: dict[str, list[Guess]]) -> str:
    """A mapping file: a table for each kind of file (`poses`, `commands`)."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment(f"Which column is what: check it, and import with {option('mapping')}.")
    )
    for kind, guesses in mappings.items():
        section = tomlkit.table()
        for guess in guesses:
            for target in guess.targets:
                entry = tomlkit.inline_table()
                if guess.column:
                    entry.update({"column": guess.column, "factor": guess.factor})
                    entry.update({"zero": guess.zero} if guess.zero else {})
                else:
                    entry.update({"value": guess.factor})
                section.add(target, entry)
                section[target].comment(guess.why)
        document.add(kind, section)
    return tomlkit.dumps(document)


def read_mapping(path: Path, kind: str, known: frozenset[str]) -> Mapping:
    """One table of a mapping file.

    Raises:
        LogError: unreadable, or an entry that makes no sense.
    """
    try:
        section = tomlkit.parse(path.read_text(encoding="utf-8")).unwrap().get(kind, {})
    except (OSError, UnicodeDecodeError, TOMLKitError) as error:
        raise LogError(f"{path}: cannot be read as TOML ({error}); check the name.") from error
    mapping: Mapping = {}
    for target, entry in section.items():
        keys = set(entry) if isinstance(entry, dict) else set()
        numbers = [entry[k] for k in keys & {"factor", "value", "zero"}]
        if any(isinstance(n, float) and math.isnan(n) for n in numbers):
            raise LogError(
                f"{path}: [{kind}] {target}: has no factor yet; {lacks(target)[1]}: write it there."
            )
        good = keys == {"value"} or {"column"} <= keys <= {"column", "factor", "zero"}
        if target not in known or not good or not all(_is_real(n) for n in numbers):
            raise LogError(
                f"{path}: [{kind}] {target}: must be one of our columns with "
                '{ column = "name in the file", factor = 1.0, zero = 0.0 } or { value = 0.0 }; '
                "correct it."
            )
        mapping[target] = Source(
            entry.get("column"),
            float(entry.get("factor", 1)),
            entry.get("value"),
            float(entry.get("zero", 0)),
        )
    return mapping


def _is_real(number: object) -> bool:
    return isinstance(number, int | float) and math.isfinite(number)
