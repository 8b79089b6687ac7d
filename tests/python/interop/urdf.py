# SPDX-License-Identifier: Apache-2.0
"""URDF: ROS's own parser, and the readers of MuJoCo, sdformat and other simulators."""

import math
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

from interop.cells import Told, writes
from interop.robot import (
    DRAKE,
    MASS_KG,
    TOP_RADPS,
    WHEEL_RADIUS_M,
    WHEELS,
    held_by_drake,
    write,
)
from interop.sdf import held_by_sdformat

FILE = "robot.urdf"
JOINTS = {f"{wheel}_wheel_joint" for wheel in WHEELS}


def _write(folder: Path) -> None:
    write(folder, "urdf")


@writes("URDF", "urdfdom (`check_urdf`)", "liburdfdom-tools", ours=_write)
def urdfdom(folder: Path) -> Told:
    """ROS's parser; it tells the tree alone."""
    command = ["check_urdf", str(folder / FILE)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = done.stdout
    return {
        "parsed without a complaint": not done.stderr,
        "root": "root Link: base_footprint" in said,
        "tree of links": all(f":  {wheel}_wheel" in said for wheel in WHEELS),
        "camera's frame": ":  camera_link" in said,
    }


@writes("URDF", "MuJoCo", "mujoco-core==4.0.1", ours=_write)
def mujoco(folder: Path) -> Told:
    """MuJoCo's importer, which welds the root to the world and keeps no frame without a joint."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / FILE))
    bodies = {model.body(i).name for i in range(model.nbody)}
    return {
        "wheels' joints": {model.joint(i).name for i in range(model.njnt)} == JOINTS,
        "shapes": model.ngeom == 1 + len(WHEELS),
        "mass": math.isclose(model.body_mass.sum(), MASS_KG),
        "base": "base_link" in bodies,
        "camera's frame": "camera_link" in bodies,
        "top speed of wheels": model.nu > 0,
    }


@writes("URDF", "sdformat", "libsdformat12-12", ours=_write)
def sdformat(folder: Path) -> Told:
    """Gazebo's parser, which makes SDF of it and lumps what is fixed together."""
    held = ET.fromstring(held_by_sdformat(folder / FILE))
    links = {link.get("name") for link in held.iter("link")}
    frames = {frame.get("name") for frame in held.iter("frame")}
    return {
        "wheels' joints": {joint.get("name") for joint in held.iter("joint")} == JOINTS,
        "mass": math.isclose(sum(float(m.text) for m in held.iter("mass")), MASS_KG),
        "top speed of wheels": held.find(".//limit/velocity") is not None,
        "camera's frame": "camera_link" in frames,
        "base as a link": "base_link" in links,
    }


@writes("URDF", "PyBullet", "pybullet==3.2.7", "numpy==2.4.6", ours=_write)
def bullet(folder: Path) -> Told:
    """Bullet's importer, which gives each frame without a mass 1 kg."""
    import pybullet

    pybullet.connect(pybullet.DIRECT)
    keep = pybullet.URDF_USE_INERTIA_FROM_FILE
    robot = pybullet.loadURDF(str(folder / FILE), flags=keep)
    joints = [pybullet.getJointInfo(robot, k) for k in range(pybullet.getNumJoints(robot))]
    names = [one[12].decode() for one in joints]
    masses_kg = [pybullet.getDynamicsInfo(robot, k)[0] for k in range(-1, len(joints))]
    turning = {one[1].decode() for one in joints if one[2] == pybullet.JOINT_REVOLUTE}
    wheel = pybullet.getDynamicsInfo(robot, names.index("fl_wheel"))
    return {
        "wheels' joints": turning == JOINTS,
        "top speed of wheels": joints[names.index("fl_wheel")][11] > 0,
        "inertia, with its flag": math.isclose(wheel[2][2], 0.5 * wheel[0] * WHEEL_RADIUS_M**2),
        "camera's frame": "camera_link" in names,
        "mass": math.isclose(sum(masses_kg), MASS_KG),
    }


@writes("URDF", "Drake", DRAKE, ours=_write)
def drake(folder: Path) -> Told:
    """Its own parser, which makes motors of `<transmission>` alone."""
    return held_by_drake(folder / FILE)


@writes("URDF", "Pinocchio", "pin==4.1.0", ours=_write)
def pinocchio(folder: Path) -> Told:
    """Rigid bodies for control, by urdfdom inside; its root is given a free joint."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(folder / FILE), pinocchio.JointModelFreeFlyer())
    tops_radps = model.velocityLimit[-len(WHEELS) :]
    wheel = model.inertias[model.getJointId("fl_wheel_joint")]
    return {
        "mass": math.isclose(pinocchio.computeTotalMass(model), MASS_KG),
        "wheels' joints": set(model.names) >= JOINTS,
        "top speed of wheels": all(abs(top / TOP_RADPS - 1) < 1e-4 for top in tops_radps),
        "inertia": math.isclose(wheel.inertia.max(), 0.5 * wheel.mass * WHEEL_RADIUS_M**2),
        "camera's frame": model.existFrame("camera_link"),
    }


@writes("URDF", "Newton", "newton==1.8.0", "warp-lang==1.19.0", ours=_write)
def newton(folder: Path) -> Told:
    """NVIDIA's and DeepMind's engine on Warp, in single precision; here on a CPU."""
    import newton
    import warp

    warp.config.quiet = True
    warp.set_device("cpu")
    builder = newton.ModelBuilder()
    builder.add_urdf(str(folder / FILE), floating=True)
    model = builder.finalize()
    names = [label.rpartition("/")[2] for label in model.joint_label]
    tops_radps = model.joint_velocity_limit.numpy()[-len(WHEELS) :]
    masses_kg = model.body_mass.numpy()
    return {
        "mass": math.isclose(masses_kg.sum(), MASS_KG, rel_tol=1e-5),
        "wheels' joints": set(names) >= JOINTS,
        "top speed of wheels": all(abs(top / TOP_RADPS - 1) < 1e-4 for top in tops_radps),
        "camera's frame": any(label.endswith("camera_link") for label in model.body_label),
    }
