# SPDX-License-Identifier: Apache-2.0
"""`twinmill twin effects`: the catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import effects_beginning
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from twinmill.export.effect_source import NEW, write_effect
    from twinmill.model.model_file import ModelFile
    from twinmill.model.parameters import catalogue, find_effect
    from twinmill.report import show, tables


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("effects")(_effects)


def _effects(
    name: Annotated[
        str | None,
        typer.Argument(
            help="One effect; all if left out; new to write one.", autocompletion=effects_beginning
        ),
    ] = None,
    called: Annotated[
        str | None, typer.Argument(metavar="NEW_NAME", help="Name of the new effect.")
    ] = None,
    *,
    from_model: Annotated[
        Path | None,
        typer.Option("--from", metavar="MODEL", help="For new: the model that has its equation."),
    ] = None,
    equation: Annotated[
        str | None,
        typer.Option(
            "--equation", help="For new: which of the model's equations, if it has several."
        ),
    ] = None,
    into: Annotated[
        Path, typer.Option("--into", help="For new: folder of the project's source.")
    ] = Path(),
    as_json: AsJson = False,
) -> None:
    """List the physical effects that a model can have, or show one with its equation.

    `effects new NAME --from MODEL` writes source, card and test of an effect
    for the catalogue, from an equation of a model.

    Example: twinmill twin effects coasting
    """
    if name != NEW and (called or from_model):
        surplus = f"'{called}'" if called else f"--from {from_model}"
        raise ValueError(f"effects {name or ''}: takes no {surplus}; that is for `effects new`.")
    if name == NEW:
        _write(called, from_model, equation, into, as_json=as_json)
    elif name is None:
        entries = list(catalogue().values())
        deliver({"effects": entries}, show.table(tables.catalogue(entries)), as_json)
    else:
        entry = find_effect(name)
        deliver(entry, show.effect(entry), as_json)


def _write(
    name: str | None, model: Path | None, equation: str | None, into: Path, *, as_json: bool
) -> None:
    """Writes the files of `effects new`."""
    if name is None or model is None:
        raise ValueError("effects new: needs a name and --from MODEL, the model with its equation.")
    files = write_effect(name, ModelFile.load(str(model)), equation, into)
    told = [str(path) for path in files]
    said = "\n".join(
        [
            *(f"Written: {path}" for path in told),
            "Its card is a draft: say in your words what it is and what shows it.",
            "Then: make format check",
        ]
    )
    deliver({"effect": name, "files": told}, said, as_json)
