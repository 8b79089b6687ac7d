# SPDX-License-Identifier: Apache-2.0
"""`twinmill compare-swarm`: does a recorded swarm behave as the twin's swarms do?"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL, FALSE_ALARMS, least_seeds
from twinmill_cli.lazy import working
from twinmill_cli.options import Model, Out
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    from concurrent.futures import ThreadPoolExecutor

    import numpy as np
    import twinmill_native as native

    from twinmill.data.log import Log, read_log
    from twinmill.report import Figure, Section, write_report
    from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw, plain_ticks
    from twinmill.swarm.behaviors import find_table
    from twinmill.swarm.compare import (
        BLOCK_S,
        COMPARED,
        RankTest,
        blocks,
        compared,
        first_motion,
        least_spread,
        plain,
        rank_test,
        twin_values,
    )
    from twinmill.swarm.metrics import STEP_S, SwarmSeries, swarm_metrics
    from twinmill.swarm.sweep import parse_table
    from twinmill.terminal import progress_bar
    from twinmill_cli.frame import command_line, open_model, provenance
    from twinmill_cli.metrics import robot_ids

NOTE = (
    "The twin runs from the recorded start with many seeds. The chance that a true model is called "
    f"wrong is {100 * FALSE_ALARMS:.0f} %, both tests together."
)
LOOK = (
    "what only a swarm shows is collisions, hidden robots, or one that sees or drives otherwise: "
    "add `collision` or `occlusion` to the model or give one robot values of its own, and compare "
    "again."
)


@dataclass(frozen=True)
class SwarmComparison:
    """The floor's run and the twin's.

    Attributes:
        names: of the K metrics compared.
        t_s: (B,) middle of each block, since the swarm began to move.
        floor: (B, K) in the metrics' own units.
        twins: (S, B, K) the same.
        test: how they compare.
    """

    names: list[str]
    t_s: np.ndarray
    floor: np.ndarray
    twins: np.ndarray
    test: RankTest

    def to_json(self) -> dict:
        """Verdict, tests and bands."""
        j, left = self.test, self.test.left
        low, middle, high = (plain(part, self.names) for part in (j.low, j.middle, j.high))
        return {
            "differs": j.differs,
            "false_alarm_rate": FALSE_ALARMS,
            "p_energy": j.p_value,
            "p_band": j.p_band,
            "left_band": {"t_s": self.t_s[left[0]], "metric": self.names[left[1]]}
            if left
            else None,
            "seeds": len(self.twins),
            "t_s": self.t_s,
            "series": {
                name: {
                    "floor": self.floor[:, k],
                    "low": low[:, k],
                    "middle": middle[:, k],
                    "high": high[:, k],
                }
                for k, name in enumerate(self.names)
            },
        }

    @property
    def verdict(self) -> str:
        """One or two sentences."""
        j = self.test
        tests = f"(energy distance p = {j.p_value:.3f}, band p = {j.p_band:.3f})"
        if not j.differs:
            return f"The floor's run could be one of the twin's {len(self.twins)} {tests}."
        words = f"The floor's run is not one of the twin's {len(self.twins)} {tests}."
        if j.left:
            words += (
                f" It leaves the twin's band first {self.t_s[j.left[0]]:.0f} s after the start, in "
                f"{self.names[j.left[1]]}."
            )
        return words


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("compare-swarm")(_compare_swarm)


def _compare_swarm(
    log: Annotated[Path, typer.Argument(metavar="LOG", show_default=False)],
    *,
    model: Model = DEFAULT_MODEL,
    seeds: Annotated[
        int, typer.Option("--seeds", min=least_seeds(), help="Runs of the twin.")
    ] = 50,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0)] = 1,
    odd: Annotated[
        str | None, typer.Option("--odd", help="Robots that are not of the ring, as 5 or R05,R06.")
    ] = None,
    behavior: Annotated[
        str | None, typer.Option("--behavior", help="Of all robots; default: what the log says.")
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> SwarmComparison:
    """Tell whether a recorded swarm behaves as the twin's swarms do, and since when not.

    Paths of a swarm are chaotic, so metrics over time are compared: the floor's
    run is ranked among runs of the twin that start from the same poses.

    Example: twinmill compare-swarm floor.lcmlog --model fitted.toml --out report
    """
    model_file = open_model(model, out)
    runs = ["--seeds", str(seeds), "--first-seed", str(first_seed)]
    runs += ["--odd", odd] if odd else []
    runs += ["--behavior", behavior] if behavior else []
    verb = shlex.join(["compare-swarm", *runs])
    source = provenance(command_line(verb, [log], model), model_file)
    scale = (
        model_file.model.get("sensor.range_m"),
        model_file.model.get("robot.body_radius_m"),
    )
    with busy(f"reading {log}"):
        recorded = read_log(log)
        series = swarm_metrics(recorded, *scale, robot_ids(odd))
    result = compare_swarm(
        recorded,
        series,
        model_file.model,
        scale,
        seeds=range(first_seed, first_seed + seeds),
        behavior=behavior,
    )
    section = _section(result, series)
    report = write_report(out, section.title, source, [section], note=NOTE) if out else None
    data = {**result.to_json(), **source.to_json(), "report": str(report) if report else None}
    lines = [result.verdict, *([f"Next: {section.next_step}"] if section.next_step else [])]
    lines += [f"Report: {report}"] if report else []
    deliver(data, "\n".join(lines), as_json)
    return result


def compare_swarm(
    log: Log,
    series: SwarmSeries,
    model: native.Model,
    scale: tuple[float, float],
    *,
    seeds: range,
    behavior: str | None = None,
) -> SwarmComparison:
    """Runs the twin from the log's start and compares.

    Raises:
        ValueError: a behaviour is not known, or the log is too short.
    """
    begin = first_motion(series)
    values = series.values[begin:]
    count = round((series.t_s[-1] - series.t_s[begin]) / STEP_S) + 1
    names = compared(bool(series.odd))
    floor = blocks(values, names)
    if len(values) < count or len(floor) < 2:
        why = "has gaps in its poses" if len(values) < count else "is too short"
        raise ValueError(
            f"{log.path.name}: {why} after the swarm starts; at least {2 * BLOCK_S:.0f} s with "
            "poses of all robots, without a gap, are needed."
        )
    ring = len(series.robots) - len(series.odd)
    tables = [_table(behavior or log.robots[i].behavior, i) for i in series.robots]
    cell = native.Cell(model, tables, ring, poses=series.pose[begin].tolist())
    twins = []
    with _progress(len(seeds)) as tell, ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for one in pool.map(lambda seed: twin_values(cell, seed, ring, scale, count=count), seeds):
            twins.append(blocks(one, names))
            tell()
    runs = np.array(twins)
    t_s = (np.arange(len(floor)) + 0.5) * BLOCK_S
    return SwarmComparison(
        names,
        t_s,
        plain(floor, names),
        plain(runs, names),
        rank_test(floor, runs, least_spread(names)),
    )


def _table(name: str, robot: int) -> list[int]:
    own = find_table(name) if name else ""
    if own:
        return parse_table(f"{name}={own}")[1]
    if not name:
        raise ValueError(f"the log does not say what robot {robot} plays; give --behavior NAME.")
    return native.species(name, 1)[0][1]


@contextmanager
def _progress(total: int) -> Iterator:
    with progress_bar() as progress:
        task = progress.add_task("twin runs", total=total)
        yield lambda: progress.advance(task)


def _section(result: SwarmComparison, series: SwarmSeries) -> Section:
    j = result.test
    return Section(
        title="The swarm on the floor and the twin's",
        score=[
            ("p, whole run", f"{j.p_value:.3f}", "bad" if j.p_value <= FALSE_ALARMS / 2 else ""),
            ("p, worst moment", f"{j.p_band:.3f}", "bad" if j.p_band <= FALSE_ALARMS / 2 else ""),
        ],
        verdict=result.verdict,
        facts=[
            ("robots", ", ".join(map(str, series.robots))),
            ("runs of the twin", str(len(result.twins))),
            ("time compared", f"{len(result.t_s) * BLOCK_S:.0f} s in means over {BLOCK_S:g} s"),
        ],
        figures=[_bands(result)],
        next_step=LOOK if j.differs else "",
    )


def _bands(result: SwarmComparison) -> Figure:
    j, names = result.test, result.names
    low, high = plain(j.low, names), plain(j.high, names)

    def paint(panels) -> None:
        for k, (axes, name) in enumerate(zip(panels, names, strict=True)):
            axes.plot(result.t_s, result.twins[:, :, k].T, color=FLOOR, lw=0.4, alpha=0.35)
            axes.fill_between(result.t_s, low[:, k], high[:, k], color=FLOOR, alpha=0.15, lw=0)
            axes.plot(result.t_s, result.floor[:, k], color=MEASURED, lw=1.8)
            axes.set_ylabel(name)
            shown = np.concatenate([result.twins[:, :, k].ravel(), result.floor[:, k]])
            if COMPARED[name][0]:
                axes.set(yscale="log", ylim=(shown.min() / 1.3, shown.max() * 1.3))
                plain_ticks(axes.yaxis)
            else:
                margin = 0.1 * (np.ptp(shown) or 1)
                axes.set_ylim(shown.min() - margin, shown.max() + margin)
            if j.left and j.left[1] == k and j.p_band <= FALSE_ALARMS / 2:
                axes.axvline(result.t_s[j.left[0]], color=PREDICTED, lw=1.2)
        panels[-1].set_xlabel("time since the swarm began to move (s)")

    return Figure(
        draw(1.15 * len(names) + 0.4, paint, nrows=len(names), sharex=True),
        "Over time",
        "Dark: the floor. Green: each run of the twin, and the band that one run in forty leaves "
        "anywhere. Red: where the floor first leaves it.",
    )
