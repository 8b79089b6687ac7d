# SPDX-License-Identifier: Apache-2.0
"""Two robots of one number: what to do, by the machines that speak as it."""

from __future__ import annotations

import socket
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from twinmill.arguments import option

if TYPE_CHECKING:
    from twinmill.robots.fleet import Fleet


def remedy(hosts: Sequence[str]) -> str:
    """Words on what makes one robot of two, without a full stop.

    Args:
        hosts: addresses of the machines that speak as it.
    """
    return _of_here(hosts) or "give one another number, `twinmill robot flash HOST=ID`"


def doubles_here(fleet: Fleet, robots: Iterable[int]) -> str:
    """Sentence on this computer, where it speaks as one of some robots beside another machine."""
    known = [r for i in sorted(robots) if (r := fleet.robots.get(i)) and r.senders.are_double]
    words = dict.fromkeys(_of_here(robot.senders.hosts) for robot in known)
    return " ".join(f"{each}." for each in words if each)


def _of_here(hosts: Sequence[str]) -> str:
    own = next(filter(_is_here, hosts), "")
    if not own:
        return ""
    twin = option("channel_prefix", "TWIN_")
    return (
        f"{own} is this computer: end what speaks here, a twin or a recording, or give the twin "
        f"{twin}"
    )


def _is_here(host: str) -> bool:
    """An address is one of this computer's: what goes there comes from there. Nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.connect((host, 9))
        return probe.getsockname()[0] == host
    return False
