# SPDX-License-Identifier: Apache-2.0
"""Answers of `twinmill diagnose` and `explain`, and the models that they write."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from twinmill_cli.lazy import working
from twinmill_cli.output import telling

if working():  # not for --help
    import shlex

    from threadpoolctl import threadpool_limits

    from twinmill.diagnosis.diagnose import diagnose
    from twinmill.diagnosis.fleet import Fleet
    from twinmill.diagnosis.infer import Inference
    from twinmill.files import check_new_file
    from twinmill.inference.answer import Answer
    from twinmill.inference.kept import as_table, with_kept
    from twinmill.listing import listed
    from twinmill.report import judged
    from twinmill.report.inference import next_run
    from twinmill_cli.frame import (
        Given,
        command_line,
        finish,
        load,
        provenance,
        told,
        with_own,
    )
    from twinmill_cli.swarm_as_whole import of_swarm
if TYPE_CHECKING:
    from twinmill.diagnosis.better import Better


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
) -> Inference | Fleet | Better:
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
        The answer; of a model that is written, that model with its answer.

    Raises:
        ValueError: files or options do not fit together.
    """
    name, typed = verb.split()[0], with_own(verb, own)
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
        if keep and len(robots) > 1:
            raise ValueError(
                f"{name}: --keep writes what one robot's log tells, and these are {len(robots)} "
                "robots; give logs of one robot."
            )
        before = load(own, given.model_file) if own else ()
        result = diagnose(given.measurements, given.model_file, before, progress)
        written = None
        if isinstance(result, Inference) and not formula:
            result = replace(result, formula=None)
        if output is not None:
            written = _written(result, given, output, say=progress, typed=source.command)
    if keep is not None and isinstance(result, Inference) and result.always:
        told_by = as_table(result.always, [m.log_sha256 for m in before])
        with_kept(given.model_file, told_by, keep, source.command).write(force)
    if written:
        written.file.write(force)
    notes, swarm = of_swarm(given.logs[0], given.measurements, result)
    mending = [] if written else _mending(result, with_own("explain", own), given)
    of_tables = isinstance(result, Inference) and result.of_tables
    settling = [] if of_tables else _settling(result.answer, given, own)
    commands = [*mending, *settling]
    data = {**judged.to_json(result), **(written.to_json() if written else {})}
    data |= {"commands": [command for _, command in commands], **told(given.measurements)}
    if notes:
        data |= {"swarm": swarm, "notes": notes}
    if settling:
        why, command = next_run(result.answer), settling[0][1]
        data["next_experiment"] = {"separates": result.answer.open, "why": why, "command": command}
    shown = judged.Told(result, commands, written, notes)
    finish(
        data,
        None if as_json else judged.terminal(shown),
        source,
        section=lambda: judged.section(shown),
        as_json=as_json,
        out=out,
    )
    return written or result


def _written(
    result: Inference | Fleet,
    given: Given,
    output: Path,
    *,
    typed: str,
    say: Callable[[str], None],
) -> Better:
    """The better model of one robot, or of several, to be written."""
    from twinmill.diagnosis.better import better  # slow, and judging needs none
    from twinmill.diagnosis.better_fleet import better_of_fleet

    if isinstance(result, Fleet):
        return better_of_fleet(result, given.model_file, output, command=typed, progress=say)
    say("what the new model still misses in these logs")
    return better(result, given.model_file, output, typed)


def _mending(result: Inference | Fleet, verb: str, given: Given) -> list[tuple[str, str]]:
    """Reason and command for the model that has what is missing.

    What is of a moment of these logs is added to none.
    """
    lasting = [*result.added]
    if isinstance(result, Fleet):
        lasting += [f"{one.name} of R{one.robot_id:02d}" for one in result.added_alone]
    elif result.formula and result.formula.lasting:
        lasting.append("equation")
    if not lasting and result.answer.verdict != "refit_enough":
        return []
    why = f"To add {listed(lasting)}" if lasting else "To refit the base"
    stem = "_".join(lasting).replace(" of ", "_") or "fitted"
    new = Path(f"{Path(given.model).stem}_{stem}.toml")
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
