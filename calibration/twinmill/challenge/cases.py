# SPDX-License-Identifier: Apache-2.0
"""Draws what is hidden, and lets the twin make the logs."""

import json
import subprocess
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from twinmill.diagnosis.candidates import STAGES
from twinmill.model.freedom import catalogue

KINDS = ("none", "one", "one", "two", "outside")
STRENGTHS = {"weak": 0.4, "medium": 1.0, "strong": 2.5}  # times the effect's default
PLANTS = ("planar", "mujoco")
# A clock offset and a delay are one thing to a log; a formula is for cases outside the catalogue.
NOT_DRAWN = ("clock_offset", "clock_rate", "equation")
# Outside the catalogue: effects that diagnosis is not told of, and formulas that it cannot know.
WITHHELD = (
    "carpet_grain",
    "gain_slope",
    "reversal_dead_time",
    "reverse_asymmetry",
    "slew_limit",
    "turn_asymmetry",
    "wheel_eccentricity",
)
# A formula is a quantity that it adds to, times a carrier, times what modulates it. Sizes are what
# a script of many drives gives them, so that a usual formula adds USUAL to the velocity.
USUAL = {"vx_mps": 0.012, "vy_mps": 0.012, "omega_radps": 0.07}
CARRIERS = {"vx": 0.2, "vy": 0.2, "omega": 1.2, "moves": 1.0}
MODULATORS = {
    "abs(vx)": 0.2, "abs(vy)": 0.2, "abs(omega)": 1.2, "vx": 0.2, "vy": 0.2, "omega": 1.2,
    "sin(theta + {phase})": 0.7, "sin(2*theta + {phase})": 0.7, "sin(3*theta + {phase})": 0.7,
    "(x*{part} + y*{rest})": 0.4, "sin(t/{slow} + {phase})": 0.7,
}  # fmt: skip
DUTY_PCT = [0, 12.5, 25, 37.5, 50, 75, 100]
ROBOT = f"""
[base]
duty_pct = {DUTY_PCT}
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
"""
CLOCK = """
[clock]
offset_s = -0.06
"""


@dataclass(frozen=True)
class Hidden:
    """One hidden effect."""

    effect: str
    parameters: dict[str, float]
    texts: dict[str, str]

    @property
    def label(self) -> str:
        """Its name, or its formula."""
        return " += ".join(self.texts.values()) or self.effect


@dataclass(frozen=True)
class Case:
    """One sealed log: which plant makes it, and what is hidden in it.

    Attributes:
        noise_seed: of the twin; other cases and other seeds of the challenge have other noise.
        withheld: effects that diagnosis is not told of.
    """

    number: int
    noise_seed: int
    plant: str
    kind: str
    strength: str
    hidden: tuple[Hidden, ...] = ()
    withheld: tuple[str, ...] = ()


def draw(number: int, seed: int, known: dict[str, Collection[str]]) -> Case:
    """Draws a case; the same numbers give the same case.

    Args:
        number: of the case.
        seed: of all cases.
        known: per plant the effects that its base model has already: they are not hidden again.
    """
    random = np.random.default_rng([seed, number])
    noise_seed = noise_seed_of(number, seed)
    plant, kind = PLANTS[number // len(KINDS) % len(PLANTS)], KINDS[number % len(KINDS)]
    strength = str(random.choice(list(STRENGTHS)))
    if kind == "none":
        return Case(number, noise_seed, plant, kind, strength)
    if kind == "outside" and random.random() < 0.5:
        hidden = (_formula(STRENGTHS[strength], random),)
        return Case(number, noise_seed, plant, kind, strength, hidden)
    entries = {n: e for n, e in catalogue().items() if _drawable(e) and n not in known[plant]}
    names = sorted(set(WITHHELD) & set(entries)) if kind == "outside" else sorted(entries)
    drawn = random.choice(names, 2 if kind == "two" else 1, replace=False)
    hidden = tuple(
        Hidden(str(n), _parameters(entries[n], STRENGTHS[strength], random), {}) for n in drawn
    )
    withheld = tuple(h.effect for h in hidden) if kind == "outside" else ()
    return Case(number, noise_seed, plant, kind, strength, hidden, withheld)


def noise_seed_of(number: int, seed: int) -> int:
    """The twin's seed for one log of one challenge."""
    return seed * 1_000_000 + number


def make_log(program: Path, folder: Path, name: str, case: Case, script: Path) -> Path:
    """Lets the twin drive the script with what is hidden, and returns the log.

    Raises:
        ValueError: the twin failed; its own sentence.
    """
    model, log = folder / f"{name}.hidden.toml", folder / f"{name}.lcmlog"
    model.write_text(ROBOT + CLOCK + "".join(map(_table, case.hidden)))
    command = [
        program, "--plant", case.plant, "--model", model, "--n", "1", "--seed", case.noise_seed,
        "--script", script, "--log", log,
    ]  # fmt: skip
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    model.unlink()
    if done.returncode:
        raise ValueError(f"{program}: {done.stderr.strip() or 'failed'}")
    return log


def seal(cases: list[Case]) -> str:
    """The answers as text, whose hash is shown before anything is diagnosed."""
    return json.dumps([asdict(c) for c in cases], indent=1, sort_keys=True)


def _drawable(entry: dict) -> bool:
    return bool(entry["parameters"]) and entry["stage"] in STAGES and entry["name"] not in NOT_DRAWN


def _formula(strength: float, random: np.random.Generator) -> Hidden:
    """A product drawn at random; it may resemble an effect of the catalogue by chance."""
    adds_to, carrier, modulator = (
        str(random.choice(list(d))) for d in (USUAL, CARRIERS, MODULATORS)
    )
    size = CARRIERS[carrier] * MODULATORS[modulator]
    phase, turned, slow = random.uniform(0, 2 * np.pi, 3)
    shape = modulator.format(
        phase=f"{phase:.2f}",
        part=f"{np.cos(turned):.2f}",
        rest=f"{np.sin(turned):.2f}",
        slow=f"{5 + 5 * slow:.1f}",
    )
    p0 = USUAL[adds_to] / size * strength * random.uniform(0.8, 1.2) * random.choice([-1, 1])
    return Hidden(
        "equation", {"p0": float(p0)}, {"adds_to": adds_to, "formula": f"p0*{carrier}*{shape}"}
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


def _table(hidden: Hidden) -> str:
    values = {"name": hidden.effect, **hidden.texts, **hidden.parameters}
    return "\n[[effect]]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in values.items())
