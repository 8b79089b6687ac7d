# SPDX-License-Identifier: Apache-2.0
"""How often `twinmill robot compare` is right: robots on many days, with and without a weak wheel.

Robots are drawn as in `twinmill lab challenge`, on formulas of their own. From day to day the
marker is mounted anew, the battery has another charge, clocks have another offset and the drive is
another one; speeds follow the battery's voltage. The model is the owner's data sheet, some percent
off.

    .venv/bin/python benchmarks/days.py 0-5 --out days.jsonl     # a line for each robot
    .venv/bin/python benchmarks/days.py 6-11 --out days.jsonl    # more of them, then or beside
    .venv/bin/python benchmarks/days.py --out days.jsonl         # the rates of all that is there
"""

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from twinmill.data.measurement import load_measurements
from twinmill.defaults import ALARM_RATE
from twinmill.estimation.opened import Opened
from twinmill.experiment.drives import drive
from twinmill.files import plain
from twinmill.model.model_file import ModelFile
from twinmill.runs.alarm import Alarm, alarm
from twinmill.runs.changes import kinds_of
from twinmill.runs.compare import may_alarm, open_run, second_half
from twinmill.runs.difference import Difference, difference
from twinmill.runs.reference import Day, day_of, steadier
from twinmill_lab.challenge.physics import Hidden, catalogue_forms
from twinmill_lab.challenge.robots import Robot, draw_robot
from twinmill_lab.challenge.run import Plan, play, write_log

HEALTHY = 19  # runs that calibrate the alarm, the first one included
TESTS, WEAK_TESTS = 12, 6  # of each robot
MARKER_M, MARKER_RAD = 0.01, 0.03  # standard deviations of a mounting by hand
CHARGE_V = (7.6, 8.4)  # of two cells at the start of a run
WEAKER = 0.03


@dataclass(frozen=True)
class Drawn:
    """A robot with what stays the same from day to day.

    Attributes:
        robot: as drawn.
        sag: how far its speeds follow the voltage; 0 where a controller keeps them.
        model: its owner's data sheet.
    """

    robot: Robot
    sag: float
    model: ModelFile


def draw(number: int, folder: Path) -> Drawn:
    """One of the robots; the same number gives the same robot."""
    random = np.random.default_rng([number, 0])
    robot = draw_robot(number, random)
    path = folder / "sheet.toml"
    path.write_text(robot.sheet(random))
    sag = float(random.uniform(0.6, 1.0)) if robot.drive == "duty" else 0.0
    return Drawn(robot, sag, ModelFile.load(str(path)))


def day(drawn: Drawn, random: np.random.Generator, duration_s: float, weak: str = "") -> Opened:
    """A run on some day, with the marker, the charge, the clock and the drive of that day.

    Args:
        drawn: who drives.
        random: of the day.
        duration_s: of the run, about.
        weak: name that its model has for the wheel that is weaker; of two to a side both are.
    """
    robot = drawn.robot
    forms = {h.name: h for h in catalogue_forms(robot, random) if h.kind == "plain"}
    offset_s = 0.0 if robot.same_clock else float(random.uniform(-0.15, 0.15))
    legs = drive("mixed", duration_s * random.uniform(0.8, 1.2), robot.sideways, random)
    plan = Plan(
        replace(robot, offset_s=offset_s),
        legs,
        int(random.integers(2**31)),
        full_V=float(random.uniform(*CHARGE_V)),
    )
    x_m, y_m = (float(v) for v in random.normal(0, MARKER_M, 2))
    hidden = [_with(forms["marker_offset"], x_m=x_m, y_m=y_m)]
    if "heading_bias" in forms:
        hidden.append(_with(forms["heading_bias"], bias_rad=float(random.normal(0, MARKER_RAD))))
    if drawn.sag:
        hidden.append(_with(forms["battery_sag"], strength=drawn.sag))
    if weak:
        known = [w["name"] for w in drawn.model.model.wheels()]
        which = {known.index(weak)}
        if robot.wheels == "differential":
            which |= {known.index(weak) + 2}
        form = forms["wheel_gain"]
        gains = {name: -WEAKER * (k in which) for k, name in enumerate(form.values)}
        hidden.append(_with(form, **gains))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.lcmlog"
        write_log(plan, play(plan, hidden, forces=True), path)
        (run,) = load_measurements([path], drawn.model.model)
        return open_run(run, drawn.model)


def _with(form: Hidden, **values: float) -> Hidden:
    return replace(form, values=values)


def recorded(number: int, duration_s: float) -> dict:
    """Recordings of all runs of one robot: healthy ones, then those with a weak wheel."""
    with TemporaryDirectory() as folder:
        drawn = draw(number, Path(folder))
        random = np.random.default_rng([number, 1])
        first = day(drawn, random, duration_s)
        names = [w["name"] for w in first.model.wheels()]
        names = names[:2] if drawn.robot.wheels == "differential" else names
        has_wheels = drawn.robot.drive != "twist"
        weak = [str(random.choice(names)) for _ in range(WEAK_TESTS * has_wheels)]
        days = []
        for k, wheel in enumerate([""] * (HEALTHY - 1 + TESTS) + weak):
            second = day(drawn, random, duration_s, wheel)
            pieces = {"whole": second}
            if k >= HEALTHY - 1:  # only a run in question is looked at by halves
                pieces["half"] = second_half(second)
            pairs = {name: difference(first, run) for name, run in pieces.items()}
            keys = may_alarm(pairs["whole"], first.one_clock)
            pairs["precise"] = pairs["whole"].precise()
            told = {name: _both_days(pair.only(keys)) for name, pair in pairs.items()}
            days.append({"weak": wheel, **told})
    robot = drawn.robot
    return {
        "robot": number,
        "plant": robot.plant,
        "drive": robot.drive,
        "wheels": robot.wheels,
        "duration_s": duration_s,
        "keys": keys,
        "runs": days,
    }


def _both_days(pair: Difference) -> list[dict]:
    return [plain(vars(day_of(pair, k))) for k in (0, 1)]


def examined(line: dict) -> list[dict]:
    """Each test run of a robot against the first run, and against all its healthy runs."""
    with TemporaryDirectory() as folder:
        model = draw(line["robot"], Path(folder)).model.model
    kinds = kinds_of(model, line["keys"])
    healthy = line["runs"][: HEALTHY - 1]
    told = []
    for run in line["runs"][HEALTHY - 1 :]:
        pieces = [[_day(d) for d in run[piece]] for piece in ("whole", "half")]
        alone = (alarm(days, kinds, ALARM_RATE, len(pieces)) for days in pieces)
        choices = [
            [_day(run[way][0]), *(_day(other[way][1]) for other in (*healthy, run))]
            for way in ("whole", "precise")
        ]
        for found, calibrated in (
            (min(alone, key=lambda a: a.p_errors), False),
            (alarm(steadier(choices, kinds), kinds, ALARM_RATE), True),
        ):
            told.append(_told(found, run["weak"], line["wheels"]) | {"calibrated": calibrated})
    return told


def _day(told: dict) -> Day:
    arrays = {k: np.array(v) if isinstance(v, list) else v for k, v in told.items()}
    return Day(**arrays)


def _told(found: Alarm, wheel: str, wheels: str) -> dict:
    sides = {"fl": "wheels.left", "fr": "wheels.right"} if wheels == "differential" else {}
    true = sides.get(wheel, f"wheel.{wheel}")
    own = next((c for c, _ in found.found if c.kind.key == true), None)
    return {
        "weak": wheel,
        "changed": bool(found.found),
        "named": bool(found.found) and found.found[0][0].kind.key == true,
        "rival": any(r.kind.key == true for _, rest in found.found for r in rest),
        "covered": own and bool(own.interval[0] <= -WEAKER <= own.interval[1]),
    }


def rates(tests: list[dict]) -> list[str]:
    """Rates of alarms and misses, in sentences."""
    told = []
    for calibrated in (False, True):
        same = [t for t in tests if t["calibrated"] == calibrated]
        still, weak = [t for t in same if not t["weak"]], [t for t in same if t["weak"]]
        covered = [t["covered"] for t in weak if t["covered"] is not None]
        how = f"{HEALTHY} healthy runs" if calibrated else "two runs alone"
        told.append(
            f"{how}: {sum(t['changed'] for t in still)} false alarms in {len(still)}; of "
            f"{len(weak)} weak wheels {sum(t['changed'] for t in weak)} noticed, "
            f"{sum(t['named'] for t in weak)} named, "
            f"{sum(t['named'] or t['rival'] for t in weak)} named first or as a rival; "
            f"{sum(covered)} of {len(covered)} intervals cover the truth"
        )
    return told


def main() -> None:
    """Adds lines to the file, and prints what all its lines tell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("robots", nargs="?", help="numbers, as 0-5; none: only the rates")
    parser.add_argument("--out", type=Path, default=Path("days.jsonl"))
    parser.add_argument("--duration-s", type=float, default=90.0)
    options = parser.parse_args()
    if options.robots:
        first, _, last = options.robots.partition("-")
        for number in range(int(first), int(last or first) + 1):
            with threadpool_limits(1, "blas"):
                line = recorded(number, options.duration_s)
            with options.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
    lines = [json.loads(line) for line in options.out.read_text().splitlines()]
    by_robot = [examined(line) for line in lines]
    for line, tests in zip(lines, by_robot, strict=True):
        print(line["robot"], line["plant"], line["drive"], line["wheels"], *rates(tests), sep="; ")
    print(*rates([t for tests in by_robot for t in tests]), sep="\n")


if __name__ == "__main__":
    main()
