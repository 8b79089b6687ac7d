# SPDX-License-Identifier: Apache-2.0
"""Tags: which number, and which edge is up, between three that draw and two that look."""

import ctypes
from pathlib import Path

from interop.cells import Told, reads, writes

OPENCV, NUMPY = "opencv-python-headless==5.0.0.93", "numpy==2.4.6"
SHEETS, NUMBERS = "tags.pdf", (1, 2)
FAMILIES = ("36h11", "25h9", "16h5")
CELL_PX, QUIET = 8, 2


def _write(folder: Path) -> None:
    from twinmill_cli.main import run

    run(["tags", "--out", str(folder / SHEETS), "--robots", "1-2"])


def _pages(folder: Path):
    """Grey pictures of the sheets, by a browser's PDF library."""
    import pypdfium2

    for page in pypdfium2.PdfDocument(str(folder / SHEETS)):
        yield page.render(scale=1.5, grayscale=True).to_numpy().squeeze()


def _told(found: list[tuple[list[int], list]]) -> Told:
    """Numbers and the upper left corner of each page's tags, and whether it is up there."""
    numbers = [list(map(int, page)) for page, _ in found]
    upright = all(first[0] < other[0] and first[1] < other[1] for _, (first, other) in found)
    return {
        "numbers": numbers == [[n] for n in NUMBERS],
        "front, as its upper edge": upright,
    }


@writes("tags", "OpenCV", OPENCV, NUMPY, "pypdfium2==5.15.2", ours=_write)
def opencv(folder: Path) -> Told:
    """`ArucoDetector`."""
    import cv2

    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector, found = cv2.aruco.ArucoDetector(book), []
    for page in _pages(folder):
        corners, numbers, _ = detector.detectMarkers(page)
        found.append((numbers.ravel(), (corners[0][0][0], corners[0][0][2])))
    return _told(found)


@writes(
    "tags", "AprilTag 3", "pupil-apriltags==1.0.4.post11", NUMPY, "pypdfium2==5.15.2", ours=_write
)
def april_tag(folder: Path) -> Told:
    """Its authors' detector; of corners the last is the upper left one of their own drawing."""
    from pupil_apriltags import Detector

    detector, found = Detector(families="tag36h11"), []
    for page in _pages(folder):
        tags = detector.detect(page.copy())
        found.append(([t.tag_id for t in tags], (tags[0].corners[3], tags[0].corners[1])))
    return _told(found)


def _picture(cells):
    """Cells of 0 or 1 as pixels on white paper."""
    import numpy as np

    paper = np.pad(255 * (np.asarray(cells) > 0).astype(np.uint8), QUIET, constant_values=255)
    return np.kron(paper, np.ones((CELL_PX, CELL_PX), np.uint8))


def _save(folder: Path, family: str, number: int, cells) -> None:
    import numpy as np

    np.save(folder / f"{family}_{number}.npy", _picture(cells))


def _read_as(name: str):
    """Each family under its name: `apriltag_` as OpenCV draws it, `tag` as AprilTag does."""

    def ours(folder: Path) -> Told:
        import numpy as np

        from twinmill.track.detect import Detector

        told = {}
        for family in FAMILIES:
            upright = []
            for number in NUMBERS:
                picture = np.load(folder / f"{family}_{number}.npy")
                numbers, corners = Detector(name + family).find(picture)
                first, other = corners[0][[0, 2]]
                upright.append(numbers.tolist() == [number] and (first < other).all())
            told[f"{name}{family}"] = all(upright)
        return told

    return ours


@reads("tags", "OpenCV", OPENCV, NUMPY, ours=_read_as("apriltag_"))
def opencv_draws(folder: Path) -> None:
    """`generateImageMarker`."""
    import cv2

    for family in FAMILIES:
        book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{family}"))
        side = book.markerSize + 2
        for number in NUMBERS:
            _save(folder, family, number, book.generateImageMarker(number, side, borderBits=1))


@reads("tags", "moms-apriltag", "moms-apriltag==2023.1.15", NUMPY, OPENCV, ours=_read_as("tag"))
def moms(folder: Path) -> None:
    """Draws by AprilTag 2's lists of codes."""
    from moms_apriltag import TagGenerator2

    for family in FAMILIES:
        for number in NUMBERS:
            _save(folder, family, number, TagGenerator2(f"tag{family}").generate(number))


class _Image(ctypes.Structure):
    _fields_ = [
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
        ("stride", ctypes.c_int32),
        ("buf", ctypes.POINTER(ctypes.c_uint8)),
    ]


@reads("tags", "AprilTag 3, C library", "libapriltag3", ours=_read_as("tag"))
def april_tag_draws(folder: Path) -> None:
    """`apriltag_to_image`; it draws the white ring about the tag, too."""
    import numpy as np

    library = ctypes.CDLL("libapriltag.so.3")
    library.apriltag_to_image.restype = ctypes.POINTER(_Image)
    library.apriltag_to_image.argtypes = [ctypes.c_void_p, ctypes.c_uint32]
    for family in FAMILIES:
        create = getattr(library, f"tag{family}_create")
        create.restype = ctypes.c_void_p
        made = create()
        for number in NUMBERS:
            image = library.apriltag_to_image(made, number).contents
            rows = np.ctypeslib.as_array(image.buf, (image.height, image.stride))
            _save(folder, family, number, rows[:, : image.width].copy())
