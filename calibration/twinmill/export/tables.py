# SPDX-License-Identifier: Apache-2.0
"""Messages as flat tables, one per type, with the column names that `twinmill import` reads."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.parquet
import turbopi

from twinmill.data.importers.plain import QUATERNION, VALUES
from twinmill.data.log import KINDS, heading_rad
from twinmill.export.recording import Channel, Recording
from twinmill.foreign_text import plain_line, printable

WHEELS = ("fl", "fr", "rl", "rr")
# Arrays in messages, one column each; those of drive_t are named by its kind.
FLAT = {
    "wheel_duty_pct": VALUES["duty"],
    "position_m": ("x_m", "y_m", "z_m"),
    "orientation_wxyz": QUATERNION,
    "wheel_radps": tuple(f"{wheel}_radps" for wheel in WHEELS),
}


def tables_of(recording: Recording, provenance: dict) -> dict[str, pa.Table]:
    """One table per type, in order of stamps; those with a channel prefix stand by themselves.

    Columns: t_s since the earliest stamp of the log, channel, logged_utime_us by the recorder's
    clock, then the fields of the .lcm file, arrays and inner messages spread out, bytes
    in hexadecimal. Poses have theta_rad besides.

    Returns:
        By name, as `pose` or `twin_pose`; `provenance` is in each table's metadata.
    """
    groups: dict[str, list[Channel]] = {}
    for channel in recording.channels:
        # Truth is the twin's alone: its prefix says nothing that the type does not.
        prefix = "" if channel.type_name == "truth" else channel.prefix.lower()
        groups.setdefault(prefix + channel.type_name, []).append(channel)
    metadata = {"twinmill": json.dumps(provenance)}
    return {
        name: _table(channels, recording.t0_utime_us).replace_schema_metadata(metadata)
        for name, channels in groups.items()
    }


def _table(channels: list[Channel], t0_us: int) -> pa.Table:
    messages = [m for channel in channels for m in channel.messages]
    utime_us = np.array([m.utime_us for m in messages])
    columns = {
        "t_s": (utime_us - t0_us) / 1e6,
        "channel": [channel.name for channel in channels for _ in channel.messages],
        "logged_utime_us": [stamp for channel in channels for stamp in channel.stamps_us],
    }
    for field in messages[0].__slots__:
        columns.update(_columns(field, messages))
    table = pa.table({name: _known(column) for name, column in columns.items()})
    return table.take(pa.array(np.argsort(utime_us, kind="stable")))


def _known(column: list | np.ndarray) -> pa.Array:
    """A column in which not-a-number is missing.

    Parquet's statistics leave it out, and readers that go by them pass over the rows that have it.
    """
    array = pa.array(column)
    if not pa.types.is_floating(array.type):
        return array
    return compute.if_else(compute.is_nan(array), None, array)


def _columns(field: str, messages: list) -> Iterator[tuple[str, np.ndarray]]:
    values = [getattr(message, field) for message in messages]
    if isinstance(values[0], str):  # which robots, or anybody else, may have said
        clean = printable if field == "config_toml" else plain_line
        yield field, [clean(value) for value in values]
        return
    if isinstance(values[0], bytes):
        yield field, [value.hex() for value in values]
        return
    if hasattr(values[0], "__slots__"):  # a message within the message
        for inner in values[0].__slots__:
            yield from ((f"{field}_{name}", column) for name, column in _columns(inner, values))
        return
    if not isinstance(values[0], list | tuple):
        yield field, values
        return
    if isinstance(messages[0], turbopi.drive_t):
        yield from _by_kind(np.array(values), np.array([message.kind for message in messages]))
        return
    count = max(map(len, values))
    names = FLAT.get(field) or [f"{field}_{k}" for k in range(count)]
    for k, name in enumerate(names):
        yield name, [value[k] if k < len(value) else None for value in values]
    if field == "orientation_wxyz":
        yield "theta_rad", heading_rad(np.array(values))


def _by_kind(value: np.ndarray, kind: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Columns of each kind of command that is there; NaN in rows of other kinds."""
    for number, name in enumerate(KINDS):
        if (kind == number).any():
            for k, column in enumerate(VALUES[name]):
                yield column, np.where(kind == number, value[:, k], np.nan)


def write_csv(table: pa.Table, path: Path) -> None:
    """With one header row; numbers of a float keep their point, and only words have quotes.

    Readers that guess types by the first rows would take `0` for an integer, which pyarrow writes.
    """
    table.to_pandas(types_mapper=pd.ArrowDtype).to_csv(path, index=False)


def write_parquet(table: pa.Table, path: Path) -> None:
    """With the provenance in the schema's metadata, under `twinmill`."""
    pyarrow.parquet.write_table(table, path)
