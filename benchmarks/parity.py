# SPDX-License-Identifier: Apache-2.0
"""Swarms run here and in swarmsim 1.2.5 from equal starts, judged by equal metrics.

    python3.12 -m venv other && other/bin/pip install swarmsim==1.2.5
    .venv/bin/python benchmarks/parity.py --other other/bin/python --runs 200

Its package has no scenarios; their numbers are of its repositories' files: turbopi-milling (paper),
and the defenders of farptest (two bits: another defender, the goal).
"""

import argparse
import json
import math
import os
import subprocess
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import lcm
import numpy as np
import turbopi
import twinmill_native as native

from twinmill.swarm.classes import interval
from twinmill.swarm.metrics import STEP_S, body_velocity

ROOT = Path(__file__).resolve().parents[1]
TWIN_RUN = ROOT / "build/bin/twin_run"
ROBOTS, RADIUS_M, DURATION_S, JUDGED_S = 6, 0.1, 60.0, 10.0
BLUE = "all,40,100,180,230,80,125"  # limits of the colour "blue", and of no other
THETA_RAD = 0.45  # farptest/world.yaml: half a cone
SPEED_MPS, TURN_RADPS = 0.3, 0.6  # its SPEED_LIMIT and TURN_LIMIT


def bit(range_m: float, half_rad: float, axis_rad: float = 0.0, team: str = "blue") -> dict:
    """One sensor of swarmsim."""
    return {"range_m": range_m, "half_rad": half_rad, "axis_rad": axis_rad, "team": team}


def turning(*signs: float) -> list[list[float]]:
    """Rows at full speed that turn to these sides."""
    return [[SPEED_MPS, sign * TURN_RADPS] for sign in signs]


MILL = {"bits": [bit(1.1, math.radians(24.5))], "rows": [[0.25, -math.pi / 4], [0.25, math.pi / 4]]}
HALVES = {
    "bits": [bit(1.0, THETA_RAD / 2, side * THETA_RAD / 2) for side in (1, -1)],
    "rows": turning(1, -1, 0.5, -0.5),
    "sees": ["left", "right"],
}
# In swarmsim a disc is within range if its centre is, here if its rim is: the same at 1 m more.
DEFENDERS = {
    "bits": [bit(1.0, THETA_RAD), bit(2.0, THETA_RAD, team="goal")],
    "rows": turning(1, -1, -1, -1),
    "sees": ["all", BLUE],
    "goal": {"at_m": [0.0, 0.0], "radius_m": 1.0},
}
SCENARIOS = {
    "milling, one bit": MILL,
    "two halves, two bits": HALVES,
    "farptest's defenders, two bits": DEFENDERS,
    "the same, who see what they stand in": DEFENDERS | {"inside": True},
}


def model_text(scenario: dict) -> str:
    """The paper's robot with this scenario's cone and bodies; it acts on what it saw a step ago."""
    text = Path(native.find_model_file("paper.toml")).read_text()
    (first, *_) = scenario["bits"]
    cone_rad = 2 * first["half_rad"] * len({b["axis_rad"] for b in scenario["bits"]})
    values = {
        "body_radius_m": RADIUS_M,
        "speed_per_input_mps": max(abs(v) for v, _ in scenario["rows"]) / 100,
        "turn_per_input_radps": max(abs(w) for _, w in scenario["rows"]),
        "control_period_s": STEP_S,
        "range_m": first["range_m"],
        "cone_rad": cone_rad,
        "target_radius_m": RADIUS_M,
        "theta_a1_std": 0,
        "theta_a2_std": 0,
    }
    lines = [line for line in text.splitlines() if line.split(" =")[0].strip() not in values]
    for section, names in {
        "robot": ["body_radius_m"],
        "base": ["speed_per_input_mps", "turn_per_input_radps", "control_period_s"],
        "sensor": ["range_m", "cone_rad", "target_radius_m"],
        "idiosyncrasy": ["theta_a1_std", "theta_a2_std"],
    }.items():
        at = lines.index(f"[{section}]") + 1
        lines[at:at] = [f"{name} = {values[name]!r}" for name in names]
    at = lines.index("[sensor]") + 1
    lines[at:at] = [f"delay_s = {STEP_S}"]
    if "sees" in scenario:
        lines[at:at] = [f"bits = {json.dumps(scenario['sees'])}"]
    return "\n".join(lines) + "\n"


def table_text(scenario: dict) -> str:
    """The rows as the firmware takes them."""
    fastest = max(abs(v) for v, _ in scenario["rows"])
    sharpest = max(abs(w) for _, w in scenario["rows"])
    return ",".join(f"{100 * v / fastest:g},{w / sharpest:g}" for v, w in scenario["rows"])


def run_here(folder: Path, scenario: dict, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) starts and (T, n, 3) last poses of one run of `twin_run`, as they truly were."""
    log = folder / f"{seed}.lcmlog"
    words = ["--plant", "planar", "--model", folder / "m.toml", "--behaviors", folder / "b.toml"]
    words += ["--behavior", "rows", "--n", ROBOTS, "--start", "square", "--seed", seed]
    words += ["--duration-s", DURATION_S, "--pose-rate-hz", 1 / STEP_S, "--log", log, "--json"]
    if "goal" in scenario:
        words += ["--world", folder / "world.toml"]
    subprocess.run([TWIN_RUN, *map(str, words)], check=True, capture_output=True)
    rows: dict[int, list[tuple[float, float, float]]] = {}
    for event in lcm.EventLog(str(log), "r"):
        if event.channel.startswith("TWIN_TRUTH_"):
            m = turbopi.truth_t.decode(event.data)
            rows.setdefault(m.utime_us, []).append((m.x_m, m.y_m, m.theta_rad))
    os.unlink(log)
    poses = np.array([rows[at] for at in sorted(rows)])
    return poses[0], poses[-round(JUDGED_S / STEP_S) :]


def judged(poses: np.ndarray, range_m: float) -> tuple[str, np.ndarray]:
    """Class and mean metrics of (T, n, 3) poses."""
    poses = poses.copy()
    poses[..., 2] = np.unwrap(poses[..., 2], axis=0)
    values = native.measure(
        np.ascontiguousarray(poses), body_velocity(poses), poses.shape[1], range_m, RADIUS_M
    )
    mean = values.mean(axis=0)
    return native.classify(np.ascontiguousarray(mean[None]))[0], mean


def compare(name: str, scenario: dict, other: str, runs: int) -> dict:
    """Both simulators' runs of one scenario."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "m.toml").write_text(model_text(scenario))
        (folder / "b.toml").write_text(f'rows = "{table_text(scenario)}"\n')
        if goal := scenario.get("goal"):
            (folder / "world.toml").write_text(
                f'[[body]]\nname = "goal"\nat_m = {goal["at_m"]}\nradius_m = {goal["radius_m"]}\n'
                'colour = "blue"\nsolid = false\n'
            )
        with ThreadPoolExecutor(2) as pool:
            done = list(pool.map(lambda seed: run_here(folder, scenario, seed), range(runs)))
        starts, here = (np.array(part) for part in zip(*done, strict=True))
        np.savez(folder / "starts.npz", starts=starts)
        request = {**scenario, "step_s": STEP_S, "duration_s": DURATION_S, "judged_s": JUDGED_S}
        program = Path(__file__).with_name("swarmsim_worlds.py")
        subprocess.run(
            [other, program, folder / "starts.npz", folder / "paths.npz"],
            input=json.dumps({**request, "radius_m": RADIUS_M}),
            text=True,
            check=True,
            env={**os.environ, "SDL_VIDEODRIVER": "dummy", "PYTHONPATH": ""},
            stdout=subprocess.DEVNULL,
        )
        there = np.load(folder / "paths.npz")["poses"]
    range_m = scenario["bits"][0]["range_m"]
    return {
        "scenario": name,
        "runs": runs,
        **{
            where: _summary([judged(run, range_m) for run in poses])
            for where, poses in (("here", here), ("there", there))
        },
    }


def _summary(runs: list[tuple[str, np.ndarray]]) -> dict:
    classes = Counter(name for name, _ in runs)
    means = np.array([mean for _, mean in runs])
    medians = {
        metric: [float(q) for q in np.nanquantile(means[:, k], (0.25, 0.5, 0.75))]
        for k, metric in enumerate(native.METRICS)
        if metric in ("circliness", "radius_m", "rotation", "groups")
    }
    return {"classes": dict(classes.most_common()), "quartiles": medians}


def _line(found: dict) -> str:
    lines = [f"{found['scenario']}, {found['runs']} runs"]
    names = sorted({*found["here"]["classes"], *found["there"]["classes"]})
    for name in names:
        counts = [found[where]["classes"].get(name, 0) for where in ("here", "there")]
        low_high = [interval(count, found["runs"]) for count in counts]
        shown = [
            f"{100 * count / found['runs']:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
            for count, (low, high) in zip(counts, low_high, strict=True)
        ]
        lines.append(f"  {name:12} here {shown[0]:20} there {shown[1]}")
    for metric in found["here"]["quartiles"]:
        shown = [found[where]["quartiles"][metric] for where in ("here", "there")]
        here, there = (f"{q[1]:.3f} ({q[0]:.3f} to {q[2]:.3f})" for q in shown)
        lines.append(f"  {metric:12} here {here:26} there {there}")
    return "\n".join(lines)


def main() -> None:
    """Prints what agrees."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--other", required=True, help="Python that has swarmsim 1.2.5")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--only", default="", help="scenarios whose names have this in them")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    for name, scenario in SCENARIOS.items():
        if given.only not in name:
            continue
        found = compare(name, scenario, given.other, given.runs)
        print(json.dumps(found) if given.json else _line(found), flush=True)


if __name__ == "__main__":
    main()
