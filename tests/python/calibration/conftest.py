# SPDX-License-Identifier: Apache-2.0
"""A robot that shares no code with the twin: numpy, 480 Hz Euler, a tanh curve from duty to speed.

It is the outside truth of the tests here: what calibration says of its logs is compared with the
constants that it was made with.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi

from twinmill.data.measurement import Measurement, load_measurements
from twinmill.experiment.drives import drive
from twinmill.fitting.fit import fit
from twinmill.inference.keeping import with_its_error
from twinmill.model.model_file import ModelFile
from twinmill_lab.challenge.cases import calibration
from twinmill_lab.challenge.physics import catalogue_forms
from twinmill_lab.challenge.robots import Robot, draw_robot
from twinmill_lab.challenge.run import Plan, play, write_log

STEP_S = 1 / 480
POSE_EVERY, COMMAND_EVERY = 4, 10  # 120 Hz and 48 Hz
STANDSTILL_MPS = 1e-3
EPOCH_US = 1_700_000_000_000_000
LEVELS_PCT = (25, 50, 75, 100)
GUESS = {
    "duty_pct": [0, 25, 50, 75, 100],
    "wheel_speed_mps": [0, 0.1, 0.2, 0.3, 0.4],
    "motor_lag_s": 0.05,
    "control_period_s": 0.0208,
}


@dataclass(frozen=True)
class TanhRobot:
    """Constants of the robot.

    Attributes:
        top_mps, bend: speed at duty u is top tanh(bend u) / tanh(bend).
        lag_s: first order; coast_mps2: drag at zero duty in its place, 0 = the lag acts there too.
        sideways, yaw: share of ideal rolling; lever_m: half wheelbase and half track.
        sensor_m, sensor_rad: white noise of poses.
        drive_mps, drive_radps, memory_s: disturbance of the body's velocity, first order,
            while a wheel turns.
        offset_s: capture's clock less the robot's.
    """

    top_mps: float = 0.4
    bend: float = 1.6
    lag_s: float = 0.09
    coast_mps2: float = 0.0
    sideways: float = 0.88
    yaw: float = 0.8
    lever_m: float = 0.126
    sensor_m: float = 3e-4
    sensor_rad: float = 1.75e-3
    drive_mps: float = 3e-3
    drive_radps: float = 0.03
    memory_s: float = 0.15
    offset_s: float = 0.0

    def speed_mps(self, duty: np.ndarray) -> np.ndarray:
        """Steady speed of a wheel's rim."""
        return self.top_mps * np.tanh(self.bend * duty) / np.tanh(self.bend)

    def wheels_mps(self, duty: np.ndarray) -> np.ndarray:
        """(K, 4) duties -1..1 to (K, 4) rim speeds at the end of each step."""
        speeds, now = np.empty(duty.shape), np.zeros(4)
        target = self.speed_mps(duty)
        for k in range(len(duty)):
            change = STEP_S / self.lag_s * (target[k] - now)
            if self.coast_mps2:
                drag = np.clip(now, -self.coast_mps2 * STEP_S, self.coast_mps2 * STEP_S)
                change = np.where(duty[k] == 0, -drag, change)
            now = now + change
            speeds[k] = now
        return speeds

    def hindered(self, motion: np.ndarray) -> np.ndarray:
        """(K, 3) velocities of the body to those that are left of them: all."""
        return motion

    def poses(self, duty: np.ndarray, seed: int) -> np.ndarray:
        """(K, 4) duties to (K, 3) poses as seen at the end of each step."""
        random = np.random.default_rng(seed)
        fl, fr, rl, rr = self.wheels_mps(duty).T
        keep = np.exp(-STEP_S / self.memory_s)
        drift = np.zeros((len(duty), 3))
        for k, fresh in enumerate(random.normal(size=(len(duty) - 1, 3))):
            drift[k + 1] = keep * drift[k] + np.sqrt(1 - keep**2) * fresh
        drift *= (self.drive_mps, self.drive_mps, self.drive_radps)
        drift[np.abs([fl, fr, rl, rr]).max(axis=0) < STANDSTILL_MPS] = 0
        motion = np.column_stack([
            (fl + fr + rl + rr) / 4,
            self.sideways * (-fl + fr + rl - rr) / 4,
            self.yaw * (-fl + fr - rl + rr) / 4 / self.lever_m,
        ])  # fmt: skip
        forward, left, turn = (self.hindered(motion) + drift).T
        heading = np.cumsum(turn) * STEP_S
        c, s = np.cos(heading), np.sin(heading)
        x, y = (np.cumsum(v) * STEP_S for v in (c * forward - s * left, s * forward + c * left))
        noise = random.normal(size=(len(duty), 3)) * (self.sensor_m, self.sensor_m, self.sensor_rad)
        return np.column_stack([x, y, heading]) + noise


def times_s(values: np.ndarray) -> np.ndarray:
    """(K,) since the first step, of values of each step."""
    return np.arange(len(values)) * STEP_S


def rich_script(duration_s: float, seed: int, legs_s: tuple[float, float] = (0.4, 1.6)):
    """(K, 4) duties in percent at each control step: straights, curves, strafes, rests."""
    random = np.random.default_rng(seed)
    count = round(duration_s / (COMMAND_EVERY * STEP_S))
    rows: list[np.ndarray] = []
    while len(rows) < count:
        a, b = random.choice(LEVELS_PCT, 2) * random.choice([-1, 1], 2)
        leg = [(a, a, a, a), (a, b, a, b), (a, -a, a, -a), (-a, a, a, -a), (0, 0, 0, 0)]
        length = round(random.uniform(*legs_s) / (COMMAND_EVERY * STEP_S))
        rows += [np.array(leg[random.integers(len(leg))])] * length
    return np.array(rows[:count])


def write_run(
    path: Path, robot: TanhRobot, script_pct: np.ndarray, seed: int, spoil: Callable | None = None
) -> Path:
    """Drives the robot by a script and writes its log; `spoil` may change (N, 3) poses, (N,) valid.

    Commands start half a second before the first and end after the last pose.
    """
    still = np.zeros((24, 4), int)
    script_pct = np.vstack([still, script_pct, still])
    pose = robot.poses(np.repeat(script_pct, COMMAND_EVERY, axis=0) / 100, seed)
    pose = pose[POSE_EVERY - 1 :: POSE_EVERY]
    pose_us = np.rint(1e6 * (np.arange(1, len(pose) + 1) * POSE_EVERY * STEP_S + robot.offset_s))
    command_us = np.rint(1e6 * np.arange(len(script_pct)) * COMMAND_EVERY * STEP_S)
    valid = np.ones(len(pose), bool)
    if spoil:
        pose, valid = spoil(pose, valid)
    log = lcm.EventLog(str(path), "w", overwrite=True)
    for k, (t_us, duty) in enumerate(zip(command_us, script_pct, strict=True)):
        message = turbopi.telemetry_t()
        message.utime_us, message.seq, message.robot_id = EPOCH_US + int(t_us), k, 3
        message.wheel_duty_pct, message.battery_V, message.mode = [int(d) for d in duty], 7.4, 2
        log.write_event(message.utime_us, "R03_TELEMETRY", message.encode())
    for k, (t_us, (x_m, y_m, theta_rad)) in enumerate(zip(pose_us, pose, strict=True)):
        message = turbopi.pose_t()
        message.utime_us, message.seq, message.robot_id = EPOCH_US + int(t_us), k, 3
        message.position_m, message.valid = [x_m, y_m, 0.1], int(valid[k])
        message.orientation_wxyz = [np.cos(theta_rad / 2), 0, 0, np.sin(theta_rad / 2)]
        log.write_event(message.utime_us, "R03_POSE", message.encode())
    log.close()
    return path


@pytest.fixture(scope="session")
def run_log(tmp_path_factory) -> Callable[..., Path]:
    """Writes a log of a TanhRobot that drives a rich script (or another one), the same one once."""

    def make(robot=None, seed=1, duration_s=40.0, script_pct=None, spoil=None) -> Path:
        robot = robot or TanhRobot()
        if type(robot) is TanhRobot and script_pct is None and spoil is None:
            return usual(robot, seed, duration_s)
        script_pct = rich_script(duration_s, seed) if script_pct is None else script_pct
        return written(robot, script_pct, seed, spoil)

    @cache
    def usual(robot, seed, duration_s) -> Path:
        return written(robot, rich_script(duration_s, seed), seed, None)

    def written(robot, script_pct, seed, spoil) -> Path:
        path = tmp_path_factory.mktemp("run") / "run.lcmlog"
        return write_run(path, robot, script_pct, seed, spoil)

    return make


@pytest.fixture(scope="session")
def measure(run_log) -> Callable[..., Measurement]:
    """Reads and cleans a log of `run_log`."""

    def make(*arguments, **options) -> Measurement:
        (measurement,) = load_measurements([run_log(*arguments, **options)])
        return measurement

    return make


@pytest.fixture(scope="session")
def tanh_robot() -> type[TanhRobot]:
    """The robot's class: its constants are the truth."""
    return TanhRobot


@pytest.fixture(scope="session")
def model_file(tmp_path_factory, model_text) -> Callable[..., ModelFile]:
    """A model of the robot: all speeds, gains and lags guessed, but for the text put in."""

    def make(*changes: tuple[str, str], extra: str = "", name: str = "guess.toml") -> ModelFile:
        text = model_text("guess", **GUESS)
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path_factory.mktemp("model") / name
        path.write_text(text + extra)
        return ModelFile.load(str(path))

    return make


@pytest.fixture(scope="session")
def true_model(tanh_robot, model_file):
    """The robot as the twin writes it; its curve by twenty straight lines."""
    robot = tanh_robot()
    duty_pct = list(range(0, 101, 5))
    speeds = [round(float(v), 5) for v in robot.speed_mps(np.array(duty_pct) / 100)]
    gains = f"sideways_gain = {robot.sideways}\nyaw_gain = {robot.yaw}\n"
    return model_file(
        ("[0, 25, 50, 75, 100]", str(duty_pct)),
        ("[0, 0.1, 0.2, 0.3, 0.4]", str(speeds)),
        ("motor_lag_s = 0.05", f"motor_lag_s = {robot.lag_s}\n{gains}"),
        name="true.toml",
    )


@pytest.fixture(scope="session")
def one_clock_base(tanh_robot, measure, model_file, tmp_path_factory) -> ModelFile:
    """The base fitted to a log of the robot as it is; one clock stamps all."""
    path = tmp_path_factory.mktemp("one_clock") / "base.toml"
    fit([measure(tanh_robot(), 1, 60.0)], model_file(extra="[clock]\nsame = true\n"), path, "")
    return ModelFile.load(str(path))


@pytest.fixture(scope="session")
def known_base(tanh_robot, measure, one_clock_base, tmp_path_factory) -> ModelFile:
    """That base with what it misses in its own log, as `twinmill fit` writes it."""
    kept = with_its_error(one_clock_base, [measure(tanh_robot(), 1, 60.0)])
    known = ModelFile.of(tmp_path_factory.mktemp("known") / "base.toml", kept.text)
    known.write()
    return known


@pytest.fixture(scope="session")
def changed(tanh_robot) -> Callable[..., TanhRobot]:
    """Makes a robot by what is done to the usual one's duties, rim speeds or motion.

    Args of what is given:
        duties: (K, 4) duties -1..1 to those that the motors get.
        wheels: (K, 4) rim speeds to those of the wheels, m/s.
        motion: (K, 3) velocities of the body to those that it has, m/s and rad/s.
        constants: of the robot.
    """

    def same(values):
        return values

    def make(duties=same, wheels=same, motion=same, **constants):
        class Changed(tanh_robot):
            def wheels_mps(self, duty):
                return wheels(super().wheels_mps(duties(duty)))

            def hindered(self, velocity):
                return motion(velocity)

        return Changed(**constants)

    return make


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Callable[..., tuple[Robot, Measurement, ModelFile]]:
    """A robot of the exam, a run of it with one thing hidden, and a base from another log.

    Args of what is given:
        kind: of the robot.
        seed: of all that is drawn.
        style: of the run, 80 s long.
        hidden: name and kind of what is hidden, and by which of its values it is told how much.
        much: that value.
        forces: whether a robot made of forces is, in the log of the base; see `play`.
    """

    def make(kind, seed, style, hidden, much, *, forces=False):
        folder, random = tmp_path_factory.mktemp(hidden[0]), np.random.default_rng(seed)
        robot = draw_robot(kind, random)
        usual = calibration(robot, seed, 60.0)
        write_log(usual, play(usual, forces=forces), folder / "usual.lcmlog")
        (folder / "sheet.toml").write_text(robot.sheet(random))
        plan = Plan(robot, drive(style, 80.0, True, random), seed)
        forms = catalogue_forms(robot, random)
        form = next(f for f in forms if (f.name, f.kind) == hidden[:2])
        form = form.scaled(much / form.values[hidden[2]])
        write_log(plan, play(plan, [form]), folder / "run.lcmlog")
        sheet, base = ModelFile.load(str(folder / "sheet.toml")), folder / "base.toml"
        fit(load_measurements([folder / "usual.lcmlog"]), sheet, base, "")
        (run,) = load_measurements([folder / "run.lcmlog"])
        return robot, run, ModelFile.load(str(base))

    return make
