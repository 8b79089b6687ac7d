# SPDX-License-Identifier: Apache-2.0
"""Results of calibration to sections of a report."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from twinmill.fitting.add import AddResult
from twinmill.fitting.compare import Comparison, RobotComparison
from twinmill.fitting.fit import FitResult
from twinmill.report import comparisons, detections, steady, tables
from twinmill.report.charted import charts
from twinmill.report.error_figures import error_growth, regimes, waterfall
from twinmill.report.html import Figure, Section
from twinmill.report.motion_figures import floor_map
from twinmill.report.tables import Table, number, tone


def comparison_section(result: Comparison) -> Section:
    """The page of a comparison: score, where the model misses, and what to do next."""
    robot = result.shown
    title = f"{result.model_name} against {robot.measurement.log_name}"
    return Section(
        title,
        [_score("score", result.score)],
        result.verdict,
        comparisons.facts(result),
        [
            *robot_pictures(result, [("this model", robot)]),
            *([detections.field_of_view(result.detections)] if result.detections else []),
        ],
        [*tables.robots(result), *comparisons.robot_tables(result)],
        charts=charts(result),
        next_step=comparisons.advice(result),
        warnings=result.warnings,
    )


def fit_section(result: FitResult) -> Section:
    """Section on one fit: the pictures of a comparison, beside the old model's errors."""
    log_name = result.after.shown.measurement.log_name
    return _of_both(
        result,
        f"{result.before.model_name} fitted to {log_name}",
        more=comparisons.robot_tables(result.after),
    )


def added_section(result: AddResult) -> Section:
    """The page of an added effect: scores on data fitted to and held out, and estimates."""
    if result.of_camera:
        return _camera_section(result)
    section = _of_both(
        result,
        f"{result.label} added to {result.before.model_name}",
        more=tables.held_out(result),
    )
    held_out = [
        _score("held out, without", result.heldout_refit.score),
        _score("held out, with it", result.heldout_after.score),
    ]
    return replace(section, score=[*section.score, *held_out])


def _of_both(result: FitResult | AddResult, title: str, more: list[Table]) -> Section:
    """Section that pages of fitted models share; `more` tables stand at the end."""
    before, after = beside(result.after, result.before), result.after.shown
    held = result.held if isinstance(result, FitResult) else ()
    return Section(
        title,
        [_score("before", result.before.score), _score("after", result.after.score)],
        result.after.verdict,
        comparisons.facts(result.after),
        robot_pictures(result.after, [("before", before), ("after", after)]),
        [
            tables.parameters(result.parameters, held),
            *tables.robots(result.after, result.before),
            *more,
        ],
        charts=_before_and_after(result),
        next_step=comparisons.advice(result.after, fitted=True),
        warnings=result.after.warnings,
    )


def _camera_section(result: AddResult) -> Section:
    before, after = number(result.heldout_refit.score), number(result.heldout_after.score)
    return Section(
        f"{result.effect} added to {result.model_name}",
        [
            _score("detections before", result.before.score),
            _score("detections after", result.after.score),
        ],
        f"Held out: {before} without, {after} with.",
        figures=[detections.field_of_view(result.after)],
        tables=[tables.parameters(result.parameters), *detections.confusion_tables(result.after)],
    )


def steps_section(title: str, scores: list[tuple[str, float]], verdict: str) -> Section:
    """Section on a chain of steps."""
    ends = [_score("start", scores[0][1]), _score("end", scores[-1][1])]
    return Section(title, ends, verdict, figures=[waterfall(scores)], tables=[tables.steps(scores)])


def _before_and_after(result: FitResult | AddResult) -> Callable[[], str] | None:
    """Charts of the new model, the old one beside."""
    return charts(result.after, [("before", r.model) for r in result.before.robots])


def beside(shown: Comparison, other: Comparison) -> RobotComparison:
    """With the other model, the robot that is shown of the first."""
    pairs = zip(shown.robots, other.robots, strict=True)
    return next(same for own, same in pairs if own is shown.shown)


def robot_pictures(result: Comparison, models: Sequence[tuple] = ()) -> list[Figure]:
    """When the model fails the robot that is shown, and where; errors over time with `models`."""
    robot, sheets = result.shown, comparisons.steady_comparisons(result)
    own = []
    if robot not in sheets:
        own = [*([regimes(robot)] if robot.where else []), floor_map(robot)]
        own += [error_growth(models)] if models else []
    if len(result.robots) > 1:
        own = [replace(f, title=f"{f.title}: {robot.measurement.label}") for f in own]
    if sheets:
        number = sheets[0].measurement.robot_id
        own += [*map(steady.values, steady.kinds(sheets))]
        own += [regimes(sheets[0], f"Steady inputs of robot {number}")]
    return own


def _score(label: str, value: float) -> tuple[str, str, tables.Tone]:
    return label, number(value), tone(value)
