# SPDX-License-Identifier: Apache-2.0
"""Parts of the paper: the claims that stand for each here, and what its text leaves open.

Vega, Zhu, Mattson, Brown and Nowzari 2024 (arXiv 2410.16444).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from twinmill.arguments import option
from twinmill_lab.claims.rows import Claim, Row


@dataclass(frozen=True)
class Part:
    """One thing that the paper shows.

    Attributes:
        shows: in words.
        claims: ours that are set against it; none: `elsewhere` says where to look.
        open: what the text does not say, and what moves with it.
        elsewhere: what answers, or why nothing does.
    """

    shows: str
    claims: tuple[str, ...]
    open: str = ""
    elsewhere: str = ""


@dataclass(frozen=True)
class Answer:
    """A part with what became of it.

    Attributes:
        agree, of: numbers that agree with the reference, of those that have one.
        differs: those that do not, each with why.
        found: what became of each claim, by its title.
    """

    part: Part
    agree: int
    of: int
    differs: list[str]
    found: str


PARTS = (
    Part(
        "Cost against fidelity of models",
        ("fidelity",),
        open="How cost is counted; here by what must be measured.",
        elsewhere="One real robot: docs/accuracy.md; a model of yours: twinmill swarm matters.",
    ),
    Part(
        "Two rules of one bit and their behaviours: milling, diffusing",
        ("milling", "diffusing", "last_figure"),
        open="Whether a neighbour's centre or any part of it is seen, the step of the simulation, "
        "and whether 0.04 is a standard deviation or a variance: with the first the "
        "reference's share that mills goes from 5 to 98 %.",
    ),
    Part(
        "The four steps from robot to swarm and back",
        ("process", "prediction", "prediction_in_mujoco"),
    ),
    Part(
        "Circliness and diffusion tell the behaviours",
        ("alike", "diffusing", "pivot"),
        open="About which middle circliness is taken: the centroid in the text, the middle of the "
        "bounding box in the authors' public model.",
    ),
    Part(
        "Four classes over 56 pairs of speed and turn rate",
        ("region", "steps", "bodies"),
        open="Runs of a cell, and how a run is classed that ends between two classes.",
    ),
    Part(
        "A mill with one odd robot",
        ("bullseye", "last_figure"),
        open="Whether its turn has the sign of the text, -3 times; +3 is measured beside it.",
    ),
    Part(
        "How many robots, how alike, how fast, how good a sensor",
        ("more_robots", "alike", "region", "sensor", "questions"),
    ),
    Part(
        "Measured speeds and turns of the robots",
        ("actuation",),
        open="Whether N(1, 0.04) is a standard deviation or a variance, and at which inputs.",
        elsewhere="A table of yours, or the authors' public one, which is no part of this "
        f"project, stands beside it with {option('actuation')} TABLE.",
    ),
)


def answers(found: Sequence[Claim]) -> list[Answer]:
    """Answer for each part of which a claim ran, and for each that no claim is for."""
    by_name = {claim.name: claim for claim in found}
    told = []
    for part in PARTS:
        ran = [by_name[name] for name in part.claims if name in by_name]
        if part.claims and not ran and not part.elsewhere:
            continue
        rows = [row for claim in ran for row in claim.rows if row.agrees is not None]
        became = [f"{claim.outcome}: {claim.title}" for claim in ran]
        told.append(
            Answer(
                part,
                sum(row.agrees for row in rows),
                len(rows),
                [_difference(row) for row in rows if not row.agrees],
                "; ".join(filter(None, [*became, part.elsewhere])),
            )
        )
    return told


def _difference(row: Row) -> str:
    return f"{row.what}: {row.known or f'not known why ({row.rule})'}"
