# SPDX-License-Identifier: Apache-2.0
"""Effects that measurements cannot show by their kind, and why."""

from collections.abc import Sequence

import numpy as np

from twinmill.arguments import option
from twinmill.data.steady_table import LACKS, SteadyTable
from twinmill.estimation.opened import Opened
from twinmill.model.parameters import beginning_at_a_moment, catalogue, making_late, needing

NO_HEADING = "the heading was not recorded, and what the robot holds is found"
ONE_LOG = "it begins at a moment of one run, and these are several; diagnose one robot's log alone"
CONTACTS = "predictions of one robot have no contacts; `twinmill swarm compare` looks at swarms"
NO_VOLTAGE = (
    "the log has no voltage of the battery; tables have no column for it, the telemetry of our "
    "program has one"
)
# What robots on these wheels cannot do.
SIDEWAYS = {"strafe", "diagonal"}
CANNOT = {"differential": SIDEWAYS, "ackermann": {*SIDEWAYS, "spin"}}
NO_SIDEWAYS = "only driving sideways shows it, which these wheels do not do"


def not_shown(opened: Sequence[Opened]) -> dict[str, str]:
    """Effects that these measurements cannot show by their kind, and why."""
    tables = all(o.floor is None for o in opened)
    found = {}
    for name, entry in catalogue().items():
        if tables and entry["needs"] in LACKS:
            found[name] = LACKS[entry["needs"]]
        elif opened[0].model.wheel_kind in CANNOT and set() < {*entry["identify"]} <= SIDEWAYS:
            found[name] = NO_SIDEWAYS
    if not tables:
        shared = any(not o.same_clock for o in opened if o.floor)
        if shared:
            why = (
                "commands and poses use different clocks, so a delay cannot be told from the "
                f"offset; if both use one clock, say so ({option('same_clock', True)}), or fit a "
                "calibration log on the same clocks first"
            )
            found |= dict.fromkeys(making_late("delay"), why)
        if all(o.heading_held for o in opened if o.floor):
            found |= dict.fromkeys(needing("heading"), NO_HEADING)
        if sum(o.floor is not None for o in opened) > 1:
            found |= dict.fromkeys(beginning_at_a_moment(), ONE_LOG)
        if len({robot_of(o) for o in opened}) > 1:
            found |= dict.fromkeys(needing("contacts"), CONTACTS)
        if all(np.isnan(o.track.battery_V).all() for o in opened if o.floor):
            found |= dict.fromkeys(needing("battery"), NO_VOLTAGE)
    return found


def robot_of(own: Opened) -> int:
    """Number of the robot that was measured."""
    measured = own.measurement
    return measured.robot_id if isinstance(measured, SteadyTable) else measured.track.robot_id
