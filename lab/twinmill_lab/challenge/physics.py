# SPDX-License-Identifier: Apache-2.0
"""Effects that can be hidden in a log: the catalogue's, their cousins, and some it does not name.

The formulas are written down here a second time, over whole arrays, and share no code with the
effects of the twin. A cousin is the same physics in another formula. Each form acts on one signal
of the chain: command (ticks) -> duty -> target (speeds asked of the rims) -> lag -> rolls (after
the encoders) -> ground (body) -> observe.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from twinmill_lab.challenge.robots import Robot

STEP_S = 1 / 500
NOMINAL_V = 7.4
TURNS_MPS = 1e-3  # of a wheel's rim: below it stands


@dataclass(frozen=True)
class Signals:
    """Time series that a form may depend on, one row for each step of STEP_S.

    Attributes:
        robot: that drives; where forces give it its lag, the forms of a lag see one without.
        duty: (N, W) in -1..1.
        battery_V: (N,)
        pose: (N, 3) x, y, heading in W as far as they are known.
        random: for what happens by chance.
    """

    robot: Robot
    duty: np.ndarray
    battery_V: np.ndarray
    pose: np.ndarray
    random: np.random.Generator


Act = Callable[[np.ndarray, dict[str, float], Signals], np.ndarray]

# Words of answers for what a motion depends on.
HEADING = ("heading", "theta")
PAST = ("past", "history", "change", "start", "stop", "transient", "accel")
SPEED = ("speed", "command")
TIME = ("time", "moment", "event")
TURNS = ("coupling", "turn")
WHERE = ("place", "position", "x", "y", "room", "floor")

# What another form of an effect depends on, for one who does not know it by name.
SHOWN_BY = {
    "dead_zone": SPEED,
    "speed_curve": SPEED,
    "speed_slip": SPEED,
    "battery_sag": TIME,
    "heat_gain": TIME,
    "abrupt_loss": TIME,
    "transient_loss": TIME,
    "motor_lag": PAST,
    "input_delay": PAST,
    "wheel_gain": TURNS,
    "lateral_slip": TURNS,
    "yaw_lever": TURNS,
    "floor_patch": WHERE,
    "carpet_grain": HEADING,
    "compass_deviation": HEADING,
}


@dataclass(frozen=True)
class Hidden:
    """One thing hidden.

    Attributes:
        name: of the catalogue's effect, or of what is outside of it.
        kind: plain, cousin or outside.
        stage: the signal that it acts on.
        values: its numbers; those of a plain form have the catalogue's names and meaning.
        grows: names of the values that are scaled for a wanted size.
        most: how many times.
        depends_on: words for what an outsider or a cousin depends on.
        kin: names of effects that are no mistake for it.
    """

    name: str
    kind: str
    stage: str
    act: Act = field(repr=False, compare=False)
    values: dict[str, float] = field(default_factory=dict)
    grows: tuple[str, ...] = ()
    most: float = 5.0
    depends_on: tuple[str, ...] = ()
    kin: tuple[str, ...] = ()

    def scaled(self, by: float) -> "Hidden":
        """Copy with the numbers that set its strength multiplied by a factor."""
        values = {k: v * by if k in self.grows else v for k, v in self.values.items()}
        return replace(self, values=values)

    def to_json(self) -> dict:
        """Name, kind and values, as the sealed answers keep them."""
        return {"name": self.name, "kind": self.kind, "values": self.values}


def slow(signal: np.ndarray, time_s: float, start: float | np.ndarray = 0.0) -> np.ndarray:
    """First-order lag of each column of (N, k) or of (N,); mean of a step's begin and end."""
    if time_s <= STEP_S:
        return signal
    a = np.exp(-STEP_S / time_s)
    first = np.broadcast_to(np.asarray(start, float), signal.shape[1:])[None]
    end = lfilter([1 - a], [1, -a], signal, axis=0, zi=a * first)[0]
    return (np.concatenate([first, end[:-1]]) + end) / 2


def _dead_zone(duty, v, _):
    return np.sign(duty) * np.maximum(0, np.abs(duty) - v["width"])


def _dead_zone_that_sticks(duty, v, _):
    return np.where(np.abs(duty) > v["width"], duty, 0)


def _speed_curve(duty, v, _):
    a = np.abs(duty)
    return duty * (1 + (1 - a) * (v["bend"] + v["skew"] * (1 - 2 * a)))


def _speed_power(duty, v, _):
    return np.sign(duty) * np.abs(duty) ** (1 + v["power"])


def _slew(duty, v, _):
    return _ramp(duty, v["ramp_s"])


def _accelerates(twist, v, _):
    return _ramp(twist, np.array([v["pace_s2_per_m"]] * 2 + [v["turn_pace_s2_per_rad"]]))


def _ramp(signal, pace_s):
    """(N, k) signals that change by one in no less than (k,) pace_s."""
    most, out = STEP_S / pace_s, np.zeros_like(signal)
    for k in range(1, len(signal)):
        out[k] = out[k - 1] + np.clip(signal[k] - out[k - 1], -most, most)
    return out


def _wheel_gain(rim, v, s):
    names = ("fl", "fr", "rl", "rr")[: rim.shape[1]]
    del s
    return rim * (1 + np.array([v[n] for n in names]))


def _one_wheel(rim, v, s):
    weak = np.zeros(rim.shape[1])
    weak[:: 2 if s.robot.wheels == "differential" else len(weak)] = v["loss"]
    return rim * (1 - weak)


def _battery(rim, v, s):
    return rim * (1 + v["strength"] * (s.battery_V / NOMINAL_V - 1))[:, None]


def _battery_under_load(rim, v, s):
    load_V = 0.4 * slow(np.abs(s.duty).mean(axis=1), 3.0)
    return rim * (1 + v["strength"] * ((s.battery_V - load_V) / NOMINAL_V - 1))[:, None]


def _heat(rim, v, s):
    return rim * (1 - v["loss"] * slow(s.duty**2, 60.0))


def _heat_of_the_pack(rim, v, s):
    return rim * (1 - v["loss"] * slow(np.abs(s.duty).mean(axis=1), 30.0))[:, None]


def _reverse(rim, v, _):
    side = np.array([v["left"], v["right"]] * 2)[: rim.shape[1]]
    return np.where(rim < 0, rim * (1 + side), rim)


def _lag(rim, v, s):
    return slow(rim, s.robot.lag_s + v["extra_s"])


def _second_order(rim, v, s):
    return slow(slow(rim, s.robot.lag_s), v["second_s"])


def _turning_lags(rim, v, s):
    spin = np.eye(3)[2] if s.robot.drive == "twist" else s.robot.to_wheels[:, 2]
    spin = spin / np.linalg.norm(spin)
    turning = np.outer(rim @ spin, spin)
    lag_s = s.robot.lag_s
    return slow(rim - turning, lag_s) + slow(turning, lag_s + v["extra_s"])


def _lag_by_duty(rim, v, s):
    tau = s.robot.lag_s + v["extra_s"] * (1 - np.abs(s.duty))
    share, out = STEP_S / tau, np.zeros_like(rim)
    for k in range(1, len(rim)):
        out[k] = out[k - 1] + share[k] * (rim[k] - out[k - 1])
    return out


def _coasting(rim, v, s):
    share, out = STEP_S / s.robot.lag_s, np.zeros_like(rim)
    for k in range(1, len(rim)):
        old = out[k - 1]
        fall = STEP_S * (v["deceleration_mps2"] + v["viscous_per_s"] * np.abs(old))
        rolls = np.sign(old) * np.maximum(0, np.abs(old) - fall)
        out[k] = np.where(s.duty[k] == 0, rolls, old + share * (rim[k] - old))
    return out


def _eccentric(rim, v, s):
    angle = np.cumsum(rim, axis=0) * STEP_S / s.robot.wheel_radius_m
    cos = np.array([v[f"{w}_cos"] for w in ("fl", "fr", "rl", "rr")[: rim.shape[1]]])
    sin = np.array([v[f"{w}_sin"] for w in ("fl", "fr", "rl", "rr")[: rim.shape[1]]])
    return rim * (1 + cos * np.cos(angle) + sin * np.sin(angle))


def _speed(twist):
    return np.hypot(twist[:, 0], twist[:, 1])[:, None]


def _slowed(twist, share):
    """Travel slowed by a share (N, 1), turning as it was."""
    return np.column_stack([twist[:, :2] * (1 - share), twist[:, 2]])


def _lateral_slip(twist, v, _):
    s = v["slip_s"] * twist[:, 2]
    return np.column_stack(
        [twist[:, 0] + s * twist[:, 1], twist[:, 1] - s * twist[:, 0], twist[:, 2]]
    )


def _slip_to_a_limit(twist, v, _):
    pull = np.abs(twist[:, 2]) * _speed(twist)[:, 0]
    s = v["slip_s"] * twist[:, 2] / (1 + pull / 0.3)
    return np.column_stack(
        [twist[:, 0] + s * twist[:, 1], twist[:, 1] - s * twist[:, 0], twist[:, 2]]
    )


def _speed_slip(twist, v, _):
    return _slowed(twist, v["loss_s_per_m"] * _speed(twist))


def _drag(twist, v, _):
    return _slowed(twist, v["loss_s2_per_m2"] * _speed(twist) ** 2)


def _friction(twist, v, _):
    speed = np.maximum(_speed(twist), 1e-6)
    return _slowed(twist, np.minimum(1, v["loss_mps"] * np.tanh(speed / 0.03) / speed))


def _tilt(twist, v, s):
    moves = np.abs(twist @ s.robot.to_wheels.T).max(axis=1) > TURNS_MPS
    c, n = np.cos(s.pose[:, 2]), np.sin(s.pose[:, 2])
    x, y = v["drift_x_mps"] * moves, v["drift_y_mps"] * moves
    return twist + np.column_stack([c * x + n * y, c * y - n * x, 0 * x])


def _travels(twist, s):
    return np.arctan2(twist[:, 1], twist[:, 0]) + s.pose[:, 2]


def _grain(twist, v, s):
    way = 2 * _travels(twist, s)
    return _slowed(twist, -(v["c2"] * np.cos(way) + v["s2"] * np.sin(way))[:, None])


def _grain_against(twist, v, s):
    across = np.sin(_travels(twist, s) - v["along_rad"]) ** 4
    return _slowed(twist, (v["loss"] * across)[:, None])


def _patch(twist, v, s):
    far = np.hypot(s.pose[:, 0] - v["x_m"], s.pose[:, 1] - v["y_m"])
    return twist * (1 - v["strength"] * 0.5 * (1 - np.tanh((far - v["radius_m"]) / 0.1)))[:, None]


def _mat(twist, v, s):
    off = np.maximum(np.abs(s.pose[:, 0] - v["x_m"]), np.abs(s.pose[:, 1] - v["y_m"]))
    return twist * (1 - v["strength"] * (off < v["half_m"]))[:, None]


def _slope(twist, v, s):
    return _slowed(twist, -(v["x_per_m"] * s.pose[:, 0] + v["y_per_m"] * s.pose[:, 1])[:, None])


def _strafe(twist, v, _):
    both = 2 * twist[:, 0] * twist[:, 1] / np.maximum(_speed(twist)[:, 0] ** 2, 1e-9)
    return twist * np.column_stack([1 + 0 * both, 1 - v["loss"] * both**2, 1 + 0 * both])


def _yaw_lever(twist, v, _):
    return twist * np.column_stack(
        [np.ones((len(twist), 2)), 1 + v["rise_s_per_m"] * _speed(twist)]
    )


def _yaw_lever_square(twist, v, _):
    rise = 1 + v["rise_s2_per_m2"] * _speed(twist) ** 2
    return twist * np.column_stack([np.ones((len(twist), 2)), rise])


def _turns(twist, v, _):
    turn = twist[:, 2] + v["asymmetry"] * np.abs(twist[:, 2])
    return np.column_stack([twist[:, :2], turn])


def _marker(pose, v, _):
    c, n = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x, y = v["x_m"], v["y_m"]
    return pose + np.column_stack([c * x - n * y, n * x + c * y, 0 * c])


def _bias(pose, v, _):
    return pose + np.array([0, 0, v["bias_rad"]])


def _turned(pose, by_rad):
    """The heading seen is off by (N,); places are right."""
    return pose + np.column_stack([np.zeros((len(pose), 2)), by_rad])


def _hard_iron(pose, v, _):
    heading = pose[:, 2]
    return _turned(pose, v["cos_rad"] * np.cos(heading) + v["sin_rad"] * np.sin(heading))


def _iron_of_both_kinds(pose, v, _):
    heading = pose[:, 2]
    return _turned(pose, v["size_rad"] * (np.sin(heading + 1) + 0.3 * np.sin(2 * heading)))


def _soft_iron(pose, v, _):
    return _turned(pose, v["size_rad"] * np.sin(2 * pose[:, 2] + 1))


def _turn_by_heading(twist, v, s):
    return twist * np.column_stack(
        [np.ones((len(twist), 2)), 1 + v["share"] * np.sin(s.pose[:, 2] + 0.4)]
    )


def _tiles(twist, v, s):
    return _slowed(twist, v["share"] * np.sin(2 * np.pi * s.pose[:, :1] / v["length_m"]))


def _from_a_moment(rim, v, _):
    rim, left = rim.copy(), np.tile([1, -1], 2)
    rim[int(v["moment"] * len(rim)) :] *= 1 - v["loss"] - v["side"] * left[: rim.shape[1]]
    return rim


def _over_seconds(rim, v, _):
    since_s = (np.arange(len(rim)) - v["moment"] * len(rim)) * STEP_S
    return rim * (1 - v["loss"] * np.clip(since_s / v["takes_s"], 0, 1))[:, None]


def _for_a_while(rim, v, _):
    rim = rim.copy()
    rim[int(v["moment"] * len(rim)) : int((v["moment"] + 0.2) * len(rim))] *= 1 - v["loss"]
    return rim


def _swelling(rim, v, _):
    """A loss that comes and leaves slowly, at its most 0.15 of the log after it began."""
    since = np.arange(len(rim)) / len(rim) - v["moment"]
    return rim * (1 - v["loss"] * np.sin(np.pi * np.clip(since / 0.3, 0, 1)) ** 2)[:, None]


def _several_losses(rim, v, _):
    t_s = STEP_S * np.arange(len(rim))
    away = np.sin(2 * np.pi * (t_s / v["every_s"] + v["moment"])) > 0.4
    return rim * np.where(away, 1 - v["loss"], 1.0)[:, None]


def _drop_outs(rim, v, s):
    rim = rim.copy()
    seconds = len(rim) * STEP_S
    for start_s in s.random.uniform(1, seconds - 2, int(seconds * v["per_s"])):
        first = int(start_s / STEP_S)
        rim[first : first + int(s.random.uniform(0.3, 0.9) / STEP_S), s.random.integers(2)] = 0
    return rim


def _springy(rim, v, s):
    """Beside the lag a swing of v["hz"] with a tenth of its critical damping."""
    w = 2 * np.pi * v["hz"] * STEP_S
    swing = lfilter([w**2], [1, -2 + 0.2 * w + w**2, 1 - 0.2 * w], slow(rim, s.robot.lag_s), axis=0)
    return (1 - v["share"]) * slow(rim, s.robot.lag_s) + v["share"] * swing


def _backlash(rim, v, s):
    gap_m, out = v["gap_rad"] * s.robot.wheel_radius_m, np.zeros_like(rim)
    low = np.zeros(rim.shape[1])  # of the play: the motor's way is within gap_m above it
    way = np.cumsum(rim, axis=0) * STEP_S
    for k in range(len(rim)):
        moved = np.clip(low, way[k] - gap_m, way[k])
        out[k], low = (moved - low) / STEP_S, moved
    return out


def _delay(t_s, v, _):
    return t_s + v["delay_s"]


def _delay_that_varies(t_s, v, s):
    late = v["delay_s"] + 0.4 * v["delay_s"] * s.random.standard_normal(len(t_s))
    return np.maximum.accumulate(t_s + np.maximum(late, 0))


def catalogue_forms(robot: Robot, random: np.random.Generator) -> list[Hidden]:
    """All that the catalogue names and that this robot can have, plain and as cousins."""
    u, sign = random.uniform, lambda: float(random.choice([-1, 1]))
    wheels = ("fl", "fr", "rl", "rr")[: robot.to_wheels.shape[0]]
    found: list[Hidden] = []

    def form(name: str, kind: str, stage: str, act: Act, *, grows=None, most=5.0, **values: float):
        grows = tuple(values) if grows is None else grows
        found.append(
            Hidden(
                name=name, kind=kind, stage=stage, act=act, values=values, grows=grows, most=most
            )
        )

    if robot.drive == "duty":
        form("dead_zone", "plain", "duty", _dead_zone, width=0.04)
        form("dead_zone", "cousin", "duty", _dead_zone_that_sticks, width=0.08)
        form("speed_curve", "plain", "duty", _speed_curve, bend=0.2 * sign(), skew=0.1 * sign())
        form("speed_curve", "cousin", "duty", _speed_power, power=0.12 * sign())
        form("slew_limit", "plain", "duty", _slew, ramp_s=0.12)
        form("battery_sag", "plain", "target", _battery, most=1.5, strength=0.9)
        form("battery_sag", "cousin", "target", _battery_under_load, most=1.5, strength=0.9)
        form("heat_gain", "plain", "target", _heat, loss=0.08)
        form("heat_gain", "cousin", "target", _heat_of_the_pack, loss=0.08)
        left, right = 0.04 * u(0.4, 1.4) * sign(), 0.04 * u(0.4, 1.4) * sign()
        form("reverse_asymmetry", "plain", "target", _reverse, left=left, right=right)
        form("lag_by_duty", "plain", "lag", _lag_by_duty, extra_s=0.08)
        form(
            "coasting",
            "plain",
            "lag",
            _coasting,
            grows=(),
            deceleration_mps2=0.6,
            viscous_per_s=0.4,
        )
    if robot.drive != "wheel_speed":
        at = {"moment": float(u(0.3, 0.7)), "loss": 0.05}
        both, slowly = at | {"side": 0.0}, at | {"takes_s": 6.0}
        if robot.drive == "duty":
            both["side"] = 0.05 * float(random.choice([-1, 0, 1]))
        form("abrupt_loss", "plain", "target", _from_a_moment, grows=("loss", "side"), **both)
        form("abrupt_loss", "cousin", "target", _over_seconds, grows=("loss",), **slowly)
        form("transient_loss", "plain", "target", _for_a_while, grows=("loss",), **at)
        form("transient_loss", "cousin", "target", _swelling, grows=("loss",), **at)
        if robot.plant == "planar":  # before motors with a lag of their own it is a second one
            form("motor_lag", "plain", "lag", _lag, extra_s=0.03)
        form("motor_lag", "cousin", "lag", _second_order, second_s=0.03)
        form("second_order_lag", "plain", "lag", _second_order, second_s=0.03)
        form("yaw_lag", "plain", "lag", _turning_lags, extra_s=0.04)
        form("input_delay", "plain", "command", _delay, delay_s=0.025)
        form("input_delay", "cousin", "command", _delay_that_varies, delay_s=0.03)
    if robot.drive == "twist":
        form("acceleration_limit", "plain", "duty", _accelerates, pace_s2_per_m=0.6,
             turn_pace_s2_per_rad=0.15)  # fmt: skip
    else:
        form("backlash", "plain", "rolls", _backlash, gap_rad=0.15)
        gains = _by_wheel(robot, random.normal(0, 0.03, len(wheels)))
        gains -= gains.mean()
        form("wheel_gain", "plain", "rolls", _wheel_gain, **dict(zip(wheels, gains, strict=True)))
        form("wheel_gain", "cousin", "rolls", _one_wheel, loss=0.05)
        bent = _by_wheel(robot, random.uniform(-0.03, 0.03, (len(wheels), 2)))
        parts = {
            f"{w}_{p}": b
            for w, row in zip(wheels, bent, strict=True)
            for p, b in zip(("cos", "sin"), row, strict=True)
        }
        form("wheel_eccentricity", "plain", "rolls", _eccentric, **parts)
    if robot.plant == "planar":
        found += _of_the_ground(robot, random)
    form("marker_offset", "plain", "observe", _marker, x_m=0.007 * sign(), y_m=0.006 * sign())
    if robot.sideways:
        form("heading_bias", "plain", "observe", _bias, bias_rad=0.02 * sign())
    off = {"cos_rad": 0.03 * sign(), "sin_rad": 0.03 * sign()}
    form("compass_deviation", "plain", "observe", _hard_iron, **off)
    form("compass_deviation", "cousin", "observe", _iron_of_both_kinds, size_rad=0.04)
    return [replace(h, depends_on=SHOWN_BY[h.name]) if h.kind == "cousin" else h for h in found]


def _by_wheel(robot: Robot, drawn: np.ndarray) -> np.ndarray:
    """(K, ...) as drawn; of robots on two wheels front and rear of a side are one."""
    return drawn[[0, 1, 0, 1]] if robot.wheels == "differential" else drawn


def _of_the_ground(robot: Robot, random: np.random.Generator) -> list[Hidden]:
    """Candidates that act between wheels and floor; only the planar plant has them."""
    sign, near = lambda: float(random.choice([-1, 1])), lambda: float(random.uniform(-0.4, 0.4))
    along_rad = float(random.uniform(0, np.pi))
    plain = [
        ("lateral_slip", _lateral_slip, {"slip_s": 0.04 * sign()}),
        ("speed_slip", _speed_slip, {"loss_s_per_m": 0.25}),
        ("coulomb_friction", _friction, {"loss_mps": 0.012}),
        ("floor_tilt", _tilt, {"drift_x_mps": 0.006 * sign(), "drift_y_mps": 0.005 * sign()}),
        ("carpet_grain", _grain, {"c2": 0.03 * sign(), "s2": 0.03 * sign()}),
        ("gain_slope", _slope, {"x_per_m": 0.03 * sign(), "y_per_m": 0.03 * sign()}),
        ("yaw_lever", _yaw_lever, {"rise_s_per_m": 0.4 * sign()}),
        ("turn_asymmetry", _turns, {"asymmetry": 0.03 * sign()}),
    ]
    if robot.sideways:
        plain.append(("strafe_loss", _strafe, {"loss": 0.12}))
    cousins = [
        ("lateral_slip", _slip_to_a_limit, {"slip_s": 0.06 * sign()}),
        ("speed_slip", _drag, {"loss_s2_per_m2": 0.5}),
        ("yaw_lever", _yaw_lever_square, {"rise_s2_per_m2": 0.8 * sign()}),
    ]
    found = [Hidden(n, "plain", "ground", a, v, tuple(v)) for n, a, v in plain]
    found += [Hidden(n, "cousin", "ground", a, v, tuple(v)) for n, a, v in cousins]
    patch = {"strength": 0.2, "x_m": near(), "y_m": near(), "radius_m": 0.45}
    mat = {"strength": 0.2, "x_m": near(), "y_m": near(), "half_m": 0.4}
    grain = {"loss": 0.06, "along_rad": along_rad}
    return [
        *found,
        Hidden(
            name="floor_patch",
            kind="plain",
            stage="ground",
            act=_patch,
            values=patch,
            grows=("strength",),
            most=4,
        ),
        Hidden(
            name="floor_patch",
            kind="cousin",
            stage="ground",
            act=_mat,
            values=mat,
            grows=("strength",),
            most=4,
        ),
        Hidden("carpet_grain", "cousin", "ground", _grain_against, grain, ("loss",)),
    ]


def outside_forms(robot: Robot, random: np.random.Generator) -> list[Hidden]:
    """Effects beyond the catalogue, each with words for what it depends on."""
    moment, hz = float(random.uniform(0.35, 0.65)), float(random.uniform(1.5, 3))
    compass = {"size_rad": 0.05}
    found = [
        Hidden(
            name="soft iron",
            kind="outside",
            stage="observe",
            act=_soft_iron,
            values=compass,
            grows=("size_rad",),
            most=5,
            depends_on=HEADING,
        )
    ]
    if robot.drive != "wheel_speed":
        several = {"moment": moment, "loss": 0.05, "every_s": float(random.uniform(20.0, 36.0))}
        drops = {"per_s": 0.12}
        swing = {"share": 0.4, "hz": hz}
        found += [
            Hidden(
                name="several",
                kind="outside",
                stage="target",
                act=_several_losses,
                values=several,
                grows=("loss",),
                most=5,
                depends_on=TIME,
            ),
            Hidden(
                name="drop-outs",
                kind="outside",
                stage="target",
                act=_drop_outs,
                values=drops,
                grows=(),
                most=1,
                depends_on=TIME,
            ),
        ]
        if robot.plant == "planar":
            found.append(
                Hidden(
                    name="springy",
                    kind="outside",
                    stage="lag",
                    act=_springy,
                    values=swing,
                    grows=("share",),
                    most=2,
                    depends_on=PAST,
                )
            )
    if robot.plant == "planar":
        turn, tiles = {"share": 0.08}, {"share": 0.1, "length_m": float(random.uniform(0.5, 0.9))}
        found += [
            Hidden(
                name="turn by heading",
                kind="outside",
                stage="ground",
                act=_turn_by_heading,
                values=turn,
                grows=("share",),
                most=5,
                depends_on=HEADING,
            ),
            Hidden(
                name="tiles",
                kind="outside",
                stage="ground",
                act=_tiles,
                values=tiles,
                grows=("share",),
                most=5,
                depends_on=WHERE,
            ),
        ]
    return found
