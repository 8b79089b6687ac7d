# SPDX-License-Identifier: Apache-2.0
"""Faults on the operator's side: what the tool says, its exit code, and when the wheels stand.

Usage: told_session.py FOLDER FAULT..., in a network of its own, with TURBOPI set. Two robots
drive, held by `twinmill swarm start` at a terminal of its own, and then the fault happens. Prints a
row for each as JSON.
"""

import fcntl
import json
import os
import pty
import re
import resource
import select
import shlex
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import turbopi
from keyring import operator_key, robot_options
from link_session import Machine
from robot_process import ZERO, Robot, wait_until

from twinmill.data.bus import UdpBus
from twinmill.robots import tell
from twinmill.robots.fleet import GONE_S, URL, Fleet

IDS = (1, 2)
COMMAND = "import sys; from twinmill_cli.main import main; sys.argv[0] = 'twinmill'; main()"
# This computer's clock is set wrong, as the command sees it.
CLOCK = (
    "import time; now, now_ns = time.time, time.time_ns; "
    "time.time, time.time_ns = lambda: now() + {0}, lambda: now_ns() + {0} * 10**9; "
)
# All that others say comes late.
LATE = "import late_network; late_network.begin({0}); "
LATE_S = 0.2
CTRL_C, CTRL_S, CTRL_V, CTRL_Z = b"\x03", b"\x13", b"\x16", b"\x1a"
PASTE = 5000 * b"\n"  # a terminal has room for 4096 bytes
LINK_TIMEOUT_S = 2.0
FRAME_TIMEOUT_S = 10  # the most that a robot can have
TRIES = 3  # to start
SCRIPT_S = 2.0
STAYS_S = 0.5  # a robot that was stopped
SIGNALLED = 128  # and the number of the signal by which a program ended, in a shell
HELD = "they stop by themselves"  # said once robots drive
AT_THE_INSTANT_S = 0.3  # before it: who falls silent then is not missed before it
HALTED_S = 0.5  # in which the held table wants to be drawn twice
FEW_FILES = 5  # below, Python itself does not begin
BUS_PORT = f":{7667:04X} "  # as /proc/net/udp has it
OTHER_HANDLERS = {**os.environ, "PYTHONFAULTHANDLER": "1"}
START = ("start", "--arm", "--robots", "1,2")
LONG_S = "15"  # a countdown that what is done in it ends, however slow this machine is
LONGER_S = "30"


class Operator:
    """`twinmill swarm` as a process: at a terminal of its own, which can be halted, or on pipes."""

    def __init__(
        self,
        key: Path | None,
        *words: str,
        terminal: bool = True,
        clock_ahead_s: int = 0,
        elsewhere: bool = False,
        late_s: float = 0.0,
        **options,
    ):
        program = (CLOCK.format(clock_ahead_s) if clock_ahead_s else "") + COMMAND
        program = (LATE.format(late_s) if late_s else "") + program
        command = [sys.executable, "-c", program, "swarm", *words]
        command += ["--key", str(key)] if key else []
        if elsewhere:  # a computer without any network
            command = ["unshare", "--net", *command]
        self.said = ""
        self.keyboard, self._closed = None, False
        if terminal:
            self.keyboard, far = pty.openpty()
            fcntl.ioctl(far, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 160, 0, 0))
            options = {"stdin": far, "stdout": far, "stderr": far}
            command = ["setsid", "--ctty", *command]
        else:
            options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, **options}
        self.process = subprocess.Popen(command, **options)
        if terminal:
            os.close(far)
        self._ear = self.keyboard if terminal else self.process.stdout
        self._reader = threading.Thread(target=self._read, daemon=True)
        if self._ear:
            self._reader.start()

    def _read(self):
        fd = self._ear if isinstance(self._ear, int) else self._ear.fileno()
        while not self._closed:
            try:
                if select.select([fd], [], [], 0.05)[0]:
                    data = os.read(fd, 65536)
                    if not data:
                        return
                    self.said += data.decode(errors="replace")
            except OSError:  # the other end is closed
                return

    def type(self, keys: bytes) -> None:
        os.write(self.keyboard, keys)

    def hang_up(self) -> None:
        """The terminal is gone."""
        self._closed = True
        self._reader.join()
        os.close(self.keyboard)

    def end(self, timeout_s: float = 20) -> int:
        """The exit code, as a shell has it."""
        code = self.process.wait(timeout_s)
        code = code if code >= 0 else SIGNALLED - code
        if self._ear and not self._closed:
            self._reader.join(2)
        return code

    @property
    def has_ended(self) -> bool:
        """As where a start is called off: on a busy machine robots may acknowledge too late."""
        return self.process.poll() is not None

    @property
    def plain(self) -> str:
        """All that was said, without the codes that move a cursor."""
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self.said)


class Field:
    """Two robots, their operator's key, and what each fault makes of them."""

    def __init__(self, folder: Path, stack: ExitStack):
        self.folder, self.stack = folder, stack
        self.key_file, self.key = operator_key(folder)
        self.robots = {i: self.robot(i, str(i)) for i in IDS}
        self.operator: Operator | None = None

    def robot(
        self, robot_id: int, name: str, machine: Machine | None = None, settings: tuple = ()
    ) -> Robot:
        (self.folder / name).mkdir()
        words = ["--lcm-url", URL, *robot_options(self.folder, robot_id), *settings]
        # Frames are not missed for ten seconds: it is the fault alone that stops the wheels.
        words += ["--set", "restart_ms=100"]
        words += ["--set", f"frame_timeout_ms={1000 * FRAME_TIMEOUT_S}"]
        # Its own file has no say in how long it drives on without its operator.
        words += ["--set", "link_timeout_ms=0"]
        program = [*(machine.enter if machine else []), *shlex.split(os.environ["TURBOPI"])]
        return self.stack.enter_context(Robot(program, self.folder / name, *words))

    def start(self, *words: str, **options) -> Operator:
        """Robots drive, held."""
        for _ in range(TRIES):
            self.operator = Operator(self.key_file, *START, *words, **options)
            if self.begins(time.monotonic()):
                return self.operator
        raise RuntimeError(f"the robots did not start: {self.operator.plain}")

    def begins(self, begin_s: float) -> bool:
        """Waits until all have moved; False if the start was called off."""
        wait_until(lambda: self.operator.has_ended or self.drive_since(begin_s), 30)
        return not self.operator.has_ended

    def drive_since(self, begin_s: float) -> bool:
        """All have moved."""
        return all(self.moved(i, begin_s) for i in IDS)

    def held(self, **options) -> Operator:
        """Operator who holds the robots, and was told so."""
        operator = self.start(**options)
        if not wait_until(lambda: HELD in operator.plain, 10):
            raise RuntimeError(operator.plain)
        time.sleep(0.3)
        return operator

    def moved(self, robot_id: int, since_s: float) -> bool:
        return any(t > since_s and d != ZERO for t, d in self.robots[robot_id].rows())

    def stood_after(self, fault_s: float, robots=IDS) -> float:
        """How long after the fault the last of them got the zero that stayed."""
        last_s = fault_s
        for i in robots:
            rows = self.robots[i].rows()
            moves_s = [t for t, duties in rows if duties != ZERO]
            zeros_s = [t for t, duties in rows if t > moves_s[-1] and duties == ZERO]
            last_s = max(last_s, zeros_s[0] if zeros_s else float("inf"))
        return last_s - fault_s

    def last_move_s(self, robot_id: int) -> float:
        return max(t for t, duties in self.robots[robot_id].rows() if duties != ZERO)

    def row(self, fault_s: float, code: int, robots=IDS) -> dict:
        """Once the robots have stood for so long that they will not drive again."""
        wait_until(lambda: all(self.last_move_s(i) < time.monotonic() - STAYS_S for i in robots))
        said = [line.strip() for line in self.operator.plain.replace("\r", "\n").splitlines()]
        return {
            "said": [line for line in said if line],
            "code": code,
            "after_s": self.stood_after(fault_s, robots),
        }

    # -- the faults: each gives its row -----------------------------------------------------------

    def ctrl_c(self) -> dict:
        operator = self.held()
        fault_s = time.monotonic()
        operator.type(CTRL_C)
        return self.row(fault_s, operator.end())

    def ctrl_v_and_ctrl_c(self) -> dict:
        return self._typed_before(CTRL_V)

    def paste_and_ctrl_c(self) -> dict:
        return self._typed_before(PASTE)

    def _typed_before(self, keys: bytes) -> dict:
        operator = self.held()
        operator.type(keys)
        fault_s = time.monotonic()
        operator.type(CTRL_C)
        return self.row(fault_s, operator.end())

    def ctrl_c_at_the_first_move(self) -> dict:
        operator = self.start()
        fault_s = time.monotonic()
        operator.type(CTRL_C)
        return self.row(fault_s, operator.end())

    def ctrl_c_and_one_is_gone(self) -> dict:
        """The end says what it waits for; who does not want to wait on presses the key again."""
        operator = self.held(terminal=False)
        self.robots[2].process.kill()
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        wait_until(lambda: "waiting up to" in operator.plain, 5)
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end(), [1]) | {"ended_s": time.monotonic() - fault_s}
        self.robots[2] = self.robot(2, "2 after Ctrl-C")
        time.sleep(1)
        return row

    def ctrl_c_five_times(self) -> dict:
        operator = self.held()
        fault_s = time.monotonic()
        for _ in range(5):
            operator.type(CTRL_C)
            time.sleep(0.005)
        return self.row(fault_s, operator.end())

    def terminal_halted_and_ctrl_c(self) -> dict:
        return self._halted(lambda operator: operator.type(CTRL_C))

    def terminal_halted_and_killed(self) -> dict:
        """By SIGTERM: the terminal stays halted until the wheels stand."""
        return self._halted(lambda operator: operator.process.terminate())

    def _halted(self, act) -> dict:
        operator = self.held()
        operator.type(CTRL_S)
        # Longer than robots drive without their operator: they hear it all the while.
        time.sleep(LINK_TIMEOUT_S + HALTED_S)
        drove = all(robot.duties() != ZERO for robot in self.robots.values())
        fault_s = time.monotonic()
        act(operator)
        stood = wait_until(lambda: all(r.duties() == ZERO for r in self.robots.values()), 5)
        operator.type(b"\x11")  # Ctrl-Q: the terminal goes on
        return self.row(fault_s, operator.end()) | {"drove": drove, "stood_before_ctrl_q": stood}

    def terminal_halted_in_the_countdown_and_stopped(self) -> dict:
        """Nobody presses Ctrl-Q: the command ends all the same, and its last word is read."""
        begin_s = time.monotonic()
        self.operator = operator = self._counting("--in-s", LONG_S, terminal=True)
        operator.type(CTRL_S)
        time.sleep(HALTED_S)
        tell.stop(Fleet(URL, key=self.key), set())
        return self._unmoved(begin_s, operator.end())

    def terminal_halted_at_the_start(self, *options: str) -> dict:
        """Nothing of the start can be told, and the wheels turn already."""
        begin_s = time.monotonic()
        self.operator = operator = Operator(self.key_file, *START, *options)
        operator.type(CTRL_S)
        assert wait_until(lambda: self.drive_since(begin_s), 20)
        time.sleep(0.2)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        wait_until(lambda: all(r.duties() == ZERO for r in self.robots.values()), 5)
        operator.type(b"\x11")
        return self.row(fault_s, operator.end())

    def untethered_at_a_halted_terminal(self) -> dict:
        return self.terminal_halted_at_the_start("--untethered")

    def hung_up(self) -> dict:
        operator = self.held()
        fault_s = time.monotonic()
        operator.hang_up()
        return self.row(fault_s, operator.end())

    def ctrl_z(self) -> dict:
        operator = self.held()
        fault_s = time.monotonic()
        operator.type(CTRL_Z)
        return self.row(fault_s, operator.end())

    def killed(self) -> dict:
        operator = self.held()
        fault_s = time.monotonic()
        operator.process.kill()
        return self.row(fault_s, operator.end())

    def away_until_its_link_is_lost(self) -> dict:
        """R03's network is gone as the stop is said, and comes back before that gives up."""
        machine = Machine()
        self.stack.callback(machine.end)
        machine.cable("wlan0", 1)
        self.robots[3] = self.robot(3, "3", machine)
        time.sleep(1)
        self.operator = operator = Operator(
            self.key_file, "start", "--arm", "--robots", "1,3", terminal=False
        )
        assert wait_until(lambda: HELD in operator.plain, 20), operator.plain
        time.sleep(0.5)
        fault_s = time.monotonic()
        machine.cut("wlan0")
        operator.process.send_signal(signal.SIGINT)
        time.sleep(LINK_TIMEOUT_S + 1)
        machine.cable("wlan0", 1)
        row = self.row(fault_s, operator.end(), [1, 3])
        self.robots.pop(3).process.terminate()
        machine.cut("wlan0")
        time.sleep(1)
        return row

    def slept(self) -> dict:
        """As a laptop whose lid is shut."""
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGSTOP)
        time.sleep(LINK_TIMEOUT_S + 1)
        operator.process.send_signal(signal.SIGCONT)
        return self.row(fault_s, operator.end())

    def output_full(self) -> dict:
        begin_s = time.monotonic()
        with open("/dev/full", "w") as full:
            self.operator = operator = Operator(
                self.key_file, *START, terminal=False, stdout=full, stderr=subprocess.PIPE
            )
            _, said = operator.process.communicate(timeout=20)
        operator.said = said.decode()
        return self._unmoved(begin_s, operator.process.returncode)

    def signalled_in_real_time(self) -> dict:
        return self._signalled(signal.SIGRTMIN)

    def signalled_as_by_a_fault(self) -> dict:
        """By a person: a fault of the program itself ends it at once."""
        return self._signalled(signal.SIGSEGV)

    def _signalled(self, number: int) -> dict:
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        operator.process.send_signal(number)
        return self.row(fault_s, operator.end())

    def run_dir_lost(self) -> dict:
        """As by somebody who tidies up: a robot cannot write down that it was stopped."""
        operator = self.held(terminal=False)
        kept = [self.folder / f"run{i}" for i in IDS]  # as robot_options() names them
        for folder in kept:
            folder.rename(f"{folder} gone")
        time.sleep(0.5)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end())
        for folder in kept:
            Path(f"{folder} gone").rename(folder)
        time.sleep(2)
        return row

    def log_deleted(self) -> dict:
        """The folder goes in which the tool's output is; its sentences have a reader."""
        folder = self.folder / "logs"
        folder.mkdir()
        with open(folder / "log", "w") as log:
            operator = self.start(terminal=False, stdout=log, stderr=subprocess.PIPE)
        operator._ear = None
        time.sleep(0.5)
        (folder / "log").unlink()
        folder.rmdir()
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        _, said = operator.process.communicate(timeout=20)
        operator.said = said.decode()
        return self.row(fault_s, operator.end())

    def stop_of_a_host_without_a_name(self) -> dict:
        return self._stopped_by("--host", "")

    def start_with_a_key_made_now(self) -> dict:
        """HOME is another user's, or new: robots answer to nothing that is signed there."""
        begin_s, home = time.monotonic(), self.folder / "home"
        env = {k: v for k, v in os.environ.items() if k != "XDG_CONFIG_HOME"}
        self.operator = Operator(
            None, "start", "--robots", "1,2", terminal=False, env={**env, "HOME": str(home)}
        )
        return self._unmoved(begin_s, self.operator.end())

    def stopped_by_another(self) -> dict:
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        tell.stop(Fleet(URL, key=self.key), set())
        return self.row(fault_s, operator.end())

    def driver_dies(self) -> dict:
        """One robot's program starts anew; the others are stopped by Ctrl-C later."""
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        os.kill(self.robots[1].children()[0], signal.SIGKILL)
        wait_until(lambda: "started anew" in operator.plain, 10)
        after_s = self.stood_after(fault_s, [1])
        drove = self.robots[2].duties() != ZERO
        operator.process.send_signal(signal.SIGINT)
        return self.row(fault_s, operator.end()) | {"after_s": after_s, "drove": drove}

    def robot_falls_silent(self) -> dict:
        """Its program is ended, as by a battery switch; without a terminal it is said, too."""
        other = self.robots[2]
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        other.process.terminate()
        wait_until(lambda: "not heard" in operator.plain, 10)
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end()) | {"after_s": self.stood_after(fault_s, [2])}
        self.robots[2] = self.robot(2, "2 again")
        return row

    def script_ends(self) -> dict:
        """Script that ends by itself on the one robot that is held; its own file names it."""
        with self._of_a_script():
            begin_s = time.monotonic()
            self.operator = Operator(
                self.key_file, "start", "--arm", "--robots", "1", terminal=False
            )
            code = self.operator.end(40)
            return self.row(self._script_over_s(begin_s), code, [1])

    def script_ends_beside_another(self) -> dict:
        """R02 drives on until Ctrl-C, which comes seconds after the script's end."""
        with self._of_a_script():
            begin_s = time.monotonic()
            operator = self.start(terminal=False)
            wait_until(lambda: "its script is over" in operator.plain, 20)
            after_s = self.stood_after(self._script_over_s(begin_s), [1])
            time.sleep(GONE_S + LINK_TIMEOUT_S)
            drove = self.robots[2].duties() != ZERO
            operator.process.send_signal(signal.SIGINT)
            row = self.row(time.monotonic(), operator.end(40), [2])
            return row | {"after_s": max(after_s, row["after_s"]), "drove": drove}

    @contextmanager
    def _of_a_script(self):
        """R01 plays one, once, instead of its table."""
        script = self.folder / "once.csv"
        script.write_text(f"t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,10,10,10,10\n{SCRIPT_S},0,0,0,0\n")
        self.robots[1].process.terminate()
        self.robots[1].process.wait()
        name = f"1 by its script {len(list(self.folder.iterdir()))}"
        self.robots[1] = self.robot(1, name, settings=("--set", f"script={script}"))
        time.sleep(1)
        yield
        self.robots[1].process.terminate()
        self.robots[1].process.wait()
        self.robots[1] = self.robot(1, f"{name}, over")
        time.sleep(1)

    def _script_over_s(self, begin_s: float) -> float:
        """By its first move."""
        rows = self.robots[1].rows()
        return next(t for t, duties in rows if t > begin_s and duties != ZERO) + SCRIPT_S

    def camera_lost(self) -> dict:
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        self.robots[1].camera.unplug()
        wait_until(lambda: "has a fault" in operator.plain, 10)
        after_s = self.stood_after(fault_s, [1])
        self.robots[1].camera.plug()
        wait_until(lambda: "R01 drives" in operator.plain, 10)
        operator.process.send_signal(signal.SIGINT)
        return self.row(fault_s, operator.end()) | {"after_s": after_s}

    def behaviour_unknown(self) -> dict:
        return self._refused("--behavior", "dance")

    def behaviour_unknown_partial(self) -> dict:
        return self._refused("--behavior", "dance", "--partial")

    def _refused(self, *words: str) -> dict:
        begin_s = time.monotonic()
        self.operator = operator = Operator(self.key_file, *START, *words, terminal=False)
        code = operator.end()
        return self._unmoved(begin_s, code)

    def _unmoved(self, begin_s: float, code: int, robots=IDS) -> dict:
        """A row of robots that never drove."""
        time.sleep(0.3)
        moved = any(self.moved(i, begin_s) for i in robots)
        said = [line.strip() for line in self.operator.plain.splitlines() if line.strip()]
        return {"said": said, "code": code, "after_s": None if not moved else float("inf")}

    def two_of_one_number(self) -> dict:
        begin_s = time.monotonic()
        twin = self.robot(1, "twin")
        fleet = Fleet(URL, key=self.key)
        fleet.listen(10, lambda: 1 in fleet.robots and fleet.robots[1].is_double)
        self.operator = operator = Operator(
            self.key_file, "stop", "--robots", "1,2", "--timeout-s", "1.5", terminal=False
        )
        code = operator.end()
        twin.process.terminate()
        twin.process.wait()
        fleet.listen(10, lambda: not fleet.robots[1].is_double)
        return self._unmoved(begin_s, code)

    def never_heard(self) -> dict:
        begin_s = time.monotonic()
        self.operator = operator = Operator(
            self.key_file, "stop", "--robots", "9", "--timeout-s", "1", terminal=False
        )
        return self._unmoved(begin_s, operator.end())

    def stop_without_a_key(self) -> dict:
        """On a machine that never commanded a robot."""
        operator = self.held(terminal=False)
        key = self.folder / "no" / "such.key"
        with self.hearing_stops() as stops_s:
            stopping = Operator(key, "stop", "--timeout-s", "2", terminal=False)
            code = stopping.end()
        operator.end()
        self.operator = stopping
        return self.row(stops_s[0], code) | {"made_a_key": key.exists()}

    def stop_without_standard_files(self) -> dict:
        """As from a program that closed them, with which what is opened first has their numbers."""
        operator = self.held(terminal=False)
        with self.hearing_stops() as stops_s:
            self.operator = Operator(
                self.key_file, "stop", terminal=False, preexec_fn=lambda: os.closerange(0, 3)
            )
            code = self.operator.end()
        operator.end()
        return self.row(stops_s[0], code)

    def stop_with_few_descriptors(self) -> dict:
        """As under `ulimit -n 5`: two more than the standard files, one for each socket."""

        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_NOFILE, (FEW_FILES, FEW_FILES))

        return self._stopped_by(preexec_fn=limit)

    def start_without_standard_files(self) -> dict:
        """Start that is refused: nobody could be told of a fault."""
        begin_s = time.monotonic()
        self.operator = Operator(
            self.key_file, *START, terminal=False, preexec_fn=lambda: os.closerange(0, 3)
        )
        return self._unmoved(begin_s, self.operator.end())

    def start_of_an_object_that_nobody_gets(self) -> dict:
        begin_s = time.monotonic()
        self.operator = Operator(
            self.key_file, *START, "--json", terminal=False, preexec_fn=lambda: os.close(1)
        )
        return self._unmoved(begin_s, self.operator.end())

    def stop_of_an_object_that_nobody_gets(self) -> dict:
        return self._stopped_by("--json", preexec_fn=lambda: os.close(1))

    def nobody_reads_on(self) -> dict:
        """As `swarm start | true`: its table has no reader, its sentences do."""
        read, write = os.pipe()
        os.close(read)
        begin_s = time.monotonic()
        self.operator = operator = Operator(
            self.key_file, *START, terminal=False, stdout=write, stderr=subprocess.PIPE
        )
        os.close(write)
        assert wait_until(lambda: self.drive_since(begin_s), 20)
        begun_s = min(
            next(t for t, duties in self.robots[i].rows() if t > begin_s and duties != ZERO)
            for i in IDS
        )
        _, said = operator.process.communicate(timeout=20)
        operator.said = said.decode()
        return self.row(begun_s, operator.process.returncode)

    def start_not_in_utf_8(self) -> dict:
        begin_s = time.monotonic()
        self.operator = Operator(self.key_file, "start", "--behavior", "\udcfc", terminal=False)
        return self._unmoved(begin_s, self.operator.end())

    def stop_output_full(self) -> dict:
        operator = self.held(terminal=False)
        with self.hearing_stops() as stops_s, open("/dev/full", "w") as full:
            self.operator = stopping = Operator(
                self.key_file, "stop", terminal=False, stdout=full, stderr=subprocess.PIPE
            )
            _, said = stopping.process.communicate(timeout=20)
        stopping.said = said.decode()
        operator.end()
        return self.row(stops_s[0], stopping.process.returncode)

    def selected_in_the_countdown(self) -> dict:
        """By another operator: told first that it may not be played, and last that it is not."""
        counting = self._counting("--in-s", LONG_S, "--behavior", "milling")
        self.operator = Operator(self.key_file, "select", "diffusing", terminal=False)
        code, begin_s = self.operator.end(), time.monotonic()
        counting.process.send_signal(signal.SIGINT)
        counting.end()
        return self._unmoved(begin_s, code)

    def start_of_robots_that_never_turn(self) -> dict:
        """By their configuration: they say so when they accept a start, and that is called off."""
        self.robots[4] = self.robot(4, "4", settings=("--set", "duty_cap_pct=0"))
        time.sleep(1)
        begin_s = time.monotonic()
        words = ("start", "--arm", "--robots", "4")
        self.operator = operator = Operator(self.key_file, *words, terminal=False)
        row = self._unmoved(begin_s, operator.end(), [4])
        self.robots.pop(4).process.terminate()
        time.sleep(1)
        return row

    def stop_not_in_utf_8(self) -> dict:
        return self._stopped_by("--robots", "\udcfc")

    def late_network(self) -> dict:
        """Network that brings late what robots say; their clocks are right."""
        operator = self.held(terminal=False, late_s=LATE_S)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        return self.row(fault_s, operator.end())

    def stop_of_a_host_that_is_not_there(self) -> dict:
        operator = self.held(terminal=False)
        with self.hearing_stops() as stops_s:
            self.operator = Operator(
                self.key_file, "stop", "--host", "10.0.1.77", "--timeout-s", "2", terminal=False
            )
            code = self.operator.end()
        operator.end()
        return self.row(stops_s[0], code)

    def stop_of_another_robot(self) -> dict:
        """By its number: R02 goes on, and that is said."""
        operator = self.held(terminal=False)
        with self.hearing_stops() as stops_s:
            self.operator = Operator(self.key_file, "stop", "--robots", "1", terminal=False)
            code = self.operator.end()
        drove = self.robots[2].duties() != ZERO
        after_s = self.stood_after(stops_s[0], [1])
        operator.process.send_signal(signal.SIGINT)
        operator.end()
        return self.row(stops_s[0], code) | {"after_s": after_s, "drove": drove}

    def untethered_and_one_hangs(self) -> dict:
        """In the countdown: it must not begin by itself once nobody expects it."""
        begin_s, robot, fleet = time.monotonic(), self.robots[2], Fleet(URL, key=self.key)
        self.operator = operator = self._counting("--untethered", "--partial", "--in-s", "3")
        hung = [robot.process.pid, *robot.children(), *robot.guards()]
        for pid in hung:
            os.kill(pid, signal.SIGSTOP)
        code = operator.end(40)
        for pid in reversed(hung):  # the supervisor last: it kills who was silent for so long
            os.kill(pid, signal.SIGCONT)
        fleet.listen(1.5)
        row = self._unmoved(begin_s, code, [2])
        tell.stop(fleet, set())
        return row

    def untethered_and_one_is_unheard(self) -> dict:
        """R03 drives for ever, and nobody hears it: its radio was gone before the instant."""
        machine = Machine()
        self.stack.callback(machine.end)
        machine.cable("wlan0", 1)
        self.robots[3] = self.robot(3, "3 untethered", machine)
        fleet = Fleet(URL, key=self.key)
        fleet.listen(1.5)
        words = ("start", "--arm", "--robots", "1,3", "--untethered", "--partial", "--in-s", "4")
        self.operator = operator = Operator(self.key_file, *words, terminal=False)
        known = fleet.robots
        fleet.listen(20, lambda: 3 in known and len(known[3].signed_acks) > 1)
        machine.cut("wlan0")
        code = operator.end(40)
        drove = self.robots[3].duties() != ZERO
        machine.cable("wlan0", 1)
        tell.stop(fleet, {1, 3})
        row = self.row(time.monotonic(), code, [3]) | {"drove": drove}
        self.robots.pop(3).process.terminate()
        machine.cut("wlan0")
        time.sleep(1)
        return row

    def untethered_and_one_is_deaf(self) -> dict:
        """R03 has accepted, hears no stop, and begins by itself while its answer is waited for."""
        machine = Machine()
        self.stack.callback(machine.end)
        machine.cable("wlan0", 1)
        robot = self.robots[3] = self.robot(3, "3 deaf", machine)
        begin_s, fleet = time.monotonic(), Fleet(URL, key=self.key)
        fleet.listen(1.5)
        words = ("start", "--arm", "--robots", "1,3", "--untethered", "--in-s", "5")
        self.operator = operator = Operator(self.key_file, *words, terminal=False)
        known = fleet.robots
        fleet.listen(20, lambda: 3 in known and known[3].awaits_start)
        machine.deafen("wlan0", 1)
        operator.process.send_signal(signal.SIGINT)
        wait_until(lambda: "R03 drives" in operator.plain, 20)
        drove, code = self.moved(3, begin_s), operator.end()
        others_moved = self.moved(1, begin_s)
        stop_s = time.monotonic()
        robot.process.terminate()
        row = self.row(stop_s, code, [3]) | {"drove": drove, "other_stood": not others_moved}
        self.robots.pop(3)
        machine.cut("wlan0")
        time.sleep(1)
        return row

    def taken_over(self) -> dict:
        """By another operator, who starts R01 while the first holds both; the first then ends."""
        first = self.held(terminal=False)
        second = self._takes_r01(first)
        fault_s = time.monotonic()
        first.process.send_signal(signal.SIGINT)
        code = first.end()
        row = self.row(fault_s, code)
        return row | {"second": [second.end(), second.plain]}

    def taken_over_by_one_who_is_killed(self) -> dict:
        """Then the first does not hold R01: it has lost its operator. R02 drives on."""
        first = self.held(terminal=False)
        second = self._takes_r01(first)
        fault_s = time.monotonic()
        second.process.kill()
        second.end()
        wait_until(lambda: "lost its link" in first.plain, 10)
        after_s = self.stood_after(fault_s, [1])
        drove = self.robots[2].duties() != ZERO
        first.process.send_signal(signal.SIGINT)
        return self.row(fault_s, first.end()) | {"after_s": after_s, "drove": drove}

    def _takes_r01(self, first: Operator) -> Operator:
        words = ("start", "--arm", "--robots", "1")
        for _ in range(TRIES):
            second = Operator(self.key_file, *words, terminal=False)
            wait_until(lambda s=second: s.has_ended or HELD in s.plain, 20)
            if not second.has_ended:
                break
        assert wait_until(lambda: "taken over" in first.plain, 10), second.plain + first.plain
        return second

    def selected_by_another(self) -> dict:
        """From a second terminal: the first says so, and all goes on."""
        operator = self.held(terminal=False)
        select = Operator(self.key_file, "select", "milling", "--robots", "1", terminal=False)
        assert select.end() == 0, select.plain
        wait_until(lambda: "another operator" in operator.plain, 10)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        return self.row(fault_s, operator.end())

    def stopped_and_armed_by_another(self) -> dict:
        """One that was armed has forgotten the stop, and no button was pressed."""
        operator, fleet = self.held(terminal=False), Fleet(URL, key=self.key)
        tell.stop(fleet, {1})
        wait_until(lambda: "stopped by another command" in operator.plain, 10)
        tell.arm(fleet, {1})
        time.sleep(1)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        return self.row(fault_s, operator.end(), [2])

    def key_changed_while_held(self) -> dict:
        """R02 answers the stop, and nobody here can check that."""
        operator, file = self.held(terminal=False), self.folder / "run2" / "key"
        own = file.read_text()
        file.write_text(f"{bytes(32).hex()}\n")
        self.robots[2].process.send_signal(signal.SIGHUP)
        wait_until(lambda: "R02 is not heard to sign" in operator.plain, 10)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end(30), [1])
        file.write_text(own)
        self.robots[2].process.send_signal(signal.SIGHUP)
        time.sleep(1)
        return row

    def other_operator_of_another_key(self) -> dict:
        """His start stops nobody: the robots drive on until Ctrl-C of their own operator."""
        first = self.held(terminal=False)
        (self.folder / "other").mkdir()
        key, _ = operator_key(self.folder / "other")
        other = Operator(key, *START, terminal=False)
        code = other.end()
        drove = all(robot.duties() != ZERO for robot in self.robots.values())
        fault_s = time.monotonic()
        first.process.send_signal(signal.SIGINT)
        first_code = first.end()
        self.operator = other
        return self.row(fault_s, code) | {"drove": drove, "first": [first_code, first.plain]}

    def stopped_in_the_countdown(self) -> dict:
        """By another, once both have accepted; nothing starts at the instant."""
        begin_s, fleet, ahead_s = time.monotonic(), Fleet(URL, key=self.key), 8.0
        self.operator = operator = self._counting("--json", "--in-s", str(ahead_s))
        said_s = time.monotonic()
        tell.stop(fleet, set())
        code = operator.end()
        ended_s = time.monotonic() - said_s
        data = json.loads(operator.plain[operator.plain.index("{") :].splitlines()[0])
        fleet.listen(said_s + ahead_s + 0.5 - time.monotonic())
        row = self._unmoved(begin_s, code)
        said = [data["sentence"]]
        row |= {"said": said, "instant": data["start_utime_us"], "ok": data["ok"]}
        return row | {"ended_s": ended_s, "ahead_s": ahead_s}

    def _counting(self, *words: str, terminal: bool = False) -> Operator:
        """A start whose robots have all accepted; its instant is seconds away."""
        fleet = Fleet(URL, key=self.key)
        operator = Operator(self.key_file, *START, *words, terminal=terminal)
        # The answers to arm and to start.
        fleet.listen(
            20, lambda: all(i in fleet.robots and len(fleet.robots[i].signed_acks) > 1 for i in IDS)
        )
        return operator

    def restarted_in_the_countdown(self) -> dict:
        """Its driver starts anew, and knows of no start."""
        begin_s, self.operator = time.monotonic(), self._counting("--in-s", LONG_S)
        os.kill(self.robots[2].children()[0], signal.SIGKILL)
        return self._unmoved(begin_s, self.operator.end())

    def gone_in_the_countdown(self) -> dict:
        """As by its battery switch."""
        begin_s, self.operator = time.monotonic(), self._counting("--in-s", LONG_S)
        self.robots[2].process.terminate()
        code = self.operator.end(40)
        row = self._unmoved(begin_s, code)
        self.robots[2] = self.robot(2, "2 after the countdown")
        time.sleep(1)
        return row

    def gone_in_the_countdown_partial(self) -> dict:
        """Those that are there start: that was asked for."""
        self.operator = operator = self._counting("--in-s", "4", "--partial")
        self.robots[2].process.terminate()
        drove = wait_until(lambda: "but not all" in operator.plain, 20)
        drove = drove and self.robots[1].duties() != ZERO
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end(), [1]) | {"drove": drove}
        self.robots[2] = self.robot(2, "2 after the partial start")
        time.sleep(1)
        return row

    def one_refuses_partial(self) -> dict:
        """R02 is not armed."""
        begin_s, fleet = time.monotonic(), Fleet(URL, key=self.key)
        fleet.listen(1.5)
        tell.stop(fleet, {2})
        tell.arm(fleet, {1})
        words = ("start", "--robots", "1,2", "--partial", "--json")
        self.operator = operator = Operator(self.key_file, *words, terminal=False)
        wait_until(lambda: HELD in operator.plain, 20)
        objects = [line for line in operator.plain.splitlines() if line.startswith("{")]
        refused = json.loads(objects[0])["robots"][1]
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end(), [1])
        stood = self._unmoved(begin_s, 0, [2])["after_s"] is None
        return row | {"other_stood": stood, "refused": refused}

    def camera_lost_before(self) -> dict:
        """It accepts the start, and would drive whenever its camera came back."""
        self.robots[2].camera.unplug()
        time.sleep(1)
        begin_s, self.operator = time.monotonic(), self._counting()
        code = self.operator.end(40)
        self.robots[2].camera.plug()
        time.sleep(2)
        moves_s = [t for t, duties in self.robots[1].rows() if t > begin_s and duties != ZERO]
        unmoved = self._unmoved(begin_s, code, [2])["after_s"] is None
        return self.row(moves_s[0], code, [1]) | {"other_stood": unmoved}

    @contextmanager
    def _frozen(self):
        """R02's camera is there, and no picture comes, as it says by now."""
        camera = self.robots[2].camera
        view, camera.view = camera.view, b""
        time.sleep(FRAME_TIMEOUT_S + 1)
        yield
        camera.view = view
        time.sleep(1)

    def camera_frozen_before(self) -> dict:
        with self._frozen():
            begin_s, self.operator = time.monotonic(), self._counting()
            code = self.operator.end(40)
            moves_s = [t for t, duties in self.robots[1].rows() if t > begin_s and duties != ZERO]
            unmoved = self._unmoved(begin_s, code, [2])["after_s"] is None
        return self.row(moves_s[0], code, [1]) | {"other_stood": unmoved}

    def camera_frozen_before_partial(self) -> dict:
        with self._frozen():
            begin_s, self.operator = time.monotonic(), self._counting("--partial")
            wait_until(lambda: HELD in self.operator.plain, 20)
            fault_s = time.monotonic()
            self.operator.process.send_signal(signal.SIGINT)
            code = self.operator.end(40)
            unmoved = self._unmoved(begin_s, code, [2])["after_s"] is None
        return self.row(fault_s, code, [1]) | {"other_stood": unmoved}

    def gone_at_the_instant(self) -> dict:
        """Too late to call the start off before it: the others drive for a moment, and stand."""
        begin_s, self.operator = time.monotonic(), self._counting("--in-s", "4")
        instant_s = time.monotonic() + 4
        time.sleep(instant_s - time.monotonic() - AT_THE_INSTANT_S)
        hung = [self.robots[2].process.pid, *self.robots[2].children()]
        for pid in hung:
            os.kill(pid, signal.SIGSTOP)
        code = self.operator.end(40)
        for pid in reversed(hung):
            os.kill(pid, signal.SIGCONT)
        time.sleep(1)
        moves_s = [t for t, duties in self.robots[1].rows() if t > begin_s and duties != ZERO]
        unmoved = self._unmoved(begin_s, code, [2])["after_s"] is None
        return self.row(moves_s[0], code, [1]) | {"other_stood": unmoved}

    def another_starts_in_the_countdown(self) -> dict:
        """The last start counts: the first ends at once, and says whose the robots are."""
        begin_s, first = time.monotonic(), self._counting("--in-s", LONG_S)
        second = Operator(self.key_file, *START, "--in-s", "3", terminal=False)
        code = first.end()
        stood = not any(self.moved(i, begin_s) for i in IDS)
        wait_until(lambda: second.has_ended or HELD in second.plain, 20)
        drove = all(robot.duties() != ZERO for robot in self.robots.values())
        fault_s = time.monotonic()
        second.process.send_signal(signal.SIGINT)
        second_code = second.end()
        self.operator = first
        row = self.row(fault_s, code) | {"stood": stood, "drove": drove}
        return row | {"second": [second_code, second.plain]}

    def another_starts_while_it_sleeps(self) -> dict:
        """Robots have lost the first by then, which wakes before its instant."""
        return self._slept_through_another("--in-s", LONGER_S, before_s=LINK_TIMEOUT_S + 0.5)

    def another_starts_while_it_sleeps_through_its_instant(self) -> dict:
        """Robots drive when the first wakes, and not by its start."""
        return self._slept_through_another("--in-s", "5")

    def _slept_through_another(self, *words: str, before_s: float = 0.0) -> dict:
        first = self._counting(*words)
        first.process.send_signal(signal.SIGSTOP)
        time.sleep(before_s)
        second = Operator(self.key_file, *START, terminal=False)
        wait_until(lambda: second.has_ended or HELD in second.plain, 20)
        time.sleep(LINK_TIMEOUT_S + 1)
        first.process.send_signal(signal.SIGCONT)
        code = first.end()
        time.sleep(STAYS_S)
        drove = all(robot.duties() != ZERO for robot in self.robots.values())
        fault_s = time.monotonic()
        second.process.send_signal(signal.SIGINT)
        second_code = second.end()
        self.operator = first
        row = self.row(fault_s, code) | {"drove": drove}
        return row | {"second": [second_code, second.plain]}

    def ctrl_c_in_the_countdown(self) -> dict:
        begin_s, self.operator = time.monotonic(), self._counting("--in-s", LONG_S)
        time.sleep(0.5)
        self.operator.process.send_signal(signal.SIGINT)
        return self._unmoved(begin_s, self.operator.end())

    def laptop_a_day_ahead(self) -> dict:
        """It arms and is refused; then another, whose clock is right, starts."""
        early = Operator(self.key_file, *START, terminal=False, clock_ahead_s=86400)
        early_code = early.end()
        arm = Operator(self.key_file, "arm", terminal=False, clock_ahead_s=86400)
        assert arm.end() == 0, arm.plain
        operator = self.held(terminal=False)
        fault_s = time.monotonic()
        operator.process.send_signal(signal.SIGINT)
        row = self.row(fault_s, operator.end())
        said = [line for line in early.plain.splitlines() if line.strip()]
        return row | {"said": [*said, *row["said"]], "early_code": early_code}

    def stop_ended_by_ctrl_c(self) -> dict:
        return self._stop_ended_by(signal.SIGINT)

    def stop_ended_by_sigterm(self) -> dict:
        return self._stop_ended_by(signal.SIGTERM)

    def _stop_ended_by(self, number: int) -> dict:
        """While it waits for one that is not there."""
        operator = self.held(terminal=False)
        with self.hearing_stops() as stops_s:
            self.operator = Operator(self.key_file, "stop", "--robots", "1,2,9", terminal=False)
            wait_until(lambda: "stop is said all the time" in self.operator.plain, 20)
            self.operator.process.send_signal(number)
            code = self.operator.end()
        operator.end()
        return self.row(stops_s[0], code)

    def ctrl_c_without_end(self) -> dict:
        """Until the tool has ended: none of them comes too late to change what it says."""
        operator = self.held()
        fault_s = time.monotonic()
        while not operator.has_ended and time.monotonic() < fault_s + 20:
            operator.process.send_signal(signal.SIGINT)
            time.sleep(0.002)
        return self.row(fault_s, operator.end())

    def ctrl_c_while_it_looks(self) -> dict:
        """Once it is on the bus and has said nothing: it hears who is there for a second."""
        begin_s = time.monotonic()
        with self.hearing_commands() as commands:
            self.operator = operator = Operator(
                self.key_file, "start", "--robots", "1,9", terminal=False
            )
            sockets = Path("/proc/net/udp")
            before = sockets.read_text().count(BUS_PORT)
            assert wait_until(lambda: sockets.read_text().count(BUS_PORT) > before, 20)
            operator.process.send_signal(signal.SIGINT)
            code = operator.end()
        return self._unmoved(begin_s, code) | {"commands": len(commands)}

    def stop_without_a_network(self) -> dict:
        """Stops from a computer without a network: nothing that it says can reach a robot."""
        begin_s = time.monotonic()
        self.operator = Operator(
            self.key_file, "stop", "--timeout-s", "1", terminal=False, elsewhere=True
        )
        return self._unmoved(begin_s, self.operator.end())

    def start_with_a_key_that_others_may_read(self) -> dict:
        begin_s = time.monotonic()
        self.operator = Operator(self._open_key(), "start", terminal=False)
        return self._unmoved(begin_s, self.operator.end())

    def stop_with_a_key_that_others_may_read(self) -> dict:
        return self._stopped_by("--timeout-s", "2", key=self._open_key())

    def _open_key(self) -> Path:
        key = self.folder / "open.key"
        key.write_bytes(self.key_file.read_bytes())
        key.chmod(0o644)
        return key

    def stop_mistyped(self) -> dict:
        return self._stopped_by("--robots", "1;2")

    def stop_of_an_empty_list(self) -> dict:
        return self._stopped_by("--robots", "")

    def stop_of_a_list_that_is_missing(self) -> dict:
        """The next option is taken for it; the key counts all the same."""
        return self._stopped_by("--robots")

    def key_mistyped(self) -> dict:
        begin_s, key = time.monotonic(), self.folder / "operator.kye"
        self.operator = Operator(key, "start", terminal=False)
        return self._unmoved(begin_s, self.operator.end()) | {"made_a_key": key.exists()}

    def _stopped_by(self, *words: str, key: Path | None = None, **options) -> dict:
        """Robots that are held, by another command."""
        operator = self.held(terminal=False)
        with self.hearing_stops() as stops_s:
            key = key or self.key_file
            self.operator = Operator(key, "stop", *words, terminal=False, **options)
            code = self.operator.end()
        operator.end()
        return self.row(stops_s[0], code)

    def stop_beside_a_request_for_help(self) -> dict:
        """As of who writes -h for --host."""
        return self._stopped_by("-h", "robot03")

    def stop_where_python_has_handlers_of_its_own(self) -> dict:
        """Which cannot be put back once the command has ended."""
        return self._stopped_by(env=OTHER_HANDLERS)

    def untethered_where_python_has_handlers_of_its_own(self) -> dict:
        self.operator = operator = self.start("--untethered", terminal=False, env=OTHER_HANDLERS)
        code = operator.end()
        with self.hearing_stops() as stops_s:
            stop = Operator(self.key_file, "stop", terminal=False)
            assert stop.end() == 0, stop.plain
        return self.row(stops_s[0], code)

    def url_mistyped(self) -> dict:
        begin_s = time.monotonic()
        self.operator = Operator(
            self.key_file, "start", "--lcm-url", "udp://239.255.76.67:7667", terminal=False
        )
        return self._unmoved(begin_s, self.operator.end())

    def robots_mistyped(self) -> dict:
        begin_s = time.monotonic()
        self.operator = Operator(self.key_file, "start", "--robots", "1;2", terminal=False)
        return self._unmoved(begin_s, self.operator.end())

    def one_is_missing(self) -> dict:
        """Nobody is told anything: neither to start nor, then, to stop."""
        begin_s = time.monotonic()
        with self.hearing_commands() as commands:
            self.operator = operator = Operator(
                self.key_file, "start", "--robots", "1,9", terminal=False
            )
            code = operator.end()
        return self._unmoved(begin_s, code) | {"commands": len(commands)}

    def killed_with_a_long_link(self) -> dict:
        """The robots drive on, and whoever looks is told that nobody holds them."""
        operator = self.start("--link-timeout-s", "600", terminal=False)
        operator.process.kill()
        operator.end()
        time.sleep(GONE_S)
        status = Operator(self.key_file, "status", "--once", terminal=False)
        status_code = status.end()
        with self.hearing_stops() as stops_s:
            self.operator = Operator(self.key_file, "stop", terminal=False)
            code = self.operator.end()
        row = self.row(stops_s[0], code) | {"status_code": status_code}
        return row | {"said": [*status.plain.splitlines(), *row["said"]]}

    @contextmanager
    def hearing_stops(self):
        """When stops are said; how long a tool takes to begin is the machine's business."""
        stop = turbopi.swarm_command_t.VERB_STOP
        with self.hearing_commands() as commands:
            yield commands
        commands[:] = [t_s for t_s, verb in commands if verb == stop]

    @contextmanager
    def hearing_commands(self):
        """When commands are said, and their verbs."""
        over, commands, bus = threading.Event(), [], UdpBus(URL)

        def on_command(channel: str, data: bytes) -> None:
            if channel == "SWARM_SIGNED":
                data = turbopi.signed_command_t.decode(data).command
            commands.append((time.monotonic(), turbopi.swarm_command_t.decode(data).verb))

        def hear():
            bus.subscribe("SWARM_(COMMAND|SIGNED)", on_command)
            while not over.is_set():
                bus.handle_timeout(50)

        thread = threading.Thread(target=hear)
        thread.start()
        try:
            yield commands
        finally:
            over.set()
            thread.join()

    def markup_in_names(self) -> dict:
        """Somebody says names with an unfinished tag and control characters."""
        with self.saying(
            behavior="[/red] [bold", version="\x1b]0;owned\x07\x1b[2J", source="a\nb" * 100
        ):
            operator = self.held()
            time.sleep(0.6)
            fault_s = time.monotonic()
            operator.type(CTRL_C)
            row = self.row(fault_s, operator.end())
            status = Operator(self.key_file, "status", "--once")
            row["status_code"] = status.end()
        raw = operator.said + status.said
        row["status"] = status.plain
        row["got_through"] = [c for c in ("\x1b]0;", "\x07", "\x1b[2J\x1b") if c in raw]
        return row

    @contextmanager
    def saying(self, **texts: str):
        """A stranger who says what R01 and R02 are, thirty times a second."""
        over, run = threading.Event(), turbopi.run_t()
        for name, text in texts.items():
            setattr(run, name, text)

        def say():
            bus = UdpBus(URL)
            while not over.wait(0.03):
                for i in IDS:
                    run.robot_id = i
                    bus.publish(f"R{i:02d}_RUN", run.encode())

        thread = threading.Thread(target=say)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def flood_of_other_packets(self) -> dict:
        """Floods channels that nobody subscribed to: an unanswered stop ends in its time."""
        begin_s, over = time.monotonic(), threading.Event()

        def flood():
            bus = UdpBus(URL)
            while not over.is_set():
                bus.publish("CAMERA_3_PICTURE", b"x" * 1000)

        threads = [threading.Thread(target=flood) for _ in range(2)]
        for thread in threads:
            thread.start()
        self.operator = operator = Operator(
            self.key_file, "stop", "--robots", "9", "--timeout-s", "2", terminal=False
        )
        code = operator.end(30)
        over.set()
        for thread in threads:
            thread.join()
        return self._unmoved(begin_s, code)


def main(folder: Path, faults: list[str], kind: type[Field] = Field) -> dict:
    result = {}
    with ExitStack() as stack:
        field = kind(folder, stack)
        time.sleep(1)
        for fault in faults:
            result[fault] = getattr(field, fault)()
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), sys.argv[2:])))
