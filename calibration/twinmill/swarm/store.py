# SPDX-License-Identifier: Apache-2.0
"""A sweep's folder: parts while it runs, one Parquet file when it is done."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from twinmill.arguments import option
from twinmill.files import replacing
from twinmill.swarm.request import Request


@dataclass(frozen=True)
class Store:
    """Everything is written beside and renamed, so that a kill leaves whole files only."""

    folder: Path

    @property
    def result(self) -> Path:
        """Path of the finished table (Parquet, a row for each cell and seed)."""
        return self.folder / "sweep.parquet"

    @property
    def _manifest(self) -> Path:
        return self.folder / "manifest.json"

    def _part(self, number: int) -> Path:
        return self.folder / "parts" / f"{number:06d}.parquet"

    def open(self, request: Request) -> None:
        """Makes the folder, or goes on in one that holds parts of the same request.

        Raises:
            ValueError: it holds something else.
        """
        if self._manifest.exists():
            if self.read_manifest()["sha256"] != request.sha256:
                raise ValueError(
                    f"{self.folder}: holds a sweep with other parameters, another model, "
                    f"version or physics; choose another {option('out')}, or remove it."
                )
        elif self.folder.exists() and any(self.folder.iterdir()):
            raise ValueError(f"{self.folder}: is not empty and holds no sweep; choose another.")
        self.folder.mkdir(parents=True, exist_ok=True)
        manifest = {"sha256": request.sha256, "request": json.loads(request.to_json())}
        with replacing(self._manifest, force=True) as fresh:
            fresh.write_text(json.dumps(manifest, indent=1, sort_keys=True))
        self._part(0).parent.mkdir(exist_ok=True)  # not before the folder says what it is for

    def read_manifest(self) -> dict[str, Any]:
        """Manifest of the folder: the `request` it was made for, and its `sha256`."""
        return json.loads(self._manifest.read_text())

    def missing(self, count: int) -> list[int]:
        """Numbers of the parts not yet kept."""
        return [number for number in range(count) if not self._part(number).exists()]

    def keep(self, number: int, columns: dict[str, list[Any]]) -> None:
        """Writes one part of the table, so that a sweep that is cut off can go on."""
        self._write(self._part(number), pa.table(columns))

    def leave_empty(self) -> None:
        """Removes what the folder says of itself, if no part was kept."""
        if not any(self._part(0).parent.iterdir()):
            self._part(0).parent.rmdir()
            self._manifest.unlink()

    def finish(self, request: Request, count: int) -> None:
        """Joins all parts and removes them."""
        table = pa.concat_tables([pq.read_table(self._part(number)) for number in range(count)])
        about = {"twinmill_request": request.to_json(), "twinmill_sha256": request.sha256}
        self._write(self.result, table.replace_schema_metadata(about))
        shutil.rmtree(self._part(0).parent)

    @staticmethod
    def _write(path: Path, table: pa.Table) -> None:
        with replacing(path, force=True) as fresh:
            pq.write_table(table, fresh, compression="zstd")


def read_sweep(folder: Path) -> tuple[Request, pa.Table]:
    """A finished sweep.

    Raises:
        ValueError: there is none.
    """
    store = Store(folder)
    if not store.result.exists():
        state = "a sweep that is not finished" if store._manifest.exists() else "no sweep"
        raise ValueError(f"{folder}: holds {state}; run that sweep to its end.")
    try:
        table = pq.read_table(store.result)
        asked = table.schema.metadata[b"twinmill_request"]
    except (pa.ArrowInvalid, KeyError, TypeError) as error:
        raise ValueError(
            f"{store.result}: is damaged; remove it and run the same twin_sweep again."
        ) from error
    return Request.from_json(asked.decode()), table
