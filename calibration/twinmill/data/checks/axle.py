# SPDX-License-Identifier: Apache-2.0
"""Where on its body a robot is tracked: a point off the axle is led round it by each turn.

That is physics and no mistake, but a lever of half a metre makes more of the motion than the
commands do, and hides what is right about them. It has two numbers, which are taken out.
"""

import numpy as np

from twinmill.data.checks.alternatives import (
    Alternative,
    Search,
    alike_left,
    by_pose,
    far_better,
)

FAINT = 1e-3  # of what turning explains: where a command goes with it, the command explains it
LED = np.array([1, 1, 0])  # forward and left: what a lever adds to

Pose = tuple[int, bool, bool]  # sign of headings; mirrored; turned


def at_axle(search: Search, alternatives: list[Alternative]) -> Search:
    """Search moved to the point that the robot turns about, if that explains far more.

    Args:
        search: of the tracked point's motion.
        alternatives: the columns as they are, and mistakes; each has the lever that suits it best.
    """
    if not search.motion.has_heading:
        return search
    found = [row for pose, group in by_pose(alternatives) for row in _led(search, pose, group)]
    alike = alike_left([left for left, *_ in found])
    _, led_m, simplest = min(
        (row for row in found if row[0] < alike), key=lambda row: (row[2].steps, row[0])
    )
    motion = search.motion.at_axle(led_m, simplest.heading_sign, simplest.mirrored)
    axle = search.of(motion)
    keys = search.keys(simplest.heading_sign, simplest.mirrored)
    (seen,), (turned_about,) = (s.best([simplest], keys) for s in (search, axle))
    return axle if far_better(turned_about, seen) else search


def _led(
    search: Search, pose: Pose, group: list[Alternative]
) -> list[tuple[float, complex, Alternative]]:
    """Share of the squared motion that each leaves with a lever, how that leads, and each."""
    mixing = search.weighted(search.mixing(group))
    found = [_at(search, pose, mixing, key) for key in search.keys(*pose[:2])]
    left, led_m = (np.array(values) for values in zip(*found, strict=True))  # (keys, A)
    best = left.argmin(axis=0)
    return [(float(left[k, i]), led_m[k, i], group[i]) for i, k in enumerate(best)]


def _at(
    search: Search, pose: Pose, mixing: np.ndarray, key: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """(A,) share left, and (A,) how turning leads the tracked point: m ahead + i m left per rad.

    Commands and motion are compared without what turning explains of either (Frisch and Waugh
    1933).

    Args:
        search: of the tracked point's motion.
        pose: what is made of the poses.
        mixing: (A, 3, 4) velocity by column.
        key: lag and shift.
    """
    (sign, mirrored, turned), (lag_s, late_s) = pose, key
    begin_s, shapes = search.felt(lag_s)
    rows = search.motion.at((begin_s, shapes[:, 1]), late_s)
    speeds = search.speeds(search.motion.body_mps(sign, mirrored), sign)
    turn = search.motion.turn_radps
    scale = np.sqrt((1 + FAINT) * np.sum(turn**2) + 1e-12)
    of_rows, of_speeds = turn @ rows / scale, turn @ speeds / scale * LED
    moment = rows.T @ speeds - np.outer(of_rows, of_speeds)
    turned_rad = 0.0
    if turned:
        body, told = moment[:, 0] + 1j * moment[:, 1], search.wheels[0] + 1j * search.wheels[1]
        turned_rad = float(np.angle(body @ np.conj(told)))
        moment, of_speeds = (_turned(a, -turned_rad) for a in (moment, of_speeds))
    grams = rows.T @ rows - np.multiply.outer(LED, np.outer(of_rows, of_rows))
    power = np.einsum("aci,cij,acj->ac", mixing, grams, mixing, optimize=True)
    along = np.maximum(np.einsum("aci,ic->ac", mixing, moment), 0)
    gain = along / np.maximum(power, 1e-12)
    total = np.sum(speeds**2)
    left = 1 - (np.sum(gain * along, axis=1) + np.sum(of_speeds**2)) / max(total, 1e-12)
    led = (of_speeds - gain * (mixing @ of_rows)) / scale
    return left, (led[:, 0] + 1j * led[:, 1]) * np.exp(1j * turned_rad)


def _turned(values: np.ndarray, by_rad: float) -> np.ndarray:
    """(..., 3) forward, left, turn: the same with the first two turned to the left."""
    along = (values[..., 0] + 1j * values[..., 1]) * np.exp(1j * by_rad)
    return np.stack([along.real, along.imag, values[..., 2]], axis=-1)
