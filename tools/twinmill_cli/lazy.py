# SPDX-License-Identifier: Apache-2.0
"""Subcommands whose modules are imported when they are called, and what those import to work.

The help of a command needs its options alone. What else the command needs takes seconds to import,
and its module imports that below `if working():`.
"""

import gc
import os
import sys
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

import twinmill_cli.typer_options  # noqa: F401 changes Typer's options

HELP = {"-h", "--help"}


def _options() -> list[str]:
    """Words of this program's command line up to `--`, behind which none is an option."""
    words = sys.argv[1:]
    return words[: words.index("--")] if "--" in words else words


# Once for the program: help and the shell's completion end it.
_helps = "_TWINMILL_COMPLETE" in os.environ or bool(HELP & set(_options()))


def working() -> bool:
    """Whether commands are imported to work, and not for their help alone."""
    return not _helps


class LazyCommand(TyperCommand):
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
        gc.disable()  # see __init__.py
        module = import_module(self.module)
        gc.freeze()
        gc.enable()
        module.register(app)
        for command in app.registered_commands:
            # Typer reads all annotations; what a command returns is a type of the library.
            command.callback.__annotations__.pop("return", None)
        return typer.main.get_group(app).commands[self.name]

    def make_context(
        self, info_name: str | None, args: list[str], *rest: Any, **options: Any
    ) -> typer.Context:
        """That of the subcommand, which is then what runs.

        Raises:
            typer.Exit: it showed its help.
        """
        words = list(args)
        context = self.command().make_context(info_name, args, *rest, **options)
        ends = options.get("resilient_parsing") or isinstance(context.command, TyperGroup)
        if not (working() or ends):
            word = next(word for word in words if word in HELP)
            raise typer.BadParameter(f"{word} is the value of an option here; write ./{word}.")
        return context
