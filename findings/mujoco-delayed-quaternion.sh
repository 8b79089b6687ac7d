#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MuJoCo 4.0.1: a delayed orientation sensor is no rotation at all until its delay is over.
#
# Guess: before the delay is over, a framequat sensor gives the orientation at the start, or 1 0 0 0.
# Seen: 0 0 0 0, as every delayed sensor gives zeros, a position, too; a program that normalises it
#   has NaN. With interp="linear" the first quaternion afterwards has a norm of 0.5, half of zero and
#   half of the first. With an interval instead of a delay it is right from the first step.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco-core==4.0.1
"$work/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep="0.01"/>
<worldbody><body quat="0.6 0 0 0.8"><freejoint/><geom size="0.1"/><site name="s"/></body></worldbody>
<sensor>
<framequat objtype="site" objname="s" delay="0.05" nsample="6"/>
<framequat objtype="site" objname="s" delay="0.055" nsample="8" interp="linear"/>
<framequat objtype="site" objname="s" interval="0.03" nsample="3"/>
</sensor></mujoco>""")
data = mujoco.MjData(model)
norms = []
for _ in range(8):
    mujoco.mj_step(model, data)
    norms.append(np.linalg.norm(data.sensordata.reshape(3, 4), axis=1))
norms = np.round(np.array(norms).T, 3)
print("norms: delayed, delayed and interpolated, at intervals\n", norms)
assert norms[0].tolist() == [0, 0, 0, 0, 0, 1, 1, 1]
assert norms[1].tolist() == [0, 0, 0, 0, 0, 0.5, 1, 1]
assert norms[2].tolist() == [1] * 8
PY
