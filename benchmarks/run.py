# SPDX-License-Identifier: Apache-2.0
"""Measures the robot's program, the diagnosis and the workbench against named alternatives.

`make bench`. Every figure is a ratio of two things measured in turn in the same minute, so that a
busy machine makes both slower; its spread is the 10th and 90th percentile of the pairs.
"""

import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import arm64
import decision
import delay
import diagnosis
import footprint
import typer
import workbench
from ratio import Ratio
from rich.console import Group, RenderableType
from rich.table import Table

from twinmill_cli.output import AsJson, busy, deliver

ROOT = Path(__file__).resolve().parents[1]


class Part(StrEnum):
    """Benchmark that can run by itself."""

    DECISION = "decision"
    DELAY = "delay"
    FOOTPRINT = "footprint"
    ARM64 = "arm64"
    DIAGNOSIS = "diagnosis"
    WORKBENCH = "workbench"


def main(
    only: Annotated[list[Part] | None, typer.Option(help="Measure this part; repeatable.")] = None,
    build: Annotated[Path, typer.Option(help="Folder of the build.")] = ROOT / "build",
    arm64_program: Annotated[
        Path | None, typer.Option(help="turbopi as built for arm64; for its size.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print how these compare. Exit code 1 if a goal is missed."""
    parts: dict[Part, Callable[[], Iterable[Ratio]]] = {
        Part.DECISION: lambda: decision.measure(build),
        Part.DELAY: lambda: delay.measure(build),
        Part.FOOTPRINT: lambda: footprint.measure(build, arm64_program),
        Part.ARM64: arm64.measure,
        Part.DIAGNOSIS: lambda: diagnosis.measure(build),
        Part.WORKBENCH: lambda: workbench.measure(build),
    }
    ratios: list[Ratio] = []
    for part in only or list(Part):
        with busy(f"measuring {part}"):
            ratios += parts[part]()
    found = [{**asdict(ratio), "met": ratio.met} for ratio in ratios]
    deliver({"ratios": found}, _shown(ratios), as_json)
    if not all(ratio.met or ratio.skipped for ratio in ratios):
        raise typer.Exit(1)


def _shown(ratios: list[Ratio]) -> RenderableType:
    said = [f"{r.name.split(' : ')[0]}: {r.says}" for r in ratios if r.says]
    return Group(_table(ratios), *said)


def _table(ratios: list[Ratio]) -> Table:
    table = Table("a : b", "a", "a / b", "10..90 %", "goal", box=None, header_style="bold")
    for column in table.columns[1:4]:
        column.justify = "right"
    for r in ratios:
        if r.skipped:
            table.add_row(r.name, "", "", "", f"skipped: {r.skipped}")
            continue
        spread = "" if r.low == r.high else f"{r.low:.2g}..{r.high:.2g}"
        goal = f"{r.goal} {'met' if r.met else 'MISSED'}" if r.goal else ""
        table.add_row(
            r.name, f"{r.a:.{0 if r.a >= 10 else 1}f} {r.unit}", f"{r.ratio:.3g}", spread, goal
        )
    return table


if __name__ == "__main__":
    try:
        typer.run(main)
    except (ValueError, OSError) as error:
        sys.exit(f"bench: {error}")
