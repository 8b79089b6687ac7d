# SPDX-License-Identifier: Apache-2.0
"""Frames of OptiTrack Motive's NatNet stream.

The library `natnet` decodes packets. The sockets are ours: what the server says of its stream
(sSender_Server in NaturalPoint's NatNetTypes.h) decides how to listen, and a packet that cannot be
read is counted and dropped.
"""

import select
import socket
import struct
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from natnet import DataDescriptions, DataFrame, NatNetError, Version
from natnet.packet_buffer import PacketBuffer

from twinmill.arguments import option

COMMAND_PORT, DATA_PORT, GROUP = 1510, 1511, "239.255.42.99"
CONNECT, SERVER_INFO, REQUEST_MODELS, MODELS, FRAME, KEEP_ALIVE = 0, 1, 4, 5, 7, 10
HEADER = struct.Struct("<HH")
CONNECTION = struct.Struct("<QHB4B")  # clock's frequency, data port, multicast or not, its group
NAME_BYTES, SENDER_BYTES = 256, 264  # of the program; with both versions
PACKET_MAX = 65535
ANSWER_S, AGAIN_S = 2.0, 0.5
LONGEST_S = 1e9  # since Motive was started
OFFSET_S = 10.0  # the quickest packet of so long tells the clocks' offset


class StreamError(ValueError):
    """Why nothing arrives, in a sentence."""


@dataclass(frozen=True)
class Server:
    """Motive's description of itself and of its stream.

    Attributes:
        address, local: its address; ours on the way to it.
        port: on which it is asked.
        name, protocol: of the program; of its packets.
        multicast: whether it streams so; None: too old to say.
        group, data_port: where to, if so.
    """

    address: str
    local: str
    port: int
    name: str
    protocol: Version
    multicast: bool | None = None
    group: str = GROUP
    data_port: int = DATA_PORT


def find_server(address: str, local: str = "", port: int = COMMAND_PORT) -> Server:
    """Asks the server what it is.

    Raises:
        StreamError: it does not answer, and why that may be.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        way = local
        try:
            if local:
                ear.bind((local, 0))
            ear.connect((address, port))
            way = ear.getsockname()[0]
            ear.settimeout(ANSWER_S)
            ear.send(request(CONNECT, b"Ping"))
            packet = ear.recv(PACKET_MAX)
        except ConnectionRefusedError as error:
            raise StreamError(
                f"{address} is there, but nothing listens on its port {port}: start Motive and "
                "turn its streaming on (Settings, Streaming)."
            ) from error
        except TimeoutError as error:
            raise StreamError(
                f"{address} does not answer on port {port}, asked from {way}: see that this is the "
                "address of Motive's computer on this network (Settings, Streaming, Local "
                "Interface), that streaming is on, and that its firewall lets Motive through (UDP "
                f"{port} and {DATA_PORT})."
            ) from error
        except OSError as error:
            which = f"{option('local', local)}" if local else f"{option('server', address)}"
            raise StreamError(
                f"{which}: {error.strerror or error}; give addresses of one network "
                "(`ip address` shows those of this machine)."
            ) from error
    kind, payload = unpacked(packet)
    if kind != SERVER_INFO or len(payload) < SENDER_BYTES:
        raise StreamError(f"{address}: what answers on port {port} is no NatNet server.")
    name = payload[:NAME_BYTES].partition(b"\0")[0].decode(errors="replace")
    protocol = Version(*payload[SENDER_BYTES - 4 : SENDER_BYTES])
    if len(payload) < SENDER_BYTES + CONNECTION.size:
        return Server(address, way, port, name, protocol)
    _, data_port, multicast, *group = CONNECTION.unpack_from(payload, SENDER_BYTES)
    group = ".".join(map(str, group))
    return Server(
        address=address,
        local=way,
        port=port,
        name=name,
        protocol=protocol,
        multicast=bool(multicast),
        group=group,
        data_port=data_port,
    )


def request(kind: int, payload: bytes = b"") -> bytes:
    """A packet to the server."""
    return HEADER.pack(kind, len(payload) + 1) + payload + b"\0"


def unpacked(packet: bytes) -> tuple[int, bytes]:
    """Kind and payload; -1 of what is no packet."""
    if len(packet) < HEADER.size:
        return -1, b""
    kind, size = HEADER.unpack_from(packet)
    return kind, packet[HEADER.size : HEADER.size + size]


def _sane(frame: DataFrame) -> DataFrame:
    """The frame.

    Raises:
        ValueError: its number or stamp can be none.
    """
    if not (0 <= frame.prefix.frame_number < 2**31 and 0 <= frame.suffix.timestamp < LONGEST_S):
        raise ValueError("a frame has a number or a stamp that can be none")
    return frame


class Packet(PacketBuffer):
    """The library's reader, which believes any count: here none goes beyond the packet."""

    def read_float32_array(self, count: int) -> tuple[float, ...]:
        """So many numbers.

        Raises:
            ValueError: the packet does not have them.
        """
        if 4 * count > len(self.data) - self.pointer:
            raise ValueError("a packet says that it has more than it has")
        return super().read_float32_array(count)

    def read_string(self, max_length: int | None = None, static_length: bool = False) -> str:
        """A text.

        Raises:
            ValueError: the packet is at its end.
        """
        if self.pointer >= len(self.data):
            raise ValueError("a packet ends where a text should be")
        return super().read_string(max_length, static_length)


class Stream:
    """Frames of one server.

    Attributes:
        server: whose.
        multicast: listens to its group, beside what is sent to us alone.
        names: of rigid bodies by their number in the stream, once the server has told them.
        broken: packets that could not be read.
        strangers: addresses of others that sent to us; their packets are dropped.
    """

    def __init__(self, server: Server, multicast: bool | None = None) -> None:
        """Listens as the server says that it streams, or as it is told.

        Raises:
            StreamError: the group cannot be joined.
        """
        told = server.multicast if multicast is None else multicast
        self.server, self.multicast = server, told is not False
        self.names: dict[int, str] = {}
        self.broken = 0
        self.strangers: set[str] = set()
        self._asked_s = -1e9
        self._offsets: deque[tuple[float, float]] = deque()
        self._mouth = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._mouth.bind((server.local, 0))
        self._ears = [self._mouth]
        if self.multicast:
            self._ears.append(self._joined())

    def _joined(self) -> socket.socket:
        server, ear = self.server, socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            ear.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            ear.bind((server.group, server.data_port))
            both = socket.inet_aton(server.group) + socket.inet_aton(server.local)
            ear.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, both)
        except OSError as error:
            ear.close()
            self.close()
            raise StreamError(
                f"{server.group}:{server.data_port} cannot be joined on {server.local} "
                f"({error.strerror}): another program has the port, or there is no multicast."
            ) from error
        return ear

    def close(self) -> None:
        """Listens no more."""
        for ear in self._ears:
            ear.close()

    def frames(self, duration_s: float) -> Iterator[tuple[float, DataFrame]]:
        """Each frame, and when it was taken: s since the Unix epoch by our clock.

        A frame's stamp is Motive's. The offset to our clock is that of the quickest packet of the
        last ten seconds: the network's jitter is not in it, its least delay is.
        """
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0:
            self._ask()
            for ear in select.select(self._ears, [], [], min(left_s, AGAIN_S))[0]:
                try:
                    packet, (sender, _) = ear.recvfrom(PACKET_MAX)
                except OSError:  # the server's port was closed for a moment
                    continue
                if sender != self.server.address:
                    self.strangers.add(sender)
                    continue
                arrived_s = time.time()
                if frame := self._read(packet):
                    yield self._on_our_clock(frame.suffix.timestamp, arrived_s), frame

    def _ask(self) -> None:
        """Says that we are here, and asks for the names until they are known."""
        now_s = time.monotonic()
        if now_s - self._asked_s < AGAIN_S:
            return
        self._asked_s = now_s
        heard = self._offsets and self._offsets[-1][0] > time.time() - ANSWER_S
        kinds = [KEEP_ALIVE if heard else CONNECT]  # a server that was started anew knows nobody
        kinds += [] if self.names else [REQUEST_MODELS]
        for kind in kinds:
            self._mouth.sendto(request(kind), (self.server.address, self.server.port))

    def _read(self, packet: bytes) -> DataFrame | None:
        kind, payload = unpacked(packet)
        buffer, protocol = Packet(payload), self.server.protocol
        try:
            if kind == MODELS:
                models = DataDescriptions.read_from_buffer(buffer, protocol)
                self.names |= {body.id_num: body.name for body in models.rigid_bodies}
            if kind == FRAME:
                return _sane(DataFrame.read_from_buffer(buffer, protocol))
        except (NatNetError, struct.error, ValueError):
            self.broken += 1
        return None

    def _on_our_clock(self, stamp_s: float, arrived_s: float) -> float:
        self._offsets.append((arrived_s, arrived_s - stamp_s))
        while self._offsets[0][0] < arrived_s - OFFSET_S:
            self._offsets.popleft()
        return stamp_s + min(offset for _, offset in self._offsets)
