# SPDX-License-Identifier: Apache-2.0
"""Draws what is hidden, of a size that shows, and makes the logs."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from twinmill.experiment.drives import STYLES, drive
from twinmill_lab.challenge.physics import STEP_S, Hidden, catalogue_forms, outside_forms, slow
from twinmill_lab.challenge.robots import KINDS, Robot, draw_robot
from twinmill_lab.challenge.run import Plan, path_of, play, write_log

CASES = ("none", "one", "cousin", "two", "outside", "one", "cousin", "none", "one", "outside")
AHEAD_S = 2.0
SIZES = (1.3, 6.0)  # floors that a hidden effect adds to the error at AHEAD_S
LEAST = 1.1
TIMING = (
    "motor_lag",
    "input_delay",
    "slew_limit",
    "acceleration_limit",
    "lag_by_duty",
    "coasting",
)
# Two effects of one of these families are not hidden together: a log seldom parts them.
FAMILIES = (
    TIMING,
    ("dead_zone", "speed_curve", "speed_slip", "coulomb_friction"),
    ("wheel_gain", "reverse_asymmetry"),
    ("battery_sag", "heat_gain", "abrupt_loss", "transient_loss"),
    ("floor_tilt", "carpet_grain", "floor_patch", "gain_slope"),
    ("yaw_lever", "turn_asymmetry", "lateral_slip", "strafe_loss"),
    ("marker_offset", "heading_bias", "compass_deviation"),
)


@dataclass(frozen=True)
class Case:
    """One sealed log.

    Attributes:
        robot: number of the robot that drives.
        hidden: what is in it.
        adds_floors: for each, what it adds to the error at AHEAD_S over what noise does, once
            gains and lag have taken of it what they can.
    """

    number: int
    kind: str
    robot: int
    style: str
    plan: Plan
    hidden: tuple[Hidden, ...]
    adds_floors: tuple[float, ...]

    def to_json(self) -> dict:
        """Sealed answer to the case: every hidden effect with its sizes."""
        return {
            "case": self.number,
            "kind": self.kind,
            "plant": self.plan.robot.plant,
            "drive": self.plan.robot.drive,
            "wheels": self.plan.robot.wheels,
            "style": self.style,
            "hidden": [h.to_json() for h in self.hidden],
            "adds_floors": list(self.adds_floors),
        }


def draw_robots(seed: int) -> list[Robot]:
    """One of each of KINDS."""
    return [draw_robot(k, np.random.default_rng([seed, 0, k])) for k in range(len(KINDS))]


def calibration(robot: Robot, seed: int, duration_s: float) -> Plan:
    """A drive of the robot as it normally is."""
    random = np.random.default_rng([seed, 1])
    return Plan(
        robot, drive("mixed", duration_s, robot.sideways, random), int(random.integers(2**31))
    )


def draw(number: int, seed: int, robots: Sequence[Robot], duration_s: float) -> Case:
    """Draws a case; the same numbers give the same case."""
    random = np.random.default_rng([seed, 2, number])
    kind = CASES[number % len(CASES)]
    which = (number + number // len(CASES)) % len(robots)
    robot = robots[which]
    while True:
        style = str(random.choice(STYLES))
        length_s = duration_s * random.uniform(0.7, 1.3)
        legs = drive(style, length_s, robot.sideways, random)
        plan = Plan(robot, legs, int(random.integers(2**31)))
        drawn = _hidden(kind, plan, random)
        if drawn is not None:
            hidden, adds = drawn
            return Case(
                number=number,
                kind=kind,
                robot=which,
                style=style,
                plan=plan,
                hidden=hidden,
                adds_floors=adds,
            )


def make_log(case: Case, path: Path) -> None:
    """Plays the case on its plant and writes what would have been recorded."""
    write_log(case.plan, play(case.plan, case.hidden, forces=True), path)


def seal(cases: list[Case]) -> str:
    """The answers as text, whose hash is shown before anything is diagnosed."""
    robots = [asdict(case.plan.robot) for case in cases]
    answers = [c.to_json() | {"robot": r} for c, r in zip(cases, robots, strict=True)]
    return json.dumps(answers, indent=1, sort_keys=True)


def _hidden(kind: str, plan: Plan, random: np.random.Generator):
    """Draws hidden effects and their sizes; None if the drawn ones cannot show in this drive."""
    if kind == "none":
        return (), ()
    robot = plan.robot
    known = catalogue_forms(robot, random)
    pool = {
        "one": [h for h in known if h.kind == "plain"],
        "cousin": [h for h in known if h.kind == "cousin"],
        "two": [h for h in known if h.kind == "plain"],
        "outside": outside_forms(robot, random),
    }[kind]
    chosen = [pool[random.integers(len(pool))]]
    if kind == "two":
        family = next((f for f in FAMILIES if chosen[0].name in f), ())
        others = [h for h in pool if h.name not in family and h.name != chosen[0].name]
        chosen.append(others[random.integers(len(others))])
    noise = Floors(plan)
    sized = [noise.sized(h, float(np.exp(random.uniform(*np.log(SIZES))))) for h in chosen]
    if any(adds < LEAST for _, adds in sized):
        return None
    return tuple(h for h, _ in sized), tuple(adds for _, adds in sized)


class Floors:
    """Errors that noise alone leaves in a plan, and those that a hidden effect adds to them."""

    def __init__(self, plan: Plan):
        self._plan = plan
        self._rest = _moves(play(plan, calm=True).pose)
        noisy = _moves(play(plan).pose) - self._rest
        sensor = np.array([plan.robot.sensor_m] * 2 + [plan.robot.sensor_rad])
        self._floor = np.sqrt((noisy**2).mean(axis=0) + 2 * sensor**2)
        self._base = self._taken_by_a_refit()

    def adds(self, hidden: Hidden) -> float:
        """RMS over forward, left and turn, in floors, without what a refit of the base takes."""
        moved = _moves(play(self._plan, [hidden], calm=True).pose) - self._rest
        whitened = (moved / self._floor).ravel()
        base = self._base[:, :-1] if hidden.name in TIMING else self._base
        taken = base @ np.linalg.lstsq(base, whitened, rcond=None)[0]
        return float(np.sqrt(np.mean((whitened - taken) ** 2)))

    def sized(self, hidden: Hidden, wanted: float) -> tuple[Hidden, float]:
        """Scales an effect towards the wanted size, as far as its parameters allow."""
        by, adds = 1.0, self.adds(hidden)
        for _ in range(4):
            if not hidden.grows or abs(adds / wanted - 1) < 0.1:
                break
            by = float(np.clip(by * np.clip(wanted / max(adds, 1e-3), 0.2, 5), 0.05, hidden.most))
            adds = self.adds(hidden.scaled(by))
        return hidden.scaled(by), adds

    def _taken_by_a_refit(self) -> np.ndarray:
        """(3 windows, 4) whitened changes for a little more of each gain, and of lag."""
        robot, motion = self._plan.robot, play(self._plan, calm=True)
        rim, to_body = motion.rim_mps, np.eye(3) if robot.drive == "twist" else robot.to_body.T
        columns = []
        for k in range(4):
            gains = np.array(robot.gains) * np.where(np.arange(3) == k, 1.02, 1)
            slower = slow(rim, 0.01) if k == 3 else rim
            columns.append(_moves(path_of(slower @ to_body * gains)) - self._rest)
        return np.column_stack([(c / self._floor).ravel() for c in columns])


def _moves(pose: np.ndarray) -> np.ndarray:
    """(M, 3) displacement over AHEAD_S in the frame of its start."""
    ahead = round(AHEAD_S / STEP_S)
    start, end = pose[:-ahead:150], pose[ahead::150]
    d = end - start
    c, s = np.cos(start[:, 2]), np.sin(start[:, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]])
