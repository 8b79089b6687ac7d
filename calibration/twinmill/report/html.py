# SPDX-License-Identifier: Apache-2.0
"""Sections of text, tables and figures to one HTML file."""

import re
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path

from markupsafe import Markup, escape

from twinmill.files import REPORT, check_report, made_folder
from twinmill.foreign_text import printable
from twinmill.model.model_file import write_whole
from twinmill.provenance import Provenance
from twinmill.report.canvas import Svg
from twinmill.report.tables import Table, Tone


@dataclass(frozen=True)
class Figure:
    """A picture as SVG text, and what is to be seen in it, in plain words."""

    svg: Svg
    title: str
    caption: str


@dataclass(frozen=True)
class Section:
    """One step of the work.

    Attributes:
        title: of the step.
        score: label, number and colour of each score shown large.
        verdict: what the score means; each line stands alone.
        facts: label and text.
        figures, tables: in their order.
        charts: HTML, made when it is asked for, of which a page has one: that of its last section
            that has any; None without.
        next_step: a sentence.
        commands: where or when, and the command line to type there; below next_step.
        transcript: titles, each with commands and what they printed, below the facts.
        notes: sentences on the result, below the verdict.
        warnings: sentences.
        folded: tables that are opened when they are asked for, at the end.
    """

    title: str
    score: list[tuple[str, str, Tone]]
    verdict: str
    facts: list[tuple[str, str]] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    _: KW_ONLY
    charts: Callable[[], str] | None = None
    next_step: str = ""
    commands: list[tuple[str, str]] = field(default_factory=list)
    transcript: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    folded: list[Table] = field(default_factory=list)


SCORE_NOTE = (
    "The score is prediction error over what noise alone would cause: 1.0 is as good as this log "
    "can tell, above about 1.3 something is missing in the model, below 0.9 it predicts better "
    "than the best model found, from whose noise the floor comes."
)


def write_report(
    folder: Path,
    title: str,
    source: Provenance,
    sections: list[Section],
    *,
    note: str = SCORE_NOTE,
) -> Path:
    """Writes index.html into a folder, which is made if need be.

    The same input gives the same bytes: no date but the log's is in it.

    Returns:
        Path of the file.

    Raises:
        ValueError: it cannot be written, or what is there is no report.
    """
    check_report(Path(folder))
    path = Path(folder) / "index.html"
    with made_folder(Path(folder)):
        write_whole(path, render_page(title, source, sections, note))
    return path


def coded(text: str) -> Markup:
    """HTML of a text in which commands stand between back quotes."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(printable(text)))))


def _shown(value: object) -> object:
    """A text without what would turn it round or hide it: names of files may be anybody's."""
    return printable(value) if type(value) is str else value


def render_page(title: str, source: Provenance, sections: list[Section], note: str) -> str:
    """The HTML text; the same input gives the same."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # most answers are no page

    environment = Environment(
        loader=PackageLoader("twinmill.report", "."),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["coded"] = coded
    charted = next((s for s in reversed(sections) if s.charts), None)
    return environment.get_template("report.html.j2").render(
        generator=Markup(REPORT),
        title=title,
        source=source,
        sections=sections,
        note=note,
        charted=charted,
    )
