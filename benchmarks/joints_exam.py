#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How often `tm.diagnose_joints` is right on robots that MuJoCo simulates: planted causes.

The robots are a two-joint arm told torques, and a leg of two servos. What is planted shares no code
with the catalogue: numbers of the XML are changed, and forces that MJCF lacks are set in a loop of
`mj_step` by other formulas than those of the catalogue (a friction of arctan, a spring that
hardens, a supply that falls by a root, ...). Positions carry white noise of an encoder. A row of
results is printed for each case, and a table in the end.

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
ROBOTS = {"arm": ARM, "leg": LEG}
PERIOD_S, DURATION_S = 0.004, 40.0
STEP_S = 0.00025  # of the simulated robot: its time is continuous, whatever the model's step is
ENCODER_RAD = 2e-4
Push = Callable[[mujoco.MjData, float], None]


@dataclass(frozen=True)
class Case:
    """What is planted.

    Attributes:
        names: answers that are right, one set for each cause.
        change: of the XML.
        push: sets forces or commands before each step.
        outside: it is nothing that the catalogue has.
        also: what is right beside these, as more friction one way is more on average, too.
    """

    names: tuple[frozenset[str], ...] = ()
    change: Callable[[str], str] = str
    push: Push | None = None
    outside: bool = False
    also: frozenset[str] = frozenset()
    shift: np.ndarray = field(default_factory=lambda: np.zeros(2))


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


def coupled(size: float) -> Push:
    """A cable over the first joint that pulls at the second by the first one's speed."""

    def push(data, _):
        data.qfrc_applied[1] += size * np.tanh(data.qvel[0])

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
    return text.replace('mass="0.7"', 'mass="0.9"').replace('mass="0.3"', 'mass="0.42"')


def any_of(*names: str) -> frozenset[str]:
    """Names of one physical cause."""
    return frozenset(names)


def cases(robot: str) -> dict[str, Case]:
    """All cases of a robot by name."""
    if robot == "arm":
        j1, j2, a1, a2 = "shoulder", "elbow", "m1", "m2"
    else:
        j1, j2, a1, a2 = "hip", "knee", "p1", "p2"
    weaker = {
        "arm": attribute("motor", "m2", "gear", 0.8),
        "leg": chain(
            attribute("position", "p2", "kp", 0.75), attribute("position", "p2", "kv", 0.75)
        ),
    }[robot]
    vbd = any_of(f"viscous_friction_by_direction@{j1}")
    more = any_of(f"viscous_friction@{j1}", f"servo_damping@{a1}")
    offset = any_of(f"force_offset@{j2}", f"coulomb_friction_by_direction@{j2}")
    found = {
        "nothing": Case(),
        "coulomb": Case((any_of(f"coulomb_friction@{j2}"),),
                        attribute("joint", j2, "frictionloss", plus=0.15)),
        "viscous": Case((any_of(f"viscous_friction@{j1}", f"servo_damping@{a1}"),),
                        attribute("joint", j1, "damping", 2.0)),
        "armature": Case((any_of(f"armature@{j2}"),),
                         attribute("joint", j2, "armature", plus=0.02)),
        "gain": Case((any_of(f"actuator_gain@{a2}"),), weaker),
        "delay": Case((any_of(f"command_delay@{a1}"),), change=delayed(a1)),
        "offset": Case((offset,), push=constant(1, 0.25)),
        "one way": Case((vbd,), push=one_way(0, 0.5), also=more),
        "load": Case((any_of(f"load_friction@{j1}"),), push=of_load(0, 0.12)),
        "sticky": Case((any_of(f"stribeck_friction@{j2}"),), push=sticky(1, 0.3, 0.15)),
        "drag": Case((any_of(f"drag@{j2}"),), push=quadratic(1, 0.08)),
        "sag": Case((any_of(f"supply_drift@{a1}"),), push=sagging(0, 0.25)),
        "limit": Case((any_of(f"force_limit@{a1}"),), limited(a1, 4.0 if robot == "arm" else 3.0)),
        "mass": Case((any_of(f"link_mass@{'fore' if robot == 'arm' else 'shank'}"),),
                     heavier),
        "encoder": Case((any_of(f"encoder_offset@{j2}"),), shift=np.array([0.0, 0.06])),
        "coulomb and delay": Case(
            (any_of(f"coulomb_friction@{j2}"), any_of(f"command_delay@{a1}")),
            chain(attribute("joint", j2, "frictionloss", plus=0.15),
                  delayed(a1)),
        ),
        "one way and gain": Case(
            (vbd, any_of(f"actuator_gain@{a2}")), weaker, one_way(0, 0.5), also=more
        ),
        "spring": Case((any_of(f"joint_stiffness@{j1}"),), push=hardening(0, 0.6)),
        "coupled": Case(push=coupled(0.3), outside=True),
        "knocks": Case(push=knocks(1, 0.8), outside=True),
        "cogging": Case(push=cogging(0, 0.35, 9), outside=True),
        "hum": Case(push=hum(1, 0.3, 2.7), outside=True),
    }  # fmt: skip
    if robot == "leg":
        del found["limit"]
        found["dead band"] = Case(push=dead_band(0, 0.015, 40), outside=True)
    return found


def commands(robot: str, random: np.random.Generator, t_s: np.ndarray, model) -> np.ndarray:
    """Sums of sines for the arm about what holds its weight, steps and ramps for the leg."""
    out = np.zeros((len(t_s), 2))
    if robot == "leg":
        for a, reach in enumerate((0.7, 0.9)):
            knots = np.arange(0, t_s[-1] + 2, 0.6)
            at = reach * random.uniform(-1, 1, len(knots)) - (0.6 if a else 0.0)
            out[:, a] = np.interp(t_s, knots, at)
    else:
        for a, reach in enumerate((0.8, 1.0)):
            for f in (0.23, 0.61, 1.3):
                out[:, a] += reach / 3 * np.sin(2 * np.pi * (f * random.uniform(0.9, 1.1) * t_s
                                                             + random.uniform()))  # fmt: skip
    return out


def record(robot: str, case: Case, seed: int) -> JointLog:
    """Runs the robot with what is planted; the arm under a controller, as such are run."""
    random = np.random.default_rng([seed, sum(map(ord, robot))])
    model = mujoco.MjModel.from_xml_string(case.change(ROBOTS[robot]))
    plain = mujoco.MjModel.from_xml_string(ROBOTS[robot])
    model.opt.timestep = STEP_S
    data, held = mujoco.MjData(model), mujoco.MjData(plain)
    every = round(PERIOD_S / model.opt.timestep)
    t_s = np.arange(0, DURATION_S, PERIOD_S)
    wanted = commands(robot, random, t_s, model)
    data.qpos[:] = wanted[0]
    measured = np.zeros((len(t_s), 2))
    ctrl = np.zeros((len(t_s), 2))
    for k, t in enumerate(t_s):
        measured[k] = data.qpos + case.shift + ENCODER_RAD * random.standard_normal(2)
        if robot == "arm":
            held.qpos[:] = data.qpos
            mujoco.mj_forward(plain, held)
            error = wanted[k] - data.qpos
            speed = (wanted[min(k + 1, len(t_s) - 1)] - wanted[k]) / PERIOD_S - data.qvel
            ctrl[k] = held.qfrc_bias + (30, 15) * error + (3, 1.5) * speed
        else:
            ctrl[k] = wanted[k]
        data.ctrl[:] = ctrl[k] - (
            case.shift if robot == "leg" else 0
        )  # servos hold what is measured
        for _ in range(every):
            data.qfrc_applied[:] = 0
            if case.push is not None:
                mujoco.mj_forward(model, data)
                case.push(data, t)
            mujoco.mj_step(model, data)
    return JointLog(t_s, ctrl, measured, name=robot)


def judged(case: Case, found) -> dict[str, bool]:
    """What of an answer is right."""
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
        "alarm": bool(names) or found.verdict == "outside_catalogue",
    }


def main() -> None:
    """Prints each case, then the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--robots", default="arm,leg")
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    rows = []
    for robot in given.robots.split(","):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{robot}.xml"
            path.write_text(ROBOTS[robot])
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
        ("nothing: alarms", none, "alarm"),
        ("surely wrong, all cases", [own for _, own in rows], "wrong"),
    ):
        print(f"{title}: {sum(own[key] for own in part)} of {len(part)}")


if __name__ == "__main__":
    main()
