# SPDX-License-Identifier: Apache-2.0
"""Facts and tables of a comparison, whatever was measured: logs, steady-state tables, or both."""

from dataclasses import replace

from twinmill.fitting.compare import Comparison
from twinmill.report import steady as present
from twinmill.report import tables
from twinmill.report.detection_tables import detection_tables
from twinmill.report.tables import Table
from twinmill.steady.compare import SteadyComparison


def steady_comparisons(comparison: Comparison) -> list[SteadyComparison]:
    """The robots known from tables."""
    return [r for r in comparison.robots if isinstance(r, SteadyComparison)]


def facts(comparison: Comparison) -> list[tuple[str, str]]:
    """What was compared with what: label and text."""
    if isinstance(comparison.worst, SteadyComparison):
        return present.facts(steady_comparisons(comparison), comparison.model_name)
    return tables.facts(comparison)


def _of_worst(comparison: Comparison) -> list[Table]:
    """Errors and where they come, of the robot that is missed most; of several it is named."""
    robot = comparison.worst
    made = [tables.errors(robot), tables.where(robot)]
    if len(comparison.robots) == 1:
        return made
    return [replace(t, title=f"{t.title}: {robot.scene.measurement.label}") for t in made]


def robot_tables(comparison: Comparison) -> list[Table]:
    """Errors and where they come: of the robot that is missed most, then of all tables."""
    made = []
    if not isinstance(comparison.worst, SteadyComparison):
        made += _of_worst(comparison)
    if steady := steady_comparisons(comparison):
        made += [present.errors(steady), present.cells(steady)]
    if comparison.bits:
        made += detection_tables(comparison.bits)
    return made
