# SPDX-License-Identifier: Apache-2.0
"""A model as URDF: the body, wheels on continuous joints, and the camera's frame."""

import xml.etree.ElementTree as ET
from copy import deepcopy

import numpy as np

from twinmill.export.carried import ALL, HULL_HEIGHT_M, WHEEL_WIDTH, Left, RobotModel
from twinmill.export.steady import TOPS, limits_of, top_speed_left

ROOT_LINK = "base_footprint"  # on the floor, below the middle; the frame that odometry moves
EFFORT_NM = 1000.0  # a joint must state a limit, and the model knows none
CARRIED = {
    "view_pan": ALL,
    "marker_offset": ALL,
    "heading_bias": ALL,
    "wheel_limit": ALL,
    "collision": ("radius_m",),
}
REASONS = dict.fromkeys(
    ("speed_limit", "acceleration_limit"), "URDF limits joints, and this is a limit of the body"
)


def urdf(robot: RobotModel) -> tuple[str, list[Left]]:
    """The file's text, and what it does not carry."""
    left = _left(robot)
    root = ET.Element("robot", name=robot.name)
    said = [f"Written by twinmill from {robot.file.path.name} (sha256 {robot.file.hash})."]
    said += ["Not carried:", *(f"- {item.sentence()}" for item in left)]
    text = "\n    ".join(line.replace("--", "- -") for line in said)
    root.append(ET.Comment(f"\n    {text}\n  "))
    wheel_m, body_m = robot.get("robot.wheel_radius_m"), robot.get("robot.body_radius_m")
    ET.SubElement(root, "link", name=ROOT_LINK)
    _joint(root, "base_joint", "fixed", ROOT_LINK, child="base_link", place=(0, 0, wheel_m))
    base = _solid(
        root=root,
        name="base_link",
        place=(0, 0, HULL_HEIGHT_M / 2),
        turned=(0, 0, 0),
        radius_m=body_m,
        length_m=HULL_HEIGHT_M,
        mass_kg=robot.hull_mass_kg,
        inertia_kgm2=robot.hull_inertia_kgm2(),
    )
    base.find("collision/geometry/cylinder").set("radius", f"{robot.touch_radius_m:.9g}")
    _supports(base, robot)
    rims_mps = limits_of(robot).rims_mps
    for k, wheel in enumerate(robot.model.wheels()):
        _wheel(root, robot, wheel, None if rims_mps is None else rims_mps[k])
    pan_rad = robot.model.detection_model()["pan_rad"]
    ET.SubElement(root, "link", name="camera_link")
    place = (body_m, 0, HULL_HEIGHT_M / 2)
    _joint(
        root=root,
        name="camera_joint",
        kind="fixed",
        parent="base_link",
        child="camera_link",
        place=place,
        turned=(0, 0, pan_rad),
    )
    if any(robot.tracked()):
        x_m, y_m, turned_rad = robot.tracked()
        ET.SubElement(root, "link", name="marker_link")
        _joint(
            root=root,
            name="marker_joint",
            kind="fixed",
            parent="base_link",
            child="marker_link",
            place=(x_m, y_m, HULL_HEIGHT_M),
            turned=(0, 0, turned_rad),
        )
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n", left


def _left(robot: RobotModel) -> list[Left]:
    why = "URDF holds geometry, masses and limits alone"
    limits = limits_of(robot)
    left = [
        *robot.wheels_left(),
        *robot.gains_left("moved by its joints"),
        *robot.base_left(why, "URDF has its top speed alone, as the joints' limit"),
        *robot.sensor_left(why),
    ]
    if robot.model.wheel_kind != "none" and limits.rims_mps is None:
        left.append(top_speed_left(robot, "the joints have no limit"))
    if robot.supports_x_m():
        why = "URDF has no friction; tell the program that front_support and rear_support slide"
        left.append(Left("friction", why))
    parts = {}
    if robot.model.drive == "duty":
        parts = dict.fromkeys(TOPS, "URDF has only the top speed that it leaves, in its joints")
    return [*left, *robot.left_effects("URDF", CARRIED, parts, REASONS)]


def _supports(base: ET.Element, robot: RobotModel) -> None:
    """Balls under the hull, as castors."""
    radius_m = robot.support_radius_m()
    for name, x_m in robot.supports_x_m().items():
        for use in ("visual", "collision"):
            place = (x_m, 0, -radius_m)
            _shape(base, use, place, (0, 0, 0), name=name, shape=_ball(radius_m))


def _wheel(root: ET.Element, robot: RobotModel, wheel: dict, top_mps: float | None) -> None:
    """Turns about its axle (z of its link, to the left of where it rolls).

    Touches in one point, as a ball does: a cylinder drags its edges through curves.
    """
    name, radius_m = wheel["name"], robot.get("robot.wheel_radius_m")
    link = _solid(
        root=root,
        name=f"{name}_wheel",
        place=(0, 0, 0),
        turned=(0, 0, 0),
        radius_m=radius_m,
        length_m=WHEEL_WIDTH * radius_m,
        mass_kg=robot.wheel_mass_kg,
        inertia_kgm2=robot.wheel_inertia_kgm2(),
    )
    link.find("collision/geometry")[:] = [_ball(radius_m)]
    heading_rad = float(np.arctan2(wheel["roll"][1], wheel["roll"][0]))
    place, turned = (wheel["x_m"], wheel["y_m"], 0), (-np.pi / 2, 0, heading_rad)
    joint = _joint(
        root=root,
        name=f"{name}_wheel_joint",
        kind="continuous",
        parent="base_link",
        child=f"{name}_wheel",
        place=place,
        turned=turned,
    )
    ET.SubElement(joint, "axis", xyz="0 0 1")
    if top_mps:
        speed = f"{top_mps / radius_m:.6g}"
        ET.SubElement(joint, "limit", effort=f"{EFFORT_NM:g}", velocity=speed)


def _solid(
    root: ET.Element,
    name: str,
    place: tuple[float, ...],
    turned: tuple[float, ...],
    *,
    radius_m: float,
    length_m: float,
    mass_kg: float,
    inertia_kgm2: tuple[float, float, float],
) -> ET.Element:
    """A link that is a full cylinder along z."""
    link = ET.SubElement(root, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    _origin(inertial, place, turned)
    ET.SubElement(inertial, "mass", value=f"{mass_kg:.9g}")
    diagonal = dict(zip(("ixx", "iyy", "izz"), (f"{v:.9g}" for v in inertia_kgm2), strict=True))
    ET.SubElement(inertial, "inertia", ixy="0", ixz="0", iyz="0", **diagonal)
    cylinder = ET.Element("cylinder", radius=f"{radius_m:.9g}", length=f"{length_m:.9g}")
    for use in ("visual", "collision"):
        _shape(link, use, place, turned, name=name, shape=cylinder)
    return link


def _shape(
    link: ET.Element,
    use: str,
    place: tuple[float, ...],
    turned: tuple[float, ...],
    *,
    name: str,
    shape: ET.Element,
) -> None:
    part = ET.SubElement(link, use, name=name)
    _origin(part, place, turned)
    ET.SubElement(part, "geometry").append(deepcopy(shape))


def _ball(radius_m: float) -> ET.Element:
    return ET.Element("sphere", radius=f"{radius_m:.9g}")


def _joint(
    root: ET.Element,
    name: str,
    kind: str,
    parent: str,
    *,
    child: str,
    place: tuple[float, ...],
    turned: tuple[float, ...] = (0, 0, 0),
) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    _origin(joint, place, turned)
    return joint


def _origin(parent: ET.Element, place: tuple[float, ...], turned: tuple[float, ...]) -> None:
    xyz, rpy = (" ".join(f"{v:.9g}" for v in values) for values in (place, turned))
    ET.SubElement(parent, "origin", xyz=xyz, rpy=rpy)
