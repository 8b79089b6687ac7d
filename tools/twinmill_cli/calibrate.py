# SPDX-License-Identifier: Apache-2.0
"""`twinmill compare`, `fit` and `add`: from logs and a model to errors and a better model."""

from __future__ import annotations

import shlex
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import (
    Force,
    Hold,
    Logs,
    Model,
    NewModel,
    Out,
    effects_beginning,
    repeated,
)
from twinmill_cli.output import AsJson, busy, say

if working():  # not for --help
    from twinmill.files import check_new_file
    from twinmill.fitting.add import OWN_GAINS, AddResult, add_to_model
    from twinmill.fitting.compare import Comparison, compare
    from twinmill.fitting.fit import Choice, FitResult, fit_model
    from twinmill.inference.keeping import with_its_error
    from twinmill.model.parameters import find_effect
    from twinmill.report import show
    from twinmill.report.sections import added_section, comparison_section, fit_section
    from twinmill.runs.history import append, calibration, check_history
    from twinmill_cli.frame import (
        command_line,
        finish,
        is_mjcf,
        load,
        of_robot,
        open_model,
        option,
        provenance,
        told,
    )
if TYPE_CHECKING:
    from twinmill.joints.compare import JointComparison


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    app.command("compare")(_compare)
    app.command("fit")(_fit)
    app.command("add")(_add)


def _compare(
    logs: Logs, model: Model = DEFAULT_MODEL, as_json: AsJson = False, out: Out = None
) -> Comparison | JointComparison:
    """Measure prediction errors of a model on logs, relative to the noise floor.

    Predictions start from measured poses; errors are taken 0.1, 0.2, 0.5, 1 and
    2 s later. The score is their RMS over the noise floor: 1.0 is as good as the
    log can tell; above 1.3 something is missing.

    Example: twinmill compare run.lcmlog --model turbopi.toml --out report

    Of a robot that MuJoCo can load: twinmill compare run.csv --model arm.xml
    """
    if is_mjcf(model):
        from twinmill_cli.joints import compared  # MuJoCo's Python is slow to import

        return compared(logs, model, as_json, out)
    source = provenance(command_line("compare", logs, model), model_file := open_model(model, out))
    with busy(f"comparing with {model}"):
        measurements = load(logs, model_file)
        result = compare(measurements, model_file)
    section = partial(comparison_section, result)
    data = {**result.to_json(), **told(measurements)}
    finish(data, show.comparison(result), source, section=section, as_json=as_json, out=out)
    return result


def _fit(
    logs: Logs,
    output: NewModel,
    *,
    model: Model = DEFAULT_MODEL,
    hold: Hold = None,
    history: Annotated[
        Path | None,
        typer.Option(
            "--history",
            metavar="FILE",
            show_default=False,
            help="Append the numbers to the robot's history (.jsonl), for `twinmill robot drift`.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    out: Out = None,
) -> FitResult:
    """Fit the parameters of a model to logs, into a new model file.

    Example: twinmill fit run.lcmlog --model turbopi.toml -o fitted.toml
    """
    held = hold or []
    kept = [] if history is None else ["--history", str(history)]
    verb = shlex.join(["fit", *repeated("--hold", held), *kept])
    source = provenance(
        command_line(verb, logs, model, output), model_file := open_model(model, out)
    )
    check_new_file(output, force, [model_file.path, *logs])
    with busy(f"fitting {model}"):
        measurements = load(logs, model_file)
        runs = check_history(history, measurements) if history else []
        result = fit_model(
            measurements, model_file, output, source.command, choice=Choice(tuple(held))
        )
        result = replace(result, child=with_its_error(result.child, measurements))
        result.child.write(force)  # last, so that Ctrl-C leaves no file of which nothing is told
        if history:
            append(history, calibration(result, runs, logs, history))
    section = partial(fit_section, result)
    data = {**result.to_json(), **told(measurements)}
    finish(data, show.fit(result), source, section=section, as_json=as_json, out=out)
    return result


def _add(
    effect: Annotated[
        str,
        typer.Argument(
            metavar="EFFECT",
            show_default=False,
            help="Name of an effect, as `twinmill twin effects` lists; with --robot also gains.",
            autocompletion=effects_beginning,
        ),
    ],
    logs: Logs,
    output: NewModel,
    *,
    model: Model = DEFAULT_MODEL,
    force: Force = False,
    adds_to: Annotated[
        str | None,
        typer.Option(
            "--adds-to", help="For equation: the quantity it adds to, as vx_mps, rim_mps."
        ),
    ] = None,
    formula: Annotated[
        str | None,
        typer.Option("--formula", help="For equation: the term, with parameters p0 to p3."),
    ] = None,
    state_rate: Annotated[
        str | None,
        typer.Option("--state-rate", help="For equation: ds/dt of a state s."),
    ] = None,
    second_rate: Annotated[
        str | None,
        typer.Option("--second-rate", help="For equation: dr/dt of a second state r."),
    ] = None,
    called: Annotated[
        str | None,
        typer.Option("--called", help="For equation: a name, as air; else it is `equation`."),
    ] = None,
    numbers: Annotated[
        str | None,
        typer.Option(
            "--numbers",
            help="For equation: names and units in the place of p0 to p3, as 'drag s/m, ratio'.",
        ),
    ] = None,
    hold: Hold = None,
    robot: Annotated[
        int | None,
        typer.Option(
            min=0, max=99, show_default=False, help="Number of the robot that alone has the effect."
        ),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> AddResult:
    """Add an effect to a model, fit it with all other parameters, and cross-validate it.

    Example: twinmill twin add coasting run.lcmlog --model fitted.toml -o better.toml
    """
    gains = robot is not None and effect == OWN_GAINS
    known = {} if gains else {t["name"]: t["default"] for t in find_effect(effect)["texts"]}
    rates = {"state_rate": state_rate, "second_rate": second_rate}
    names = {"called": called, "numbers": numbers}
    typed = {"adds_to": adds_to, "formula": formula, **rates, **names}
    texts = {name: text for name, text in typed.items() if text is not None}
    if extra := [name for name in texts if name not in known]:
        raise ValueError(
            f"{option(extra[0])}: {effect} has none; it is for `twinmill twin add equation`."
        )
    if "formula" in known and formula is None:
        used = {**known, **texts}
        usual = f"{used['adds_to']} += {used['formula']}"
        say(f"without --formula, {usual} is fitted.")
    held = hold or []
    given = [w for name, text in texts.items() for w in (option(name), text)]
    verb = shlex.join(["twin", "add", effect, *of_robot(robot), *given, *repeated("--hold", held)])
    source = provenance(
        command_line(verb, logs, model, output), model_file := open_model(model, out)
    )
    check_new_file(output, force, [model_file.path, *logs])
    measurements = load(logs, model_file)
    with busy(f"adding {effect} to {model}"):
        result = add_to_model(
            effect=effect,
            measurements=measurements,
            model_file=model_file,
            path=output,
            command=source.command,
            texts=texts,
            held=held,
            robot_id=robot,
        )
        result = replace(result, child=with_its_error(result.child, measurements))
        result.child.write(force)  # last, as of fit
    section = partial(added_section, result)
    data = {**result.to_json(), **told(measurements)}
    finish(data, show.added(result), source, section=section, as_json=as_json, out=out)
    return result
