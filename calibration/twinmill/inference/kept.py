# SPDX-License-Identifier: Apache-2.0
"""Lasting errors of a model in its own logs, kept in its file as [fit.always]."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from twinmill.arguments import option
from twinmill.inference.hidden import Hidden
from twinmill.inference.lasting import Lasting
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Usual
from twinmill.inference.prior import Always
from twinmill.model.model_file import ModelError, ModelFile

DIGITS = 7  # of each number: the covariance is kept as its Cholesky factor, which stays one


def kept(model_file: ModelFile) -> Always | None:
    """Lasting errors of its model that a file keeps; None if it has none.

    Raises:
        ModelError: the table is not as `with_kept` writes it.
    """
    table = model_file.fit.get("always")
    if table is None:
        return None
    try:
        low = np.zeros((len(table["labels"]),) * 2)
        for k, row in enumerate(table["cholesky"]):
            low[k, : k + 1] = row
        if len(table["mean"]) != len(low) or len(table["cholesky"]) != len(low):
            raise ValueError(f"{len(low)} labels have {len(table['mean'])} means")
        return Always(
            effects=tuple(table["effects"]),
            labels=tuple(table["labels"]),
            mean=np.array(table["mean"], float),
            cov=low @ low.T,
            kernels=tuple((str(name), float(size)) for name, size in table["kernels"].items()),
            wander={str(name): np.array(p, float) for name, p in table["wander"].items()},
            lasting={n: _lasting(of, len(low)) for n, of in table.get("lasting", {}).items()},
            rate=Rate(**table["rate"]),
            usual=np.array(table["usual"], float),
            top=np.array(table["top"], float),
            noise=Usual(
                np.log(np.array(table["noise"], float)), np.array(table["noise_cov"], float)
            ),
            hidden=_hidden(table["hidden"], len(low)),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(
            f"{model_file.path}: [fit.always] cannot be read ({error}); take the table out, and "
            f"give the model's own log with {option('own')}."
        ) from error


def with_kept(model_file: ModelFile, always: dict[str, Any], path: Path, command: str) -> ModelFile:
    """A model's file with a table of what it misses, as another file that is not written yet."""
    document = tomlkit.parse(model_file.text)
    document["parent"] = model_file.hash
    document["created_by"] = command
    document.setdefault("fit", tomlkit.table())["always"] = always
    return ModelFile.of(Path(path), tomlkit.dumps(document))


def as_table(always: Always, logs: Sequence[str]) -> dict[str, Any]:
    """Table [fit.always] for a model's file, from logs of these hashes."""
    low = np.linalg.cholesky(always.cov)
    return {
        "logs": [*logs],
        "effects": list(always.effects),
        "kernels": dict(always.kernels),
        "wander": {name: _short(p) for name, p in always.wander.items()},
        "lasting": {name: _of_lasting(of) for name, of in always.lasting.items()},
        "rate": {k: _short([getattr(always.rate, k)])[0] for k in ("there", "on", "off")},
        "usual": _short(always.usual),
        "top": _short(always.top),
        "noise": [_short(row) for row in np.exp(always.noise.logs)],
        "noise_cov": [[_short(row) for row in cov] for cov in always.noise.cov],
        "labels": list(always.labels),
        "mean": _short(always.mean),
        "cholesky": _lower(low),
        "hidden": {
            "names": list(always.hidden.names),
            "unit": _short(always.hidden.unit),
            "gram": _lower(always.hidden.gram),
            "push": _short(always.hidden.push),
            "shift": [_short(row) for row in always.hidden.shift],
        },
    }


def _hidden(table: dict[str, Any], numbers: int) -> Hidden:
    """Effects that the base may have lacked; `numbers` of the base and beside it."""
    return Hidden(
        tuple(map(str, table["names"])),
        np.array(table["unit"], float),
        _symmetric(table["gram"]),
        np.array(table["push"], float),
        np.array(table["shift"], float).reshape(numbers, len(table["names"])),
    )


def _of_lasting(kernel: Lasting) -> dict[str, Any]:
    return {
        "chance": _short(kernel.chance),
        "gram": _lower(kernel.gram),
        "push": _short(kernel.push),
        "shift": [_short(row) for row in kernel.shift],
    }


def _lasting(table: dict[str, Any], numbers: int) -> Lasting:
    """A kernel that the base may have; `numbers` of the base and beside it."""
    return Lasting(
        np.array(table["chance"], float),
        _symmetric(table["gram"]),
        np.array(table["push"], float),
        np.array(table["shift"], float).reshape(numbers, len(table["push"])),
    )


def _lower(matrix: np.ndarray) -> list[list[float]]:
    """Rows of a matrix's lower triangle."""
    return [_short(row[: k + 1]) for k, row in enumerate(matrix)]


def _symmetric(rows: Sequence[Sequence[float]]) -> np.ndarray:
    """(K, K) matrix of its lower triangle."""
    found = np.zeros((len(rows),) * 2)
    for k, row in enumerate(rows):
        found[k, : k + 1] = found[: k + 1, k] = row
    return found


def _short(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") for value in values]
