# SPDX-License-Identifier: Apache-2.0
"""firmware/README.md says of states, conditions and transitions what the program has.

Run as a program it writes them there: `make format`.
"""

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "firmware/README.md"
BEGIN, END = "<!-- made by `make format` from app/robot_state.c -->\n", "<!-- until here -->\n"
PROGRAM = os.environ.get("STATE_TABLES", str(ROOT / "build/tests/app/state_tables"))


def with_tables(text: str) -> str:
    """The page with the tables that the program has."""
    before, rest = text.split(BEGIN)
    tables = subprocess.run(PROGRAM.split(), capture_output=True, text=True, check=True).stdout
    return f"{before}{BEGIN}{tables}{END}{rest.split(END)[1]}"


def test_readme_has_the_programs_states():
    text = README.read_text(encoding="utf-8")
    assert text == with_tables(text), "make format writes them"


if __name__ == "__main__":
    README.write_text(with_tables(README.read_text(encoding="utf-8")), encoding="utf-8")
