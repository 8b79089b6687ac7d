# SPDX-License-Identifier: Apache-2.0
"""What a swarm of robots would do with a model: the twin, from several starts."""

import shlex
import subprocess
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.log import read_log
from twinmill.programs import find_program
from twinmill.swarm.metrics import swarm_metrics

STARTS = 10  # seeds
POSE_RATE_HZ = 20
LOG = "swarm.lcmlog"
EVERY = 2  # poses of which one is drawn


def swarm_commands(model: str, options: Mapping[str, Any]) -> list[str]:
    """The first start as the workbench runs it, and its metrics."""
    run = ["twin_run", *_words(model, options, 1)]
    return [shlex.join(run), shlex.join(["twinmill", "metrics", LOG, "--model", model])]


def _words(model: str, options: Mapping[str, Any], seed: int) -> list[str]:
    """Of `twin_run`."""
    return [
        *("--plant", "planar", "--model", model, "--n", str(options["n"])),
        *("--behavior", options["behavior"], "--duration-s", f"{options['duration_s']:g}"),
        *("--seed", str(seed), "--pose-rate-hz", str(POSE_RATE_HZ), "--log", LOG),
    ]


def run_swarms(
    texts: Mapping[str, str], options: Mapping[str, Any], say: Callable[[str], None]
) -> dict[str, dict]:
    """The same swarm from the same starts with each model.

    Args:
        texts: of model files, by label.
        options: n, behavior, duration_s.
        say: told in words what is being done.

    Returns:
        By label: `classes` with their counts, `metrics` (means of the last 10 s over all starts),
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
                "t_s": first.t_s[::EVERY] - first.t_s[0],
                "pose": first.pose[::EVERY],
            }
    return found


def _run(place: Path, model: native.Model, options: Mapping[str, Any], seed: int):
    command = [str(find_program("twin_run")), *_words("model.toml", options, seed)]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(done.stderr.strip().splitlines()[-1])
    log = read_log(place / LOG)
    scale = (model.get("sensor.range_m"), model.get("robot.body_radius_m"))
    (place / LOG).unlink()
    return swarm_metrics(log, *scale)
