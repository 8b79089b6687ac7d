# SPDX-License-Identifier: Apache-2.0
"""A bus on which all that others say comes late, as over a slow network."""

import time
from collections import deque

from twinmill.data.bus import DATAGRAM_MAX, UdpBus

LOOK_S = 0.002


def begin(late_s: float) -> None:
    """From now on, for all buses of this process."""
    on_their_way: deque = deque()

    def handle_timeout(self, timeout_ms: int) -> bool:
        end_s = time.monotonic() + timeout_ms / 1e3
        while True:
            self._renew()
            now_s = time.monotonic()
            try:
                while True:
                    on_their_way.append((now_s + late_s, *self._ear.recvfrom(DATAGRAM_MAX)))
            except BlockingIOError:
                pass
            while on_their_way and on_their_way[0][0] <= now_s:
                _, packet, self.sender = on_their_way.popleft()
                if self._hand_out(packet):
                    return True
            if now_s >= end_s:
                return False
            time.sleep(LOOK_S)

    UdpBus.handle_timeout = handle_timeout
