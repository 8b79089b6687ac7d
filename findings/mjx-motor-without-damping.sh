#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MJX 3.17.0 (JAX 0.10.2): a motor's own damping and inertia, and drag that grows with speed, are left out.
#
# Guess: what is new in the model (a motor's armature and damping, a joint's damping of several numbers) acts as
#   in MuJoCo in C, or put_model refuses it, as it refuses the solver PGS.
# Seen: a cart whose motor brakes itself to 1.0 m/s goes at 24 m/s after two seconds, as if nothing braked it;
#   so does one whose motor's inertia leaves it 4.8 m/s, and one whose quadratic drag leaves it 4.9. Nothing is
#   said. One number of damping on the joint is kept: a motor's, times its gear squared, does the same there.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco-mjx==3.17.0 mujoco==3.17.0 jax==0.10.2
JAX_PLATFORMS=cpu "$work/venv/bin/python" -W error::UserWarning - <<'PY'
import jax
import mujoco
import numpy as np
from mujoco import mjx

CART = """<mujoco><option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/><worldbody>
<body><joint name="x" type="slide" {}/><geom size="0.1" mass="1"/></body></worldbody>
<actuator><motor joint="x" gear="2" {}/></actuator></mujoco>"""
CARTS = {
    "motor's damping": ("", 'damping="3"', 1.0, 24.0),
    "the same on the joint": ('damping="12"', "", 1.0, 1.0),
    "motor's inertia": ("", 'armature="1"', 4.8, 24.0),
    "quadratic drag": ('damping="0 0.5"', "", 4.9, 24.0),
}
steps = jax.jit(lambda m, data: jax.lax.fori_loop(0, 1000, lambda _, d: mjx.step(m, d), data))
for name, (joint, motor, in_c, in_mjx) in CARTS.items():
    model = mujoco.MjModel.from_xml_string(CART.format(joint, motor))
    data = mujoco.MjData(model)
    data.ctrl[0] = 6
    after = steps(mjx.put_model(model), mjx.put_data(model, data))
    for _ in range(1000):
        mujoco.mj_step(model, data)
    speeds = float(data.qvel[0]), float(after.qvel[0])
    print("{}: {:.2f} m/s in C, {:.2f} in MJX".format(name, *speeds))
    assert np.allclose(speeds, [in_c, in_mjx], rtol=0.01)
model.opt.solver = mujoco.mjtSolver.mjSOL_PGS
try:
    mjx.put_model(model)
    raise SystemExit("it takes the solver PGS now")
except NotImplementedError as error:
    print("refused:", error)
PY
