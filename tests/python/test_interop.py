# SPDX-License-Identifier: Apache-2.0
"""The table in docs/files.md of what other programs make of our files, run anew."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
from interop.cells import ROOT, NotInstalled, lasting, row, rows_of
from interop.formats import CELLS

LINES = rows_of((ROOT / "docs/files.md").read_text())
RENEW = "\nOnce that is right: .venv/bin/python tests/python/interop"


def name_of(cell):
    return f"{cell.format}-{cell.direction}-{cell.program}"


def test_the_table_has_a_line_of_each_cell_and_no_other():
    named = ["-".join(part.strip() for part in line.split("|")[1:4]) for line in LINES]
    assert named == [name_of(cell) for cell in CELLS], RENEW


@pytest.mark.parametrize(
    "cell",
    [
        pytest.param(cell, id=name_of(cell), marks=[] if cell.quick else pytest.mark.long)
        for cell in CELLS
        if not cell.why_not
    ],
)
def test_another_program_makes_of_a_file_what_the_table_says(cell, tmp_path):
    try:
        told = cell.run(tmp_path)
    except NotInstalled as error:
        pytest.skip(str(error))
    lines = [lasting(line, pinned=cell.pinned) for line in LINES]
    assert lasting(row(cell, told, ""), pinned=cell.pinned) in lines, RENEW
