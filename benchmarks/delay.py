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


def measure(build: Path) -> Iterator[Ratio]:
    """Every frame asks for other duties than the one before; when does the board get them?"""
    pictures = [scene.floor(1), scene.floor(1, robot_radius_px=40)]
    with (
        tempfile.TemporaryDirectory() as folder,
        Robot(build / "bin/turbopi", Path(folder), "udpm://239.255.76.67:7667?ttl=0") as robot,
    ):
        sent_us = []
        for i in range(FRAMES):
            sent_us.append(robot.show(pictures[i % 2]))
            time.sleep(max(0, (sent_us[0] + (i + 1) * PERIOD_US) / 1e6 - time.monotonic()))
        rows = robot.rows()
    delays_us = _delays_us(np.array(sent_us), rows)
    period_us = np.full(len(delays_us), PERIOD_US)
    yield paired("frame to duty : period", delays_us, period_us, "us", at_most=1)
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
