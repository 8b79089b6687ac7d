# SPDX-License-Identifier: Apache-2.0
"""Where an output comes from."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Provenance:
    """What every output carries; the model's hash is empty where none was used."""

    command: str
    version: str
    model_sha256: str

    def to_json(self) -> dict:
        """Fields of JSON output."""
        return vars(self)
