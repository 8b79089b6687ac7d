# SPDX-License-Identifier: Apache-2.0
"""Services of their page to all panels; numbers, tones and refusals in words."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from markupsafe import Markup
from nicegui import ui

from twinmill.fitting.compare import GOOD, MISSING
from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.model.parameters import ParameterEstimate
from twinmill.report import tables
from twinmill.workbench.bench import Bench


class PageActions(Protocol):
    """Requests that a panel may make of the page that shows it.

    Attributes:
        bench: what all pages show.
    """

    bench: Bench

    async def start(self, kind: str, effect: str = "", options: dict | None = None) -> None:
        """A fit, an addition, a diagnosis, a next run or a swarm."""

    async def design(self) -> None:
        """Designs the run that parts what cannot be parted, in its panel."""

    async def try_beside(self, effect: str, robot_id: int | None = None) -> None:
        """Draws what an effect would change beside the model; once more takes it away."""

    async def keep(self, name: str, value: float) -> None:
        """A knob was let go at a value."""

    async def go(self, number: int) -> None:
        """To a model tried before."""

    def javascript(self, code: str) -> None:
        """Runs in this page's browser."""


def check_free(path: Path) -> None:
    """Raises ValueError if a file is there, in words that do for a page: it has no --force."""
    if path.is_file():
        raise ValueError(f"{path}: exists; choose another name.")


def escaped(form: str, *values: object) -> Markup:
    """HTML with texts in it: names of files, effects and behaviours may be anybody's.

    Args:
        form: HTML of ours, with {} where a text stands.
        values: the texts, shown as they are; Markup stays markup.
    """
    shown = [v if isinstance(v, Markup) else plain_line(str(v), MESSAGE_MAX) for v in values]
    return Markup(form).format(*shown)


def markup(form: str, *values: object) -> ui.html:
    """An element that shows what `escaped` makes; the only way to HTML in the workbench."""
    return ui.html(escaped(form, *values), sanitize=False)


def commands_html(commands: Sequence[str]) -> Markup:
    """Commands to be copied, a line each; lines break between words alone, not in `--n`."""
    lines = [
        Markup(" ").join(escaped("<span>{}</span>", word) for word in line.split(" "))
        for line in commands
    ]
    return escaped('<pre class="command">{}</pre>', Markup("\n").join(lines))


def scored(score: float | None) -> str:
    """A score, or a dash."""
    return "-" if score is None or math.isnan(score) else f"{score:#.3g}".rstrip(".")


def tone(score: float | None) -> str:
    """CSS class of a score."""
    if score is None or not math.isfinite(score):
        return "soft"
    return "good" if score <= GOOD else "warn" if score <= MISSING else "bad"


def estimate(entry: dict) -> str:
    """A parameter as --json gives it, in the words of the reports."""
    std = float("nan") if entry["std"] is None else entry["std"]
    told = {
        "at_bound": False,
        "seen": True,
        **entry,
        "std": std,
    }  # by probabilities neither is told
    return tables.estimate(ParameterEstimate(**told))
