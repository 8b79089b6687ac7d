# SPDX-License-Identifier: Apache-2.0
"""`twinmill diagnose` and `explain`: which physical effect a model lacks."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.exit_now import STOPPED
from twinmill_cli.lazy import working
from twinmill_cli.options import Force, Logs, Model, NewModel, Out, Own
from twinmill_cli.output import AsJson, deliver, say, telling

if working():  # not for --help
    import twinmill_native as native

    from twinmill.data.log import read_log
    from twinmill.data.measurement import Measurements
    from twinmill.data.steady_table import is_steady_table
    from twinmill.diagnosis.diagnose import diagnose
    from twinmill.diagnosis.first_sight import at_first_sight
    from twinmill.diagnosis.result import Diagnosis
    from twinmill.diagnosis.stopped import NOTHING_TRIED, stopped
    from twinmill.files import check_new_file
    from twinmill.inference.keeping import by_probabilities
    from twinmill.model.model_file import ModelFile
    from twinmill.provenance import Provenance
    from twinmill_cli.frame import (
        command_line,
        finish,
        is_mjcf,
        open_model,
        option,
        provenance,
        read,
        told,
    )
if TYPE_CHECKING:
    from twinmill.diagnosis.explain import Explanation
    from twinmill.inference.better import Better
    from twinmill.inference.infer import Inference
    from twinmill.joints.diagnose import JointDiagnosis
    from twinmill.joints.explain import JointExplanation

TWIN_RUNS = 50
TABLE = 1  # telemetry_t.mode


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    app.command("diagnose")(_diagnose)
    app.command("explain")(_explain)


def _diagnose(
    logs: Logs,
    *,
    model: Model = DEFAULT_MODEL,
    own: Own = None,
    as_json: AsJson = False,
    out: Out = None,
) -> Diagnosis | JointDiagnosis | list[Inference] | Better:
    """Name the physical effect that a model lacks, or say that none is missing or identifiable.

    Works best with a model whose base was fitted to another log of the same robot
    and clocks: only then can a new lag or delay be told from an old one.

    Example: twinmill diagnose run.lcmlog --model fitted.toml

    Of one robot each effect has a probability. Several robots are compared with
    each other. A model that does not keep what it misses in its own log, as those
    of `fit` do, needs that log: --own calibration.lcmlog

    Of a robot that MuJoCo can load:
    twinmill diagnose run.csv --model arm.xml
    """
    if is_mjcf(model):
        from twinmill_cli.joints import diagnosed  # MuJoCo's Python is slow to import

        return diagnosed(logs, model, own=own or [], as_json=as_json, out=out)
    native.keep_memory()  # what the work frees it wants again
    source = provenance(command_line("diagnose", logs, model), model_file := open_model(model, out))
    with _told_if_stopped(source, as_json):
        given = read(logs, model, model_file)
        if own or by_probabilities(given.measurements):
            from twinmill_cli.infer import inferred  # slow to import

            return inferred("diagnose", given, own=own or [], as_json=as_json, out=out)
    measurements = given.measurements
    with _told_if_stopped(source, as_json), telling(f"diagnosing with {model}") as progress:
        _hint(measurements, model_file)
        result = diagnose(measurements, model_file, progress, stoppable=True)
    swarm = None
    if robots_recorded(logs[0], measurements) > 1 and not result.search.stopped:
        result, swarm = _with_swarm(logs[0], result)
    data = {**result.to_json(), **told(measurements), "swarm": swarm}
    then = [*_mending(result, logs, model), *_settling(result, logs, model)]
    if data["next_experiment"]:
        data["next_experiment"]["command"] = then[-1][1]
    if data["rest"]["proven"]:
        data["rest"]["proven"]["command"] = next(c for why, c in then if "the formula" in why)
    finish(
        data,
        None if as_json else _shown().terminal(result, then),
        source,
        section=lambda: _shown().section(result, then),
        as_json=as_json,
        out=out,
    )
    return result


def _shown() -> ModuleType:
    """Tables and pictures of a diagnosis: slow to import, and JSON needs none."""
    from twinmill.report import diagnosis

    return diagnosis


@contextmanager
def _told_if_stopped(source: Provenance, as_json: bool) -> Iterator[None]:
    """Ctrl-C before there is an answer: that nothing can be said is said, too.

    Raises:
        Exit: so it was.
    """
    try:
        yield
    except KeyboardInterrupt as stop:
        data = {"verdict": "cannot_tell", "sentence": NOTHING_TRIED, "stopped": True}
        deliver({**data, "findings": [], "found": [], **source.to_json()}, NOTHING_TRIED, as_json)
        raise typer.Exit(STOPPED) from stop


def _with_swarm(path: Path, result: Diagnosis) -> tuple[Diagnosis, dict[str, Any] | None]:
    """With what is said of the swarm as a whole; Ctrl-C leaves that out."""
    try:
        with telling("the swarm as a whole"):
            note, swarm = _judge_swarm(path, result)
    except KeyboardInterrupt:
        return stopped(result, "Stopped before the swarm as a whole was judged."), None
    return replace(result, notes=[*result.notes, note]), swarm


def _hint(measurements: Measurements, model_file: ModelFile) -> None:
    """Says what stands out, before anything is tested, to a person who waits."""
    if sys.stderr.isatty() and (seen := at_first_sight(measurements, model_file)):
        say(f"at first sight {seen}; this is now tested.")


def _mending(result: Diagnosis, logs: list[Path], model: str) -> list[tuple[str, str]]:
    """Reason and command for adding the findings to the model."""
    stem, told = Path(model).stem, []
    why = {
        "robots": "To give each robot its own numbers",
        "runs": "To take the middle of the runs, if it predicts better",
    }
    added = result.lasting or result.robots_off
    if added or result.apart:
        to = Path(f"{stem}_explained.toml")
        reason = why[result.apart.whose] if result.apart and not added else "To add what was found"
        told.append((reason, command_line("explain", logs, model, to)))
    elif result.verdict == "refit_enough":
        to = Path(f"{stem}_fitted.toml")
        told.append(("To refit the base", command_line("fit", logs, model, to)))
    explained = f"{stem}_explained.toml" if result.lasting else model
    return [*told, *_adding(result, logs, given=model, explained=explained)]


def _adding(
    result: Diagnosis, logs: list[Path], *, given: str, explained: str
) -> list[tuple[str, str]]:
    """Command that adds the validated formula; empty without one.

    Args:
        result: the diagnosis.
        logs: of it.
        given: the model that was diagnosed: to it, if the formula stands for what was found.
        explained: the model with what was found.
    """
    proven = result.rest.proven
    if not proven:
        return []
    options = [w for name, text in proven.equation.items() for w in (option(name), text)]
    verb = shlex.join(["twin", "add", "equation", *options])
    model = given if proven.instead_of else explained
    why = "To add the formula" if model == given else "Then, to add the formula"
    to = Path(f"{Path(given).stem}_equation.toml")
    return [(why, command_line(verb, logs, model, to))]


def _settling(result: Diagnosis, logs: list[Path], model: str) -> list[tuple[str, str]]:
    """Command that designs a run for the open questions; empty without any."""
    command = command_line("next", logs, model, Path("next.csv"))
    return [("To design that run", command)] if result.next_experiment else []


def robots_recorded(path: Path, measurements: Measurements) -> int:
    """How many robots drove together in this log; none in a table of separate drives."""
    if is_steady_table(path):
        return 0
    return len({m.label for m in measurements if m.log_name == path.name})


def _judge_swarm(path: Path, result: Diagnosis) -> tuple[str, dict[str, Any] | None]:
    """Compares the whole log with swarms of the model that was found.

    Returns:
        A sentence, and the comparison where there is one.
    """
    if result.verdict in ("ambiguous", "outside_catalogue"):
        return (
            "Each robot was judged by itself; the swarm as a whole can be once the model predicts "
            "each robot: `twinmill swarm compare`."
        ), None
    log, model = read_log(path), result.model
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
    done = "with what was found" if result.found else "with this model, its base refitted"
    if not found.test.differs:
        return f"The swarm as a whole, {done}: {found.verdict}", found.to_json()
    return f"The swarm as a whole, {done}: {found.verdict} {LOOK.capitalize()}", found.to_json()


def _refuse_formula(asked: bool | None) -> None:
    """Raises ValueError if a formula is asked for, or none, of a robot that none is proposed of."""
    if asked is not None:
        given = "--formula" if asked else "--no-formula"
        raise ValueError(f"explain: no formula is proposed for jointed robots; leave {given} away.")


def _explain(
    logs: Logs,
    output: NewModel,
    *,
    model: Model = DEFAULT_MODEL,
    own: Own = None,
    formula: Annotated[
        bool | None,
        typer.Option(
            "--formula/--no-formula",
            show_default=False,
            help="Add a validated formula for what no effect explains, as is done by default.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    out: Out = None,
) -> Explanation | JointExplanation | list[Inference] | Better:
    """Diagnose, add the effects found, and write the new model.

    If an error remains that no effect explains, and a formula for it holds, the
    formula is added, too. Of several robots and tables each step is
    cross-validated.

    Example: twinmill explain run.lcmlog --model fitted.toml -o explained.toml

    Of an MJCF: twinmill explain run.csv --model arm.xml -o better.xml
    """
    if is_mjcf(model):
        from twinmill_cli.joints import explained as of_joints  # as in diagnose

        _refuse_formula(formula)
        return of_joints(
            *(logs, model, output), own=own or [], force=force, as_json=as_json, out=out
        )
    verb = "explain --no-formula" if formula is False else "explain"
    native.keep_memory()  # what the work frees it wants again
    source = provenance(
        command_line(verb, logs, model, output), model_file := open_model(model, out)
    )
    check_new_file(output, force, [model_file.path, *logs, *(own or [])])
    with _told_if_stopped(source, as_json):
        given = read(logs, model, model_file)
    if own or by_probabilities(given.measurements):
        from twinmill_cli.infer import inferred  # as in diagnose

        with _told_if_stopped(source, as_json):
            return inferred(
                *(verb, given),
                own=own or [],
                output=output,
                formula=formula is not False,
                force=force,
                as_json=as_json,
                out=out,
            )
    from twinmill.diagnosis.explain import explain  # slow to import, and diagnose needs none of it

    measurements = given.measurements
    with _told_if_stopped(source, as_json), telling(f"explaining with {model}") as progress:
        _hint(measurements, model_file)
        result = explain(
            measurements,
            model_file,
            out=output,
            command=source.command,
            progress=progress,
            formula=formula is not False,
            stoppable=True,
            force=force,
        )
    explained = str(result.path or model)
    settling = _settling(result.diagnosis, logs, explained)
    adding = _adding(result.diagnosis, logs, given=model, explained=explained)
    kept = result.formula and result.formula.kept
    then = [*(() if kept else adding), *settling]
    not_written = "" if result.path else f"Not written: {output}; nothing was found for it."
    data = {**result.to_json(), **told(measurements)}
    if settling:
        data["next_experiment"]["command"] = settling[-1][1]
    finish(
        data,
        None if as_json else _shown().terminal_explanation(result, then, not_written),
        source,
        section=lambda: _shown().explanation_section(result, then, not_written),
        as_json=as_json,
        out=out,
    )
    return result
