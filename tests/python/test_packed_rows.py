# SPDX-License-Identifier: Apache-2.0
"""Packed rows are those of a list of lists."""

import numpy as np
import pytest

from twinmill.data.packed_rows import NO_LETTER, ROWS, PackedRows


@pytest.mark.parametrize("count", [1, ROWS, ROWS + 1, 2 * ROWS + 5])
def test_packed_rows_are_those_of_a_list(count):
    lists = [[str(k), "", f" {k * k},5 "] for k in range(count)]
    rows = PackedRows(lists)
    assert len(rows) == count and list(rows) == lists
    for k in (0, count // 2, count - 1, -1):
        assert rows[k] == lists[k]
    for place in (0, 1, 2, -1):
        assert [c for cells in rows.parts(place) for c in cells] == [row[place] for row in lists]
    index = np.flatnonzero(np.arange(count) % 3 == 0)
    assert list(rows.at(index)) == [lists[k] for k in index]
    assert list(rows.rearranged([2, "0.5", 0])) == [[row[2], "0.5", row[0]] for row in lists]
    assert list(rows.changed(str.strip)) == [[cell.strip() for cell in row] for row in lists]
    assert rows.hold(",") and not rows.hold(";")
    assert rows.pop() == lists[-1] and len(rows) == count - 1


def test_a_cell_with_a_zero_byte_moves_no_other():
    rows = PackedRows([["a\0b", str(k)] for k in range(ROWS + 2)])
    assert rows[0] == [f"a{NO_LETTER}b", "0"] and rows[ROWS - 1][1] == str(ROWS - 1)
