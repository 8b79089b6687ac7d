# SPDX-License-Identifier: Apache-2.0
"""One result of `diagnose`, of a robot or of several, as a sentence, JSON, text and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.diagnosis.fleet import Fleet
from twinmill.diagnosis.infer import Inference
from twinmill.report import Figure, Section, fleet, inference, show
from twinmill.report.tables import number

if TYPE_CHECKING:
    from twinmill.diagnosis.better import Better


def sentence(result: Inference | Fleet) -> str:
    """The verdict, with its probability."""
    if isinstance(result, Fleet):
        return fleet.fleet_sentence(result)
    return inference.sentence_on(result)


def bars(result: Inference | Fleet) -> Figure:
    """Figure of the probability of each effect; of several robots, that all lack it."""
    if isinstance(result, Fleet):
        return fleet.bars(result)
    return inference.probabilities(result.answer)


def to_json(result: Inference | Fleet) -> dict[str, Any]:
    """Fields of `twinmill diagnose --json`, its sentences among them."""
    told = {"sentence": sentence(result), **result.to_json()}
    if isinstance(result, Fleet):
        told["robots_off"] = fleet.robots_off(result)
        told["robots"] = [to_json(robot) for robot in result.robots]
    return told


@dataclass(frozen=True)
class Told:
    """A result, and what is said beside it.

    Attributes:
        result: logs, judged.
        commands: what to type then, each with why.
        written: the new model; None where none is.
        notes: further sentences.
    """

    result: Inference | Fleet
    commands: show.Commands = ()
    written: Better | None = None
    notes: Sequence[str] = ()


def terminal(told: Told) -> RenderableType:
    """Text for a terminal."""
    result = told.result
    shown = fleet.terminal(result) if isinstance(result, Fleet) else inference.terminal(result)
    return Group(
        shown,
        *map(Text, told.notes),
        *([Text(), Text(_new_model(told.written))] if told.written else []),
        *show.typed_next(told.commands),
    )


def section(told: Told) -> Section:
    """Page of a report."""
    result = told.result
    page = fleet.section(result) if isinstance(result, Fleet) else inference.section(result)
    new = [_new_model(told.written)] if told.written else []
    return replace(
        page,
        commands=[(f"{why}:", command) for why, command in told.commands],
        notes=[*page.notes, *told.notes, *new],
    )


def _new_model(written: Better) -> str:
    """Sentence on a file that was written, with both scores."""
    has = f"has {', '.join(written.added)}" if written.added else "has the base's new numbers"
    return (
        f"{written.file.path} {has}: score {number(written.before.score)} without, "
        f"{number(written.after.score)} with (1 is as good as the log can tell)."
    )
