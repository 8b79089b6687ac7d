# SPDX-License-Identifier: Apache-2.0
"""firmware/app: the wheels stand, whatever happens to the program, its configuration or its reader.

Each fault has a limit from the moment it happens to the zero that the board keeps.
"""

import contextlib
import fcntl
import itertools
import os
import pty
import resource
import select
import shlex
import signal
import socket
import struct
import subprocess
import time
from pathlib import Path

import pytest
from robot_process import LEFT, ZERO, Robot, full_pipe, wait_until

TURBOPI = shlex.split(os.environ.get("TURBOPI", ""))
pytestmark = pytest.mark.skipif(not TURBOPI, reason="TURBOPI does not name the program")

TIOCSPTLCK, TIOCGPTN = 0x40045431, 0x80045430  # of a pseudo terminal, <asm-generic/ioctls.h>

# The program's promise, and what a machine that is busy with other tests may add.
LIMIT_S, SLACK_S = 0.5, 1.0


def stop(*arguments, **options):
    """`turbopi --stop`."""
    command = [*TURBOPI, "--stop", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, **options)


def stands_for_good(robot, since_s):
    """Waits for zero, and that it stays. Returns how long after since_s the last move came."""
    assert robot.wait_for(ZERO), robot.rows()[-3:]
    time.sleep(0.3)
    moves_s = [t for t, duties in robot.rows() if duties != ZERO]
    zeros_s = [t for t, duties in robot.rows() if t > moves_s[-1]]
    assert robot.duties() == ZERO
    return zeros_s[0] - since_s


@pytest.fixture
def driving(tmp_path):
    """A robot that turns left, and would drive on for ten seconds without a frame."""
    patience = ("--set", "frame_timeout_ms=10000", "--set", "restart_ms=-1")
    with Robot(TURBOPI, tmp_path, "--start", *patience) as robot:
        assert robot.wait_for(LEFT)
        # Whoever watches is up, too.
        assert wait_until(robot.guards)
        yield robot


def processes(robot):
    """The three that can stop the wheels."""
    return {"driver": robot.children()[0], "parent": robot.process.pid, "guard": robot.guards()[0]}


def kill(number, *pids):
    """Signals each that still runs: one that saw another end may have stopped the board already."""
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


ROLES = ("driver", "parent", "guard")
SOME = [*itertools.combinations(ROLES, 1), *itertools.combinations(ROLES, 2)]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
@pytest.mark.parametrize("roles", SOME, ids="+".join)
def test_whoever_is_left_stops_the_wheels(driving, roles, number):
    pids = processes(driving)
    begin_s = time.monotonic()
    kill(number, *(pids[role] for role in roles))
    if roles == ("guard",) and number == signal.SIGKILL:
        # The parent starts another: nothing is lost for long.
        assert wait_until(lambda: driving.guards() not in ([], [pids["guard"]]))
        return
    assert stands_for_good(driving, begin_s) < LIMIT_S + SLACK_S


@pytest.mark.parametrize("killed", [("driver",), ("driver", "parent"), ("driver", "guard")])
def test_a_stop_needs_no_file_that_cannot_be_opened(driving, killed):
    """As where the kernel has no more of them: whoever may have to stop the board has it open."""
    pids = processes(driving)
    for pid in pids.values():
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (3, 3))
    begin_s = time.monotonic()
    kill(signal.SIGKILL, *(pids[role] for role in killed))
    assert stands_for_good(driving, begin_s) < LIMIT_S + SLACK_S


def holds(pid, path):
    """It has this file open."""
    opened = []
    for fd in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            opened.append(os.readlink(fd))
    return str(path) in opened


def test_a_driver_that_cannot_write_is_helped_and_a_lost_board_let_go(driving):
    """The unplugged board gets its name back only when nobody has it open any more."""
    pids = processes(driving)
    assert wait_until(lambda: all(holds(pid, driving.record) for pid in pids.values()))
    begin_s = time.monotonic()
    resource.prlimit(pids["driver"], resource.RLIMIT_FSIZE, (0, 0))
    assert stands_for_good(driving, begin_s) < LIMIT_S + SLACK_S
    assert wait_until(lambda: not holds(pids["guard"], driving.record))


def has_ended(pid):
    """It is gone, or is there only until its parent takes notice."""
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or ") Z " in stat.read_text()


def test_a_driver_that_has_ended_first_leaves_the_others_of_the_terminal_alone(tmp_path):
    """Asked to end, the parent finds the driver dead: it asks nobody else."""
    beside = f'(sleep 60 2>/dev/null & echo $! >{tmp_path}/beside); exec "$@"'
    program = ["sh", "-c", beside, "sh", *TURBOPI]
    with Robot(program, tmp_path, "--start") as robot:
        assert robot.wait_for(LEFT)
        parent, driver = robot.process.pid, robot.children()[0]
        os.kill(parent, signal.SIGSTOP)
        os.kill(driver, signal.SIGKILL)
        assert wait_until(lambda: has_ended(driver))
        os.kill(parent, signal.SIGTERM)
        os.kill(parent, signal.SIGCONT)
        code, _ = robot.end()
    beside = int((tmp_path / "beside").read_text())
    assert code == 0 and robot.duties() == ZERO and not has_ended(beside)
    os.kill(beside, signal.SIGKILL)


def test_killall_leaves_the_guard(driving):
    pids = processes(driving)
    names = {role: Path(f"/proc/{pid}/comm").read_text() for role, pid in pids.items()}
    assert names["driver"] == names["parent"] != names["guard"]
    command = Path(f"/proc/{driving.guards()[0]}/cmdline").read_text()
    assert "turbopi" not in command


@pytest.mark.parametrize("number", [signal.SIGTSTP, signal.SIGQUIT, signal.SIGUSR1])
def test_keys_of_a_terminal_leave_no_wheel_turning(driving, number):
    begin_s = time.monotonic()
    kill(number, driving.process.pid, *driving.children())
    if number == signal.SIGUSR1:  # nothing that asks it to end
        time.sleep(0.3)
        assert driving.wait_for(LEFT)  # a frame that came late may have stopped it for a moment
        return
    code, said = driving.end()
    assert code == 0
    assert stands_for_good(driving, begin_s) < LIMIT_S + SLACK_S
    assert "guard" not in said  # nothing hung, at the start as little as later
    assert ("not suspended" in said) == (number in (signal.SIGTSTP, signal.SIGQUIT))


@pytest.fixture
def unheard(tmp_path):
    """A robot that drives, and whose stderr nobody reads."""
    read_end, write_end = full_pipe()
    patience = ("--set", "restart_ms=100")
    robot = Robot(TURBOPI, tmp_path, "--start", *patience, stderr=write_end)
    with robot:
        assert robot.wait_for(LEFT)
        yield robot
    os.close(write_end)
    os.close(read_end)


def test_unread_messages_do_not_keep_a_lost_camera_from_stopping(unheard):
    begin_s = time.monotonic()
    unheard.camera.unplug()
    assert stands_for_good(unheard, begin_s) < LIMIT_S + SLACK_S
    unheard.camera.plug()


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_unread_messages_do_not_keep_a_dead_driver_from_being_stopped(unheard, number):
    begin_s = time.monotonic()
    driver = unheard.children()[0]
    os.kill(driver, number)
    assert wait_until(lambda: any(t > begin_s and d == ZERO for t, d in unheard.rows()))
    zero_s = next(t for t, d in unheard.rows() if t > begin_s and d == ZERO)
    assert zero_s - begin_s < LIMIT_S + SLACK_S
    assert wait_until(lambda: unheard.children() not in ([], [driver]))


@pytest.mark.parametrize("closed", ["2>&-", "0<&- 2>&-", "0<&- 1>&- 2>&-"])
def test_messages_go_to_no_device_that_was_opened_as_number_2(tmp_path, closed):
    """Started without the three files of a terminal, it would give their numbers to devices."""
    program = ["sh", "-c", f'exec "$@" {closed}', "sh", *TURBOPI]
    with Robot(program, tmp_path, "--start") as robot:
        assert robot.wait_for(LEFT) and wait_until(robot.guards)
        for pid in (robot.process.pid, *robot.children(), *robot.guards()):
            targets = [os.readlink(f"/proc/{pid}/fd/{number}") for number in range(3)]
            assert targets[2].startswith("pipe:"), targets  # to who passes messages on
            assert not any(target.startswith("socket:") for target in targets), targets


@pytest.mark.parametrize("reader", [True, False], ids=["full", "without a reader"])
def test_log_that_is_a_pipe_keeps_nobody_waiting(tmp_path, reader):
    os.mkfifo(tmp_path / "pipe")
    pipe = os.open(tmp_path / "pipe", os.O_RDWR | os.O_NONBLOCK) if reader else -1
    with contextlib.suppress(BlockingIOError):
        while reader:
            os.write(pipe, b"x" * 4096)
    with Robot(TURBOPI, tmp_path, "--start", "--io-tsv", str(tmp_path / "pipe")) as robot:
        assert robot.wait_for(LEFT)
        robot.process.terminate()
        code, said = robot.end()
    assert "io_tsv" in said and code == 4


def test_unread_messages_do_not_keep_it_from_ending(unheard):
    unheard.process.terminate()
    assert unheard.process.wait(timeout=10) == 0
    assert unheard.duties() == ZERO


WRONG = {
    "garbage": b"\x00\xff garbage \n" * 50,
    "typo": b"behaviour = milling\n",
    "unknown behaviour": b"behavior = dance\n",
    "no table file": b"behaviors = /nowhere.toml\n",
    "bad value": b"watchdog_ms = never\n",
}


@pytest.fixture(scope="module")
def stops(tmp_path_factory):
    """`turbopi --stop` with each wrong configuration, at once: each looks for boards."""
    folder, started = tmp_path_factory.mktemp("stops"), {}
    for name, text in WRONG.items():
        record, config = folder / f"{name}.csv", folder / f"{name}.conf"
        config.write_bytes(f"board = stub:{record}\n".encode() + text)
        command = [*TURBOPI, "--stop", "--config", str(config)]
        started[name] = record, subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    yield started
    for _, process in started.values():
        process.kill()
        process.communicate()


@pytest.mark.parametrize("what", WRONG)
def test_stop_needs_no_configuration(stops, what):
    record, process = stops[what]
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert record.read_text().endswith(",0,0,0,0\n")
    assert f"{record}: zero to all wheels, confirmed" in said


# A folder /dev of its own, in which two pseudo terminals have the names of lines.
OWN_DEV = """
mount -t tmpfs none "$1" && mkdir "$1/pts" && mount --bind /dev/pts "$1/pts" && touch "$1/null" &&
mount --bind /dev/null "$1/null" && ln -s "pts/$2" "$1/ttyAMA0" && ln -s "pts/$3" "$1/ttyUSB0" &&
mount --rbind "$1" /dev && shift 3 && exec "$@"
"""


def unopened_line():
    """A pseudo terminal whose far end nobody has opened: its near end and its number."""
    near = os.open("/dev/ptmx", os.O_RDWR | os.O_NOCTTY)
    fcntl.ioctl(near, TIOCSPTLCK, struct.pack("i", 0))
    (number,) = struct.unpack("i", fcntl.ioctl(near, TIOCGPTN, bytes(4)))
    return near, number


def was_opened(near):
    """Linux says that the far end hung up once somebody has opened and closed it."""
    line = select.poll()
    line.register(near, 0)
    return any(event & select.POLLHUP for _, event in line.poll(0))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount")
@pytest.mark.parametrize("confirms", [True, False], ids=["its board confirms", "none does"])
def test_what_hangs_on_usb_is_opened_only_if_no_board_confirms(tmp_path, confirms):
    """Opening alone resets some devices: with a wrong configuration, too, its own are asked."""
    (tmp_path / "dev").mkdir()
    (own, own_number), (usb, usb_number) = unopened_line(), unopened_line()
    board = f"stub:{tmp_path}/board.csv" if confirms else "uart"
    (tmp_path / "conf").write_text(
        f"board = {board}\nuart_device = /nowhere\nbehaviour = milling\n"
    )
    command = ["unshare", "--mount", "sh", "-c", OWN_DEV, "sh", str(tmp_path / "dev")]
    command += [str(own_number), str(usb_number)]
    done = subprocess.run(
        [*command, *TURBOPI, "--stop", "--config", str(tmp_path / "conf")],
        capture_output=True,
        text=True,
        timeout=60,
    )
    if "unshare: " in done.stderr or "mount: " in done.stderr:
        pytest.skip(f"no mounts here: {done.stderr.strip()}")
    assert done.returncode == (0 if confirms else 1), done.stderr
    assert was_opened(own) and was_opened(usb) == (not confirms)
    os.close(own)
    os.close(usb)


def test_stop_waits_for_no_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    record = tmp_path / "board.csv"
    assert stop("--config", str(tmp_path / "pipe"), "--board", f"stub:{record}").returncode == 0
    assert record.read_text().endswith(",0,0,0,0\n")


def test_stop_ends_the_program_that_drives(driving):
    """The other program's last words may follow the first zero: a zero comes after its end."""
    done = stop("--config", "/dev/null", "--board", f"stub:{driving.record}")
    rows_at_end = driving.rows()
    code, _ = driving.end()
    assert done.returncode == code == 0 and driving.duties() == ZERO
    assert driving.rows() == rows_at_end
    assert done.stderr.count("zero to all wheels, confirmed") == 1


def test_a_line_that_opens_is_no_board():
    """A pseudo terminal takes every byte, and answers none, whether it was named or not."""
    lines, stops = [pty.openpty() for _ in range(2)], []
    for (_, line), options in zip(lines, ([], ["--board", "uart"]), strict=True):
        named = ("--set", f"uart_device={os.ttyname(line)}", "--set", "i2c_device=/nowhere")
        command = [*TURBOPI, "--stop", "--config", "/dev/null", *named, *options]
        stops.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
    for process in stops:
        _, said = process.communicate(timeout=60)
        assert process.returncode == 1
        assert "NOT CONFIRMED" in said and "SWITCH" in said.upper()
    for fds in lines:
        for fd in fds:
            os.close(fd)


def test_a_board_is_found_by_its_answer(tmp_path):
    board, line = pty.openpty()
    command = [*TURBOPI, "--config", "/dev/null", "--lcm-url", "", "--set", "panel=none"]
    named = ("--set", f"uart_device={os.ttyname(line)}", "--set", "i2c_device=/nowhere")
    silent = subprocess.run(
        [*command, *named, "--set", "restart_ms=-1"], capture_output=True, text=True, timeout=30
    )
    assert silent.returncode == 1 and "none is heard" in silent.stderr
    os.close(board)
    os.close(line)


def test_one_program_has_the_board(driving, tmp_path):
    """The second says who has it, and moves nothing; --stop for it leaves the first alone."""
    before = len(driving.rows())
    second = [*TURBOPI, "--config", "/dev/null", "--start", "--board", f"stub:{driving.record}"]
    done = subprocess.run(
        [*second, "--lcm-url", "", "--set", "panel=none", "--camera", "stub:unix:/nowhere"],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 3
    assert f"turbopi (pid {driving.process.pid}" in done.stderr and "has it" in done.stderr
    refused = {"SERVICE_RESULT": "exit-code", "EXIT_CODE": "exited", "EXIT_STATUS": "3"}
    board = ("--config", "/dev/null", "--board", f"stub:{driving.record}")
    assert stop(*board, env={**os.environ, **refused}).returncode == 0
    assert {duties for _, duties in driving.rows()[before:]} == {LEFT}
    assert driving.process.poll() is None


def test_parent_that_waits_for_a_board_can_be_ended(tmp_path):
    inbox = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    inbox.bind(str(tmp_path / "notify"))
    inbox.settimeout(10)
    nowhere = ("--set", "i2c_device=/nowhere", "--set", "uart_device=/nowhere")
    process = subprocess.Popen(
        [*TURBOPI, "--config", "/dev/null", *nowhere, "--lcm-url", ""],
        env={**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify")},
        stderr=subprocess.PIPE,
    )
    assert inbox.recv(100) == b"READY=1"
    process.terminate()
    _, said = process.communicate(timeout=10)
    assert process.returncode == 0 and b"none answers at /nowhere" in said
