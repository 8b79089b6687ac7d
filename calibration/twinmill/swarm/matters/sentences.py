# SPDX-License-Identifier: Apache-2.0
"""Sentences on the parts of a model that matter."""

from collections.abc import Sequence
from typing import Any

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.listing import listed
from twinmill.swarm.matters.differences import Difference
from twinmill.swarm.matters.sensitivity import (
    MATTERS,
    NOTHING,
    UNSURE,
    FactorResult,
    Outcome,
    Sensitivity,
)

VERBS = {MATTERS: "matters", UNSURE: "may matter", NOTHING: "does not matter"}
TELLS = 0.1  # relative change of a median that is worth a word
WORDS = {
    "radius_m": ("radius", 1.0, " m"),
    "settled_s": ("time to form", 1.0, " s"),
    "circliness": ("circliness", 1.0, ""),
}
NAMED = 4  # of a list in a sentence


def sentence(result: FactorResult) -> str:
    """Sentence on one part's weight for the swarm, with the shares that show it."""
    factor, worst = result.factor, result.worst
    verb = VERBS[result.verdict]
    low, high = result.shares
    before, after = percent(worst.share.before), percent(worst.share.after)
    if factor.kind == "effect":
        text = f"{factor.name} {verb}: {before} with it, {after} without"
    elif factor.kind == "parameter":
        span = f"{100 * low:.0f} to {percent(high)}"
        text = f"{factor.name} {verb} {factor.about}: {span}"
    elif factor.kind == "hidden":
        even = " even" if result.verdict == NOTHING else ""
        text = f"{factor.name} {verb},{even} at {_inside(worst)}: {before} become {after}"
    elif factor.kind == "robots":
        text = f"That robots differ {verb}: {before} as they are, {after} were they alike"
    else:
        text = f"{_capital(worst.change.what)} {verb}: {before} become {after}"
        if factor.about == "one robot without it":
            text = f"One robot without {factor.name} {verb}: {before} become {after}"
    return f"{text} ({points(worst.share)}, {worst.seeds} runs{_besides(worst)})."


def label(result: FactorResult) -> str:
    """Short name of the change."""
    factor = result.factor
    if factor.kind == "effect":
        return f"{factor.name} left out"
    if factor.kind == "hidden":
        return f"{factor.name}, not excluded"
    if factor.kind == "robots":
        return "robots all alike"
    if factor.about == "one robot without it":
        return f"one robot without {factor.name}"
    what = result.worst.change.what
    return what if factor.kind == "parameter" else what.partition(" (")[0]


def headline(found: Sensitivity) -> str:
    """The whole in one or two sentences."""
    share, low, high = found.before
    text = (
        f"{percent(share)} of {found.request.seeds} runs end '{found.goal}' (95 % interval "
        f"{100 * low:.0f} to {100 * high:.0f} %)."
    )
    own = found.of(MATTERS, kinds=("effect", "parameter", "robots"))
    idle = found.of(NOTHING, kinds=("effect", "parameter", "robots"))
    if own:
        text += f" Of what is in the model, {_list(own)} matter{'s' if len(own) == 1 else ''} most."
    if idle:
        do = "does" if len(idle) == 1 else "do"
        text += f" {len(idle)} of its effects and numbers {do} not matter."
    if found.together:
        least, most = found.together.shares
        text += (
            f" What the fits leave open, all together, gives {100 * least:.0f} to {percent(most)}."
        )
    return text


def next_step(found: Sensitivity) -> str:
    """Advice on the next measurement, and on those that would be wasted."""
    worth = found.of(MATTERS, kinds=("parameter", "hidden"))
    idle = found.of(NOTHING, kinds=("parameter", "hidden"))
    text = ""
    if worth:
        text += f"measure {_list(worth)}: there lies what the log leaves open and the swarm feels. "
    if idle:
        text += f"{'not' if not worth else 'Not'} worth another run for this: {_list(idle)}. "
    unsure = found.of(UNSURE)
    if unsure:
        text += (
            f"{counted(len(unsure), 'answer is', 'answers are')} open after "
            f"{counted(found.request.seeds, 'run')}; {option('seeds')} "
            f"{4 * found.request.seeds} halves their intervals."
        )
    return text.strip()


def percent(share: float) -> str:
    """A share as `12 %`."""
    return f"{100 * share:.0f} %"


def points(difference: Difference) -> str:
    """A change of a share with its interval."""
    low, high = 100 * difference.low, 100 * difference.high
    return f"{100 * difference.change:+.0f} points, 95 % interval {low:+.0f} to {high:+.0f}"


def _inside(worst: Outcome) -> str:
    """`factor 0.8` of `view_range (factor 0.8)`."""
    return worst.change.what.partition("(")[2].rstrip(")")


def _besides(worst: Outcome) -> str:
    """Other numbers that move beyond doubt and by much."""
    told = []
    for name, (word, scale, unit) in WORDS.items():
        d = worst.metrics[name]
        moved = d.low > 0 or d.high < 0
        if moved and abs(d.change) > TELLS * abs(d.before):
            told.append(f"{word} {_two(d.before * scale)} to {_two(d.after * scale)}{unit}")
    return f"; {', '.join(told)}" if told else ""


def _two(value: float) -> str:
    """Two significant digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def _list(result: Sequence[FactorResult]) -> str:
    names = list(dict.fromkeys(j.factor.name for j in result))
    shown = names[:NAMED]
    rest = len(names) - len(shown)
    more = [f"{rest} more"] if rest else []
    return listed([*shown, *more])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def to_json(found: Sensitivity) -> dict[str, Any]:
    """The interface's object."""
    share, low, high = found.before
    request = found.request
    return {
        "behavior": request.behavior,
        "goal": found.goal,
        "n": len(request.species(request.n)[0]),
        "seeds": request.seeds,
        "duration_s": request.duration_s,
        "margin": found.margin,
        "share": share,
        "low": low,
        "high": high,
        **found.medians,
        "sentence": headline(found),
        "next": next_step(found),
        "ranking": [_result_json(result) for result in found.ranked],
        "together": _result_json(found.together) if found.together else None,
        "left_out": [{"name": name, "why": why} for name, why in found.left],
    }


def _result_json(result: FactorResult) -> dict[str, Any]:
    factor = result.factor
    return {
        "name": factor.name,
        "kind": factor.kind,
        "about": factor.about,
        "verdict": result.verdict,
        "sentence": sentence(result) if factor.kind != "together" else None,
        "change": result.worst.share.change,
        "changes": [outcome.to_json() for outcome in result.outcomes],
    }
