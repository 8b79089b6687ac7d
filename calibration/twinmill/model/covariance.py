# SPDX-License-Identifier: Apache-2.0
"""How the errors of fitted quantities go together."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

SYMMETRIC = 1e-4  # relative: entries are written with six digits


@dataclass(frozen=True)
class Covariance:
    """Covariance of fitted quantities.

    Attributes:
        names: in the model, P of them.
        values: (P, P) in the units of the quantities; the diagonal is the square of each `std`.
    """

    names: tuple[str, ...] = ()
    values: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def from_toml(cls, table: Mapping[str, Any]) -> "Covariance":
        """From `names` and `values` of a model file's table.

        Raises:
            ValueError: it is no covariance of these names, as the end of a sentence.
        """
        names = tuple(map(str, table.get("names", ())))
        try:
            values = np.array([[float(v) for v in row] for row in table.get("values", ())])
        except (TypeError, ValueError) as error:
            raise ValueError("must have rows of numbers as values.") from error
        size = len(names)
        if values.size != size**2 or (size and values.shape != (size, size)):
            raise ValueError(f"must have {size} rows of {size} numbers, one for each name.")
        values = values.reshape(size, size)
        scale = np.sqrt(np.abs(np.outer(np.diag(values), np.diag(values))))
        if not np.all(np.abs(values - values.T) <= SYMMETRIC * scale):
            raise ValueError("must be symmetric, with the variances on its diagonal.")
        values = (values + values.T) / 2
        if size and np.linalg.eigvalsh(_correlation(values))[0] < -SYMMETRIC * size:
            raise ValueError("is wrong: some sum of its quantities would have a negative variance.")
        return cls(names, values)

    def of(self, names: Collection[str]) -> "Covariance":
        """Covariance of the named quantities alone."""
        kept = [i for i, name in enumerate(self.names) if name in names]
        return Covariance(tuple(self.names[i] for i in kept), self.values[np.ix_(kept, kept)])

    def to_toml(self) -> dict[str, list[Any]]:
        """As `from_toml` reads it, six digits."""
        rows = [[float(f"{v:.6g}") for v in row] for row in self.values]
        return {"names": list(self.names), "values": rows}

    def replaced_by(self, newer: "Covariance | None") -> "Covariance":
        """With what a later fit told; what it left alone stays, and is independent of it."""
        if newer is None:
            return self
        old = [i for i, name in enumerate(self.names) if name not in newer.names]
        size = len(old)
        values = np.zeros((size + len(newer.names),) * 2)
        values[:size, :size] = self.values[np.ix_(old, old)]
        values[size:, size:] = newer.values
        return Covariance((*(self.names[i] for i in old), *newer.names), values)


def _correlation(values: np.ndarray) -> np.ndarray:
    """Correlations; what has no spread is correlated with nothing."""
    std = np.sqrt(np.maximum(np.diag(values), 0))
    std = np.where(std > 0, std, 1.0)
    return values / np.outer(std, std)
