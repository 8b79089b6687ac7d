# SPDX-License-Identifier: Apache-2.0
"""What the columns of other people's tables mean: their names, their units, and what only looks so.

A unit in a name is believed and converted: `theta_deg`, `x_mm`, `t_ms`. A name without a unit is
never guessed silently: `explain` says what it looks like, a mapping file keeps what was decided.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from twinmill.data.log import LogError
from twinmill.data.measurement_table import Table, read_table

UNITS = {  # unit in a name: that of ours, and the factor
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "deg": ("rad", math.pi / 180),
    "mmps": ("mps", 1e-3),
    "cmps": ("mps", 1e-2),
    "degps": ("radps", math.pi / 180),
    "rpm": ("radps", math.pi / 30),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "unit": ("pct", 100.0),  # duties of -1 to 1
    "pwm": ("pct", 100 / 255),  # duties of -255 to 255
}


@dataclass(frozen=True)
class Source:
    """Where one of our columns comes from: a column of the file times a factor, or a constant."""

    column: str | None
    factor: float = 1.0
    value: float | None = None


Mapping = dict[str, Source]


@dataclass(frozen=True)
class Guess:
    """What a column of a file looks like.

    Attributes:
        column: its name in the file; empty for a constant.
        targets: our columns; empty if it is left out.
        factor: to our unit.
        why: in words, with the values that speak for it.
        sure: its name says so; else a person must.
    """

    column: str
    targets: tuple[str, ...]
    factor: float
    why: str
    sure: bool


def by_name(column: str, known: frozenset[str]) -> tuple[str, float] | None:
    """Our column and the factor, where a name with a unit says it all."""
    if column in known:
        return column, 1.0
    stem, _, unit = column.rpartition("_")
    if unit in UNITS:
        ours, factor = UNITS[unit]
        if f"{stem}_{ours}" in known:
            return f"{stem}_{ours}", factor
    return None


def _time(values: np.ndarray) -> tuple[float, str]:
    step = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else 0.0
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if step * factor < 2:
            return factor, f"rows are {step:g} apart, so it looks like {unit}"
    return 1.0, f"rows are {step:g} apart, which fits no unit"


def _length(values: np.ndarray) -> tuple[float, str]:
    span = float(np.ptp(values))
    if span > 100:
        return 1e-3, f"goes over {span:.0f}, so it looks like mm"
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
    if top > 20:
        return 1e-3, f"goes to {top:.0f}, so it looks like mm/s"
    return 1.0, f"goes to {top:.2f}, so it looks like m/s"


def _turn(values: np.ndarray) -> tuple[float, str]:
    top = float(np.abs(values).max())
    if top > 20:
        return math.pi / 180, f"goes to {top:.0f}, so it looks like degrees/s"
    return 1.0, f"goes to {top:.2f}, so it looks like rad/s"


def _plain(values: np.ndarray) -> tuple[float, str]:
    return 1.0, f"goes from {values.min():g} to {values.max():g}"


LEFT, RIGHT = ("fl_pct", "rl_pct"), ("fr_pct", "rr_pct")
# Usual names without a unit: what they mean, and how their values tell the unit.
USUAL: dict[str, tuple[tuple[str, ...], Callable[[np.ndarray], tuple[float, str]]]] = {
    **dict.fromkeys(("t", "time", "timestamp", "stamp", "time_s", "secs"), (("t_s",), _time)),
    **dict.fromkeys(("robot", "id", "agent", "robotid"), (("robot_id",), _plain)),
    **dict.fromkeys(("x", "pos_x", "position_x", "px"), (("x_m",), _length)),
    **dict.fromkeys(("y", "pos_y", "position_y", "py"), (("y_m",), _length)),
    **dict.fromkeys(("z", "pos_z", "position_z", "pz", "height"), (("z_m",), _length)),
    **dict.fromkeys(("theta", "yaw", "heading", "psi", "phi"), (("theta_rad",), _angle)),
    **dict.fromkeys(("v", "vx", "linear_x", "speed", "v_mps"), (("vx_mps",), _speed)),
    **dict.fromkeys(("vy", "linear_y"), (("vy_mps",), _speed)),
    **dict.fromkeys(
        ("w", "omega", "angular_z", "wz", "yaw_rate", "w_radps"), (("omega_radps",), _turn)
    ),
    **dict.fromkeys(("left", "pwm_left", "pwm_l", "u_l", "duty_left"), (LEFT, _duty)),
    **dict.fromkeys(("right", "pwm_right", "pwm_r", "u_r", "duty_right"), (RIGHT, _duty)),
    **{
        name: ((f"{wheel}_pct",), _duty)
        for wheel in ("fl", "fr", "rl", "rr")
        for name in (wheel, f"pwm_{wheel}", f"duty_{wheel}")
    },
    **{q: ((q,), _plain) for q in ("qw", "qx", "qy", "qz")},
}


def explain(table: Table, known: frozenset[str]) -> list[Guess]:
    """What each column looks like, in the order of the file."""
    guesses = []
    for column in table.header:
        if found := by_name(column, known):
            target, factor = found
            why = "by its name" if factor == 1 else f"by its name, times {factor:.6g}"
            guesses.append(Guess(column, (target,), factor, why, True))
            continue
        usual = USUAL.get(column.strip().lower().replace(".", "_").replace(" ", "_"))
        values = _numbers(table, column) if usual else np.empty(0)
        if usual is None or not len(values):
            guesses.append(Guess(column, (), 1.0, "not known: left out", True))
            continue
        targets, unit_of = usual
        factor, why = unit_of(values)
        guesses.append(Guess(column, targets, factor, why, False))
    targets = {t for guess in guesses for t in guess.targets}
    if "vx_mps" in targets and "omega_radps" in targets and "vy_mps" not in targets:
        guesses.append(Guess("", ("vy_mps",), 0.0, "no sideways speed: 0", False))
    return guesses


def _numbers(table: Table, column: str) -> np.ndarray:
    try:
        values = table.numbers(column, empty_is_nan=True)
    except LogError:
        return np.empty(0)
    return values[np.isfinite(values)]


def mapping_of(guesses: list[Guess]) -> Mapping:
    """Where each of our columns comes from."""
    return {
        target: Source(g.column, g.factor) if g.column else Source(None, value=g.factor)
        for g in guesses
        for target in g.targets
    }


def to_toml(mappings: dict[str, list[Guess]]) -> str:
    """A mapping file: a table for each kind of file (`poses`, `commands`)."""
    document = tomlkit.document()
    document.add(tomlkit.comment("Which column is what: check it, and import with --mapping."))
    for kind, guesses in mappings.items():
        section = tomlkit.table()
        for guess in guesses:
            for target in guess.targets:
                entry = tomlkit.inline_table()
                if guess.column:
                    entry.update({"column": guess.column, "factor": guess.factor})
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
        numbers = [entry[k] for k in keys & {"factor", "value"}]
        good = keys in ({"column"}, {"column", "factor"}, {"value"})
        if target not in known or not good or not all(_is_real(n) for n in numbers):
            raise LogError(
                f"{path}: [{kind}] {target}: must be one of our columns with "
                '{ column = "name in the file", factor = 1.0 } or { value = 0.0 }; correct it.'
            )
        mapping[target] = Source(
            entry.get("column"), float(entry.get("factor", 1)), entry.get("value")
        )
    return mapping


def _is_real(number: object) -> bool:
    return isinstance(number, int | float) and math.isfinite(number)


def read_mapped(
    path: Path,
    known: frozenset[str],
    mapping: Mapping | None,
    rename: dict[str, str],
    flips: frozenset[str],
) -> Table:
    """A table under our names and in our units.

    Args:
        path: CSV, `.gz` too.
        known: all columns that have a meaning.
        mapping: what a person decided; None: names that say all, and `rename`.
        rename: column in the file to ours, which may have another unit (`yaw=theta_deg`).
        flips: our columns that are to change their sign.

    Raises:
        LogError: as read_table; a column of the mapping is not there, or one looks like ours and
            has no unit.
    """
    table = read_table(path, rename, known)
    if mapping is None:
        guesses = explain(table, known)
        unsure = [g for g in guesses if not g.sure and g.column]
        if unsure:
            g = unsure[0]
            raise LogError(
                f"{table.name}: column '{g.column}' has no unit ({g.why}); say what it is with "
                f"--rename {g.column}={g.targets[0]} (or _mm, _deg, _ms ...), or let "
                "--explain-columns FILE write down all columns and give that to --mapping."
            )
        mapping = mapping_of(guesses)
    gone = [s.column for s in mapping.values() if s.column and s.column not in table.header]
    if gone:
        raise LogError(
            f"{table.name}: the mapping names column '{gone[0]}', but the file has "
            f"{', '.join(table.header)}; correct the mapping."
        )
    return table.under(mapping, flips)
