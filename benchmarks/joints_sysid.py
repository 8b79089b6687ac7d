#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""mujoco.sysid and `tm.explain_joints` on the public EMPS recording: a motor, a screw, a carriage.

Both get the training record and an MJCF with round numbers. mujoco.sysid is told which numbers to
fit (damping, friction, mass, a constant force); none is a friction that differs by direction.
Errors are of free runs of 25 s by stock MuJoCo, over the training and the test record. What
mujoco.sysid imports is in benchmarks/requirements.txt.

    PYTHONPATH=.deps/bench .venv/bin/python benchmarks/joints_sysid.py ../shared/data/emps
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from mujoco import MjSpec, sysid
from scipy.io import loadmat
from threadpoolctl import threadpool_limits

from twinmill import JointLog, compare_joints, explain_joints
from twinmill.joints.hook import hook_beside

CARRIAGE = """<mujoco model="emps">
  <option timestep="0.001"/>
  <worldbody>
    <body name="carriage">
      <joint name="x" type="slide" axis="1 0 0" damping="200" frictionloss="20"/>
      <geom type="box" size=".1 .1 .1" mass="95"/>
    </body>
  </worldbody>
  <actuator>
    {drive}
  </actuator>
  <sensor>
    <jointpos name="position" joint="x"/>
  </sensor>
</mujoco>
"""
MOTOR = '<motor name="drive" joint="x"/>'
WITH_OFFSET = '<general name="drive" joint="x" biastype="affine" biasprm="0 0 0"/>'
RECORDS = ("DATA_EMPS", "DATA_EMPS_PULSES")  # training, test
START = {  # and bounds
    "damping": (200.0, 40.0, 1000.0),
    "frictionloss": (20.0, 4.0, 100.0),
    "mass": (95.0, 19.0, 475.0),
    "offset": (0.0, -20.0, 20.0),
}


def record(folder: Path, name: str) -> JointLog:
    """One of the two records."""
    held = loadmat(folder / f"{name}.mat")
    force = float(held["gtau"].item()) * held["vir"]
    return JointLog(held["t"].ravel(), force, held["qm"], name=name)


def changed(values: sysid.ParameterDict, spec: MjSpec) -> None:
    """Sets the numbers."""
    joint, geom = spec.joint("x"), spec.body("carriage").geoms[0]
    joint.damping[0] = values["damping"].value[0]
    joint.frictionloss = values["frictionloss"].value[0]
    geom.mass = values["mass"].value[0]
    spec.actuator("drive").biasprm[0] = values["offset"].value[0]


def by_sysid(log: JointLog, out: Path, window_s: float) -> str:
    """Fits over windows that begin at rest or in the measured state; writes the MJCF."""
    spec = MjSpec.from_string(CARRIAGE.format(drive=WITH_OFFSET))
    model, speed = spec.compile(), np.gradient(log.qpos[:, 0], log.t_s)
    speed = np.convolve(speed, np.ones(21) / 21, mode="same")
    edges = np.arange(0, len(log.t_s) - 1, round(window_s / 1e-3))
    parts = [slice(a, a + round(window_s / 1e-3)) for a in edges]
    parts = [part for part in parts if len(log.t_s[part]) > 500]
    sequences = sysid.ModelSequences(
        "carriage",
        spec,
        [f"window {k}" for k in range(len(parts))],
        [sysid.create_initial_state(model, log.qpos[p.start], speed[p.start : p.start + 1])
         for p in parts],
        [sysid.TimeSeries.from_control_names(log.t_s[p] - log.t_s[p.start], log.ctrl[p], model)
         for p in parts],
        # it stamps what sensors saw at the start of a step with the step's end
        [sysid.TimeSeries.from_names(log.t_s[p] - log.t_s[p.start] + 1e-3, log.qpos[p], model)
         for p in parts],
    )  # fmt: skip
    parameters = sysid.ParameterDict(
        {name: sysid.Parameter(name, *numbers) for name, numbers in START.items()}
    )

    def built(values: sysid.ParameterDict, spec: MjSpec):
        changed(values, spec)
        return spec.compile()

    residual = sysid.build_residual_fn(models_sequences=[sequences], build_model=built)
    with redirect_stdout(StringIO()):  # it prints every step
        found, _ = sysid.optimize(parameters, residual, verbose=False, x_scale="jac")
    spec = MjSpec.from_string(CARRIAGE.format(drive=WITH_OFFSET))
    changed(found, spec)
    spec.compile()
    out.write_text(spec.to_xml())
    return ", ".join(f"{name} {found[name].value[0]:.4g}" for name in START)


def by_twinmill(log: JointLog, out: Path) -> str:
    """Writes what `explain` does."""
    given = out.with_name("emps.xml")
    given.write_text(CARRIAGE.format(drive=MOTOR))
    found = explain_joints(log, given)
    out.write_text(found.text)
    hook_beside(out).write_text(found.hook)
    named = found.diagnosis.answer.findings
    return ", ".join(f"{f.effect} {f.probability:.2f} {f.certainty}" for f in named)


def main() -> None:
    """Prints what each says, its errors in mm, and its processor time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    logs = [record(folder, name) for name in RECORDS]
    ways: dict[str, Callable[[JointLog, Path], str]] = {
        "mujoco.sysid, windows of 2 s": lambda log, out: by_sysid(log, out, 2.0),
        "mujoco.sysid, all at once": lambda log, out: by_sysid(log, out, 30.0),
        "twinmill explain": by_twinmill,
    }
    for name, way in ways.items():
        with tempfile.TemporaryDirectory() as place, threadpool_limits(1, "blas"):
            out, begin_s = Path(place) / "better.xml", time.process_time()
            told = way(logs[0], out)
            took_s = time.process_time() - begin_s
            hook = hook_beside(out) if hook_beside(out).is_file() else None
            train, test = (1e3 * compare_joints(log, out, hook).free_rms[0] for log in logs)
            print(f"{name}: {told}; {train:.1f} mm, {test:.1f} mm; {took_s:.0f} s", flush=True)


if __name__ == "__main__":
    main()
