# SPDX-License-Identifier: Apache-2.0
"""Draws what is hidden, and lets the twin make the logs."""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from twinmill.calibration.diagnosis.candidates import STAGES
from twinmill.calibration.freedom import catalogue

KINDS = ("none", "one", "one", "two", "outside")
STRENGTHS = {"weak": 0.4, "medium": 1.0, "strong": 2.5}  # times the effect's default
PLANTS = ("planar", "mujoco")
# A clock offset and a delay are one thing to a log, and so is a lag of the base and one more.
BARRED = ("clock_offset", "clock_rate", "equation")
ROBOT = """
[base]
duty_pct = [0, 12.5, 25, 37.5, 50, 75, 100]
wheel_speed_mps = [0, 0.11, 0.18, 0.24, 0.28, 0.33, 0.37]
sideways_gain = 0.89
yaw_gain = 0.85
motor_lag_s = 0.09

[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
drive_mps = 0.003
drive_radps = 0.03
drive_s = 0.15
drive_turn_s = 0.15

[clock]
offset_s = -0.06
"""


@dataclass(frozen=True)
class Case:
    """One sealed log: which plant makes it, and what is hidden in it (name to parameters)."""

    number: int
    plant: str
    kind: str
    strength: str
    hidden: dict[str, dict[str, float]]


def draw(number: int, seed: int) -> Case:
    """Draws a case; the same numbers give the same case."""
    random = np.random.default_rng([seed, number])
    kind = KINDS[number % len(KINDS)]
    strength = str(random.choice(list(STRENGTHS)))
    entries = {n: e for n, e in catalogue().items() if _drawable(e)}
    count = {"none": 0, "two": 2}.get(kind, 1)
    names = random.choice(sorted(entries), count, replace=False) if count else []
    hidden = {str(n): _parameters(entries[n], STRENGTHS[strength], random) for n in names}
    return Case(number, PLANTS[number // len(KINDS) % 2], kind, strength, hidden)


def make_log(program: Path, folder: Path, name: str, case: Case, script: Path) -> Path:
    """Lets the twin drive the script with what is hidden, and returns the log.

    Raises:
        ValueError: the twin failed; its own sentence.
    """
    model, log = folder / f"{name}.hidden.toml", folder / f"{name}.lcmlog"
    model.write_text(ROBOT + "".join(_table(n, p) for n, p in case.hidden.items()))
    command = [
        program, "--plant", case.plant, "--model", model, "--n", "1", "--seed", 1 + case.number,
        "--script", script, "--log", log,
    ]  # fmt: skip
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(f"{program}: {done.stderr.strip() or 'failed'}")
    return log


def seal(cases: list[Case]) -> str:
    """The answers as text, whose hash is shown before anything is diagnosed."""
    return json.dumps([vars(c) for c in cases], indent=1, sort_keys=True)


def _drawable(entry: dict) -> bool:
    return (
        bool(entry["parameters"])
        and entry["stage"] in STAGES
        and entry["name"] not in BARRED
        and not entry["name"].startswith("view")
    )


def _parameters(entry: dict, strength: float, random: np.random.Generator) -> dict[str, float]:
    """Defaults moved away from neutral by the strength, with random signs where bounds allow."""
    values = {}
    for p in entry["parameters"]:
        reach = p["default"] - p["neutral"]
        if p["neutral"] == p["max"]:  # such as a deceleration, whose neutral is `at once`
            value = p["default"] / strength
        else:
            sign = random.choice([-1, 1]) if p["min"] < p["neutral"] else 1
            value = p["neutral"] + sign * strength * reach * random.uniform(0.8, 1.2)
        values[p["name"]] = float(np.clip(value, p["min"], p["max"]))
    return values


def _table(name: str, parameters: dict[str, float]) -> str:
    lines = "".join(f"{key} = {value!r}\n" for key, value in parameters.items())
    return f'\n[[effect]]\nname = "{name}"\n{lines}'
