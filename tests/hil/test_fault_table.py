# SPDX-License-Identifier: Apache-2.0
"""The table of faults in firmware/README.md: how long after each the wheels stand.

The program is that of the Debian package, started by hand or, where HIL_START says "service", by
systemd. Times are the guest kernel's, from the fault to the zero that stays. The camera's frames go
on, or would not be missed for ten seconds, so that it is nothing but the row's fault that stops the
wheels.
"""

import itertools
import os
import signal
import statistics
import time

import pytest
import turbopi
from rig import BUILD, SUITE, SYSTEM_LIMIT_S, ZERO
from robot import LEFT, PROGRAM, SERVICE, SETTINGS, Robot, Service, give_environment

BY_SERVICE = os.environ.get("HIL_START") == "service"
by_hand = pytest.mark.skipif(BY_SERVICE, reason="a service's stderr is the journal's")
by_service = pytest.mark.skipif(not BY_SERVICE, reason="the program was started by hand")

# What the program promises while it or its guard lives. The emulator may be slow: SLACK_S.
LIMIT_S, SLACK_S = 0.5, 0.25
WATCHDOG, PATIENT = ("--set", "watchdog_ms=300"), ("--set", "watchdog_ms=3000")
PRELOAD = ("LD_PRELOAD=/lib/failcalls.so",)
CONTROL, FIRST = "/var/failcalls/which", "/var/failcalls/first"
UNCONFIRMED = turbopi.telemetry_t.STATUS_STOP_UNCONFIRMED
ENODEV, EIO, EMFILE, EREMOTEIO = 19, 5, 24, 121
ALL, BOARD_ANSWERS, SECOND_WHEEL = 255, 0, 0x20
ROLES = ("driver", "parent", "guard")
PARTS = [*itertools.combinations(ROLES, 1), *itertools.combinations(ROLES, 2)]

# (function, ioctl, path, errno): calls that a driving robot makes again and again.
VIDEO, I2C, CHIP, GPIO = "/dev/video", "/dev/i2c", "/dev/gpiochip", "anon_inode:gpio"
CALLS = {
    "camera: VIDIOC_DQBUF": ("ioctl", 0xC0585611, VIDEO, ENODEV),
    "camera: VIDIOC_QBUF": ("ioctl", 0xC058560F, VIDEO, EIO),
    "motor board: read": ("read", 0, I2C, EREMOTEIO),
    "button and lights: ioctl": ("ioctl", 0, GPIO, EIO),
}
# What loses a part; then calls that open it again, while the robot stands, and that close it.
LOSING = {"camera": "camera: VIDIOC_DQBUF", "button and lights": "button and lights: ioctl"}
OPENING = {
    ("camera", "open"): ("open", 0, VIDEO, EIO),
    ("camera", "VIDIOC_QUERYCAP"): ("ioctl", 0x80685600, VIDEO, EIO),
    ("camera", "VIDIOC_ENUM_FMT"): ("ioctl", 0xC0405602, VIDEO, EIO),
    ("camera", "VIDIOC_S_FMT"): ("ioctl", 0xC0D05605, VIDEO, EIO),
    ("camera", "VIDIOC_REQBUFS"): ("ioctl", 0xC0145608, VIDEO, EIO),
    ("camera", "VIDIOC_QUERYBUF"): ("ioctl", 0xC0585609, VIDEO, EIO),
    ("camera", "mmap"): ("mmap", 0, VIDEO, EIO),
    ("camera", "VIDIOC_STREAMON"): ("ioctl", 0x40045612, VIDEO, EIO),
    ("button and lights", "open"): ("open", 0, CHIP, EIO),
    ("button and lights", "ioctl"): ("ioctl", 0, CHIP, EIO),
}
CLOSING = {
    ("camera", "VIDIOC_STREAMOFF"): ("ioctl", 0x40045613, VIDEO, EIO),
    ("camera", "munmap"): ("munmap", 0, "-", EIO),
    ("camera", "close"): ("close", 0, VIDEO, EIO),
    ("button and lights", "close"): ("close", 0, GPIO, EIO),
}
OPENING_BOARD = {"open": ("open", 0, I2C, EMFILE), "I2C_SLAVE": ("ioctl", 0x0703, I2C, EIO)}


@pytest.fixture(scope="module")
def table():
    """Rows of the table, by the order of the tests; written at the end."""
    rows: dict[str, str] = {}
    yield rows
    text = "| fault | wheels stand after |\n|---|---|\n"
    text += "".join(f"| {fault} | {after} |\n" for fault, after in rows.items())
    (BUILD / f"faults_by_{'service' if BY_SERVICE else 'hand'}.{SUITE}.md").write_text(text)
    print("\n" + text)


@pytest.fixture(scope="module")
def guest(request):
    """Guest that the program runs in."""
    guest = request.getfixturevalue("installed" if BY_SERVICE else "rig")
    yield guest
    if BY_SERVICE:
        give_environment(guest, ())


def start(guest, *arguments, **options):
    """A robot that was told to drive."""
    if BY_SERVICE:
        return Service(guest, *arguments, **options)
    return Robot(guest, "--start", *arguments, **options)


@pytest.fixture
def drive(guest):
    """Makes a robot that turns left and does not miss a frame for ten seconds."""
    robots = []

    def make(*arguments, **options):
        patience = ("--set", "frame_timeout_ms=10000", *WATCHDOG)
        robot = start(guest, *patience, *arguments, **options)
        robots.append(robot)
        robot.drive_until(LEFT)
        # Whoever watches is up.
        guest.wait(lambda: guest.words("d", robot.pid, "wheelguard")[0] > 0, what="the guard")
        return robot

    yield make
    guest.words("w", CONTROL, "")
    guest.mend()
    for robot in robots:
        end_all(guest, robot)
    assert guest.duties[-1].wire == ZERO


def end_all(guest, robot):
    """Ends what is left of a robot, and its wheels."""
    if BY_SERVICE:
        guest.systemctl("stop", SERVICE)
        return
    if robot.pid not in guest.ends:
        guest.words("k", int(signal.SIGCONT), robot.pid)
        guest.words("k", int(signal.SIGTERM), robot.pid)
        robot.wait_for_end()
    guest.run(PROGRAM, *SETTINGS, "--stop")


def stands_after(robot, fault_s, *, frames=False):
    """Waits for four zeros that stay a second. Returns how long after the fault they came."""
    guest = robot.rig
    pump = robot.show_until if frames else guest.wait
    pump(lambda: robot.wire() == ZERO)
    end_s = time.monotonic() + 1.0
    pump(lambda: time.monotonic() > end_s)
    assert robot.wire() == ZERO
    return robot.stopped_s(fault_s) - fault_s


def fail(guest, *calls, pid=0):
    """Makes calls fail from now on."""
    guest.words("n", FIRST)
    guest.words("w", CONTROL, "".join("{} {} {} {} {}\n".format(*call, pid) for call in calls))


def failed_s(guest):
    """When the first of them did (guest, s)."""
    t_ns = -1
    end_s = time.monotonic() + 30
    while t_ns < 0 and time.monotonic() < end_s:
        guest.pump(0.05)
        t_ns, _ = guest.words("n", FIRST)
    assert t_ns > 0
    return t_ns / 1e9


def note(table, fault, after_s):
    table[fault] = f"{after_s:.2f} s"
    assert after_s < LIMIT_S + SLACK_S


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize("roles", PARTS, ids="+".join)
def test_processes(drive, table, roles, number):
    robot = drive("--set", "restart_ms=-1")
    pids = {"driver": robot.driver(), "parent": robot.pid, "guard": robot.guard()}
    fault_s = robot.rig.kill(number, *(pids[role] for role in roles))
    what = "killed" if number == signal.SIGKILL else "stopped (SIGSTOP)"
    if roles == ("guard",) and number == signal.SIGKILL:
        robot.rig.wait(lambda: robot.rig.words("d", robot.pid, "wheelguard")[0] > 0)
        table[f"guard {what}"] = "drives on: another guard is started"
        return
    note(table, f"{' and '.join(roles)} {what}", stands_after(robot, fault_s))


def work_us(robot):
    """The middle of what a step of a driving robot takes, by its own clock."""
    end = len(robot.telemetry()) + 30
    robot.show_until(lambda: len(robot.telemetry()) >= end)
    return statistics.median(t.loop_us for t in robot.telemetry()[-30:])


@by_hand
def test_what_the_robot_works_takes_no_longer_on_a_machine_that_is_busy(guest, drive):
    """Times in this table are the robot's: as many instructions are as long, however emulated."""
    robot = drive()
    usual_us = work_us(robot)
    with guest.slowed():
        slowed_us = work_us(robot)
    print(f"hil: a step works {usual_us:.0f} us, {slowed_us:.0f} us on a busy machine")
    assert slowed_us < 2 * usual_us


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGTSTP])
def test_signals(drive, table, number):
    robot = drive()
    fault_s = robot.rig.kill(number, robot.pid)
    names = {"SIGINT": "SIGINT (Ctrl-C)", "SIGTSTP": "SIGTSTP (Ctrl-Z)"}
    after_s = stands_after(robot, fault_s)
    note(table, f"{names.get(number.name, number.name)} to the program", after_s)


def test_call_that_nothing_ends(guest, drive, table):
    """The driver hangs for five seconds in the kernel, where SIGKILL does not reach it."""
    robot = drive("--set", "restart_ms=-1")
    _, fault_s = guest.call("b", b"H" + bytes([50]))
    note(table, "driver hangs in a call that cannot be killed", stands_after(robot, fault_s))


@by_hand
@pytest.mark.parametrize("fault", ["driver killed", "driver stopped (SIGSTOP)", "camera frozen"])
def test_messages_that_nobody_reads(guest, drive, table, fault):
    timeout = ("--set", "frame_timeout_ms=200") if fault == "camera frozen" else ()
    robot = drive("--set", "restart_ms=60000", *timeout, heard=False)
    if fault == "camera frozen":
        fault_s = robot.show(robot.view)
    else:
        number = signal.SIGKILL if "killed" in fault else signal.SIGSTOP
        fault_s = guest.kill(number, robot.driver())
    note(table, f"{fault}, stderr full and unread", stands_after(robot, fault_s))


@pytest.mark.parametrize("call", CALLS)
def test_call_fails(guest, drive, table, call):
    robot = drive(environment=PRELOAD)
    fail(guest, CALLS[call])
    robot.show_until(lambda: robot.wire() == ZERO)
    note(table, f"{call} fails", stands_after(robot, failed_s(guest), frames=True))
    guest.words("w", CONTROL, "")
    robot.drive_until(LEFT)


def test_only_the_driver_cannot_reach_the_board(guest, drive, table):
    robot = drive(*PATIENT, environment=PRELOAD)
    fail(guest, ("write", 0, I2C, EREMOTEIO), pid=robot.driver())
    robot.show_until(lambda: robot.wire() == ZERO)
    after_s = stands_after(robot, failed_s(guest), frames=True)
    note(table, "motor board: write fails, in the driver", after_s)


@pytest.mark.parametrize("call", OPENING_BOARD)
def test_nobody_can_open_the_board_again(guest, drive, table, call):
    robot = drive("--set", "restart_ms=-1", *PATIENT, environment=PRELOAD)
    fail(guest, OPENING_BOARD[call])
    fault_s = guest.kill(signal.SIGKILL, robot.driver())
    note(table, f"motor board: {call} fails, driver killed", stands_after(robot, fault_s))


@pytest.mark.parametrize(("part", "call"), OPENING)
def test_part_cannot_be_opened_again(guest, drive, table, part, call):
    robot = drive(environment=PRELOAD)
    fail(guest, CALLS[LOSING[part]])
    robot.show_until(lambda: robot.wire() == ZERO)
    fault_s = failed_s(guest)
    fail(guest, OPENING[part, call])
    note(table, f"{part} lost, then {call} fails", stands_after(robot, fault_s, frames=True))
    guest.words("w", CONTROL, "")
    robot.drive_until(LEFT)


@pytest.mark.parametrize(("part", "call"), CLOSING)
def test_part_that_is_lost_cannot_be_closed(guest, drive, table, part, call):
    robot = drive(environment=PRELOAD)
    fail(guest, CALLS[LOSING[part]], CLOSING[part, call])
    robot.show_until(lambda: robot.wire() == ZERO)
    note(table, f"{part}: {call} fails, too", stands_after(robot, failed_s(guest), frames=True))
    guest.words("w", CONTROL, "")
    robot.drive_until(LEFT)


def test_write_that_is_torn(guest, drive, table):
    """The second wheel's register refuses: the first has its duty already."""
    end_all(guest, drive("--set", "restart_ms=-1"))
    fault_s = guest.duties[-1].t_s

    def refuse():
        guest.call("b", b"B" + bytes([SECOND_WHEEL]))

    torn = start(guest, "--set", "frame_timeout_ms=10000", *PATIENT, fault=refuse)
    torn.show_until(lambda: torn.has(UNCONFIRMED))
    assert torn.telemetry()[-1].mode == torn.telemetry()[-1].MODE_FAULT
    assert {d.wire for d in torn.since(fault_s)} <= {ZERO}
    table["one wheel's register refuses"] = "never starts, and says so"
    # Mended, it may drive, until it is ended.
    guest.mend()
    end_all(guest, torn)


def test_board_refuses_everything(guest, drive, table):
    """No program can mend that; it says so, and the first that the board hears is a stop."""
    robot = drive(*PATIENT)
    guest.board(b"N", ALL)
    robot.show_until(lambda: robot.has(UNCONFIRMED))
    said = robot.telemetry()[-1]
    assert said.mode == said.MODE_FAULT and tuple(map(abs, said.wheel_duty_pct)) != ZERO
    _, answers_s = guest.call("b", b"N" + bytes([BOARD_ANSWERS]))
    # After the stop it drives on.
    robot.show_until(lambda: ZERO in [d.wire for d in robot.since(answers_s)])
    after_s = min(d.t_s for d in robot.since(answers_s) if d.wire == ZERO) - answers_s
    table["motor board refuses all"] = f"{after_s:.2f} s after it answers again"
    assert after_s < LIMIT_S + SLACK_S


@by_hand
def test_all_three_are_killed(guest, drive, table):
    robot = drive(*PATIENT)
    pids = robot.guard(), robot.pid, robot.driver()
    guest.kill(signal.SIGSTOP, *pids)
    guest.kill(signal.SIGKILL, *pids)
    robot.wait_for_end()
    assert robot.wire() == LEFT
    guest.words("w", "/tmp/garbage.conf", "speed = much\n= =\n[\n")
    pid = guest.start(PROGRAM, "--config", "/tmp/garbage.conf", "--stop")
    begin_s = guest.duties[-1].t_s
    guest.wait(lambda: robot.wire() == ZERO)
    guest.wait(lambda: pid in guest.ends)
    stop_s = min(d.t_s for d in robot.since(begin_s) if d.wire == ZERO)
    took_s = guest.ends[pid].t_s - stop_s
    assert guest.ends[pid].code == 0, took_s
    table["all three killed"] = "only `turbopi --stop` or systemd, see below"


@by_service
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_all_three_of_the_service(guest, drive, table, number):
    """Nobody of the program is left: systemd's own doing, which has no limit of ours."""
    robot = drive(*PATIENT)
    pids = robot.guard(), robot.driver(), robot.pid
    fault_s = guest.kill(number, *pids)
    guest.wait(lambda: robot.wire() == ZERO, SYSTEM_LIMIT_S)
    what = "killed" if number == signal.SIGKILL else "stopped (SIGSTOP)"
    table[f"all three {what}"] = f"{stands_after(robot, fault_s):.2f} s"


@by_service
@pytest.mark.parametrize("ending", ["stop", "restart"])
def test_service_ends(guest, drive, table, ending):
    robot = drive()
    pid, begin_s = guest.words("x", "/bin/systemctl", ending, SERVICE)
    guest.wait(lambda: pid in guest.ends, SYSTEM_LIMIT_S)
    after_s = stands_after(robot, begin_s)
    table[f"`systemctl {ending}`, its own start included"] = f"{after_s:.2f} s"
