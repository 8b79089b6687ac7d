# SPDX-License-Identifier: Apache-2.0
"""Tags in a picture, found by OpenCV: AprilTag 36h11 (Wang and Olson 2016), or another family."""

from dataclasses import dataclass

import cv2
import numpy as np

from twinmill.arguments import option


@dataclass(frozen=True)
class Family:
    """Drawings of tags: OpenCV's dictionary, and whether they stand on their head against it."""

    dictionary: int
    turned: bool = False


# By its name in OpenCV: `apriltag_36h11`, `4x4_50` and others of ArUco.
BY_OPENCV = {
    name.removeprefix("DICT_").lower(): Family(number)
    for name, number in vars(cv2.aruco).items()
    if name.startswith("DICT_")
}
# By its name in AprilTag, as `tag36h11`: the same bits, read from the opposite corner.
BY_APRILTAG = {
    name.replace("apriltag_", "tag"): Family(family.dictionary, turned=True)
    for name, family in BY_OPENCV.items()
    if name.startswith("apriltag_")
}
FAMILIES = BY_OPENCV | BY_APRILTAG
FAMILY = "apriltag_36h11"
ROBOTS = range(100)  # a robot's tag is its number
FLOOR = range(500, 504)  # as `twinmill track tags --floor` prints them
TAGS = 587  # in the family
WINDOW_PX, WINDOW_MODULES = 5, 0.8  # half width: a corner is refined without its neighbours

THRESHOLD_PX = 23  # one window about each pixel finds what OpenCV's three do, in 40 % of the time


@dataclass(frozen=True)
class Sightings:
    """Tags found in a film.

    Attributes:
        frame: (N,) int, ascending.
        number: (N,) int, the tag's.
        corners_px: (N, 4, 2) front left, front right, rear right, rear left; a pixel's centre is a
            whole number.
    """

    frame: np.ndarray
    number: np.ndarray
    corners_px: np.ndarray

    def of(self, rows: np.ndarray) -> "Sightings":
        """Those at these rows."""
        return Sightings(self.frame[rows], self.number[rows], self.corners_px[rows])


class Detector:
    """Finds tags of a family in pictures, their corners to parts of a pixel.

    Raises:
        ValueError: there is no such family.
    """

    def __init__(self, family: str = FAMILY):
        if family not in FAMILIES:
            raise ValueError(
                f"{option('family', family)}: is none of {', '.join(sorted(FAMILIES))}."
            )
        settings = cv2.aruco.DetectorParameters()
        settings.adaptiveThreshWinSizeMin = settings.adaptiveThreshWinSizeMax = THRESHOLD_PX
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        settings.cornerRefinementWinSize = WINDOW_PX
        settings.relativeCornerRefinmentWinSize = WINDOW_MODULES
        self._first = 2 if FAMILIES[family].turned else 0
        book = cv2.aruco.getPredefinedDictionary(FAMILIES[family].dictionary)
        self._detector = cv2.aruco.ArucoDetector(book, settings)

    def find(self, picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(K,) numbers and (K, 4, 2) corners in (H, W, 3) or (H, W) bytes."""
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
        corners, numbers, _ = self._detector.detectMarkers(grey)
        if numbers is None or len(numbers) == 0:
            return np.empty(0, int), np.empty((0, 4, 2))
        from_front = np.roll(np.array(corners, float).reshape(-1, 4, 2), self._first, axis=1)
        return numbers.ravel().astype(int), from_front


def other_drawing(family: str) -> str | None:
    """The family of the same tags that stand on their head; None where there is none."""
    own = FAMILIES[family]
    twins = (name for name, f in FAMILIES.items() if f.dictionary == own.dictionary)
    return next((name for name in twins if FAMILIES[name].turned != own.turned), None)


def check_single(seen: Sightings) -> None:
    """Two tags of one number in a frame, apart by more than half a side, are two things.

    Raises:
        ValueError: there are such.
    """
    order = np.lexsort([seen.number, seen.frame])
    frame, number, corners_px = seen.frame[order], seen.number[order], seen.corners_px[order]
    step_px = np.linalg.norm(np.diff(corners_px.mean(axis=1), axis=0), axis=1)
    side_px = np.linalg.norm(corners_px[1:, 0] - corners_px[1:, 1], axis=1)
    same = (np.diff(frame) == 0) & (np.diff(number) == 0)
    for k in np.flatnonzero(same & (step_px > side_px / 2))[:1]:
        raise ValueError(
            f"number {number[k]} was seen twice in one picture (frame {frame[k]}); give each robot "
            "its own."
        )


def gather(found: list[tuple[np.ndarray, np.ndarray]]) -> Sightings:
    """Sightings gathered from the answers of Detector.find for each frame of a film."""
    counts = [len(numbers) for numbers, _ in found]
    return Sightings(
        np.repeat(np.arange(len(found)), counts),
        np.concatenate([np.empty(0, int), *(numbers for numbers, _ in found)]),
        np.concatenate([np.empty((0, 4, 2)), *(corners for _, corners in found)]),
    )


def centres(corners_px: np.ndarray) -> np.ndarray:
    """(N, 2) pixels where the diagonals of (N, 4, 2) corners cross: a square's centre, as seen."""
    a, b, c, d = np.moveaxis(corners_px, 1, 0)
    along, across = c - a, d - b
    part = _cross(b - a, across) / _cross(along, across)
    return a + part[:, None] * along


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
