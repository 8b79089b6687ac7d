# SPDX-License-Identifier: Apache-2.0
"""Runs swarms in swarmsim 1.2.5, the simulator of the paper's authors: starts in, paths out.

Usage: swarmsim_worlds.py STARTS.npz PATHS.npz, with a scenario as JSON on stdin. Needs Python 3.12
and `pip install swarmsim==1.2.5`, so `parity.py` starts it in an environment of its own.
"""

import json
import sys

import numpy as np
import pygame  # noqa: F401  swarmsim needs it imported first
from swarmsim.agent.control.MultibitBinaryController import MultibitBinaryController
from swarmsim.agent.MazeAgent import MazeAgent, MazeAgentConfig
from swarmsim.sensors.BinaryFOVSensor import BinaryFOVSensor
from swarmsim.util.collider.CollisionMode import CollisionMode
from swarmsim.world.objects.DetectionRegion import DetectionRegion, DetectionRegionConfig
from swarmsim.world.RectangularWorld import RectangularWorld, RectangularWorldConfig

SIZE_M = 40.0  # no robot comes to its edges
MIDDLE_M = SIZE_M / 2
ROBOTS, GOAL = "blue", "goal"


class SeesWhatItStandsIn(BinaryFOVSensor):
    """Sensor that also sees a region in which the robot stands, whatever is ahead."""

    def checkForLOSCollisions(self, world: RectangularWorld) -> None:
        """As the sensor it is of, then within the regions of its team."""
        super().checkForLOSCollisions(world)
        for other in world.population:
            is_target = other.team == self.target_team and isinstance(other, DetectionRegion)
            if is_target and np.linalg.norm(other.pos - self.agent.pos) < other.radius:
                self.determineState(True, other, world)


def paths(starts: np.ndarray, scenario: dict, seed: int) -> np.ndarray:
    """(T, n, 3) poses after each step, of one run from (n, 3) starts."""
    world = RectangularWorld(
        RectangularWorldConfig(size=[SIZE_M, SIZE_M], time_step=scenario["step_s"], seed=seed)
    )
    if goal := scenario.get("goal"):
        place = [MIDDLE_M + goal["at_m"][0], MIDDLE_M + goal["at_m"][1]]
        config = DetectionRegionConfig(
            position=place,
            agent_radius=goal["radius_m"],
            team=GOAL,
            collides=CollisionMode.Detect,
        )
        world.population.append(DetectionRegion(config, world))
    robots = []
    for k, (x_m, y_m, theta_rad) in enumerate(starts):
        config = MazeAgentConfig(
            position=[MIDDLE_M + x_m, MIDDLE_M + y_m],
            angle=theta_rad,
            agent_radius=scenario["radius_m"],
            seed=seed * len(starts) + k,
            team=ROBOTS,
            controller=MultibitBinaryController([tuple(row) for row in scenario["rows"]]),
        )
        robot = MazeAgent(config, world)
        for bit in scenario["bits"]:
            kind = SeesWhatItStandsIn if scenario.get("inside") else BinaryFOVSensor
            robot.sensors.append(
                kind(
                    robot,
                    robot,
                    theta=bit["half_rad"],
                    bias=bit["axis_rad"],
                    distance=bit["range_m"],
                    target_team=bit["team"],
                )
            )
        robots.append(robot)
        world.population.append(robot)
    world.setup()
    steps = round(scenario["duration_s"] / scenario["step_s"])
    found = np.empty((steps, len(robots), 3))
    for step in range(steps):
        world.step()
        for k, robot in enumerate(robots):
            found[step, k] = robot.pos[0] - MIDDLE_M, robot.pos[1] - MIDDLE_M, robot.angle
    return found


def main() -> None:
    """All runs of one scenario; of each the last part that is judged."""
    scenario = json.load(sys.stdin)
    starts = np.load(sys.argv[1])["starts"]
    kept = round(scenario["judged_s"] / scenario["step_s"])
    found = [paths(run, scenario, seed)[-kept:] for seed, run in enumerate(starts)]
    np.savez_compressed(sys.argv[2], poses=np.array(found))


if __name__ == "__main__":
    main()
