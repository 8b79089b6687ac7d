#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MuJoCo 4.0.1: an actuator's delay of ten whole steps is ten steps for two seconds, then eleven.
#
# Guess: delay="0.02" at timestep="0.002" is ten steps, always, or eleven, always.
# Seen: ten until step 1003, eleven from 1004 to 4000, ten to 8003, eleven to 16002, and so on:
#   data.time is a sum of steps, and the sum less 0.02 falls on one or the other side of the stamp
#   that it is compared with. A delay shorter by 1e-7 s is ten steps throughout.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco-core==4.0.1
"$work/venv/bin/python" - <<'PY'
import mujoco

ROBOT = """<mujoco><option timestep="0.002" gravity="0 0 0"/>
<worldbody><body><joint name="x" type="slide"/><geom size="0.1"/></body></worldbody>
<actuator><motor joint="x" delay="{}" nsample="12"/></actuator></mujoco>"""


def changes(delay):
    """Steps at which the number of steps changes by which a command is late."""
    model = mujoco.MjModel.from_xml_string(ROBOT.format(delay))
    data, seen = mujoco.MjData(model), []
    for step in range(20000):
        data.ctrl[0] = step
        mujoco.mj_step(model, data)
        late = step - round(data.actuator_force[0])
        if step > 20 and (not seen or seen[-1][1] != late):
            seen.append((step, late))
    return seen


seen = changes("0.02")
print("delay 0.02:", seen)
assert seen == [(21, 10), (1004, 11), (4001, 10), (8004, 11), (16003, 10)], seen
steady = changes("0.0199999")
print("delay 0.0199999:", steady)
assert steady == [(21, 10)], steady
PY
