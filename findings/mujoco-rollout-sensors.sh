#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MuJoCo 4.0.1: in what rollout returns, a row of sensors is one step older than the row of states.
#
# Guess: states[k] and sensors[k] belong to one moment.
# Seen: a clock sensor reads 0.00, 0.01, 0.02 s beside states at 0.01, 0.02, 0.03 s, and a jointpos
#   sensor the position of the row before. mj_step reads sensors before it moves on. A log that is
#   compared with sensors by the states' times is fitted with a lag that is one step wrong.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco-core==4.0.1
"$work/venv/bin/python" - <<'PY'
import mujoco
import numpy as np
from mujoco import rollout

model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep="0.01" gravity="0 0 0"/>
<worldbody><body><joint name="x" type="slide"/><geom size="0.1"/></body></worldbody>
<actuator><motor joint="x"/></actuator>
<sensor><jointpos joint="x"/><clock/></sensor></mujoco>""")
data, full = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
begin = np.zeros(mujoco.mj_stateSize(model, full))
mujoco.mj_getState(model, data, begin, full)
states, sensors = rollout.rollout(model, data, begin[None], np.ones((1, 5, 1)))
times_s, x_m = states[0, :, 0], states[0, :, 1]
print("states: ", times_s, x_m)
print("sensors:", sensors[0, :, 1], sensors[0, :, 0])
assert np.allclose(sensors[0, :, 1], times_s - 0.01)
assert np.allclose(sensors[0, 1:, 0], x_m[:-1]) and not np.allclose(sensors[0, :, 0], x_m)
PY
