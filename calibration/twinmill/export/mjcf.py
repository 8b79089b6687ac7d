# SPDX-License-Identifier: Apache-2.0
"""A model as one MJCF file for MuJoCo as it is, without plugins and without the twin.

The body moves on the floor by two slides and a hinge. Of each wheel an actuator pulls at the body
along the wheel's grip, by the difference between the rim's speed and the body's:

    force_k = kv (a_k - J_k v),  a_k the actuator's activation, J_k its gear, v the body's velocity

A body that light settles within about a millisecond where the forces cancel, which is the least
squares of J v = a: the rolling of mecanum, omni and plain wheels. Gains of the body's speeds are in
the gears, the motors' lag is the activation's filter, a delay of commands is the actuator's own.

A robot that is told its velocity has an actuator for each part of it, which pushes the body along
what the wheels make of that part, a column of G, and damped joints:

    force = D (G a - v),  D the damping
"""

import xml.etree.ElementTree as ET

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.export.carried import ALL, HULL_HEIGHT_M, WHEEL_WIDTH, Left, RobotModel
from twinmill.export.drive import wheel_gains
from twinmill.export.steady import CURVES, DUTIES_PCT, STATIC, limits_of, only, rim_table

STEP_S = 0.001
SETTLE_S = 0.001  # of the body behind its wheels
DELAY_SLOTS_PER_S = 10_000  # commands that a delay keeps: one each step of 0.1 ms or more
# Taken off a delay: MuJoCo's time is a sum of steps, and a delay of whole steps is one step longer
# while the sum is rounded to one side.
ROUNDING_S = 1e-7
ASPECT = 4 / 3  # of the camera's picture
LAGS = (*CURVES, "motor_lag", "lag_by_duty")
PLACED = ("marker_offset", "heading_bias", "collision", "view_angle", "view_pan")
SIGHT = (
    *("view_range", "missed_detection", "false_detection", "vote", "sensor_delay", "occlusion"),
)
USUAL_PCT = 75  # a duty between those that robots drive at
LONG_S = 20.0  # after which no lag is left
COUPLING = ("mass_offset",)  # linear in the body's velocity, so in the gears
BY_TABLE = {
    "lag_by_duty": "MuJoCo's filter has one time constant, here that of duty "
    f"{USUAL_PCT} %; set each wheel's actuator_dynprm from lag_s in <custom> with its duty",
    "coasting": "MuJoCo's filter slows down by a share, not evenly; lag_s in <custom> at duty 0 "
    f"rolls as far, from the speed of duty {USUAL_PCT} %; exact is, if <custom> has coasting, to "
    "let ctrl fall at duty 0 by its first number, in m/s^2, and its second times ctrl",
}

DELAYED = (
    "The delay of commands holds in MuJoCo in C and in Warp, at steps of 0.1 ms or more.",
    "MJX with JAX leaves it out, and actearly, without a word. Before the first command it is 0,",
    "whatever ctrl a keyframe has: mj_initCtrlHistory fills it. data.time set back repeats old",
    "commands or ends it. Begin a rollout with mj_getState after mj_resetData: from a state of",
    "zeros one command acts at once.",
)


def mjcf(robot: RobotModel) -> tuple[str, list[Left]]:
    """The file's text, and what it does not carry.

    Raises:
        ValueError: the robot steers.
    """
    model = robot.model
    if model.wheel_kind == "ackermann":
        raise ValueError(
            f"{robot.file.path}: a steered robot's wheels have no MJCF here; "
            f"use {option('to', 'urdf')}, sdf or json."
        )
    left = _left(robot)
    lags_s = _lags_s(robot)
    root = ET.Element("mujoco", model=robot.name)
    root.append(ET.Comment(_about(robot, left)))
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", timestep=_n(STEP_S), integrator="implicitfast")
    root.append(_custom(robot, lags_s))
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0 0 3", dir="0 0 -1")
    ET.SubElement(
        world,
        "geom",
        name="floor",
        type="plane",
        size="5 5 0.1",
        contype="0",
        conaffinity="0",
        rgba="0.8 0.8 0.8 1",
    )
    world.append(_body(robot))
    root.append(_actuators(robot, float(lags_s[USUAL_PCT - DUTIES_PCT[0]])))
    root.append(_sensors(robot))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n", left


def lag_table(model: native.Model) -> np.ndarray:
    """(201,) time constant (s) of a wheel after a change to duties -100..100 %.

    By how far the robot falls behind from rest; at duty 0 by how far it rolls. Where a duty does
    not move it, as at the next that does.
    """
    lags_s = np.full(101, np.nan)
    slow = only(model, LAGS)
    for duty in range(1, 101):
        way_m, then_m = _ways_m(slow, [duty / 100])
        if then_m > 1e-6:
            lags_s[duty] = LONG_S * (1 - way_m / then_m)
    speed_mps = _ways_m(slow, [USUAL_PCT / 100])[1] / LONG_S
    rolled = only(model, (*LAGS, "coasting"))
    lags_s[0] = _ways_m(rolled, [USUAL_PCT / 100, 0.0])[1] / speed_mps
    known = np.isfinite(lags_s)
    lags_s = np.interp(np.arange(101), np.flatnonzero(known), lags_s[known])
    return np.concatenate([lags_s[:0:-1], lags_s])


def _ways_m(model: native.Model, duties: list[float]) -> tuple[float, float]:
    """Way forward in the first and in the second 20 s, the duties sharing that time evenly."""
    count = len(duties)
    commands = np.zeros((count, 4))
    commands[:, : len(model.wheels())] = np.outer(duties, _ahead(model))
    track = native.Track(
        np.arange(count) * LONG_S,
        commands,
        np.full(count, np.nan),
        np.arange(3) * LONG_S,
        np.zeros((3, 3)),
        np.zeros(3, np.int64),
    )
    ahead = native.windows(model, track, np.array([0]), np.array([[1, 2]]))[0]
    return float(np.hypot(*ahead[0, :2])), float(np.hypot(*(ahead[1] - ahead[0])[:2]))


def _ahead(model: native.Model) -> np.ndarray:
    """(K,) duties -1, 0 or 1 that drive straight on; three omni wheels all at 1 only turn."""
    return np.rint([wheel["grip"][0] for wheel in model.wheels()])


def _about(robot: RobotModel, left: list[Left]) -> str:
    ctrl = {
        "duty": "rim speed of the wheel in m/s: look a duty up in <custom>, "
        "ctrl = interp(duty, duty_pct, NAME_rim_mps)",
        "wheel_speed": "speed of the wheel in rad/s",
        "twist": "velocity of the body: forward and left in m/s, turn to the left in rad/s",
    }[robot.model.drive]
    lines = [
        f"Written by twinmill from {robot.file.path.name} (sha256 {robot.file.hash}).",
        f"ctrl: {ctrl}.",
        "Joints x, y, yaw are the pose; the floor is drawn and does not touch.",
        "A scene that this is attached to needs this integrator: its own options hold there.",
        *(DELAYED if _delay_s(robot) > 0 else ()),
        "Not carried:",
        *(f"- {item.sentence()}" for item in left),
    ]
    # A comment must not hold two hyphens in a row, nor end in one.
    return "\n    " + "\n    ".join(line.replace("--", "- -") for line in lines) + "\n  "


def _left(robot: RobotModel) -> list[Left]:
    carried = dict.fromkeys((*PLACED, *COUPLING, "motor_lag", "input_delay"), ALL)
    parts = dict.fromkeys(SIGHT, "no bit of detection is made; its numbers are in <custom>")
    reasons = {}
    if robot.model.drive == "duty":
        carried |= dict.fromkeys(STATIC, ALL)
        parts |= BY_TABLE
    else:
        carried["wheel_gain"] = ALL
    if robot.model.drive == "wheel_speed":
        carried["wheel_limit"] = ALL
    elif robot.model.wheel_kind == "differential":
        carried["speed_limit"] = ALL
    else:
        parts["speed_limit"] = "ahead and sideways are limited each alone, so aslant it is faster"
    if robot.model.drive == "twist":
        reasons["wheel_limit"] = "the file pushes the body, and its wheels do not turn"
    left = robot.left_effects("stock MuJoCo", carried, parts, reasons)
    if robot.get("noise.drive_mps") or robot.get("noise.drive_radps"):
        left.append(Left("noise.drive", "MuJoCo adds no noise by itself; its size is in <custom>"))
    why = "no bit of detection is made; its numbers are in <custom>"
    left += robot.sensor_left(why, partly=True)
    left.append(Left("motor torque", "the model tells none: the wheels never slip or stall"))
    return left


def _custom(robot: RobotModel, lags_s: np.ndarray) -> ET.Element:
    """Numbers on which MuJoCo itself does not act, for the program that drives it."""
    custom = ET.Element("custom")
    if robot.model.drive == "duty":
        _numeric(custom, "duty_pct", DUTIES_PCT)
        for wheel, rim_mps in zip(robot.model.wheels(), rim_table(robot.model).T, strict=True):
            _numeric(custom, f"{wheel['name']}_rim_mps", rim_mps)
        _numeric(custom, "lag_s", lags_s)
        if (rolls := robot.values_of("coasting")) and not _delay_s(robot):
            _numeric(custom, "coasting", list(rolls[-1].values()))
    _numeric(custom, "control_period_s", [robot.get("base.control_period_s")])
    for key in ("sensor_m", "sensor_rad", "drive_mps", "drive_s", "drive_radps", "drive_turn_s"):
        _numeric(custom, f"noise_{key}", [robot.get(f"noise.{key}")])
    for key, value in robot.model.detection_model().items():
        _numeric(custom, f"sight_{key}", [value])
    return custom


def _numeric(custom: ET.Element, name: str, data: np.ndarray | list[float]) -> None:
    ET.SubElement(custom, "numeric", name=name, data=_n(*data))


def _body(robot: RobotModel) -> ET.Element:
    radius_m, wheel_m = robot.get("robot.body_radius_m"), robot.get("robot.wheel_radius_m")
    body = ET.Element("body", name="base")
    held = _damping(robot) if robot.model.drive == "twist" else np.zeros(3)
    for name, kind, axis, damping in (
        ("x", "slide", "1 0 0", held[0]),
        ("y", "slide", "0 1 0", held[1]),
        ("yaw", "hinge", "0 0 1", held[2]),
    ):
        ET.SubElement(body, "joint", name=name, type=kind, axis=axis, damping=_n(damping))
    middle = _n(0, 0, wheel_m + HULL_HEIGHT_M / 2)
    ET.SubElement(
        body,
        "inertial",
        pos=middle,
        mass=_n(robot.get("robot.mass_kg")),
        diaginertia=_n(*robot.hull_inertia_kgm2()),
    )
    ET.SubElement(
        body,
        "geom",
        name="hull",
        type="cylinder",
        pos=middle,
        mass="0",
        size=_n(robot.touch_radius_m, HULL_HEIGHT_M / 2),
        friction=_n(robot.rubbing),
        rgba="0.2 0.5 0.4 0.6",
    )
    for wheel in robot.model.wheels():
        axle = (-wheel["roll"][1], wheel["roll"][0], 0)
        ET.SubElement(
            body,
            "geom",
            name=wheel["name"],
            type="cylinder",
            mass="0",
            contype="0",
            conaffinity="0",
            size=_n(wheel_m, WHEEL_WIDTH * wheel_m / 2),
            pos=_n(wheel["x_m"], wheel["y_m"], wheel_m),
            zaxis=_n(*axle),
            rgba="0.1 0.1 0.1 1",
        )
    ET.SubElement(body, "site", name="drive")
    x_m, y_m, bias_rad = robot.tracked()
    ET.SubElement(
        body,
        "site",
        name="marker",
        pos=_n(x_m, y_m, wheel_m + HULL_HEIGHT_M),
        euler=_n(0, 0, bias_rad),
        size="0.005",
    )
    _camera(robot, body, radius_m, wheel_m + HULL_HEIGHT_M / 2)
    return body


def _camera(robot: RobotModel, body: ET.Element, x_m: float, z_m: float) -> None:
    """Looks ahead, turned by the pan; its picture is as wide as the cone that the model sees."""
    detection = robot.model.detection_model()
    wide_rad = min(detection["cone_rad"], 0.95 * np.pi)
    fovy_deg = np.degrees(2 * np.arctan(np.tan(wide_rad / 2) / ASPECT))  # as MuJoCo has it
    c, s = np.cos(detection["pan_rad"]), np.sin(detection["pan_rad"])
    ET.SubElement(
        body,
        "camera",
        name="camera",
        pos=_n(x_m, 0, z_m),
        xyaxes=_n(s, -c, 0, 0, 0, 1),
        fovy=_n(fovy_deg),
        resolution="640 480",
    )


def _actuators(robot: RobotModel, lag_s: float) -> ET.Element:
    """One for each wheel, or for each direction of a robot told its velocity."""
    if robot.model.drive == "twist":
        return _pushes(robot, lag_s)
    gains = np.array([robot.get(f"base.{d}_gain") for d in ("forward", "sideways", "yaw")])
    gains *= [robot.get(n) for n in ("theta_a1", "theta_a1", "theta_a2")]
    wheels = robot.model.wheels()
    rows = np.array([_grip(w) for w in wheels])
    strafes = bool(np.any(rows[:, 1]))
    apart = np.linalg.inv(_coupling(robot, strafes))
    kv = robot.get("robot.mass_kg") / SETTLE_S
    actuator = ET.Element("actuator")
    held = kv
    kv /= np.sum(rows[:, 0] ** 2)  # together they pull forward at kv
    rims_mps = limits_of(robot).rims_mps
    unit = robot.get("robot.wheel_radius_m") if robot.model.drive == "wheel_speed" else 1.0
    for k, (wheel, row) in enumerate(zip(wheels, rows, strict=True)):
        own = unit * (1.0 if robot.model.drive == "duty" else wheel_gains(robot)[k])
        servo = _servo(
            robot=robot,
            lag_s=lag_s,
            name=wheel["name"],
            row=row / gains @ apart,
            kv=kv,
            gain=float(own),
            top=_top(robot, rims_mps, k, float(own)),
        )
        actuator.append(servo)
    if not strafes:  # plain wheels hold the robot sideways
        actuator.append(
            _servo(robot, lag_s, name="left", row=apart[1], kv=held, gain=0.0, top=None)
        )
    return actuator


def _top(robot: RobotModel, rims_mps: np.ndarray | None, k: int, gain: float) -> float | None:
    """Highest command of a wheel; one told a rim's speed may be told twice the robot's top."""
    if rims_mps is None:
        return None
    return 2 * float(rims_mps.max()) if robot.model.drive == "duty" else float(rims_mps[k]) / gain


def _coupling(robot: RobotModel, strafes: bool) -> np.ndarray:
    """(3, 3) velocity that comes of each part of the wheels' own (forward, left, turn)."""
    commands = np.eye(4)
    plain, coupled = (
        native.steady(only(robot.model, effects), commands, [], np.zeros((0, 0)))[0][:, :3]
        for effects in ((), COUPLING)
    )
    if not strafes:
        plain, coupled = (np.vstack([v, [0.0, 1.0, 0.0]]) for v in (plain, coupled))
    return np.linalg.lstsq(plain, coupled)[0].T


def _pushes(robot: RobotModel, lag_s: float) -> ET.Element:
    """One for each part of the velocity that a robot is told; the damped joints hold against it."""
    actuator = ET.Element("actuator")
    pushes = (_damping(robot)[:, None] * _velocity_gains(robot)).T
    pace = max((v["pace_s_per_m"] for v in robot.values_of("speed_limit")), default=0.0)
    for name, row in zip(("forward", "left", "turn"), pushes, strict=True):
        options = _signal(robot, lag_s, name, row)
        if pace > 0 and name != "turn":
            options["ctrlrange"] = _n(-1 / pace, 1 / pace)
        actuator.append(ET.Element("general", options))
    return actuator


def _damping(robot: RobotModel) -> np.ndarray:
    """(3,) N s/m along x and y and N m s about z, by which the body alone settles in SETTLE_S."""
    mass_kg = robot.get("robot.mass_kg")
    return np.array([mass_kg, mass_kg, robot.hull_inertia_kgm2()[2]]) / SETTLE_S


def _velocity_gains(robot: RobotModel) -> np.ndarray:
    """(3, 3) velocity that comes of each part of a velocity told, once the lags are over."""
    still = only(robot.model, ("wheel_gain", *COUPLING))
    told = np.column_stack([np.eye(3), np.zeros(3)])
    return native.steady(still, told, [], np.zeros((0, 0)))[0][:, :3].T


def _grip(wheel: dict) -> np.ndarray:
    """(3,) rim speed per forward, left and turning speed of the body."""
    x, y = wheel["grip"]
    return np.array([x, y, wheel["x_m"] * y - wheel["y_m"] * x])


def _servo(
    robot: RobotModel,
    lag_s: float,
    *,
    name: str,
    row: np.ndarray,
    kv: float,
    gain: float,
    top: float | None,
) -> ET.Element:
    """Pulls along `row` (forward, left, turn) until the speed there is `gain` times its filter.

    Its command is cut to `top`, if there is one.
    """
    options = _signal(robot, lag_s, name, row)
    if top is not None:
        options["ctrlrange"] = _n(-top, top)
    options |= {"gainprm": _n(kv * gain), "biastype": "affine", "biasprm": _n(0, 0, -kv)}
    return ET.Element("general", options)


def _signal(robot: RobotModel, lag_s: float, name: str, row: np.ndarray) -> dict[str, str]:
    """Attributes of an actuator along `row` (forward, left, turn), with lag and delay."""
    delay_s = _delay_s(robot)
    options = {"name": name, "site": "drive", "gear": _n(row[0], row[1], 0, 0, 0, row[2])}
    if lag_s > 1e-6 or robot.values_of("coasting"):
        options |= {"dyntype": "filterexact", "dynprm": _n(lag_s), "actearly": "true"}
    if delay_s > ROUNDING_S:
        options |= {
            "delay": _n(delay_s - ROUNDING_S),
            "nsample": str(int(np.ceil(DELAY_SLOTS_PER_S * delay_s)) + 1),
        }
    return options


def _delay_s(robot: RobotModel) -> float:
    return sum(v["delay_s"] for v in robot.values_of("input_delay"))


def _lags_s(robot: RobotModel) -> np.ndarray:
    """(201,) time constants at DUTIES_PCT; of other drives the same everywhere."""
    if robot.model.drive == "duty":
        return lag_table(robot.model)
    more_s = sum(v["extra_s"] for v in robot.values_of("motor_lag"))
    return np.full(len(DUTIES_PCT), max(0.0, robot.get("base.motor_lag_s") + more_s))


def _sensors(robot: RobotModel) -> ET.Element:
    """Sensors for motion capture, with its noise as MuJoCo keeps it."""
    sensor = ET.Element("sensor")
    noise_m, noise_rad = (robot.get(f"noise.sensor_{u}") for u in ("m", "rad"))
    marker = {"objtype": "site", "objname": "marker"}
    ET.SubElement(sensor, "framepos", name="position", noise=_n(noise_m), **marker)
    ET.SubElement(sensor, "framequat", name="orientation", noise=_n(noise_rad), **marker)
    return sensor


def _n(*values: float) -> str:
    return " ".join(f"{v:.9g}" for v in np.asarray(values, float) + 0.0)
