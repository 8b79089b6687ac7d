# SPDX-License-Identifier: Apache-2.0
"""A bus that loses half of its packets, each way and each on its own."""

import random

import lcm

LOSS = 0.5


class LossyBus:
    """As lcm.LCM, but whatever is published or heard is lost at random."""

    def __init__(self, url: str, seed: int):
        self._bus, self._random = lcm.LCM(url), random.Random(seed)
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
    """Loses nothing but what one robot acknowledges."""

    def __init__(self, url: str, channel: str):
        super().__init__(url, 0)
        self._channel = channel

    def _loses(self) -> bool:
        return False

    def subscribe(self, channels, handler):
        return self._bus.subscribe(
            channels, lambda channel, data: channel == self._channel or handler(channel, data)
        )
