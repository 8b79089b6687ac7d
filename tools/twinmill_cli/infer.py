# SPDX-License-Identifier: Apache-2.0
"""`twinmill infer`: probabilities of what a model lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Model
from twinmill_cli.output import AsJson, deliver, telling

if working():  # not for --help
    import shlex

    import twinmill_native as native
    from threadpoolctl import threadpool_limits

    from twinmill.inference.infer import Inference, infer
    from twinmill_cli.frame import command_line, load, open_model, provenance, told


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("infer")(_infer)


def _infer(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            show_default=False,
            help="Logs with commands and poses of one robot, which are judged together.",
        ),
    ],
    model: Model = DEFAULT_MODEL,
    own: Annotated[
        list[Path] | None,
        typer.Option(
            "--own",
            metavar="LOG",
            show_default=False,
            help="Log that the model was fitted to (once for each): what it misses there, too, "
            "is no news.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> Inference:
    """Give the probability of each effect that a model may lack, and of something nameless.

    Effects of the catalogue, dependences without a name (on time, place, heading,
    speed, turns, the past, single moments) and nothing at all compete by their
    evidence. Sure means 90 % or more.

    Example: twinmill infer run.lcmlog --model fitted.toml --own calibration.lcmlog
    """
    native.keep_memory()  # what the work frees it wants again
    verb = shlex.join(["infer", *(word for path in own or () for word in ("--own", str(path)))])
    source = provenance(command_line(verb, logs, model), model_file := open_model(model, None))
    with telling(f"inferring with {model}") as progress, threadpool_limits(1, "blas"):
        measurements = load(logs, model_file)
        before = load(own, model_file) if own else ()
        result = infer(measurements, model_file, before, progress)
    data = {**result.to_json(), **told(measurements), **source.to_json()}
    if as_json:
        deliver(data, None, as_json)
    else:
        from twinmill.report.inference import terminal  # slow to import, and JSON needs none

        deliver(data, terminal(result), as_json)
    return result
