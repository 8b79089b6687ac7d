# SPDX-License-Identifier: Apache-2.0
"""Two robots of one number, or a robot and a twin: what to do, by who speaks as it."""

from __future__ import annotations

import itertools
import socket
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from twinmill.arguments import option

if TYPE_CHECKING:
    from twinmill.robots.fleet import Fleet, Robot


def doubles(fleet: Fleet, robots: Iterable[int]) -> str:
    """Sentences on those of some robots that are two of one number; empty if none is."""
    known = [r for i in sorted(robots) if (r := fleet.robots.get(i)) and r.is_double]
    several = _of_several_numbers(fleet)
    return " ".join(_told(robot, several) for robot in known)


def _told(robot: Robot, several: set[str]) -> str:
    hosts = robot.hosts
    who = "A robot and a twin" if robot.source == "robot, twin" else "Two robots"
    say = "say" if robot.is_double_now else "said"
    return (
        f"{who} {say} that they are number {robot.robot_id} ({', '.join(hosts)}): "
        f"{_remedy(robot, several)}."
    )


def _remedy(robot: Robot, several: set[str]) -> str:
    """Words on what makes one robot of two, without a full stop.

    Args:
        robot: that is two.
        several: machines on which one program speaks as several robots.
    """
    hosts = robot.hosts
    return (
        _of_here(hosts)
        or "; ".join(itertools.starmap(_of_old, sorted(robot.older_s.items())))
        or "; ".join(map(_of_twin, robot.twins))
        or "; ".join(_of_player(host) for host in hosts if host in several)
        or (FLASH if robot.is_source_known else f"{FLASH}; if one is a twin, {_end_twin()}")
    )


def _of_several_numbers(fleet: Fleet) -> set[str]:
    """Addresses of machines on which one program speaks as several robots: none of them does."""
    spoken = Counter(p for robot in fleet.robots.values() for p in robot.programs)
    return {program[0] for program, numbers in spoken.items() if numbers > 1}


FLASH = "give one another number, `twinmill robot flash HOST=ID`"


def _end_twin() -> str:
    prefix, bus = option("channel_prefix", "TWIN_"), option("lcm_url")
    return f"end it, or give it {prefix} or an {bus} of its own"


def _of_twin(host: str) -> str:
    return f"{host} says that it is a twin: {_end_twin()}"


def _of_player(host: str) -> str:
    return (
        f"one program on {host} speaks as several robots, as a twin, a recording that is played or "
        f"a relay does: {_end_twin()}"
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
        f"{own} is this computer: if a twin or a recording speaks here, end it, or give the twin "
        f"{twin}; if the robot itself does, it is the other one"
    )


def _is_here(host: str) -> bool:
    """An address is one of this computer's: what goes there comes from there. Nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.connect((host, 9))
        return probe.getsockname()[0] == host
    return False
