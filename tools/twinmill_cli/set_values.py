# SPDX-License-Identifier: Apache-2.0
"""`twinmill twin set`: numbers of a model set by hand, in a new model file."""

from __future__ import annotations

import shlex
from typing import Annotated, Any

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Force, Model, NewModel
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from twinmill.files import check_new_file, replacing
    from twinmill.model.set_values import with_values
    from twinmill.numbers_typed import typed_float
    from twinmill_cli.frame import command_line, open_model


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("set")(_set)


def _set(
    values: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME=VALUE", show_default=False, help="Such as base.motor_lag_s=0.06."
        ),
    ],
    output: NewModel,
    *,
    model: Model = DEFAULT_MODEL,
    force: Force = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Set parameters of a model by hand, into a new model file.

    What fits told of these numbers is taken out of the new file.

    Example: twinmill twin set base.motor_lag_s=0.06 --model turbopi.toml -o slower.toml
    """
    wanted: dict[str, float] = {}
    for name, value in map(_parsed, values):
        if name in wanted:
            raise ValueError(f"{name}: is given twice; give it one value.")
        wanted[name] = value
    model_file = open_model(model, None)
    check_new_file(output, force, [model_file.path])
    command = command_line(shlex.join(["twin", "set", *values]), [], model, output)
    text = with_values(model_file, wanted, command)
    with replacing(output, force) as temporary:
        temporary.write_text(text)
    deliver({"model": str(output), "values": wanted}, f"Written: {output}", as_json)
    return wanted


def _parsed(word: str) -> tuple[str, float]:
    name, _, value = word.partition("=")
    try:
        return name, typed_float(value)
    except ValueError as error:
        raise ValueError(f"{word}: is not of the form NAME=VALUE with a number.") from error
