# SPDX-License-Identifier: Apache-2.0
"""Tags as AprilTag's authors draw them, and as OpenCV does: upside down against each other."""

import cv2
import numpy as np
import pytest

from twinmill.track.detect import FAMILIES, Detector, other_drawing

# The first code words of each family as AprilTag 2 lists them (Wang and Olson 2016): rows of bits
# from the upper left, white is 1, within a black border of one.
WORDS = {
    "36h11": (6, (0xD5D628584, 0xD97F18B49, 0xDD280910E)),
    "25h9": (5, (0x155CBF1, 0x1E4D1B6, 0x17B0B68)),
    "16h5": (4, (0x231B, 0x2EA5, 0x346A)),
}
CELL_PX, QUIET = 8, 2


def by_april_tag(side, word):
    """A picture of the tag, upright, on white paper."""
    bits = [(word >> k) & 1 for k in reversed(range(side * side))]
    cells = np.pad(np.reshape(bits, (side, side)), 1)
    cells = np.pad(cells, QUIET, constant_values=1)
    return np.kron(255 * cells, np.ones((CELL_PX, CELL_PX))).astype(np.uint8)


def by_opencv(name, number, side):
    book = cv2.aruco.getPredefinedDictionary(FAMILIES[name].dictionary)
    picture = book.generateImageMarker(number, (side + 2) * CELL_PX, borderBits=1)
    return np.pad(picture, QUIET * CELL_PX, constant_values=255)


def corners_of_upright(side):
    low, high = QUIET * CELL_PX, (QUIET + side + 2) * CELL_PX
    return np.array([[low, low], [high, low], [high, high], [low, high]]) - 0.5


@pytest.mark.parametrize("family", WORDS)
def test_the_upper_edge_of_either_drawing_is_the_front_under_its_own_name(family):
    side, words = WORDS[family]
    for number, word in enumerate(words):
        drawn = {
            f"tag{family}": by_april_tag(side, word),
            f"apriltag_{family}": by_opencv(f"apriltag_{family}", number, side),
        }
        for name, picture in drawn.items():
            numbers, corners = Detector(name).find(picture)
            assert numbers.tolist() == [number]
            np.testing.assert_allclose(corners[0], corners_of_upright(side), atol=1)
            _, backwards = Detector(other_drawing(name)).find(picture)
            np.testing.assert_allclose(backwards[0], corners_of_upright(side)[[2, 3, 0, 1]], atol=1)


def test_only_drawings_of_april_tag_have_another_one():
    assert other_drawing("apriltag_25h9") == "tag25h9"
    assert other_drawing("tag16h5") == "apriltag_16h5"
    assert other_drawing("4x4_50") is None
