# SPDX-License-Identifier: Apache-2.0
"""CSV and Parquet of a log, by the libraries that people open tables with.

Each of them guesses the types of a CSV by its first rows, as it does if nothing is said.
"""

from collections.abc import Callable
from pathlib import Path

from interop import drive
from interop.cells import Told, reads, writes

PANDAS, POLARS, DUCKDB, PYARROW = (
    "pandas==3.1.1",
    "polars==2.1.0",
    "duckdb==2.0.1",
    "pyarrow==26.0.1",
)
FOLDER, POSES, COMMANDS, LOG = "tables", "poses.csv", "commands.csv", "read.lcmlog"


def _write(to: str) -> Callable[[Path], None]:
    return lambda folder: drive.export(folder, to, FOLDER)


UNTOLD = "speed_input"  # of this drive, in every row
UNTOLD_TYPE = "a column without any value, as numbers"
NAMED_TYPE = f"{UNTOLD_TYPE}, if named"


def _told(x_m: list, volts: list, seq: list, float_types: bool, whole_type: bool) -> Told:
    """Facts in columns; a missing cell is None or NaN."""
    missing = [value is None or value != value for value in x_m]
    return {
        "rows": len(x_m) == len(volts) == drive.COUNT,
        "numbers with a fraction, from rest on": float_types,
        "whole numbers": whole_type and list(seq) == list(range(drive.COUNT)),
        "places": all(
            abs(x_m[k] - drive.x_m(k)) < 1e-9 for k in range(drive.COUNT) if drive.seen(k)
        ),
        "gaps": missing == [not drive.seen(k) for k in range(drive.COUNT)],
        "a voltage in every tenth row": sum(v is not None and v == v for v in volts) == 40,
    }


@writes("CSV", "pandas", PANDAS, ours=_write("csv"))
def pandas_csv(folder: Path) -> Told:
    """`read_csv`."""
    import pandas as pd

    return _of_pandas(*(pd.read_csv(folder / FOLDER / f"{n}.csv") for n in ("pose", "telemetry")))


@writes("Parquet", "pandas", PANDAS, PYARROW, ours=_write("parquet"))
def pandas_parquet(folder: Path) -> Told:
    """`read_parquet`."""
    import pandas as pd

    files = (folder / FOLDER / f"{n}.parquet" for n in ("pose", "telemetry"))
    return _of_pandas(*map(pd.read_parquet, files))


def _of_pandas(poses, told) -> Told:
    floats = poses["x_m"].dtype == told["battery_V"].dtype == poses["y_m"].dtype == float
    whole = poses["seq"].dtype.kind == "i"
    columns = poses["x_m"], told["battery_V"], poses["seq"]
    return _told(*map(list, columns), floats, whole) | {UNTOLD_TYPE: told[UNTOLD].dtype == float}


@writes("CSV", "polars", POLARS, ours=_write("csv"))
def polars_csv(folder: Path) -> Told:
    """`read_csv`, which looks at 100 rows."""
    import polars as pl

    poses, told = (folder / FOLDER / f"{n}.csv" for n in ("pose", "telemetry"))
    named = pl.read_csv(told, schema_overrides={UNTOLD: pl.Float64})
    return _of_polars(pl.read_csv(poses), pl.read_csv(told)) | {
        NAMED_TYPE: named[UNTOLD].dtype == pl.Float64 and named[UNTOLD].null_count() == drive.COUNT
    }


@writes("Parquet", "polars", POLARS, ours=_write("parquet"))
def polars_parquet(folder: Path) -> Told:
    """`read_parquet`."""
    import polars as pl

    files = (folder / FOLDER / f"{n}.parquet" for n in ("pose", "telemetry"))
    return _of_polars(*map(pl.read_parquet, files))


def _of_polars(poses, told) -> Told:
    floats = poses["x_m"].dtype.is_float() and told["battery_V"].dtype.is_float()
    whole = poses["seq"].dtype.is_integer()
    columns = poses["x_m"], told["battery_V"], poses["seq"]
    return _told(*(column.to_list() for column in columns), floats, whole) | {
        UNTOLD_TYPE: told[UNTOLD].dtype.is_float()
    }


@writes("CSV", "DuckDB", DUCKDB, ours=_write("csv"))
def duckdb_csv(folder: Path) -> Told:
    """`FROM 'pose.csv'`."""
    import duckdb

    told = f"read_csv('{folder / FOLDER}/telemetry.csv', types = {{'{UNTOLD}': 'DOUBLE'}})"
    (row,) = duckdb.sql(f"SELECT count(*), avg({UNTOLD}) FROM {told}").fetchall()
    return _of_duckdb(folder, "csv") | {NAMED_TYPE: row == (drive.COUNT, None)}


@writes("Parquet", "DuckDB", DUCKDB, ours=_write("parquet"))
def duckdb_parquet(folder: Path) -> Told:
    """`FROM 'pose.parquet'`, and each command with the last pose before it."""
    import duckdb

    poses, told = (f"'{folder / FOLDER}/{name}.parquet'" for name in ("pose", "telemetry"))
    joined = duckdb.sql(
        f"SELECT told.fl_pct, pose.x_m FROM {told} told ASOF JOIN {poses} pose "
        "ON told.robot_id = pose.robot_id AND told.t_s >= pose.t_s ORDER BY told.t_s"
    )
    wanted = [
        (50 * (k >= drive.STANDS), drive.x_m(k) if drive.seen(k) else None)
        for k in range(drive.COUNT)
    ]
    alike = all(
        duty == row[0] and (row[1] is None if x is None else abs(row[1] - x) < 1e-9)
        for row, (duty, x) in zip(joined.fetchall(), wanted, strict=True)
    )
    return _of_duckdb(folder, "parquet") | {"`ASOF JOIN` of poses and commands": alike}


def _of_duckdb(folder: Path, ending: str) -> Told:
    import duckdb

    file = f"'{folder / FOLDER / 'pose'}.{ending}'"
    poses = duckdb.sql(f"SELECT x_m, seq FROM {file}")
    told = duckdb.sql(f"SELECT battery_V, {UNTOLD} FROM '{folder / FOLDER / 'telemetry'}.{ending}'")
    kinds = [str(kind) for kind in (*poses.types, *told.types)]
    x_m, seq = zip(*poses.fetchall(), strict=True)
    volts = [row[0] for row in told.fetchall()]
    floats = kinds[0] == kinds[2] == "DOUBLE"
    lost = duckdb.sql(f"SELECT count(*) FROM {file} WHERE x_m IS NULL").fetchall()
    whole = kinds[1] in ("BIGINT", "INTEGER")
    return _told(list(x_m), volts, list(seq), floats, whole) | {
        "gaps, asked for": lost == [(drive.LOST,)],
        UNTOLD_TYPE: kinds[3] in ("DOUBLE", "FLOAT"),
    }


@writes("CSV", "pyarrow", PYARROW, ours=_write("csv"))
def pyarrow_csv(folder: Path) -> Told:
    """`open_csv`, which takes the types of the first block, here of 4 KB."""
    import pyarrow.csv as pc

    blocks = pc.ReadOptions(block_size=4096)
    files = (folder / FOLDER / f"{n}.csv" for n in ("pose", "telemetry"))
    return _of_pyarrow(*(pc.open_csv(file, blocks).read_all() for file in files))


@writes("Parquet", "pyarrow", PYARROW, ours=_write("parquet"))
def pyarrow_parquet(folder: Path) -> Told:
    """`read_table`; and the provenance in the schema."""
    import json

    import pyarrow.parquet as pq

    files = (folder / FOLDER / f"{n}.parquet" for n in ("pose", "telemetry"))
    poses, told = map(pq.read_table, files)
    source = json.loads(poses.schema.metadata[b"twinmill"])
    return _of_pyarrow(poses, told) | {
        "where it comes from": source["t0_utime_us"] == drive.START_US
    }


def _of_pyarrow(poses, told) -> Told:
    import pyarrow as pa

    floats = {poses["x_m"].type, poses["y_m"].type, told["battery_V"].type} == {pa.float64()}
    whole = pa.types.is_integer(poses["seq"].type)
    columns = poses["x_m"], told["battery_V"], poses["seq"]
    return _told(*(column.to_pylist() for column in columns), floats, whole) | {
        UNTOLD_TYPE: pa.types.is_floating(told[UNTOLD].type)
    }


def _read(folder: Path) -> Told:
    import twinmill as tm

    tm.import_log(folder / POSES, folder / COMMANDS).save(folder / LOG)
    return drive.told_of_import(folder / LOG, "twist")


def _columns() -> tuple[dict, dict]:
    """Poses and commands; lost places are None."""
    rows = range(drive.COUNT)
    t_s = [drive.START_US / 1e6 + k * drive.STEP_US * 1e-6 for k in rows]
    x_m = [drive.x_m(k) if drive.seen(k) else None for k in rows]
    there = [None if x is None else 0.0 for x in x_m]
    poses = {"t_s": t_s, "robot_id": [1] * drive.COUNT, "x_m": x_m, "y_m": there}
    poses["theta_rad"] = there
    vx_mps = [drive.SPEED_MPS * (k >= drive.STANDS) for k in rows]
    still = [0.0] * drive.COUNT
    told = {"t_s": t_s, "robot_id": [1] * drive.COUNT, "vx_mps": vx_mps}
    return poses, told | {"vy_mps": still, "omega_radps": still}


def _pairs(folder: Path):
    return zip((folder / POSES, folder / COMMANDS), _columns(), strict=True)


@reads("CSV", "pandas", PANDAS, ours=_read)
def pandas_writes(folder: Path) -> None:
    """`to_csv`."""
    import pandas as pd

    for path, columns in _pairs(folder):
        pd.DataFrame(columns).to_csv(path, index=False)


@reads("CSV", "polars", POLARS, ours=_read)
def polars_writes(folder: Path) -> None:
    """`write_csv`."""
    import polars as pl

    for path, columns in _pairs(folder):
        pl.DataFrame(columns).write_csv(path)


@reads("CSV", "DuckDB", DUCKDB, PYARROW, ours=_read)
def duckdb_writes(folder: Path) -> None:
    """`COPY ... TO`."""
    import duckdb
    import pyarrow as pa

    for path, columns in _pairs(folder):
        table = pa.table(columns)
        duckdb.register("given", table)
        duckdb.sql(f"COPY given TO '{path}' (HEADER)")


@reads("CSV", "pyarrow", PYARROW, ours=_read)
def pyarrow_writes(folder: Path) -> None:
    """`write_csv`, which quotes names and words, and writes 0.0 as 0."""
    import pyarrow as pa
    import pyarrow.csv as pc

    for path, columns in _pairs(folder):
        pc.write_csv(pa.table(columns), path)
