# SPDX-License-Identifier: Apache-2.0
"""Question on what was meant by a command line that is refused, where an option is mistyped."""

import difflib
import re
import shlex
from collections.abc import Sequence
from itertools import pairwise

import typer
from typer.core import TyperArgument, TyperCommand, TyperOption

from twinmill_cli.word_order import LIKE_OPTION

# Words that can be told from others though nothing stands before them, by what help calls them.
FORMS = {"IDS": r"[0-9]{1,2}(,[0-9]{1,2})*", "BEHAVIOR": r"[^\W\d][\w-]*"}


def refuse_one_dash(command: TyperCommand, ctx: typer.Context, words: Sequence[str]) -> None:
    """Raises typer.TyperException for a long option behind one dash.

    Typer would read it as a short option with its value: `-model M` names a model `odel`.
    """
    named = _long_options(command, ctx)
    for place, word in enumerate(_before_the_rest(words)):
        if _of_one_dash(word) in named:
            meant = _two_dashes(named, _of_one_dash(word), words, place)
            ctx.fail(f"{word}: a name of several letters has two dashes; was `{meant}` meant?")


def meant(
    command: TyperCommand, ctx: typer.Context, words: Sequence[str], error: typer.TyperException
) -> str:
    """Question on what was meant, to go on behind the reason why it was refused; may be empty."""
    return (
        _of_stop(ctx, words)
        or _of_misspelled_dash(command, ctx, words)
        or _of_argument(command, ctx, words, error)
        or _of_bare_word(command, ctx, words)
    )


def _of_stop(ctx: typer.Context, words: Sequence[str]) -> str:
    """A stop behind another verb to the swarm: whoever says it believes that robots stand."""
    group = ctx.parent.command_path if ctx.parent else ""
    is_other = group.endswith(" swarm") and str(ctx.info_name).lower() != "stop"
    is_stop = is_other and "stop" in [word.lower() for word in words]
    return f"NOTHING WAS STOPPED; was `{group} stop` meant?" if is_stop else ""


def _of_misspelled_dash(command: TyperCommand, ctx: typer.Context, words: Sequence[str]) -> str:
    """A long option behind one dash, with another letter besides."""
    named = _long_options(command, ctx)
    for place, word in enumerate(_before_the_rest(words)):
        for name in difflib.get_close_matches(_of_one_dash(word), named, 1, LIKE_OPTION):
            return f"was `{_two_dashes(named, name, words, place)}` meant?"
    return ""


def _of_argument(
    command: TyperCommand, ctx: typer.Context, words: Sequence[str], error: typer.TyperException
) -> str:
    """A word that this command takes without a name, and that was given with one."""
    name = str(getattr(error, "option_name", ""))  # where there is no such option
    shown = {p.metavar or p.name for p in command.get_params(ctx) if isinstance(p, TyperArgument)}
    value = _value(name, words)
    is_one = name.startswith("--") and name.removeprefix("--").upper() in shown
    return f"was `{ctx.command_path} {value}` meant, without {name}?" if is_one and value else ""


def _of_bare_word(command: TyperCommand, ctx: typer.Context, words: Sequence[str]) -> str:
    """A word without the name of its option, as a behaviour, or robots with spaces between them."""
    try:
        given, extra, _ = command.make_parser(ctx).parse_args(args=[*words])
    except typer.TyperException:
        return ""
    for option in _long_options(command, ctx).values():
        form = FORMS.get(option.metavar or "")
        fits = [word for word in extra if form and re.fullmatch(form, word)]
        if fits and len(fits) == len(extra):
            before = given.get(option.name or "")
            if option.metavar == "IDS":
                fits = [",".join([*([str(before)] if before else []), *fits])]
            elif before or len(fits) > 1:
                continue
            return f"was `{_long_name(option)} {shlex.quote(fits[0])}` meant?"
    return ""


def _before_the_rest(words: Sequence[str]) -> Sequence[str]:
    return words[: words.index("--")] if "--" in words else words


def _of_one_dash(word: str) -> str:
    """Name behind one dash; empty where there are two, or none, or a single letter."""
    found = re.fullmatch(r"-([^\W\d_][\w-]+)(=.*)?", word, re.DOTALL)
    return found[1].lower() if found else ""


def _long_options(command: TyperCommand, ctx: typer.Context) -> dict[str, TyperOption]:
    """Options by each of their long names, without its dashes."""
    return {
        name.removeprefix("--"): param
        for param in command.get_params(ctx)
        if isinstance(param, TyperOption)
        for name in (*param.opts, *param.secondary_opts)
        if name.startswith("--")
    }


def _long_name(option: TyperOption) -> str:
    return next(name for name in option.opts if name.startswith("--"))


def _two_dashes(named: dict[str, TyperOption], name: str, words: Sequence[str], place: int) -> str:
    """The option as it has to be typed, with its value."""
    value = "" if named[name].is_flag else _value(words[place].partition("=")[0], words[place:])
    return f"--{name} {value}".strip()


def _value(name: str, words: Sequence[str]) -> str:
    """Value given to an option, as a shell has it; empty where none is."""
    for word, following in pairwise([*words, ""]):
        if word.partition("=")[0] == name:
            value = word.partition("=")[2] or following
            return "" if not value or value.startswith("-") else shlex.quote(value)
    return ""
