# SPDX-License-Identifier: Apache-2.0
"""Finds the ball, and limits of colour that hold it and nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native
from scipy import ndimage

from twinmill.arguments import option
from twinmill.threshold.pictures import BT601, Picture

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
# Least overlap of a blob with the disc of the same area and middle, over their union: a disc has 1,
# a square 0.83, a longer rectangle less.
ROUND = 0.88
SMALLEST_PX = 50  # of a blob, below which nothing is told of its form
OTHER_HUE_RAD = 0.35  # two pictures of one ball differ less, whatever the light
COLOURLESS = 6  # counts of U and V about grey, below which there is no hue


# Colours by name, as R, G, B: what is looked for where nobody says where the ball is. For green the
# robot's own limits do.
COLOURS = {
    "green": None,
    "red": (200, 30, 30),
    "blue": (30, 60, 210),
    "orange": (230, 140, 30),
    "purple": (150, 50, 180),
}


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
class PictureResult:
    """Firmware's answer for one picture.

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


def find_ball(picture: Picture, colour: str = "green") -> Ball:
    """The largest round blob of anything of a colour.

    Raises:
        ValueError: there is none, or a second one of half its size.
    """
    rgb = COLOURS[colour]
    mask = _of_hue(picture, rgb) if rgb else native.inside(picture.yuyv, native.green_box())
    labels, _ = ndimage.label(ndimage.binary_opening(mask, iterations=2))
    blobs = [
        (rows, columns, labels[rows, columns] == index)
        for index, (rows, columns) in enumerate(ndimage.find_objects(labels), 1)
    ]
    blobs = [blob for blob in blobs if np.count_nonzero(blob[2]) > SMALLEST_PX]
    blobs.sort(key=lambda blob: -np.count_nonzero(blob[2]))
    found = [blob for blob in blobs if _roundness(blob[2]) > ROUND]
    if not found:
        largest = (
            f"the largest {colour} thing, at {_where(blobs[0])}, is not round" if blobs else ""
        )
        raise ValueError(
            f"{picture.name}: {largest or 'nothing in it is ' + colour}; say where the ball is: "
            f"{option('ball')} X,Y,R."
        )
    sizes = [np.count_nonzero(blob[2]) for blob in found]
    if len(found) > 1 and sizes[1] > 0.5 * sizes[0]:
        raise ValueError(
            f"{picture.name}: round and {colour} are the things at {_where(found[0])} and at "
            f"{_where(found[1])}; say which is the ball: {option('ball')} X,Y,R."
        )
    rows, columns, _ = found[0]
    middle = ((columns.start + columns.stop - 1) / 2, (rows.start + rows.stop - 1) / 2)
    return Ball(*middle, max(rows.stop - rows.start, columns.stop - columns.start) / 2)


def _of_hue(picture: Picture, rgb: tuple[int, int, int]) -> np.ndarray:
    """(H, W) pixels that have about the hue of a colour, and are not near grey."""
    colour = BT601[1:] @ rgb
    u, v = np.moveaxis(picture.yuv[..., 1:].astype(float) - 128, -1, 0)
    apart = np.angle((u + 1j * v) / complex(*colour))
    return (np.abs(apart) < OTHER_HUE_RAD) & (np.hypot(u, v) > 3 * COLOURLESS)


def _roundness(blob: np.ndarray) -> float:
    """Overlap of an (H, W) mask with the disc of its area about its middle, over their union."""
    area_px, middle = np.count_nonzero(blob), np.argwhere(blob).mean(axis=0)
    edge = round(np.sqrt(area_px))  # the disc may stand out of the blob's box
    y, x = np.mgrid[-edge : blob.shape[0] + edge, -edge : blob.shape[1] + edge]
    disc = np.hypot(y - middle[0], x - middle[1]) <= np.sqrt(area_px / np.pi)
    both = np.count_nonzero(disc & np.pad(blob, edge))
    return both / (area_px + np.count_nonzero(disc) - both)


def _where(blob: tuple[slice, slice, np.ndarray]) -> str:
    rows, columns, _ = blob
    return f"{(columns.start + columns.stop) // 2},{(rows.start + rows.stop) // 2}"


def evaluate(picture: Picture, ball: Ball, box: Sequence[int]) -> PictureResult:
    """Judges limits on one picture, by the firmware's own code."""
    mask = native.inside(picture.yuyv, box)
    distance = ball.distance(mask.shape)
    inside, outside = distance < SURE_INSIDE, distance > SURE_OUTSIDE
    return PictureResult(
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
        results: what the firmware makes of each picture with them.
        problem: why they do not do, as a sentence; empty if they do.
    """

    box: Box
    results: list[PictureResult]
    problem: str


def overlap(a: Box, b: Box) -> bool:
    """True if some colour is inside both."""
    return all(max(a[k], b[k]) <= min(a[k + 1], b[k + 1]) for k in (0, 2, 4))


def ball_pixels(pictures: list[Picture], balls: list[Ball]) -> np.ndarray:
    """(N, 3) Y, U and V of all that surely is the ball's, one in each picture."""
    return np.concatenate(
        [
            picture.yuv[ball.distance(picture.yuv.shape[:2]) < SURE_INSIDE]
            for picture, ball in zip(pictures, balls, strict=True)
        ]
    )


def fit_box(
    pictures: list[Picture],
    balls: list[Ball],
    min_blob_px: int,
    *,
    others: np.ndarray | None = None,
) -> Fitted:
    """Limits that hold the ball of all pictures, as wide as their backgrounds allow.

    The tightest limits that hold almost all of the ball are moved outwards, one after the other,
    half way to where the background's colours begin, at most by MARGINS. If what is left of the
    background makes a blob, more of the ball's pixels are given up. All this must hold in LIGHTS,
    too: a ball that only its brightness tells from the rest is lost at the next cloud.

    Args:
        pictures: at least one.
        balls: one in each.
        min_blob_px: the robot takes blobs that are larger for a target.
        others: (N, 3) pixels of balls of other colours, wherever they were seen.
    """
    lit = [picture.in_light(times) for times in LIGHTS for picture in pictures]
    shown, at = [*pictures, *lit], balls * (1 + len(LIGHTS))
    outside = [
        picture.yuv[ball.distance(picture.yuv.shape[:2]) > SURE_OUTSIDE]
        for picture, ball in zip(shown, at, strict=True)
    ]
    outside += [] if others is None else [others]
    target, rest = ball_pixels(shown, at).astype(int), np.concatenate(outside).astype(int)
    for trim in TRIMS:
        box = _widen(_tight(target, trim), rest, FALSE_FRAC * len(rest))
        results = [evaluate(*both, box) for both in zip(shown, at, strict=True)]
        fitted = Fitted(box, results[: len(pictures)], _problem(shown, results, min_blob_px))
        if not fitted.problem:
            return fitted
    return replace(fitted, problem=_other_colour(pictures, balls) or fitted.problem)


def _other_colour(pictures: list[Picture], balls: list[Ball]) -> str:
    """Whose ball has another hue than those of the other pictures, as a sentence; or nothing."""
    hues = np.array([_hue_rad(*both) for both in zip(pictures, balls, strict=True)])
    if len(hues) < 2 or not np.isfinite(hues).all():
        return ""
    apart = np.abs(np.angle(np.exp(1j * (hues[:, None] - hues))))
    off = np.array([np.median(np.delete(row, k)) for k, row in enumerate(apart)])
    if off.max() < OTHER_HUE_RAD:
        return ""
    if len(hues) == 2:
        return (
            f"what was taken for the ball in {pictures[0].name} has another colour than in "
            f"{pictures[1].name}; say where it is in each: {option('ball')} X,Y,R"
        )
    name, ball = pictures[int(off.argmax())].name, balls[int(off.argmax())]
    return (
        f"{name}: what was taken for the ball, at {ball.x_px:.0f},{ball.y_px:.0f}, has another "
        "colour than in the other pictures; say where it is, once per picture: "
        f"{option('ball')} X,Y,R"
    )


def _hue_rad(picture: Picture, ball: Ball) -> float:
    """Direction of the ball's colour from grey, which light does not change; NaN of grey."""
    inside = picture.yuv[ball.distance(picture.yuv.shape[:2]) < SURE_INSIDE]
    u, v = np.median(inside[:, 1:].astype(float), axis=0) - 128
    return float(np.arctan2(v, u)) if np.hypot(u, v) > COLOURLESS else float("nan")


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
    a, b, c, d, e, f = (int(number) for number in np.clip(limits, 0, 255).ravel())
    return a, b, c, d, e, f


def _problem(pictures: list[Picture], results: list[PictureResult], min_blob_px: int) -> str:
    for picture, seen in zip(pictures, results, strict=True):
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
