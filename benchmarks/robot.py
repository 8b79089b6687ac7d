# SPDX-License-Identifier: Apache-2.0
"""The robot's program with a socket for a camera and a file for a motor board."""

import socket
import subprocess
import time
from pathlib import Path
from typing import Self

import numpy as np
import scene


class Robot:
    """The running program, which drives; a context that ends it."""

    def __init__(
        self, program: Path, folder: Path, lcm_url: str, settings: tuple[str, ...] = ()
    ) -> None:
        """Starts it; `settings` are KEY=VALUE of its configuration."""
        camera_path, self._record = folder / "camera", folder / "board.csv"
        for path in (camera_path, self._record):
            path.unlink(missing_ok=True)
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(camera_path))
        listener.listen()
        settings += ("panel=none", f"width_px={scene.WIDTH_PX}", f"height_px={scene.HEIGHT_PX}")
        self.process = subprocess.Popen(
            [
                *(str(program), "--config", "/dev/null", "--start"),
                *("--camera", f"stub:unix:{camera_path}", "--board", f"stub:{self._record}"),
                *("--lcm-url", lcm_url, "--set", "vote_frames=1"),
                *(word for setting in settings for word in ("--set", setting)),
            ],
            stderr=subprocess.DEVNULL,
        )
        listener.settimeout(10)
        self._camera, _ = listener.accept()
        listener.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._camera.close()
        self.process.terminate()
        self.process.wait()

    def show(self, frame: np.ndarray) -> int:
        """Sends a frame. Returns the monotonic time before its first byte, in us."""
        begin_us = time.monotonic_ns() // 1000
        self._camera.sendall(frame.tobytes())
        return begin_us

    def rows(self) -> np.ndarray:
        """Duties that the board received: (N, 5) monotonic time in us, four duties in percent."""
        return np.loadtxt(self._record, delimiter=",", dtype=np.int64, ndmin=2)

    def driver(self) -> int:
        """The process that drives: the child of the program's name."""
        return next(
            pid for pid in self.pids()[1:] if self._name(pid) == self._name(self.process.pid)
        )

    def pids(self) -> list[int]:
        """The process that was started, and all that it did."""
        pid = self.process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [pid, *map(int, children)]

    @staticmethod
    def _name(pid: int) -> str:
        return Path(f"/proc/{pid}/comm").read_text()
