# SPDX-License-Identifier: Apache-2.0
"""Posterior probabilities of effects, as sentences and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.arguments import option
from twinmill.fitting.compare import Comparison
from twinmill.inference.answer import Answer, Named, units_of
from twinmill.inference.infer import Inference
from twinmill.inference.robots import shared
from twinmill.inference.settings import PRIORS
from twinmill.listing import listed
from twinmill.model.parameters import catalogue
from twinmill.report import Figure, Section, comparisons, show, unnamed
from twinmill.report.canvas import FLOOR, PREDICTED, draw
from twinmill.report.charted import charts
from twinmill.report.error_figures import waterfall
from twinmill.report.sections import beside, robot_pictures
from twinmill.report.tables import VERDICTS, Cell, Table, number, of_unit, tone

if TYPE_CHECKING:
    from twinmill.inference.better import Better

ONE_BY_ONE = (
    "Robots of one model differ by an amount that infer does not know: a small effect of one robot "
    "alone may be its own gains. For all results of one robot, give its logs alone."
)
LIKELY = 0.5  # probability of what is said in the sentences on several robots
SHOWN = 0.01  # probability of an effect that is listed; --json has all
SHARES = (
    "Shares are of the squared error that the refitted base leaves above the noise: an effect's is "
    "that of the change that it makes by itself, a dependence's what it removes beside these "
    "effects. What changes the same motion overlaps, so they do not add up to 100 %."
)
SCORES = (
    "Scores are RMS errors of predictions 0.1 to 2 s ahead over the noise floor. The models are "
    "the most probable ones by steps of 0.1 s and what was known before, not those with the least "
    "score, so a score may also rise; what has no name is in them by its formula alone."
)
SEVERAL = "Several dependences may be there at once: their probabilities do not add up to 100 %."


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


def next_run(answer: Answer) -> str:
    """Purpose of another run, in a sentence; empty where no effect is in question."""
    if not answer.open:
        return ""
    names = listed([f"{name} ({percent(answer.effects[name])})" for name in answer.open])
    verb = "is" if len(answer.open) == 1 else "are"
    return f"{names} {verb} neither sure nor ruled out; another run would tell."


def terminal_of_robots(
    results: Sequence[Inference], commands: show.Commands = (), written: Better | None = None
) -> RenderableType:
    """Text on the robots of a log: of one all, of several what is missing of each.

    Args:
        results: one for each robot.
        commands: what to type then, each with why.
        written: the new model of one robot.
    """
    if len(results) > 1:
        told = map(Text, shared_words(results))
        return Group(*told, Text(), show.table(_robots(results)), Text(ONE_BY_ONE))
    new = [Text(), Text(_new(written))] if written else []
    return Group(terminal(results[0]), *new, *show.typed_next(commands))


def section(
    results: Sequence[Inference], commands: show.Commands = (), written: Better | None = None
) -> Section:
    """The page on the robots of a log: verdicts, figures, tables and the commands that follow.

    Args:
        results: as of `terminal_of_robots`.
        commands: likewise.
        written: likewise.
    """
    before, refitted, after = (
        _joined([getattr(result, which) for result in results])
        for which in ("before", "refitted", "after")
    )
    scores = [("as given", before.score), ("base refitted", refitted.score)]
    if any(result.finds for result in results):
        scores.append(("with what was found", after.score))
    errors = [("as given", before.shown), ("with what was found", beside(before, after))]
    one = results[0] if len(results) == 1 else None
    return Section(
        f"What {before.model_name} lacks",
        [(label, number(value), tone(value)) for label, value in scores],
        "\n".join(_verdicts(results)),
        comparisons.facts(before),
        [
            *([probabilities(one.answer)] if one else []),
            *(figure for left in (one.left if one else ()) for figure in unnamed.figures(left)),
            _fall(scores),
            *robot_pictures(before, errors),
        ],
        _tables(one) if one else [_robots(results)],
        charts=charts(before, [("with what was found", robot.model) for robot in after.robots]),
        next_step=next_run(one.answer) if one else "",
        commands=[(f"{why}:", command) for why, command in commands],
        notes=[
            *([*_formula(one), *_left_out(one), *_known(one)] if one else [ONE_BY_ONE]),
            *([_new(written)] if written else []),
        ],
        warnings=[*results[0].strangers, *before.warnings],
        folded=[_priors()],
    )


def _joined(each: Sequence[Comparison]) -> Comparison:
    """One comparison of the robots of several."""
    robots = [robot for one in each for robot in one.robots]
    return replace(each[0], robots=robots, warnings=[w for one in each for w in one.warnings])


def _fall(scores: list[tuple[str, float]]) -> Figure:
    """Fall of the score, with what the three models are."""
    drawn = waterfall(scores, "on the logs that were judged")
    return replace(drawn, caption=f"{drawn.caption} {SCORES}")


def _verdicts(results: Sequence[Inference]) -> list[str]:
    if len(results) == 1:
        return [sentence(results[0].answer)]
    return shared_words(results)


def shared_words(results: Sequence[Inference]) -> list[str]:
    """Sentences on what several robots lack together, and what each lacks beside that."""
    found = shared([result.table for result in results])
    of_all = _likely(found.things, found.words)
    none = f"Nothing is missing of all {len(results)} robots ({percent(found.nothing)})."
    words = [f"All {len(results)} robots lack {listed(of_all)}." if of_all else none]
    for result, own in zip(results, found.own, strict=True):
        if likely := _likely(own, found.words):
            words.append(f"{_label(result)} lacks {listed(likely)}{' besides' if of_all else ''}.")
    return words


def _likely(things: dict[str, float], dependences: frozenset[str]) -> list[str]:
    """Words on the things that are likelier than not."""
    told = []
    for name, p in things.items():
        if p > LIKELY:
            what = f"something that depends on {name}" if name in dependences else name
            told.append(f"{what} ({percent(p)}{'' if p >= PRIORS.sure else ', not sure'})")
    return told


def _label(result: Inference) -> str:
    return f"R{result.measurements[0].track.robot_id:02d}"


def probabilities(answer: Answer) -> Figure:
    """Bars of the probability of each effect, of nothing and of an unknown cause."""
    told = {"nothing is missing": answer.nothing, "outside the catalogue": answer.outside}
    effects = {name: p for name, p in answer.effects.items() if p >= SHOWN}
    rows = dict(sorted({**told, **effects}.items(), key=lambda row: -row[1]))
    values = np.array([*rows.values()])

    def paint(axes: Any) -> None:
        at = np.arange(len(rows))
        colours = [PREDICTED if name in effects else FLOOR for name in rows]
        axes.barh(at, values, color=colours, height=0.62)
        for y, value in zip(at, values, strict=True):
            axes.annotate(
                percent(value),
                (value, y),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontweight="bold",
            )
        axes.axvline(PRIORS.sure, color="#3c3c3c", lw=1, ls="--")
        axes.set(xlim=(0, 1.12), ylim=(len(rows) - 0.4, -0.6), xlabel="posterior probability")
        axes.set_yticks(at, [*rows])
        axes.grid(False, axis="y")

    return Figure(
        draw(0.9 + 0.36 * max(len(rows), 3), paint),
        "What is missing, with its probability",
        f"Several effects may be missing at once. Dashed: {PRIORS.sure:g}, from which on an effect "
        "is called sure.",
    )


def _priors() -> Table:
    """Numbers of prior knowledge, each with its meaning."""
    rows = [[Cell(name), Cell(f"{value:g}"), Cell(what)] for name, value, what in PRIORS.listed()]
    return Table("Prior knowledge", ["name", "value", "meaning"], rows, words=(0, 2))


def _new(written: Better) -> str:
    has = f"has {', '.join(written.added)}" if written.added else "has the base's new numbers"
    return (
        f"{written.file.path} {has}: score {number(written.before.score)} without, "
        f"{number(written.after.score)} with (1 is as good as the log can tell)."
    )


def _robots(results: Sequence[Inference]) -> Table:
    rows = []
    for result in results:
        numbers = "; ".join(
            f"{f.effect}.{name} {number(value)} ± {number(std, 2)} "
            f"{of_unit(units_of(f.effect).get(name, ''))}".rstrip()
            for f in result.answer.findings
            for name, (value, std) in f.numbers.items()
        )
        rows.append([Cell(_label(result)), Cell(sentence(result.answer)), Cell(numbers)])
    return Table("Each robot by itself", ["robot", "answer", "numbers"], rows, words=(0, 1, 2))


def terminal(result: Inference) -> RenderableType:
    """Text on one robot: verdict, scores, effects, dependences, and errors that are not new."""
    scores = (
        f"score {number(result.before.score)} as given, "
        f"{number(result.refitted.score)} after a refit of the base"
    )
    if result.finds:
        scores += f", {number(result.after.score)} with what was found"
    falls = result.before.score >= result.refitted.score >= result.after.score
    return Group(
        Text(sentence(result.answer), show.STYLES[VERDICTS[result.answer.verdict]]),
        Text(scores),
        *([] if falls else [Text(SCORES)]),
        Text(),
        *map(show.table, _tables(result)),
        *map(Text, (*_formula(result), *_left_out(result), *_known(result))),
        *([Text(step)] if (step := next_run(result.answer)) else []),
        *show.warned([*result.strangers, *result.before.warnings]),
    )


def _tables(result: Inference) -> list[Table]:
    answer = result.answer
    return [
        *([_effects(answer.findings)] if answer.findings else []),
        *([_dependences(answer)] if answer.depends_on else []),
        *([others] if (others := _others(answer)) else []),
        *([_unseen(result.not_shown)] if result.not_shown else []),
    ]


def _unseen(not_shown: dict[str, str]) -> Table:
    """Effects that these logs cannot show, those of one reason in a row."""
    of_why: dict[str, list[str]] = {}
    for effect, why in not_shown.items():
        of_why.setdefault(why, []).append(effect)
    rows = [[Cell(", ".join(effects)), Cell(why)] for why, effects in of_why.items()]
    return Table("Not shown by these logs", ["effects", "why"], rows, words=(0, 1))


def _formula(result: Inference) -> list[str]:
    """The formula of what has no name, in a sentence; none where there is none."""
    found = result.formula
    if found is None or not found.holds:
        return []
    spans = listed([f"{n['name']} {number(n['low'])} to {number(n['high'])}" for n in found.spans])
    run = ", in this log alone" if found.of_one_run else ""
    return [
        f"What depends on {found.word} follows a formula ({percent(found.probability)}){run}: "
        f"{found.text} (95 %: {spans})."
    ]


def _left_out(result: Inference) -> list[str]:
    """A sentence on effects that `explain` does not add; none where it adds what lasts."""
    lasting = result.lasting
    if result.added or not lasting:
        return []
    what, it = f"{lasting[0]} is not sure", "it"
    if len(lasting) > 1:
        what, it = f"None of {listed(lasting)} is sure", "them"
    return [f"{what}, and predictions are no better with {it}: explain leaves {it} out."]


def _known(result: Inference) -> list[str]:
    """Errors that are not new, as far as they are known, in sentences."""
    always = result.always
    if always is None and result.told_here:
        return ["This log told the base, too, so that all is named that the base misses in it."]
    if always is None:
        return [
            "The model's error on the log that it was fitted to is not known, so it may be "
            f"reported as new: give that log with {option('own')}, and store its result with "
            f"{option('keep')}."
        ]
    known = [*always.effects, *(name for name, _ in always.kernels)]
    return [f"No news, since its own log shows it: {', '.join(known)}."] if known else []


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
    words = [f"{word} ({percent(answer.depends_on[word])})" for word in answer.sure_words]
    return f"; what is left depends on {listed(words)}"


def _effects(findings: list[Named]) -> Table:
    rows = []
    for f in findings:
        for k, (name, (value, std)) in enumerate(f.numbers.items() or [("", (None, None))]):
            rows.append(
                [
                    Cell("" if k else f.effect),
                    Cell("" if k else percent(f.probability), bar=None if k else f.probability),
                    Cell(name),
                    Cell(f"{number(value)} ± {number(std, 2)}"),
                    Cell(of_unit(units_of(f.effect).get(name, ""))),
                ]
            )
    columns = ["effect", "probability", "number", "value ± std", "unit"]
    note = "\n".join(f"{f.effect}: {catalogue()[f.effect]['summary']}" for f in findings)
    return Table("Missing effects", columns, rows, words=(0, 2, 4), note=note)


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
    return Table("The residual depends on", ["", "probability"], rows, note=of_rest(answer))


def of_rest(answer: Answer) -> str:
    """Share of the likeliest dependence, in a sentence, and what its shares and chances are of."""
    several = f" {SEVERAL}" if len(answer.depends_on) > 1 else ""
    first = next(iter(answer.depends_on))
    return f"What depends on {first} makes {percent(answer.share)}.{several} {SHARES}"
