#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MuJoCo 4.0.1, mujoco.sysid: of a perfect log with commands at 10 Hz it fits a lag of 0.156 s for 0.1.
#
# Guess: a log without noise, made by MuJoCo itself, gives back the lag that made it, 0.100 s.
# Seen: 0.156 s. Commands are held from one to the next by the robot, and so in the log; the fit
#   draws straight lines between them, which is half a period early, and makes that up with lag. With
#   the commands repeated at each step of the simulation it is 0.098 s.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet 'mujoco-core[sysid]==4.0.1' numpy==2.4.6 scipy==1.17.1
"$work/venv/bin/python" - <<'PY'
import mujoco
import numpy as np
from mujoco import sysid

ROBOT = """<mujoco><option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body><joint name="x" type="slide" damping="100"/><geom size="0.1" mass="1"/></body>
</worldbody><actuator><general name="motor" joint="x" dyntype="filterexact" dynprm="0.1"
gainprm="100"/></actuator><sensor><jointvel joint="x"/></sensor></mujoco>"""
PERIOD_S, RUN_S = 0.1, 10

model = mujoco.MjModel.from_xml_string(ROBOT)
data = mujoco.MjData(model)
times_s = np.arange(round(RUN_S / model.opt.timestep)) * model.opt.timestep
said = np.random.default_rng(1).choice([-1.0, 0.0, 1.0], (round(RUN_S / PERIOD_S) + 1, 1))
held = said[np.floor(times_s / PERIOD_S + 1e-9).astype(int)]
speeds = np.zeros_like(held)
for k, command in enumerate(held):
    speeds[k], data.ctrl[:] = data.qvel, command
    mujoco.mj_step(model, data)
measured = sysid.TimeSeries.from_names(times_s, speeds, model)


def fitted_lag_s(control):
    def apply(spec, parameter):
        spec.actuator("motor").dynprm[0] = parameter.value[0]

    begin, spec = mujoco.MjData(model), mujoco.MjSpec.from_string(ROBOT)
    numbers = sysid.ParameterDict()
    numbers.add(sysid.Parameter("lag", 0.15, 0.005, 1.0, modifier=apply))
    state = sysid.create_initial_state(model, begin.qpos, begin.qvel, begin.act)
    run = sysid.ModelSequences("robot", spec, "run", state, control, measured)
    residual = sysid.build_residual_fn(models_sequences=[run])
    found, _ = sysid.optimize(numbers, residual, optimizer="mujoco", verbose=False)
    return found["lag"].value[0]


as_logged = fitted_lag_s(sysid.TimeSeries(np.arange(len(said)) * PERIOD_S, said))
each_step = fitted_lag_s(sysid.TimeSeries(times_s, held))
print(f"lag 0.100 s: commands as logged {as_logged:.4f} s, at each step {each_step:.4f} s")
assert abs(as_logged - 0.156) < 0.002 and 0.095 < each_step < 0.0995
PY
