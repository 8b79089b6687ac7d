#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# polars 2.1.0: a column of numbers that is empty in its first 100 rows is one of words, without an error.
#
# Guess: float numbers, as pandas 3.1.1 and DuckDB 2.0.1 find; else an error, as polars raises for a column
#   that is 0 for 100 rows and 0.5 later.
# Seen: String, where a robot is found by its tracker in row 101 only, by read_csv and by scan_csv. "7.50" is
#   larger than "12.0" then. infer_schema_length=None reads it right.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet polars==2.1.0 pandas==3.1.1 duckdb==2.0.1
cd "$work"
"$work/venv/bin/python" - <<'PY'
import duckdb
import pandas as pd
import polars as pl

for gaps in (99, 100):
    rows = [f"{k},{'' if k < gaps else '12.0' if k % 2 else '7.50'}" for k in range(1000)]
    with open(f"poses{gaps}.csv", "w") as file:
        file.write("\n".join(["frame,x", *rows]) + "\n")
few, many = (pl.read_csv(f"poses{gaps}.csv")["x"] for gaps in (99, 100))
lazy = pl.scan_csv("poses100.csv").collect()["x"]
whole = pl.read_csv("poses100.csv", infer_schema_length=None)["x"]
print(f"99 gaps {few.dtype}, 100 gaps {many.dtype}, lazily {lazy.dtype}; largest {many.max()}, {whole.max()}")
assert few.dtype == whole.dtype == pl.Float64 and whole.max() == 12.0
assert many.dtype == lazy.dtype == pl.String and many.max() == "7.50"
assert pd.read_csv("poses100.csv")["x"].dtype == float
assert duckdb.sql("SELECT max(x) FROM 'poses100.csv'").fetchall() == [(12.0,)]
with open("speeds.csv", "w") as file:
    file.write("v\n" + "0\n" * 100 + "0.5\n" * 100)
try:
    pl.read_csv("speeds.csv")
    raise SystemExit("it reads a column that is 0 for 100 rows")
except pl.exceptions.ComputeError as error:
    print(str(error).splitlines()[0])
PY
