# SPDX-License-Identifier: Apache-2.0
"""Posterior probabilities of effects, as sentences and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.arguments import option
from twinmill.inference.answer import Answer, Named
from twinmill.inference.infer import Inference
from twinmill.model.parameters import catalogue
from twinmill.report import show
from twinmill.report.tables import Cell, Table, number

if TYPE_CHECKING:
    from twinmill.inference.better import Better

ONE_BY_ONE = (
    "Robots of one model differ by an amount that infer does not know: a small effect of one robot "
    "alone may be its own gains. For all results of one robot, give its logs alone."
)
SHOWN = 0.01  # probability of an effect that is listed; --json has all


def sentence(answer: Answer) -> str:
    """The verdict in one sentence, with its probability."""
    if answer.verdict == "cannot_tell":
        return (
            f"This log cannot tell: nothing is missing ({percent(answer.nothing)}), or something "
            f"outside the catalogue ({percent(answer.outside)}), or an effect."
        )
    if answer.verdict in ("model_adequate", "refit_enough"):
        better = ", but the base's numbers are stale: fit it anew" if _stale(answer) else ""
        return f"Nothing is missing ({percent(answer.nothing)}){better}."
    names = " and ".join(_name(f) for f in answer.findings)
    if answer.verdict == "outside_catalogue":
        like = f", most like {names}" if names else ""
        outside = f"something outside the catalogue ({percent(answer.outside)})"
        return f"Missing: {outside}{like}{_on(answer)}."
    return f"Missing: {names}{_on(answer)}."


def terminal_of_robots(
    results: list[Inference], commands: show.Commands = (), written: Better | None = None
) -> RenderableType:
    """Text of `twinmill lab infer`: of one robot all, of several what is missing of each.

    Args:
        results: one for each robot.
        commands: what to type then, each with why.
        written: the new model of one robot.
    """
    if len(results) > 1:
        return Group(show.table(_robots(results)), Text(ONE_BY_ONE))
    new = [Text(), Text(_new(written))] if written else []
    return Group(terminal(results[0]), *new, *show.typed_next(commands))


def _new(written: Better) -> str:
    has = f"has {', '.join(written.added)}" if written.added else "has the base's new numbers"
    return (
        f"{written.file.path} {has}: score {number(written.before.score)} without, "
        f"{number(written.after.score)} with (1 is as good as the log can tell)."
    )


def _robots(results: list[Inference]) -> Table:
    rows = []
    for result in results:
        numbers = "; ".join(
            f"{f.effect}.{name} {number(value)} ± {number(std, 2)}"
            for f in result.answer.findings
            for name, (value, std) in f.numbers.items()
        )
        robot = f"R{result.measurements[0].track.robot_id:02d}"
        rows.append([Cell(robot), Cell(sentence(result.answer)), Cell(numbers)])
    return Table("Each robot by itself", ["robot", "answer", "numbers"], rows, words=(0, 1, 2))


def terminal(result: Inference) -> RenderableType:
    """Text on one robot: verdict, effects, dependences, and errors that are not new."""
    answer = result.answer
    parts: list[RenderableType] = [Text(sentence(answer)), Text()]
    if answer.findings:
        parts.append(show.table(_effects(answer.findings)))
    if answer.depends_on:
        parts.append(show.table(_dependences(answer)))
    if others := _others(answer):
        parts.append(show.table(others))
    if result.always is None:
        parts.append(
            Text(
                "The model's error on the log that it was fitted to is not known, so it may be "
                f"reported as new: give that log with {option('own')}, and store its result with "
                f"{option('keep')}."
            )
        )
    elif result.always.kernels or result.always.effects:
        known = ", ".join([*result.always.effects, *(name for name, _ in result.always.kernels)])
        parts.append(Text(f"Not reported, since its own log shows it, too: {known}."))
    return Group(*parts)


def percent(probability: float) -> str:
    """A probability in percent; none is certain."""
    if probability > 0.99:
        return f"{min(100 * probability, 99.9):.1f} %"
    return f"{100 * probability:.0f} %" if probability >= 0.01 else "< 1 %"


def _stale(answer: Answer) -> bool:
    return answer.verdict == "refit_enough"


def _name(found: Named) -> str:
    if found.certainty == "group":
        return f"one of {', '.join(found.group)} ({percent(found.group_probability)})"
    word = "" if found.certainty == "sure" else ", not sure"
    return f"{found.effect} ({percent(found.probability)}{word})"


def _on(answer: Answer) -> str:
    if not answer.depends_on:
        return ""
    word, p = next(iter(answer.depends_on.items()))
    return f"; what is left depends on {word} ({percent(p)})"


def _effects(findings: list[Named]) -> Table:
    rows = []
    for f in findings:
        for k, (name, (value, std)) in enumerate(f.numbers.items() or [("", (None, None))]):
            rows.append(
                [
                    Cell("" if k else f.effect),
                    Cell("" if k else percent(f.probability), bar=None if k else f.probability),
                    Cell(name),
                    Cell(number(value)),
                    Cell(f"± {number(std, 2)}"),
                    Cell("" if k else str(catalogue()[f.effect]["summary"])),
                ]
            )
    columns = ["effect", "probability", "number", "value", "std", "what it is"]
    return Table("Missing effects", columns, rows, words=(0, 2, 5))


def _others(answer: Answer) -> Table | None:
    """Effects that are no finding, and not ruled out; None where all are."""
    found = {f.effect for f in answer.findings}
    rows = [
        [Cell(name), Cell(percent(p), bar=p)]
        for name, p in answer.effects.items()
        if name not in found and p >= SHOWN
    ]
    return Table("Not ruled out", ["effect", "probability"], rows) if rows else None


def _dependences(answer: Answer) -> Table:
    rows = [[Cell(word), Cell(percent(p), bar=p)] for word, p in answer.depends_on.items()]
    note = f"The first explains {percent(answer.share)} of the squared error above the noise."
    return Table("The residual depends on", ["", "probability"], rows, note=note)
