# SPDX-License-Identifier: Apache-2.0
"""Arguments of the library: checked, and written in sentences as the reader would give them."""

import difflib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any


def checked(name: str, value: Any, kinds: Any, wanted: str) -> Any:
    """The value of an argument, if it is of one of these kinds.

    Args:
        name: of the argument.
        value: that came.
        kinds: as for isinstance.
        wanted: the kinds in words.

    Raises:
        TypeError: it is of another kind.
    """
    if isinstance(value, kinds):
        return value
    came = repr(value) if isinstance(value, str | int | float) else f"a {type(value).__name__}"
    hint = " (its attribute `model` is a model)" if hasattr(value, "model") else ""
    raise TypeError(f"{name}: is {came}{hint}, and must be {wanted}.")


def known(what: str, names: Iterable[str], all_names: Collection[str]) -> tuple[str, ...]:
    """The names, if all of them are known.

    Raises:
        TypeError: it is one text and no list of names.
        ValueError: one is not known; the sentence has the nearest that is.
    """
    if isinstance(names, str):
        raise TypeError(f"{what}: must be a list of names, such as [{names!r}].")
    names = tuple(names)
    for name in names:
        checked(what, name, str, "a name")
        if name not in all_names:
            (near,) = difflib.get_close_matches(name, sorted(all_names), n=1, cutoff=0)
            raise ValueError(f"{what}: there is no '{name}'; the nearest is '{near}'.")
    return names


def _in_python(given: Mapping[str, Any], robot_id: int | None) -> str:
    """Options as arguments of the library, by robot where they are of one."""
    return ", ".join(
        name if value is None else f"{name}={value if robot_id is None else {robot_id: value}!r}"
        for name, value in given.items()
    )


Spelling = Callable[[Mapping[str, Any], int | None], str]
_spelling: Spelling = _in_python


def spelling() -> Spelling:
    """How options are written now; another process is told with it."""
    return _spelling


@contextmanager
def spelled(way: Spelling) -> Iterator[None]:
    """Sentences made meanwhile, in any thread, write options this way."""
    global _spelling
    before, _spelling = _spelling, way
    try:
        yield
    finally:
        _spelling = before


def options(given: Mapping[str, Any], robot_id: int | None = None) -> str:
    """Options in a sentence, as the reader writes them: here as arguments in Python.

    A program with another way to give them says so with `spelled`.

    Args:
        given: value by name, as the library takes it; None leaves the value to the reader.
        robot_id: whose the values are; None: of all.
    """
    return _spelling(given, robot_id)


def option(name: str, value: Any = None, robot_id: int | None = None) -> str:
    """One of `options`."""
    return options({name: value}, robot_id)
