# SPDX-License-Identifier: Apache-2.0
"""`twinmill track tags`: what is printed is found, is as large as it says, and shows the front."""

import io
import re

import cv2
import numpy as np
import pytest

from twinmill.track.boards import Board
from twinmill.track.detect import Detector
from twinmill.track.sheets import board_sheet, floor_sheet, robot_sheet
from twinmill_cli import main as cli

DPI = 200
INCH_M = 0.0254


def printed(figure):
    """(H, W) bytes of a page."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI)
    return cv2.imdecode(np.frombuffer(buffer.getvalue(), np.uint8), cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize("size_m", [0.04, 0.10, 0.125])
def test_tag_is_its_robots_and_as_large_as_said(size_m):
    numbers, corners = Detector().find(printed(robot_sheet(17, size_m, "a4")))
    assert numbers.tolist() == [17]
    sides_px = np.linalg.norm(np.roll(corners[0], -1, axis=0) - corners[0], axis=1)
    assert sides_px == pytest.approx(size_m / INCH_M * DPI, abs=1.5)


def test_line_is_at_the_edge_that_the_tracker_calls_the_front():
    page = printed(robot_sheet(3, 0.10, "a4"))
    _, (corners,) = Detector().find(page)
    front, middle = corners[:2].mean(axis=0), corners.mean(axis=0)
    half = front - middle

    def darkness(part):  # within 6 px of a place `part` half sides away from the middle
        x, y = np.round(middle + part * half).astype(int)
        return 255 - page[y - 6 : y + 7, x - 6 : x + 7].min()

    assert darkness(1.38) > 200  # the line
    assert darkness(1.1) < 20  # white paper about the tag
    assert darkness(-1.1) < 20


def test_ruler_is_100_mm_long():
    page = printed(robot_sheet(3, 0.10, "a4"))
    height = page.shape[0]
    low, high = height - round(0.0225 / INCH_M * DPI), height - round(0.0215 / INCH_M * DPI)
    dark = np.flatnonzero((page[low:high] < 128).any(axis=0))
    assert np.ptp(dark) == pytest.approx(0.1 / INCH_M * DPI, abs=3)


def test_board_is_found_with_all_corners_where_they_should_be():
    places, pixels = Board().find(printed(board_sheet(Board(), "a4")))
    assert len(places) == 6 * 4
    step_px = 0.036 / INCH_M * DPI
    assert np.ptp(pixels, axis=0) == pytest.approx([5 * step_px, 3 * step_px], abs=1)


def test_floor_tag_is_found():
    numbers, _ = Detector().find(printed(floor_sheet(502, 0.10, "letter")))
    assert numbers.tolist() == [502]


def test_command_writes_pages_of_the_papers_size_and_the_same_bytes(tmp_path):
    for name in ("a.pdf", "b.pdf"):
        found = cli.run(["tags", "--out", str(tmp_path / name), "--robots", "1-2,7", "--floor",
                         "--board", "--json"])  # fmt: skip
    data = (tmp_path / "a.pdf").read_bytes()
    assert found["pages"] == 8 and found["robots"] == [1, 2, 7]
    boxes = re.findall(rb"/MediaBox \[ ?([\d. ]+) ?\]", data)
    sides_mm = np.array([[float(n) for n in box.split()[2:]] for box in boxes]) * 25.4 / 72
    assert sides_mm[:7] == pytest.approx(np.tile([210, 297], (7, 1)), abs=0.1)
    assert sides_mm[7] == pytest.approx([297, 210], abs=0.1)
    assert data == (tmp_path / "b.pdf").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--size", "0.2"], "does not fit on a4, the largest is 0.129 m"),
        (["--paper", "b7"], "one of a4, a3, letter"),
        (["--robots", "8-1"], "numbers and ranges"),
        (["--robots", "120"], "not in 0..99"),
        (["--size", "5"], "0.01..1 m"),
    ],
)
def test_mistakes_get_one_sentence(tmp_path, arguments, words):
    with pytest.raises(ValueError, match=words):
        cli.run(["tags", "--out", str(tmp_path / "a.pdf"), *arguments])
    assert list(tmp_path.iterdir()) == []
