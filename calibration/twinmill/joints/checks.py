# SPDX-License-Identifier: Apache-2.0
"""Checks of a log of joints against the model of their machine."""

import numpy as np

from twinmill.data.lcm_log import LogError
from twinmill.joints.log import JointLog
from twinmill.joints.mjcf import Mjcf

TOO_FAR = 1.05  # times a joint's range, in which a position is the range's own softness


def check_units(log: JointLog, mjcf: Mjcf) -> None:
    """Raises LogError where hinges are in degrees: beyond their ranges, which degrees would fit."""
    model = mjcf.model
    for d, name in enumerate(mjcf.joints):
        if mjcf.units[d] != "rad" or not model.jnt_limited[d]:
            continue
        middle, half = model.jnt_range[d].mean(), TOO_FAR * np.ptp(model.jnt_range[d]) / 2
        far = np.abs(log.qpos[:, d] - middle).max()
        if far > half and np.abs(np.radians(log.qpos[:, d]) - middle).max() <= half and far > np.pi:
            raise LogError(
                f"{log.name}: joint '{name}' reaches {np.abs(log.qpos[:, d]).max():.4g}, beyond "
                f"its range of {model.jnt_range[d][0]:.3g} to {model.jnt_range[d][1]:.3g} rad: "
                "these are degrees; give radians, as "
                "`twinmill import joints --degrees` does."
            )


def warnings_of(log: JointLog, mjcf: Mjcf) -> list[str]:
    """Sentences on positions and commands beyond ranges, and gaps."""
    model, found = mjcf.model, []
    for d, name in enumerate(mjcf.joints):
        low, high = model.jnt_range[d]
        over = ((log.qpos[:, d] < low) | (log.qpos[:, d] > high)).mean()
        if model.jnt_limited[d] and over > 0:
            found.append(
                f"joint '{name}' is beyond its range of {low:.4g} to {high:.4g} "
                f"{mjcf.units[d]} in {100 * over:.2g} % of the samples; is its zero the model's?"
            )
    for a, name in enumerate(mjcf.actuators):
        low, high = model.actuator_ctrlrange[a]
        over = ((log.ctrl[:, a] < low) | (log.ctrl[:, a] > high)).mean()
        if model.actuator_ctrllimited[a] and over > 0:
            found.append(
                f"commands to '{name}' are beyond its ctrlrange of {low:.4g} to {high:.4g} in "
                f"{100 * over:.2g} % of the samples; MuJoCo clips them."
            )
    gaps = len(log.stretches) - len(log.begins)
    if gaps:
        found.append(f"{gaps} gaps; steps across them are left out.")
    return found
