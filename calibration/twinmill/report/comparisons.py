# SPDX-License-Identifier: Apache-2.0
"""A comparison of logs, steady-state tables or both: facts, tables, and what to do next."""

from dataclasses import replace

from twinmill.fitting.compare import GOOD, SUSPECT, Comparison, RobotComparison
from twinmill.predict.steady_errors import ON_BENCH, SteadyComparison
from twinmill.report import detections, steady, tables
from twinmill.report.tables import Table, number


def steady_comparisons(comparison: Comparison) -> list[SteadyComparison]:
    """The robots known from tables."""
    return [r for r in comparison.robots if isinstance(r, SteadyComparison)]


def facts(comparison: Comparison) -> list[tuple[str, str]]:
    """Log, model and settings of a comparison: label and text."""
    robot = comparison.shown
    if isinstance(robot, SteadyComparison):
        return steady.facts(steady_comparisons(comparison), comparison.model_name)
    return tables.facts(comparison, robot)


def _of_shown(comparison: Comparison, robot: RobotComparison) -> list[Table]:
    """Errors and regimes of the robot that is shown; of several it is named."""
    made = [tables.errors(robot), tables.where(robot)]
    if len(comparison.robots) == 1:
        return made
    return [replace(t, title=f"{t.title}: {robot.measurement.label}") for t in made]


def robot_tables(comparison: Comparison) -> list[Table]:
    """Errors and regimes: of the robot that is shown, then of all tables."""
    made, shown = [], comparison.shown
    if not isinstance(shown, SteadyComparison):
        made += _of_shown(comparison, shown)
    if sheets := steady_comparisons(comparison):
        made += [table for kind in steady.kinds(sheets) for table in steady.tables(kind)]
    if comparison.detections:
        made += detections.confusion_tables(comparison.detections)
    return made


def advice(comparison: Comparison, fitted: bool = False) -> str:
    """One sentence, from the score and the worst phase of the drive; `fitted`: just now."""
    if comparison.score < SUSPECT:
        return "compare with a log that the model was not fitted on."
    if comparison.score <= GOOD:
        return "nothing to add for this log; compare with one of another day, floor or battery."
    robot = comparison.shown
    if isinstance(robot, SteadyComparison):
        return _steady_advice(robot)
    if robot.unseen:
        return (
            f"{robot.measurement.label} does not show {' and '.join(robot.unseen)}, which the "
            "model predicts: compare it with the model that was there before."
        )
    phases = [r for r in robot.where if r.group == "phase"]
    if not phases:
        return "record a longer log with starts, stops and turns, then compare again."
    worst = max(phases, key=lambda r: r.share)
    try_next = "`twinmill diagnose` names what is missing"
    if comparison.missed:
        try_next = "`twinmill diagnose` tells how it differs from the others"
    elif not fitted:
        try_next = f"fit if you have not, then {try_next}"
    whose, who = "", "the robot"
    if len(comparison.robots) > 1:
        whose, who = f" of {robot.measurement.label}", "it"
    return (
        f"{100 * worst.share:.0f} % of the error{whose} comes while {who} is {worst.regime} "
        f"({number(worst.ratio)} times the noise floor); {try_next}."
    )


def _steady_advice(robot: SteadyComparison) -> str:
    first = robot.where[0].group
    worst = max((r for r in robot.where if r.group == first), key=lambda r: r.share)
    where = f"at {worst.regime}" if first == ON_BENCH else worst.regime
    return (
        f"{100 * worst.share:.0f} % of the error comes {where} ({number(worst.ratio)} times "
        "the noise floor); `twinmill diagnose` names what is missing."
    )
