# SPDX-License-Identifier: Apache-2.0
"""`twinmill diagnose` and `explain`: which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.exit_now import STOPPED
from twinmill_cli.lazy import working
from twinmill_cli.options import Force, Logs, Model, NewModel, Out, Own
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import twinmill_native as native

    from twinmill.files import check_new_file
    from twinmill.provenance import Provenance
    from twinmill_cli.frame import command_line, is_mjcf, open_model, provenance, read
if TYPE_CHECKING:
    from twinmill.diagnosis.better import Better
    from twinmill.diagnosis.fleet import Fleet
    from twinmill.diagnosis.infer import Inference
    from twinmill.joints.diagnose import JointDiagnosis
    from twinmill.joints.explain import JointExplanation

NOTHING_TRIED = "Stopped before there was an answer; nothing can be said."


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    app.command("diagnose")(_diagnose)
    app.command("explain")(_explain)


def _diagnose(
    logs: Logs,
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
    force: Force = False,
    as_json: AsJson = False,
    out: Out = None,
) -> JointDiagnosis | Inference | Fleet | Better:
    """Name the physical effect that a model lacks, or say that none is missing or identifiable.

    Works best with a model whose base was fitted to another log of the same robot
    and clocks: only then can a new lag or delay be told from an old one.

    Example: twinmill diagnose run.lcmlog --model fitted.toml

    Each effect has a probability, and so has an unknown cause; sure means 90 % or
    more. Several logs of a robot are judged together; of several robots it is
    told what all lack, and in what one differs. A model that does not keep what
    it misses in its own log, as those of `fit` do, needs that log: --own
    calibration.lcmlog

    Of a robot that MuJoCo can load:
    twinmill diagnose run.csv --model arm.xml
    """
    if is_mjcf(model):
        from twinmill_cli.joints import diagnosed  # MuJoCo's Python is slow to import

        if keep:
            raise ValueError("diagnose: a MJCF keeps nothing of its own log; leave --keep away.")
        return diagnosed(logs, model, own=own or [], as_json=as_json, out=out)
    native.keep_memory()  # what the work frees it wants again
    source = provenance(command_line("diagnose", logs, model), model_file := open_model(model, out))
    with _told_if_stopped(source, as_json):
        from twinmill_cli.inferred import inferred  # slow to import

        given = read(logs, model, model_file)
        return inferred(
            *("diagnose", given),
            own=own or [],
            keep=keep,
            force=force,
            as_json=as_json,
            out=out,
        )


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
            help="Add a formula that holds for what no effect explains, as is done by default.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    out: Out = None,
) -> JointExplanation | Inference | Fleet | Better:
    """Diagnose, add the effects found, and write the new model.

    If an error remains that no effect explains, and a formula for it holds, the
    formula is added, too. Of several robots all get what all lack, and each its
    own numbers.

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
        from twinmill_cli.inferred import inferred  # as in diagnose

        given = read(logs, model, model_file)
        return inferred(
            *(verb, given),
            own=own or [],
            output=output,
            formula=formula is not False,
            force=force,
            as_json=as_json,
            out=out,
        )
