# SPDX-License-Identifier: Apache-2.0
"""Subcommands whose modules are imported when they are called: `twinmill --help` needs none."""

from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup


class Later(TyperCommand):
    """Stands for a subcommand until that is called.

    Args:
        name: as the user types it.
        module: whose function `register` adds it to an application.
        summary: first sentence of its help.
    """

    def __init__(self, name: str, module: str, summary: str) -> None:
        super().__init__(name, help=summary)
        self.module = module

    def command(self) -> TyperCommand | TyperGroup:
        """The subcommand itself."""
        app = typer.Typer()
        import_module(self.module).register(app)
        return typer.main.get_group(app).commands[self.name]

    def make_context(self, *arguments: Any, **options: Any) -> typer.Context:
        """That of the subcommand, which is then what runs."""
        return self.command().make_context(*arguments, **options)
