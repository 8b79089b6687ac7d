# SPDX-License-Identifier: Apache-2.0
"""Outcomes of real runs against a phase diagram, and where the next run tells most."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twinmill.arguments import option
from twinmill.swarm.axes import ALIASES, Axis
from twinmill.swarm.classes import check_goal, interval
from twinmill.swarm.phase import CLASSES, Phase

NEXT = 5


@dataclass(frozen=True)
class Experiment:
    """One run on the floor.

    Attributes:
        cell: the diagram's nearest; None if the run was outside the diagram.
        probability: that the model gives to what was observed.
    """

    point: tuple[float, ...]
    observed: str
    note: str
    cell: int | None
    predicted: str | None
    probability: float | None


def read_experiments(path: Path, phase: Phase) -> list[Experiment]:
    """CSV with a column for each axis and `class`, `note` optional; other columns are ignored.

    Raises:
        ValueError: in one sentence, with the line.
    """
    with open(path, newline="", encoding="utf-8-sig") as file:
        try:
            lines = {k: line for k, line in enumerate(file, 1) if not line.startswith("#")}
        except UnicodeDecodeError as error:
            raise ValueError(f"{path}: is no CSV file in UTF-8 ({error}).") from error
        numbers = list(lines)
        reader = csv.DictReader(lines.values())
        names = {ALIASES.get(name, name): name for name in reader.fieldnames or []}
        for axis in [*(axis.name for axis in phase.axes), "class"]:
            if axis not in names:
                raise ValueError(
                    f"{path}: has no column '{axis}'; it needs one for each axis of the sweep "
                    "and 'class' for what was seen."
                )
        found = []
        for row in reader:
            try:
                point = tuple(_number(row[names[axis.name]], axis.name) for axis in phase.axes)
                observed = check_goal((row[names["class"]] or "").strip())
            except ValueError as error:
                line = numbers[reader.line_num - 1]
                raise ValueError(f"{path}, line {line}: {error}") from None
            found.append(_judge(point, observed, row.get(names.get("note", ""), "") or "", phase))
    if not found:
        raise ValueError(f"{path}: holds no experiment.")
    return found


def _number(text: str | None, name: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} is '{text or ''}': it must be a number.")
    return value


def _judge(point: tuple[float, ...], observed: str, note: str, phase: Phase) -> Experiment:
    cell = nearest_cell(point, phase)
    if cell is None:
        return Experiment(point, observed, note, None, None, None)
    if observed == phase.goal and observed not in CLASSES:
        share = phase.hits[cell] / phase.seeds
        predicted = observed if share > 0.5 else CLASSES[phase.mode[cell]]
        return Experiment(point, observed, note, cell, predicted, float(share))
    share = phase.share[cell, CLASSES.index(observed)] if observed in CLASSES else 0.0
    return Experiment(point, observed, note, cell, CLASSES[phase.mode[cell]], float(share))


def nearest_cell(point: tuple[float, ...], phase: Phase) -> int | None:
    """The cell whose area holds the point; areas end half a step beyond the outermost values."""
    index = 0
    for value, axis in reversed(list(zip(point, phase.axes, strict=True))):
        values = np.array(axis.values)
        k = int(np.argmin(np.abs(values - value)))
        gaps = np.abs(values - values[k])
        step = gaps[gaps > 0].min() if len(values) > 1 else np.inf
        if abs(value - values[k]) > step * 0.5 * (1 + 1e-9):
            return None
        index = index * len(values) + k
    return index


def agreement(experiments: list[Experiment]) -> dict[str, Any]:
    """Number of recorded runs that ended in the class that the phase diagram predicts.

    Args:
        experiments: recorded runs, with what the cell of the diagram nearest to each predicts.

    Returns:
        `agree` of `of` runs within the diagram, `outside`: runs beyond its axes, which are not
        counted; `low` and `high`: the 95 % interval of the probability to agree (Clopper and
        Pearson 1934); `rows`: the runs one by one.
    """
    inside = [e for e in experiments if e.cell is not None]
    agree = sum(e.predicted == e.observed for e in inside)
    low, high = interval(agree, len(inside), exact=True) if inside else (0.0, 1.0)
    return {
        "agree": agree,
        "of": len(inside),
        "outside": len(experiments) - len(inside),
        "low": low,
        "high": high,
        "rows": [vars(e) for e in experiments],
    }


def entropy_bits(share: np.ndarray) -> np.ndarray:
    """Shannon entropy of each of C distributions, in bits.

    Args:
        share: (C, K) probabilities of K classes; each row adds up to 1.

    Returns:
        (C,) 0 where one class is certain, log2 K where all are equally probable.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return -np.nansum(share * np.log2(share), axis=1)


def divergence_bits(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Information that one run in a cell is expected to give on which of two models is right.

    It is the Jensen-Shannon divergence of their predictions, the two models being equally probable
    before.

    Args:
        a: (C, K) probabilities of K classes in C cells by the first model.
        b: (C, K) the same by the second.

    Returns:
        (C,) bits, 0 where both predict alike to 1 where their predictions exclude each other.
    """
    return entropy_bits((a + b) / 2) - (entropy_bits(a) + entropy_bits(b)) / 2


def varied(phase: Phase) -> list[Axis]:
    """Axes of more than one value."""
    return [axis for axis in phase.axes if len(axis.values) > 1]


def words(axes: list[Axis]) -> str:
    """Each axis as its name, its first and last value and their number, for a sentence."""
    return ", ".join(
        f"{axis.name} {axis.values[0]:g} to {axis.values[-1]:g} ({len(axis.values)})"
        for axis in axes
    )


def next_cells(phase: Phase, rival: Phase | None, done: set[int]) -> list[dict[str, Any]]:
    """Where to run next: where two models disagree most, or else where this one is least sure.

    Raises:
        ValueError: the rival's axes are others.
    """
    if rival is None:
        worth = entropy_bits(phase.outcomes)
    else:
        ours, theirs = varied(phase), varied(rival)
        if ours != theirs:
            raise ValueError(
                f"{option('rival')}: that sweep varies {words(theirs)}, this one {words(ours)}; "
                "run it over "
                "the same values, with what is to differ in its model or in an axis of one value."
            )
        worth = divergence_bits(phase.outcomes, rival.outcomes)
    chosen: list[dict[str, Any]] = []
    for cell in np.argsort(-worth, kind="stable"):
        if worth[cell] <= 0 or len(chosen) == NEXT:
            break
        if int(cell) not in done:
            chosen.append(
                {
                    **dict(
                        zip((a.name for a in phase.axes), phase.points[cell].tolist(), strict=True)
                    ),
                    "cell": int(cell),
                    "worth_bit": float(worth[cell]),
                    "class": CLASSES[phase.mode[cell]],
                    "rival_class": CLASSES[rival.mode[cell]] if rival else None,
                }
            )
    return chosen
