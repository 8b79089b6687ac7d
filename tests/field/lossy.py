# SPDX-License-Identifier: Apache-2.0
"""A bus that loses half of its packets, each way and each on its own."""

import random

from twinmill.data.bus import UdpBus

LOSS = 0.5


class LossyBus:
    """As UdpBus, but whatever is published or heard is lost at random."""

    def __init__(self, url: str, seed: int):
        self._bus, self._random = UdpBus(url), random.Random(seed)
        self.lost = 0

    def _loses(self) -> bool:
        lost = self._random.random() < LOSS
        self.lost += lost
        return lost

    def subscribe(self, channels, handler):
        return self._bus.subscribe(
            channels, lambda channel, data: self._loses() or handler(channel, data)
        )

    def publish(self, channel, data):
        if not self._loses():
            self._bus.publish(channel, data)

    def handle_timeout(self, timeout_ms):
        return self._bus.handle_timeout(timeout_ms)


class DeafBus(LossyBus):
    """Loses nothing but what is said on some channels."""

    def __init__(self, url: str, deaf_to: set[str]):
        super().__init__(url, 0)
        self._deaf_to = deaf_to

    def _loses(self) -> bool:
        return False

    def subscribe(self, channels, handler):
        return self._bus.subscribe(
            channels, lambda channel, data: channel in self._deaf_to or handler(channel, data)
        )
