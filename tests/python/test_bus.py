# SPDX-License-Identifier: Apache-2.0
"""The bus of the tools on this machine alone: waiting ends in time whatever else is said on it."""

import socket
import time

import pytest

from twinmill.data.bus import HEADER, MAGIC_SHORT, SKIP_S, UdpBus

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
    bus._ear.close()
    bus._mouth.close()


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
