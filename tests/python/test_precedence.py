# SPDX-License-Identifier: Apache-2.0
"""Poses that precede their commands are told where the motion shows it, and of no causal robot.

The robots are simulated here, and each says by how much its poses are stamped early. The second
half of either list was written down, with what is right, before any of it was run.
"""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import twinmill as tm
from twinmill.data.checks.causality import precedence
from twinmill.data.checks.settings import CHECKS

EXAMPLE = Path(__file__).parents[2] / "examples/make_ros_bag.py"
STEP_S, DURATION_S = 0.005, 60.0
T_S = np.arange(0, DURATION_S, STEP_S)


def _lag(u, lag_s):
    out, keep = np.zeros_like(u), np.exp(-STEP_S / lag_s)
    for k in range(1, len(u)):
        out[k] = keep * out[k - 1] + (1 - keep) * u[k]
    return out


def _limited(u, up, down=None):
    """Each channel's change is limited; moving away from zero by `up`, towards it by `down`."""
    up, down = np.array(up), np.array(down or up)
    out = np.zeros_like(u)
    for k in range(1, len(u)):
        most = np.where(np.abs(u[k]) > np.abs(out[k - 1]), up, down) * STEP_S
        out[k] = out[k - 1] + np.clip(u[k] - out[k - 1], -most, most)
    return out


def _smoothed(u, over_s):
    count = round(over_s / STEP_S)
    total = np.cumsum(np.vstack([np.zeros((count, 2)), u]), axis=0)
    return (total[count:] - total[:-count]) / count


def _controlled(u, natural_radps, damping):
    """A PI controller of an integrator: it overshoots, and on the mean it is not late at all."""
    v, integral = np.zeros_like(u), np.zeros(2)
    for k in range(1, len(u)):
        off = u[k] - v[k - 1]
        integral += STEP_S * natural_radps**2 * off
        v[k] = v[k - 1] + STEP_S * (2 * damping * natural_radps * off + integral)
    return v


def _dead(u):
    return np.sign(u) * np.maximum(np.abs(u) - [0.05, 0.2], 0)


def _steps(rng):
    """Any time between half a second and two, any of some speeds."""
    begin_s = np.append(0, np.cumsum(rng.uniform(0.5, 2.0, 120)))
    speeds = [rng.choice(s, len(begin_s)) for s in ([-0.3, 0, 0.15, 0.3, 0.45], [-2, -1, 0, 1, 2])]
    return begin_s, np.column_stack(speeds)


def _stop_and_go(rng, every_s=1.5):
    begin_s = np.arange(0, DURATION_S, every_s)
    goes = np.arange(len(begin_s)) % 2
    speeds = [goes * rng.choice(s, len(begin_s)) for s in ([0.2, 0.3, 0.4], [-1, 0, 1])]
    return begin_s, np.column_stack(speeds)


def _smooth(rng, over_s=0.5, hz=25):
    begin_s = np.arange(0, DURATION_S, 1 / hz)
    wander = rng.normal(size=(len(T_S), 2))
    for _ in range(2):
        wander = _lag(wander, over_s)
    wander /= wander.std(axis=0)
    return begin_s, ([0.25, 0] + [0.12, 0.7] * wander)[np.searchsorted(T_S, begin_s)]


def _sines(rng):
    begin_s = np.arange(0, DURATION_S, 0.02)
    phase = 2 * np.pi * (0.1 + 0.004 * begin_s) * begin_s
    return begin_s, np.column_stack([0.25 + 0.15 * np.sin(phase), np.cos(0.7 * phase + 1)])


def _followed(rng, responds, slip):
    """Drives to random places, told at 20 Hz by where it is: commands, and how it drives."""
    at, heading_rad, goal, v, slips = 0j, 0.0, 1 + 0j, np.zeros(2), np.zeros(2)
    told, driven = np.zeros((len(T_S), 2)), np.zeros((len(T_S), 2))
    for k in range(1, len(T_S)):
        told[k] = told[k - 1]
        if k % 10 == 0:
            if abs(goal - at) < 0.1:
                goal = complex(*rng.uniform(-1, 1, 2))
            off_rad = np.angle((goal - at) * np.exp(-1j * heading_rad))
            told[k] = 0.3 * max(np.cos(off_rad), 0), np.clip(2 * off_rad, -1.5, 1.5)
        slips += -slips * STEP_S / 0.5 + rng.normal(size=2) * slip * np.sqrt(2 * STEP_S / 0.5)
        v = responds(v, told[k])
        driven[k] = v * (1 + slips)
        heading_rad += driven[k, 1] * STEP_S
        at += driven[k, 0] * STEP_S * np.exp(1j * heading_rad)
    return T_S[::10], told[::10], driven


def _limited_step(v, told):
    """One step of a limit of 0.4 m/s2 and 2 rad/s2."""
    return v + np.clip(told - v, [-0.4 * STEP_S, -2 * STEP_S], [0.4 * STEP_S, 2 * STEP_S])


@dataclass(frozen=True)
class Robot:
    """How it is driven, what it makes of that, and how it is recorded; `drive` None: a follower."""

    drive: Callable | None
    responds: Callable
    pose_hz: float
    noise_m: float = 0.0005
    slip: float = 0.0

    def driven(self, rng):
        """(M,) s, (M, 2) commands, and (T, 2) how fast it is at each time."""
        if self.drive is None:
            return _followed(rng, self.responds, self.slip)
        command_t_s, command = self.drive(rng)
        told = command[np.searchsorted(command_t_s, T_S, side="right") - 1]
        slips = _lag(rng.normal(size=told.shape), 0.5)
        slips *= self.slip / slips.std(axis=0)
        return command_t_s, command, self.responds(told) * (1 + slips)

    def run(self, early_s, seed=1):
        """Reading of its log, declared to be of one clock, with poses stamped early."""
        rng = np.random.default_rng(seed)
        command_t_s, command, speed = self.driven(rng)
        heading_rad = np.cumsum(speed[:, 1]) * STEP_S
        along = speed[:, :1] * np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
        seen = slice(None, None, round(1 / (self.pose_hz * STEP_S)))
        pose = np.column_stack([np.cumsum(along, axis=0) * STEP_S, heading_rad])[seen]
        pose += rng.normal(size=pose.shape) * self.noise_m * [1, 1, 5]
        given = 10 + T_S[seen] - early_s, pose, 10 + command_t_s, command
        (run,) = tm.Log.from_arrays(*given, kind="twist", same_clock=True).measurements()
        return run


ROBOTS = {
    "limit 0.5": Robot(_steps, lambda u: _lag(_limited(u, [0.5, 99]), 0.08), 100),
    "lag 0.3": Robot(_steps, lambda u: _lag(u, 0.3), 50, 0.001),
    "smooth slips": Robot(partial(_smooth, over_s=1.0), lambda u: u, 25, 0.0026, 0.1),
    # Written down before they were run.
    "limit 0.3 of both": Robot(_steps, lambda u: _lag(_limited(u, [0.3, 3]), 0.04), 100),
    "brakes slowly": Robot(
        partial(_stop_and_go, every_s=1.2),
        lambda u: _lag(_limited(u, [1, 5], [0.4, 2]), 0.12),
        40,
    ),
    "jerk": Robot(_steps, lambda u: _smoothed(_limited(u, [0.6, 4]), 0.15), 50),
    "overshoots, slips": Robot(_smooth, lambda u: _controlled(u, 6, 0.4), 25, 0.0026, 0.15),
    "follows its pose": Robot(None, _limited_step, 50, 0.001, 0.1),
    "sines": Robot(_sines, lambda u: _lag(u, 0.3), 40),
    "dead zone": Robot(_stop_and_go, lambda u: _lag(_dead(u), 0.1), 20, 0.003),
    "fast, stops and goes": Robot(_stop_and_go, lambda u: _lag(u, 0.03), 50, 0.001, 0.05),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_motion_of_no_robot_precedes_its_command(name):
    run = ROBOTS[name].run(0.0)
    assert not run.findings
    for lead_s in (0.1, 0.3):
        assert precedence(run.track, np.eye(3, 4), lead_s, 0.04) < CHECKS.sure


def test_a_limited_acceleration_does_not_belie_one_clock(monkeypatch):
    """The tutorial's robot with half its limit resembles poses 0.06 s early more than a lag."""
    logs = []
    monkeypatch.setattr(tm.Log, "export", lambda log, *_, **__: logs.append(log))
    spec = importlib.util.spec_from_file_location("make_ros_bag", EXAMPLE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    example.LIMIT_MPS2 = 0.5
    monkeypatch.setattr(tm.Log, "from_arrays", partial(tm.Log.from_arrays, same_clock=True))
    example.main()
    (run,) = logs[0].measurements()
    assert run.same_clock and not run.findings


@pytest.mark.parametrize(
    ("name", "early_s"),
    [
        ("limit 0.5", 0.17),
        ("lag 0.3", 0.17),
        # Written down before they were run; so was "sines", which shows nothing: it is foretold.
        ("limit 0.3 of both", 0.25),
        ("brakes slowly", 0.2),
        ("overshoots, slips", 0.3),
        ("follows its pose", 0.2),
        ("fast, stops and goes", 0.1),
    ],
)
def test_poses_that_are_stamped_early_are_told_and_the_declaration_stays(name, early_s):
    run = ROBOTS[name].run(early_s)
    (said,) = run.findings
    assert said.two_clocks and not said.fatal and run.same_clock
