# SPDX-License-Identifier: Apache-2.0
"""The HTML report: one file that needs no other, for people who did not run the comparison."""

from twinmill.provenance import Provenance
from twinmill.report.html import Figure, Section, render_page, write_report

__all__ = [
    "Figure",
    "Provenance",
    "Section",
    "render_page",
    "write_report",
]
