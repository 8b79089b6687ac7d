# SPDX-License-Identifier: Apache-2.0
"""The HTML report: one file that needs no other, for people who did not run the comparison."""

from twinmill.report.html import Figure, Provenance, Section, render_page, write_report
from twinmill.report.sections import added_section, comparison_section, fit_section, steps_section

__all__ = [
    "Figure",
    "Provenance",
    "Section",
    "added_section",
    "comparison_section",
    "fit_section",
    "render_page",
    "steps_section",
    "write_report",
]
