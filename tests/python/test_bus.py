# SPDX-License-Identifier: Apache-2.0
"""The bus of the tools on this machine alone: waiting ends in time whatever else is said on it."""

import errno
import json
import os
import resource
import socket
import struct
import time

import pytest

from twinmill.data import bus as buses
from twinmill.data.bus import (
    HEADER,
    MAGIC_SHORT,
    SKIP_S,
    Reach,
    UdpBus,
    check_url,
    open_bus,
    too_many_files,
)
from twinmill.robots.fleet import Fleet
from twinmill.robots.tell import why_unheard
from twinmill_cli.swarm_verdict import Saying, of_stop

WAIT_MS = 200
SLACK_S = 0.3  # the machine may be busy with other tests


@pytest.fixture
def bus():
    """A bus and a function that puts a message into its socket, by loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    try:
        bus = UdpBus(f"udpm://239.255.76.67:{port}?ttl=0")
    except RuntimeError as error:
        pytest.skip(f"no multicast here: {error}")
    mouth = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def say(channel: str) -> None:
        packet = HEADER.pack(MAGIC_SHORT, 1) + channel.encode() + b"\0"
        mouth.sendto(packet, ("127.0.0.1", port))

    yield bus, say
    mouth.close()
    bus.close()


def always_ready(bus, monkeypatch, say):
    """Another packet waits as soon as one was taken."""
    hand_out = bus._hand_out

    def handed_out(packet):
        say("CAMERA")
        return hand_out(packet)

    monkeypatch.setattr(bus, "_hand_out", handed_out)
    say("CAMERA")


def test_waiting_ends_in_time_though_others_speak_without_end(bus, monkeypatch):
    bus, say = bus
    bus.subscribe("R[0-9]+_LINK", lambda *_: None)
    always_ready(bus, monkeypatch, say)
    begin_s = time.monotonic()
    assert not bus.handle_timeout(WAIT_MS)
    assert WAIT_MS / 1e3 <= time.monotonic() - begin_s < WAIT_MS / 1e3 + SKIP_S + SLACK_S


def test_what_waits_behind_packets_of_others_is_taken_without_waiting(bus):
    bus, say = bus
    heard = []
    bus.subscribe("R[0-9]+_LINK", lambda channel, _: heard.append(channel))
    for channel in ("CAMERA", "CAMERA", "R03_LINK"):
        say(channel)
    assert bus.handle_timeout(0) and heard == ["R03_LINK"]
    assert not bus.handle_timeout(0)


@pytest.mark.parametrize(
    ("kinds", "took", "errors", "ttl", "says"),
    [
        # A laptop at its access point; unplugged, which takes packets and loses them; switched off.
        ({"lo": "own", "wlan0": "out"}, {"lo", "wlan0"}, {}, 1, (1, {"wlan0"}, "")),
        ({"lo": "own", "eth0": "lost"}, {"lo", "eth0"}, {}, 1, (0, set(), "eth0: not connected")),
        ({"lo": "own", "wlan0": "lost"}, {"lo"}, {"wlan0": "down"}, 1, (0, set(), "wlan0: down")),
        # One network of two is enough; tunnels that nobody set up are none.
        ({"eth0": "out", "wlan0": "lost"}, {"eth0"}, {"wlan0": "down"}, 1, (1, {"eth0"}, "")),
        ({"lo": "own", "tunl0": "none"}, {"lo"}, {"tunl0": "down"}, 1, (1, {"lo"}, "")),
        ({"lo": "own"}, set(), {"lo": "down"}, 1, (0, set(), "lo: down")),
        ({}, set(), {}, 1, (0, set(), "no network")),
        ({"lo": "own", "eth0": "out"}, {"eth0"}, {}, 0, (1, {"this computer alone (ttl=0)"}, "")),
    ],
)
def test_how_far_a_message_got_is_what_the_kernel_says_of_the_networks_that_took_it(
    monkeypatch, bus, kinds, took, errors, ttl, says
):
    """IFF_RUNNING is what tells a network without a carrier from one that carries."""
    bus, _ = bus
    monkeypatch.setattr(bus, "_kind", kinds.get)
    bus.ttl, bus.reach = ttl, Reach()
    bus._note(took, errors)
    assert (bus.reach.out, bus.reach.networks, bus.reach.fault) == says and bus.reach.said == 1


def test_a_network_of_this_machine_is_known_by_its_flags(bus):
    bus, _ = bus
    assert bus._kind("lo") == "own" and bus._kind("no such") == "none"


@pytest.mark.parametrize(
    "url", ["udp://1.2.3.4:7667", "239.255.76.67:7667", "udpm://10.0.0.1:1", "udpm://?ttl=x", "x"]
)
def test_a_malformed_url_is_told_apart_from_a_network_that_is_not_there(url):
    with pytest.raises(RuntimeError):
        check_url(url)


@pytest.fixture
def port_of_another():
    """A UDP port that another socket has for itself, as the kernel gives it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", 0))
        yield other.getsockname()[1]


def test_a_port_that_another_program_has_is_no_missing_network(port_of_another):
    url = f"udpm://239.255.76.67:{port_of_another}?ttl=0"
    for join in (open_bus, Fleet):
        with pytest.raises((RuntimeError, ValueError), match="another program has UDP") as told:
            join(url)
        assert f"sport = :{port_of_another}" in str(told.value) and "route" not in str(told.value)


def test_a_stop_that_cannot_be_heard_tells_who_has_the_port(
    monkeypatch, tmp_path, twinmill, port_of_another
):
    """It had been told to look for the network's multicast; robots hear that stop."""
    monkeypatch.setenv("HOME", str(tmp_path))
    url = f"udpm://239.255.76.67:{port_of_another}?ttl=0"
    code, out, _ = twinmill("swarm", "stop", "--lcm-url", url, "--timeout-s", "0.5", "--json")
    told = json.loads(out)["sentence"]
    assert code == 1 and "No robot can be heard: another program has UDP port" in told
    assert "multicast" not in told and "BY HAND" in told


def test_a_stop_can_wait_for_a_network(monkeypatch):
    monkeypatch.setattr(buses, "_networks", lambda _: {})
    with pytest.raises(RuntimeError, match=r"no network.*a route for multicast"):
        open_bus("udpm://239.255.76.67:7998?ttl=0")
    waits = open_bus("udpm://239.255.76.67:7998?ttl=0", needs_network=False)
    with pytest.raises(OSError, match="no network"):
        waits.publish("A", b"")
    waits._ear.close()
    waits._mouth.close()


@pytest.fixture
def full(monkeypatch, bus):
    """A bus on two networks, each of whose sockets can be in one group, and those that joined."""
    bus, _ = bus
    ears = []

    def member(_, ear, what, index):
        if index == 3 and ear in ears:
            raise OSError(errno.ENOBUFS, "No buffer space available")
        ears.append(ear)
        return ear

    monkeypatch.setattr(buses, "_networks", lambda _: {2: "docker0", 3: "wlan0"})
    monkeypatch.setattr(UdpBus, "_kind", lambda *_: "out")
    monkeypatch.setattr(UdpBus, "_member", member)
    monkeypatch.setattr(bus, "_joined", {})
    monkeypatch.setattr(bus, "_join_s", 0.0)
    return bus, ears


def test_where_a_socket_can_join_no_more_networks_another_does(full):
    bus, ears = full
    bus._renew()
    assert len(ears) == 2 and bus._joined == {2: ears[0], 3: ears[1]} and not bus.unheard


def test_what_can_be_said_does_not_depend_on_what_can_be_heard(monkeypatch, full):
    """With many networks of containers a stop left by all but the newest one, a laptop's Wi-Fi."""
    bus, _ = full
    monkeypatch.setattr(bus, "_join", lambda index: bus._member(bus._ear, 0, index))
    bus._renew()
    spoken = []
    monkeypatch.setattr(bus, "_mouth", Mouth(spoken))
    bus.publish("STOP", b"")
    assert [*bus._joined] == [2] and spoken == [2, 3]
    fleet = Fleet("", connect=lambda _: bus)
    assert "heard on wlan0: No buffer space available (ENOBUFS)." in why_unheard(fleet)
    how = Saying(reach=bus.reach, is_deaf=True, key_fault=fleet.deaf)
    assert fleet.deaf in of_stop([], how).sentence


class Mouth:
    """Takes note of the networks that something is said on."""

    def __init__(self, spoken):
        self._spoken, self._network = spoken, 0

    def setsockopt(self, _level, _option, interface):
        *_, self._network = struct.unpack("=4s4si", interface)

    def sendto(self, *_):
        self._spoken.append(self._network)

    def close(self):
        """Nothing is open."""


@pytest.fixture
def room_for_one(bus):
    """No file can be opened but one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    free = os.open(os.devnull, os.O_RDONLY)
    os.close(free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free + 1, hard))
    yield free + 1
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_a_stop_needs_one_socket_and_no_other_file(bus, room_for_one):
    """It is heard by a bus that was there before."""
    ear, _ = bus
    heard = []
    ear.subscribe("STOP", lambda *message: heard.append(message))
    mouth = UdpBus(f"udpm://239.255.76.67:{ear.group[1]}?ttl=0", hears=False)
    try:
        mouth.publish("STOP", b"now")
        assert ear.handle_timeout(WAIT_MS) and heard == [("STOP", b"now")]
        with pytest.raises(OSError) as error:
            mouth.hear()
        told = too_many_files(error.value)
        assert f"{room_for_one} are allowed" in told and "`ulimit -n " in told
        assert not mouth.handle_timeout(1)
    finally:
        mouth.close()


def test_networks_are_known_without_another_file(bus, room_for_one):
    """All that have an address, as by the system's own list."""
    ear, _ = bus
    asker = ear._mouth
    held = os.open(os.devnull, os.O_RDONLY)
    try:
        with pytest.raises(OSError):
            socket.if_nameindex()
        found = buses._networks(asker)
    finally:
        os.close(held)
    assert found and found.items() <= dict(socket.if_nameindex()).items()
