# SPDX-License-Identifier: Apache-2.0
"""Diagnosis of several robots of one model, as sentences and tables."""

from __future__ import annotations

from dataclasses import replace

from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.diagnosis.fleet import Fleet
from twinmill.fitting.compare import LACKING
from twinmill.report import Figure, Section, cameras, show
from twinmill.report.inference import (
    next_run,
    of_answer,
    page_of,
    probabilities,
    scores_in_words,
    sentence,
    sentence_on,
    unseen,
)
from twinmill.report.robot_words import robot_sentence
from twinmill.report.tables import VERDICTS, Cell, Table, number, percent

SHARED = (
    "Each robot is judged in the light of the others: what all lack counts once in the prior. "
    "Numbers of what all lack are means over the robots, with the scatter between them in their "
    "standard deviation."
)


def fleet_sentence(fleet: Fleet) -> str:
    """Robots that differ, each in a sentence, and what all lack."""
    off = [robot_sentence(one, percent(one.probability)) for one in fleet.differs]
    seen = cameras.words(fleet.cameras) if fleet.cameras else []
    return " ".join([*off, _of_all(fleet), *seen])


def _of_all(fleet: Fleet) -> str:
    """Sentence on all robots, those that differ among them."""
    told = sentence(fleet.answer, "Nothing is missing that all robots lack")
    if fleet.differs and told.startswith(LACKING):
        return f"All lack {told.removeprefix(LACKING)}"
    return told


def robots_off(fleet: Fleet) -> list[dict[str, object]]:
    """Robots that differ, as `robots_off` of the interface has them."""
    told = []
    for one in fleet.differs:
        why = (
            f"its score is {one.scores[0]:.2f} with the model of all, those of the others "
            f"{one.others:.2f}; with what was found in it {one.scores[1]:.2f}"
        )
        said = robot_sentence(one, percent(one.probability))
        told.append({**one.to_json(), "sentence": said, "why": why})
    return [*told, *(one.to_json() for one in (fleet.cameras.off if fleet.cameras else ()))]


def terminal(fleet: Fleet) -> RenderableType:
    """Text on a fleet: robots that differ, what all lack, and each robot."""
    return Group(
        Text(fleet_sentence(fleet), show.STYLES[VERDICTS[fleet.verdict]]),
        *scores_in_words(fleet),
        Text(),
        *map(show.table, _tables(fleet)),
        *([Text(step)] if (step := next_run(fleet.answer)) else []),
        *show.warned([*fleet.strangers, *fleet.before.warnings]),
    )


def bars(fleet: Fleet) -> Figure:
    """Bars of the probability of what all robots lack."""
    return probabilities(fleet.answer, "What all robots lack, with its probability")


def section(fleet: Fleet) -> Section:
    """The page on a fleet."""
    page = page_of(fleet, fleet_sentence(fleet), _tables(fleet), bars=bars(fleet))
    seen = cameras.figures(fleet.cameras) if fleet.cameras else []
    return replace(page, figures=[*page.figures, *seen])


def _tables(fleet: Fleet) -> list[Table]:
    return [
        *of_answer(fleet.answer),
        _each_robot(fleet),
        *(cameras.tables(fleet.cameras) if fleet.cameras else ()),
        *([unseen(fleet.not_shown)] if fleet.not_shown else []),
    ]


def _each_robot(fleet: Fleet) -> Table:
    rows = []
    gone = {one.robot_id for one in fleet.differs}
    for robot in fleet.robots:
        number_of = robot.measurements[0].robot_id
        rows.append(
            [
                Cell(f"R{number_of:02d}", "bad" if number_of in gone else ""),
                Cell(sentence_on(robot)),
                Cell(number(robot.before.score)),
                Cell(number(robot.after.score)),
            ]
        )
    columns = ["robot", "it lacks", "score", "with it"]
    return Table("Each robot", columns, rows, words=(0, 1), note=SHARED)
