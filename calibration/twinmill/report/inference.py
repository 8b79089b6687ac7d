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
from twinmill.diagnosis.infer import Inference
from twinmill.fitting.compare import LACKING
from twinmill.inference.answer import LIKELY, PASSES, Answer, Named, units_of
from twinmill.inference.settings import PRIORS
from twinmill.listing import listed
from twinmill.model.parameters import catalogue
from twinmill.report import Figure, Section, comparisons, show, unnamed
from twinmill.report.canvas import FLOOR, PREDICTED, draw
from twinmill.report.charted import charts
from twinmill.report.error_figures import waterfall
from twinmill.report.sections import beside, robot_pictures
from twinmill.report.tables import VERDICTS, Cell, Table, number, of_unit, percent, tone

if TYPE_CHECKING:
    from twinmill.diagnosis.fleet import Fleet

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
OF_TABLES = (
    "Scores are RMS errors of readings over their floors, the largest by their logarithm. The "
    "models are the most probable ones, not those with the least score, so a score may also rise."
)
NOTHING, OUTSIDE = "Nothing is missing", "something outside the catalogue"
SEVERAL = "Several dependences may be there at once: their probabilities do not add up to 100 %."


def sentence(answer: Answer, nothing: str = NOTHING) -> str:
    """The verdict with its probability, and that the base's numbers are stale.

    Args:
        answer: with the verdict.
        nothing: words for that nothing is missing.
    """
    told = _verdict(answer, nothing)
    if _stale(answer) or answer.stale <= LIKELY or not told.startswith(LACKING):
        return told
    return f"{told} The base's numbers are stale, too ({percent(answer.stale)})."


def sentence_on(result: Inference) -> str:
    """The sentence on one robot or on tables: what its own log shows, too, is nothing new."""
    told = sentence(result.answer, "Nothing new is missing" if _no_news(result) else NOTHING)
    if result.answer.verdict in PASSES and result.always and (lacked := result.always.effects):
        return f"{told} It always lacked {listed(lacked)}, which `explain` writes."
    return told


def _verdict(answer: Answer, nothing: str) -> str:
    """The verdict in one sentence, with its probability; arguments as of `sentence`."""
    if answer.verdict == "cannot_tell":
        return f"This cannot be told: {', or '.join(_possible(answer))}."
    if answer.verdict in ("model_adequate", "refit_enough"):
        better = ", but the base's numbers are stale: fit it anew" if _stale(answer) else ""
        return f"{nothing} ({percent(answer.nothing)}){better}."
    names = " and ".join(_name(f) for f in answer.findings)
    if answer.verdict == "outside_catalogue":
        perhaps = f"; perhaps {names} as well or instead" if names else ""
        on = f", which depends on {words}" if (words := _words(answer)) else ""
        return f"{LACKING}{OUTSIDE} ({percent(answer.outside)}){on}{perhaps}."
    left = f"; what is left depends on {words}" if (words := _words(answer)) else ""
    return f"{LACKING}{names}{left}."


def _possible(answer: Answer) -> list[str]:
    """Things that may be missing, or that nothing is, with probabilities; the likeliest first."""
    each = {f"{name} is missing": p for name, p in answer.effects.items()}
    each |= {"nothing is missing": answer.nothing, OUTSIDE: answer.outside}
    likely = [words for words, p in each.items() if p >= PRIORS.member]
    return [f"{words} ({percent(each[words])})" for words in sorted(likely, key=lambda w: -each[w])]


def next_run(answer: Answer) -> str:
    """Purpose of another run, in a sentence; empty where no effect is in question."""
    if not answer.open:
        return ""
    names = listed([f"{name} ({percent(answer.effects[name])})" for name in answer.open])
    verb = "is" if len(answer.open) == 1 else "are"
    return f"{names} {verb} neither sure nor ruled out; another run would tell."


def section(result: Inference) -> Section:
    """The page on one robot, or on tables."""
    curves = [figure for left in result.left for figure in unnamed.figures(left)]
    notes = [*_formula(result), *_left_out(result), *_known(result)]
    bars = probabilities(result.answer)
    page = page_of(result, sentence_on(result), _tables(result), bars=bars, curves=curves)
    return replace(page, notes=notes)


def page_of(
    result: Inference | Fleet,
    told: str,
    tables: list[Table],
    *,
    bars: Figure,
    curves: Sequence[Figure] = (),
) -> Section:
    """The page on a result: scores, figures and tables.

    Args:
        result: logs of one robot or several, judged.
        told: verdict in words.
        tables: below the figures.
        bars: figure of probabilities.
        curves: figures on what has no name.
    """
    before, after, scores = result.before, result.after, _scores_of(result)
    errors = [("as given", before.shown), ("with what was found", beside(before, after))]
    return Section(
        f"What {before.model_name} lacks",
        [(label, number(value), tone(value)) for label, value in scores],
        told,
        comparisons.facts(before),
        [
            bars,
            *curves,
            _fall(scores, _about(result)),
            *robot_pictures(before, errors),
        ],
        tables,
        charts=charts(before, [("with what was found", robot.model) for robot in after.robots]),
        next_step=next_run(result.answer),
        warnings=[*result.strangers, *before.warnings],
        folded=[_priors()],
    )


def _about(result: Inference | Fleet) -> str:
    """Scores' meaning, of logs or of tables."""
    return OF_TABLES if isinstance(result, Inference) and result.of_tables else SCORES


def _scores_of(result: Inference | Fleet) -> list[tuple[str, float]]:
    """Scores of the given model, of its refitted base and of what was found, with their names."""
    scores = [("as given", result.before.score), ("base refitted", result.refitted.score)]
    return [*scores, ("with what was found", result.after.score)] if result.finds else scores


def _fall(scores: list[tuple[str, float]], about: str) -> Figure:
    """Fall of the score, with what the three models are."""
    drawn = waterfall(scores, "on what was judged")
    return replace(drawn, caption=f"{drawn.caption} {about}")


def probabilities(answer: Answer, title: str = "What is missing, with its probability") -> Figure:
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
        title,
        f"Several effects may be missing at once. Dashed: {PRIORS.sure:g}, from which on an effect "
        "is called sure.",
    )


def _priors() -> Table:
    """Numbers of prior knowledge, each with its meaning."""
    rows = [[Cell(name), Cell(f"{value:g}"), Cell(what)] for name, value, what in PRIORS.listed()]
    return Table("Prior knowledge", ["name", "value", "meaning"], rows, words=(0, 2))


def terminal(result: Inference) -> RenderableType:
    """Text on one robot: verdict, scores, effects, dependences, and errors that are not new."""
    return Group(
        Text(sentence_on(result), show.STYLES[VERDICTS[result.answer.verdict]]),
        *scores_in_words(result),
        Text(),
        *map(show.table, _tables(result)),
        *map(Text, (*_formula(result), *_left_out(result), *_known(result))),
        *([Text(step)] if (step := next_run(result.answer)) else []),
        *show.warned([*result.strangers, *result.before.warnings]),
    )


def scores_in_words(result: Inference | Fleet) -> list[Text]:
    """Scores of the three models in a line, and what they are where they do not fall."""
    scores = (
        f"score {number(result.before.score)} as given, "
        f"{number(result.refitted.score)} after a refit of the base"
    )
    if result.finds:
        scores += f", {number(result.after.score)} with what was found"
    falls = result.before.score >= result.refitted.score >= result.after.score
    return [Text(scores), *([] if falls else [Text(_about(result))])]


def _tables(result: Inference) -> list[Table]:
    return [*of_answer(result.answer), *([unseen(result.not_shown)] if result.not_shown else [])]


def of_answer(answer: Answer) -> list[Table]:
    """Tables of effects and dependences with their probabilities."""
    return [
        *([_effects(answer.findings)] if answer.findings else []),
        *([_dependences(answer)] if answer.depends_on else []),
        *([others] if (others := _others(answer)) else []),
    ]


def unseen(not_shown: dict[str, str]) -> Table:
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
        what = "table" if result.of_tables else "log"
        return [f"This {what} told the base, too, so that all is named that the base misses in it."]
    if result.of_tables:
        return []
    if always is None:
        return [
            "The model's error on the log that it was fitted to is not known, so it may be "
            f"reported as new: give that log with {option('own')}, and store its result with "
            f"{option('keep')}."
        ]
    known = _no_news(result)
    return [f"No news, since its own log shows it: {', '.join(known)}."] if known else []


def _no_news(result: Inference) -> list[str]:
    """Names of effects and kernels that the model lacks in its own log, too."""
    always = result.always
    return [*always.effects, *(name for name, _ in always.kernels)] if always else []


def _stale(answer: Answer) -> bool:
    return answer.verdict == "refit_enough"


def _name(found: Named) -> str:
    if found.certainty == "group":
        return f"one of {', '.join(found.group)} ({percent(found.group_probability)})"
    word = "" if found.certainty == "sure" else ", not sure"
    return f"{found.effect} ({percent(found.probability)}{word})"


def _words(answer: Answer) -> str:
    """Dependences of what has no name, with their probabilities; empty if there is none."""
    words = [f"{word} ({percent(answer.depends_on[word])})" for word in answer.sure_words]
    return listed(words) if words else ""


def _effects(findings: list[Named]) -> Table:
    rows = []
    for f in findings:
        for k, (name, (value, std)) in enumerate(f.numbers.items() or [("", (None, None))]):
            rows.append(
                [
                    Cell("" if k else f.effect),
                    Cell("" if k else percent(f.probability), bar=None if k else f.probability),
                    Cell(name),
                    Cell(give_or_take(value, std)),
                    Cell(of_unit(units_of(f.effect).get(name, ""))),
                ]
            )
    columns = ["effect", "probability", "number", "value ± std", "unit"]
    note = "\n".join(f"{f.effect}: {catalogue()[f.effect]['summary']}" for f in findings)
    return Table("Missing effects", columns, rows, words=(0, 2, 4), note=note)


def give_or_take(value: float | None, std: float | None) -> str:
    """A number with its standard deviation where that is known."""
    known = std is not None and np.isfinite(std)
    return f"{number(value)} ± {number(std, 2)}" if known else number(value)


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
