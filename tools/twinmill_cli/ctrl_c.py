# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C at the terminal of a command that moves robots: does it come, and what would keep it."""

from __future__ import annotations

import fcntl
import os
import struct
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from twinmill.streams import STDERR, STDOUT

if TYPE_CHECKING:
    from twinmill.robots.fleet import Fleet

INTERRUPT_KEY = b"\x03"  # Ctrl-C, unless `stty intr` chose another
LOCAL, KEYS = 3, 6  # places in what tcgetattr gives


def key_reaches() -> bool:
    """Ctrl-C comes to this program: it is in the foreground of its terminal, where that key ends.

    Not so behind `&`, under cron, over ssh without `-t`, or below `timeout` in a script.
    """
    with _terminal() as terminal:
        try:
            *_, local, _, _, keys = termios.tcgetattr(terminal)
            is_set = bool(local & termios.ISIG) and keys[termios.VINTR] == INTERRUPT_KEY
            return is_set and _is_ours(terminal)
        except (OSError, termios.error):
            return False


def has_terminal() -> bool:
    """A terminal that is closed sends this program SIGHUP."""
    with suppress(OSError):
        os.close(os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY))
        return True
    return False


@contextmanager
def kept_free(fleet: Fleet) -> Iterator[None]:
    """Nothing that is typed keeps a Ctrl-C behind it from this program while the fleet listens.

    A key that quotes the next one (Ctrl-V) would swallow it, be it pressed before; and behind lines
    that nobody reads, as of a paste, a terminal that is full takes none. Other keys are left.

    Args:
        fleet: whose watch it is.
    """
    watch = fleet.watch
    with _terminal() as terminal:
        none = _bytes_of_none(terminal)
        quotes = none

        def look() -> None:
            nonlocal quotes
            with suppress(OSError, termios.error):  # it is closed
                if _is_ours(terminal):
                    quotes = _without_quoting(terminal, none) or quotes
                    _make_room(terminal)
            watch()

        fleet.watch = look
        try:
            look()
            yield
        finally:
            fleet.watch = watch
            if quotes != none:
                with suppress(OSError, termios.error):
                    _set_quoting(terminal, quotes)


def _bytes_of_none(terminal: int) -> bytes:
    """Stands for no key."""
    with suppress(OSError):
        return bytes([os.fpathconf(terminal, "PC_VDISABLE")])
    return b"\0"


def _without_quoting(terminal: int, none: bytes) -> bytes:
    """The key that quoted until now, if any did; none does now, nor has one that waits."""
    attributes = termios.tcgetattr(terminal)
    quotes = attributes[KEYS][termios.VLNEXT]
    if quotes == none or not attributes[LOCAL] & termios.ICANON:
        return b""
    attributes[KEYS][termios.VLNEXT] = none
    # The kernel forgets a quote that waits for its key where this changes (n_tty_set_termios).
    for local in (attributes[LOCAL] & ~termios.ICANON, attributes[LOCAL]):
        attributes[LOCAL] = local
        termios.tcsetattr(terminal, termios.TCSANOW, attributes)
    return quotes


def _set_quoting(terminal: int, key: bytes) -> None:
    attributes = termios.tcgetattr(terminal)
    attributes[KEYS][termios.VLNEXT] = key
    termios.tcsetattr(terminal, termios.TCSANOW, attributes)


def _make_room(terminal: int) -> None:
    """Drops lines that nobody reads while they are more than POSIX has any terminal take.

    By reading: what comes behind those that tcflush drops, Linux 6.18 never looked at.
    """
    while _waiting(terminal) >= os.fpathconf(terminal, "PC_MAX_INPUT"):
        os.read(terminal, _waiting(terminal))


def _waiting(terminal: int) -> int:
    """Bytes of whole lines that are typed and not read."""
    (count,) = struct.unpack("i", fcntl.ioctl(terminal, termios.FIONREAD, bytes(4)))
    return count


def _is_ours(terminal: int) -> bool:
    """This program is in its foreground: what is typed is for it."""
    return os.tcgetpgrp(terminal) == os.getpgrp()


@contextmanager
def _terminal() -> Iterator[int]:
    """A handle of this program's terminal, or a standard file, which may be none."""
    try:
        terminal = os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:  # there is none, or too many files are open
        yield next((handle for handle in (0, STDOUT, STDERR) if os.isatty(handle)), STDERR)
        return
    try:
        yield terminal
    finally:
        os.close(terminal)
