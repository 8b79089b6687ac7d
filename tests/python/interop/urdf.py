# SPDX-License-Identifier: Apache-2.0
"""URDF: ROS's own parser, MuJoCo's and sdformat's readers."""

import subprocess
from pathlib import Path

from interop.cells import Told, writes
from interop.robot import MASS_KG, write

FILE = "robot.urdf"
WHEELS = ("fl", "fr", "rl", "rr")


def _write(folder: Path) -> None:
    write(folder, "urdf")


@writes("URDF", "urdfdom (`check_urdf`)", "liburdfdom-tools", ours=_write)
def urdfdom(folder: Path) -> Told:
    """ROS's parser; it tells the tree alone."""
    command = ["check_urdf", str(folder / FILE)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return {
        "root": "root Link: base_footprint" in said,
        "tree of links": all(f":  {wheel}_wheel" in said for wheel in WHEELS),
        "camera's frame": ":  camera_link" in said,
    }


@writes("URDF", "MuJoCo", "mujoco-core==4.0.1", ours=_write)
def mujoco(folder: Path) -> Told:
    """MuJoCo's importer."""
    import mujoco
    import numpy as np

    model = mujoco.MjModel.from_xml_path(str(folder / FILE))
    bodies = {model.body(i).name for i in range(model.nbody)}
    joints = {model.joint(i).name for i in range(model.njnt)}
    return {
        "wheels' joints": {f"{wheel}_wheel_joint" for wheel in WHEELS} <= joints,
        "mass": np.isclose(model.body_mass.sum(), MASS_KG),
        "base as a body": "base_link" in bodies,
        "camera's frame": "camera_link" in bodies,
        "limits of speed": False,
    }
