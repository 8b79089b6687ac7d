# SPDX-License-Identifier: Apache-2.0
"""Lack of an MJCF, as sentences and tables."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.joints.compare import WINDOW_S, JointComparison
from twinmill.joints.diagnose import JointDiagnosis
from twinmill.joints.explain import JointExplanation
from twinmill.joints.importers.import_joints import ImportedJoints
from twinmill.joints.next import Excitation, sure
from twinmill.report import show
from twinmill.report.inference import SHARES, of_rest, sentence
from twinmill.report.tables import Cell, Table, number, percent

QUESTIONS = 8  # that are listed, those first that stay open; --json has all
PLACES = {"mjcf": "MJCF", "hook": "hook", None: "neither"}  # that hold an effect
SHOWN = 0.05  # probability of an effect that is listed; --json has all


def diagnosis(found: JointDiagnosis) -> RenderableType:
    """Text of `twinmill diagnose` of an MJCF."""
    answer = found.answer
    parts: list[RenderableType] = [Text(sentence(answer))]
    if found.mjcf.hook:
        parts.append(Text(f"With its hook: {', '.join(name for name, _ in found.mjcf.hook)}."))
    if found.always and found.always.effects:
        parts.append(Text(f"In its own log, too: {', '.join(found.always.effects)}."))
    if answer.findings:
        parts += [Text(), show.table(_effects(found))]
    named = {f.effect for f in answer.findings}
    rest = {n: p for n, p in answer.effects.items() if n not in named and p >= SHOWN}
    if rest:
        rows = [[Cell(name), Cell(percent(p), bar=p)] for name, p in rest.items()]
        parts += [show.table(Table("Not ruled out", ["effect", "probability"], rows))]
    if answer.depends_on:
        rows = [[Cell(word), Cell(percent(p), bar=p)] for word, p in answer.depends_on.items()]
        note = of_rest(answer)
        parts += [
            show.table(Table("The residual depends on", ["", "probability"], rows, note=note))
        ]
    return Group(*parts)


def explanation(found: JointExplanation, written: Mapping[str, str]) -> RenderableType:
    """Text of `twinmill explain` of an MJCF.

    Args:
        found: what was added.
        written: files, by what they are.
    """
    effects = found.diagnosis.problem.effects
    lines = [
        f"Added {name} in the {PLACES[effects[name].held_in]}, with the numbers of the likeliest "
        "model."
        for name in found.added
    ]
    lines += [f"Left out {name}: neither an MJCF nor a force holds it." for name in found.left_out]
    lines += [f"Written: {path}" for path in written.values()]
    if not written:
        lines.append("Not written: nothing that a model can hold is likelier missing than not.")
    return Group(diagnosis(found.diagnosis), Text(), *map(Text, lines))


def imported(found: ImportedJoints, path: Path) -> RenderableType:
    """Text of `twinmill import joints`."""
    log, mjcf = found.log, found.mjcf
    rows = [
        [Cell(name), Cell(number(low)), Cell(number(high)), Cell(unit)]
        for names, table, units in (
            (mjcf.joints, log.qpos, mjcf.units),
            (mjcf.actuators, log.ctrl, ["ctrl"] * len(mjcf.actuators)),
        )
        for name, low, high, unit in zip(
            names, table.min(axis=0).tolist(), table.max(axis=0).tolist(), units, strict=True
        )
    ]
    last_s = sum(float(np.ptp(log.t_s[run])) for run in log.runs)
    runs = f", {len(log.begins)} runs" if len(log.begins) > 1 else ""
    title = f"{path}: {last_s:.4g} s at {1 / log.period_s:.4g} Hz{runs}"
    return show.table(Table(title, ["joint or actuator", "least", "most", "unit"], rows))


def comparison(found: JointComparison, hook: Path | None) -> RenderableType:
    """Text of `twinmill compare` of an MJCF."""
    rows = [
        [Cell(joint), Cell(number(window)), Cell(number(free)), Cell(unit)]
        for joint, window, free, unit in zip(
            found.joints,
            found.window_rms.tolist(),
            found.free_rms.tolist(),
            found.units,
            strict=True,
        )
    ]
    columns = ["joint", f"windows of {WINDOW_S:g} s", "free run", "unit"]
    note = f"With the forces of {hook}." if hook else ""
    return show.table(Table("RMS errors of positions", columns, rows, note=note))


def excitation(found: Excitation, path: Path | None, then: str) -> RenderableType:
    """Text of `twinmill next` of an MJCF.

    Args:
        found: the motion.
        path: of the script; None: it is not written.
        then: the command that judges what it was for; empty: none is told.
    """
    rows = [
        [Cell(a), Cell(b or "nothing"), Cell(percent(sure(found.before[a, b]))),
         Cell(percent(sure(odds)))]
        for (a, b), odds in sorted(found.odds.items(), key=lambda item: item[1])
    ]  # fmt: skip
    columns = ["effect", "instead of", "these logs", "this run"]
    note = (
        "Expected probability of the right one. Of the questions not shown this run is surer."
        if len(rows) > QUESTIONS
        else "Expected probability of the right one."
    )
    table = Table("Told apart by", columns, rows[:QUESTIONS], note=note, words=(0, 1))
    pose = zip(found.mjcf.joints, found.log.qpos[0], found.mjcf.units, strict=True)
    begin = ", ".join(f"{joint} {number(float(q))} {unit}" for joint, q, unit in pose)
    written = f"Written: {path}" if path else "Not written yet (`save(path)` does that)"
    lines = [
        f"{written}, the best of {found.kept} motions within the limits ({found.tried} "
        f"tried). It begins at rest at {begin}.",
        "ctrl.* is what to command; where actuators are told forces let a controller follow "
        "qpos.*, and record what it commands.",
        *([f"then: {then}"] if then else []),
    ]
    return Group(show.table(table), Text(), *map(Text, lines))


def _effects(found: JointDiagnosis) -> Table:
    rows = []
    for f in found.answer.findings:
        card = found.problem.effects[f.effect]
        units = {n.key: n.unit for n in card.parameters}
        for k, (name, (value, std)) in enumerate(f.numbers.items()):
            rows.append(
                [
                    Cell("" if k else f.effect),
                    Cell("" if k else percent(f.probability), bar=None if k else f.probability),
                    Cell("" if k else percent(f.share)),
                    Cell(name),
                    Cell(number(value)),
                    Cell(f"± {number(std, 2)} {units[name]}"),
                    Cell("" if k else PLACES[card.held_in]),
                    Cell("" if k else card.summary),
                ]
            )
    columns = ["effect", "probability", "takes", "number", "value", "std", "held by", "what it is"]
    note = f"takes: its share. {SHARES} hook: a Python file that `explain` writes."
    return Table("Missing effects", columns, rows, words=(0, 3, 6, 7), note=note)
