# SPDX-License-Identifier: Apache-2.0
"""mujoco.sysid: fits gains and lag to stretches of a log; a large rest says that more lacks."""

import mujoco
import numpy as np
import sysid_fit
import twinmill_native as native
from scipy.signal import lfilter

from rivals.protocol import DOCUMENTED, TUNED, Answer, Problem, Rival, predicted_by
from twinmill.data.measurement import Measurement
from twinmill.model.parameters import BASE_GAINS, LAG, LAG_EFFECT
from twinmill.predict.residual import rotate

STRETCH_S, STEP_S = 2.0, 0.005  # a shorter step: MuJoCo pushes where the heading was at its start
LEAST_LAG_S = 0.01  # that a filter is started from: of none there is no multiple
LARGE = 1.7  # times the RMS error that the base's own noise makes; see README
LATE_S = 0.02
ADDED = f"{LAG_EFFECT}.extra_s"
YAW_LAG, YAW_EXTRA = "yaw_lag", "yaw_lag.extra_s"
ALL_WELL = "No Issues Detected"
AXES = {"forward": (1.0, 0.0, 0.0), "left": (0.0, 1.0, 0.0), "turn": (0.0, 0.0, 1.0)}


def answers(problem: Problem) -> dict[str, Answer]:
    """By its report, and by its residual."""
    runs = stretches(problem.measurement, problem.model)
    noise = problem.noise
    lag_s, turn_lag_s = _lags_s(problem.model)
    start = {"forward": 1.0, "sideways": 1.0, "yaw": 1.0, "lag_s": lag_s}
    if YAW_LAG in problem.model.effects:
        start["turn_lag_s"] = turn_lag_s
    rad_in_m = noise["sensor_m"] / noise["sensor_rad"]
    found = sysid_fit.fit(runs, start, AXES, rad_in_m)
    model = problem.model.copy()
    for name, key in zip(BASE_GAINS, ("forward", "sideways", "yaw"), strict=True):
        model.set(name, model.get(name) * found["values"][key])
    later_s = found["values"]["lag_s"] - lag_s
    late = later_s > LATE_S
    if lag_s > LEAST_LAG_S or late:
        model.set(LAG, model.get(LAG) + later_s)
    if YAW_LAG in model.effects:
        turn_later_s = found["values"]["turn_lag_s"] - turn_lag_s
        model.set(YAW_EXTRA, model.get(YAW_EXTRA) + turn_later_s - later_s)
    large = found["rms_m"] / _expected_m(noise)
    issue = found["insights"] != [ALL_WELL]
    names = ("motor_lag",) if late else ()
    told = late or large > LARGE
    return {
        DOCUMENTED: Answer(issue, float(issue), predicted_by(model)),
        TUNED: Answer(told, large, predicted_by(model), names),
    }


def stretches(measurement: Measurement, model: native.Model) -> list[tuple]:
    """Runs of STRETCH_S on an even grid: s, body velocity asked for, poses, and what it has."""
    track = measurement.track
    bare = model.copy()
    lag_s, turn_lag_s = _lags_s(model)
    for name in _lag_names(model):
        bare.set(name, 0.0)
    runs = []
    for number in np.unique(track.segment[track.segment >= 0]):
        index = np.flatnonzero(track.segment == number)
        t_s = np.arange(track.pose_t_s[index[0]], track.pose_t_s[index[-1]], STEP_S)
        measured = track.pose[index].T
        pose = np.column_stack([np.interp(t_s, track.pose_t_s[index], p) for p in measured])
        asked = _asked(measurement, bare, index, t_s)
        keep = np.exp(-STEP_S / np.array([lag_s, lag_s, turn_lag_s]))
        has = np.column_stack(
            [lfilter([1 - k], [1, -k], c) for k, c in zip(keep, asked.T, strict=True)]
        )
        count = round(STRETCH_S / STEP_S)
        runs += [
            (t_s[a : a + count] - t_s[a], asked[a : a + count], pose[a : a + count], has[a - 1])
            for a in range(count, len(t_s) - count, count)
        ]
    return runs


def _asked(
    measurement: Measurement, bare: native.Model, index: np.ndarray, t_s: np.ndarray
) -> np.ndarray:
    """(N, 3) velocity of the body without any lag, in the steps from these times on.

    A step of MuJoCo moves by the state that its actuators have at its start: half a step late.
    """
    track = measurement.track
    start, end = index[:-1].astype(np.int64), index[1:].astype(np.int64)
    ahead = native.windows(bare, measurement.played, start, end[:, None])[:, 0]
    d = ahead - track.pose[start]
    turn = np.remainder(d[:, 2] + np.pi, 2 * np.pi) - np.pi
    body = np.column_stack([*rotate(d[:, 0], d[:, 1], -track.pose[start, 2] - turn / 2), turn])
    body /= (track.pose_t_s[end] - track.pose_t_s[start])[:, None]
    middle_s = (track.pose_t_s[start] + track.pose_t_s[end]) / 2
    return np.column_stack([np.interp(t_s + STEP_S, middle_s, c) for c in body.T])


def _lag_names(model: native.Model) -> list[str]:
    """The base's lag and what effects add to it, to the lag of turns last."""
    own = {LAG_EFFECT: ADDED, YAW_LAG: YAW_EXTRA}
    return [LAG, *(name for effect, name in own.items() if effect in model.effects)]


def _lags_s(model: native.Model) -> tuple[float, float]:
    """Time constants of travel and of turns."""
    lags_s = {name: model.get(name) for name in _lag_names(model)}
    turn_s = sum(lags_s.values())
    travel_s = turn_s - lags_s.get(YAW_EXTRA, 0.0)
    return max(travel_s, LEAST_LAG_S), max(turn_s, LEAST_LAG_S)


def _expected_m(noise: dict[str, float]) -> float:
    """RMS error of place that sensor and disturbance make over a stretch (Ornstein-Uhlenbeck)."""
    t_s, memory_s = np.linspace(0, STRETCH_S, 101), noise["drive_s"]
    wander = 2 * memory_s * (t_s - memory_s * (1 - np.exp(-t_s / memory_s)))
    one = 2 * noise["sensor_m"] ** 2 + noise["drive_mps"] ** 2 * wander
    return float(np.sqrt(2 * one.mean()))


RIVAL = Rival(
    name="mujoco.sysid",
    source=f"mujoco {mujoco.__version__}",
    settings={
        DOCUMENTED: "gains and lags by sysid.optimize; told if its report's insights are not "
        f'"{ALL_WELL}"',
        TUNED: f"told if the rest is {LARGE:g} times what the base's noise makes, or the lag "
        f"moved by {1000 * LATE_S:g} ms, which it then names",
    },
    lacks={"depends": "its residual is a number", "name": "it has the lag alone to name"},
    answers=answers,
    once=True,
)
