# SPDX-License-Identifier: Apache-2.0
"""mujoco.sysid on runs of a robot: fits its three gains and the motors' lag.

A body on two slides and a hinge. Each wheel is an actuator with a first-order filter, whose force
pushes the body as its rollers would; the body's damping is so large that it follows at once. Runs
start where the whole state is known.
"""

from collections.abc import Mapping
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
from mujoco import MjSpec, sysid
from mujoco.sysid.report.sections.insights import AutomatedInsights

BODY = """
<mujoco>
  <option timestep="{step_s}" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="x" type="slide" axis="1 0 0" damping="{damping}"/>
      <joint name="y" type="slide" axis="0 1 0" damping="{damping}"/>
      <joint name="yaw" type="hinge" axis="0 0 1" damping="{damping}"/>
      <geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <site name="robot"/>
    </body>
  </worldbody>
  <actuator>{wheels}</actuator>
  <sensor>{sensors}</sensor>
</mujoco>
"""
WHEEL = '<general name="{}" site="robot" gear="1 0 0 0 0 0" dyntype="filterexact" dynprm="{}"/>'
# Forward, left and turn of front-left, front-right, rear-left and rear-right.
SIGNS = {"fl": (1, -1, -1), "fr": (1, 1, 1), "rl": (1, 1, -1), "rr": (1, -1, 1)}
DAMPING = 1e4  # per s: follows within a step
Pushes = Mapping[str, tuple[float, float, float]]


def mecanum(lever_m: float) -> Pushes:
    """Four wheels, by their rim speeds in m/s; the lever is half wheelbase and half track."""
    return {w: (x / 4, y / 4, turn / 4 / lever_m) for w, (x, y, turn) in SIGNS.items()}


def fit(
    runs: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
    start: dict[str, float],
    pushes: Pushes,
    rad_in_m: float,
) -> dict:
    """Fits and says what its report says.

    Args:
        runs: each (N,) s on an even grid, (N, A) speeds asked of the actuators, (N, 3) poses (m, m,
            rad), and (A,) speeds that the actuators have at the start.
        start: where forward, sideways, yaw (gains) and lag_s begin, and <actuator>_lag_s of those
            that have their own.
        pushes: A actuators, each with the forward and left speed (m/s) and turn (rad/s) that a unit
            of its own speed makes.
        rad_in_m: how many m an error of 1 rad weighs.

    Returns:
        values and half widths of their 95 % intervals by name, RMS error of the position in m,
        titles of the report's automated insights.
    """
    spec = MjSpec.from_string(_xml(runs[0][0], start["lag_s"], pushes))
    model = spec.compile()
    sequences = sysid.ModelSequences(
        "robot",
        spec,
        [f"run {i}" for i in range(len(runs))],
        [sysid.create_initial_state(model, pose[0], act=has) for _, _, pose, has in runs],
        [sysid.TimeSeries.from_control_names(t_s, asked, model) for t_s, asked, _, _ in runs],
        # It stamps what sensors saw at the start of a step with the step's end.
        [sysid.TimeSeries.from_names(t_s + t_s[1], pose, model) for t_s, _, pose, _ in runs],
    )
    parameters = sysid.ParameterDict(
        {
            name: sysid.Parameter(name, value, 0.2 * value, 5 * value)
            for name, value in start.items()
        }
    )
    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        build_model=lambda values, spec: _compiled(values, spec, pushes),
        sensor_weights={"x": 1.0, "y": 1.0, "yaw": rad_in_m},
    )
    with redirect_stdout(StringIO()):  # it prints every step
        found, result = sysid.optimize(parameters, residual, verbose=False, x_scale="jac")
    left, predicted, measured = residual(result.x, found)
    _, half = sysid.calculate_intervals(left, result.jac)
    off_m = [
        (m.data - p.data)[:, :2]
        for own, seen in zip(predicted, measured, strict=True)
        for p, m in zip(own, seen, strict=True)
    ]
    insights = AutomatedInsights("insights", found).get_context()["insights"]
    return {
        "values": {name: float(found[name].value[0]) for name in start},
        "half": dict(zip(start, map(float, half), strict=True)),
        "rms_m": float(np.sqrt(2 * np.mean(np.square(np.concatenate(off_m))))),
        "insights": [insight["title"] for insight in insights],
    }


def _xml(t_s: np.ndarray, lag_s: float, pushes: Pushes) -> str:
    wheels = "".join(WHEEL.format(name, lag_s) for name in pushes)
    sensors = "".join(f'<jointpos name="{axis}" joint="{axis}"/>' for axis in ("x", "y", "yaw"))
    return BODY.format(step_s=t_s[1] - t_s[0], damping=DAMPING, wheels=wheels, sensors=sensors)


def _compiled(values: sysid.ParameterDict, spec: MjSpec, pushes: Pushes):
    forward, sideways, yaw = (values[name].value[0] for name in ("forward", "sideways", "yaw"))
    gains = DAMPING * np.array([forward, sideways, yaw])
    for actuator in spec.actuators:
        x, y, turn = gains * pushes[actuator.name]
        actuator.gear = [x, y, 0, 0, 0, turn]
        own = f"{actuator.name}_lag_s"
        actuator.dynprm[0] = values[own if own in values else "lag_s"].value[0]
    return spec.compile()
