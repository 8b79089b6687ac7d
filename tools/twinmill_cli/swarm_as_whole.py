# SPDX-License-Identifier: Apache-2.0
"""The recorded swarm as a whole, beside swarms of the model that was found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import twinmill_native as native

from twinmill.data.log import read_log
from twinmill.data.measurement import Measurements
from twinmill.data.steady_table import is_steady_table
from twinmill.diagnosis.fleet import Fleet
from twinmill.diagnosis.infer import Inference
from twinmill_cli.output import telling

TWIN_RUNS = 50
TABLE = 1  # telemetry_t.mode


def of_swarm(
    path: Path, measurements: Measurements, result: Inference | Fleet
) -> tuple[list[str], dict[str, Any] | None]:
    """Sentences and JSON on a log of several robots; none of one robot or a table."""
    if not isinstance(result, Fleet) or robots_recorded(path, measurements) < 2:
        return [], None
    with telling("the swarm as a whole"):
        note, swarm = judge_swarm(path, result.verdict, result.model, result.finds)
    return [note], swarm


def robots_recorded(path: Path, measurements: Measurements) -> int:
    """How many robots drove together in this log; none in a table of separate drives."""
    if is_steady_table(path):
        return 0
    return len({m.label for m in measurements if m.log_name == path.name})


def judge_swarm(
    path: Path, verdict: str, model: native.Model | None, finds: bool
) -> tuple[str, dict[str, Any] | None]:
    """Compares the whole log with swarms of the model that was found.

    Args:
        path: of the log.
        verdict: on its robots.
        model: of all, with what was found; None where the verdict makes it needless.
        finds: something was.

    Returns:
        A sentence, and the comparison where there is one.
    """
    if model is None or verdict in ("ambiguous", "outside_catalogue"):
        return (
            "Each robot was judged by itself; the swarm as a whole can be once the model predicts "
            "each robot: `twinmill swarm compare`."
        ), None
    log = read_log(path)
    if not all((robot.mode == TABLE).any() for robot in log.robots.values()):
        return (
            "Each robot was judged by itself, not the swarm as a whole: for that all must play a "
            "table of behaviour, and these do not."
        ), None
    # Slow to import, and `make demo` does without what it needs.
    from twinmill.report.swarm_comparison import LOOK
    from twinmill.swarm.compare import compare_swarm
    from twinmill.swarm.metrics import swarm_metrics
    from twinmill.terminal import progress_bar

    try:
        series = swarm_metrics(log, model.get("sensor.range_m"), model.get("robot.body_radius_m"))
        with progress_bar() as progress:
            task = progress.add_task("twin runs", total=TWIN_RUNS)
            found = compare_swarm(
                *(log, series, model),
                seeds=range(1, TWIN_RUNS + 1),
                tell=lambda: progress.advance(task),
            )
    except ValueError as error:
        return f"Each robot was judged by itself; the swarm as a whole cannot be: {error}", None
    done = "with what was found" if finds else "with this model, its base refitted"
    if not found.test.differs:
        return f"The swarm as a whole, {done}: {found.verdict}", found.to_json()
    return f"The swarm as a whole, {done}: {found.verdict} {LOOK.capitalize()}", found.to_json()
