# SPDX-License-Identifier: Apache-2.0
"""Motion capture: exports and streams that only the makers' programs write."""

from interop.cells import Cell

_LICENCE = "it needs Windows, a licence and cameras"
_LAID_OUT = f"{_LICENCE}; files laid out by its manual are read in the tests"

NOT_RUN = [
    *(
        Cell("Motive CSV", "reads", f"Motive {version}", why_not=_LAID_OUT)
        for version in ("1.2x", "2.x", "3.x")
    ),
    *(Cell("Vicon CSV", "reads", program, why_not=_LAID_OUT) for program in ("Tracker", "Nexus")),
    *(
        Cell(
            "NatNet",
            "reads",
            f"Motive, NatNet {version}",
            why_not=f"{_LICENCE}; packets laid out by its SDK are read in the tests",
        )
        for version in ("3", "4")
    ),
]
