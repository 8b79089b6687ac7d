# SPDX-License-Identifier: Apache-2.0
"""Robots whose names are exchanged: the commands of one explain the poses of another."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from twinmill.data.checks.alternatives import Explained, Search
from twinmill.data.checks.commands import CheckedTrack, far_better
from twinmill.data.checks.finding import InputFinding


def check_exchange(
    judged: list[tuple[CheckedTrack, Search, Explained]],
) -> tuple[list[InputFinding], set[int]]:
    """Findings about the robots of one log, and who is exchanged.

    Only shifts in time near those at which a robot's own commands fit best are tried.
    """
    n = len(judged)
    if n < 2 or all(own.left < 0.03 for _, _, own in judged):
        return [], set()
    lates_s = sorted({round(own.late_s, 3) for _, _, own in judged} | {0.0, 0.06, 0.12})
    table = [[_explained(j, i, lates_s) for j in judged] for i in judged]
    left = np.array([[e.left for e in row] for row in table])
    poses, commands = linear_sum_assignment(left)
    found, who = [], set()
    for p, c in zip(poses, commands, strict=True):
        if p == c or not far_better(table[p][c], table[p][p]):
            continue
        checked, other = judged[p][0], judged[c][0]
        who.add(checked.track.robot_id)
        found.append(
            checked.finding(
                f"its name is exchanged with that of robot {other.track.robot_id}",
                f"the commands of robot {other.track.robot_id} explain {1 - left[p, c]:.0%} of its "
                f"motion, its own {1 - left[p, p]:.0%}",
                "give the poses or the commands the other number (column robot_id, or "
                "--robot NAME=ID)",
            )
        )
    return found, who


def _explained(
    of_commands: tuple[CheckedTrack, Search, Explained],
    of_poses: tuple[CheckedTrack, Search, Explained],
    lates_s: list[float],
) -> Explained:
    """How well the commands of one explain the poses of another."""
    commands, motion = of_commands[1], of_poses[1].motion
    return Search(motion, commands.wheels, commands.felt, np.array(lates_s)).own()
