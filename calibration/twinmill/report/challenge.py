# SPDX-License-Identifier: Apache-2.0
"""The outcome of a challenge for people: terminal and HTML."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType

from twinmill.challenge.scoring import AS_GOOD, BINS
from twinmill.report import Figure, Provenance, Section, show, write_report
from twinmill.report.canvas import BEFORE, FLOOR, PREDICTED, draw
from twinmill.report.tables import Cell, Table

# Key, what it says, the goal, whether more is better.
RATES = (
    ("false_alarm", "false alarm, nothing hidden", 0.05, False),
    ("right_first", "one effect: first, or in its group", 0.95, True),
    ("both_of_two", "both of two found", 0.80, True),
    ("outside_called", "outside the catalogue, called so", 0.80, True),
    ("as_good_as_true", f"score within {AS_GOOD} of the truth's", 0.95, True),
)
COLOURS = {"one": BEFORE, "two": FLOOR, "outside": PREDICTED}


def shown(found: dict, times_s: list[float]) -> RenderableType:
    """For the terminal."""
    return Group(show.table(_rates(found, times_s)), show.table(_confusion(found)))


def write(folder: Path, found: dict, times_s: list[float]) -> None:
    """index.html with the same tables and the power against strength."""
    section = Section(
        "Blind test of diagnosis",
        [],
        f"{len(found['cases'])} logs of {found['duration_s']:g} s, seed {found['seed']}; effects "
        "count where each adds more than the floor to the error at 2 s.",
        figures=[_power(found)],
        tables=[_rates(found, times_s), _confusion(found)],
    )
    source = Provenance(f"twinmill challenge --seed {found['seed']}", "twinmill", "")
    write_report(folder, "Blind test of diagnosis", source, [section])


def _rates(found: dict, times_s: list[float]) -> Table:
    rows = []
    for key, words, goal, more in RATES:
        r = found[key]
        share = r["hits"] / r["of"] if r["of"] else float("nan")
        met = share >= goal if more else share <= goal
        rows.append(
            [
                Cell(words),
                Cell(f"{r['hits']} of {r['of']}"),
                Cell(f"{100 * share:.0f} %" if r["of"] else "-", "good" if met else "bad"),
                Cell(f"{100 * r['low']:.0f} to {100 * r['high']:.0f} %"),
                Cell(f"{'at least' if more else 'at most'} {100 * goal:.0f} %"),
            ]
        )
    note = f"Time per log: median {np.median(times_s):.1f} s, longest {np.max(times_s):.1f} s."
    return Table("Right or wrong", ["", "cases", "share", "95 % interval", "goal"], rows, note)


def _confusion(found: dict) -> Table:
    rows = [
        [Cell(c["hidden"]), Cell(c["said"], _tone(c)), Cell(str(c["cases"]))]
        for c in found["confusion"]
    ]
    return Table("Hidden, and what was said", ["hidden", "said", "cases"], rows, words=(0, 1))


def _tone(row: dict) -> str:
    same = set(row["hidden"].split(" + ")) == set(row["said"].split(" + "))
    return "good" if same or (row["hidden"], row["said"]) == ("nothing", "model_adequate") else ""


def _power(found: dict) -> Figure:
    """Share of right answers against what the effect adds to the error."""
    labels = [f"{a:g} to {b:g}" for a, b in pairwise(BINS)]
    labels.append(f"over {BINS[-1]:g}")

    def paint(axes) -> None:
        for shift, (kind, colour) in zip((-0.1, 0.0, 0.1), COLOURS.items(), strict=True):
            bins = [(k, b) for k, b in enumerate(found["power"][kind]) if b["of"]]
            at = [k + shift for k, _ in bins]
            share = np.array([b["hits"] / b["of"] for _, b in bins])
            low, high = (np.array([b[end] for _, b in bins]) for end in ("low", "high"))
            error = [np.maximum(share - low, 0), np.maximum(high - share, 0)]
            axes.errorbar(at, share, error, color=colour, marker="o", capsize=2, label=kind)
        axes.set_xticks(range(len(labels)), labels)
        axes.set_xlabel("what the hidden effect adds to the error at 2 s, in floors")
        axes.set_ylabel("share of right answers")
        axes.set_ylim(-0.02, 1.05)
        axes.legend()

    return Figure(
        draw(3.2, paint),
        "Power against strength",
        "Right answers by what was hidden: one effect, two (the weaker counts), one outside the "
        "catalogue. Bars: 95 % intervals.",
    )
