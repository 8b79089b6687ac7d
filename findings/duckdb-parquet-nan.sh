#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# DuckDB 2.0.1 does not find NaN in a Parquet file of pyarrow 26.0.1 or polars 2.1.0; in memory it does.
#
# Guess: a query of a file gives what the same query of the same table in memory gives.
# Seen: a row group's least and largest value are written without NaN, and DuckDB passes over row groups by
#   them, although it holds NaN for larger than all: isnan(v) finds 0 rows of the file and 1 of the table, and
#   v > 5 likewise. Of a file that DuckDB wrote itself both are 1. Gaps as NULL are found.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet duckdb==2.0.1 pyarrow==26.0.1 polars==2.1.0
cd "$work"
"$work/venv/bin/python" - <<'PY'
import duckdb
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

volts = pa.table({"v": [1.0, float("nan"), 2.0]})
pq.write_table(volts, "pyarrow.parquet")
pl.from_arrow(volts).write_parquet("polars.parquet")
duckdb.sql("COPY volts TO 'duckdb.parquet'")
found = {}
for source in ("volts", "'pyarrow.parquet'", "'polars.parquet'", "'duckdb.parquet'"):
    found[source] = [
        duckdb.sql(f"SELECT count(*) FROM {source} WHERE {asked}").fetchall()[0][0]
        for asked in ("isnan(v)", "v > 5", "v = v")
    ]
    print(f"{source}: isnan {found[source][0]}, larger than 5 {found[source][1]}, rows {found[source][2]}")
assert found["volts"] == found["'duckdb.parquet'"] == [1, 1, 3]
assert found["'pyarrow.parquet'"] == found["'polars.parquet'"] == [0, 0, 3]
PY
