# SPDX-License-Identifier: Apache-2.0
"""Fixtures that several test files share."""

import os
import signal
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the commands do, before numpy is loaded

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi
import twinmill_native as native

from twinmill import api
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import RobotLog
from twinmill.diagnosis import diagnose, infer
from twinmill.experiment import design
from twinmill.inference import always
from twinmill.robots.key import load_or_make
from twinmill_cli import early, ending, main
from twinmill_cli.handlers import put_back

sys.path.insert(0, str(Path(__file__).parent))
from asked_once import AlwaysOnce, AskedOnce, DesignedOnce
from same_robot import make_days

ALWAYS, DESIGN = AlwaysOnce(), DesignedOnce()
ONCE = (
    *((diagnose, name, AskedOnce(getattr(diagnose, name))) for name in ("infer", "judge_fleet")),
    *((module, "always_of", ALWAYS) for module in (always, infer)),
    *((module, "design", DESIGN) for module in (design, api)),
)

NOISE = """
[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
drive_mps = 0.005
drive_radps = 0.03
"""


@pytest.fixture(scope="session")
def model_text() -> Callable[..., str]:
    """Text of a model file: four mecanum wheels under a body of TurboPi's size."""

    def make(name: str, **base: float | list[float]) -> str:
        usual = {
            "duty_pct": [0, 100],
            "wheel_speed_mps": [0, 0.36],
            "motor_lag_s": 0.06,
            "control_period_s": 0.022,
        }
        keys = "".join(f"{key} = {value}\n" for key, value in (usual | base).items())
        return f"""
name = "{name}"
[robot]
wheel_radius_m = 0.0325
half_wheelbase_m = 0.059
half_track_m = 0.067
body_radius_m = 0.1
battery_nominal_V = 7.4
[base]
drive = "duty"
wheels = "mecanum"
{keys}"""

    return make


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of recordings that are not part of the project."""
    beside = Path(__file__).resolve().parents[2] / ".." / "shared" / "data"
    path = Path(os.environ.get("TWINMILL_DATA", beside))
    if not path.is_dir():
        pytest.skip(f"no recordings at {path}: set TWINMILL_DATA")
    return path


@pytest.fixture
def write_log(tmp_path) -> Callable[..., Path]:
    """Writes (channel, message or bytes) events with LCM's own writer."""

    def write(*events, name="made.lcmlog") -> Path:
        log = lcm.EventLog(str(tmp_path / name), "w", overwrite=True)
        for k, (channel, message) in enumerate(events):
            log.write_event(k, channel, message if isinstance(message, bytes) else message.encode())
        log.close()
        return tmp_path / name

    return write


@pytest.fixture
def message() -> Callable:
    """Makes a message of a type by name, with the fields given."""

    def make(type_name: str, **fields):
        made = getattr(turbopi, f"{type_name}_t")()
        if type_name == "pose":
            made.valid, made.orientation_wxyz = 1, [1.0, 0.0, 0.0, 0.0]
        for name, value in fields.items():
            setattr(made, name, value)
        return made

    return make


@pytest.fixture(scope="session")
def driven() -> Callable[..., RobotLog]:
    """A robot at 0.3 m/s, 0.5 rad/s for some seconds: 120 Hz poses, 45 Hz commands, no noise."""

    def make(duration_s=10.0, **changes) -> RobotLog:
        pose_t_s, command_t_s = np.arange(0, duration_s, 1 / 120), np.arange(0, duration_s, 1 / 45)
        theta = 0.5 * pose_t_s
        pose = np.column_stack([0.6 * np.sin(theta), 0.6 * (1 - np.cos(theta)), theta])
        flags, count = np.zeros(len(command_t_s), np.int8), len(command_t_s)
        robot = RobotLog(
            robot_id=3,
            source="robot",
            behavior="",
            command_kind="duty",
            command_t_s=command_t_s,
            command=np.tile([0.5, 0.8, 0.5, 0.8], (count, 1)),
            battery_V=np.full(count, 8.0),
            frame_t_s=np.full(count, np.nan),
            mode=flags,
            detected_raw=flags,
            detected=flags,
            speed_input=np.zeros(count),
            turn_input=np.zeros(count),
            pose_t_s=pose_t_s,
            pose=pose,
            z_m=np.full(len(pose_t_s), 0.1),
            valid=np.ones(len(pose_t_s), bool),
        )
        return replace(robot, **changes)

    return make


@dataclass(frozen=True)
class CoastingRobot:
    """A log that the twin's planar plant made, and the two models of it.

    Attributes:
        log: steps and turns, none driven twice, each followed by a stop.
        model: the model as it was driven, but without its effect.
        true_model: with it: coasting at `deceleration_mps2`.
    """

    log: Path
    model: Path
    true_model: Path
    deceleration_mps2: float


@pytest.fixture(scope="session")
def coasting_robot(tmp_path_factory, model_text) -> CoastingRobot:
    """120 s of a robot with noise that rolls on after each stop; its model knows all but that."""
    return _coasting(tmp_path_factory.mktemp("coasting"), model_text, 120, 0.01)


@pytest.fixture(autouse=True)
def own_ctrl_c():
    """A program that ends ignores Ctrl-C from then on; the tests are one that goes on."""
    before = {number: signal.getsignal(number) for number in early.ENDING}
    yield
    put_back(before)


@pytest.fixture(scope="module")
def asked_once() -> Iterator[None]:
    """Diagnoses of the same logs by the same model are made once, for all modules that use this."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name, once in ONCE:
            patch.setattr(module, name, once)
        yield


@pytest.fixture
def key_file(tmp_path) -> Path:
    """An operator's key that is there."""
    load_or_make(tmp_path / "key")
    return tmp_path / "key"


@pytest.fixture
def twinmill(monkeypatch, capsys):
    """Runs the command line: exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["twinmill", *map(str, arguments)])
        monkeypatch.setattr(ending, "exit_now", sys.exit)  # else by a signal, after Ctrl-C
        with pytest.raises(SystemExit) as stopped:
            main.main()
        return stopped.value.code, *capsys.readouterr()

    return run


@pytest.fixture(scope="session")
def brief_coasting_robot(tmp_path_factory, model_text) -> CoastingRobot:
    """Coasting robot for 45 s with fewer poses, where numbers need not be sharp."""
    return _coasting(tmp_path_factory.mktemp("brief"), model_text, 45, 0.025)


@pytest.fixture(scope="session")
def brief_log_without_coasting(tmp_path_factory, model_text) -> Path:
    """Log of the brief robot before it rolled on: its model's own."""
    return _coasting(tmp_path_factory.mktemp("own"), model_text, 45, 0.025, effect="").log


COASTING = '[[effect]]\nname = "coasting"\ndeceleration_mps2 = 0.7\n'


def _coasting(
    folder: Path,
    model_text: Callable[..., str],
    duration_s: float,
    period_s: float,
    effect: str = COASTING,
) -> CoastingRobot:
    known = model_text("coaster") + NOISE
    (folder / "model.toml").write_text(known)
    (folder / "true.toml").write_text(known + effect)
    command_t_s = np.arange(0, duration_s, 0.022)
    legs = np.random.default_rng(1).choice([-1, -0.8, -0.6, 0.6, 0.8, 1], (80, 2))
    legs[::2] = 0
    left, right = legs[(command_t_s // 1.5).astype(int)].T
    command = np.ascontiguousarray(np.column_stack([left, right, left, right]))
    pose_t_s = np.arange(0.1, duration_s - 0.1, period_s)
    played = native.Track(
        command_t_s,
        command,
        np.full(len(command_t_s), 7.4),
        pose_t_s,
        np.zeros((len(pose_t_s), 3)),
        np.zeros(len(pose_t_s), np.int64),
    )
    pose = native.replica(native.Model.load(str(folder / "true.toml")), played, 1)
    poses, commands = folder / "poses.csv", folder / "commands.csv"
    np.savetxt(
        poses,
        np.column_stack([pose_t_s, np.full(len(pose_t_s), 3), pose]),
        delimiter=",",
        header="t_s,robot_id,x_m,y_m,theta_rad",
        comments="",
        fmt="%.7f",
    )
    np.savetxt(
        commands,
        np.column_stack([command_t_s, np.full(len(command_t_s), 3), 100 * command]),
        delimiter=",",
        header="t_s,robot_id,fl_pct,fr_pct,rl_pct,rr_pct",
        comments="",
        fmt="%.4f",
    )
    import_log(poses, commands, folder / "run.lcmlog", options=ImportOptions())
    return CoastingRobot(folder / "run.lcmlog", folder / "model.toml", folder / "true.toml", 0.7)


@pytest.fixture(scope="session")
def same_robot(tmp_path_factory) -> dict[str, Path]:
    """Logs of one robot on four days, by name; `model.toml` is beside them."""
    return make_days(tmp_path_factory.mktemp("days"))


@pytest.fixture
def clock(monkeypatch):
    """Both clocks of this computer, which stand until they are set forward by so many seconds."""
    now = {name: getattr(time, name)() for name in ("monotonic", "time")}

    def forward(s: float) -> None:
        for name in now:
            now[name] += s

    for name in now:
        monkeypatch.setattr(time, name, lambda name=name: now[name])
    monkeypatch.setattr(time, "time_ns", lambda: round(1e9 * now["time"]))
    return forward
