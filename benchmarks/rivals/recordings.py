# SPDX-License-Identifier: Apache-2.0
"""Recordings whose answer is known: a plant of other writers, and a real robot with three wheels.

Where each came from, and how its answer is known, stands in the README beside it.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rivals.protocol import Answer, Problem
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.measurement import load_measurements
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile
from twinmill_lab.challenge.scoring import said

DATA = Path(os.environ.get("TWINMILL_DATA", Path(__file__).parents[2] / ".." / "shared" / "data"))
HIDDEN = {
    "a": "dead_zone",
    "b": "motor_lag",
    "c": "floor_tilt",
    "d": "marker_offset",
    "e": "",
    "f": "battery_sag",
}
ROUGH = """
[base]
duty_pct = [0, 12.5, 25, 37.5, 50, 75, 100]
wheel_speed_mps = [0, 0.05, 0.1, 0.15, 0.2, 0.28, 0.36]
"""
OMNI3 = """
[robot]
wheel_radius_m = 0.051
half_track_m = 0.195
[base]
drive = "wheel_speed"
wheels = "omni3"
motor_lag_s = 0
control_period_s = 0.04
"""


@dataclass(frozen=True)
class Recording:
    """A log, the model of its robot, and the effect that is known to be missing; "" if none is."""

    name: str
    effect: str
    problem: Problem


def recordings(out: Path) -> Iterator[Recording]:
    """All that are there; models and imported logs go to the folder.

    Raises:
        FileNotFoundError: with the reason, where they are not.
    """
    if not DATA.is_dir():
        raise FileNotFoundError(f"no recordings at {DATA}: set TWINMILL_DATA")
    out.mkdir(exist_ok=True)
    yield from _hidden_effects(out)
    yield from _omni3(out)


def told(recording: Recording, answer: Answer) -> tuple[str, bool]:
    """Answer in words, and True beside it if it is right."""
    names = list(answer.names)
    if answer.said:
        names = [" or ".join(sorted({f.effect, *f.group})) for f in said(answer.said)]
    on = answer.said["rest"]["depends_on"] if answer.said else list(answer.depends_on)
    if not answer.told:
        return "nothing", not recording.effect
    words = " + ".join(names) or (f"on {', '.join(on[:2])}" if on else "something")
    return words, bool(names) and recording.effect in names[0].split(" or ")


def _hidden_effects(out: Path) -> Iterator[Recording]:
    folder, base = DATA / "hidden_effects", out / "hidden_effects.toml"
    if not base.exists():
        rough = out / "rough.toml"
        rough.write_text(ROUGH)
        logs = load_measurements([folder / "calibration.lcmlog"])
        fit(logs, ModelFile.load(str(rough)), base, "twinmill fit")
    for case, effect in HIDDEN.items():
        problem = Problem(folder / f"case_{case}.lcmlog", base)
        yield Recording(f"hidden_effects, {case}", effect, problem)


def _omni3(out: Path) -> Iterator[Recording]:
    for run in range(1, 6):
        log, base = out / f"omni3_{run}.lcmlog", out / f"omni3_{run}.toml"
        if not base.exists():
            stem = DATA / "omni3_joystick" / f"run-{run:02d}"
            files = [stem.with_name(f"{stem.name}_{kind}.csv.gz") for kind in ("poses", "commands")]
            log.unlink(missing_ok=True)
            import_log(*files, log, options=ImportOptions(robot_id=1, same_clock=True))
            base.write_text(OMNI3 + _noise(log, out / "sheet.toml"))
        yield Recording(f"omni3_joystick, run {run}", "marker_offset", Problem(log, base))


def _noise(log: Path, sheet: Path) -> str:
    """A table of the noise that a log has, which a rival may ask of the model."""
    sheet.write_text(OMNI3)
    found = compare(load_measurements([log]), ModelFile.load(str(sheet)))
    noise = found.robots[0].modelled.noise.to_json()
    return "\n".join(["[noise]", *(f"{k} = {v}" for k, v in noise.items())]) + "\n"
