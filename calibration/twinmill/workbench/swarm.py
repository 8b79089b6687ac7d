# SPDX-License-Identifier: Apache-2.0
"""Forecast of a swarm of robots with a model: the twin, from several starts, and its phases."""

import shlex
import subprocess
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.log import Log, read_log
from twinmill.programs import find_program
from twinmill.swarm.metrics import STEP_S, SwarmSeries, resample, swarm_metrics
from twinmill.swarm.request import run_part
from twinmill.swarm.sweep import make_request

STARTS = 10  # seeds
POSE_RATE_HZ = 20
LOG = "swarm.lcmlog"
EVERY = 2  # poses of which one is drawn
FACTORS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8)  # of speed and turn rate in the diagram
ALONE_S, SETTLED_S, APART_M = 15.0, 5.0, 1000.0  # to see how fast a robot is that sees nobody
DIAGRAM_STARTS = 5  # in each of its cells


def swarm_commands(model: str, options: Mapping[str, Any]) -> list[str]:
    """The first start as the workbench runs it, and its metrics."""
    run = ["twin_run", *_words(model, options, 1)]
    return [shlex.join(run), shlex.join(["twinmill", "swarm", "metrics", LOG, "--model", model])]


def _words(model: str, options: Mapping[str, Any], seed: int) -> list[str]:
    """Arguments of `twin_run`."""
    return [
        *("--plant", "planar", "--model", model, "--n", str(options["n"])),
        *("--behavior", options["behavior"], "--duration-s", f"{options['duration_s']:g}"),
        *("--seed", str(seed), "--pose-rate-hz", str(POSE_RATE_HZ), "--log", LOG),
    ]


def run_swarms(
    texts: Mapping[str, str], options: Mapping[str, Any], say: Callable[[str], None]
) -> dict[str, dict]:
    """Swarms of each model, from equal starts.

    Args:
        texts: of model files, by label.
        options: n, behavior, duration_s.
        say: told in words what is being done.

    Returns:
        By label: `classes` with their counts, `metrics` (means of the last 10 s over all starts),
        `speed_mps` and `turn_radps` of a robot that sees nobody,
        `t_s` (T,) and `pose` (T, n, 3) of the first start.

    Raises:
        ValueError: the twin refuses; its own sentence.
    """
    found = {}
    with TemporaryDirectory(prefix="twinmill-") as folder:
        for label, text in texts.items():
            place = Path(folder)
            (place / "model.toml").write_text(text)
            model = native.Model.from_toml(text, label)
            runs = []
            for seed in range(1, STARTS + 1):
                say(f"{label}: start {seed} of {STARTS}")
                runs.append(_run(place, model, options, seed))
            first = runs[0]
            found[label] = {
                "classes": dict(Counter(run.final for run in runs)),
                "metrics": dict(
                    zip(native.METRICS, np.mean([r.mean for r in runs], axis=0), strict=True)
                ),
                **_alone(place, options),
                "t_s": first.t_s[::EVERY] - first.t_s[0],
                "pose": first.pose[::EVERY],
            }
    return found


def has_poses(told: Mapping[str, Any]) -> bool:
    """True if the worker's swarms can be played; those kept in a file cannot."""
    return all("pose" in swarm for swarm in told["swarms"].values())


def without_poses(told: Mapping[str, Any]) -> dict[str, Any]:
    """Worker's word on swarms, less the poses, which are too much to be kept."""
    swarms = {
        label: {name: value for name, value in swarm.items() if name not in ("t_s", "pose")}
        for label, swarm in told["swarms"].items()
    }
    return {**told, "swarms": swarms}


def phase_diagram(text: str, options: Mapping[str, Any], say: Callable[[str], None]) -> list[dict]:
    """Classes of the swarm of a model whose robots are faster or turn faster by a factor.

    Returns:
        For each cell `speed` and `turn` (factors), `class` (the most frequent) and `share`.

    Raises:
        ValueError: the model cannot be varied so; one sentence.
    """
    with TemporaryDirectory(prefix="twinmill-") as folder:
        path = Path(folder) / "model.toml"
        path.write_text(text)
        model = native.Model.from_toml(text, "model.toml")
        axes = []
        for name in ("base.forward_gain", "base.yaw_gain"):
            at = ",".join(f"{factor * model.get(name):.6g}" for factor in FACTORS)
            axes.append(f"{name}={at}")
        asked = {key: options[key] for key in ("n", "duration_s")}
        request = make_request(
            options["behavior"], str(path), axes, seeds=DIAGRAM_STARTS, start="facing-out", **asked
        )
        parts, classes = request.parts(), []
        for k, worlds in enumerate(parts):
            say(f"the phase diagram: {100 * k // len(parts)} %")
            classes += run_part(request, worlds)["class"]
    cells = np.reshape(classes, (-1, DIAGRAM_STARTS))
    found = []
    for k, ended in enumerate(cells):
        name, count = Counter(ended.tolist()).most_common(1)[0]
        speed, turn = FACTORS[k % len(FACTORS)], FACTORS[k // len(FACTORS)]
        found.append({"speed": speed, "turn": turn, "class": name, "share": count / len(ended)})
    return found


def _alone(place: Path, options: Mapping[str, Any]) -> dict[str, float]:
    """Speed and turn rate that the first robot settles to while all are out of sight."""
    words = _words("model.toml", {**options, "duration_s": ALONE_S}, 1)
    robot = _logged(place, [*words, "--spread-m", f"{APART_M:g}"]).robots[0]
    t_s = np.arange(SETTLED_S, robot.pose_t_s[-1], STEP_S)
    _, velocity = resample(robot, t_s)
    forward_mps, _, turn_radps = np.abs(velocity.mean(axis=0))
    return {"speed_mps": float(forward_mps), "turn_radps": float(turn_radps)}


def _run(place: Path, model: native.Model, options: Mapping[str, Any], seed: int) -> SwarmSeries:
    scale = (model.get("sensor.range_m"), model.get("robot.body_radius_m"))
    return swarm_metrics(_logged(place, _words("model.toml", options, seed)), *scale)


def _logged(place: Path, words: list[str]) -> Log:
    """Log of a run of the twin, whose file is gone at once."""
    command = [str(find_program("twin_run")), *words]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(done.stderr.strip().splitlines()[-1])
    log = read_log(place / LOG)
    (place / LOG).unlink()
    return log
