# SPDX-License-Identifier: Apache-2.0
"""Results of calibration to sections of a report."""

from twinmill.calibration import tables
from twinmill.calibration.add import AddResult
from twinmill.calibration.advice import advice
from twinmill.calibration.compare import Comparison
from twinmill.calibration.fit import FitResult
from twinmill.calibration.report.error_figures import error_growth, regimes, waterfall
from twinmill.calibration.report.html import Section
from twinmill.calibration.report.motion_figures import floor_map, path, speeds
from twinmill.calibration.tables import number, tone


def comparison_section(result: Comparison) -> Section:
    """Of one comparison."""
    robot = tables.main_robot(result)
    title = f"{result.model_name} against {robot.scene.measurement.log_name}"
    return Section(
        title,
        [_score("score", result.score)],
        result.verdict,
        tables.facts(result),
        [
            path(robot),
            speeds(robot),
            error_growth([("this model", robot)]),
            regimes(robot),
            floor_map(robot),
        ],
        [tables.errors(robot), tables.where(robot)],
        advice(result),
        result.warnings,
    )


def fit_section(result: FitResult) -> Section:
    """Of one fit: the same pictures of the fitted model, beside the old one's errors."""
    before, after = tables.main_robot(result.before), tables.main_robot(result.after)
    title = f"{result.before.model_name} fitted to {after.scene.measurement.log_name}"
    return Section(
        title,
        [_score("before", result.before.score), _score("after", result.after.score)],
        result.after.verdict,
        tables.facts(result.after),
        [
            path(after),
            speeds(after),
            error_growth([("before", before), ("after", after)]),
            regimes(after),
            floor_map(after),
        ],
        [tables.parameters(result.parameters), tables.errors(after), tables.where(after)],
        advice(result.after),
        result.after.warnings,
    )


def added_section(result: AddResult) -> Section:
    """Of one added effect."""
    before, after = tables.main_robot(result.before), tables.main_robot(result.after)
    scores = [
        _score("before", result.before.score),
        _score("after", result.after.score),
        _score("held out, without", result.heldout_refit.score),
        _score("held out, with it", result.heldout_after.score),
    ]
    title = f"{result.effect} added to {result.before.model_name}"
    return Section(
        title,
        scores,
        result.after.verdict,
        tables.facts(result.after),
        [speeds(after), error_growth([("before", before), ("after", after)]), regimes(after)],
        [tables.parameters(result.parameters), tables.held_out(result)],
        advice(result.after),
        result.after.warnings,
    )


def steps_section(title: str, scores: list[tuple[str, float]], verdict: str) -> Section:
    """Of a chain of steps."""
    ends = [_score("start", scores[0][1]), _score("end", scores[-1][1])]
    return Section(title, ends, verdict, figures=[waterfall(scores)], tables=[tables.steps(scores)])


def _score(label: str, value: float) -> tuple[str, str, tables.Tone]:
    return label, number(value), tone(value)
