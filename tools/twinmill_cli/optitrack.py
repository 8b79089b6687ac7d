# SPDX-License-Identifier: Apache-2.0
"""`twinmill track optitrack`: an OptiTrack's live stream on the bus, or why nothing arrives."""

from __future__ import annotations

import math
import time
from typing import Annotated

import typer

from twinmill.counted import counted
from twinmill.defaults import URL
from twinmill_cli.lazy import working
from twinmill_cli.options import LcmUrl
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from dataclasses import asdict

    from rich.text import Text

    from twinmill.data.bus import open_bus
    from twinmill.data.natnet_stream import Stream, StreamError, find_server
    from twinmill.data.optitrack import Check, Robots, View
    from twinmill.report import show
    from twinmill.report.tables import Cell, Table, Tone
    from twinmill.terminal import PlainConsole

PATIENCE_S = 3.0  # without a frame: something is wrong
CHECK_S = 5.0
SHOWN_S = 0.5


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("optitrack")(_optitrack)


def _optitrack(
    server: Annotated[
        str, typer.Option("--server", metavar="IP", help="Address of Motive's computer.")
    ],
    *,
    local: Annotated[
        str,
        typer.Option("--local", metavar="IP", help="Address of this machine on Motive's network."),
    ] = "",
    multicast: Annotated[
        bool | None,
        typer.Option("--multicast/--unicast", show_default=False, help="Default: as Motive says."),
    ] = None,
    up: Annotated[str, typer.Option("--up", help="y or z, as Motive streams.")] = "y",
    robot: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=ID", help="Number of a rigid body; else digits in its name."),
    ] = None,
    heading_offset_deg: Annotated[
        float,
        typer.Option(help="From the tracked body's x axis to the robot's front, left positive."),
    ] = 0.0,
    check: Annotated[
        bool, typer.Option("--check", help="Listen for 5 s, publish nothing, say what is wrong.")
    ] = False,
    duration_s: Annotated[
        float, typer.Option("--duration-s", min=0.1, help="Else until Ctrl-C.")
    ] = math.inf,
    command_port: Annotated[int, typer.Option("--command-port", min=1, max=65535)] = 1510,
    lcm_url: LcmUrl = URL,
    as_json: AsJson = False,
) -> int:
    """Publish the poses that OptiTrack Motive streams (NatNet), or say why none arrive.

    The poses go to R<nn>_POSE, where characterise, watch and metrics look for
    them. Stamps are Motive's, on this machine's clock: the network's least
    delay is in them. With --check, turn a robot by hand: that shows which axis
    is up.

    Example: twinmill track optitrack --server 192.168.1.20 --check
    """
    if up not in ("y", "z"):
        raise ValueError(f"--up {up}: must be y or z.")
    view = View(up, _numbers(robot or []), math.radians(heading_offset_deg))
    robots = Robots(Stream(find_server(server, local, command_port), multicast), view)
    try:
        if check:
            return _check(robots, min(duration_s, CHECK_S), as_json)
        return _publish(robots, lcm_url, duration_s, as_json)
    finally:
        robots.stream.close()


def _numbers(words: list[str]) -> dict[str, int]:
    pairs = [word.rpartition("=") for word in words]
    for name, _, number in pairs:
        if not (name and number.isdecimal() and int(number) <= 99):
            raise ValueError(f"--robot {name}={number}: must be as robot_03=3, with 0..99.")
    return {name: int(number) for name, _, number in pairs}


def _check(robots: Robots, duration_s: float, as_json: bool) -> int:
    with PlainConsole(stderr=True).status("listening; turn a robot on the floor by hand"):
        for stamped in robots.stream.frames(duration_s):
            for _ in robots.take(*stamped):
                pass
    return _deliver(robots, as_json)


def _publish(robots: Robots, url: str, duration_s: float, as_json: bool) -> int:
    bus = open_bus(url)
    begin_s = shown_s = time.monotonic()
    with PlainConsole(stderr=True).status("waiting for frames") as status:
        try:
            while not robots.frames or time.monotonic() - begin_s < duration_s:
                for stamped in robots.stream.frames(min(duration_s, PATIENCE_S)):
                    for pose in robots.take(*stamped):
                        bus.publish(f"R{pose.robot_id:02d}_POSE", pose.encode())
                    if time.monotonic() - shown_s > SHOWN_S:
                        shown_s = time.monotonic()
                        rate_hz = robots.frames / (shown_s - begin_s)
                        status.update(Text(f"{rate_hz:.0f} Hz, poses {dict(robots.poses)}"))
                if not robots.frames:
                    raise StreamError(f"{robots.checks()[1].words}.")
        except KeyboardInterrupt:
            pass
    return _deliver(robots, as_json)


def _deliver(robots: Robots, as_json: bool) -> int:
    checks = robots.checks()
    data = {
        "frames": robots.frames,
        "poses": dict(robots.poses),
        "checks": [asdict(check) for check in checks],
    }
    rows = [[Cell(c.what), Cell(_mark(c), _tone(c)), Cell(c.words)] for c in checks]
    table = Table(counted(robots.frames, "frame"), ["", "", ""], rows, words=(0, 1, 2))
    deliver(data, show.table(table), as_json)
    return 1 if any(check.ok is False for check in checks) else 0


def _mark(check: Check) -> str:
    return {True: "well", False: "wrong", None: "-"}[check.ok]


def _tone(check: Check) -> Tone:
    return "dim" if check.ok is None else "good" if check.ok else "bad"
