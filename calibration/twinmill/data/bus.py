# SPDX-License-Identifier: Apache-2.0
"""LCM's bus on UDP, read by code that any packet may come to.

The receiver of LCM's C library does not check all that a packet claims (programs with 1.3.1 and
1.5.3 ended). Here a packet that is not as it should be is dropped.
"""

import array
import errno
import fcntl
import re
import resource
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any
from urllib.parse import parse_qs, urlsplit

import lcm

Handler = Callable[[str, bytes], Any]
Address = tuple[str, int]

DEFAULT = ("239.255.76.67", 7667)
MAGIC_SHORT = b"LC02"  # all of a message in one datagram; longer ones are no message of ours
HEADER = struct.Struct(">4sI")
CHANNEL_MAX = 63
DATAGRAM_MAX = 65535
RECEIVE_BUFFER_BYTES = 2 << 20
PAIRS_MAX = 100  # of addresses from which the same bytes came: anybody can be many
SKIP_S = 0.01  # beyond a time-out, to get past what nobody subscribed to
REJOIN_S = 1.0  # networks come and go: Wi-Fi is made anew, a cable is unplugged
KINDS = ("udpm", "tcpq", "memq", "file")  # of buses that LCM's library has
# From Linux's <linux/sockios.h>, <net/if.h> and <net/if_arp.h>.
SIOCGIFCONF, SIOCGIFFLAGS, SIOCGIFHWADDR, SIOCGIFINDEX = 0x8912, 0x8913, 0x8927, 0x8933
IFREQ_BYTES, NAME_BYTES = 40, 16
NETWORKS_MAX = 256
TOO_MANY = (errno.EMFILE, errno.ENFILE)
NO_NETWORK = (
    "there is no network; is there one with a route for multicast "
    "(ip route add 224.0.0.0/4 dev DEVICE)?"
)
IFF_LOOPBACK, IFF_RUNNING, ARPHRD_ETHER = 0x8, 0x40, 1


def open_bus(url: str, *, needs_network: bool = True, hears: bool = True) -> Any:
    """A UdpBus, or what the library has for other kinds of buses, as file:// and tcpq://.

    Args:
        url: of the bus.
        needs_network: else the bus waits for one, and what is said meanwhile fails.
        hears: as of UdpBus.

    Raises:
        RuntimeError: there is no such bus; a sentence says why not, and what to do.
    """
    check_url(url)
    if url == "" or url.startswith("udpm:"):
        bus = UdpBus(url, hears=hears)
        if needs_network and not bus.has_network:
            raise RuntimeError(NO_NETWORK)
        return bus
    return lcm.LCM(url)


def why_no_socket(error: OSError, port: int) -> str:
    """Sentence on what keeps a bus at this port from being joined, and what to do."""
    if error.errno == errno.EADDRINUSE:
        return (
            f"another program has UDP port {port} and shares it with nobody; "
            f"`sudo ss -ulnp sport = :{port}` names it: end it."
        )
    return too_many_files(error) or f"{error.strerror}."


def too_many_files(error: BaseException | None) -> str:
    """Sentence on the limit that kept something from being opened, and what to do; else empty."""
    if not (isinstance(error, OSError) and error.errno in TOO_MANY):
        return ""
    if error.errno == errno.ENFILE:
        return "too many files are open on this computer: end what has so many open."
    most, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    enough = 1024 if hard == resource.RLIM_INFINITY else min(1024, hard)
    remedy = f"`ulimit -n {enough}` allows more" if enough > most else "a new terminal allows more"
    return f"too many open files: {most} are allowed to this program; {remedy}."


def check_url(url: str) -> None:
    """Raises RuntimeError if no bus has such a URL; whether it can be joined is not asked."""
    kind = urlsplit(url).scheme
    if not url.isprintable():
        raise RuntimeError(f"{url}: has characters that no URL has")
    if url and kind not in KINDS:
        raise RuntimeError(f"{url}: begins with none of {', '.join(f'{k}://' for k in KINDS)}")
    if kind == "udpm":
        _parse_url(url)


def parse_packet(packet: bytes) -> tuple[str, bytes] | None:
    """Channel and payload of a datagram, or None if it is not one of LCM's whole messages."""
    if len(packet) < HEADER.size or packet[:4] != MAGIC_SHORT:
        return None
    end = packet.find(b"\0", HEADER.size, HEADER.size + CHANNEL_MAX + 1)
    if end < 0:
        return None
    try:
        return packet[HEADER.size : end].decode("ascii"), packet[end + 1 :]
    except UnicodeDecodeError:
        return None


class Senders:
    """Who spoke on a channel that is one robot's, in the last seconds."""

    WINDOW_S = 2.0

    def __init__(self):
        self._recent: deque[tuple[float, Address]] = deque()
        self._said: deque[tuple[float, Address | None, bytes]] = deque()
        self._copies: dict[tuple[Address, Address], float] = {}

    def add(self, sender: Address | None) -> None:
        """Somebody spoke just now; None: the bus cannot tell who."""
        now_s = time.monotonic()
        if sender:
            self._recent.append((now_s, sender))
        self._forget(self._recent, now_s)

    def is_copy(self, sender: Address | None, data: bytes) -> bool:
        """These very bytes came before, as over a relay: whoever sent both is one program."""
        now_s = time.monotonic()
        self._forget(self._said, now_s)
        first = next((said for said in self._said if said[2] == data), None)
        if not first:
            self._said.append((now_s, sender, data))
            return False
        if first[1] and sender and first[1] != sender:
            both = (min(first[1], sender), max(first[1], sender))
            self._copies.pop(both, None)
            self._copies[both] = now_s
            if len(self._copies) > PAIRS_MAX:
                del self._copies[next(iter(self._copies))]
        return True

    def _forget(self, heard: deque, now_s: float) -> None:
        while heard and heard[0][0] < now_s - self.WINDOW_S:
            heard.popleft()

    @property
    def on_two_ways(self) -> list[str]:
        """Addresses from which the same bytes came, in order: one program's; empty: from none."""
        since_s = time.monotonic() - self.WINDOW_S
        now = [both for both, heard_s in self._copies.items() if heard_s >= since_s]
        return sorted({sender[0] for both in now for sender in both})

    def program_of(self, sender: Address | None) -> Address | None:
        """One address for all from which the same bytes ever came."""
        return self._programs_of([sender])[0]

    def _programs_of(self, senders: Iterable[Address | None]) -> list[Address | None]:
        pairs = sorted(self._copies, key=lambda both: both[1], reverse=True)
        found = []
        for sender in senders:
            for first, other in pairs:
                sender = first if sender == other else sender
            found.append(sender)
        return found

    @property
    def hosts(self) -> list[str]:
        """Addresses of the machines that speak on the channel, in order."""
        return sorted({sender[0] for _, sender in self._recent})

    @property
    def programs(self) -> set[Address]:
        """Those that speak on the channel, by the address that each sends from."""
        return {sender for _, sender in self._recent}

    @property
    def are_double(self) -> bool:
        """One program spoke, then another, and then the one again; not on two ways (`is_copy`).

        A program that was started anew, or has changed networks, speaks from another address and
        never again from the first.
        """
        return len(list(groupby(self._programs_of(s for _, s in self._recent)))) > 2


@dataclass
class Reach:
    """How far that got what was said to all.

    Attributes:
        said: how often something was.
        out: how often of these a network took it that leads out of this computer, or the one
            network that there is.
        begin_s: when it first did, by time.monotonic(); None: never.
        networks: those that took it.
        fault: why it did not get out, the last time that it did not.
    """

    said: int = 0
    out: int = 0
    begin_s: float | None = None
    networks: set[str] = field(default_factory=set)
    fault: str = ""

    def note(self, networks: set[str], fault: str) -> None:
        """Something was said."""
        self.said += 1
        self.networks |= networks
        if not networks:
            self.fault = fault
            return
        self.out += 1
        if self.begin_s is None:
            self.begin_s = time.monotonic()


class UdpBus:
    """Speaks and hears on every network that this machine is on; otherwise as lcm.LCM.

    Attributes:
        sender: who sent the message that a handler was called for last, (host, port).
        reach: how far that got what was published; another one may be put in its place.
        ttl: how many networks what is said may pass; by 0 none leaves this computer.
    """

    def __init__(self, url: str = "", *, hears: bool = True):
        """Joins the bus.

        Args:
            url: udpm://ADDRESS:PORT?ttl=N, as LCM has it.
            hears: else it only speaks, by one socket, and opens no other file, until `hear`.

        Raises:
            RuntimeError: it is no such URL, or there can be no socket.
        """
        self.group, self.ttl = _parse_url(url)
        self.sender: Address | None = None
        self.reach = Reach()
        self._handlers: list[tuple[re.Pattern, Handler]] = []
        self._sequence = 0
        self._ear: socket.socket | None = None
        self._joined: dict[int, socket.socket] = {}
        self._no_joins: dict[str, str] = {}
        self._join_s = 0.0
        try:
            self._mouth = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, self.ttl)
            self._mouth.setblocking(False)
            self._names = _networks(self._mouth)
            if hears:
                self.hear()
        except OSError as error:
            raise RuntimeError(why_no_socket(error, self.group[1])) from error

    def hear(self) -> None:
        """Hears what is said from now on.

        Raises:
            OSError: there can be no socket.
        """
        if self._ear is None:
            self._ear, self._join_s = _listening_socket(self.group[1]), 0.0
            self._renew()

    def close(self) -> None:
        """Says and hears nothing any more."""
        for one in {self._mouth, self._ear, *self._joined.values()} - {None}:
            one.close()
        self._ear = None

    @property
    def has_network(self) -> bool:
        """It is on one, be it this computer's own."""
        return bool(self._joined if self._ear else self._names)

    @property
    def fault(self) -> str:
        """Why nothing leaves this computer; empty if something does, or nothing is meant to."""
        kinds = {name: self._kind(name) for name in _networks(self._mouth).values()}
        if self.ttl == 0 or "out" in kinds.values():
            return ""
        return _not_connected(kinds)

    @property
    def unheard(self) -> str:
        """Networks that lead out of this computer and cannot be heard, each with why; or empty."""
        out = {n: why for n, why in self._no_joins.items() if self._kind(n) == "out"}
        return ", ".join(f"{name}: {why}" for name, why in out.items())

    def _renew(self) -> None:
        """Joins the group on networks that are new, and forgets those that are gone."""
        now_s = time.monotonic()
        if now_s < self._join_s:
            return
        self._join_s = now_s + REJOIN_S
        self._names = _networks(self._mouth)
        if self._ear is None:
            return
        for index in self._joined.keys() - self._names.keys():
            with suppress(OSError):
                self._member(self._joined.pop(index), socket.IP_DROP_MEMBERSHIP, index)
        self._no_joins = {}
        for index in sorted(self._names.keys() - self._joined.keys()):
            try:
                self._joined[index] = self._join(index)
            except OSError as error:
                code = errno.errorcode.get(error.errno or 0, "")
                self._no_joins[self._names[index]] = f"{error.strerror} ({code})"

    def _join(self, index: int) -> socket.socket:
        """Has a socket of this bus join the group on a network, and gives it.

        Linux lets one socket be in few groups (net.ipv4.igmp_max_memberships, 20): where that is
        full another joins. The ear hears what any of them brings.
        """
        for ear in dict.fromkeys([self._ear, *self._joined.values()]):
            try:
                return self._member(ear, socket.IP_ADD_MEMBERSHIP, index)
            except OSError as error:
                if error.errno != errno.ENOBUFS:
                    raise
        return self._member(
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM), socket.IP_ADD_MEMBERSHIP, index
        )

    def _member(self, ear: socket.socket | None, what: int, index: int) -> socket.socket:
        assert ear
        request = struct.pack("=4s4si", socket.inet_aton(self.group[0]), bytes(4), index)
        ear.setsockopt(socket.IPPROTO_IP, what, request)
        return ear

    def _kind(self, name: str) -> str:
        """A network: this computer's "own", "out" of it, "lost" its carrier, or "none"."""
        flags = _asked(self._mouth, SIOCGIFFLAGS, name)
        if flags & IFF_LOOPBACK:
            return "own"
        if flags & IFF_RUNNING:
            return "out"
        # Kernels make tunnels that nobody set up.
        is_wire = _asked(self._mouth, SIOCGIFHWADDR, name) == ARPHRD_ETHER
        return "lost" if is_wire else "none"

    def subscribe(self, channels: str, handler: Handler) -> None:
        """Has a function called with channel and payload of each message.

        Args:
            channels: regular expression that matches all of the channel's name.
            handler: the function.
        """
        self._handlers.append((re.compile(channels), handler))

    def publish(self, channel: str, data: bytes) -> None:
        """Says something on every network.

        Raises:
            OSError: it could be said on none.
        """
        packet, errors, took = self._packet(channel, data), {}, set()
        names = self._names
        for index in sorted(names):
            interface = struct.pack("=4s4si", bytes(4), bytes(4), index)
            try:
                self._mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
                self._mouth.sendto(packet, self.group)
                took.add(names[index])
            except OSError as error:
                errors[names[index]] = error.strerror
        self._note(took, errors)
        if not took:
            raise OSError(f"the bus cannot be reached: {self.reach.fault}")

    def _note(self, took: set[str], errors: dict[str, str]) -> None:
        """Keeps how far a message got: a network without a carrier takes all, and loses it."""
        kinds = {name: self._kind(name) for name in took}
        faults = [f"{n}: {why}" for n, why in errors.items() if self._kind(n) != "none"]
        faults += filter(None, [_not_connected(kinds)])
        out = {name for name, kind in kinds.items() if kind == "out"}
        if self.ttl == 0 and took:
            out = {"this computer alone (ttl=0)"}
        elif not (out or faults):
            out = took
        self.reach.note(out, ", ".join(faults) or "no network")

    def tell(self, host: str, channel: str, data: bytes) -> None:
        """Says something to one machine alone: some wireless networks carry nothing else.

        Raises:
            OSError: it cannot be reached.
        """
        self._mouth.sendto(self._packet(channel, data), (host, self.group[1]))

    def _packet(self, channel: str, data: bytes) -> bytes:
        self._sequence = (self._sequence + 1) % 2**32
        return HEADER.pack(MAGIC_SHORT, self._sequence) + channel.encode() + b"\0" + data

    def handle_timeout(self, timeout_ms: int) -> bool:
        """Waits for a message that somebody subscribed to, and has it handled.

        However many other messages come, it ends SKIP_S after the time-out at the latest.

        Returns:
            False if none came in time.
        """
        end_s = time.monotonic() + timeout_ms / 1e3
        while time.monotonic() <= end_s + SKIP_S:
            self._renew()
            left_s = max(0.0, end_s - time.monotonic())
            if self._ear is None:
                time.sleep(left_s)
                return False
            if not select.select([self._ear], [], [], min(left_s, REJOIN_S))[0]:
                if left_s == 0:
                    return False
                continue
            try:
                packet, self.sender = self._ear.recvfrom(DATAGRAM_MAX)
            except OSError:  # taken meanwhile, or its checksum is wrong
                continue
            if self._hand_out(packet):
                return True
        return False

    def _hand_out(self, packet: bytes) -> bool:
        message = parse_packet(packet)
        if message is None:
            return False
        handlers = [h for pattern, h in self._handlers if pattern.fullmatch(message[0])]
        for handler in handlers:
            handler(*message)
        return bool(handlers)


def _parse_url(url: str) -> tuple[Address, int]:
    parts = urlsplit(url)
    try:
        address = (parts.hostname or DEFAULT[0], parts.port or DEFAULT[1])
        multicast = 224 <= socket.inet_aton(address[0])[0] <= 239
        ttl = int(parse_qs(parts.query).get("ttl", ["0"])[0])
    except (ValueError, OSError) as error:
        raise RuntimeError(f"{url}: {error}") from error
    if not multicast or not 0 <= ttl <= 255:
        raise RuntimeError(f"{url}: no multicast address or no ttl in 0..255")
    return address, ttl


def _networks(asker: socket.socket) -> dict[int, str]:
    """Names of this computer's networks by their numbers.

    Where no file more can be opened only those that have an address of IPv4: by `asker` alone.
    """
    with suppress(OSError):
        return dict(socket.if_nameindex())
    room = array.array("B", bytes(NETWORKS_MAX * IFREQ_BYTES))
    address, length = room.buffer_info()
    answer = fcntl.ioctl(asker, SIOCGIFCONF, struct.pack("iP", length, address))
    used = struct.unpack("iP", answer)[0]
    entries = [room[k : k + NAME_BYTES].tobytes() for k in range(0, used, IFREQ_BYTES)]
    names = {entry.split(b"\0")[0].decode() for entry in entries}
    return {_asked(asker, SIOCGIFINDEX, name, "i"): name for name in names}


def _asked(asker: socket.socket, request: int, name: str, kind: str = "H") -> int:
    """Answer of the kernel, a number of that kind of `struct`; 0 of a network that is gone."""
    try:
        answer = fcntl.ioctl(asker, request, struct.pack("16s24x", name.encode()))
    except OSError:
        return 0
    (number,) = struct.unpack_from(kind, answer, NAME_BYTES)
    return number


def _not_connected(kinds: dict[str, str]) -> str:
    """Words on the networks without a carrier, or on none."""
    return ", ".join(f"{name}: not connected" for name in sorted(kinds) if kinds[name] == "lost")


def _listening_socket(port: int) -> socket.socket:
    """Hears unicast, too: bound to the port alone."""
    ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ear.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    ear.bind(("", port))
    ear.setblocking(False)
    return ear
