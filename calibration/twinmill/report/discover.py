# SPDX-License-Identifier: Apache-2.0
"""The page of what was found: the archive's map, and pictures of the best of each kind."""

from dataclasses import replace

import numpy as np
import twinmill_native as native
from matplotlib.axes import Axes

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.report import Figure, Section
from twinmill.report.canvas import draw
from twinmill.report.phase_figures import TRACE_EVERY_S, TRACE_S, paint_paths, paint_world
from twinmill.report.tables import Cell, Table, number
from twinmill.swarm.classes import WORDS
from twinmill.swarm.discover.entries import Entry
from twinmill.swarm.discover.genes import table_text
from twinmill.swarm.discover.kinds import KIND_COLORS, KIND_WORDS, MEASURES
from twinmill.swarm.discover.search import Hunt

ACROSS = 3
LOGARITHMS = ("circliness", "scatter")  # what the archive has the powers of 10 of
UNITS = {"scatter": "scatter\nm²", "odd_ratio": "odd ones"}


def section(
    hunt: Hunt,
    found: list[Entry],
    offered: list[Entry],
    *,
    shown: list[Entry],
    tried: int,
    cells: int,
) -> Section:
    """The page of a search: the archive, what is offered and how it was confirmed."""
    present = [kind for kind in KIND_COLORS if any(entry.kind == kind for entry in offered)]
    count = {kind: sum(entry.kind == kind for entry in offered) for kind in present}
    listed = ", ".join(f"{kind} {count[kind]}" for kind in present)
    twins = ", and so in twins drawn from the model's errors" if shown[0].drawn is not None else ""
    twins += " and in MuJoCo" if shown[0].mujoco is not None else ""
    waiting = sum(entry.holds and not entry.name for entry in found)
    untried = (
        f"; {waiting} were not run in MuJoCo, more of which {option('show')} asks for"
        if waiting
        else ""
    )
    return Section(
        title="Behaviours that were found",
        score=[
            ("behaviours offered", str(len(offered)), ""),
            ("that differ, in all", str(len(found)), ""),
            ("of cells", str(cells), ""),
            ("swarms tried", str(tried), ""),
        ],
        verdict=f"Of {tried} swarms, {len(found)} differ. {len(offered)} were what they are called "
        f"in most of {shown[0].confirmed} fresh runs{twins}, and are offered: {listed}. The names "
        f"of {counted(sum(not entry.holds for entry in found), 'other')} were taken back{untried}.",
        facts=[
            ("model", hunt.request.model_name),
            ("robots", str(hunt.n)),
            ("runs", f"{hunt.request.seeds} of {hunt.request.duration_s:g} s each"),
            ("run one", f"in this folder: {shown[0].command}"),
            (
                "put one on a robot",
                f"twinmill robot flash robot03.local --behavior {shown[0].name}",
            ),
        ],
        figures=[
            _map(offered, present),
            *_galleries(hunt, shown, present),
        ],
        tables=[_table(shown)],
    )


def _map(found: list[Entry], present: list[str]) -> Figure:
    names = list(MEASURES)
    x, y = names.index("circliness"), names.index("scatter")

    def paint(axes: Axes) -> None:
        for kind in reversed(present):
            at = np.array([entry.measures for entry in found if entry.kind == kind])
            axes.plot(*10 ** at[:, [x, y]].T, "o", ms=3.5, color=KIND_COLORS[kind], label=kind)
        axes.set(xscale="log", yscale="log", xlabel="circliness", ylabel="scatter (m²)")
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, columnspacing=1)

    return Figure(
        draw(4.4, paint),
        "All that are offered",
        "Each dot is the most repeatable swarm of its cell; cells also differ in rotation, groups "
        "and where odd robots are.",
    )


def _galleries(hunt: Hunt, shown: list[Entry], present: list[str]) -> list[Figure]:
    """One of each kind; the first says what is seen in all."""
    made = [_gallery(hunt, k, [e for e in shown if e.kind == k]) for k in present]
    seen = (
        f"The last {TRACE_S:.0f} s of one run each, here and below; dots are the robots at the "
        "end, odd ones hollow; the bar is 1 m. Below the name: speed and turn for nothing seen, "
        "then for seen."
    )
    return [replace(made[0], caption=seen), *made[1:]]


def _gallery(hunt: Hunt, kind: str, best: list[Entry]) -> Figure:
    rows = -(-len(best) // ACROSS)

    def paint(panels: np.ndarray) -> None:
        for axes in panels.flat:
            axes.set_axis_off()
        for axes, entry in zip(panels.flat, best, strict=False):
            axes.set_axis_on()
            odd = entry.mix.odd_count
            trace = native.trace_world(
                hunt.cell(entry.mix),
                hunt.request.first_seed,
                hunt.request.duration_s,
                TRACE_EVERY_S,
            )[-int(TRACE_S / TRACE_EVERY_S) :]
            paint_paths(axes, trace, KIND_COLORS[kind], odd)
            paint_world(axes, hunt.request)
            title = f"{entry.name}\n{table_text(entry.mix.ring)}"
            title += f"\n{odd} odd: {table_text(entry.mix.odd)}" if odd else ""
            axes.set_title(title, fontsize=7)

    words = KIND_WORDS.get(kind) or WORDS[kind]
    return Figure(
        draw(2.1 * rows + 0.2, paint, nrows=rows, ncols=ACROSS, squeeze=False),
        f"{kind.capitalize()}: {words}",
        "",
    )


def _table(shown: list[Entry]) -> Table:
    rows = [
        [
            Cell(entry.mix.behavior(entry.name)),
            Cell(f"{100 * entry.share:.0f}"),
            Cell("-" if entry.drawn is None else f"{100 * entry.drawn:.0f}"),
            Cell("-" if entry.mujoco is None else f"{100 * entry.mujoco:.0f}"),
            *([] if entry.kept_out is None else [Cell(f"{100 * entry.kept_out:.0f}")]),
            Cell(number(entry.alike, 2)),
            *_measured(entry),
        ]
        for entry in shown
    ]
    runs = shown[0].confirmed
    return Table(
        "The most repeatable of each kind",
        [
            "behaviour",
            "so called\n%",
            "in twins\n%",
            "in MuJoCo\n%",
            *([] if shown[0].kept_out is None else ["kept out\n%"]),
            "alike",
            *(UNITS.get(name, name) for name in MEASURES),
        ],
        rows,
        f"The first column goes after {option('behavior')}. So called: the share that is what "
        "its name says, "
        f"of {runs} runs with fresh seeds; in twins: of as many drawn from the model's errors, if "
        f"it knows them; in MuJoCo: of the fewer runs there ({option('mujoco')}). "
        + ("" if shown[0].kept_out is None else "Kept out: no evader came into a goal untouched. ")
        + "Alike: 1 is the same "
        "whatever the seed. Odd ones: how far from the middle they are, over the ring's radius, "
        "and 2 if farther.",
    )


def _measured(entry: Entry) -> list[Cell]:
    """Its measures in their units."""
    values = dict(zip(MEASURES, entry.measures, strict=True))
    values |= {name: 10 ** values[name] for name in LOGARITHMS}
    told = {**values, **({} if entry.mix.odd_count else {"odd_ratio": None})}
    return [Cell(number(value, 2)) for value in told.values()]
