# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab infer`: probabilities of what a model lacks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Force, Model, Out, Own
from twinmill_cli.output import AsJson, telling

if working():  # not for --help
    import shlex

    import twinmill_native as native
    from threadpoolctl import threadpool_limits

    from twinmill.files import check_new_file
    from twinmill.inference.answer import Answer
    from twinmill.inference.infer import Inference, infer_robots
    from twinmill.inference.kept import as_table, with_kept
    from twinmill.inference.robots import shared
    from twinmill.listing import listed
    from twinmill.report.inference import (
        next_run,
        section,
        sentence,
        shared_words,
        terminal_of_robots,
    )
    from twinmill_cli.frame import (
        Given,
        command_line,
        finish,
        load,
        open_model,
        provenance,
        read,
        told,
        with_own,
    )
if TYPE_CHECKING:
    from twinmill.inference.better import Better


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
    own: Own = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            "--keep",
            metavar="FILE",
            show_default=False,
            help="Write the model with what it misses in --own, which later logs then do without.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="M2",
            show_default=False,
            help="Write the likeliest model: with the effects that are missing, all numbers "
            "fitted, and what it misses in these logs.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    out: Out = None,
) -> list[Inference] | Better:
    """Posterior probability of each effect that a model may lack, and of an unknown cause.

    Effects of the catalogue, dependences without a name (on time, place, heading,
    speed, turns, the past, single moments) and nothing at all compete by their
    evidence. Sure means 90 % or more.

    Example: twinmill lab infer run.lcmlog --model fitted.toml --own calibration.lcmlog

    With -o better.toml the model is written with what was missing: later,
    `twinmill lab infer other.lcmlog --model better.toml` is enough. With
    --keep known.toml the model as given is written with what it misses in --own.
    """
    return inferred(
        "lab infer",
        read(logs, model, open_model(model, out)),
        own=own or [],
        keep=keep,
        output=output,
        force=force,
        as_json=as_json,
        out=out,
    )


def inferred(
    verb: str,
    given: Given,
    *,
    own: list[Path],
    keep: Path | None = None,
    output: Path | None = None,
    formula: bool = True,
    force: bool = False,
    as_json: bool,
    out: Path | None,
) -> list[Inference] | Better:
    """Tells what is missing with its probability, and writes the models that are asked for.

    Args:
        verb: of the command that was typed.
        given: logs of one robot or several, and the model.
        own: logs that the model was fitted to.
        keep: where the model is written with what it misses in these.
        output: where the model is written with what is missing.
        formula: one that holds is in it, too.
        force: replaces what is there.
        as_json: one JSON object in the place of tables.
        out: folder of a report.

    Returns:
        The answer on each robot; of a model that is written, that model with its answer.

    Raises:
        ValueError: files or options do not fit together.
    """
    native.keep_memory()  # what the work frees it wants again
    name, typed = verb.removeprefix("lab ").split()[0], with_own(verb, own)
    typed += f" --keep {shlex.quote(str(keep))}" if keep else ""
    source = provenance(command_line(typed, given.logs, given.model, output), given.model_file)
    if keep is not None and not own:
        raise ValueError(f"{name}: --keep stores what --own shows; give the model's own log, too.")
    for path in filter(None, (keep, output)):
        check_new_file(path, force, [given.model_file.path, *given.logs, *own])
    if keep is not None and keep == output:
        raise ValueError(f"{name}: --keep and -o are both {keep}; give each a file of its own.")
    with telling(f"inferring with {given.model}") as progress, threadpool_limits(1, "blas"):
        robots = {track.robot_id for _, track in given.measurements.tracks}
        if (keep or output) and len(robots) > 1:
            raise ValueError(
                f"{name}: {'--keep' if keep else '-o'} writes what one robot's log tells, and "
                f"these are {len(robots)} robots; give logs of one robot."
            )
        before = load(own, given.model_file) if own else ()
        results = infer_robots(given.measurements, given.model_file, before, progress)
        written = None
        if output is not None:
            from twinmill.inference.better import better  # slow, and judging needs none

            progress("what the new model still misses in these logs")
            found = results[0] if formula else replace(results[0], formula=None)
            written = better(found, given.model_file, output, source.command)
    if keep is not None and (always := results[0].always):
        told_by = as_table(always, [m.log_sha256 for m in before])
        with_kept(given.model_file, told_by, keep, source.command).write(force)
    if written:
        written.file.write(force)
    each = [{"sentence": sentence(result.answer), **result.to_json()} for result in results]
    data: dict[str, Any] = each[0]
    if len(each) > 1:
        together = shared([result.table for result in results])
        words = " ".join(shared_words(results))
        data = {"sentence": words, "shared": together.to_json(), "robots": each}
    answer = results[0].answer if len(results) == 1 else None
    writes = with_own("explain" if verb == "diagnose" else verb, own)
    mending = _mending(results[0], writes, given) if answer and not written else []
    settling = _settling(answer, given, own) if answer else []
    commands = [*mending, *settling]
    data = {**data, **(written.to_json() if written else {})}
    data |= {"commands": [command for _, command in commands], **told(given.measurements)}
    if answer and settling:
        why, command = next_run(answer), settling[0][1]
        data["next_experiment"] = {"separates": answer.open, "why": why, "command": command}
    finish(
        data,
        None if as_json else terminal_of_robots(results, commands, written),
        source,
        section=lambda: section(results, commands, written),
        as_json=as_json,
        out=out,
    )
    return written or results


def _mending(result: Inference, verb: str, given: Given) -> list[tuple[str, str]]:
    """Reason and command for the model that has what is missing.

    What is of a moment of these logs is added to none.
    """
    lasting = [*result.added]
    if result.formula and result.formula.lasting:
        lasting.append("equation")
    if not lasting and result.answer.verdict != "refit_enough":
        return []
    why = f"To add {listed(lasting)}" if lasting else "To refit the base"
    new = Path(f"{Path(given.model).stem}_{'_'.join(lasting) or 'fitted'}.toml")
    return [
        (
            f"{why}, and see by how much the error falls",
            command_line(verb, given.logs, given.model, new),
        )
    ]


def _settling(answer: Answer, given: Given, own: list[Path]) -> list[tuple[str, str]]:
    """Reason and command for the run that tells what is neither sure nor ruled out."""
    if not answer.open:
        return []
    verb = with_own("next", own)
    return [("To design that run", command_line(verb, given.logs, given.model, Path("next.csv")))]
