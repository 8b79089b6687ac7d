# SPDX-License-Identifier: Apache-2.0
"""Starts the program twin_run, which a wheel keeps inside the package."""

import os
import sys

from twinmill.programs import find_program


def main() -> None:
    """Entry point: becomes the program."""
    try:
        program = find_program("twin_run")
        os.execv(program, [str(program), *sys.argv[1:]])
    except (ValueError, OSError) as error:
        sys.exit(f"twin_run: {error}")
