#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How often `tm.diagnose_joints` is right on robots that MuJoCo simulates: planted causes.

The robots are a two-joint arm told torques, and three of servos: a leg, three joints with the
numbers of MuJoCo Menagerie's UR5e (stiff, strongly damped, no friction), and a small desk arm of
hobby servos, whose encoders have 12 bits. What is planted shares no code with the catalogue:
numbers of the XML are changed, and forces that MJCF lacks are set in a loop of `mj_step` by other
formulas than those of the catalogue (a friction of arctan, a spring that hardens, a supply that
falls by a root, ...). A row of results is printed for each case, and a table in the end.

    .venv/bin/python benchmarks/joints_exam.py --seeds 3
"""

import argparse
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from threadpoolctl import threadpool_limits

from twinmill.joints.diagnose import diagnose_joints
from twinmill.joints.log import JointLog

ARM = """<mujoco model="arm">
  <option timestep="0.002"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" damping="0.4" frictionloss="0.3" armature="0.02"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="1.2"/>
      <body name="fore" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.2" frictionloss="0.15" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.025" mass="0.7"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="m1" joint="shoulder" gear="1"/>
    <motor name="m2" joint="elbow" gear="1"/>
  </actuator>
</mujoco>
"""
LEG = """<mujoco model="leg">
  <option timestep="0.002"/>
  <worldbody>
    <body name="thigh" pos="0 0 0.6">
      <joint name="hip" axis="0 1 0" damping="0.3" frictionloss="0.2" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.9"/>
      <body name="shank" pos="0 0 -0.2">
        <joint name="knee" axis="0 1 0" damping="0.2" frictionloss="0.1" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.015" mass="0.3"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="p1" joint="hip" kp="40" kv="1.5"/>
    <position name="p2" joint="knee" kp="30" kv="1"/>
  </actuator>
</mujoco>
"""
UR = """<mujoco model="ur">
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="upper" pos="0 0 0.163" quat="1 0 1 0">
      <inertial mass="8.393" pos="0 0 0.2125" diaginertia="0.133886 0.133886 0.0151074"/>
      <joint name="lift" axis="0 1 0" armature="0.1" damping="0" frictionloss="0"/>
      <body name="fore" pos="0 -0.131 0.425">
        <inertial mass="2.275" pos="0 0 0.196" diaginertia="0.0311796 0.0311796 0.004095"/>
        <joint name="elbow" axis="0 1 0" armature="0.1" damping="0" frictionloss="0"/>
        <body name="hand" pos="0 0 0.392" quat="1 0 1 0">
          <inertial mass="1.219" pos="0 0.127 0" diaginertia="0.0025599 0.0025599 0.0021942"/>
          <joint name="wrist" axis="0 1 0" armature="0.1" damping="0" frictionloss="0"/>
          <body pos="0 0.127 0">
            <inertial mass="1.408" pos="0 0.05 0.1" diaginertia="0.004 0.004 0.003"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="p1" joint="lift" kp="2000" kv="400"/>
    <position name="p2" joint="elbow" kp="2000" kv="400"/>
    <position name="p3" joint="wrist" kp="500" kv="100"/>
  </actuator>
</mujoco>
"""
DESK = """<mujoco model="desk">
  <option timestep="0.002"/>
  <default>
    <joint axis="0 1 0"/>
  </default>
  <worldbody>
    <body name="upper" pos="0 0 0.1">
      <joint name="shoulder" damping="0.6" frictionloss="0.052" armature="0.028"/>
      <geom type="box" pos="0 0 0.056" size=".02 .02 .056" mass="0.11"/>
      <body name="fore" pos="0 0 0.112">
        <joint name="elbow" damping="0.6" frictionloss="0.052" armature="0.028"/>
        <geom type="box" pos="0.067 0 0" size=".067 .02 .02" mass="0.1"/>
        <body name="hand" pos="0.135 0 0">
          <joint name="wrist" damping="0.6" frictionloss="0.052" armature="0.028"/>
          <geom type="box" pos="0.05 0 0" size=".05 .03 .02" mass="0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="p1" joint="shoulder" kp="17.8"/>
    <position name="p2" joint="elbow" kp="17.8"/>
    <position name="p3" joint="wrist" kp="17.8"/>
  </actuator>
</mujoco>
"""


@dataclass(frozen=True)
class Robot:
    """A robot of the exam; what is planted acts on two of its joints, an early and a late one.

    Attributes:
        xml: of it.
        at: numbers of those two joints.
        forces, speeds: of these as they move, about which what is planted is sized.
        period_s: of the log.
        encoder_rad: white noise of positions.
        bits: of encoders; 0 for none.
        span: reach of the commands, by joint.
        middle: of the commands.
        knots_s: between poses; ways are straight where `jerky`, else of minimum jerk.
    """

    xml: str
    at: tuple[int, int]
    forces: tuple[float, float]
    speeds: tuple[float, float]
    period_s: float = 0.004
    encoder_rad: float = 2e-4
    bits: int = 0
    span: tuple[float, ...] = (0.7, 0.9)
    middle: tuple[float, ...] = (0.0, -0.6)
    knots_s: float = 0.6
    jerky: bool = True

    def names(self, element: str) -> list[str]:
        """Names of joints or of actuators."""
        kinds = {"joint": "joint", "actuator": "motor|position"}[element]
        return re.findall(rf'<(?:{kinds}) name="(\w+)"', self.xml)

    @property
    def last_body(self) -> str:
        """Name of the link whose mass is changed."""
        return re.findall(r'<body name="(\w+)"', self.xml)[-1]

    @property
    def stiffness(self) -> float:
        """Gain of the first servo."""
        return float(re.search(r'kp="([\d.]+)"', self.xml)[1])


ROBOTS = {
    "arm": Robot(ARM, (0, 1), (5.2, 1.2), (1.9, 2.2), span=(0.8, 1.0), middle=(0.0, 0.0)),
    "leg": Robot(LEG, (0, 1), (0.7, 0.4), (0.9, 1.2)),
    "ur": Robot(UR, (0, 2), (38.0, 1.0), (0.45, 0.8), 0.008, 2e-5, 0, (0.7, 0.9, 1.2),
                (-0.9, 1.0, 0.0), 1.5, False),
    "desk": Robot(DESK, (0, 2), (0.65, 0.63), (0.8, 1.0), 0.02, 0.0, 12, (0.8, 0.9, 1.0),
                  (0.0, 0.3, 0.0), 1.2, False),
}  # fmt: skip
DURATION_S = 40.0
STEP_S = 0.00025  # of the simulated robot: its time is continuous, whatever the model's step is
Push = Callable[[mujoco.MjData, float], None]


@dataclass(frozen=True)
class Case:
    """Planted defect of a joint model.

    Attributes:
        names: answers that are right, one set for each cause.
        change: of the XML.
        push: sets forces or commands before each step.
        outside: it is nothing that the catalogue has, but depends on this.
        also: what is right beside these, as more friction one way is more on average, too.
    """

    names: tuple[frozenset[str], ...] = ()
    change: Callable[[str], str] = str
    push: Push | None = None
    outside: str = ""
    also: frozenset[str] = frozenset()
    shift: np.ndarray = field(default_factory=lambda: np.zeros(0))


def attribute(element: str, name: str, key: str, factor: float = 1.0, *, plus: float = 0.0):
    """Changes one number of the XML."""

    def change(text: str) -> str:
        at = rf'(<{element} name="{name}"[^>]*\b{key}=")([\d.]+)'
        assert re.search(at, text)
        return re.sub(at, lambda m: f"{m[1]}{float(m[2]) * factor + plus:.8g}", text)

    return change


def one_way(d: int, c: float) -> Push:
    """More friction with speed one way alone, by a soft threshold of speed."""

    def push(data, _):
        v = data.qvel[d]
        data.qfrc_applied[d] -= c * np.log1p(np.exp(20 * v)) / 20 if v < 2 else c * v

    return push


def of_load(d: int, share: float) -> Push:
    """Friction of a gear under load, by arctan."""

    def push(data, _):
        load = abs(data.qfrc_actuator[d])
        data.qfrc_applied[d] -= share * load * 2 / np.pi * np.arctan(data.qvel[d] / 0.02)

    return push


def sticky(d: int, extra: float, speed: float) -> Push:
    """Larger friction near standstill, by a Lorentzian of speed."""

    def push(data, _):
        v = data.qvel[d]
        data.qfrc_applied[d] -= extra / (1 + (v / speed) ** 2) * v / np.hypot(v, 0.01)

    return push


def quadratic(d: int, c: float) -> Push:
    """Drag by speed to the power of 1.9."""

    def push(data, _):
        v = data.qvel[d]
        data.qfrc_applied[d] -= c * np.sign(v) * abs(v) ** 1.9

    return push


def cogging(d: int, size: float, per_turn: int) -> Push:
    """A torque by the angle, several times a turn: nothing of the catalogue."""

    def push(data, _):
        data.qfrc_applied[d] += size * np.sin(per_turn * data.qpos[d] + 0.7)

    return push


def hum(d: int, size: float, period_s: float) -> Push:
    """A torque by the time: nothing of the catalogue."""

    def push(data, t):
        data.qfrc_applied[d] += size * np.sin(2 * np.pi * t / period_s) * (1 + 0.3 * np.sin(t / 3))

    return push


def sagging(d: int, loss: float) -> Push:
    """A supply that falls faster at first, as a battery does."""

    def push(data, t):
        x = t / DURATION_S
        data.qfrc_applied[d] -= loss * (0.8 * x + 0.2 * np.sqrt(x)) * data.qfrc_actuator[d]

    return push


def constant(d: int, size: float) -> Push:
    """A pull of a cable."""

    def push(data, _):
        data.qfrc_applied[d] += size

    return push


def coupled(d: int, size: float) -> Push:
    """A cable over the first joint that pulls at another by the first one's speed."""

    def push(data, _):
        data.qfrc_applied[d] += size * np.tanh(3 * data.qvel[0])

    return push


def knocks(d: int, size: float) -> Push:
    """Three pushes of 0.2 s: nothing that lasts."""

    def push(data, t):
        if any(0 <= t - begin < 0.2 for begin in (7.3, 18.9, 31.1)):
            data.qfrc_applied[d] += size

    return push


def dead_band(d: int, width: float, stiffness: float) -> Push:
    """A servo that lets small errors of its position be."""

    def push(data, _):
        error = data.ctrl[d] - data.qpos[d]
        data.qfrc_applied[d] -= stiffness * width * np.tanh(error / width)

    return push


def hardening(d: int, stiffness: float) -> Push:
    """A hose that pulls back with more than proportion to the angle."""

    def push(data, _):
        q = data.qpos[d]
        data.qfrc_applied[d] -= stiffness * q * (1 + 0.5 * q * q)

    return push


def warming(d: int, c: float) -> Push:
    """Grease that thins as it warms up."""

    def push(data, t):
        data.qfrc_applied[d] -= c * np.exp(-t / 12) * data.qvel[d]

    return push


def cable(d: int, size: float) -> Push:
    """A cable that rubs at one joint as far as the first one is bent."""

    def push(data, _):
        bent = 1 + np.sin(2.5 * data.qpos[0])
        data.qfrc_applied[d] -= size * bent * np.tanh(data.qvel[d] / 0.05)

    return push


def bristles(d: int, size: float) -> Push:
    """A hose that gives way before it slides: Dahl's hysteresis, 0.15 rad wide."""
    z = [0.0]

    def push(data, t):
        v = data.qvel[d] if t else 0.0
        z[0] = (z[0] if t else 0.0) + STEP_S * (v - abs(v) * z[0] / 0.15)
        data.qfrc_applied[d] -= size * z[0] / 0.15

    return push


def both(*parts: Push) -> Push:
    """Several at once."""

    def push(data, t):
        for part in parts:
            part(data, t)

    return push


def limited(name: str, limit: float):
    """A limit of an actuator's force."""

    def change(text: str) -> str:
        return text.replace(f'name="{name}"', f'name="{name}" forcerange="-{limit} {limit}"')

    return change


def delayed(name: str):
    """A command that acts 16 ms later."""
    late = f'name="{name}" delay="0.016" nsample="80"'
    return lambda text: text.replace(f'name="{name}"', late)


def chain(*parts):
    """Several changes of the XML."""

    def change(text: str) -> str:
        for part in parts:
            text = part(text)
        return text

    return change


def heavier(text: str) -> str:
    """A last link of other mass."""
    at = text.rindex("<body name")
    return text[:at] + re.sub(
        r'mass="([\d.]+)"', lambda m: f'mass="{1.35 * float(m[1]):g}"', text[at:], count=1
    )


def any_of(*names: str) -> frozenset[str]:
    """Names of one physical cause."""
    return frozenset(names)


def cases(robot: str) -> dict[str, Case]:
    """All cases of a robot by name; forces and speeds are sized by those of its joints."""
    own = ROBOTS[robot]
    (d1, d2), (f1, f2), (s1, s2) = own.at, own.forces, own.speeds
    j1, j2 = (own.names("joint")[d] for d in own.at)
    a1, a2 = (own.names("actuator")[d] for d in own.at)
    weaker = {
        "arm": attribute("motor", "m2", "gear", 0.8),
        "leg": chain(
            attribute("position", "p2", "kp", 0.75), attribute("position", "p2", "kv", 0.75)
        ),
        "ur": chain(
            attribute("position", "p3", "kp", 0.75), attribute("position", "p3", "kv", 0.75)
        ),
        "desk": attribute("position", "p3", "kp", 0.75),
    }[robot]
    vbd = any_of(f"viscous_friction_by_direction@{j1}")
    more = any_of(f"viscous_friction@{j1}", f"servo_damping@{a1}")
    parts = any_of(f"servo_damping@{a2}", f"servo_stiffness@{a2}")  # a servo's gains are these
    offset = any_of(f"force_offset@{j2}", f"coulomb_friction_by_direction@{j2}")
    coulomb = any_of(f"coulomb_friction@{j2}")
    more_coulomb = attribute("joint", j2, "frictionloss", plus=0.25 * f2)
    forward = one_way(d1, 0.4 * f1 / s1)
    shift = np.zeros(len(own.names("joint")))
    shift[d2] = 0.06
    found = {
        "nothing": Case(),
        "coulomb": Case((coulomb,), more_coulomb),
        "viscous": Case((more,), attribute("joint", j1, "damping", plus=0.25 * f1 / s1)),
        "armature": Case((any_of(f"armature@{j2}"),),
                         attribute("joint", j2, "armature", plus=0.05 if robot == "ur" else 0.02)),
        "gain": Case((any_of(f"actuator_gain@{a2}"),), weaker, also=parts),
        "delay": Case((any_of(f"command_delay@{a1}"),), change=delayed(a1)),
        "offset": Case((offset,), push=constant(d2, 0.2 * f2)),
        "one way": Case((vbd,), push=forward, also=more),
        "load": Case((any_of(f"load_friction@{j1}"),), push=of_load(d1, 0.12)),
        "sticky": Case((any_of(f"stribeck_friction@{j2}"),), push=sticky(d2, 0.3 * f2, 0.2 * s2)),
        "drag": Case((any_of(f"drag@{j2}"),), push=quadratic(d2, 0.3 * f2 / s2**1.9)),
        "sag": Case((any_of(f"supply_drift@{a1}"),), push=sagging(d1, 0.25)),
        "limit": Case((any_of(f"force_limit@{a1}"),), limited(a1, 4.0)),
        "mass": Case((any_of(f"link_mass@{own.last_body}"),), heavier),
        "encoder": Case((any_of(f"encoder_offset@{j2}"),), shift=shift),
        "coulomb and delay": Case((coulomb, any_of(f"command_delay@{a1}")),
                                  chain(more_coulomb, delayed(a1))),
        "one way and gain": Case((vbd, any_of(f"actuator_gain@{a2}")), weaker, forward,
                                 also=more | parts),
        "spring": Case((any_of(f"joint_stiffness@{j1}"),), push=hardening(d1, 0.3 * f1)),
        "coupled": Case(push=coupled(d2, 0.25 * f2), outside="other joints"),
        "knocks": Case(push=knocks(d2, f2), outside="moments"),
        "cogging": Case(push=cogging(d1, 0.25 * f1, 9), outside="position"),
        "hum": Case(push=hum(d2, 0.25 * f2, 2.7), outside="time"),
        "warming": Case(push=warming(d1, 0.5 * f1 / s1), outside="time"),
        "cable": Case(push=cable(d2, 0.3 * f2), outside="other joints"),
        "bristles": Case(push=bristles(d2, 0.3 * f2), outside="past"),
    }  # fmt: skip
    if robot != "arm":
        del found["limit"]
        found["dead band"] = Case(
            push=dead_band(d1, 0.5 * f1 / own.stiffness, own.stiffness), outside="command"
        )
    return found


def commands(robot: str, random: np.random.Generator, t_s: np.ndarray) -> np.ndarray:
    """Sums of sines for the arm about what holds its weight, ways between poses for servos."""
    own = ROBOTS[robot]
    out = np.zeros((len(t_s), len(own.span)))
    for a, (reach, middle) in enumerate(zip(own.span, own.middle, strict=True)):
        if robot == "arm":
            for f in (0.23, 0.61, 1.3):
                out[:, a] += reach / 3 * np.sin(2 * np.pi * (f * random.uniform(0.9, 1.1) * t_s
                                                             + random.uniform()))  # fmt: skip
            continue
        at = middle + reach * random.uniform(-1, 1, int(t_s[-1] / own.knots_s) + 3)
        k, x = np.divmod(t_s / own.knots_s, 1.0)
        x = x if own.jerky else x**3 * (10 - 15 * x + 6 * x**2)
        out[:, a] = at[k.astype(int)] + x * np.diff(at)[k.astype(int)]
    return out


def record(robot: str, case: Case, seed: int) -> JointLog:
    """Runs the robot with what is planted; the arm under a controller, as such are run."""
    own = ROBOTS[robot]
    random = np.random.default_rng([seed, sum(map(ord, robot))])
    model = mujoco.MjModel.from_xml_string(case.change(own.xml))
    plain = mujoco.MjModel.from_xml_string(own.xml)
    model.opt.timestep = STEP_S
    data, held = mujoco.MjData(model), mujoco.MjData(plain)
    every = round(own.period_s / model.opt.timestep)
    t_s = np.arange(0, DURATION_S, own.period_s)
    wanted = commands(robot, random, t_s)
    shift = case.shift if len(case.shift) else np.zeros(model.nq)
    data.qpos[:] = wanted[0]
    measured, ctrl = np.zeros_like(wanted), np.zeros_like(wanted)
    for k, t in enumerate(t_s):
        measured[k] = data.qpos + shift + own.encoder_rad * random.standard_normal(model.nq)
        if own.bits:
            step = 2 * np.pi / 2**own.bits
            measured[k] = step * np.round(measured[k] / step)
        if robot == "arm":
            held.qpos[:] = data.qpos
            mujoco.mj_forward(plain, held)
            error = wanted[k] - data.qpos
            speed = (wanted[min(k + 1, len(t_s) - 1)] - wanted[k]) / own.period_s - data.qvel
            ctrl[k] = held.qfrc_bias + (30, 15) * error + (3, 1.5) * speed
        else:
            ctrl[k] = wanted[k]
        data.ctrl[:] = ctrl[k] - (0 if robot == "arm" else shift)  # servos hold what is measured
        for n in range(every):
            data.qfrc_applied[:] = 0
            if case.push is not None:
                mujoco.mj_forward(model, data)
                case.push(data, t + n * STEP_S)
            mujoco.mj_step(model, data)
    return JointLog(t_s, ctrl, measured, name=robot)


def judged(case: Case, found) -> dict[str, bool]:
    """Marks each part of an answer as right or wrong."""
    names = [f.effect for f in found.findings]
    groups = [{f.effect, *f.group} for f in found.findings]
    sure = [f.effect for f in found.findings if f.certainty == "sure"]
    right = case.also.union(*case.names)
    first = bool(groups) and any(groups[0] & own for own in case.names)
    whole = all(any(g & own for g in groups) for own in case.names) and bool(case.names)
    return {
        "first": first,
        "all": whole,
        "sure": bool(sure) and all(n in right for n in sure),
        "wrong": any(n not in right for n in sure),
        "outside": found.verdict == "outside_catalogue" or bool(found.depends_on),
        "word": bool(found.depends_on) and next(iter(found.depends_on)).startswith(case.outside),
        "alarm": bool(names) or found.verdict == "outside_catalogue",
    }


def main() -> None:
    """Prints each case, then the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    rows = []
    for robot in given.robots.split(","):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{robot}.xml"
            path.write_text(ROBOTS[robot].xml)
            for seed in range(given.first, given.first + given.seeds):
                for name, case in cases(robot).items():
                    if given.only and name not in given.only.split(","):
                        continue
                    with threadpool_limits(1, "blas"):
                        answer = diagnose_joints(record(robot, case, seed), path).answer
                    own = judged(case, answer)
                    rows.append((case, own))
                    told = ", ".join(f"{f.effect} {f.probability:.2f} {f.certainty}"
                                     + (f" {f.group}" if f.certainty == "group" else "")
                                     for f in answer.findings)  # fmt: skip
                    print(f"{robot} {seed} {name:18} {answer.verdict:18} {told} | nothing "
                          f"{answer.nothing:.2f} outside {answer.outside:.2f} "
                          f"{list(answer.depends_on)} "
                          f"{'+' if own['first'] else '-' if case.names else ' '}"
                          f"{' SURELY WRONG' if own['wrong'] else ''}", flush=True)  # fmt: skip
    single = [own for case, own in rows if len(case.names) == 1]
    two = [own for case, own in rows if len(case.names) == 2]
    outside = [own for case, own in rows if case.outside]
    none = [own for case, own in rows if not case.names and not case.outside]
    for title, part, key in (
        ("one cause: right first or in its group", single, "first"),
        ("one cause: sure, and right", single, "sure"),
        ("two causes: both", two, "all"),
        ("outside: told", outside, "outside"),
        ("outside: what it depends on is first", outside, "word"),
        ("nothing: alarms", none, "alarm"),
        ("surely wrong, all cases", [own for _, own in rows], "wrong"),
    ):
        print(f"{title}: {sum(own[key] for own in part)} of {len(part)}")


if __name__ == "__main__":
    main()
