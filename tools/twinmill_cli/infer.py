# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab infer`: probabilities of what a model lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Force, Model
from twinmill_cli.output import AsJson, deliver, telling

if working():  # not for --help
    import shlex

    import twinmill_native as native
    from threadpoolctl import threadpool_limits

    from twinmill.files import check_new_file
    from twinmill.inference.answer import Answer
    from twinmill.inference.infer import Inference, infer_robots
    from twinmill.inference.kept import with_kept
    from twinmill.model.parameters import with_role
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
            help="Logs with commands and poses: those of one robot are judged together, each robot "
            "by itself.",
        ),
    ],
    *,
    model: Model = DEFAULT_MODEL,
    own: Annotated[
        list[Path] | None,
        typer.Option(
            "--own",
            metavar="LOG",
            show_default=False,
            help="Log that the model was fitted to (once for each): what it misses there, too, "
            "is not reported as new.",
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            "--keep",
            metavar="FILE",
            show_default=False,
            help="Write the model with what it misses in --own, which later logs then do without.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> list[Inference]:
    """Posterior probability of each effect that a model may lack, and of an unknown cause.

    Effects of the catalogue, dependences without a name (on time, place, heading,
    speed, turns, the past, single moments) and nothing at all compete by their
    evidence. Sure means 90 % or more.

    Example: twinmill lab infer run.lcmlog --model fitted.toml --own calibration.lcmlog

    With --keep known.toml the model is written with what it misses in its own
    log: later, `twinmill lab infer other.lcmlog --model known.toml` is enough.
    """
    native.keep_memory()  # what the work frees it wants again
    words = [word for path in own or () for word in ("--own", str(path))]
    verb = shlex.join(["lab", "infer", *words, *(["--keep", str(keep)] if keep else [])])
    source = provenance(command_line(verb, logs, model), model_file := open_model(model, None))
    if keep is not None and not own:
        raise ValueError("infer: --keep stores what --own shows; give the model's own log, too.")
    if keep is not None:
        check_new_file(keep, force, [model_file.path, *logs, *own])
    with telling(f"inferring with {model}") as progress, threadpool_limits(1, "blas"):
        measurements = load(logs, model_file)
        robots = {track.robot_id for _, track in measurements.tracks}
        if keep is not None and len(robots) > 1:
            raise ValueError(
                f"infer: --keep writes what one robot's log tells, and these are {len(robots)} "
                "robots; give logs of the one that the model was fitted to."
            )
        before = load(own, model_file) if own else ()
        results = infer_robots(measurements, model_file, before, progress)
    if keep is not None:
        with_kept(model_file, results[0].always, keep, source.command).write(force)
    each = [result.to_json() for result in results]
    data = each[0] if len(each) == 1 else {"robots": each}
    commands = _mending(results[0].answer, logs, model) if len(results) == 1 else []
    lines = [command for _, command in commands]
    data = {**data, "commands": lines, **told(measurements), **source.to_json()}
    if as_json:
        deliver(data, None, as_json)
    else:
        from twinmill.report.inference import terminal_of_robots  # slow, and JSON needs none

        deliver(data, terminal_of_robots(results, commands), as_json)
    return results


def _mending(answer: Answer, logs: list[Path], model: str) -> list[tuple[str, str]]:
    """Reason and command for each step to the model that has what is missing beyond doubt.

    What is of a moment of these logs is added to none.
    """
    if answer.verdict == "refit_enough":
        fitted = Path(f"{Path(model).stem}_fitted.toml")
        return [("To refit the base", command_line("fit", logs, model, fitted))]
    steps, given = [], model
    for found in answer.findings:
        if found.certainty == "doubtful" or with_role(found.effect, "moment"):
            continue
        better = Path(f"{Path(given).stem}_{found.effect}.toml")
        why = "Then" if steps else "To add it, and see by how much the error falls"
        steps.append((why, command_line(f"twin add {found.effect}", logs, given, better)))
        given = str(better)
    return steps
