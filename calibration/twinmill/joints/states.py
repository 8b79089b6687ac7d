# SPDX-License-Identifier: Apache-2.0
"""States of joints in a log: the motion of the model itself, and what was measured beside it.

A servo's force follows from where its joint is. Computed from measured positions it holds their
noise, which is in the errors that it is to explain: a regression on it is biased (errors in
variables). A stiff servo answers within a millisecond, too, which no smooth path through positions
shows. So effects and dependences are looked at in states whose noise is that of many steps:
the model is run by the log's commands, as instruments are for industrial robots, and is led back to
the measured positions by what differs smoothly (Janot, Vandanjon and Gautier 2014, IEEE Trans.
Control Syst. Technol. 22: a generic instrumental variable approach). The base's error is that of
the run, which has all of its own forces, and of what the difference between both adds to these.
Where effects are found they are part of the model that is run, as instruments are made again from
the model that they gave: of a robot that is far from its model the first run is far, too.
"""

from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from scipy.fft import dct, idct
from scipy.interpolate import CubicHermiteSpline, CubicSpline, make_interp_spline
from scipy.special import softmax

from twinmill.joints.action import Action
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.series import FEWEST, Series, lagged, series_of, smoothed

FOLLOW_S = 0.3  # in which a spring leads the run back: slower than any servo
OVER = np.geomspace(0.1, 1e10, 23)  # variance over the noise's at low frequencies
CORNERS = 16  # frequencies that compete
RUN_S = 2.5e-4  # step of the run: the robot's time is continuous


@dataclass(frozen=True)
class Run:
    """The model in a log, run by its commands and led back by a spring.

    Attributes:
        action: the model, in the run's states, with the forces of the spring.
        changes: (W, J) change of velocity over steps, found from positions as the measured one is.
        far: (J,) root mean square of how far it is from the measured positions.
    """

    action: Action
    changes: np.ndarray
    far: np.ndarray


def with_run(action: Action, mjcf: Mjcf) -> tuple[Series, Run]:
    """Series with states by a run of a model, see this module, and that run.

    Args:
        action: the model in the states of the series as they are.
        mjcf: whose joints and actuators it has.
    """
    series, log = action.series, action.series.log
    zero = (action.q - series.q).mean(axis=0)  # a model's encoders may have another
    q, v, pull = np.empty_like(series.q), np.empty_like(series.v), np.empty_like(series.q)
    near, far, at_stamps = np.empty((2, *q.shape)), np.empty((2, *q.shape)), log.qpos.copy()
    for part in log.stretches:
        stamps = log.t_s[part]
        own = (series.t_s > stamps[0]) & (series.t_s < stamps[-1])
        if own.any():
            path, pulls = _run(action, mjcf, part, own)
            t_s, at_stamps[part] = series.t_s[own], path(stamps) - zero
            q[own], v[own], pull[own] = path(t_s), path(t_s, 1), pulls(t_s)
            beside = log.qpos[part] - at_stamps[part]
            near[:, own] = smoothed(stamps, beside, t_s, float(series.step_s[0]))
            far[:, own] = without_noise(stamps, beside, t_s)
    states = {
        "q": q - zero + far[0],
        "v": v + far[1],
        "seen_q": q - zero + near[0],
        "seen_v": v + near[1],
    }
    changes = series_of(replace(log, qpos=at_stamps)).changes
    away = np.sqrt(((log.qpos - at_stamps) ** 2).mean(axis=0))
    run = Run(replace(action, q=q, v=v, force=action.force + pull), changes, away)
    return replace(series, **states), run


def without_noise(
    stamps: np.ndarray, values: np.ndarray, t_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n, J) what is no white noise in (N, J) values, and its slope, by Wiener's filter.

    The spectrum of the rest is taken to be a second-order lag's, as a joint answers a force; its
    size over the noise and its corner are averaged over, each pair by its likelihood (Rasmussen and
    Williams 2006, ch. 4.2.1 and 5.4.1).
    """
    even_s = np.linspace(stamps[0], stamps[-1], len(stamps))
    found = np.empty((2, len(t_s), values.shape[1]))
    waves = np.pi * np.arange(len(even_s)) / np.ptp(even_s)
    corners = np.geomspace(2 * np.pi / np.ptp(even_s), waves[-1] / FEWEST, CORNERS)
    shape = 1 / (1 + (waves[1:] / corners[:, None]) ** 2) ** 2
    shares = np.concatenate([np.zeros((1, len(even_s) - 1)), *(size * shape for size in OVER)])
    prior = np.r_[0.5, np.full(len(shares) - 1, 0.5 / (len(shares) - 1))]
    for d, own in enumerate(values.T):
        ways = dct(np.interp(even_s, stamps, own), norm="ortho")
        white = (ways[1:] ** 2 / (1 + shares)).mean(axis=1)
        log = -0.5 * (len(ways) - 1) * np.log(white) - 0.5 * np.log1p(shares).sum(axis=1)
        weight = softmax(log + np.log(prior))
        ways[1:] *= weight @ (shares / (1 + shares))
        path = CubicSpline(even_s, idct(ways, norm="ortho"))
        found[:, :, d] = path(t_s), path(t_s, 1)
    return found[0], found[1]


def _run(action: Action, mjcf: Mjcf, part: slice, own: np.ndarray) -> tuple[Any, Any]:
    """Positions of the model over time, run by a stretch's commands, and forces of the spring."""
    series, model = action.series, _of_run(action.model)
    stamps, data = series.log.t_s[part], mujoco.MjData(model)
    t_s = np.arange(stamps[0], stamps[-1] + 2 * RUN_S, RUN_S)
    ctrl = _commands(action, mjcf, t_s + RUN_S / 2)  # the middle of a step makes none late
    lead_q, lead_v, force = (
        np.column_stack([np.interp(t_s, series.t_s[own], x) for x in states[own].T])
        for states in (action.q, action.v, action.force)
    )
    stiff, damping = model.dof_M0 / FOLLOW_S**2, 2 * model.dof_M0 / FOLLOW_S
    lead = stiff * lead_q + damping * lead_v
    data.qpos[:], data.qvel[:] = lead_q[0], lead_v[0]
    q, v, pull = np.empty_like(lead_q), np.empty_like(lead_v), np.empty_like(lead_q)
    # Views, made once: making them takes as long as a step of a small robot.
    now_q, now_v, told, pushed = data.qpos, data.qvel, data.ctrl, data.qfrc_applied
    for k in range(len(t_s)):
        q[k], v[k] = now_q, now_v
        told[:] = ctrl[k]
        pull[k] = lead[k] - stiff * now_q - damping * now_v
        np.add(pull[k], force[k], out=pushed)
        mujoco.mj_step(model, data)
    return CubicHermiteSpline(t_s, q, v), make_interp_spline(t_s, pull, k=1)


def _of_run(given: Any) -> Any:
    model = copy(given)
    model.opt.timestep = RUN_S
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _commands(action: Action, mjcf: Mjcf, t_s: np.ndarray) -> np.ndarray:
    """(n, U) commands at the steps of a run, as late, slow and shaped as the model has them."""
    out, log = np.empty((len(t_s), len(mjcf.actuators))), action.series.log
    for a, (late_s, lag_s) in enumerate(zip(action.late_s, action.lag_s, strict=True)):
        at = np.searchsorted(log.t_s, t_s - late_s, side="right") - 1
        out[:, a] = log.ctrl[np.maximum(at, 0), a]
        if lag_s > 0:
            out[:, a] = lagged(out[:, a], lag_s, RUN_S)
    for a, shape in action.shapes:
        out[:, a] = shape(out[:, a])
    return out
