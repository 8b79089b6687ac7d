# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm` as shells run it: in loops, in the background, redirected, under cron.

Usage: shell_session.py FOLDER CASE..., in a network of its own, with TURBOPI set. Prints a row for
each case as JSON: what was said, the exit code, and when the wheels stood.
"""

import fcntl
import json
import os
import pty
import re
import select
import shlex
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import turbopi
from robot_process import ZERO, wait_until
from told_session import CTRL_C, IDS, LINK_TIMEOUT_S, Field, main

from twinmill.robots.fleet import GONE_S

PROGRAM = "import sys\nfrom twinmill_cli.main import main\nsys.exit(main())\n"
VERB_START = turbopi.swarm_command_t.VERB_START
CTRL_BACKSLASH = b"\x1c"
PROMPT = "ready> "
TIMEOUT_S = 7  # of `timeout`: a start takes three, on a busy machine
SAID_S = 0.7  # after the first move, in which the start is told
NAP_S = 1.0  # shorter than robots drive without their operator


class Shell:
    """A script, or an interactive shell, at a terminal of its own or at none."""

    def __init__(self, command: list[str], folder: Path, *, terminal: bool = True, env=None):
        self.said, self.keyboard = "", None
        self.env = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", **(env or {})}
        if terminal:
            self.keyboard, far = pty.openpty()
            fcntl.ioctl(far, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 300, 0, 0))
            streams = {"stdin": far, "stdout": far, "stderr": far}
            command = ["setsid", "--ctty", *command]
        else:
            self.ear, far = os.pipe()
            streams = {"stdin": subprocess.DEVNULL, "stdout": far, "stderr": far}
            command = ["setsid", *command]
        self.ear = self.keyboard or self.ear
        self.process = subprocess.Popen(command, cwd=folder, env=self.env, **streams)
        os.close(far)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while True:
            try:
                if select.select([self.ear], [], [], 0.05)[0]:
                    data = os.read(self.ear, 65536)
                    if not data:
                        return
                    self.said += data.decode(errors="replace")
            except (OSError, ValueError):  # the other end is closed, or this one
                return

    def type(self, keys: bytes) -> None:
        os.write(self.keyboard, keys)

    def hang_up(self) -> None:
        keyboard, self.ear = self.keyboard, -1
        self._reader.join()
        os.close(keyboard)

    def end(self, timeout_s: float = 30) -> int:
        code = self.process.wait(timeout_s)
        self._reader.join(1)
        return code

    @property
    def plain(self) -> str:
        """All that was said, without the codes that move a cursor."""
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self.said)


class Laboratory(Field):
    """Two robots, and what people do with a shell."""

    def __init__(self, folder: Path, stack: ExitStack):
        super().__init__(folder, stack)
        program = folder / "twinmill"
        program.write_text(f"#!{sys.executable}\n{PROGRAM}")
        program.chmod(0o755)
        self.key_words = f"--key {shlex.quote(str(self.key_file))}"
        self.begin_s = time.monotonic()

    def started(self, robots: str = "1,2") -> str:
        """A command line that starts robots."""
        self.begin_s = time.monotonic()
        return f"twinmill swarm start --arm --robots {robots} {self.key_words}"

    def script(self, text: str, **options) -> Shell:
        return Shell(["bash", "-c", text], self.folder, **options)

    def drive(self, shell: Shell, robots=IDS) -> float:
        """Waits until robots drive, held, and said so. Returns the time then."""

        def ready() -> bool:
            has_ended = shell.process.poll() is not None
            return has_ended or all(self.moved(i, self.begin_s) for i in robots)

        assert wait_until(ready, 20), shell.plain
        assert shell.process.poll() is None, shell.plain
        time.sleep(SAID_S)
        return time.monotonic()

    def told(self, shell: Shell, since_s: float, code: int, robots=IDS) -> dict:
        """The row of a case, once the wheels have stood for a while."""
        self.operator = shell
        return self.row(since_s, code, robots)

    # -- the cases: each gives its row ------------------------------------------------------------

    def ctrl_c_in_a_loop(self) -> dict:
        """The next robot of the list never starts."""
        line = f"for i in 1 2; do {self.started('$i')}; done; echo went on"
        shell = self.script(line)
        fault_s = self.drive(shell, [1])
        shell.type(CTRL_C)
        row = self.told(shell, fault_s, shell.end(), [1])
        return row | {"second_moved": self.moved(2, fault_s)}

    def ctrl_c_in_the_countdown_of_a_loop(self) -> dict:
        """No robot of the list ever starts."""
        line = f"for i in 1 2; do {self.started('$i')} --in-s 3; done; echo went on"
        shell = self.script(line)
        with self.hearing_commands() as commands:
            wait_until(lambda: any(verb == VERB_START for _, verb in commands), 20)
            time.sleep(0.5)
            shell.type(CTRL_C)
            code = shell.end()
        self.operator = shell
        return self._unmoved(self.begin_s, code)

    def ctrl_backslash(self) -> dict:
        shell = self.script(f"exec {self.started()}")
        fault_s = self.drive(shell)
        shell.type(CTRL_BACKSLASH)
        return self.told(shell, fault_s, shell.end())

    def background_of_a_script(self) -> dict:
        """SIGINT is ignored as it begins, and the terminal's Ctrl-C comes to the script's group."""
        shell = self.script(f"{self.started()} & wait $!; echo script is over; wait")
        fault_s = self.drive(shell)
        shell.type(CTRL_C)
        wait_until(lambda: "All stand" in shell.plain, 10)
        return self.told(shell, fault_s, shell.end())

    def background_of_a_terminal(self) -> dict:
        """Ctrl-C does not come to it, and it says what does."""
        shell = Shell(["bash", "--norc", "-i"], self.folder, env={"PS1": PROMPT})
        shell.type(f"{self.started()} &\n".encode())
        self.drive(shell)
        shell.type(CTRL_C)
        time.sleep(0.5)
        drove = all(robot.duties() != ZERO for robot in self.robots.values())
        said = re.search(r"`(kill \d+)`", shell.plain)
        fault_s = time.monotonic()
        shell.type(f"{said[1] if said else 'kill %1'}; wait %1; echo code $?; exit 0\n".encode())
        shell.end()
        code = re.search(r"code (\d+)", shell.plain.split("exit 0")[-1])
        return self.told(shell, fault_s, int(code[1])) | {"drove": drove}

    def stderr_thrown_away_and_a_robot_unplugged(self) -> dict:
        """As `ssh lab twinmill swarm start 2>/dev/null`, ended by SIGTERM."""
        shell = self.script(f"exec {self.started()} 2>/dev/null", terminal=False)
        self.drive(shell)
        gone = self.robots[2]
        hung = [gone.process.pid, *gone.children()]
        for pid in hung:
            os.kill(pid, signal.SIGSTOP)
        fault_s = time.monotonic()
        shell.process.terminate()
        code = shell.end()
        for pid in reversed(hung):
            os.kill(pid, signal.SIGCONT)
        return self.told(shell, fault_s, code, [1])

    def stop_whose_stdout_is_thrown_away(self) -> dict:
        """Who is not there is named on stderr."""
        begin_s = time.monotonic()
        line = f"twinmill swarm stop --robots 9 --timeout-s 1 {self.key_words} >/dev/null"
        self.operator = shell = self.script(line, terminal=False)
        return self._unmoved(begin_s, shell.end())

    def cron(self) -> dict:
        """No terminal, hardly an environment, and a `kill` later."""
        env = shlex.join(f"{k}={v}" for k, v in os.environ.items() if k == "PYTHONPATH")
        line = self.started()
        line = f"exec env -i {env} PATH=/usr/bin:/bin {self.folder}/{line}"
        shell = self.script(line, terminal=False)
        fault_s = self.drive(shell)
        shell.process.terminate()
        return self.told(shell, fault_s, shell.end())

    def timeout_in_a_script(self) -> dict:
        """It has a group of its own, to which no Ctrl-C comes: the script ends, this goes on."""
        shell = self.script(f"timeout {TIMEOUT_S} {self.started()}; echo code $?")
        begin_s = time.monotonic()
        self.drive(shell)
        row = self.told(shell, begin_s + TIMEOUT_S, shell.end())
        return row | {"code": int(re.search(r"code (\d+)", shell.plain)[1])}

    def nohup_and_the_terminal_closed(self) -> dict:
        """A hang-up counts, be it ignored: nobody could see a fault any more."""
        shell = self.script(f"nohup {self.started()} > nohup.txt 2>&1; echo $? > code.txt")
        fault_s = self.drive(shell)
        shell.hang_up()
        shell.process.wait(20)
        wait_until((self.folder / "code.txt").exists, 5)
        shell.said += (self.folder / "nohup.txt").read_text()
        return self.told(shell, fault_s, shell.process.returncode)

    def pipe_into_tee(self) -> dict:
        """Ctrl-C ends its reader, too, and before it."""
        shell = self.script(f"{self.started()} | tee log.txt; echo ${{PIPESTATUS[0]}}")
        fault_s = self.drive(shell)
        shell.type(CTRL_C)
        return self.told(shell, fault_s, shell.end())

    def all_into_tee(self) -> dict:
        """Nobody reads any more what it says: the terminal is still there."""
        shell = self.script(f"{self.started()} 2>&1 | tee log.txt; echo went on")
        fault_s = self.drive(shell)
        shell.type(CTRL_C)
        return self.told(shell, fault_s, shell.end())

    def all_into_tee_and_a_robot_hangs(self) -> dict:
        shell = self.script(f"{self.started()} 2>&1 | tee log.txt; echo code ${{PIPESTATUS[0]}}")
        self.drive(shell)
        gone = self.robots[2]
        hung = [gone.process.pid, *gone.children()]
        for pid in hung:
            os.kill(pid, signal.SIGSTOP)
        fault_s = time.monotonic()
        shell.type(CTRL_C)
        shell.end()
        for pid in reversed(hung):
            os.kill(pid, signal.SIGCONT)
        row = self.told(shell, fault_s, 0, [1])
        return row | {"code": int(re.search(r"code (\d+)", shell.plain)[1])}

    def nap(self) -> dict:
        """A laptop that sleeps for less than its robots wait: they drive on, and it holds them."""
        shell = self.script(f"exec {self.started()}")
        self.drive(shell)
        shell.process.send_signal(signal.SIGSTOP)
        time.sleep(NAP_S)
        shell.process.send_signal(signal.SIGCONT)
        time.sleep(LINK_TIMEOUT_S + 0.5)
        drove = all(robot.duties() != ZERO for robot in self.robots.values())
        fault_s = time.monotonic()
        shell.type(CTRL_C)
        return self.told(shell, fault_s, shell.end()) | {"drove": drove}

    def quota(self) -> dict:
        """The file below stdout takes no byte."""
        shell = self.script(f"ulimit -f 0; exec {self.started()} > log.txt", terminal=False)
        code = shell.end()
        self.operator = shell
        return self._unmoved(self.begin_s, code)

    def one_of_two_is_heard(self) -> dict:
        """Nobody has said how many there are: a robot may be there and not be heard."""
        gone = self.robots[2]
        hung = [gone.process.pid, *gone.children()]
        for pid in hung:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(GONE_S)
        self.begin_s = time.monotonic()
        shell = self.script(f"exec twinmill swarm start --arm {self.key_words}", terminal=False)
        fault_s = self.drive(shell, [1])
        shell.process.terminate()
        code = shell.end()
        for pid in reversed(hung):
            os.kill(pid, signal.SIGCONT)
        return self.told(shell, fault_s, code, [1])


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), sys.argv[2:], Laboratory)))
