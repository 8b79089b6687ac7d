# SPDX-License-Identifier: Apache-2.0
"""Changes to Typer's options in all programs here, made when this module is imported."""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from typer._coercion import RuntimeParam
from typer.core import TyperArgument, TyperCommand, TyperOption, _TyperParameter

from twinmill.numbers_typed import REAL
from twinmill_cli.meant import meant, refuse_one_dash

if TYPE_CHECKING:  # the base of what Typer exports
    from typer._click.core import Context

OF_PYDANTIC = "Input should be "  # how its messages on a value begin

_display_type = TyperOption.display_type_rich
_argument_type = TyperArgument.display_type_rich
_process_value = TyperOption.process_value
_argument_value = TyperArgument.process_value
_argument_usage = TyperArgument.get_usage_pieces
_parse_args = TyperCommand.parse_args


def _type_shown(option: TyperOption, ctx: typer.Context) -> str | None:
    """Typer's, but nothing of a flag: it writes `<bool>`, and nobody is to type one."""
    return None if option.is_flag else _plain(_display_type(option, ctx=ctx))


def _of_argument(argument: TyperArgument, ctx: typer.Context) -> str | None:
    return _plain(_argument_type(argument, ctx=ctx))


def _usage(argument: TyperArgument, ctx: typer.Context) -> list[str]:
    """Typer's, but without arguments that are hidden."""
    return [] if argument.hidden else _argument_usage(argument, ctx)


def _plain(shown: str | None) -> str | None:
    """Kind of one value: Typer's `<list[Path]>` and `<int range>` as `<path>` and `<int>`."""
    return shown and re.sub(r"<list\[(.*)\]>|<(\w+) range>", r"<\1\2>", shown).lower()


@dataclass(frozen=True)
class _Word(RuntimeParam):
    """Type of a word of the command line where any word will do, as a text or path; or a flag.

    Typer asks pydantic, which takes twice as long to import as NumPy.
    """

    kind: Callable[[Any], Any]

    def _coerce_value(self, value: Any, param: _TyperParameter, ctx: "Context") -> Any:
        many = param.multiple or param.nargs == -1
        return [self.kind(one) for one in value] if many else self.kind(value)


NUMBERS = {int: "integer", float: "number", list[int]: "integer", list[float]: "number"}
# By the annotation, as Typer tells it; of `bool` are flags alone.
WORDS = {bool: bool, str: str, Path: Path, list[str]: str, list[Path]: Path}


def _without_pydantic(param: TyperOption | TyperArgument) -> None:
    """Before its first value: parameters of which any word will do."""
    told, info = param.type_descriptor.annotation, param.type_descriptor.parameter_info
    kind = WORDS.get(told)
    checked = info.parser or info.exists or info.resolve_path or not info.file_okay
    if kind and not (checked or not info.dir_okay or info.writable):
        param._runtime_param = _Word(info, told, kind)


def _given(argument: TyperArgument, ctx: typer.Context, value: Any) -> Any:
    """Typer's, but without pydantic where that is not needed."""
    _without_pydantic(argument)
    _refuse_misread(argument, ctx, value)
    return _argument_value(argument, ctx, value)


def _finite(option: TyperOption, ctx: typer.Context, value: Any) -> Any:
    """Typer's, but NaN and infinity are refused as such: NaN passes some ranges, and no others."""
    _without_pydantic(option)
    _refuse_misread(option, ctx, value)
    try:
        found = _process_value(option, ctx, value)
    except typer.BadParameter as error:
        _refuse_odd(option, ctx, map(_as_number, _each(value)), value)
        error.message = _quoting(error.message, value)
        raise
    _refuse_odd(option, ctx, _each(found), value)
    return found


def _refuse_misread(param: TyperOption | TyperArgument, ctx: typer.Context, value: Any) -> None:
    """Raises typer.BadParameter for 1_2 and the like, which pydantic takes for a number."""
    kind = NUMBERS.get(param.type_descriptor.annotation)
    for text in _each(value) if kind else ():
        if not isinstance(text, str) or REAL.fullmatch(text):
            continue
        number = _as_number(text)
        if not text.isascii() or (isinstance(number, float) and math.isfinite(number)):
            why = f"{text}: must be a valid {kind}; give another value."
            raise typer.BadParameter(why, ctx=ctx, param=param)


def _quoting(message: str, value: Any) -> str:
    """Pydantic's message, which does not tell what was given, with that before it."""
    if not message.startswith(OF_PYDANTIC):
        return message
    given = ", ".join(map(str, _each(value))).strip() or "an empty text"
    why, _, _ = message.removeprefix(OF_PYDANTIC).partition(", unable to parse")
    return f"{given}: must be {why}; give another value."


def _each(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]


def _as_number(text: Any) -> Any:
    """The number that a text is; another one as it stands."""
    try:
        return float(text)
    except (TypeError, ValueError):
        return text


def _refuse_odd(
    option: TyperOption, ctx: typer.Context, numbers: Iterable[Any], value: Any
) -> None:
    """Raises typer.BadParameter for NaN and infinity, in the words that were given for it."""
    for number, given in zip(numbers, _each(value), strict=False):
        odd = isinstance(number, float) and not math.isfinite(number)
        if odd and number != option.default:
            raise typer.BadParameter(f"{given} is no finite number.", ctx=ctx, param=option)


def _as_meant(command: TyperCommand, ctx: typer.Context, args: list[str]) -> list[str]:
    """Typer's; where it refuses that, with a question on what was meant."""
    words = [*args]
    try:
        if not ctx.resilient_parsing:
            refuse_one_dash(command, ctx, words)
        return _each_once(command, ctx, args)
    except typer.TyperException as error:
        if question := meant(command, ctx, words, error) if not error.message.endswith("?") else "":
            error.message = f"{error.message.rstrip('.')}; {question}"
        raise


def _each_once(command: TyperCommand, ctx: typer.Context, args: list[str]) -> list[str]:
    """Typer's, but an option for one value is refused the second time: it takes the last."""
    _, _, given = command.make_parser(ctx).parse_args(args=[*args])
    for option in given:
        if not isinstance(option, TyperOption) or option.multiple or option.is_flag:
            continue
        if given.count(option) > 1:
            raise typer.BadParameter("is given twice, and takes one value.", ctx=ctx, param=option)
    return _parse_args(command, ctx, args)


for _changed, _method, _ours in (
    (TyperCommand, "parse_args", _as_meant),
    (TyperOption, "display_type_rich", _type_shown),
    (TyperArgument, "display_type_rich", _of_argument),
    (TyperArgument, "get_usage_pieces", _usage),
    (TyperOption, "process_value", _finite),
    (TyperArgument, "process_value", _given),
):
    setattr(_changed, _method, _ours)
