# SPDX-License-Identifier: Apache-2.0
"""Sheets to print, to scale: tags for robots and floor, and the board for the lens."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from twinmill.arguments import option
from twinmill.track.boards import Board
from twinmill.track.detect import FAMILIES, FAMILY

PAPERS_M = {"a4": (0.210, 0.297), "a3": (0.297, 0.420), "letter": (0.2159, 0.2794)}
MODULES = 8  # a side, black border included
QUIET = 1 + 2 / MODULES  # white paper that a detector needs, in sides
CUT = 1.5  # where to cut, in sides
MARGIN_M = 0.008  # that printers leave white
RULER_M = 0.1
RULER_Y_M = 0.022
INCH_M = 0.0254
DOTS = 40  # of a module: viewers that smooth pictures then smooth little


def robot_sheet(number: int, size_m: float, paper: str) -> Figure:
    """One robot's tag, its number, and a line at its front.

    Raises:
        ValueError: it does not fit on the paper.
    """
    page = _Page(PAPERS_M[paper])
    side_m = _draw_tag(page, number, size_m, paper)
    x_m, y_m = page.middle
    top_m, edge_m = y_m + QUIET / 2 * size_m, y_m + side_m / 2
    page.axes.plot([x_m, x_m], [top_m, edge_m], color="black", linewidth=2.5)
    page.write(x_m + 0.003, (top_m + edge_m) / 2, "front", points=10, ha="left")
    page.write(x_m, y_m - (QUIET + CUT) / 4 * size_m, f"robot {number}", points=14)
    page.write(x_m, edge_m + 0.02, f"Robot {number}", points=40)
    advice = "The line goes to the robot's front, the square's middle over its centre."
    page.write(x_m, edge_m + 0.008, advice, points=9)
    _draw_ruler(page, f"tag 36h11 no. {number}, black square {1e3 * size_m:g} mm")
    return page.figure


def floor_sheet(number: int, size_m: float, paper: str) -> Figure:
    """A tag for the floor, with lines to measure its middle from.

    Raises:
        ValueError: it does not fit on the paper.
    """
    page = _Page(PAPERS_M[paper])
    side_m = _draw_tag(page, number, size_m, paper)
    x_m, y_m = page.middle
    near_m, far_m = QUIET / 2 * size_m, side_m / 2
    for sign in (-1, 1):
        page.axes.plot([x_m] * 2, [y_m + sign * near_m, y_m + sign * far_m], color="black", lw=1)
        page.axes.plot([x_m + sign * near_m, x_m + sign * far_m], [y_m] * 2, color="black", lw=1)
    page.write(x_m, y_m + far_m + 0.02, f"Floor {number}", points=40)
    page.write(
        x_m, y_m + far_m + 0.008, "Flat on the floor; measure where the four lines meet.", points=9
    )
    _draw_ruler(page, f"tag 36h11 no. {number}, black square {1e3 * size_m:g} mm")
    return page.figure


def board_sheet(board: Board, paper: str) -> Figure:
    """A ChArUco board, across the paper.

    Raises:
        ValueError: it does not fit.
    """
    short_m, long_m = PAPERS_M[paper]
    page = _Page((long_m, short_m))
    width_m, height_m = (board.square_m * n for n in board.squares)
    x_m, y_m = page.middle
    y_m += 0.006
    if width_m > long_m - 2 * MARGIN_M or y_m + height_m / 2 > short_m - MARGIN_M / 4:
        raise ValueError(
            f"the board is {1e3 * width_m:.0f} by {1e3 * height_m:.0f} mm and does not fit on "
            f"{paper}; choose a larger {option('paper')}."
        )
    page.picture(board.drawn(8 * DOTS), x_m, y_m, w_m=width_m, h_m=height_m)
    across, down = board.squares
    _draw_ruler(page, f"ChArUco {across} by {down}, square {1e3 * board.square_m:g} mm", 0.009)
    return page.figure


def write_sheets(path: Path, sheets: Iterable[Figure]) -> int:
    """One page each; says how many. The same sheets give the same bytes."""
    count = 0
    with PdfPages(path, metadata={"CreationDate": None, "Title": "Twinmill tags"}) as pages:
        for figure in sheets:
            pages.savefig(figure)
            count += 1
    return count


class _Page:
    """A figure as large as the paper, whose axes are metres from its lower left corner."""

    def __init__(self, size_m: tuple[float, float]):
        self.figure = Figure(figsize=tuple(side / INCH_M for side in size_m))
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set_xlim(0, size_m[0])
        self.axes.set_ylim(0, size_m[1])
        self.axes.axis("off")
        self.size_m = size_m
        self.middle = (size_m[0] / 2, size_m[1] / 2)

    def write(
        self, x_m: float, y_m: float, words: str, *, points: float, ha: str = "center"
    ) -> None:
        self.axes.text(x_m, y_m, words, fontsize=points, ha=ha, va="center")

    def picture(self, grey: np.ndarray, x_m: float, y_m: float, *, w_m: float, h_m: float) -> None:
        self.axes.imshow(
            grey, cmap="gray", vmin=0, vmax=255, interpolation="none", aspect="auto",
            extent=(x_m - w_m / 2, x_m + w_m / 2, y_m - h_m / 2, y_m + h_m / 2),
        )  # fmt: skip
        self.axes.set_xlim(0, self.size_m[0])
        self.axes.set_ylim(0, self.size_m[1])


def _draw_tag(page: _Page, number: int, size_m: float, paper: str) -> float:
    """Tag and where to cut; gives the side of the piece."""
    room_m = min(page.size_m) - 2 * MARGIN_M
    if CUT * size_m > room_m:
        raise ValueError(
            f"{option('size', size_m)}: does not fit on {paper}, the largest is {room_m / CUT:.3f} "
            "m; "
            f"choose a larger {option('paper')}."
        )
    book = cv2.aruco.getPredefinedDictionary(FAMILIES[FAMILY].dictionary)
    tag = book.generateImageMarker(number, MODULES, borderBits=1)
    x_m, y_m = page.middle
    page.picture(np.kron(tag, np.ones((DOTS, DOTS), np.uint8)), x_m, y_m, w_m=size_m, h_m=size_m)
    corner = (x_m - CUT / 2 * size_m, y_m - CUT / 2 * size_m)
    page.axes.add_patch(
        Rectangle(corner, CUT * size_m, CUT * size_m, fill=False, color="0.6", lw=0.6, ls="--")
    )
    return CUT * size_m


def _draw_ruler(page: _Page, what: str, y_m: float = RULER_Y_M) -> None:
    start_m = page.middle[0] - RULER_M / 2
    page.axes.plot([start_m, start_m + RULER_M], [y_m, y_m], color="black", lw=0.8)
    for k in range(11):
        tick_m = 0.004 if k % 5 == 0 else 0.002
        page.axes.plot([start_m + k * RULER_M / 10] * 2, [y_m, y_m + tick_m], color="black", lw=0.8)
    page.write(
        page.middle[0], y_m - 0.005,
        f"This line is {1e3 * RULER_M:.0f} mm long: if yours is not, print at 100 %, not fitted to "
        f"the page.  ({what})", points=7,
    )  # fmt: skip
