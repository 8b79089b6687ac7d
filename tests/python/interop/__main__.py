# SPDX-License-Identifier: Apache-2.0
"""Runs all cells, or those whose format or program are named, and writes the page's table anew.

.venv/bin/python tests/python/interop [NAME...]
"""

import datetime
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from interop.cells import BEGIN, END, HEAD, ROOT, row, rows_of
from interop.formats import CELLS

PAGE = ROOT / "docs/files.md"


def main() -> None:
    page = PAGE.read_text()
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    old = {tuple(line.split(" | ")[:3]): line for line in rows_of(page)}
    lines = []
    for cell in CELLS:
        names = (f"| {cell.format}", cell.direction, cell.program)
        wanted = not sys.argv[1:] or {cell.format, cell.program} & set(sys.argv[1:])
        if not wanted and names in old:
            lines.append(old[names])
            continue
        told = {}
        if not cell.why_not:
            with tempfile.TemporaryDirectory() as folder:
                told = cell.run(Path(folder))
        lines.append(row(cell, told, today))
        print(lines[-1])
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    PAGE.write_text(before + "\n".join([BEGIN, "", HEAD, *lines, "", END]) + after)


main()
