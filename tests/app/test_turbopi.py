# SPDX-License-Identifier: Apache-2.0
"""firmware/app: what the robot's program does as a whole, kill -9 included."""

import json
import os
import re
import resource
import shlex
import signal
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi
from robot_process import GREEN, GREY, HEIGHT_PX, LEFT, RIGHT, WIDTH_PX, ZERO, Robot, wait_until

from twinmill.data.importers.io_tsv import read_io_tsv

# Programs of another machine are run by an emulator, whose command comes first.
TURBOPI = shlex.split(os.environ.get("TURBOPI", ""))
CORE_DUTIES = shlex.split(os.environ.get("CORE_DUTIES", ""))
pytestmark = pytest.mark.skipif(not TURBOPI, reason="TURBOPI does not name the program")

WATCHDOG_S = 0.5
# The machine may be busy with other tests.
SLACK_S = 1.0


def run(*arguments):
    return subprocess.run([*TURBOPI, *arguments], capture_output=True, text=True, timeout=60)


@pytest.fixture
def driving(tmp_path):
    """A robot that sees green and turns left; it is not started again if it dies."""
    with Robot(TURBOPI, tmp_path, "--start", "--set", "restart_ms=-1") as robot:
        assert robot.wait_for(LEFT)
        yield robot


def assert_stopped_since(robot, killed_s, within_s):
    """All that the board heard last is zero, and it came in time."""
    rows = robot.rows()
    last_move_s = max(t for t, duties in rows if duties != ZERO)
    zeros_s = [t for t, duties in rows if t > last_move_s]
    assert robot.duties() == ZERO
    assert zeros_s[0] - killed_s < within_s


def test_green_turns_left_and_grey_turns_right(driving):
    driving.camera.view = GREY
    assert driving.wait_for(RIGHT)
    driving.camera.view = GREEN
    assert driving.wait_for(LEFT)


def test_kill_9_of_the_driving_process_stops_the_wheels(driving):
    killed_s = time.monotonic()
    os.kill(driving.children()[0], signal.SIGKILL)
    code, said = driving.end()
    assert_stopped_since(driving, killed_s, WATCHDOG_S)
    assert code == 1 and "killed by signal 9" in said


def test_hanging_process_is_killed_and_the_wheels_stop(driving):
    stopped_s = time.monotonic()
    os.kill(driving.children()[0], signal.SIGSTOP)
    code, said = driving.end()
    assert_stopped_since(driving, stopped_s, WATCHDOG_S + SLACK_S)
    # Where its parent is kept waiting itself, the guard is first.
    assert code == 1 and ("hangs" in said or "guard: the driving process hung" in said)


def test_hanging_process_does_not_keep_the_program_from_ending(driving):
    stopped_s = time.monotonic()
    os.kill(driving.children()[0], signal.SIGSTOP)
    driving.process.terminate()
    code, _ = driving.end()
    assert code == 0
    # It is given a second to end by itself.
    assert_stopped_since(driving, stopped_s, 1 + SLACK_S)


def test_kill_9_of_the_parent_stops_the_wheels(driving):
    killed_s = time.monotonic()
    os.kill(driving.process.pid, signal.SIGKILL)
    assert driving.wait_for(ZERO)
    time.sleep(0.2)
    assert_stopped_since(driving, killed_s, WATCHDOG_S)


def test_stop_option_stops_what_a_threefold_kill_left(driving):
    all_of_them = (*driving.guards(), driving.process.pid, *driving.children())
    for number in (signal.SIGSTOP, signal.SIGKILL):
        for pid in all_of_them:
            os.kill(pid, number)
    driving.process.wait()
    assert driving.duties() == LEFT
    assert (
        run("--config", "/dev/null", "--stop", "--board", f"stub:{driving.record}").returncode == 0
    )
    assert driving.duties() == ZERO


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGQUIT])
def test_signal_stops_the_wheels_and_ends_well(driving, number):
    killed_s = time.monotonic()
    driving.process.send_signal(number)
    code, _ = driving.end()
    assert code == 0
    assert_stopped_since(driving, killed_s, WATCHDOG_S)


def test_dead_program_is_started_again(tmp_path):
    with Robot(TURBOPI, tmp_path, "--start", "--set", "restart_ms=100") as robot:
        assert robot.wait_for(LEFT)
        first = robot.children()[0]
        os.kill(first, signal.SIGKILL)
        assert robot.wait_for(ZERO)
        assert robot.wait_for(LEFT)
        assert robot.children() not in ([], [first])


def test_no_autostart_where_a_stop_could_not_be_kept_in_mind(tmp_path):
    """The reason for the stop may be forgotten: the robot waits, and says why."""
    options = ("--set", "autostart=true", "--set")
    with Robot(TURBOPI, tmp_path, *options, f"run_dir={tmp_path}") as robot:
        assert robot.wait_for(LEFT)
        robot.process.terminate()
        robot.end()
    robot.record.unlink()
    with Robot(TURBOPI, tmp_path, *options, "run_dir=/proc") as robot:
        assert robot.wait_for(ZERO) and wait_until(robot.rows)
        time.sleep(1)
        robot.process.terminate()
        _, said = robot.end()
    assert {duties for _, duties in robot.rows()} == {ZERO}
    assert "run_dir: /proc" in said and "no autostart" in said


def test_frozen_picture_stops_the_wheels_after_200_ms(driving):
    driving.camera.view = b""
    frozen_s = time.monotonic()
    assert driving.wait_for(ZERO)
    stopped_s = next(t for t, duties in driving.rows() if duties == ZERO and t > frozen_s)
    # The last frame came at most one period earlier.
    assert 0.2 - 0.04 < stopped_s - frozen_s < 0.2 + SLACK_S


def test_unplugged_camera_comes_back(driving):
    driving.camera.unplug()
    assert driving.wait_for(ZERO)
    driving.camera.plug()
    assert driving.wait_for(LEFT)


def test_camera_that_comes_back_under_another_name_is_found_by_its_lasting_one(tmp_path):
    """As by /dev/v4l/by-id, whose entries lead to the name that the camera has now."""
    lasting = tmp_path / "by-id"
    lasting.symlink_to(tmp_path / "camera")
    with Robot(TURBOPI, tmp_path, "--start", "--camera", f"stub:unix:{lasting}") as robot:
        assert robot.wait_for(LEFT)
        robot.camera.unplug()
        assert robot.wait_for(ZERO)
        lasting.unlink()
        lasting.symlink_to(tmp_path / "another")
        robot.camera.path = tmp_path / "another"
        robot.camera.plug()
        assert robot.wait_for(LEFT)


def test_the_lasting_name_on_the_page_is_one_of_udevs_and_is_what_is_opened(tmp_path):
    """Its 60-persistent-v4l.rules: by-id/$env{ID_BUS}-$env{ID_SERIAL}-video-index$attr{index}."""
    page = Path(__file__).parents[2] / "docs/robot.md"
    (name,) = re.findall(r"`camera = (\S+)`", page.read_text())
    assert re.fullmatch(r"/dev/v4l/by-id/usb-[\w.-]+-video-index0", name)
    with Robot(TURBOPI, tmp_path, "--start", "--camera", name) as robot:
        said = ""
        while f"{name}: No such file or directory" not in said:
            said = robot.process.stderr.readline()
            assert said
    assert {duties for _, duties in robot.rows()} == {ZERO}


def test_script_is_played_once(tmp_path):
    script = tmp_path / "s.csv"
    script.write_text(
        "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,10,20,30,40\n0.3,-5,5,-5,5\n0.6,0,0,0,0\n"
    )
    with Robot(TURBOPI, tmp_path, "--start", "--script", str(script)) as robot:
        code, _ = robot.end()
        rows = [duties for _, duties in robot.rows()]
    assert code == 0
    # Before anything else the board is told to stand.
    assert [d for i, d in enumerate(rows) if i == 0 or rows[i - 1] != d] == [
        ZERO,
        (10, 20, 30, 40),
        (-5, 5, -5, 5),
        ZERO,
    ]


def write_frames(path: Path, seed: int, count: int):
    """Green rectangles of sizes about the threshold of 300 pixels, with noise, on grey."""
    rng = np.random.default_rng(seed)
    frames = np.tile(
        np.frombuffer(GREY, np.uint8).reshape(1, HEIGHT_PX, WIDTH_PX // 2, 4), (count, 1, 1, 1)
    )
    frames = frames.copy()
    for frame in frames:
        height, width = rng.integers(8, 24, 2)
        frame[4 : 4 + height, 2 : 2 + width // 2] = (81, 91, 81, 81)
        noisy = rng.random(frame.shape) < 0.02
        frame[noisy] = rng.integers(0, 256, np.count_nonzero(noisy))
    path.write_bytes(frames.tobytes())


@dataclass
class Played:
    """Frames that went through the program, and its log of them."""

    frames: Path
    telemetry: list
    runs: list
    io_tsv: Path


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Plays a file of frames through the program and reads its log."""
    folder = tmp_path_factory.mktemp("played")
    frames, log, io_tsv = folder / "frames.yuyv", folder / "a.lcmlog", folder / "io.tsv"
    write_frames(frames, seed=5, count=150)
    done = run(
        *("--config", "/dev/null", "--start", "--camera", f"stub:{frames}", "--board", "stub"),
        *(
            "--set",
            "panel=none",
            "--set",
            f"width_px={WIDTH_PX}",
            "--set",
            f"height_px={HEIGHT_PX}",
        ),
        *("--set", "rate_Hz=100", "--set", "frame_timeout_ms=5000", "--set", "robot_id=7"),
        *("--set", "watchdog_ms=5000"),  # a busy machine is no fault of the robot
        *("--lcm-url", f"file://{log}?mode=w", "--io-tsv", str(io_tsv)),
    )
    assert done.returncode == 0, done.stderr
    events = list(lcm.EventLog(str(log), "r"))
    telemetry = [turbopi.telemetry_t.decode(e.data) for e in events if e.channel == "R07_TELEMETRY"]
    runs = [turbopi.run_t.decode(e.data) for e in events if e.channel == "R07_RUN"]
    return Played(frames, telemetry, runs, io_tsv)


def test_duties_are_those_of_the_core_byte_for_byte(played):
    telemetry = played.telemetry
    expected = subprocess.run(
        [*CORE_DUTIES, played.frames, str(WIDTH_PX), str(HEIGHT_PX)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    decided = {t.frame_seq: t for t in telemetry if t.frame_utime_us and t.mode == t.MODE_TABLE}
    assert sorted(decided) == list(range(150))
    assert [" ".join(map(str, decided[i].wheel_duty_pct)) for i in range(150)] == expected
    # Both rows of the table and both bits are among them.
    assert len(set(expected)) == 2
    assert {t.detected_raw for t in decided.values()} == {0, 1}


def test_telemetry_explains_itself(played):
    telemetry, runs = played.telemetry, played.runs
    assert [t.seq for t in telemetry] == list(range(len(telemetry)))
    for t in telemetry:
        assert t.frame_utime_us <= t.utime_us
        assert abs(t.utime_us / 1e6 - time.time()) < 60
    assert telemetry[-2].battery_V == pytest.approx(8.0)
    assert runs[0].source == "robot" and runs[0].behavior == "milling" and runs[0].robot_id == 7
    try:
        import tomllib
    except ImportError:
        pytest.skip("no tomllib")
    config = tomllib.loads(runs[0].config_toml)
    assert config["robot_id"] == 7 and config["rate_Hz"] == 100 and config["panel"] == "none"


def test_io_tsv_is_read_by_the_importer(played):
    telemetry, series = played.telemetry, read_io_tsv(played.io_tsv, 7)
    logged = {t.utime_us: t for t in telemetry}
    assert len(series.utime_us) == len(telemetry)
    moving = [t for t in telemetry if t.mode == t.MODE_TABLE]
    rows = dict(zip(series.utime_us.tolist(), series.value.tolist(), strict=True))
    assert len(moving) > 100 and set(rows) == set(logged)
    # The vendor's mixing of the logged move gives the duties that the robot sent.
    assert all(rows[t.utime_us] == list(t.wheel_duty_pct) for t in moving)


@pytest.mark.parametrize(
    "log",
    [
        ("--io-tsv", "/dev/full"),
        ("--io-tsv", "/nowhere/io.tsv"),
        ("--lcm-url", "file:///nowhere/a.lcmlog?mode=w"),
    ],
    ids=["full disk", "no folder", "no folder for LCM"],
)
def test_log_that_cannot_be_written_is_told(tmp_path, log):
    frames = tmp_path / "frames.yuyv"
    frames.write_bytes(GREEN * 30)
    size = ("--set", f"width_px={WIDTH_PX}", "--set", f"height_px={HEIGHT_PX}")
    done = run(
        *("--config", "/dev/null", "--start", "--camera", f"stub:{frames}", "--board", "stub"),
        *("--set", "panel=none", "--set", "rate_Hz=100", "--lcm-url", "", *size, *log),
    )
    assert done.returncode == 4
    assert "rows of a log are lost" in done.stderr


def test_robot_without_its_log_is_on_the_network_and_says_so(tmp_path):
    """Its card is read-only, or has no such folder: it obeys, drives and tells all the same."""
    log, lost = tmp_path / "a.lcmlog", turbopi.telemetry_t.STATUS_LOG_LOST
    options = ("--lcm-url", f"file://{log}?mode=w", "--io-tsv", "/proc/io.tsv")
    with Robot(TURBOPI, tmp_path, "--start", *options) as robot:
        assert robot.wait_for(LEFT)
        robot.process.terminate()
        code, said = robot.end()
    events = [e for e in lcm.EventLog(str(log), "r") if e.channel == "R00_TELEMETRY"]
    flags = [turbopi.telemetry_t.decode(event.data).status_flags for event in events]
    assert code == 4 and "io_tsv: /proc/io.tsv" in said
    assert flags[-1] & lost
    assert all(flag & turbopi.telemetry_t.STATUS_TELLS_START for flag in flags)


LOGS = [("--io-tsv", "{}"), ("--lcm-url", "file://{}?mode=w")]


@pytest.mark.parametrize("option", LOGS, ids=["io.tsv", "LCM log"])
def test_full_disk_takes_whole_rows_and_is_told(tmp_path, option):
    """A file that may not grow stands for the disk: it takes a part of what is written, too."""
    frames, log, limit_bytes = tmp_path / "frames.yuyv", tmp_path / "log", 10_000
    frames.write_bytes(GREEN * 300)
    size = ("--set", f"width_px={WIDTH_PX}", "--set", f"height_px={HEIGHT_PX}")
    done = subprocess.run(
        [
            *(*TURBOPI, "--config", "/dev/null", "--start", "--camera", f"stub:{frames}"),
            *("--board", "stub", "--set", "panel=none", "--set", "rate_Hz=100", "--lcm-url", ""),
            *(*size, *(word.format(log) for word in option)),
        ],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes)),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 4, done.stderr
    assert "rows are lost from here on" in done.stderr and "killed" not in done.stderr
    assert limit_bytes - 7_000 < log.stat().st_size <= limit_bytes
    if option[0] == "--io-tsv":
        assert log.read_bytes().endswith(b")]\n")
    else:
        events = list(lcm.EventLog(str(log), "r"))
        # LCM's own reader takes every byte of it.
        assert sum(28 + len(e.channel) + len(e.data) for e in events) == log.stat().st_size
        assert [e.eventnum for e in events] == list(range(len(events)))


def test_log_outlives_the_driver(tmp_path):
    """All that a driver said that was killed is kept, and the next one goes on in the same log."""
    log = tmp_path / "log"
    options = ("--lcm-url", f"file://{log}?mode=w", "--set", "restart_ms=100")

    def said():
        events = list(lcm.EventLog(str(log), "r")) if log.exists() else []
        return [e.eventnum for e in events if e.channel == "R00_TELEMETRY"]

    with Robot(TURBOPI, tmp_path, "--start", *options) as robot:
        assert wait_until(lambda: len(said()) > 20)
        driver, before = robot.children()[0], len(said())
        os.kill(driver, signal.SIGKILL)
        assert wait_until(lambda: robot.children() not in ([], [driver]))
        assert wait_until(lambda: len(said()) > before + 20)
        # Each counts from 0.
        assert wait_until(lambda: sum(number <= 1 for number in said()) == 2)


def test_systemd_is_told(tmp_path):
    inbox = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    inbox.bind(str(tmp_path / "notify"))
    inbox.settimeout(10)
    env = {"NOTIFY_SOCKET": str(tmp_path / "notify")}
    with Robot(TURBOPI, tmp_path, "--start", env=env) as robot:
        assert inbox.recv(100) == b"READY=1"
        assert inbox.recv(100) == b"WATCHDOG=1"
        robot.process.terminate()
        assert wait_until(lambda: inbox.recv(100) == b"STOPPING=1")


@pytest.fixture(scope="module")
def bus_session(tmp_path_factory):
    """Record of a session in a network of its own: see bus_session.py."""
    script = Path(__file__).with_name("bus_session.py")
    done = subprocess.run(
        [
            "unshare",
            "--map-root-user",
            "--net",
            sys.executable,
            script,
            tmp_path_factory.mktemp("bus"),
            *TURBOPI,
        ],
        capture_output=True,
        text=True,
        timeout=120,
    )
    if "unshare" in done.stderr:
        pytest.skip(f"no network namespace here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_bus_commands_are_obeyed_and_acknowledged(bus_session):
    assert bus_session["stands_before_start"]
    assert bus_session["answers"] == [
        [True, True, ""],
        [False, True, "no behaviour 'dance'"],
        [True, True, ""],
    ]
    # To the instant: the first moving duties come at most one frame and some load later.
    assert 0 <= bus_session["start_delay_s"] < 0.033 + SLACK_S
    assert bus_session["stopped"]


def test_key_that_was_changed_on_the_card_counts_after_sighup(bus_session):
    """Who signs with the old one is told the new one's name; who has the new one arms."""
    old, new = bus_session["armed"]["old key"], bus_session["armed"]["new key"]
    assert old[0] is False and "signed with another key" in old[2]
    assert new[:2] == [True, True]
    assert bus_session["key_name"] in old[2] and bus_session["key_name"] in new[2]


def test_network_that_goes_away_does_not_delay_the_loop(bus_session):
    # 30 frames a second: at 200 ms the core would have stopped the wheels.
    assert bus_session["longest_gap_without_network_s"] < 0.2
    assert bus_session["moved_without_network"]


def test_server_that_never_answers_delays_neither_loop_nor_end(tmp_path):
    server = socket.create_server(("127.0.0.1", 0))
    url = f"tcpq://127.0.0.1:{server.getsockname()[1]}"
    with server, Robot(TURBOPI, tmp_path, "--start", "--lcm-url", url) as robot:
        assert robot.wait_for(LEFT)
        time.sleep(1)
        times_s = [t for t, duties in robot.rows() if duties == LEFT]
        killed_s = time.monotonic()
        robot.process.terminate()
        code, _ = robot.end()
        assert_stopped_since(robot, killed_s, WATCHDOG_S)
    assert code == 0
    assert len(times_s) > 20 and max(np.diff(times_s)) < 0.2


def test_telemetry_comes_back_with_the_network(bus_session):
    assert bus_session["heard_again"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--behavior", "dance"], "must be one of"),
        (["--set", "robot_id=100"], "0..99"),
        (["--set", "behaviors=/nowhere.toml"], "cannot be read"),
        (["--set", "table=1,2,3"], "'milling' must be speed,turn,speed,turn"),
        (["--set", "speed=1"], "is no key"),
        (["--config", "/nowhere.conf"], "cannot be read"),
        (["--board", "parallel"], "must be auto, i2c, uart"),
        (["--script", "/nowhere.csv"], "cannot be read"),
        (["--camera", "stub:/nowhere.yuyv"], "cannot be read"),
        (["--camera", "stub:/dev/null"], "no whole number of YUYV frames of 640x480"),
        (["frames"], "not an option"),
    ],
)
def test_mistakes_get_one_sentence(arguments, words):
    config = [] if "--config" in arguments else ["--config", "/dev/null"]
    done = run(*config, "--board", "stub", "--lcm-url", "", "--set", "restart_ms=-1", *arguments)
    assert done.returncode in (1, 2)
    assert words in done.stderr and done.stdout == ""


def test_tables_of_ones_own_come_from_a_file(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text('# mine\nspin = "0,2,100,0.5"  # to the left\n')
    own = ("--config", "/dev/null", "--set", f"behaviors={path}", "--print-config")
    assert 'table = "0,2,100,0.5"' in run(*own, "--behavior", "spin").stdout
    assert 'table = ""' in run(*own, "--behavior", "orbit").stdout
    assert 'table = "1,1,1,1"' in run(*own, "-b", "spin", "--set", "table=1,1,1,1").stdout
    path.write_text('good = "0,0,0,0"\nbad = "0,2,200,0"\n')
    assert f"{path}, line 2: table 'bad' must be" in run(*own).stderr


def test_help_version_and_config_go_to_stdout(tmp_path):
    assert "usage: turbopi" in run("--help").stdout
    assert run("--version").stdout.startswith("turbopi ")
    printed = run("--config", "/dev/null", "--set", "robot_id=42", "--print-config").stdout
    path = tmp_path / "robot.conf"
    path.write_text(printed)
    assert run("--config", str(path), "--print-config").stdout == printed
    assert "robot_id = 42" in printed
