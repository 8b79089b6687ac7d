# SPDX-License-Identifier: Apache-2.0
"""Films of tagged robots under a ceiling camera, with known truth, and none of the tracker's code.

Each pixel's ray is found by solving the lens's equation (Brown 1966) for it, meets the plane of the
tags, and looks there which module of which tag it sees: over a grid within the pixel, over the time
that its row was exposed. The tracker instead projects corners. Only the tags' bits and the film's
codec are OpenCV's.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

MODULES = 8  # a side of tag 36h11, its black border included
SHEET = 1.3  # white paper about the tag
GRID = 3  # rays along a side of a pixel
BLUR_STEPS = 5
PAPER, INK, FLOOR = 225.0, 25.0, 120.0

Path = Callable[[np.ndarray], np.ndarray]  # (N,) s to (N, 3) m, m, rad


@dataclass(frozen=True)
class Lens:
    """A pinhole camera with Brown's distortion; pixel centres are whole numbers.

    Attributes:
        size_px: width, height.
        focal_px, centre_px: of x and y each.
        distortion: k1, k2, p1, p2.
        position_m: (3,) in W.
        tilt_rad, roll_rad: from looking straight down with W's x to the right.
    """

    size_px: tuple[int, int] = (1920, 1080)
    focal_px: tuple[float, float] = (880.0, 883.0)
    centre_px: tuple[float, float] = (950.0, 545.0)
    distortion: tuple[float, float, float, float] = (-0.08, 0.02, 0.0006, -0.0004)
    position_m: tuple[float, float, float] = (0.1, -0.15, 2.5)
    tilt_rad: float = 0.08
    roll_rad: float = 0.05

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) from W to the camera."""
        a, b = self.tilt_rad, self.roll_rad
        tilt = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        roll = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
        return tilt @ roll @ np.diag([1.0, -1.0, -1.0])

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) as OpenCV has it."""
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    def _distorted(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k1, k2, p1, p2 = self.distortion
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """(N, 3) in W to (N, 2) px."""
        x, y, z = ((points_m - self.position_m) @ self.rotation.T).T
        return np.column_stack(self._distorted(x / z, y / z)) * self.focal_px + self.centre_px

    def rays(self, u_px: np.ndarray, v_px: np.ndarray) -> np.ndarray:
        """(..., 3) directions in W, by fixed-point iteration."""
        x0 = x = (u_px - self.centre_px[0]) / self.focal_px[0]
        y0 = y = (v_px - self.centre_px[1]) / self.focal_px[1]
        for _ in range(12):
            bent_x, bent_y = self._distorted(x, y)
            x, y = x + x0 - bent_x, y + y0 - bent_y
        return np.stack([x, y, np.ones_like(x)], axis=-1) @ self.rotation


@dataclass(frozen=True)
class Tag:
    """A tag that lies or drives.

    Attributes:
        number: which.
        path: where its centre is, and the angle of its front.
        size_m, height_m: of the black square; over the floor.
        hidden_s: from when until when something is held over it.
        lies: it never moves.
        family: OpenCV's number of it; all have MODULES.
    """

    number: int
    path: Path
    size_m: float = 0.10
    height_m: float = 0.12
    hidden_s: tuple[tuple[float, float], ...] = ()
    lies: bool = False
    family: int = cv2.aruco.DICT_APRILTAG_36h11

    @cached_property
    def bits(self) -> np.ndarray:
        """(MODULES, MODULES) bool, white; the first row is the front."""
        book = cv2.aruco.getPredefinedDictionary(self.family)
        return book.generateImageMarker(self.number, MODULES, borderBits=1) > 127


@dataclass
class Scene:
    """The floor, the light, and the camera's time.

    Attributes:
        lens: the camera.
        tags: on robots and on the floor.
        rate_hz: of the frames; frame k's first row starts to be exposed at k / rate_hz.
        exposure_s, line_delay_s: of a row; from row to row.
        noise: of a pixel, of 255.
        shadow: part of the light that is left in a half of the picture.
    """

    lens: Lens
    tags: list[Tag]
    rate_hz: float = 30.0
    exposure_s: float = 0.008
    line_delay_s: float = 0.0
    noise: float = 4.0
    shadow: float = 0.5
    seed: int = 1
    _light: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        random, (width, height) = np.random.default_rng(self.seed), self.lens.size_px
        texture = cv2.GaussianBlur(random.normal(0, 60, (height, width)), (0, 0), 3)
        self._floor = (FLOOR + texture).astype(np.float32)
        for tag in self.tags:
            if tag.lies:
                self._draw(self._floor, tag, 0.0)
        v, u = np.mgrid[:height, :width]
        edge = (u - 0.45 * width) + 0.4 * (v - 0.5 * height)
        light = self.shadow + (1 - self.shadow) / (1 + np.exp(-edge / 3))
        self._light = light.astype(np.float32)
        self._noise = random.normal(0, self.noise, (2 * height, width)).astype(np.float32)

    def frame(self, k: int) -> np.ndarray:
        """(H, W, 3) bytes of frame k."""
        picture, t_s = self._floor.copy(), k / self.rate_hz
        for tag in self.tags:
            if not tag.lies:
                self._draw(picture, tag, t_s)
        first = np.random.default_rng([self.seed, k]).integers(0, len(picture))
        seen = self._seen(picture, self._light, self._noise[first : first + len(picture)])
        return np.repeat(seen[..., None], 3, axis=2)

    def part(self, k: int, tag: Tag, around_px: int) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) bytes of frame k about a tag, but for the other tags that drive; (2,) its corner.

        The corner is on a multiple of 8 px, as the blocks of a codec are.
        """
        place = tag.path(np.array([k / self.rate_hz]))[0]
        (middle,) = self.lens.project(np.array([[*place[:2], tag.height_m]]))
        low = np.maximum(np.floor((middle - around_px) / 8).astype(int) * 8, 0)
        high = np.minimum(low + 2 * around_px, self.lens.size_px)
        cut = np.s_[low[1] : high[1], low[0] : high[0]]
        floor = self._floor[cut].copy()
        self._draw(self._floor, tag, k / self.rate_hz)
        drawn, self._floor[cut] = self._floor[cut].copy(), floor
        first = np.random.default_rng([self.seed, k]).integers(0, self.lens.size_px[1])
        noise = self._noise[first : first + self.lens.size_px[1]][cut]
        return self._seen(drawn, self._light[cut], noise), low

    @staticmethod
    def _seen(picture: np.ndarray, light: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """(h, w) bytes."""
        lit = cv2.GaussianBlur(picture * light, (5, 5), 0.6)
        return np.clip(lit + noise, 0, 255).astype(np.uint8)

    def write(self, path: str, count: int, codec: str = "mp4v") -> None:
        """A film of so many frames."""
        writer = cv2.VideoWriter(
            path, cv2.VideoWriter_fourcc(*codec), self.rate_hz, self.lens.size_px
        )
        assert writer.isOpened()
        for k in range(count):
            writer.write(self.frame(k))
        writer.release()

    def _draw(self, picture: np.ndarray, tag: Tag, t_s: float) -> None:
        place = tag.path(np.array([t_s]))[0]
        reach = 0.75 * SHEET * tag.size_m + 0.01
        corners = [(dx, dy) for dx in (-reach, reach) for dy in (-reach, reach)]
        points = [[place[0] + dx, place[1] + dy, tag.height_m] for dx, dy in corners]
        around = self.lens.project(np.array(points))
        low = np.maximum(np.floor(around.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(around.max(axis=0)).astype(int) + 1, self.lens.size_px)
        if np.any(high <= low):
            return
        if any(a <= t_s < b for a, b in tag.hidden_s):
            picture[low[1] : high[1], low[0] : high[0]] = 60
            return
        v, u = np.mgrid[low[1] : high[1], low[0] : high[0]].astype(float)
        ink, paper = np.zeros(u.shape), np.zeros(u.shape)
        offsets = (np.arange(GRID) + 0.5) / GRID - 0.5
        middle = self.lens.rays(u, v)  # within a pixel rays change evenly
        down, across = np.gradient(middle, axis=(0, 1))
        rays = [middle + du * across + dv * down for du in offsets for dv in offsets]
        for step in range(BLUR_STEPS):
            row_s = t_s + self.line_delay_s * v[:, 0] + (step + 0.5) / BLUR_STEPS * self.exposure_s
            pose = tag.path(row_s)
            for ray in rays:
                black, sheet = _sees(tag, pose, ray, self.lens.position_m)
                ink += black
                paper += sheet
        count = BLUR_STEPS * len(rays)
        part = picture[low[1] : high[1], low[0] : high[0]]
        part *= 1 - paper / count
        part += (PAPER * (paper - ink) + INK * ink) / count


def _sees(
    tag: Tag, pose: np.ndarray, ray: np.ndarray, eye_m: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) bool each: the ray meets ink; it meets the sheet."""
    depth = (tag.height_m - eye_m[2]) / ray[..., 2]
    x = eye_m[0] + depth * ray[..., 0] - pose[:, :1]
    y = eye_m[1] + depth * ray[..., 1] - pose[:, 1:2]
    c, s = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    forward, left = (c * x + s * y) / tag.size_m, (c * y - s * x) / tag.size_m
    sheet = np.maximum(np.abs(forward), np.abs(left)) < SHEET / 2
    on_tag = np.maximum(np.abs(forward), np.abs(left)) < 0.5
    row = np.clip(((0.5 - forward) * MODULES).astype(int), 0, MODULES - 1)
    column = np.clip(((0.5 - left) * MODULES).astype(int), 0, MODULES - 1)
    return on_tag & ~tag.bits[row, column], sheet


def circle(x_m: float, y_m: float, radius_m: float, rate_radps: float, phase_rad: float) -> Path:
    """A robot that drives round and round, its front ahead."""

    def path(t_s: np.ndarray) -> np.ndarray:
        angle = phase_rad + rate_radps * t_s
        ahead = angle + np.copysign(np.pi / 2, rate_radps)
        return np.column_stack(
            [x_m + radius_m * np.cos(angle), y_m + radius_m * np.sin(angle), ahead]
        )

    return path


def still(x_m: float, y_m: float, theta_rad: float) -> Path:
    """Path of a tag that never moves."""
    return lambda t_s: np.tile([x_m, y_m, theta_rad], (len(t_s), 1))


def board_view(lens: Lens, board: np.ndarray, square_px: int, square_m: float, seed: int):
    """(H, W, 3) bytes of a board, given as a picture, held before a camera somewhere and tilted."""
    random = np.random.default_rng(seed)
    turn, _ = cv2.Rodrigues(random.uniform([-0.6, -0.6, -3], [0.6, 0.6, 3]))
    height_px, width_px = board.shape
    half_m = np.array([width_px, height_px, 0]) / square_px * square_m / 2
    away_m = random.uniform(0.35, 0.6)
    size = np.array(lens.size_px)
    aim = (random.uniform(0.25, 0.75, 2) * size - lens.centre_px) / lens.focal_px
    middle_m = away_m * np.array([*aim, 1.0])
    v, u = np.mgrid[: size[1], : size[0]].astype(float)
    rays = lens.rays(u, v) @ lens.rotation.T  # in the camera's axes
    down, across = np.gradient(rays, axis=(0, 1))
    total = np.zeros(u.shape)
    for du, dv in ((-0.25, -0.25), (0.25, 0.25)):
        ray = rays + du * across + dv * down
        depth = (turn[:, 2] @ middle_m) / (ray @ turn[:, 2])
        place = (depth[..., None] * ray - middle_m) @ turn + half_m
        x, y = (
            np.floor(place[..., 0] / square_m * square_px),
            np.floor(place[..., 1] / square_m * square_px),
        )
        on = (x >= 0) & (x < width_px) & (y >= 0) & (y < height_px)
        x, y = np.where(on, x, 0).astype(int), np.where(on, y, 0).astype(int)
        total += np.where(on, board[y, x], 235.0) / 2
    picture = cv2.GaussianBlur(0.7 * total + 30, (5, 5), 0.6) + random.normal(0, 3, u.shape)
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
