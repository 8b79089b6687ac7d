# SPDX-License-Identifier: Apache-2.0
"""The robot's program as a process: its camera is a socket, its motor board a file."""

import contextlib
import fcntl
import os
import pty
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

WIDTH_PX, HEIGHT_PX = 64, 48
# sRGB (0, 128, 0) and mid grey in BT.601 studio range.
GREEN = bytes([81, 91, 81, 81]) * (WIDTH_PX * HEIGHT_PX // 2)
GREY = bytes([126, 128, 126, 128]) * (WIDTH_PX * HEIGHT_PX // 2)
# What two of its processes go by.
GUARD, RELAY = "wheelguard", "stderr-relay"
LEFT, RIGHT, ZERO = (37, 100, 37, 100), (100, 37, 100, 37), (0, 0, 0, 0)


def wait_until(condition, timeout_s=10.0):
    """Waits for a condition and says whether it came."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        if condition():
            return True
        time.sleep(0.01)
    return False


def full_pipe():
    """A pipe that takes no byte more."""
    read_end, write_end = os.pipe()
    fcntl.fcntl(write_end, fcntl.F_SETFL, os.O_NONBLOCK)
    try:
        while True:
            os.write(write_end, b"x" * 4096)
    except BlockingIOError:
        fcntl.fcntl(write_end, fcntl.F_SETFL, 0)
    return read_end, write_end


@contextlib.contextmanager
def terminal():
    """Pair: runner of a command at a terminal of its own, and that terminal's other end."""
    master, line = pty.openpty()
    begin = "import os, sys; os.open(sys.argv[1], os.O_RDWR); os.execvp(sys.argv[2], sys.argv[2:])"
    yield [sys.executable, "-c", begin, os.ttyname(line)], master
    os.close(line)
    with contextlib.suppress(OSError):  # hung up by the test
        os.close(master)


class Camera:
    """Sends `view` thirty times a second to whoever connects; can be unplugged."""

    def __init__(self, path: Path):
        self.path = path
        self.view = GREEN
        self._plugged = False
        self.plug()

    def plug(self):
        """Begins to listen."""
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(self.path))
        self._listener.listen()
        self._plugged = True
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def unplug(self):
        """Hangs up and goes away."""
        self._plugged = False
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()
        self.path.unlink()

    def _serve(self):
        while self._plugged:
            try:
                connection, _ = self._listener.accept()
                while self._plugged:
                    if self.view:
                        connection.sendall(self.view)
                    time.sleep(1 / 30)
                connection.close()
            except OSError:
                pass


class Robot:
    """The running program. As a context it is killed at the end, if it still lives.

    A configuration of the test's own takes the place of all options but the arguments; it must
    name this camera and board.
    """

    def __init__(
        self,
        program: list[str],
        folder: Path,
        *arguments: str,
        env: dict | None = None,
        stderr: int = subprocess.PIPE,
        config: Path | None = None,
    ):
        self.record = folder / "board.csv"
        self.camera = Camera(folder / "camera")
        options = [
            *("--config", "/dev/null", "--camera", f"stub:unix:{folder}/camera"),
            *("--board", f"stub:{self.record}", "--lcm-url", "", "--set", "panel=none"),
            *("--set", f"width_px={WIDTH_PX}", "--set", f"height_px={HEIGHT_PX}"),
        ]
        command = [*program, *(["--config", config] if config else options), *arguments]
        self.process = subprocess.Popen(
            command,
            stderr=stderr,
            text=True,
            env={**os.environ, **(env or {})},
            start_new_session=True,  # without a terminal, as a service
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            for pid in (self.process.pid, *self.children(), *self.guards()):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()
        self.camera.unplug()

    def children(self) -> list[int]:
        """The child that drives."""
        return self._children(lambda name: name not in (GUARD, RELAY))

    def guards(self) -> list[int]:
        """The child that watches with its parent."""
        return self._children(lambda name: name == GUARD)

    def _children(self, is_it) -> list[int]:
        path = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        try:
            pids = path.read_text().split()
            return [int(p) for p in pids if is_it(Path(f"/proc/{p}/comm").read_text().strip())]
        except OSError:  # one of them is gone
            return []

    def rows(self) -> list[tuple[float, tuple[int, ...]]]:
        """Duties that the board received: monotonic time in s and four duties."""
        if not self.record.exists():
            return []
        rows = [tuple(map(int, line.split(","))) for line in self.record.open() if "\n" in line]
        return [(row[0] / 1e6, row[1:]) for row in rows]

    def duties(self) -> tuple[int, ...]:
        """Last duties that the board received."""
        rows = self.rows()
        return rows[-1][1] if rows else ZERO

    def wait_for(self, duties, timeout_s=10.0) -> bool:
        """Waits until the board has these duties."""
        return wait_until(lambda: self.duties() == duties, timeout_s)

    def end(self) -> tuple[int, str]:
        """Waits for the end: exit code and what was said on stderr."""
        _, said = self.process.communicate(timeout=20)
        return self.process.returncode, said
