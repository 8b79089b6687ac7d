# SPDX-License-Identifier: Apache-2.0
"""Rivals side by side for people: terminal and HTML."""

from pathlib import Path

from rich.console import Group, RenderableType

from rivals.protocol import DOCUMENTED
from rivals.scoring import ERRORS, RATES, Column
from twinmill.report import Provenance, Section, show, write_report
from twinmill.report.tables import Cell, Table

HEADS = {
    "told": "told of\nsomething",
    "alarm": "false\nalarms",
    "name": "right\nname",
    "depends": "right\ndependence",
    "wrong": "surely named\nwrongly",
    "within": "outside:\nwithin 1.3",
    "same_0.5": "same drive\n0.5 s",
    "same_2": "same drive\n2 s",
    "other_0.5": "other drive\n0.5 s",
    "other_2": "other drive\n2 s",
}


def shown(found: dict, times_s: dict) -> RenderableType:
    """The tables of the terminal."""
    return Group(*(show.table(t) for t in _tables(found, times_s)))


def write(folder: Path, found: dict, times_s: dict) -> None:
    """index.html: the same tables, what each rival does, and every case."""
    section = Section(
        "Rivals on the same cases",
        [],
        f"{len(found['cases'])} sealed logs of about {found['duration_s']:g} s, seed "
        f"{found['seed']}. Every rival has the same base model and the same log.",
        figures=[],
        tables=[
            *_tables(found, times_s),
            _how(found),
            *([_real(found)] if found["recordings"] else []),
            _cases(found),
        ],
    )
    source = Provenance(f"make rivals, seed {found['seed']}", "twinmill", "")
    write_report(folder, "Rivals on the same cases", source, [section])


def _tables(found: dict, times_s: dict) -> list[Table]:
    return [
        _rates(found, times_s),
        _errors(found),
        *([_right(found)] if found["recordings"] else []),
    ]


def _right(found: dict) -> Table:
    """How many recordings each rival answered rightly."""
    rows = []
    for r in found["rows"][:-1]:
        own = [o for o in found["recordings"] if (o["rival"], o["setting"]) == _key(r)]
        missing = [o["right"] for o in own if o["missing"]]
        quiet = [o["right"] for o in own if not o["missing"]]
        rows.append(
            [_who(r)] + [Cell(f"{sum(group)} of {len(group)}") for group in (missing, quiet)]
        )
    heads = ["rival", "named first what\nis known to miss", "silent where\nnothing is"]
    return Table("Recordings whose answer is known", heads, rows)


def _heads(found: dict) -> list[tuple[str, str]]:
    """A column for each rival that says anything, in the setting that was tuned if there is one."""
    return list({r["rival"]: _key(r) for r in found["rows"][:-1]}.values())


def _key(r: dict) -> tuple[str, str]:
    return r["rival"], r["setting"]


def _rates(found: dict, times_s: dict) -> Table:
    """Table of each rival's rates (told, named, said of the rest) and its time."""
    rows = []
    for r in found["rows"]:
        time_s = times_s[r["rival"]]["median"]
        rows.append([_who(r), *(_share(r, c, found) for c in RATES), Cell(f"{time_s:.1f}")])
    note = (
        "In brackets 95 % intervals. Green: no row is better. Dependence is asked where "
        "what is hidden is outside the catalogue, a name where one effect or its cousin is. "
        "Time: median processor time of one log in one setting. " + _why_not(found)
    )
    heads = ["rival", *(HEADS[c.key] for c in RATES), "time\ns"]
    return Table("What was said", heads, rows, note)


def _why_not(found: dict) -> str:
    """Which columns rivals cannot answer, and why."""
    lacks = {r["rival"]: r["lacks"] for r in found["rows"]}
    said = [
        f"{rival}: {' and '.join(dict.fromkeys(own.values()))}"
        for rival, own in lacks.items()
        if own
    ]
    return f"Cannot: {'; '.join(said)}."


def _errors(found: dict) -> Table:
    """How well what was learnt predicts."""
    rows = [[_who(r), *(_ratio(r, c, found) for c in ERRORS)] for r in found["rows"]]
    note = (
        "RMS error of predictions on logs that were not fitted to, over that of the truth itself; "
        "1 is all that can be known. Medians of the cases in which something is hidden, in "
        "brackets their 95 % intervals. Who tells of nothing keeps the base model."
    )
    return Table("What it predicts", ["rival", *(HEADS[c.key] for c in ERRORS)], rows, note)


def _who(r: dict) -> Cell:
    return Cell(r["rival"] if r["setting"] == DOCUMENTED else f"{r['rival']}, {r['setting']}")


def _share(r: dict, column: Column, found: dict) -> Cell:
    if column.key in r["lacks"] and not r[column.key]["hits"]:
        return Cell("cannot", "dim")
    own = r[column.key]
    if not own["of"]:
        return Cell("no case", "dim")
    text = f"{own['hits']} of {own['of']}\n({100 * own['low']:.0f} to {100 * own['high']:.0f} %)"
    rivals = [o for o in found["rows"] if column.key not in o["lacks"] or o[column.key]["hits"]]
    hits = [o[column.key]["hits"] for o in rivals]
    return Cell(text, "good" if own["hits"] == (max(hits) if column.more else min(hits)) else "")


def _ratio(r: dict, column: Column, found: dict) -> Cell:
    own = r[column.key]
    if own["median"] is None:
        return Cell("no case", "dim")
    text = f"{own['median']:.2f}\n({own['low']:.2f} to {own['high']:.2f})"
    least = min(o[column.key]["median"] for o in found["rows"])
    return Cell(text, "good" if own["median"] == least else "")


def _real(found: dict) -> Table:
    """Recordings: a row for each, a column for each rival."""
    heads = _heads(found)
    logs = dict.fromkeys((r["log"], r["missing"]) for r in found["recordings"])
    said = {(r["log"], r["rival"], r["setting"]): r for r in found["recordings"]}
    rows = [
        [
            Cell(log),
            Cell(missing or "nothing"),
            *(
                Cell(r["said"], "good" if r["right"] else "bad")
                for r in (said[log, *h] for h in heads)
            ),
        ]
        for log, missing in logs
    ]
    names = [_named(*head) for head in heads]
    note = "Green: the known answer was named first, or nothing told where nothing is missing."
    words = tuple(range(len(names) + 2))
    return Table("Recordings", ["log", "known to miss", *names], rows, note, words)


def _named(rival: str, setting: str) -> str:
    return rival if setting == DOCUMENTED else f"{rival},\n{setting}"


def _how(found: dict) -> Table:
    rows = [[_who(r), Cell(r["source"]), Cell(r["how"])] for r in found["rows"]]
    return Table("Rivals and their settings", ["rival", "source", "how"], rows, words=(0, 1, 2))


def _cases(found: dict) -> Table:
    """Every case and what each rival said of it, lost ones included."""
    heads = _heads(found)
    rows = [
        [Cell(str(c["case"])), Cell(_hidden(c)), *(_said(c, *head) for head in heads)]
        for c in found["cases"]
    ]
    names = [_named(*head) for head in heads]
    note = (
        "In brackets the error at 2 s on the same kind of drive, over the truth's. Rivals as they "
        "were tuned; results.json has them as documented, too."
    )
    return Table(
        "Every case", ["case", "hidden", *names], rows, note, tuple(range(1, len(heads) + 2))
    )


def _hidden(case: dict) -> str:
    names = [f"{h['name']} ({h['kind']})" for h in case["hidden"]] or ["nothing"]
    return f"{' + '.join(names)}; {case['plant']}, {case['drive']}, {case['style']}"


def _said(case: dict, rival: str, setting: str) -> Cell:
    said = case["rivals"][rival][setting]
    words = " + ".join(" or ".join(names) for names in said["said"])
    on = f"on {', '.join(said['depends_on'][:2])}" if said["depends_on"] else "something"
    text = (words or on) if said["told"] else "nothing"
    right = {
        "none": not said["told"],
        "one": said["first"],
        "cousin": said["first"],
        "two": said["told"],
        "outside": said["depends"],
    }[case["kind"]]
    return Cell(f"{text} ({said['same_2']:.1f})", "good" if right else "bad")
