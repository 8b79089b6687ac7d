# SPDX-License-Identifier: Apache-2.0
"""A NatNet server whose packets are laid out by hand.

Layout: NaturalPoint's NatNet SDK, "Direct Depacketization" and NatNetTypes.h: little-endian,
packed, and from 4.1 on the size of each part stands behind its count. The maker's own client reads
them in interop/capture.py.
"""

import socket
import struct
import threading
import time
from dataclasses import dataclass

START_S = 1000.0  # Motive's clock when the first frame was taken
PERIOD_S = 0.005


@dataclass
class Body:
    """A rigid body: y up, so that a turn by `turn_rad` is about y."""

    number: int
    name: str
    position: tuple = (1.0, 0.1, -2.0)
    quaternion_xyzw: tuple = (0.0, 0.0, 0.0, 1.0)
    tracked: bool = True


def packet(kind, payload):
    return struct.pack("<HH", kind, len(payload)) + payload


def text(words):
    return words.encode() + b"\0"


def counted(parts, version):
    """A count, from 4.1 on the bytes, then the parts."""
    body = b"".join(parts)
    size = struct.pack("<I", len(body)) if version >= (4, 1) else b""
    return struct.pack("<I", len(parts)) + size + body


def server_info(version, port, multicast, group):
    names = b"Motive".ljust(256, b"\0") + bytes([3, 1, 0, 0]) + bytes([*version, 0, 0])
    how = struct.pack("<QHB4B", 10_000_000, port, multicast, *map(int, group.split(".")))
    return packet(1, names + how)


def models(bodies, version):
    parts = []
    for body in bodies:
        one = text(body.name) + struct.pack("<Ii3f", body.number, -1, 0, 0, 0)
        if version >= (4, 2):
            one += struct.pack("<4f", 0, 0, 0, 1)
        one += struct.pack("<I3fI", 1, 0.0, 0.05, 0.0, 0)  # one marker: place, active label
        one += text("Marker1") if version >= (4, 0) else b""
        size = struct.pack("<I", len(one)) if version >= (4, 1) else b""
        parts.append(struct.pack("<I", 1) + size + one)
    return packet(5, struct.pack("<I", len(parts)) + b"".join(parts))


def frame(number, bodies, version):
    bodies = [
        struct.pack("<I7f", b.number, *b.position, *b.quaternion_xyzw)
        + struct.pack("<fH", 0.0002, int(b.tracked))
        for b in bodies
    ]
    cloud = text("all") + struct.pack("<I3f", 1, 9.0, 9.0, 9.0)
    payload = struct.pack("<I", number)
    payload += counted([cloud], version) + counted([struct.pack("<3f", 8, 8, 8)], version)
    payload += counted(bodies, version)
    parts = 5 if version >= (4, 1) else 4  # skeletons, assets, labelled markers, plates, devices
    payload += counted([], version) * parts
    stamp_s = START_S + PERIOD_S * number
    payload += struct.pack("<IIdQQQ", 0, 0, stamp_s, 1, 2, 3)
    payload += struct.pack("<II", 4, 5) if version >= (4, 1) else b""  # the precise stamp
    payload += struct.pack("<HI", 0, 0)
    return packet(7, payload)


class Motive:
    """Answers and streams in a thread; a context."""

    def __init__(self, bodies, version=(3, 1), multicast=False, group="239.255.42.99", **how):
        self.bodies, self.version, self.multicast, self.group = bodies, version, multicast, group
        self.streams, self.told_multicast = how.get("streams", True), how.get("told", multicast)
        self.extra = how.get("extra", lambda number: b"")
        self.turn = how.get("turn", lambda number, body: body)
        self.ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.ear.bind(("127.0.0.1", 0))
        self.ear.settimeout(PERIOD_S)
        self.port = self.ear.getsockname()[1]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("", 0))
            self.data_port = free.getsockname()[1]
        self.clients, self.number, self.over = set(), 0, threading.Event()
        self.thread = threading.Thread(target=self.serve)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.over.set()
        self.thread.join()
        self.ear.close()

    def serve(self):
        local = socket.inet_aton("127.0.0.1")
        self.ear.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, local)
        next_s = time.monotonic()
        while not self.over.is_set():
            self.answer()
            while self.streams and time.monotonic() >= next_s:
                next_s += PERIOD_S
                self.send_frame()

    def answer(self):
        try:
            asked, client = self.ear.recvfrom(2000)
        except OSError:
            return
        kind = struct.unpack_from("<H", asked)[0]
        if kind == 0:
            info = server_info(self.version, self.data_port, self.told_multicast, self.group)
            self.ear.sendto(info, client)
            self.clients.add(client)
        elif kind == 4:
            self.ear.sendto(models(self.bodies, self.version), client)

    def send_frame(self):
        bodies = [self.turn(self.number, body) for body in self.bodies]
        sent = [frame(self.number, bodies, self.version), self.extra(self.number)]
        self.number += 1
        to = [(self.group, self.data_port)] if self.multicast else list(self.clients)
        for one in filter(None, sent):
            for client in to:
                self.ear.sendto(one, client)
