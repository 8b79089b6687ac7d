#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# PyBullet 3.2.7: each empty frame of a URDF, as base_footprint, weighs 1 kg.
#
# Guess: a link without an inertial has no mass, as in ROS; the robot weighs what its links say.
# Seen: a robot of 1.2 kg with base_footprint and camera_link weighs 3.2 kg. A warning says so, once
#   for each, without a newline between them.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet pybullet==3.2.7 numpy==2.4.6
cat >"$work/robot.urdf" <<'XML'
<robot name="robot"><link name="base_footprint"/><link name="camera_link"/>
<link name="base_link"><inertial><mass value="1.2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="a" type="fixed"><parent link="base_footprint"/><child link="base_link"/></joint>
<joint name="b" type="fixed"><parent link="base_link"/><child link="camera_link"/></joint></robot>
XML
"$work/venv/bin/python" - "$work/robot.urdf" <<'PY'
import sys

import pybullet

pybullet.connect(pybullet.DIRECT)
robot = pybullet.loadURDF(sys.argv[1])
links = range(-1, pybullet.getNumJoints(robot))
masses_kg = [pybullet.getDynamicsInfo(robot, link)[0] for link in links]
print("\nmasses:", masses_kg)
assert sorted(masses_kg) == [1, 1, 1.2]
PY
