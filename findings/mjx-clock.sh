#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# MJX 3.17.0 (JAX 0.10.2): after an hour its clock is 2.3 % slow, after nine hours twice too fast.
#
# Guess: 1000 steps of 2 ms are 2 s on data.time, to a millisecond, at any hour.
# Seen: 2.000 s at the start, 1.953 s after one hour and after four, 3.906 s after 32768 s. The time is
#   a float of 32 bits and is rounded at each step; what moves is not: it goes as far in each. What is
#   asked by data.time, such as a path to follow or a rate of control, goes at the wrong pace.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco-mjx==3.17.0 mujoco==3.17.0 jax==0.10.2
JAX_PLATFORMS=cpu "$work/venv/bin/python" - <<'PY'
import jax
import mujoco
from mujoco import mjx

model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep="0.002" gravity="0 0 0"/>
<worldbody><body><joint type="slide"/><geom size="0.1"/></body></worldbody></mujoco>""")
there = mjx.put_model(model)
steps = jax.jit(lambda m, data: jax.lax.fori_loop(0, 1000, lambda _, d: mjx.step(m, d), data))
for begin_s, seen_s in ((0, 2.0), (3600, 1.953), (14400, 1.953), (32768, 3.906)):
    data = mujoco.MjData(model)
    data.time, data.qvel[0] = begin_s, 1
    after = steps(there, mjx.put_data(model, data))
    clock_s, way_m = float(after.time) - begin_s, float(after.qpos[0])
    print(f"from {begin_s} s: the clock goes on by {clock_s:.3f} s, 1 m/s goes {way_m:.3f} m")
    assert abs(clock_s - seen_s) < 0.001 and abs(way_m - 2) < 0.001
PY
