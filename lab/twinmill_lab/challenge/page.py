# SPDX-License-Identifier: Apache-2.0
"""The outcome of a challenge for people: terminal and HTML."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType

from twinmill.report import Figure, Provenance, Section, show, write_report
from twinmill.report.canvas import BEFORE, draw
from twinmill.report.tables import Cell, Table
from twinmill.version import __version__
from twinmill_lab.challenge.intervals import GOAL
from twinmill_lab.challenge.scoring import BARS, BINS, LARGEST_GROUP


def shown(found: dict, times_s: list[float]) -> RenderableType:
    """Tables of rates and of missed cases."""
    tables = (_rates(found, times_s), *_reliability(found), *_lost(found))
    return Group(*(show.table(t) for t in tables))


def intervals(found: dict) -> RenderableType:
    """How often intervals cover the truth, for the terminal."""
    low, high = GOAL
    rows = [
        [
            Cell(q["name"]),
            Cell(f"{q['hits']} of {q['of']}"),
            # Wrong only where so many cases could not come of a right interval.
            Cell(
                f"{100 * q['hits'] / q['of']:.0f} %",
                "good" if q["low"] <= high and q["high"] >= low else "bad",
            ),
            Cell(f"{100 * q['low']:.0f} to {100 * q['high']:.0f} %"),
            Cell(f"{q['rms']:.2f}"),
        ]
        for q in found["quantities"]
    ]
    note = (
        f"Goal: {100 * low:.0f} to {100 * high:.0f} %. Errors over standard errors have an RMS of "
        "1 if these are right; below it intervals are too wide."
    )
    head = ["quantity", "covered", "share", "95 % interval of it", "RMS"]
    title = f"95 % intervals, {found['cases']} drives"
    return show.table(Table(title, head, rows, note, words=(0,)))


def write(folder: Path, found: dict, times_s: list[float]) -> Path:
    """Writes index.html with the same tables and the power against strength, and says where."""
    section = Section(
        "Blind test of diagnosis",
        [],
        f"{len(found['cases'])} logs of about {found['duration_s']:g} s, seed {found['seed']}; "
        "each hidden effect adds more than the floor to the error at 2 s. A group of more than "
        f"{LARGEST_GROUP} names is wrong.",
        figures=[_power(found)],
        tables=[
            _rates(found, times_s),
            *_reliability(found),
            *_lost(found),
            _confusion(found),
        ],
    )
    source = Provenance(found["command"], f"twinmill {__version__}", "")
    return write_report(folder, "Blind test of diagnosis", source, [section], note="")


def _rates(found: dict, times_s: list[float]) -> Table:
    rows = []
    for bar in BARS:
        r = found[bar.key]
        share = r["hits"] / r["of"] if r["of"] else float("nan")
        met = share >= bar.goal if bar.more else share <= bar.goal
        tone = ("good" if met else "bad") if r["of"] else ""
        rows.append(
            [
                Cell(bar.words),
                Cell(f"{r['hits']} of {r['of']}"),
                Cell(f"{100 * share:.0f} %" if r["of"] else "-", tone),
                Cell(f"{100 * r['low']:.0f} to {100 * r['high']:.0f} %"),
                Cell(f"{'at least' if bar.more else 'at most'} {100 * bar.goal:.0f} %"),
            ]
        )
    note = f"Time per log: median {np.median(times_s):.1f} s, longest {np.max(times_s):.1f} s."
    if found["bias"]:
        low, middle, high = found["bias"]
        note += f" Estimates over truth: {middle:.2f}, half of them {low:.2f} to {high:.2f}."
    return Table("Right or wrong", ["", "cases", "share", "95 % interval", "goal"], rows, note)


def _reliability(found: dict) -> list[Table]:
    """Probabilities of names against how often they are right; none where none were given."""
    rows = [
        [
            Cell(f"{b['from']:g} to {b['to']:g}"),
            Cell(f"{100 * b['mean']:.1f} %"),
            Cell(f"{b['right']['hits']} of {b['right']['of']}"),
            Cell(f"{100 * b['right']['low']:.0f} to {100 * b['right']['high']:.0f} %"),
        ]
        for b in found["reliability"]
    ]
    head = ["probability of a name", "mean", "right", "95 % interval"]
    return [Table("Reliability", head, rows)] if rows else []


def _lost(found: dict) -> list[Table]:
    """None where no case is lost."""
    rows = [
        [
            Cell(str(r["case"])),
            Cell(f"{r['plant']}, {r['drive']}, {r['wheels']}, {r['style']}"),
            Cell(_hidden(r)),
            Cell(" + ".join(" or ".join(names) for names in r["said"]) or r["verdict"], "bad"),
            Cell(", ".join(r["rest"]["depends_on"][:2]) or "-"),
        ]
        for r in found["lost"]
    ]
    head = ["case", "robot and drive", "hidden", "said", "the rest depends on"]
    return [Table("Lost cases", head, rows, words=(1, 2, 3, 4))] if rows else []


def _hidden(result: dict) -> str:
    names = [f"{h['name']} ({h['kind']})" for h in result["hidden"]]
    return " + ".join(names) or "nothing"


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
        bins = [(k, b) for k, b in enumerate(found["power"]) if b["of"]]
        share = np.array([b["hits"] / b["of"] for _, b in bins])
        low, high = (np.array([b[end] for _, b in bins]) for end in ("low", "high"))
        error = [np.maximum(share - low, 0), np.maximum(high - share, 0)]
        axes.errorbar([k for k, _ in bins], share, error, color=BEFORE, marker="o", capsize=2)
        axes.set_xticks(range(len(labels)), labels)
        axes.set_xlabel("what the hidden effect adds to the error at 2 s, in floors")
        axes.set_ylabel("share right first")
        axes.set_ylim(-0.02, 1.05)

    return Figure(
        draw(3.2, paint),
        "Power against size",
        "One effect hidden, plain or as a cousin. Bars: 95 % intervals.",
    )
