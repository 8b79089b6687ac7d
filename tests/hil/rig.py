# SPDX-License-Identifier: Apache-2.0
"""The rig: a guest in QEMU whose hardware is made up, and what the robot's program does to it."""

import os
import select
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import turbopi

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build/hil"
KERNEL = os.environ.get("HIL_KERNEL", "linux-image-arm64")
SUITE = os.environ.get("HIL_SUITE", "bookworm")
SETUP_LIMIT_S, BOOT_LIMIT_S, CALL_LIMIT_S = 600, 300, 60
# An emulated systemd has much to do, and the machine may be busy.
SYSTEM_LIMIT_S = 300
PATIENCE_S = 120.0  # ends what hangs: a busy machine runs the guest several times slower
CANNOT = 77  # exit code of a script that says why it cannot

HEADER = struct.Struct("<B3xI")
ANSWER = struct.Struct("<qQ")
EVENT = struct.Struct("<Q3B21s")
END = struct.Struct("<iiQ")
STANDSTILL = struct.Struct("<QQ")
LCM_HEADER = struct.Struct(">4sI")

# The vendor's board: registers of the four duties, and of the pack's voltage.
MOTOR_REGISTER, BATTERY_REGISTER = 0x1F, 0x00
PACK_MV = 8000
ZERO = (0, 0, 0, 0)
# The start button, low while pressed.
BUTTON_LINE = 13
PRESSED, RELEASED = 0, 1
NONE_REFUSED = 255


class StoodStill(Exception):
    """The machine did other work meanwhile: what was measured is not the program's."""


class CannotRun(Exception):
    """This machine cannot run the rig; the message says why."""


@dataclass(frozen=True)
class Duties:
    """Contents of the board's four motor registers since t_s (guest's CLOCK_MONOTONIC)."""

    t_s: float
    wire: tuple[int, ...]


@dataclass(frozen=True)
class Level:
    """An output line changed at t_s."""

    t_s: float
    line: int
    value: int


@dataclass(frozen=True)
class End:
    """A process ended at t_s: exit code, or minus the signal that killed it."""

    t_s: float
    code: int


def _script(name: str, limit_s: float = SETUP_LIMIT_S) -> str:
    """Runs a script of this folder. Returns what it says on stdout."""
    done = subprocess.run(
        [HERE / name, KERNEL, SUITE], capture_output=True, text=True, timeout=limit_s, check=False
    )
    if done.returncode == CANNOT:
        raise CannotRun(done.stderr.strip().splitlines()[-1].removeprefix("hil: "))
    if done.returncode:
        raise RuntimeError(f"{name} failed:\n{done.stdout}{done.stderr}")
    return done.stdout.strip()


def prepare() -> Path:
    """Fetches and builds what is missing. Returns the initramfs. Raises CannotRun."""
    _script("setup")
    return Path(_script("build_guest"))


def prepare_system() -> Path:
    """Builds a whole Debian with the package's file in its root. Returns the initramfs."""
    prepare()
    return Path(_script("build_system"))


class Rig:
    """A booted guest. As a context its QEMU is killed at the end, whatever happened.

    Attributes:
        duties: every change of the motor registers, oldest first.
        levels: every change of an output line.
        telemetry: what the program published.
        ends: processes that ended, by pid.
        console: the guest's console, kept after the end.
        standstills: for how long (guest, s) nothing ran in the guest since the newest robot began.
        service_environment: what the service has besides its unit's own.
    """

    def __init__(self, image: Path, name: str, *, memory_mb: int = 256):
        self.console = BUILD / f"{name}.console.log"
        self.duties = [Duties(0.0, ZERO)]
        self.levels: list[Level] = []
        self.telemetry: list = []
        self.ends: dict[int, End] = {}
        self.standstills: list[float] = []
        self.service_environment: tuple[str, ...] = ()
        self._answers: list[tuple[int, int]] = []
        self._ready = False
        self._inbox = bytearray()
        self._folder = tempfile.mkdtemp(prefix="hil")
        self.begin_s = time.monotonic()
        self._qemu = self._start(image, memory_mb)
        try:
            self._port = self._connect(f"{self._folder}/port")
            self.wait(lambda: self._ready, BOOT_LIMIT_S, "the guest to come up")
            self.boot_s = time.monotonic() - self.begin_s
        except BaseException:
            self.close()
            raise

    def _start(self, image: Path, memory_mb: int) -> subprocess.Popen:
        self.console.unlink(missing_ok=True)
        kernel = ROOT / ".deps/hil" / KERNEL / "vmlinuz"
        port = f"{self._folder}/port"
        command = (
            # Even if this process is killed, QEMU does not outlive it.
            "setpriv --pdeathsig KILL qemu-system-aarch64"
            # 2^2 ns for each instruction, 250 million a second (a Pi 4: 1500 million cycles): what
            # it works takes the same time in the guest, however slowly it is emulated.
            " -accel tcg,thread=single -icount shift=2,sleep=on -M virt -cpu cortex-a53 -nodefaults"
            f" -m {memory_mb}M -display none -monitor none -no-reboot -device virtio-serial-pci"
            " -device virtserialport,chardev=port,name=hil.0"
        ).split()
        return subprocess.Popen(
            [
                *command,
                *("-chardev", f"socket,id=port,path={port},server=on,wait=off"),
                *("-serial", f"file:{self.console}", "-kernel", kernel, "-initrd", image),
                *("-append", "console=ttyAMA0 panic=-1 quiet mitigations=off"),
            ],
            stdin=subprocess.DEVNULL,
        )

    def _connect(self, path: str) -> socket.socket:
        port = socket.socket(socket.AF_UNIX)
        end_s = time.monotonic() + BOOT_LIMIT_S
        while True:
            try:
                port.connect(path)
                return port
            except OSError:
                if time.monotonic() > end_s or self._qemu.poll() is not None:
                    raise
                time.sleep(0.02)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @contextmanager
    def slowed(self):
        """The machine gives the guest a tenth of a processor, in pieces too short to be noticed."""
        over = threading.Event()

        def slow():
            while not over.wait(0.002):
                self._qemu.send_signal(signal.SIGSTOP)
                time.sleep(0.018)
                self._qemu.send_signal(signal.SIGCONT)

        thread = threading.Thread(target=slow)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def close(self):
        """Kills QEMU by its pid and waits for it."""
        self._qemu.kill()
        self._qemu.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    # What the guest says

    def pump(self, timeout_s: float = 0.0):
        """Takes all that has come, waiting up to timeout_s for something."""
        while select.select([self._port], [], [], timeout_s)[0]:
            timeout_s = 0.0
            got = self._port.recv(1 << 16)
            if not got:
                raise RuntimeError(f"the guest is gone: see {self.console}")
            self._inbox += got
            self._take_messages()

    def _take_messages(self):
        while len(self._inbox) >= HEADER.size:
            kind, length = HEADER.unpack_from(self._inbox)
            if len(self._inbox) < HEADER.size + length:
                return
            payload = bytes(self._inbox[HEADER.size : HEADER.size + length])
            del self._inbox[: HEADER.size + length]
            self._take(chr(kind), payload)

    def _take(self, kind: str, payload: bytes):
        if kind == "r":
            self._ready = True
        elif kind == "a":
            self._answers.append(ANSWER.unpack(payload))
        elif kind == "h":
            self._take_event(*EVENT.unpack(payload))
        elif kind == "t":
            self._take_packet(payload)
        elif kind == "s":
            self.standstills.append(STANDSTILL.unpack(payload)[1] / 1e9)
        elif kind == "e":
            pid, status, t_ns = END.unpack(payload)
            self.ends[pid] = End(t_ns / 1e9, os.waitstatus_to_exitcode(status))

    def _take_event(self, t_ns: int, kind: int, register: int, length: int, data: bytes):
        if chr(kind) == "G":
            self.levels.append(Level(t_ns / 1e9, register, data[0]))
            return
        wire = list(self.duties[-1].wire)
        first = register - MOTOR_REGISTER
        assert first >= 0 and first + length <= 4, f"a write to register {register:#x}"
        wire[first : first + length] = struct.unpack(f"{length}b", data[:length])
        self.duties.append(Duties(t_ns / 1e9, tuple(wire)))

    def _take_packet(self, packet: bytes):
        magic, _ = LCM_HEADER.unpack_from(packet)
        channel, _, message = packet[LCM_HEADER.size :].partition(b"\0")
        if magic == b"LC02" and channel.endswith(b"_TELEMETRY"):
            self.telemetry.append(turbopi.telemetry_t.decode(message))

    def said(self) -> str:
        """Returns what the console has shown so far."""
        return self.console.read_text(errors="replace")

    def wait(self, condition: Callable[[], bool], limit_s: float = PATIENCE_S, what: str = "it"):
        """Waits for a condition. Raises TimeoutError."""
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end_s:
                raise TimeoutError(
                    f"waited {limit_s} s for {what}; motors {self.duties[-1]}; see {self.console}"
                )
            self.pump(0.02)

    # What the host asks for

    def call(self, kind: str, payload: bytes) -> tuple[int, float]:
        """Has one command done. Returns its result (minus errno) and when it began (guest, s)."""
        self._port.sendall(HEADER.pack(ord(kind), len(payload)) + payload)
        self.wait(lambda: bool(self._answers), CALL_LIMIT_S, f"the answer to '{kind}'")
        result, t_ns = self._answers.pop()
        return result, t_ns / 1e9

    def words(self, kind: str, *words: object) -> tuple[int, float]:
        """As call(), of words."""
        return self.call(kind, b"".join(str(word).encode() + b"\0" for word in words))

    def board(self, kind: bytes, *numbers: int):
        """Gives the module one command."""
        result, _ = self.call("b", kind + bytes(numbers))
        assert result == 1 + len(numbers), os.strerror(-result)

    def mend(self):
        """Makes the board answer, its pack full and its button released."""
        self.board(b"N", 0)
        self.board(b"B", NONE_REFUSED)
        self.board(b"R", BATTERY_REGISTER, *PACK_MV.to_bytes(2, "little"))
        self.board(b"P", BUTTON_LINE, RELEASED)

    def start(self, *command: object, heard: bool = True) -> int:
        """Starts a program, words NAME=VALUE of its environment first. Returns its pid.

        Without being heard it writes its messages into a pipe that is full.
        """
        pid, _ = self.words("x" if heard else "y", *command)
        assert pid > 0
        return pid

    def run(self, *command: object, limit_s: float = 60.0) -> End:
        """Runs a program to its end."""
        pid = self.start(*command)
        self.wait(lambda: pid in self.ends, limit_s, str(command[0]))
        return self.ends[pid]

    def number(self, command: str) -> int:
        """Runs a line of shell that prints a number."""
        assert (
            self.run("/bin/sh", "-c", f"{command} > /tmp/number", limit_s=SYSTEM_LIMIT_S).code == 0
        ), command
        number, _ = self.words("n", "/tmp/number")
        return number

    def systemctl(self, *words: object) -> End:
        """Has systemd do something, which must succeed."""
        end = self.run("/bin/systemctl", *words, limit_s=SYSTEM_LIMIT_S)
        assert end.code == 0, words
        return end

    def kill(self, signal_number: int, *pids: int) -> float:
        """Sends a signal; all but the first may have ended by then. Returns when (guest, s)."""
        reached, t_s = self.words("k", int(signal_number), *pids)
        assert reached > 0, os.strerror(-reached) if reached else "no such process"
        return t_s
