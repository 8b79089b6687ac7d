# SPDX-License-Identifier: Apache-2.0
"""The page on a sealed prediction and what came of it."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from twinmill.report import Figure, Section
from twinmill.report.canvas import FLOOR, MEASURED, draw
from twinmill.report.tables import Cell, Table, number
from twinmill.swarm.classes import COLORS
from twinmill.swarm.forecast.draws import OUTCOMES
from twinmill.swarm.forecast.plan import Plan
from twinmill.swarm.forecast.score import ALPHA, FEWEST_CELLS, FEWEST_RUNS, Mean, Score

NOTE = (
    "The log score is the mean log probability that was given to what came of each run: 0 is best, "
    "and a prediction gains by nothing but honest probabilities. Brier's is the squared distance: "
    "0 is best, 2 worst. Intervals are 95 %, by the scatter of the cells."
)


def sentences(found: Score, missing: list[int]) -> list[str]:
    """Sentences on the floor and the score, for people."""
    log, expected = found.log_score, found.expected
    lines = [
        f"{found.hits} of {found.runs} runs ended in their most probable class; log score "
        f"{_words(log)} nats a run, Brier score {_words(found.brier)}."
    ]
    verdict = (
        "that is worse than chance allows if the model is right"
        if found.p_value < ALPHA
        else "as good as the model expects of itself"
    )
    lines.append(
        f"{_capital(verdict)} (expected {number(expected.value, 2)}, 95 % of its worlds "
        f"{number(expected.low, 2)} to {number(expected.high, 2)}; p = {found.p_value:.2g})."
    )
    if not np.isfinite(log.low):
        lines.append(
            "So few runs or cells tell no interval of a score; it takes "
            f"{FEWEST_RUNS} runs in {FEWEST_CELLS} cells."
        )
    for rival in found.rivals:
        gain = rival.gain
        better = (
            "better than"
            if gain.low > 0
            else "worse than"
            if gain.high < 0
            else "neither better nor worse beyond doubt than"
        )
        lines.append(
            f"The sealed prediction is {better} {rival.name}: {_words(gain, sign=True)} nats a run."
        )
    lines += found.misses
    if missing:
        lines.append(
            f"{len(missing)} of the plan's runs have no outcome ({_numbers(missing)}): were they "
            "left out for how they went, no score means anything."
        )
    return lines


def section(
    found: Score, plan: Plan, *, cell: np.ndarray, seen: np.ndarray, missing: list[int]
) -> Section:
    """The page of a score: verdict, each cell beside its prediction, and what is missing."""
    bad = found.p_value < ALPHA
    first, second, *rest = sentences(found, missing)
    return Section(
        title=f"A prediction of {plan.request.behavior}, and what came of it",
        score=[
            ("log score, nats a run", number(found.log_score.value, 2), "bad" if bad else "good"),
            ("in their most probable class", f"{found.hits} of {found.runs}", ""),
        ],
        verdict=f"{first} {second}",
        facts=[(f"{k}.", line) for k, line in enumerate(rest, 1)],
        figures=[_outcome_figure(plan, cell, seen), _gain_figure(found)],
        tables=[_table(found)],
    )


def _outcome_figure(plan: Plan, cell: np.ndarray, seen: np.ndarray) -> Figure:
    share, points = plan.expected.share, plan.expected.points
    varied = [k for k, axis in enumerate(plan.request.axes) if len(axis.values) > 1]

    def paint(axes: Axes) -> None:
        for row in range(len(share)):
            y, left = len(share) - 1 - row, 0.0
            for k, name in enumerate(OUTCOMES):
                axes.barh(y, 100 * share[row, k], left=left, color=COLORS[name], height=0.62)
                left += 100 * share[row, k]
            for j, ended in enumerate(seen[cell == row]):
                color = COLORS[OUTCOMES[ended]]
                axes.plot(106 + 6 * j, y, "o", ms=7, mfc=color, mec=MEASURED, clip_on=False)
        labels = [", ".join(f"{points[r, k]:g}" for k in varied) for r in range(len(share))]
        axes.set(yticks=range(len(share)), xlim=(0, 100), xlabel="probability that was sealed (%)")
        axes.set_yticklabels(reversed(labels))
        axes.grid(False)
        shown = [k for k in range(len(OUTCOMES)) if share[:, k].max() > 0.02 or k in seen]
        handles = [Patch(color=COLORS[OUTCOMES[k]], label=OUTCOMES[k]) for k in shown]
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=3)

    names = ", ".join(plan.request.axes[k].label for k in varied)
    return Figure(
        draw(0.34 * len(share) + 1.3, paint),
        "What was predicted, and what was seen",
        f"A row for each cell ({names}): bars are the probabilities, circles the runs, in the "
        "colour of what they ended as.",
    )


def _gain_figure(found: Score) -> Figure:
    def paint(axes: Axes) -> None:
        for y, rival in enumerate(reversed(found.rivals)):
            gain = rival.gain
            axes.plot([gain.low, gain.high], [y, y], color=FLOOR, lw=4, alpha=0.35)
            axes.plot(gain.value, y, "o", ms=6, color=FLOOR)
        axes.axvline(0, color=MEASURED, lw=1)
        axes.set(yticks=range(len(found.rivals)), ylim=(-0.6, len(found.rivals) - 0.4))
        axes.set_yticklabels([_broken(rival.name) for rival in reversed(found.rivals)])
        axes.set_xlabel("gain in log score (nats a run)")

    return Figure(
        draw(2.0, paint),
        "Against simpler predictions",
        "Right of the line the sealed probabilities are better. Bars are 95 % intervals.",
    )


def _broken(name: str) -> str:
    return name.replace(", ", ",\n")


def _table(found: Score) -> Table:
    own = [Cell("sealed"), Cell(_words(found.log_score)), Cell(_words(found.brier)), Cell("")]
    rows = [own] + [
        [
            Cell(rival.name),
            Cell(_words(rival.log_score)),
            Cell(_words(rival.brier)),
            Cell(_words(rival.gain, sign=True)),
        ]
        for rival in found.rivals
    ]
    return Table("Scores", ["prediction", "log score", "Brier", "gain of the sealed one"], rows)


def _words(mean: Mean, sign: bool = False) -> str:
    form = "{:+.2f}" if sign else "{:.2f}"
    if not np.isfinite(mean.low):
        return form.format(mean.value)
    low, high = form.format(mean.low), form.format(mean.high)
    return f"{form.format(mean.value)} ({low} to {high})"


def _numbers(values: list[int]) -> str:
    shown = ", ".join(map(str, values[:8]))
    return shown + (", ..." if len(values) > 8 else "")


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
