#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# pyarrow 26.0.1: a CSV with quotes where "needed" has them about all words, and about its names.
#
# Guess: quoting_style="needed" puts quotes about a cell that holds a comma, a quote or a new line, as
#   csv.QUOTE_MINIMAL does, and about no other; so numbers that were made words to keep their point
#   (0.0 is written 0) are bare.
# Seen: "t_s","word" and "0.0","plain": every cell of a column of words, needed or not. NumPy's genfromtxt
#   reads such numbers as NaN, without an error; pandas and polars take the quotes away and see nothing.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet --no-compile pyarrow==26.0.1 numpy==2.4.6

cd "$folder"
bin/python - <<'PROGRAM'
import csv

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

numbers = pa.table({"t_s": [0.0, 0.5]})
pc.write_csv(numbers, "numbers.csv")
print(open("numbers.csv").read().split())
words = pa.table({"t_s": ["0.0", "0.5"], "word": ["plain", "two, parts"]})
pc.write_csv(words, "words.csv", pc.WriteOptions(quoting_style="needed"))
rows = open("words.csv").read().splitlines()
print(rows)
with open("minimal.csv", "w", newline="") as file:
    csv.writer(file).writerows([words.column_names, *zip(*words.to_pydict().values())])
minimal = open("minimal.csv").read().splitlines()
print(minimal)
pc.write_csv(words.select(["t_s"]), "quoted.csv", pc.WriteOptions(quoting_style="needed"))
read = np.genfromtxt("quoted.csv", skip_header=1)
print(read)
as_seen = open("numbers.csv").read().split()[1] == "0" and np.isnan(read).all()
as_seen &= rows == ['"t_s","word"', '"0.0","plain"', '"0.5","two, parts"']
as_seen &= minimal == ["t_s,word", "0.0,plain", '0.5,"two, parts"']
raise SystemExit(0 if as_seen else "it does otherwise now")
PROGRAM
