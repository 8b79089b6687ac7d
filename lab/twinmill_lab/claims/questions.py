# SPDX-License-Identifier: Apache-2.0
"""The four questions of a design, asked as `twinmill swarm ask` asks them."""

from twinmill.defaults import Question
from twinmill.report.questions import curve_figure
from twinmill.swarm.questions import axes_for, curve_of
from twinmill.swarm.sweep import make_request
from twinmill_lab.claims.rows import Claim, Row

GOAL, WANTED, RADIUS_M = "milling", 0.9, 0.1


def questions(seeds: int) -> Claim:
    """A curve for each quantity, the best value of each, and what the commands print."""
    rows, figures, transcript, told = [], [], [], []
    for question in Question:
        said = []
        for axis in axes_for(question, "twist"):
            request = make_request(
                GOAL, "paper.toml", [axis], seeds=seeds, target_radius_m=RADIUS_M
            )
            curve = curve_of(request, GOAL)
            said.append(curve.sentence(GOAL, WANTED))
            best = curve.best
            what = f"{question}: {curve.axis.label}, best at {curve.axis.values[best]:g}"
            ends = curve.low[best], curve.high[best]
            rows.append(Row(what, curve.probability[best], *ends, None, None, unit="%"))
            figures.append(curve_figure(curve, GOAL, "", WANTED))
        command = f"$ twinmill swarm ask {question} --target-radius-m {RADIUS_M:g} --seeds {seeds}"
        transcript.append(
            (f"{question.replace('-', ' ').capitalize()}?", "\n".join([command, *said]))
        )
        told.append(said[0])
    return Claim(
        "questions",
        "Four questions: how many, how fast, how good a sensor, how alike",
        "Simulation answers how many robots a behaviour needs, how fast, with which sensor, and "
        "how alike they must be.",
        None,
        " ".join(sentence[:1].upper() + sentence[1:] for sentence in told)
        + f" View ranges here are to a neighbour's centre, {RADIUS_M:g} m more than to its nearest "
        "part.",
        rows,
        figures,
        transcript,
    )
