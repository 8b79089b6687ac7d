# SPDX-License-Identifier: Apache-2.0
"""Agent-steps a second of swarmsim, the simulator of the paper's authors: milling, 6 robots.

Needs Python 3.12 and `pip install swarmsim==1.2.5`, so it runs in an environment of its own; the
number printed is what `bench_sweep` takes to compare.
"""

import math
import random
import sys
import time

import pygame  # noqa: F401  swarmsim needs it imported first
from swarmsim.agent.control.BinaryController import BinaryController
from swarmsim.agent.MazeAgent import MazeAgent, MazeAgentConfig
from swarmsim.sensors.BinaryFOVSensor import BinaryFOVSensor
from swarmsim.world.RectangularWorld import RectangularWorld, RectangularWorldConfig

ROBOTS, STEPS, REPEATS, STEP_S = 6, 1000, 3, 0.022
TURN_RADPS = math.radians(45)


def rate(seed: int) -> float:
    """World-seconds that one world advances in a second of processor time."""
    draw = random.Random(seed)
    world = RectangularWorld(RectangularWorldConfig(size=[10, 10], time_step=STEP_S, seed=seed))
    for k in range(ROBOTS):
        place = [5 + draw.uniform(-0.6, 0.6), 5 + draw.uniform(-0.6, 0.6)]
        config = MazeAgentConfig(
            position=place,
            angle=draw.uniform(-math.pi, math.pi),
            agent_radius=0.1,
            seed=seed * ROBOTS + k,
            controller=BinaryController([0.25, -TURN_RADPS], [0.25, TURN_RADPS]),
        )
        agent = MazeAgent(config, world)
        view = {"theta": math.radians(24.5), "distance": 1.1}
        agent.sensors.append(BinaryFOVSensor(agent, agent, **view))
        world.population.append(agent)
    world.setup()
    begin_s = time.process_time()
    for _ in range(STEPS):
        world.step()
    return ROBOTS * STEPS / (time.process_time() - begin_s)


if __name__ == "__main__":
    rates = [rate(seed) for seed in range(REPEATS)]
    print(f"{max(rates):.0f}")
    sys.exit(0)
