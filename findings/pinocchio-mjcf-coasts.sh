#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Pinocchio 4.1.0: of an MJCF's armature, damping and dry friction it reads all and uses the first alone.
#
# Guess: aba gives the acceleration that MuJoCo 4.0.1 gives, for a cart on a rail without contacts, since the
#   model that was read has the numbers in armature, damping and friction; or these are all left to the caller.
# Seen: the mass with armature is right, 1.3 kg; but a cart at 1 m/s, damping 2 N s/m and dry friction 0.1 N, is
#   slowed by 0, and not by 1.6 m/s^2, and rnea asks for no force to hold its speed: a twin coasts for ever.
#   Nothing is said. The caller has to take damping * v and friction * sign(v) from the torque for aba.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6
cd "$work"
cat >cart.xml <<'XML'
<mujoco><option gravity="0 0 0"/><worldbody><body name="cart">
<joint name="x" type="slide" axis="1 0 0" armature="0.3" damping="2" frictionloss="0.1"/>
<geom size="0.1" mass="1"/></body></worldbody></mujoco>
XML
"$work/venv/bin/python" - <<'PY'
import mujoco
import numpy as np
import pinocchio as pin

still, ahead = np.zeros(1), np.ones(1)
theirs = mujoco.MjModel.from_xml_path("cart.xml")
data = mujoco.MjData(theirs)
data.qvel[:] = ahead
mujoco.mj_forward(theirs, data)
model = pin.buildModelFromMJCF("cart.xml")
held = [float(numbers[0]) for numbers in (model.armature, model.damping, model.upperDryFrictionLimit)]
work = model.createData()
slowed = float(pin.aba(model, work, still, ahead, still)[0])
force = float(pin.rnea(model, work, still, ahead, still)[0])
mass_kg = float(pin.crba(model, work, still)[0, 0])
print(f"armature, damping and friction that were read: {held}; mass {mass_kg} kg")
print(f"acceleration: MuJoCo {data.qacc[0]:.3f}, Pinocchio {slowed:.3f} m/s^2; force by rnea {force} N")
assert np.allclose(held, [0.3, 2, 0.1]) and np.isclose(mass_kg, 1.3)
assert slowed == force == 0 and np.isclose(data.qacc[0], -2.1 / 1.3, rtol=0.01)
PY
