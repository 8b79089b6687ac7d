# SPDX-License-Identifier: Apache-2.0
"""An effect added to the camera, for the terminal and as a section of a report."""

from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.diagnosis.detections.add import DetectionAddition
from twinmill.report import show, tables
from twinmill.report.detection_figures import field_of_view
from twinmill.report.detection_tables import detection_tables
from twinmill.report.html import Section
from twinmill.report.tables import number, tone


def addition(result: DetectionAddition) -> RenderableType:
    """What a person reads of an added effect."""
    return Group(
        Text(
            f"bits' score {number(result.before.score)} → {number(result.after.score)}, held out "
            f"{number(result.heldout_before)} → {number(result.heldout_after)} without and with it"
        ),
        Text(),
        show.table(tables.parameters(result.parameters)),
        *(show.table(t) for t in detection_tables(result.after)),
        Text(f"Written: {result.path}"),
    )


def addition_section(result: DetectionAddition, model_name: str) -> Section:
    """Of a report."""
    scores = [
        ("bits before", number(result.before.score), tone(result.before.score)),
        ("bits after", number(result.after.score), tone(result.after.score)),
    ]
    return Section(
        f"{result.effect} added to {model_name}",
        scores,
        f"Held out: {number(result.heldout_before)} without, {number(result.heldout_after)} with.",
        figures=[field_of_view(result.after)],
        tables=[tables.parameters(result.parameters), *detection_tables(result.after)],
    )
