# SPDX-License-Identifier: Apache-2.0
"""Records of numbers that decide, each with what it means: reports and JSON output print them."""

from dataclasses import dataclass, field, fields
from typing import Any


def number(value: Any, what: str) -> Any:
    """A field of a record with its value and what it means."""
    return field(default=value, metadata={"what": what})


@dataclass(frozen=True)
class Numbers:
    """A record of numbers that decide, each with what it means."""

    def listed(self) -> list[tuple[str, float, str]]:
        """Name, value and meaning of each, as reports print them."""
        return [(f.name, getattr(self, f.name), f.metadata["what"]) for f in fields(self)]
