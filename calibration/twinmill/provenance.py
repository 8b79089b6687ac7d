# SPDX-License-Identifier: Apache-2.0
"""Where an output comes from."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Provenance:
    """Origin that every output carries; the model's hash is empty where none was used."""

    command: str
    version: str
    model_sha256: str

    def to_json(self) -> dict[str, Any]:
        """Fields of JSON output."""
        return vars(self)
