#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# dm_control 1.0.50 on MuJoCo 3.17.0: a robot that is attached sets the step of the whole arena.
#
# Guess: as with MuJoCo's own MjSpec.attach, a robot's <option> stays behind: an arena that was given
#   2 ms keeps that and its Euler; or a robot of another step is refused.
# Seen: the arena has the robot's integrator, and of all steps the smallest, that of a robot that
#   joins later as well; nothing is said. MjSpec keeps the scene's, and warns.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet dm_control==1.0.50 mujoco==3.17.0
MUJOCO_GL=disabled "$work/venv/bin/python" - <<'PY'
import mujoco
from dm_control import mjcf

ROBOT = """<mujoco model="{0}"><option timestep="{1}" integrator="implicitfast"/><worldbody>
<body><joint name="x" type="slide"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>"""

arena = mjcf.RootElement(model="arena")
arena.option.timestep = 0.002
steps_s = []
for k, step_s in enumerate((0.001, 0.0005, 0.004)):
    arena.attach(mjcf.from_xml_string(ROBOT.format(f"R{k}", step_s)))
    option = mjcf.Physics.from_mjcf_model(arena).model.opt
    steps_s.append(option.timestep)

scene = mujoco.MjSpec()
scene.attach(mujoco.MjSpec.from_string(ROBOT.format("R0", 0.001)), frame=scene.worldbody.add_frame())
alone = scene.compile().opt
print("steps of the arena:", steps_s, "of the scene:", alone.timestep)
assert steps_s == [0.001, 0.0005, 0.0005]
assert option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
assert (alone.timestep, alone.integrator) == (0.002, mujoco.mjtIntegrator.mjINT_EULER)
PY
