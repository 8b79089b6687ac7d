# SPDX-License-Identifier: Apache-2.0
"""SDF: sdformat, the physics of Gazebo, and Bullet."""

import ctypes
import ctypes.util
import math
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

from interop.cells import ROOT, Cell, Told, writes
from interop.robot import DRAKE, MASS_KG, TEXT, WHEEL_RADIUS_M, WHEELS, held_by_drake, write

FILE = "robot.sdf"
ENGINE = "ign-physics-5/engine-plugins/libignition-physics5-dartsim-plugin.so.5"
WAYS = {"ahead": (0.2, 0, 0), "sideways": (0, 0.2, 0), "turning": (0, 0, 1.5)}
WAYS |= {"all three at once": (0.12, 0.08, 0.8)}
HALF_TRACK_M, HALF_WHEELBASE_M = 0.067, 0.059


def _write(folder: Path) -> None:
    write(folder, "sdf")


@writes("SDF", "sdformat", "libsdformat12-12", ours=_write)
def sdformat(folder: Path) -> Told:
    """Gazebo's parser: what it prints is what it holds."""
    printed = held_by_sdformat(folder / FILE)
    held = ET.fromstring(printed)
    masses_kg = [float(mass.text) for mass in held.iter("mass")]
    frame = "<fdir1 ignition:expressed_in='base_link' gz:expressed_in='base_link'>"
    check = ctypes.CDLL(ctypes.util.find_library("sdformat12")).cmdCheck
    _write_room(folder, folder / FILE)
    return {
        "valid by its schema": check(str(folder / FILE).encode()) == 0,
        "valid in the page's world": check(str(folder / "room.sdf").encode()) == 0,
        "mass": math.isclose(sum(masses_kg), MASS_KG),
        "wheels' joints": len(held.findall("model/joint")) == len(WHEELS),
        "top speed of wheels": held.find(".//limit/velocity") is not None,
        "frame of the rollers": printed.count(frame) == len(WHEELS),
        "drive": held.find("model/plugin/wheel_separation") is not None,
    }


def held_by_sdformat(path: Path) -> str:
    """SDF that the library prints of a file in SDF or URDF."""
    library = ctypes.util.find_library("sdformat12")
    code = f"import ctypes; ctypes.CDLL('{library}').cmdPrint(b'{path}', 0, 0, 0, 17, 0)"
    return subprocess.check_output([sys.executable, "-c", code], text=True)


def _write_robots(folder: Path) -> None:
    """Robots on mecanum wheels, on three omni wheels, and on plain ones, four and two."""
    one_axle = TEXT.replace(f"half_wheelbase_m = {HALF_WHEELBASE_M}", "half_wheelbase_m = 0")
    text = one_axle.replace('"mecanum"', '"differential"')
    write(folder, "sdf", text).rename(folder / "two.sdf")
    for wheels in ("differential", "omni3", "mecanum"):
        text = TEXT.replace('"mecanum"', f'"{wheels}"')
        write(folder, "sdf", text).rename(folder / f"{wheels}.sdf")


@writes(
    "SDF",
    "Gazebo Fortress, its physics (DART)",
    "libignition-physics5-dartsim-plugin5",
    "libignition-physics-sdf-dev",
    ours=_write_robots,
)
def gazebo(folder: Path) -> Told:
    """The engine that Gazebo loads, without the program around it: its joints held at speeds."""
    ask = ["pkg-config", "--cflags", "--libs", "sdformat12", "ignition-plugin1-loader"]
    flags = subprocess.check_output([*ask, "ignition-physics5-sdf"], text=True).split()
    source = str(Path(__file__).with_name("gazebo_drive.cpp"))
    subprocess.run(["g++", "-w", source, "-o", "gazebo_drive", *flags], cwd=folder, check=True)
    told = {}
    for way, velocity in WAYS.items():
        told[f"mecanum: {way}"] = _drives(folder, "mecanum", velocity)
    told["three omni wheels"] = all(_drives(folder, "omni3", v) for v in WAYS.values())
    for way in ("ahead", "turning"):
        told[f"four plain wheels: {way}"] = _drives(folder, "differential", WAYS[way])
    curve = (0.15, 0, 0.8)
    ways = (WAYS["ahead"], WAYS["turning"], curve)
    told["two plain wheels"] = all(_drives(folder, "two", way) for way in ways)
    told["four plain wheels: middle of a curve"] = _drives(folder, "differential", curve)
    return told


def _drives(folder: Path, wheels: str, velocity: tuple[float, float, float]) -> bool:
    """In the page's world, its wheels told by textbook kinematics, is `velocity` its own?"""
    told = [
        f"{name}_wheel_joint={rim_mps / WHEEL_RADIUS_M}"
        for name, rim_mps in _rims_mps(wheels, *velocity).items()
    ]
    _write_room(folder, folder / f"{wheels}.sdf")
    engine = f"/usr/lib/{sys.implementation._multiarch}/{ENGINE}"
    command = ["./gazebo_drive", engine, "room.sdf", "second", "base_link", "2", *told]
    printed = subprocess.check_output(command, cwd=folder, text=True).split()
    (x0, y0, at0), (x1, y1, at1) = ([float(v) for v in printed[i:][:3]] for i in (-6, -3))
    turned = math.remainder(at1 - at0, 2 * math.pi)
    c, s = math.cos(at0 + turned / 2), math.sin(at0 + turned / 2)
    x, y = x1 - x0, y1 - y0
    moved = (c * x + s * y, c * y - s * x, turned)
    return all(abs(a / 0.1 - b) < 0.01 for a, b in zip(moved, velocity, strict=True))


def _write_room(folder: Path, robot: Path) -> None:
    """The world of docs/simulators.md, beside the robot that it includes."""
    page = (ROOT / "docs/simulators.md").read_text()
    (folder / "room.sdf").write_text(page.split("```xml\n")[1].split("```")[0])
    shutil.copy(robot, folder / "better.sdf")


def _rims_mps(wheels: str, vx: float, vy: float, omega: float) -> dict[str, float]:
    """Rim speed of each wheel, positive where it rolls ahead; of omni wheels as the page has it."""
    if wheels == "omni3":
        at_rad = {f"w{k + 1}": math.radians(60 + 120 * k) for k in range(3)}
        turn_mps = HALF_TRACK_M * omega
        return {k: vy * math.cos(a) - vx * math.sin(a) + turn_mps for k, a in at_rad.items()}
    sides = {"fl": -1, "fr": 1, "rl": 1, "rr": -1}
    turns = {"fl": -1, "fr": 1, "rl": -1, "rr": 1}
    plain = {"differential": sides, "two": ("fl", "fr")}
    if wheels in plain:
        return {k: vx + turns[k] * HALF_TRACK_M * omega for k in plain[wheels]}
    lever_m = HALF_TRACK_M + HALF_WHEELBASE_M
    return {k: vx + sides[k] * vy + turns[k] * lever_m * omega for k in sides}


@writes("SDF", "PyBullet", "pybullet==3.2.7", "numpy==2.4.6", ours=_write)
def bullet(folder: Path) -> Told:
    """Bullet's own importer, which needs neither sdformat nor Gazebo."""
    import pybullet

    pybullet.connect(pybullet.DIRECT)
    (robot,) = pybullet.loadSDF(str(folder / FILE))
    joints = [pybullet.getJointInfo(robot, k) for k in range(pybullet.getNumJoints(robot))]
    held = [pybullet.getDynamicsInfo(robot, k) for k in range(-1, len(joints))]
    return {
        "mass": math.isclose(sum(one[0] for one in held), MASS_KG),
        "wheels' joints": {one[12].decode() for one in joints} == {f"{w}_wheel" for w in WHEELS},
        "top speed of wheels": all(one[11] > 0 for one in joints),
        "inertia": math.isclose(held[1][2][2], 0.5 * held[1][0] * WHEEL_RADIUS_M**2),
        "friction": all(one[1] == 1 for one in held[1:]),
    }


@writes("SDF", "Drake", DRAKE, ours=_write)
def drake(folder: Path) -> Told:
    """A simulator with a newer sdformat, which says that it leaves out plugins and sensors."""
    return held_by_drake(folder / FILE)


NOT_RUN = [
    Cell(
        "SDF",
        "writes",
        "Gazebo, the program",
        why_not="no registry has it (PyPI has bindings without its libraries); its physics was run",
    ),
]
