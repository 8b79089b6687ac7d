# SPDX-License-Identifier: Apache-2.0
"""Subcommands whose modules are imported when they are called, and what those import to work.

The help of a command needs its options alone. What else the command needs takes seconds to import,
and its module imports that below `if working():`.
"""

import gc
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand, TyperGroup

import twinmill_cli.typer_options  # noqa: F401 changes Typer's options
from twinmill_cli import early
from twinmill_cli.word_order import GROUP, in_order

if TYPE_CHECKING:  # the bases of what Typer exports
    from typer._click.core import Command, Context

HELP = {"-h", "--help"}


def _options() -> list[str]:
    """Words of this program's command line up to `--`, behind which none is an option."""
    words = in_order(sys.argv[1:])
    return words[: words.index("--")] if "--" in words else words


def asks_for_help(words: Sequence[str]) -> bool:
    """True if these words of a command line, up to `--`, have its help shown."""
    words = in_order(words)
    if words[:1] == [GROUP] and means_stop(words[1:]):
        return asks_for_help_alone(words[2:])
    return bool(HELP & {*words})


def means_stop(words: Sequence[str]) -> bool:
    """True if somebody who wrote these words behind `swarm` wants robots to stand."""
    return "stop" in [word.lower() for word in words]


def asks_for_help_alone(words: Sequence[str]) -> bool:
    """True if these words are a request for help and nothing else.

    In the command line of a stop another is none: -h is near to --host.
    """
    return len(words) == 1 and words[0].lower() in HELP


# Once for the program: help and the shell's completion end it.
_helps = "_TWINMILL_COMPLETE" in os.environ or asks_for_help(_options())


def working() -> bool:
    """True if commands are imported to work, and not for their help alone."""
    return not _helps


class LazyCommand(TyperCommand):
    """Stands for a subcommand until that is called.

    Args:
        name: as the user types it.
        module: whose function `register` adds it to an application; of this package, unless the
            name of another stands before it.
        summary: first sentence of its help.
        registered: its name there, if another.
        renamed: its name in the list of commands, which leaves this one out.
    """

    def __init__(
        self, name: str, module: str, summary: str, *, registered: str = "", renamed: str = ""
    ) -> None:
        super().__init__(name, help=summary, hidden=bool(renamed))
        self.module = module if "." in module else f"twinmill_cli.{module}"
        self.registered, self.renamed = registered or name, renamed
        self.below: dict[str, LazyCommand] = {}  # commands whose first word is this one's name

    def command(self) -> "Command":
        """The subcommand itself."""
        app = typer.Typer()
        gc.disable()  # see __init__.py
        early.begin()
        try:
            module = import_module(self.module)
        except Exception as error:  # whatever a file that stands in the way may do
            if isinstance(error, ModuleNotFoundError) and self.name != "swarm":
                raise  # as an extra that is not installed
            raise ImportError(early.why_not_begun(error)) from error
        finally:
            early.end()
        gc.freeze()
        gc.enable()
        module.register(app)
        for told in app.registered_commands:
            # Typer reads all annotations; what a command returns is a type of the library.
            told.callback.__annotations__.pop("return", None)
        command = typer.main.get_group(app).commands[self.registered]
        if not working():
            for leaf in command.commands.values() if isinstance(command, TyperGroup) else [command]:
                leaf.callback = _refuse
        if isinstance(command, TyperGroup):
            command.commands.update(self.below)
        elif self.below:
            names = ", ".join(f"`{self.name} {name}`" for name in self.below)
            command.epilog = f"Other commands: {names}."
        return command

    def make_context(
        self, info_name: str | None, args: list[str], *rest: Any, **options: Any
    ) -> "Context":
        """That of the subcommand, which is then what runs.

        Raises:
            typer.Exit: it showed its help.
        """
        words = list(args)
        if self.renamed and sys.stderr.isatty() and not options.get("resilient_parsing"):
            typer.echo(f"twinmill {self.name} is now twinmill {self.renamed}", err=True)
        command = self.command()
        if words and words[0] in self.below and not isinstance(command, TyperGroup):
            below = self.below[words[0]]
            return below.make_context(f"{info_name} {words[0]}", words[1:], *rest, **options)
        return command.make_context(info_name, args, *rest, **options)


def _refuse(**_: Any) -> None:
    """Instead of a command whose help was to be shown, and was not."""
    word = next(word for word in _options() if word in HELP)
    raise typer.BadParameter(f"{word} is the value of an option here; write ./{word}.")
