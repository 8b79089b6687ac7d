# SPDX-License-Identifier: Apache-2.0
"""What to do after a comparison, in a sentence."""

from twinmill.calibration.compare import GOOD, SUSPECT, Comparison
from twinmill.calibration.tables import main_robot, number

HINTS = {
    "standing": "the robot is predicted to move while it stands: dead_zone, or clocks that differ",
    "steady": "steady speeds are wrong: fit, then speed_curve or wheel_gain",
    "starting": "starts are wrong: fit, then motor_lag or lag_by_duty",
    "stopping": "stops are wrong: coasting",
    "changing": "changes of command are wrong: fit, then motor_lag, lag_by_duty or input_delay",
}


def advice(comparison: Comparison) -> str:
    """One sentence, from the score and the worst phase of the drive."""
    if comparison.score < SUSPECT:
        return "compare with a log that the model was not fitted on."
    if comparison.score <= GOOD:
        return "nothing to add for this log; compare with one of another day, floor or battery."
    phases = [r for r in main_robot(comparison).where if r.group == "phase"]
    if not phases:
        return "record a longer log with starts, stops and turns, then compare again."
    worst = max(phases, key=lambda r: r.share)
    return (f"{100 * worst.share:.0f} % of the error comes while the robot is {worst.regime} "
            f"({number(worst.ratio)} times the floor): {HINTS[worst.regime]}.")
