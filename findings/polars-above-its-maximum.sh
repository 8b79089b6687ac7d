#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# polars 2.1.0: no value of a column is larger than its max(), but a row with NaN passes `> max`.
#
# Guess: NaN compares false, as in IEEE 754, NumPy, pandas and SQL's NULL, so that a threshold drops it.
# Seen: max() leaves NaN out (2.0), mean() does not (NaN), and a comparison holds NaN for larger than all
#   numbers and equal to itself: filter(v > max) has one row, and v == v drops none. drop_nans() first.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet polars==2.1.0 pandas==3.1.1
"$work/venv/bin/python" - <<'PY'
import math

import pandas as pd
import polars as pl

speeds = pl.DataFrame({"v": [1.0, math.nan, 2.0]})
v = pl.col("v")
most, mean = speeds["v"].max(), speeds["v"].mean()
above, same = speeds.filter(v > most).height, speeds.filter(v == v).height
print(f"max {most}, mean {mean}, rows above the max {above}, rows with v == v {same}")
assert (most, above, same) == (2.0, 1, 3) and math.isnan(mean)
theirs = pd.Series([1.0, math.nan, 2.0])
assert (theirs > theirs.max()).sum() == 0 and (theirs == theirs).sum() == 2
PY
