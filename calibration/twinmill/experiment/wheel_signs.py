# SPDX-License-Identifier: Apache-2.0
"""One wheel, or one velocity, at a time: the script of it, and what the poses say came of each.

Turned alone, each wheel takes the body another way: which wheel it was and which way it turned
follow from the signs of three speeds (Lynch and Park 2017, section 13.2.1). Plain wheels of one
side do the same, and often have one motor: they are turned together.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.checks import InputFinding, check_tracks
from twinmill.data.checks.commands import body_by_command
from twinmill.data.checks.motion import Motion
from twinmill.data.checks.words import COLUMNS
from twinmill.data.log import CommandKind, LogError, RobotLog
from twinmill.data.track import Track, command_at, make_track

DRIVEN_S, STILL_S = 2.0, 1.5
RIM_MPS, TURN_RADPS = 0.15, 0.6  # of wheels that are told speeds, of bodies that are told theirs
MARGIN_S = 0.4  # after each change: clocks, lag
FEWEST = 3  # velocities in which one column was driven
STANDS = 0.1  # of what the fastest does: this column moves nothing
SIDES = {"left": (0, 2), "right": (1, 3)}  # places of the columns of plain wheels
LIKE = 0.7  # cosine, below which a direction is that of no column
AS_GOOD = 0.1  # cosine that another column must gain: front and rear may do the same


@dataclass(frozen=True)
class Column:
    """Reaction of the robot to one column of commands, or to those of one side, driven forward.

    Attributes:
        name: of the column; of a side as `import` takes it.
        body: (3,) forward m/s, left m/s, turn rad/s; NaN where it was not driven alone.
        like: the column that does this by the model; empty if it stood, or none does.
        sign: -1 where it went backward.
        stood: nothing moved.
    """

    name: str
    body: np.ndarray
    like: str
    sign: int
    stood: bool

    @property
    def right(self) -> bool:
        """It does what it should."""
        return self.like == self.name and self.sign > 0

    @property
    def driven(self) -> bool:
        """It was driven alone for long enough to tell."""
        return bool(np.isfinite(self.body).all())

    @property
    def verdict(self) -> str:
        """Effect of the column in words."""
        if not self.driven:
            return "was not driven alone"
        if self.stood:
            return "stands"
        if not self.like:
            return "goes as no wheel does"
        backward = " backward" if self.sign < 0 else ""
        return "right" if self.right else f"goes as {self.like}{backward}"

    def to_json(self) -> dict[str, Any]:
        """The interface's object."""
        speeds = zip(("forward_mps", "left_mps", "turn_radps"), self.body, strict=True)
        return {
            "name": self.name,
            "does": self.like or None,
            "sign": self.sign,
            "stands": self.stood,
            "right": self.right,
            **dict(speeds),
        }


@dataclass(frozen=True)
class WheelSigns:
    """Columns of one robot, and mistakes of signs, cables and axes that explain them all."""

    robot_id: int
    columns: list[Column]
    findings: list[InputFinding]

    @property
    def right(self) -> bool:
        """Every column was driven alone and did what it should."""
        return all(c.right for c in self.columns) and not any(f.fatal for f in self.findings)

    def to_json(self) -> dict[str, Any]:
        """The interface's object."""
        return {
            "robot_id": self.robot_id,
            "right": self.right,
            "columns": [column.to_json() for column in self.columns],
            "input": [finding.to_json() for finding in self.findings],
        }


def drive_of(model: native.Model) -> CommandKind:
    """Kind of the commands that a model's robot takes."""
    return next(k for k in COLUMNS if k == model.drive)


def columns_that_act(model: native.Model, kind: CommandKind) -> dict[str, tuple[int, ...]]:
    """Columns of commands that move this robot, by name; plain wheels as sides.

    Raises:
        ValueError: the model is driven by another kind of command.
    """
    body = body_by_command(model, kind)
    if body is None:
        raise ValueError(
            f"commands: are of kind {kind}, and the model is driven by {model.drive}; take a model "
            "of this robot."
        )
    if model.wheel_kind == "differential" and kind != "twist":
        unit = COLUMNS[kind][0].partition("_")[2]
        return {f"{side}_{unit}": places for side, places in SIDES.items()}
    places = [k for k in range(4) if np.any(body[:, k])]
    if model.wheel_kind == "differential":  # told to go sideways, it stays
        places = [0, 2]
    return {COLUMNS[kind][k]: (k,) for k in places}


def script(model: native.Model, duty_pct: int) -> tuple[list[str], np.ndarray]:
    """Names of the columns and (K, 1 + C) rows, t_s first: each column forth, still, back, still.

    Raises:
        ValueError: the robot steers, so that no column alone tells how it turns.
    """
    if model.wheel_kind == "ackermann":
        raise ValueError(
            "wheels: this robot steers; drive a curve to the left and see that it goes there."
        )
    kind = drive_of(model)
    names = [name for name in COLUMNS[kind] if name]
    if kind == "twist":
        size = np.array([RIM_MPS, RIM_MPS, TURN_RADPS])
    else:
        rim_radps = round(RIM_MPS / model.get("robot.wheel_radius_m"), 2)
        size = np.full(4, rim_radps if kind == "wheel_speed" else float(duty_pct))
    rows, t_s = [np.zeros(1 + len(names))], 1.0
    for places in columns_that_act(model, kind).values():
        for sign in (1, -1):
            value = np.where(np.isin(np.arange(len(names)), places), sign * size, 0.0)
            rows += [np.array([t_s, *value]), np.array([t_s + DRIVEN_S, *np.zeros(len(names))])]
            t_s += DRIVEN_S + STILL_S
    rows.append(np.array([t_s, *np.zeros(len(names))]))
    return names, np.array(rows)


def csv_text(names: list[str], rows: np.ndarray) -> str:
    """The script as a table: t_s and the columns, each row held until the next."""
    lines = [",".join(f"{value:g}" for value in row + 0.0) for row in rows]
    return "\n".join([",".join(["t_s", *names]), *lines, ""])


def read_signs(robot: RobotLog, model: native.Model, label: str) -> WheelSigns:
    """Sign of each column, told by the poses.

    Args:
        robot: a log in which columns of the commands were driven one at a time.
        model: of the robot: its kind of wheels and of commands.
        label: the log's name.

    Raises:
        LogError: no column was driven alone, the heading was not recorded, or the model is driven
            by another kind of command.
    """
    track = make_track(robot)
    body = body_by_command(model, track.command_kind)
    if body is None:
        raise LogError(
            f"{label}: the commands are {track.command_kind}, the model is driven by "
            f"{model.drive}; take a model of this robot."
        )
    if not track.has_heading:
        raise LogError(f"{label}: has no heading, which tells the wheels apart; record it.")
    used = columns_that_act(model, track.command_kind)
    did = _responses(track, list(used.values()))
    if np.isnan(did).all():
        raise LogError(
            f"{label}: no command was alone for {2 * MARGIN_S + 0.5:.1f} s; play the script that "
            "`twinmill robot wheels -o wheels.csv` writes."
        )
    wanted = np.column_stack([body[:, places].sum(axis=1) for places in used.values()])
    columns = _named(list(used), wanted, did, track.command_kind)
    return WheelSigns(robot.robot_id, columns, check_tracks([(label, track)], model))


def _responses(track: Track, used: list[tuple[int, ...]]) -> np.ndarray:
    """(3, C) mean velocity of the body while some columns alone are driven, by their sign."""
    motion = Motion.of(track)
    at_s = motion.t_s[:, None] + np.linspace(-MARGIN_S, MARGIN_S, 9)
    told = command_at(at_s.ravel(), track.command_t_s, track.command).reshape(*at_s.shape, -1)
    same = (told == told[:, :1]).all(axis=(1, 2))
    told, body = told[:, 4], motion.body_mps()
    speeds = np.column_stack([body.real, body.imag, motion.turn_radps])
    did = np.full((3, len(used)), np.nan)
    for k, places in enumerate(used):
        own = told[:, places]
        alone = same & (own != 0).all(axis=1) & (own == own[:, :1]).all(axis=1)
        alone &= np.count_nonzero(told, axis=1) == len(places)
        if np.count_nonzero(alone) >= FEWEST:
            did[:, k] = np.mean(np.sign(own[alone, :1]) * speeds[alone], axis=0)
    return did


def _named(
    names: list[str], wanted: np.ndarray, did: np.ndarray, kind: CommandKind
) -> list[Column]:
    """Each column by the direction that is nearest to what it did."""
    forward, turn = np.abs(wanted[0]).max(), np.abs(wanted[2]).max()
    weight = np.array([[1.0], [1.0], [0.2 if kind == "twist" else forward / turn]])
    size = np.linalg.norm(weight * did, axis=0)
    unit = weight * did / np.maximum(size, 1e-9)
    known = weight * wanted / np.linalg.norm(weight * wanted, axis=0)
    columns = []
    for k, name in enumerate(names):
        cosine = known.T @ unit[:, k]
        best = int(np.argmax(np.abs(cosine)))
        if abs(cosine[k]) > abs(cosine[best]) - AS_GOOD:
            best = k
        stood = bool(size[k] < STANDS * np.nanmax(size))
        clear = abs(cosine[best]) > LIKE and not stood
        like, sign = (names[best], int(np.sign(cosine[best]))) if clear else ("", 1)
        columns.append(Column(name, did[:, k], like, sign, stood))
    return columns
