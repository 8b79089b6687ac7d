# SPDX-License-Identifier: Apache-2.0
"""Motion capture: exports and streams that only the makers' programs write.

Their programs do not run here. Of NatNet the tests have a server of their own, whose packets the
maker's client reads beside ours.
"""

import json
import math
from pathlib import Path

from interop.cells import Cell, Told, reads

_LICENCE = "it needs Windows, a licence and cameras"
_LAID_OUT = f"{_LICENCE}; files laid out by its manual are read in the tests"
_SERVED = f"{_LICENCE}; the tests' own server stands in for it, which the lines above read"

HEARD, BODY, TURN_RAD = "heard.json", (17, "robot_03"), 0.8
FRAMES, LONGEST_S = 20, 30.0


def _motive(version: tuple[int, int]):
    """A server of one body, turned about the vertical y."""
    from motive_server import Body, Motive

    turned = (0.0, math.sin(TURN_RAD / 2), 0.0, math.cos(TURN_RAD / 2))
    return Motive([Body(*BODY, quaternion_xyzw=turned)], version)


def _read(version: tuple[int, int]):
    """Twinmill's side, compared with what the other client heard."""

    def ours(folder: Path) -> Told:
        import numpy as np

        from twinmill.data.natnet_stream import Stream, find_server
        from twinmill.data.optitrack import Robots, View

        poses = {}
        with _motive(version) as motive:
            robots = Robots(Stream(find_server("127.0.0.1", port=motive.port), None), View())
            for stamped in robots.stream.frames(LONGEST_S):
                poses |= {pose.robot_id: pose for pose in robots.take(*stamped)}
                if robots.frames >= FRAMES and robots.stream.names:
                    break
            robots.stream.close()
        theirs = json.loads((folder / HEARD).read_text())
        x, y, z = theirs["place"]
        _, about_y, _, real = theirs["turn"]
        here = poses[3]
        return {
            "places": np.allclose(here.position_m, [x, -z, y], atol=1e-6),
            "turn": np.allclose(here.orientation_wxyz, [real, 0, 0, about_y], atol=1e-6),
            "steps of stamps": np.allclose(np.diff(theirs["stamps_s"]), 0.005, atol=1e-6),
        }

    return ours


def _heard_by_the_maker(folder: Path, version: tuple[int, int]) -> None:
    import socket
    import time

    from natnetsdk.NatNetClient import NatNetClient

    heard, stamps_s = {}, []
    socket.setdefaulttimeout(1)  # else its thread waits for a socket that is closed
    with _motive(version) as motive:
        client = NatNetClient()
        client.set_use_multicast(False)
        client.set_print_level(0)
        client.command_port = motive.port
        client.rigid_body_listener = lambda number, *pose: heard.update({number: pose})
        client.new_frame_listener = lambda frame: stamps_s.append(frame["timestamp"])
        client.run()
        until_s = time.monotonic() + LONGEST_S
        while len(stamps_s) < FRAMES and time.monotonic() < until_s:
            time.sleep(0.01)
        client.shutdown()
    place, turn = heard[BODY[0]]
    told = {"place": place, "turn": turn, "stamps_s": stamps_s[:FRAMES]}
    (folder / HEARD).write_text(json.dumps(told))


@reads("NatNet", "the maker's client, NatNet 3", "natnetsdk==4.1.1", ours=_read((3, 1)))
def maker_3(folder: Path) -> None:
    """NaturalPoint's depacketizer, as someone put it on PyPI; of Motive 2.x."""
    _heard_by_the_maker(folder, (3, 1))


@reads("NatNet", "the maker's client, NatNet 4", "natnetsdk==4.1.1", ours=_read((4, 1)))
def maker_4(folder: Path) -> None:
    """Export in the format of Motive 3.1."""
    _heard_by_the_maker(folder, (4, 1))


NOT_RUN = [
    *(
        Cell("NatNet", "reads", f"Motive, NatNet {version}", why_not=_SERVED)
        for version in ("3", "4")
    ),
    *(
        Cell("Motive CSV", "reads", f"Motive {version}", why_not=_LAID_OUT)
        for version in ("1.2x", "2.x", "3.x")
    ),
    *(Cell("Vicon CSV", "reads", program, why_not=_LAID_OUT) for program in ("Tracker", "Nexus")),
]
