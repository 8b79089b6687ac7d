# SPDX-License-Identifier: Apache-2.0
"""What is asked of the library's arguments, and its sentences as Python says them."""

import difflib
import re
from collections.abc import Collection, Iterable
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


def in_python(sentence: str) -> str:
    """A sentence of a program, with its options as arguments of the library."""
    sentence = sentence.replace(" (--help lists the options)", "").replace("--force", "force=True")
    sentence = re.sub(
        r"--(pose-\w+-\w+) R(\d+)=(-?\d+(?:\.\d+)?)",
        lambda own: f"{own[1].replace('-', '_')}={{{int(own[2])}: {own[3]}}}",
        sentence,
    )
    return re.sub(
        r"(?<![\w-])--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), sentence
    )
