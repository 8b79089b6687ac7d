#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MuJoCo 4.0.1: a wheeled robot's URDF is opened as wheels that turn in the world; its body is gone.
#
# Guess: base_link is a body of 1 kg in the world, that falls or stands.
# Seen: no body base_link, no mass of it: what has no joint to the world is part of the world. All
#   masses are 0.1 kg, those of the wheels, and no warning is given. A free joint put on the root by
#   MjSpec before it is compiled keeps body and mass.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco-core==4.0.1
"$work/venv/bin/python" - <<'PY'
import mujoco

INERTIAL = """<inertial><mass value="{}"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>"""
WHEEL = """<link name="{0}">{1}</link><joint name="{0}_joint" type="continuous">
<parent link="base_link"/><child link="{0}"/><axis xyz="0 1 0"/></joint>"""
robot = '<robot name="r"><link name="base_link">' + INERTIAL.format(1) + "</link>"
robot += "".join(WHEEL.format(side, INERTIAL.format(0.05)) for side in ("left", "right")) + "</robot>"


def told(model):
    return [model.body(i).name for i in range(model.nbody)], round(model.body_mass.sum(), 9), model.nv


plain = told(mujoco.MjModel.from_xml_string(robot))
spec = mujoco.MjSpec.from_string(robot)
spec.body("base_link").add_freejoint()
free = told(spec.compile())
print("as it is:", plain, "\nwith a free joint:", free)
assert plain == (["world", "left", "right"], 0.1, 2)
assert free == (["world", "base_link", "left", "right"], 1.1, 8)
PY
