# SPDX-License-Identifier: Apache-2.0
"""LCM's log files, by its C library and by its wheel for Python, which is another version."""

import ctypes
import struct
import sys
from itertools import pairwise
from pathlib import Path

from interop import drive
from interop.cells import ROOT, Told, reads, writes

FILE = "run.lcmlog"
POSE = "R01_POSE"


def _write(folder: Path) -> None:
    """By `Log.save`, from data frames."""
    import numpy as np
    import pandas as pd

    import twinmill as tm

    k = np.arange(drive.COUNT)
    there = np.array([drive.seen(n) for n in k])
    x_m = np.where(there, [drive.x_m(n) for n in k], np.nan)
    t_s = k * drive.STEP_US * 1e-6
    poses = pd.DataFrame({"t_s": t_s, "robot_id": 1, "x_m": x_m, "y_m": 0.0, "theta_rad": 0.0})
    told = pd.DataFrame({"t_s": t_s, "robot_id": 1, "vy_mps": 0.0, "omega_radps": 0.0})
    told["vx_mps"] = drive.SPEED_MPS * (k >= drive.STANDS)
    tm.Log.from_frames(poses, told, robot_id=1).save(folder / FILE)


def _told(events: list[tuple[int, str, bytes]]) -> Told:
    """Facts in events; a pose's payload by the order of fields in pose_t.lcm, big-endian."""
    poses = [data for _, channel, data in events if channel == POSE]
    stamps = [at for at, _, _ in events]
    first = [struct.unpack_from(">q", data, 8)[0] for data in poses]
    return {
        "events in order of time": stamps == sorted(stamps),
        "channels": {channel for _, channel, _ in events} >= {POSE, "R01_DRIVE"},
        "poses": len(poses) == drive.COUNT,
        "steps of their stamps": all(abs(b - a - drive.STEP_US) <= 1 for a, b in pairwise(first)),
    }


class _Event(ctypes.Structure):
    _fields_ = [
        ("eventnum", ctypes.c_int64),
        ("timestamp", ctypes.c_int64),
        ("channellen", ctypes.c_int32),
        ("datalen", ctypes.c_int32),
        ("channel", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
    ]


def _library() -> ctypes.CDLL:
    library = ctypes.CDLL("liblcm.so.1")
    library.lcm_eventlog_create.restype = ctypes.c_void_p
    library.lcm_eventlog_read_next_event.restype = ctypes.POINTER(_Event)
    for name in ("read_next_event", "destroy"):
        getattr(library, f"lcm_eventlog_{name}").argtypes = [ctypes.c_void_p]
    library.lcm_eventlog_free_event.argtypes = [ctypes.POINTER(_Event)]
    library.lcm_eventlog_write_event.argtypes = [ctypes.c_void_p, ctypes.POINTER(_Event)]
    return library


@writes("LCM log", "LCM, C library", "liblcm1", ours=_write)
def c(folder: Path) -> Told:
    """`lcm_eventlog_read_next_event` to the end."""
    library, events = _library(), []
    log = library.lcm_eventlog_create(str(folder / FILE).encode(), b"r")
    while event := library.lcm_eventlog_read_next_event(log):
        e = event.contents
        data = ctypes.string_at(e.data, e.datalen)
        events.append((e.timestamp, e.channel[: e.channellen].decode(), data))
        library.lcm_eventlog_free_event(event)
    library.lcm_eventlog_destroy(log)
    return _told(events)


@writes("LCM log", "LCM, Python", "lcm==1.5.3", ours=_write)
def python(folder: Path) -> Told:
    """`lcm.EventLog`."""
    import lcm

    return _told([(e.timestamp, e.channel, e.data) for e in lcm.EventLog(str(folder / FILE), "r")])


def _read(folder: Path) -> Told:
    return drive.told_of_import(folder / drive.LOG, "duty")


@reads("LCM log", "LCM, C library", "liblcm1", ours=_read)
def c_writes(folder: Path) -> None:
    """`lcm_eventlog_write_event` for each message."""
    library = _library()
    log = library.lcm_eventlog_create(str(folder / drive.LOG).encode(), b"w")
    for stamp_us, channel, data in drive.events():
        payload = ctypes.create_string_buffer(data, len(data))
        address = ctypes.cast(payload, ctypes.c_void_p)
        event = _Event(0, stamp_us, len(channel), len(data), channel.encode(), address)
        library.lcm_eventlog_write_event(log, event)
    library.lcm_eventlog_destroy(log)


@reads("LCM log", "LCM, Python", "lcm==1.5.3", ours=_read)
def python_writes(folder: Path) -> None:
    """`lcm.EventLog`; the messages' code is what lcm-gen made for the build."""
    sys.path.append(str(ROOT / "build/lcm_types/generated/python"))
    drive.write_log(folder)
