# SPDX-License-Identifier: Apache-2.0
"""Results of calibration to sections of a report."""

from collections.abc import Sequence
from dataclasses import replace

from twinmill.fitting.add import AddResult
from twinmill.fitting.compare import Comparison, RobotComparison
from twinmill.fitting.fit import FitResult
from twinmill.predict.detection_errors import DetectionComparison
from twinmill.predict.steady_errors import SteadyComparison
from twinmill.report import comparisons, detections, steady, tables
from twinmill.report.charted import charts
from twinmill.report.error_figures import error_growth, regimes
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
        (result.before, result.after),
        f"{result.before.model_name} fitted to {log_name}",
        quantities=tables.parameters(result.parameters, result.held),
        more=comparisons.robot_tables(result.after),
    )


def added_section(result: AddResult) -> Section:
    """The page of an added effect: scores on data fitted to and held out, and estimates."""
    if not (both := result.of_motion):
        return _camera_section(result, result.of_detections)
    section = _of_both(
        both,
        f"{result.label} added to {both[0].model_name}",
        quantities=tables.parameters(result.parameters),
        more=tables.held_out(result),
    )
    held_out = [
        _score("held out, without", result.heldout_refit.score),
        _score("held out, with it", result.heldout_after.score),
    ]
    return replace(section, score=[*section.score, *held_out])


def _of_both(
    both: tuple[Comparison, Comparison], title: str, *, quantities: Table, more: list[Table]
) -> Section:
    """Section that pages of fitted models share.

    Args:
        both: comparisons before and after.
        title: of the section.
        quantities: that were fitted.
        more: tables at the end.
    """
    before, after = both
    return Section(
        title,
        [_score("before", before.score), _score("after", after.score)],
        after.verdict,
        comparisons.facts(after),
        robot_pictures(after, [("before", beside(after, before)), ("after", after.shown)]),
        [quantities, *tables.robots(after, before), *more],
        charts=charts(after, [("before", r.model) for r in before.robots]),
        next_step=comparisons.advice(after, fitted=True),
        warnings=after.warnings,
    )


def _camera_section(result: AddResult, detected: DetectionComparison) -> Section:
    before, after = number(result.heldout_refit.score), number(result.heldout_after.score)
    return Section(
        f"{result.effect} added to {result.model_name}",
        [
            _score("detections before", result.before.score),
            _score("detections after", result.after.score),
        ],
        f"Held out: {before} without, {after} with.",
        figures=[detections.field_of_view(detected)],
        tables=[tables.parameters(result.parameters), *detections.confusion_tables(detected)],
    )


def beside(shown: Comparison, other: Comparison) -> RobotComparison | SteadyComparison:
    """With the other model, the robot that is shown of the first."""
    pairs = zip(shown.robots, other.robots, strict=True)
    return next(same for own, same in pairs if own is shown.shown)


def robot_pictures(
    result: Comparison, models: Sequence[tuple[str, RobotComparison | SteadyComparison]] = ()
) -> list[Figure]:
    """When the model fails the robot that is shown, and where; errors over time with `models`."""
    robot, sheets = result.shown, comparisons.steady_comparisons(result)
    own = []
    if isinstance(robot, RobotComparison):
        own = [*([regimes(robot)] if robot.where else []), floor_map(robot)]
        logs = [(label, r) for label, r in models if isinstance(r, RobotComparison)]
        own += [error_growth(logs)] if logs else []
    if len(result.robots) > 1:
        own = [replace(f, title=f"{f.title}: {robot.measurement.label}") for f in own]
    if sheets:
        number = sheets[0].measurement.robot_id
        own += [*map(steady.values, steady.kinds(sheets))]
        own += [regimes(sheets[0], f"Steady inputs of robot {number}")]
    return own


def _score(label: str, value: float) -> tuple[str, str, tables.Tone]:
    return label, number(value), tone(value)
