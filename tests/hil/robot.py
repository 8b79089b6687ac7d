# SPDX-License-Identifier: Apache-2.0
"""The robot's program in the rig, and what is shown to its camera."""

import signal
import time
from collections.abc import Callable

from rig import BUTTON_LINE, PATIENCE_S, PRESSED, RELEASED, ZERO, Duties, End, Rig

PROGRAM = "/usr/bin/turbopi"
WIDTH_PX, HEIGHT_PX = 160, 120
FRAME_PERIOD_S = 1 / 30
# sRGB (0, 128, 0) and (128, 0, 0) in BT.601 studio range, as Y U Y V.
GREEN = bytes([81, 91, 81, 81]) * (WIDTH_PX * HEIGHT_PX // 2)
RED = bytes([49, 109, 49, 184]) * (WIDTH_PX * HEIGHT_PX // 2)
# Milling turns left when it sees and right when it does not, the slow side at 100 - 126 * 0.5 = 37;
# the board's left channels run the other way round (vendor's software).
SIGNS = (-1, 1, -1, 1)
LEFT, RIGHT = (-37, 100, -37, 100), (-100, 37, -100, 37)
LOOPBACK, VIVID = "/dev/video0", "/dev/video1"
# Chip 0 is the machine's own.
SETTINGS = (
    *("--set", "gpio_chip=/dev/gpiochip1", "--set", f"width_px={WIDTH_PX}"),
    # The emulator may be slow: only tests of it have the watchdog's own time.
    *("--set", "watchdog_ms=1000"),
    # Pictures without noise are all alike.
    *("--set", "frozen_ms=0"),
    *("--set", f"height_px={HEIGHT_PX}", "--lcm-url", "udpm://239.255.76.67:7667?ttl=0"),
)


class Watched:
    """A robot whose camera shows `view`, whoever started its program."""

    def __init__(
        self,
        rig: Rig,
        camera: str = LOOPBACK,
        size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX),
    ):
        self.rig = rig
        self.view = GREEN
        rig.mend()
        rig.standstills.clear()
        if camera == LOOPBACK:
            self._open_loopback(size_px)
        self.first = len(rig.duties)
        self.telemetry_first = len(rig.telemetry)

    def _open_loopback(self, size_px: tuple[int, int]):
        result, _ = self.rig.words("o", LOOPBACK, *size_px)
        assert result == 0
        # Without a first frame the driver refuses its readers; a part of one decides nothing.
        self.show(RED[:4])

    def show(self, frame: bytes) -> float:
        """Gives the camera one frame, or a part of one. Returns when (guest, s)."""
        result, t_s = self.rig.call("f", frame)
        assert result == len(frame)
        return t_s

    def show_until(self, condition: Callable[[], bool], limit_s: float = PATIENCE_S):
        """Shows self.view thirty times a second until a condition holds."""
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end_s:
                raise TimeoutError(f"motors {self.wire()} after {limit_s} s of frames")
            self.show(self.view)
            self.rig.pump(FRAME_PERIOD_S)

    def drive_until(self, wire: tuple[int, ...]):
        """Shows self.view until the motors have these duties."""
        self.show_until(lambda: self.wire() == wire)

    def wire(self) -> tuple[int, ...]:
        """Returns the four duties as the board has them now."""
        return self.rig.duties[-1].wire

    def since(self, t_s: float) -> list[Duties]:
        """Returns what the board was told after t_s."""
        return [duties for duties in self.rig.duties[self.first :] if duties.t_s > t_s]

    def stopped_s(self, t_s: float) -> float:
        """Returns when the motors came to zero after t_s, for good so far."""
        moving = [d.t_s for d in self.since(t_s) if d.wire != ZERO]
        return min(d.t_s for d in self.since(max(moving, default=t_s)) if d.wire == ZERO)

    def telemetry(self) -> list:
        """Returns what the program has published."""
        return self.rig.telemetry[self.telemetry_first :]

    def has(self, flag: int) -> bool:
        """Tells whether the newest telemetry has one of its STATUS flags."""
        return bool(self.telemetry()) and bool(self.telemetry()[-1].status_flags & flag)

    def press(self):
        """Holds the button for ten frames, then lets it go."""
        for outside in (PRESSED, RELEASED):
            self.rig.board(b"P", BUTTON_LINE, outside)
            end = len(self.telemetry()) + 10
            self.show_until(lambda end=end: len(self.telemetry()) >= end)

    def driver(self) -> int:
        """Returns the pid of the process that drives: the program's child."""
        return self._child("turbopi")

    def guard(self) -> int:
        """Returns the pid of the child that watches with the program."""
        return self._child("wheelguard")

    def _child(self, name: str) -> int:
        pid, _ = self.rig.words("d", self.pid, name)
        assert pid > 0, name
        return pid


class Robot(Watched):
    """The running program; as a context it is ended at the end, and the motors are at zero."""

    def __init__(
        self,
        rig: Rig,
        *arguments: str,
        camera: str = LOOPBACK,
        environment: tuple[str, ...] = (),
        heard: bool = True,
        fault: Callable[[], object] = lambda: None,
        **watching,
    ):
        super().__init__(rig, camera, **watching)
        command = (*environment, PROGRAM, *SETTINGS, "--camera", camera, *arguments)
        self.pid = rig.start(*command, heard=heard)
        fault()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.pid not in self.rig.ends:
            self.rig.kill(signal.SIGTERM, self.pid)
            self.wait_for_end()
        assert self.rig.duties[-1].wire == ZERO

    def wait_for_end(self) -> End:
        """Waits until the program has ended."""
        self.rig.wait(lambda: self.pid in self.rig.ends, what="the program's end")
        return self.rig.ends[self.pid]


SERVICE, CONFIG = "twinmill-robot.service", "/etc/turbopi/turbopi.conf"
# For the calls that are made to fail; in all else the unit is as shipped.
DROP_IN = f"/run/systemd/system/{SERVICE}.d"


def give_environment(rig: Rig, environment: tuple[str, ...]):
    """Adds words NAME=VALUE to the service's environment; none: leaves the unit as it was."""
    if environment == rig.service_environment:
        return
    rig.service_environment = environment
    lines = "".join(f"Environment={pair}\\n" for pair in environment)
    text = f"[Service]\\n{lines}ReadWritePaths=/var/failcalls\\n"
    give = f"mkdir -p {DROP_IN} && printf '{text}' >{DROP_IN}/hil.conf"
    end = rig.run("/bin/sh", "-c", give if environment else f"rm -r {DROP_IN}")
    assert end.code == 0
    rig.systemctl("daemon-reload")


class Service(Watched):
    """Program run by systemd, driving since its button was pressed."""

    def __init__(
        self,
        rig: Rig,
        *arguments: str,
        environment: tuple[str, ...] = (),
        fault: Callable[[], object] = lambda: None,
    ):
        super().__init__(rig)
        options = [word for word in (*SETTINGS, *arguments) if "=" in word and "://" not in word]
        result, _ = rig.words("w", CONFIG, "\n".join(options) + "\n")
        assert result == 0
        give_environment(rig, environment)
        rig.systemctl("reset-failed", SERVICE)
        rig.systemctl("restart", SERVICE)
        self.pid = rig.number(f"systemctl show -P MainPID {SERVICE}")
        self.show_until(lambda: any(t.frame_utime_us for t in self.telemetry()), 120)
        fault()
        self.press()
