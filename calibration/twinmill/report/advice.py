# SPDX-License-Identifier: Apache-2.0
"""What to do after a comparison, in a sentence."""

from twinmill.fitting.compare import GOOD, SUSPECT, Comparison
from twinmill.report.tables import number
from twinmill.steady.compare import SteadyComparison

# By what the robot was doing: what is wrong, and effects that act there.
HINTS = {
    "standing": ("it is predicted to move while it stands", ("dead_zone",)),
    "steady": ("steady speeds are wrong", ("speed_curve", "wheel_gain", "reverse_asymmetry")),
    "starting": ("starts are wrong", ("motor_lag", "lag_by_duty", "input_delay")),
    "stopping": ("stops are wrong", ("coasting", "motor_lag")),
    "changing": (
        "changes of command are followed wrongly",
        ("motor_lag", "lag_by_duty", "input_delay"),
    ),
}


def advice(comparison: Comparison) -> str:
    """One sentence, from the score and the worst phase of the drive."""
    if comparison.score < SUSPECT:
        return "compare with a log that the model was not fitted on."
    if comparison.score <= GOOD:
        return "nothing to add for this log; compare with one of another day, floor or battery."
    robot = comparison.worst
    if isinstance(robot, SteadyComparison):
        return _steady_advice(robot)
    phases = [r for r in robot.where if r.group == "phase"]
    if not phases:
        return "record a longer log with starts, stops and turns, then compare again."
    worst = max(phases, key=lambda r: r.share)
    wrong, effects = HINTS[worst.regime]
    fresh = [name for name in effects if name not in robot.scene.model.effects]
    try_next = (
        f"fit if you have not, then add {' or '.join(fresh)}" if fresh else "look at where it fails"
    )
    return (
        f"{100 * worst.share:.0f} % of the error comes while the robot is {worst.regime} "
        f"({number(worst.ratio)} times the floor): {wrong}; {try_next}."
    )


def _steady_advice(robot: SteadyComparison) -> str:
    worst = max((r for r in robot.where if r.group == "path"), key=lambda r: r.share)
    return (
        f"{100 * worst.share:.0f} % of the error comes {worst.regime} ({number(worst.ratio)} times "
        "the floor); `twinmill diagnose` names what is missing."
    )
