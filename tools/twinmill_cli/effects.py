# SPDX-License-Identifier: Apache-2.0
"""`twinmill effects`: the catalogue."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import effects_beginning
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from twinmill.model.parameters import catalogue
    from twinmill.report import show, tables


def find_effect(name: str) -> dict:
    """The catalogue's entry of that name.

    Raises:
        ValueError: there is none; the message names the nearest.
    """
    entries = catalogue()
    if name in entries:
        return entries[name]
    near = get_close_matches(name, entries, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]}?" if near else "`twinmill effects` lists them all."
    raise ValueError(f"effect '{name}': not in the catalogue; {hint}")


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("effects")(_effects)


def _effects(
    name: Annotated[
        str | None,
        typer.Argument(help="One effect; all if left out.", autocompletion=effects_beginning),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the physical effects that a model can have, or show one with its equation.

    Example: twinmill effects coasting
    """
    if name is None:
        entries = list(catalogue().values())
        deliver({"effects": entries}, show.table(tables.catalogue(entries)), as_json)
    else:
        entry = find_effect(name)
        deliver(entry, show.effect(entry), as_json)
