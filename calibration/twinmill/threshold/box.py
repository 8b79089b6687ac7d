# SPDX-License-Identifier: Apache-2.0
"""Finds the ball, and limits of colour that hold it and nothing else."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from scipy import ndimage

from twinmill.threshold.pictures import Picture

KEYS = ("y_min", "y_max", "u_min", "u_max", "v_min", "v_max")
Box = tuple[int, int, int, int, int, int]
# Shares of the ball's pixels that may lie outside the limits on either side, tried in turn.
TRIMS = (0.002, 0.01, 0.03, 0.08)
# Light changes more than colour does: how far a limit may move away from the ball, in counts.
MARGINS = (40, 12, 12)
LIGHTS = (0.9, 1.1)
# Pixels of a picture's background that may be inside the limits: single ones, of noise.
FALSE_FRAC = 1e-4
SURE_INSIDE, SURE_OUTSIDE = 0.85, 1.2  # of the ball's radius: its edge is of both colours
# Of the ball's pixels: with more of the background inside, single ones though they be, limits lie
# in the middle of another colour.
MOST_FALSE = 0.05
ROUND = 0.6  # least share of its box that a blob fills to be taken for a ball; a disc fills 0.785


@dataclass(frozen=True)
class Ball:
    """Where it is in a picture, in pixels."""

    x_px: float
    y_px: float
    radius_px: float

    def distance(self, shape: tuple[int, int]) -> np.ndarray:
        """(H, W) distances from its middle, in radii."""
        y, x = np.mgrid[: shape[0], : shape[1]]
        return np.hypot(x - self.x_px, y - self.y_px) / self.radius_px


@dataclass(frozen=True)
class Look:
    """What the firmware makes of one picture.

    Attributes:
        mask: (H, W) pixels inside the limits.
        hit_frac: share of the ball's pixels that are.
        ball_blob_px, false_blob_px: largest blob with the ball alone, and without it.
        false_px: pixels inside the limits that are not the ball's.
    """

    mask: np.ndarray
    hit_frac: float
    ball_blob_px: int
    false_blob_px: int
    false_px: int


def find_ball(picture: Picture) -> Ball:
    """The largest round blob of anything green.

    Raises:
        ValueError: there is none, or a second one as large.
    """
    mask = native.inside(picture.yuyv, native.green_box())
    labels, _ = ndimage.label(ndimage.binary_opening(mask, iterations=2))
    found = []
    for index, (rows, columns) in enumerate(ndimage.find_objects(labels), 1):
        area_px = np.count_nonzero(labels[rows, columns] == index)
        height, width = rows.stop - rows.start, columns.stop - columns.start
        is_round = area_px > ROUND * height * width and 0.5 < height / width < 2
        if is_round and area_px > 50:
            middle = ((columns.start + columns.stop - 1) / 2, (rows.start + rows.stop - 1) / 2)
            found.append((area_px, Ball(*middle, max(height, width) / 2)))
    found.sort(key=lambda item: -item[0])
    if not found:
        raise ValueError(f"{picture.name}: no green ball was found; say where it is: --ball X,Y,R.")
    if len(found) > 1 and found[1][0] > 0.5 * found[0][0]:
        raise ValueError(
            f"{picture.name}: more than one thing could be the ball; say where it is: --ball X,Y,R."
        )
    return found[0][1]


def look(picture: Picture, ball: Ball, box: Box) -> Look:
    """Judges limits on one picture, by the firmware's own code."""
    mask = native.inside(picture.yuyv, box)
    distance = ball.distance(mask.shape)
    inside, outside = distance < SURE_INSIDE, distance > SURE_OUTSIDE
    return Look(
        mask,
        float(mask[inside].mean()),
        native.largest_blob_px(mask & ~outside),
        native.largest_blob_px(mask & outside),
        int(np.count_nonzero(mask & outside)),
    )


@dataclass(frozen=True)
class Fitted:
    """Limits, and whether they part the ball from the rest.

    Attributes:
        box: the best limits found.
        looks: what the firmware makes of each picture with them.
        problem: why they do not do, as a sentence; empty if they do.
    """

    box: Box
    looks: list[Look]
    problem: str


def fit_box(pictures: list[Picture], balls: list[Ball], min_blob_px: int) -> Fitted:
    """Limits that hold the ball of all pictures, as wide as their backgrounds allow.

    The tightest limits that hold almost all of the ball are moved outwards, one after the other,
    half way to where the background's colours begin, at most by MARGINS. If what is left of the
    background makes a blob, more of the ball's pixels are given up. All this must hold in LIGHTS,
    too: a ball that only its brightness tells from the rest is lost at the next cloud.

    Args:
        pictures: at least one.
        balls: one in each.
        min_blob_px: the robot takes blobs that are larger for a target.
    """
    lit = [picture.in_light(times) for times in LIGHTS for picture in pictures]
    shown, at = [*pictures, *lit], balls * (1 + len(LIGHTS))
    inside, outside = [], []
    for picture, ball in zip(shown, at, strict=True):
        yuv = picture.yuv
        distance = ball.distance(yuv.shape[:2])
        inside.append(yuv[distance < SURE_INSIDE])
        outside.append(yuv[distance > SURE_OUTSIDE])
    target, rest = np.concatenate(inside).astype(int), np.concatenate(outside).astype(int)
    for trim in TRIMS:
        box = _widen(_tight(target, trim), rest, FALSE_FRAC * len(rest))
        looks = [look(*both, box) for both in zip(shown, at, strict=True)]
        fitted = Fitted(box, looks[: len(pictures)], _problem(shown, looks, min_blob_px))
        if not fitted.problem:
            break
    return fitted


def _tight(target: np.ndarray, trim: float) -> np.ndarray:
    """(3, 2) limits that leave out a share `trim` of the ball's pixels on each side."""
    low = np.quantile(target, trim, axis=0, method="lower")
    high = np.quantile(target, 1 - trim, axis=0, method="higher")
    return np.column_stack([low, high])


def _widen(limits: np.ndarray, rest: np.ndarray, allowed: float) -> Box:
    """Moves V, U and Y outwards, lower and upper limits in turn."""
    limits = limits.copy()
    for channel in (2, 1, 0):
        for side, sign in ((0, -1), (1, 1)):
            others = [k for k in range(3) if k != channel]
            near = np.all(
                (rest[:, others] >= limits[others, 0]) & (rest[:, others] <= limits[others, 1]),
                axis=1,
            )
            # How far each background pixel of these other colours is beyond the limit.
            gap = np.sort(sign * (rest[near, channel] - limits[channel, side]))
            gap = gap[gap > 0]
            wall = gap[int(allowed)] if len(gap) > allowed else 2 * MARGINS[channel]
            limits[channel, side] += sign * min(MARGINS[channel], (wall - 1) // 2)
    return tuple(int(number) for number in np.clip(limits, 0, 255).ravel())


def _problem(pictures: list[Picture], looks: list[Look], min_blob_px: int) -> str:
    for picture, seen in zip(pictures, looks, strict=True):
        if seen.hit_frac < 0.7:
            return (
                f"{picture.name}: only {100 * seen.hit_frac:.0f} % of the ball is inside limits "
                "that leave the background out"
            )
        if seen.ball_blob_px <= min_blob_px:
            return (
                f"{picture.name}: the ball is a blob of {seen.ball_blob_px} pixels, and the robot "
                f"takes only those above {min_blob_px} (min_blob_px)"
            )
        if seen.false_blob_px > min(min_blob_px, 0.25 * seen.ball_blob_px):
            return (
                f"{picture.name}: something else of the same colour makes a blob of "
                f"{seen.false_blob_px} pixels, the ball {seen.ball_blob_px}"
            )
        if seen.false_px > MOST_FALSE * seen.ball_blob_px:
            return (
                f"{picture.name}: {seen.false_px} pixels of the background have the same colour, "
                f"the ball has {seen.ball_blob_px}"
            )
    return ""
