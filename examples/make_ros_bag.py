# SPDX-License-Identifier: Apache-2.0
"""Writes drive_bag/, a ROS 2 bag of a two-wheeled robot that takes velocity commands.

The robot is simulated here with NumPy: a lag of 80 ms, and a speed ahead that changes by 1 m/s² at
most, as ros2_control's diff_drive_controller limits it. Put your own bag in its place.
"""

import numpy as np

import twinmill as tm

STEP_S, DURATION_S = 0.001, 60.0
LAG_S, LIMIT_MPS2 = 0.08, 1.0
POSE_EVERY = 10  # steps: 100 Hz


def main() -> None:
    """Writes the bag into the working directory."""
    random = np.random.default_rng(1)
    commands_t_s = np.cumsum(random.uniform(0.5, 2.0, 120))
    commands_t_s = np.append(0.0, commands_t_s[commands_t_s < DURATION_S])
    speeds = random.choice([-0.3, 0.0, 0.15, 0.3, 0.45], commands_t_s.size)
    turns = random.choice([-2.0, -1.0, 0.0, 1.0, 2.0], commands_t_s.size)
    commands = np.column_stack([speeds, turns])

    t_s = np.arange(0.0, DURATION_S, STEP_S)
    given = commands[np.searchsorted(commands_t_s, t_s, side="right") - 1]
    vx = omega = x = y = theta = limited = 0.0
    poses = []
    for speed, turn in given:
        poses.append((x, y, theta))
        limited += np.clip(speed - limited, -LIMIT_MPS2 * STEP_S, LIMIT_MPS2 * STEP_S)
        vx += (limited - vx) * STEP_S / LAG_S
        omega += (turn - omega) * STEP_S / LAG_S
        x += vx * np.cos(theta) * STEP_S
        y += vx * np.sin(theta) * STEP_S
        theta += omega * STEP_S
    seen = np.array(poses[::POSE_EVERY]) + random.normal(0, [5e-4, 5e-4, 3e-3], (6000, 3))
    log = tm.Log.from_arrays(t_s[::POSE_EVERY], seen, commands_t_s, commands, kind="twist")
    log.export("drive_bag", to="rosbag2")


if __name__ == "__main__":
    main()
