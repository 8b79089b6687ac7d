# SPDX-License-Identifier: Apache-2.0
"""Subcommands whose modules are imported when they are called, and what those import to work.

The help of a command needs its options alone. What else the command needs takes seconds to import,
and its module imports that below `if working():`.
"""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

import twinmill_cli.typer_options  # noqa: F401 changes Typer's options

_working = True


def working() -> bool:
    """Whether a command's module is imported to work, and not to show its help alone."""
    return _working


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
        """That of the subcommand, which is then what runs; for completion it only parses."""
        if {"-h", "--help"} & set(args):
            self._show_help(info_name, args, *rest, **options)
        if options.get("resilient_parsing"):
            with _looking():
                return self.command().make_context(info_name, args, *rest, **options)
        return self.command().make_context(info_name, args, *rest, **options)

    def _show_help(
        self, info_name: str | None, args: list[str], *rest: Any, **options: Any
    ) -> None:
        """Leaves with typer.Exit, unless --help is no option here but the value of one."""
        with _looking():
            command = self.command()
            context = command.make_context(info_name, [*args], *rest, **options)
            if isinstance(command, TyperGroup):
                name, subcommand, others = command.resolve_command(context, [*args])
                subcommand.make_context(name, others, parent=context)


@contextmanager
def _looking() -> Iterator[None]:
    """Meanwhile commands are imported without what they need to work; later they are anew."""
    global _working
    known = set(sys.modules)
    _working = False
    try:
        yield
    finally:
        _working = True
        for name in set(sys.modules) - known:
            if name.startswith("twinmill_cli."):
                del sys.modules[name]
