#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# dm_control 1.0.50 on MuJoCo 3.17.0: a restored state obeys commands that were given after it.
#
# Guess: get_state holds what the physics needs to go on, so that after set_state a robot at rest that
#   is told nothing stays at rest.
# Seen: the state has position and speed alone. Commands on their way through an actuator's delay are
#   in mjData.history, stay there, and push the robot in the first step.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet dm_control==1.0.50 mujoco==3.17.0
MUJOCO_GL=disabled "$work/venv/bin/python" - <<'PY'
from dm_control import mujoco

physics = mujoco.Physics.from_xml_string("""<mujoco><option timestep="0.01" gravity="0 0 0"/>
<worldbody><body><joint name="x" type="slide"/><geom size="0.1" mass="1"/></body></worldbody>
<actuator><motor joint="x" delay="0.05" nsample="6"/></actuator></mujoco>""")
at_rest = physics.get_state()
physics.set_control([1])
physics.step(20)
physics.set_state(at_rest)
physics.set_control([0])
physics.step()
print("numbers of a state:", len(at_rest), "speed after one step at rest:", physics.data.qvel[0])
assert len(at_rest) == 2 and abs(physics.data.qvel[0] - 0.01) < 1e-9
PY
