# SPDX-License-Identifier: Apache-2.0
"""Where the camera is over the floor, from points whose places on it were measured."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from twinmill.track.camera import Camera
from twinmill.track.detect import ROBOTS, TAGS, Sightings, centres, check_single

FEWEST = 4  # three leave two places for the camera, and nothing to check by
FLAT = 0.05  # points are on a line if they stretch less than this share across it
MIRRORED = 0.5  # of `_turned_alike`; points that are exchanged make less
EDGE = 0.15  # of the picture, where boards are seldom shown
WORST_PX, WORST_M = 2.0, 0.005  # beyond both it is no tape measure's error


@dataclass(frozen=True)
class View:
    """A camera over the floor.

    Attributes:
        camera: its lens.
        rotation: (3, 3) from W to the camera's axes: x right, y down, z ahead.
        position_m: (3,) of the camera in W.
        error_px: RMS miss of the floor's points.
    """

    camera: Camera
    rotation: np.ndarray
    position_m: np.ndarray
    error_px: float

    @property
    def tilt_rad(self) -> float:
        """Angle between the camera's axis and the way straight down."""
        return float(np.arccos(np.clip(-self.rotation[2, 2], -1, 1)))

    def on_plane(self, pixels: np.ndarray, height_m: float) -> np.ndarray:
        """(N, 2) px to (N, 2) m: where their rays meet the plane z = height_m; NaN above it."""
        rays = self.camera.rays(pixels) @ self.rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (height_m - self.position_m[2]) / rays[:, 2]
        met = self.position_m[:2] + reach[:, None] * rays[:, :2]
        return np.where((reach > 0)[:, None], met, np.nan)

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """(N, 3) in W to (N, 2) px."""
        turn, _ = cv2.Rodrigues(self.rotation)
        shift = -self.rotation @ self.position_m
        pixels, _ = cv2.projectPoints(
            np.ascontiguousarray(points_m, float), turn, shift,
            self.camera.matrix, self.camera.distortion,
        )  # fmt: skip
        return pixels.reshape(-1, 2)


@dataclass(frozen=True)
class Floor:
    """Measured points and tags on the floor, with the pixels that show them.

    Attributes:
        place_m: (N, 2) in W.
        pixel: (N, 2); NaN for tags, whose centres are looked for.
        tag: (N,) number; -1 for points.
    """

    place_m: np.ndarray
    pixel: np.ndarray
    tag: np.ndarray


def read_floor(path: Path) -> Floor:
    """Reads [[tag]] number, x_m, y_m and [[point]] u_px, v_px, x_m, y_m.

    Raises:
        ValueError: it is no such file, or its points do not fix a plane.
    """
    try:
        data = tomlkit.parse(path.read_text()).unwrap()
        tags, points = data.get("tag", []), data.get("point", [])
        place = [[float(row["x_m"]), float(row["y_m"])] for row in [*tags, *points]]
        pixel = [[np.nan, np.nan]] * len(tags)
        pixel += [[float(row["u_px"]), float(row["v_px"])] for row in points]
        number = [int(row["number"]) for row in tags] + [-1] * len(points)
    except KeyError as error:
        raise ValueError(
            f"{path}: {error} is missing; a [[tag]] has number, x_m, y_m, and a [[point]] has "
            "u_px, v_px, x_m, y_m."
        ) from error
    except (OSError, UnicodeDecodeError, TOMLKitError, TypeError, ValueError, AttributeError) as e:
        raise ValueError(f"{path}: is no floor file ({e}).") from e
    floor = Floor(np.array(place).reshape(-1, 2), np.array(pixel).reshape(-1, 2), np.array(number))
    known = floor.tag[floor.tag >= 0]
    if wrong := [n for n in known.tolist() if n in ROBOTS or n >= TAGS]:
        raise ValueError(
            f"{path}: tag {wrong[0]} is no floor tag; they are {ROBOTS.stop} to {TAGS - 1}, as a "
            "smaller number is a robot's."
        )
    if len(np.unique(known)) < len(known):
        raise ValueError(f"{path}: a tag is listed twice; each lies at one place.")
    if not np.isfinite(floor.place_m).all():
        raise ValueError(f"{path}: x_m and y_m must be numbers.")
    _check_spread(f"{path}: has", floor.place_m)
    return floor


def _check_spread(who: str, place_m: np.ndarray) -> None:
    if len(place_m) < FEWEST:
        raise ValueError(
            f"{who} {len(place_m)} floor points, and {FEWEST} are needed; measure more of them."
        )
    if _on_a_line(place_m):
        raise ValueError(f"{who} floor points that are all on one line; lay one beside it.")


def _on_a_line(place_m: np.ndarray) -> bool:
    stretch = np.linalg.svd(place_m - place_m.mean(axis=0), compute_uv=False)
    return bool(stretch[1] < FLAT * stretch[0])


def look(camera: Camera, floor: Floor, seen: Sightings) -> View:
    """Where the camera is: planar pose (Collins and Bartoli 2014), refined by least squares.

    Args:
        camera: its lens.
        floor: what was measured.
        seen: tags of a film; each floor tag's centre is the median over it.

    Raises:
        ValueError: too few of the tags were seen, one at two places, or the points do not fit.
    """
    check_single(seen.of(np.isin(seen.number, floor.tag)))
    pixel = floor.pixel.copy()
    for k in np.flatnonzero(floor.tag >= 0):
        rows = seen.number == floor.tag[k]
        if rows.any():
            pixel[k] = np.median(centres(seen.corners_px[rows]), axis=0)
    known = np.isfinite(pixel).all(axis=1)
    if not known.all():
        missing = ", ".join(str(n) for n in floor.tag[~known])
        if np.count_nonzero(known) < FEWEST:
            raise ValueError(
                f"floor: tags {missing} are nowhere in the film, and {FEWEST} points are needed; "
                "see that they are in view, lit and flat."
            )
    place_m, pixel = floor.place_m[known], pixel[known]
    _check_spread("floor: sees", place_m)
    view = _pose(camera, place_m, pixel)
    if _misses(view, place_m):
        raise ValueError(_which(view, place_m, pixel, floor.tag[known]))
    return view


def _pose(camera: Camera, place_m: np.ndarray, pixel: np.ndarray) -> View:
    """From (N, 2) m and (N, 2) px.

    Planar pose has no answer where the camera looks exactly straight down; the homography has.
    """
    flat = camera.rays(pixel)[:, :2]
    mirrored = ValueError(
        "floor: the points are mirrored, the camera would be under the floor; x to y must turn "
        "counter-clockwise, seen from above."
    )
    if _turned_alike(place_m, flat) > MIRRORED:
        raise mirrored
    solid = np.column_stack([place_m, np.zeros(len(place_m))])
    lens = camera.matrix, camera.distortion
    found, turns, shifts, _ = cv2.solvePnPGeneric(solid, pixel, *lens, flags=cv2.SOLVEPNP_IPPE)
    views = []
    starts = [*_start(place_m, flat), *zip(turns[:found], shifts[:found], strict=True)]
    for turn, shift in starts:
        if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
            continue
        turn, shift = cv2.solvePnPRefineLM(solid, pixel, *lens, turn.copy(), shift.copy())
        rotation, _ = cv2.Rodrigues(turn)
        view = View(camera, rotation, -rotation.T @ shift.ravel(), 0.0)
        miss = np.sqrt(np.mean(np.sum((view.project(solid) - pixel) ** 2, axis=1)))
        if np.isfinite(miss) and view.position_m[2] > 0:
            views.append(View(camera, rotation, view.position_m, float(miss)))
    if not views:
        raise mirrored
    return min(views, key=lambda view: view.error_px)


def _turned_alike(place_m: np.ndarray, flat: np.ndarray) -> float:
    """From -1 to 1: whether triangles of points turn the same way on the floor and in the picture.

    The sum over all triangles of the products of their areas (Cauchy-Binet), as a share of the
    most that it can be. Seen from above the picture's axes, x right and y down, turn them over.
    """
    floor, seen = place_m - place_m.mean(axis=0), flat - flat.mean(axis=0)
    most = np.sqrt(np.linalg.det(floor.T @ floor) * np.linalg.det(seen.T @ seen))
    return float(np.linalg.det(floor.T @ seen) / most) if most > 0 else 0.0


def _start(place_m: np.ndarray, flat: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Turn and shift, (3, 1) each, by the floor's homography (Zhang 2000, section 3.1)."""
    middle_m = place_m.mean(axis=0)
    h, _ = cv2.findHomography(place_m - middle_m, flat)
    if h is None:
        return []
    h *= np.sign(h[2, 2]) / np.sqrt(np.linalg.norm(h[:, 0]) * np.linalg.norm(h[:, 1]))
    u, _, v = np.linalg.svd(np.column_stack([h[:, 0], h[:, 1], np.cross(h[:, 0], h[:, 1])]))
    rotation = u @ v
    turn, _ = cv2.Rodrigues(rotation)
    return [(turn, (h[:, 2] - rotation[:, :2] @ middle_m).reshape(3, 1))]


def _error_m(view: View, place_m: np.ndarray) -> float:
    """The points' miss on the floor, about."""
    away_m = np.linalg.norm(view.position_m - np.append(place_m.mean(axis=0), 0))
    return float(view.error_px * away_m / view.camera.matrix[0, 0])


def _misses(view: View, place_m: np.ndarray) -> bool:
    return view.error_px > WORST_PX and _error_m(view, place_m) > WORST_M


def _which(view: View, place_m: np.ndarray, pixel: np.ndarray, tag: np.ndarray) -> str:
    """The sentence on points that do not fit: without which one the rest do."""
    head = (
        f"floor: the points miss the picture by {view.error_px:.1f} px "
        f"({1e3 * _error_m(view, place_m):.0f} mm)"
    )
    names = [
        f"tag {n}" if n >= 0 else f"the point at {u:g}, {v:g} px"
        for n, (u, v) in zip(tag.tolist(), pixel, strict=True)
    ]
    rests = []
    for k in range(len(place_m)) if len(place_m) > FEWEST else ():
        rest = np.arange(len(place_m)) != k
        if not _on_a_line(place_m[rest]):
            with suppress(ValueError):
                rests.append((_pose(view.camera, place_m[rest], pixel[rest]), k, place_m[rest]))
    best = min(rests, key=lambda found: found[0].error_px, default=None)
    if best and not _misses(best[0], best[2]):
        part = pixel[best[1]] / view.camera.size_px
        lens = (
            "; it is near the edge of the picture, where the lens may be wrong: show the board "
            "there, too, and calibrate it again"
        )
        return (
            f"{head}; without {names[best[1]]} the rest miss by {best[0].error_px:.1f} px: measure "
            "anew where it is, or take it out of the floor file"
            f"{lens * bool(np.minimum(part, 1 - part).min() < EDGE)}."
        )
    return (
        f"{head}; check the places of {', '.join(names)}, which is which, and that the lens file "
        f"is this camera's{'; a fifth point would show which is wrong' * (len(names) == FEWEST)}."
    )
