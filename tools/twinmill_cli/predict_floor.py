# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab predict`: a sealed prediction of real runs, and the plan to make them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from twinmill.counted import counted
    from twinmill.files import check_holds, check_new_folder
    from twinmill.swarm.forecast.choose import choose
    from twinmill.swarm.forecast.draws import forecast, knows_errors, out_of_bounds
    from twinmill.swarm.forecast.plan import PLAN, SEALED, Plan, in_random_order, write_plan
    from twinmill.swarm.store import read_sweep
    from twinmill.terminal import progress_bar

RUNS = "draws"  # folder in the plan's


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("predict-floor")(_predict_floor)


def _predict_floor(
    sweep: Annotated[
        Path, typer.Argument(metavar="SWEEP", show_default=False, help="Folder of twin_sweep.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", show_default=False, help="Folder of the plan."
        ),
    ],
    *,
    cells: Annotated[int, typer.Option("--cells", min=1, help="Number of cells to run.")] = 9,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Runs of each cell.")] = 3,
    draws: Annotated[
        int, typer.Option("--draws", min=0, help="Models drawn from the errors of the numbers.")
    ] = 100,
    seeds: Annotated[int, typer.Option("--seeds", min=2, help="Runs of each in each cell.")] = 10,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Random seed of draws, order and starts.")
    ] = 1,
    as_json: AsJson = False,
) -> Plan:
    """Preregister a prediction: choose the most informative cells of a sweep, plan their runs.

    Cells tell most where models drawn from the uncertainty of the sweep's model
    end differently, or surely and otherwise than most cells do. DIR/plan.md is
    for the laboratory; the probabilities are in a file whose hash it names.

    Example: twinmill lab predict sweep --cells 9 -o plan
    """
    request, table = read_sweep(sweep)
    if cells > len(request.points):
        raise ValueError(f"--cells {cells}: the sweep has {counted(len(request.points), 'cell')}.")
    check_new_folder(output)
    if (output / SEALED).exists():
        raise ValueError(
            f"{output}: holds a plan that is sealed, and none is replaced; choose another -o."
        )
    check_holds(output, [RUNS])
    with progress_bar() as progress:
        task = progress.add_task("runs of models drawn", total=None)
        expected = forecast(
            request=request,
            table=table,
            count=draws,
            seeds=seeds,
            seed=seed,
            folder=output / RUNS,
            tell=lambda done, planned: progress.update(task, completed=done, total=planned),
        )
    chosen = choose(expected, cells, repeats, seed)
    numbers = [cell for cell, _ in chosen]
    bits = [told for _, told in chosen]
    order = in_random_order(cells, repeats, seed)
    plan = Plan(
        request=request,
        cells=numbers,
        expected=expected.cells(numbers),
        bits=bits,
        repeats=repeats,
        order=order,
        seed=seed,
    )
    digest = write_plan(plan, output)
    knows = knows_errors(request)
    anew, truncated = out_of_bounds(request, draws, seed) if knows else (0, [])
    data = {
        "plan": str(output / PLAN),
        "sealed": str(output / SEALED),
        "sha256": digest,
        "cells": [
            {
                **dict(zip(plan.names, point, strict=True)),
                "cell": cell,
                "information_bit": bit,
            }
            for cell, bit, point in zip(numbers, bits, plan.expected.points.tolist(), strict=True)
        ],
        "runs": len(order),
        "draws": len(expected.draws) if knows else 0,
        "draws_out_of_bounds": anew,
        "truncated": truncated,
    }
    lines = [
        f"Planned: {counted(len(order), 'run')} of {counted(cells, 'cell')}, together worth "
        f"{bits[-1]:.1f} bit.",
        f"Sealed: {output / SEALED}, SHA-256 {digest}",
    ]
    if not data["draws"]:
        lines.append(
            f"{request.model_name} says nothing of the errors of its numbers, so that the "
            "probabilities count chance alone; fit the model first (twinmill fit), sweep again."
        )
    if anew:
        names = f" ({', '.join(truncated)})" if truncated else ""
        lines.append(
            f"{anew} of {anew + draws} models drawn were out of bounds{names} and drawn anew: the "
            "predictions are of what is within."
        )
    deliver(data, "\n".join([*lines, f"Plan: {output / PLAN}"]), as_json)
    return plan
