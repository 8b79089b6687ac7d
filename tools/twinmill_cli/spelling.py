# SPDX-License-Identifier: Apache-2.0
"""Options in the library's sentences, as they are typed."""

import shlex
from collections.abc import Mapping
from typing import Any


def typed(given: Mapping[str, Any], robot_id: int | None) -> str:
    """Options by name, as words of a command line; of one robot as in --flip R02=y_m."""
    own = "" if robot_id is None else f"R{robot_id:02d}="
    return " ".join(_typed("--" + name.replace("_", "-"), v, own) for name, v in given.items())


def _typed(option: str, value: Any, own: str) -> str:
    if value is None or value is True:
        return option
    if value is False:
        return option.replace("--", "--no-", 1)
    if isinstance(value, Mapping):
        value = [f"{key}={each}" for key, each in value.items()]
    if not isinstance(value, list):
        joint = "=" if isinstance(value, int | float) and value < 0 and not own else " "
        return f"{option}{joint}{own}{_word(value)}"
    return " ".join(f"{option} {own}{_word(each)}" for each in value)


def _word(value: Any) -> str:
    if isinstance(value, tuple):  # two robots
        return "=".join(f"R{robot_id:02d}" for robot_id in value)
    return str(value).removesuffix(".0") if isinstance(value, float) else shlex.quote(str(value))
