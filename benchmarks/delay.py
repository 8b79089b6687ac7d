# SPDX-License-Identifier: Apache-2.0
"""From a frame to the motor board, in the whole program, against the time between two frames."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scene
from ratio import Ratio, paired, single
from robot import Robot

PERIOD_US = 1_000_000 // 30
FRAMES = 300


# Of red, blue and yellow anywhere; the table goes by the green alone.
FOUR_BITS = (
    "bit2=all,40,235,0,124,165,255",
    "bit3=all,30,235,150,255,0,124",
    "bit4=all,80,235,0,90,130,160",
)


def measure(build: Path) -> Iterator[Ratio]:
    """Every frame asks for other duties than the one before; when does the board get them?

    Two robots, of one bit and of four, are shown the same pictures in turn.
    """
    pictures = [scene.floor(1), scene.floor(1, robot_radius_px=40)]
    url, program = "udpm://239.255.76.67:7667?ttl=0", build / "bin/turbopi"
    with (
        tempfile.TemporaryDirectory() as one,
        tempfile.TemporaryDirectory() as four,
        Robot(program, Path(one), url) as robot,
        Robot(program, Path(four), url, ("robot_id=1", *FOUR_BITS)) as other,
    ):
        sent_us = [[], []]
        begin_s = time.monotonic()
        for i in range(FRAMES):
            for k, shown in enumerate((robot, other)):
                sent_us[k].append(shown.show(pictures[i % 2]))
                due_us = (i + (k + 1) / 2) * PERIOD_US
                time.sleep(max(0, begin_s + due_us / 1e6 - time.monotonic()))
        delays_us, others_us = (
            _delays_us(np.array(times), shown.rows())
            for times, shown in zip(sent_us, (robot, other), strict=True)
        )
    period_us = np.full(len(delays_us), PERIOD_US)
    yield paired("frame to duty : period", delays_us, period_us, "us", at_most=1)
    count = min(len(delays_us), len(others_us))
    yield paired(
        "frame to duty : with 1 bit", others_us[-count:], delays_us[-count:], "us", at_most=1.5
    )
    rare_us = float(np.percentile(delays_us, 99))
    # No goal: what else the machine does decides it.
    yield single("99 % of them : period", rare_us, PERIOD_US, "us")


def _delays_us(sent_us: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """From a frame's first byte to the first change of the duties after it."""
    moving = rows[np.any(rows[:, 1:], axis=1)]
    changed = np.flatnonzero(np.any(np.diff(moving[:, 1:], axis=0), axis=1)) + 1
    changes_us = moving[changed, 0]
    # Those before it opened the camera.
    frames_us = sent_us[sent_us > moving[0, 0]]
    after = np.searchsorted(changes_us, frames_us)
    answered = after < len(changes_us)
    # The program may have been asked for its rows before it answered the last frame.
    if len(frames_us) < FRAMES / 2 or np.count_nonzero(~answered) > 1:
        raise ValueError(f"{FRAMES} frames, but the duties changed {len(changes_us)} times only.")
    return changes_us[after[answered]] - frames_us[answered]
