# SPDX-License-Identifier: Apache-2.0
"""Two robots of one number: what to do, by the machines that speak as it."""

from __future__ import annotations

import itertools
import socket
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from twinmill.arguments import option

if TYPE_CHECKING:
    from twinmill.robots.fleet import Fleet, Robot


def doubles(fleet: Fleet, robots: Iterable[int]) -> str:
    """Sentences on those of some robots that are two of one number; empty if none is."""
    known = [r for i in sorted(robots) if (r := fleet.robots.get(i)) and r.is_double]
    return " ".join(map(_told, known))


def _told(robot: Robot) -> str:
    hosts = robot.senders.hosts
    return (
        f"Two robots say that they are number {robot.robot_id} ({', '.join(hosts)}): "
        f"{_remedy(robot)}."
    )


def _remedy(robot: Robot) -> str:
    """Words on what makes one robot of two, without a full stop."""
    return (
        _of_here(robot.senders.hosts)
        or "; ".join(itertools.starmap(_of_old, sorted(robot.older_s.items())))
        or "give one another number, `twinmill robot flash HOST=ID`"
    )


def _of_old(host: str, older_s: float) -> str:
    return (
        f"what {host} says is {older_s:.0f} s older, and may be a recording that is played there: "
        "end that (else its clock is behind)"
    )


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
