# SPDX-License-Identifier: Apache-2.0
"""A model as SDF 1.9 for Gazebo: body, wheels, camera, and Gazebo's own drive where it has one."""

import xml.etree.ElementTree as ET

import numpy as np

from twinmill.export.carried import ALL, HULL_HEIGHT_M, WHEEL_WIDTH, Left, RobotModel
from twinmill.export.steady import TOPS, limits_of, top_speed_left

VERSION = "1.9"  # Gazebo Fortress and later
DRIVES = {
    "mecanum": ("gz-sim-mecanum-drive-system", "gz::sim::systems::MecanumDrive"),
    "differential": ("gz-sim-diff-drive-system", "gz::sim::systems::DiffDrive"),
}
LONG = {"f": "front", "r": "back"}
ROLLERS = ("mecanum", "omni3")  # wheels that grip along one line of the floor alone
# A plain wheel's grip sideways over that along. Four of them turn as fast as told while this is
# less than their track over their wheelbase; with one friction for all ways, a third slower.
PLAIN_GRIP = 0.5
CARRIED = {
    "view_angle": ALL,
    "view_pan": ALL,
    "view_range": ("factor",),
    "marker_offset": ALL,
    "heading_bias": ALL,
    "wheel_limit": ALL,
    "collision": ALL,
}
LIMITS = ("speed_limit", "acceleration_limit")  # of the body, as Gazebo's drive of plain wheels has
# Before the name of the attribute that holds a direction of friction still while its wheel turns.
# Gazebo's physics compares the letters: Fortress with the first prefix, Garden with either, later
# ones with the second. For XML they are two attributes only if they have two addresses.
PREFIXES = {
    "ignition": "http://ignitionrobotics.org/schema",
    "gz": "http://gazebosim.org/schema",
}


def sdf(robot: RobotModel) -> tuple[str, list[Left]]:
    """The file's text, and what it does not carry."""
    left = _left(robot)
    prefixes = {f"xmlns:{prefix}": name for prefix, name in PREFIXES.items()}
    root = ET.Element("sdf", version=VERSION, **prefixes)
    said = [f"Written by twinmill from {robot.file.path.name} (sha256 {robot.file.hash})."]
    said += ["Not carried:", *(f"- {item.sentence()}" for item in left)]
    text = "\n    ".join(line.replace("--", "- -") for line in said)
    root.append(ET.Comment(f"\n    {text}\n  "))
    model = ET.SubElement(root, "model", name=robot.name)
    wheel_m, body_m = robot.get("robot.wheel_radius_m"), robot.get("robot.body_radius_m")
    base = _solid(
        model=model,
        name="base_link",
        pose=(0, 0, wheel_m + HULL_HEIGHT_M / 2, 0, 0, 0),
        radius_m=body_m,
        length_m=HULL_HEIGHT_M,
        mass_kg=robot.hull_mass_kg,
        inertia_kgm2=robot.hull_inertia_kgm2(),
    )
    hull = base.find("collision")
    hull.find("geometry/cylinder/radius").text = _n(robot.touch_radius_m)
    _friction(hull, _n(robot.rubbing), _n(robot.rubbing))
    _camera(base, robot, body_m)
    _supports(base, robot)
    if any(robot.tracked()):
        x_m, y_m, turned_rad = robot.tracked()
        marker = ET.SubElement(model, "frame", name="marker", attached_to="base_link")
        _text(marker, "pose", _n(x_m, y_m, wheel_m + HULL_HEIGHT_M, 0, 0, turned_rad))
    rims_mps = limits_of(robot).rims_mps
    for k, wheel in enumerate(robot.model.wheels()):
        _wheel(model, robot, wheel, None if rims_mps is None else rims_mps[k])
    if robot.model.wheel_kind in DRIVES:
        _drive(model, robot)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n", left


def _left(robot: RobotModel) -> list[Left]:
    plain = robot.model.wheel_kind == "differential"
    left = [
        *robot.wheels_left(),
        *robot.gains_left("in Gazebo"),
        *robot.base_left("SDF has no place for it", "SDF has its top speed alone"),
    ]
    if robot.model.wheel_kind not in DRIVES:
        why = "the file brings none for such wheels; add Gazebo's VelocityControl to its model"
        left.append(Left("drive", why))
    if robot.model.wheel_kind != "none" and limits_of(robot).rims_mps is None:
        left.append(top_speed_left(robot, "the joints have no limit"))
    if plain and robot.get("robot.half_wheelbase_m"):
        why = "Gazebo turns four plain wheels in curves about one axle, not about the middle"
        left.append(Left("middle of curves", why))
    left += robot.sensor_left("a camera's picture is carried, no bit of detection", partly=True)
    parts, reasons = {}, {}
    if robot.model.drive == "duty":
        parts = dict.fromkeys(TOPS, "SDF has only the top speed that it leaves")
    if robot.model.wheel_kind == "mecanum":
        why = "Gazebo's mecanum drive has one limit for m/s and rad/s"
        reasons = dict.fromkeys(LIMITS, why)
    carried = CARRIED | (dict.fromkeys(LIMITS, ALL) if plain else {})
    return [*left, *robot.left_effects("Gazebo", carried, parts, reasons)]


def _camera(base: ET.Element, robot: RobotModel, x_m: float) -> None:
    """As wide as the cone that the model sees, as far as its range."""
    detection = robot.model.detection_model()
    sensor = ET.SubElement(base, "sensor", name="camera", type="camera")
    _text(sensor, "pose", _n(x_m, 0, 0, 0, 0, detection["pan_rad"]))
    _text(sensor, "update_rate", _n(1 / robot.get("base.control_period_s")))
    camera = ET.SubElement(sensor, "camera", name="camera")
    _text(camera, "horizontal_fov", _n(min(detection["cone_rad"], 3.1)))
    image = ET.SubElement(camera, "image")
    _text(image, "width", "640")
    _text(image, "height", "480")
    clip = ET.SubElement(camera, "clip")
    _text(clip, "near", "0.01")
    _text(clip, "far", _n(max(detection["range_m"], 0.02)))


def _supports(base: ET.Element, robot: RobotModel) -> None:
    """Balls without friction under the hull, as castors."""
    radius_m = robot.support_radius_m()
    for name, x_m in robot.supports_x_m().items():
        for use in ("visual", "collision"):
            part = ET.SubElement(base, use, name=f"{name}_{use}")
            _text(part, "pose", _n(x_m, 0, -HULL_HEIGHT_M / 2 - radius_m, 0, 0, 0))
            ball = ET.SubElement(ET.SubElement(part, "geometry"), "sphere")
            _text(ball, "radius", _n(radius_m))
        _friction(part, "0", "0")


def _wheel(model: ET.Element, robot: RobotModel, wheel: dict, top_mps: float | None) -> None:
    name, radius_m = wheel["name"], robot.get("robot.wheel_radius_m")
    heading_rad = float(np.arctan2(wheel["roll"][1], wheel["roll"][0]))
    pose = (wheel["x_m"], wheel["y_m"], radius_m, -np.pi / 2, 0, heading_rad)
    link = _solid(
        model=model,
        name=f"{name}_wheel",
        pose=pose,
        radius_m=radius_m,
        length_m=WHEEL_WIDTH * radius_m,
        mass_kg=robot.wheel_mass_kg,
        inertia_kgm2=robot.wheel_inertia_kgm2(),
    )
    _grip(link.find("collision"), robot, wheel)
    joint = ET.SubElement(model, "joint", name=f"{name}_wheel_joint", type="revolute")
    _text(joint, "parent", "base_link")
    _text(joint, "child", f"{name}_wheel")
    axis = ET.SubElement(joint, "axis")
    _text(axis, "xyz", "0 0 1")
    limit = ET.SubElement(axis, "limit")
    _text(limit, "lower", "-1e16")
    _text(limit, "upper", "1e16")
    if top_mps:
        _text(limit, "velocity", _n(top_mps / radius_m))


def _grip(collision: ET.Element, robot: RobotModel, wheel: dict) -> None:
    """Touches in one point under the axle, as a ball does: a cylinder stands on its inner edge."""
    shape = collision.find("geometry")
    shape.clear()
    _text(ET.SubElement(shape, "sphere"), "radius", _n(robot.get("robot.wheel_radius_m")))
    across = "0" if robot.model.wheel_kind in ROLLERS else _n(PLAIN_GRIP)
    ode = _friction(collision, "1", across)
    expressed = {f"{prefix}:expressed_in": "base_link" for prefix in PREFIXES}
    ET.SubElement(ode, "fdir1", expressed).text = _n(*wheel["grip"], 0)


def _friction(collision: ET.Element, along: str, across: str) -> ET.Element:
    surface = ET.SubElement(collision, "surface")
    ode = ET.SubElement(ET.SubElement(surface, "friction"), "ode")
    _text(ode, "mu", along)
    _text(ode, "mu2", across)
    return ode


def _drive(model: ET.Element, robot: RobotModel) -> None:
    """Gazebo's controller: the geometry of the wheels, and the real robot's top speeds."""
    kind, limits = robot.model.wheel_kind, limits_of(robot)
    filename, name = DRIVES[kind]
    plugin = ET.SubElement(model, "plugin", filename=filename, name=name)
    for wheel in robot.model.wheels():
        side = "left" if wheel["y_m"] > 0 else "right"
        row = f"{LONG[wheel['name'][0]]}_" if kind == "mecanum" else ""
        _text(plugin, f"{row}{side}_joint", f"{wheel['name']}_wheel_joint")
    _text(plugin, "wheel_separation", _n(2 * robot.get("robot.half_track_m")))
    if kind == "mecanum":
        _text(plugin, "wheelbase", _n(2 * robot.get("robot.half_wheelbase_m")))
    _text(plugin, "wheel_radius", _n(robot.get("robot.wheel_radius_m")))
    if kind == "mecanum":  # its one limit is of m/s and of rad/s; there the joints' limits hold
        return
    for key, way in (("linear", "ahead"), ("angular", "turning")):
        if way in limits.body:
            lowest, highest = limits.body[way]
            _text(plugin, f"min_{key}_velocity", _n(lowest))
            _text(plugin, f"max_{key}_velocity", _n(highest))
        if way in limits.accelerations:
            _text(plugin, f"min_{key}_acceleration", _n(-limits.accelerations[way]))
            _text(plugin, f"max_{key}_acceleration", _n(limits.accelerations[way]))


def _solid(
    model: ET.Element,
    name: str,
    pose: tuple[float, ...],
    radius_m: float,
    *,
    length_m: float,
    mass_kg: float,
    inertia_kgm2: tuple[float, float, float],
) -> ET.Element:
    """A link that is a full cylinder along its z."""
    link = ET.SubElement(model, "link", name=name)
    _text(link, "pose", _n(*pose))
    inertial = ET.SubElement(link, "inertial")
    _text(inertial, "mass", _n(mass_kg))
    inertia = ET.SubElement(inertial, "inertia")
    for key, value in zip(("ixx", "iyy", "izz"), inertia_kgm2, strict=True):
        _text(inertia, key, _n(value))
    for kind in ("visual", "collision"):
        part = ET.SubElement(link, kind, name=kind)
        cylinder = ET.SubElement(ET.SubElement(part, "geometry"), "cylinder")
        _text(cylinder, "radius", _n(radius_m))
        _text(cylinder, "length", _n(length_m))
    return link


def _text(parent: ET.Element, name: str, text: str) -> None:
    ET.SubElement(parent, name).text = text


def _n(*values: float) -> str:
    return " ".join(f"{v:.9g}" for v in np.asarray(values, float) + 0.0)
