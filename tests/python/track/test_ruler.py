# SPDX-License-Identifier: Apache-2.0
"""A sheet that a hand pushes along a ruler, filmed: the marks are the truth, not the tracker's."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from twinmill_cli import main as cli

sys.path.insert(0, str(Path(__file__).parent))
from rendering import Lens, Scene, Tag, still
from test_ceiling_camera import camera_toml, floor_toml

MARKS_MM = (0, 100, 200, 300)
REST_S, PUSH_S = 1.6, 0.9
RATE_HZ, EXPOSURE_S = 15.0, 0.008
LENS = Lens(
    size_px=(960, 540),
    focal_px=(440.0, 441.0),
    centre_px=(476.0, 271.0),
    position_m=(0.05, -0.05, 1.2),
    tilt_rad=0.15,
)
FLOOR = [
    Tag(500 + k, still(x, y, 0.4 * k), 0.1, 0.0, lies=True)
    for k, (x, y) in enumerate([(-0.9, -0.7), (0.95, -0.7), (0.8, 0.3), (-0.85, 0.25)])
]


def by_hand(t_s):
    """(N, 3) m, rad: from mark to mark, jerkily, with a tremor of 0.3 mm and 0.1 degrees."""
    marks_m = 1e-3 * np.array(MARKS_MM)
    part = np.clip((t_s % (REST_S + PUSH_S) - REST_S) / PUSH_S, 0, 1)
    leg = np.minimum((t_s // (REST_S + PUSH_S)).astype(int), len(marks_m) - 1)
    onward = np.where(leg < len(marks_m) - 1, part - 0.08 * np.sin(4 * np.pi * part), 0)
    along = marks_m[leg] + onward * (marks_m[1] - marks_m[0])
    tremor = 3e-4 * np.sin(2 * np.pi * 8.3 * t_s), 3e-4 * np.cos(2 * np.pi * 9.1 * t_s)
    turned = 0.3 + np.radians(0.1 * np.sin(2 * np.pi * 7.7 * t_s) + np.sin(np.pi * part))
    c, s = np.cos(0.35), np.sin(0.35)  # the ruler lies askew
    x, y = -0.2 + along + tremor[0], tremor[1]
    return np.column_stack([c * x - s * y, s * x + c * y - 0.05, turned])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("ruler")
    (path / "camera.toml").write_text(camera_toml(LENS, EXPOSURE_S, 0.0))
    (path / "floor.toml").write_text(floor_toml(FLOOR))
    count = round((len(MARKS_MM) * REST_S + (len(MARKS_MM) - 1) * PUSH_S) * RATE_HZ)
    scene = Scene(LENS, [*FLOOR, Tag(7, by_hand, 0.1, 0.0)], RATE_HZ, EXPOSURE_S)
    scene.write(str(path / "ruler.mp4"), count)
    return path


def checked(folder, capsys, height="0", marks=MARKS_MM):
    """Exit code, and what the two commands of the page say."""
    out = folder / f"ruler{height}.csv"
    words = ["track", str(folder / "ruler.mp4"), "--height", height, "--force", "--out", str(out)]
    words += ["--lens", str(folder / "camera.toml"), "--floor", str(folder / "floor.toml")]
    cli.run(words)
    capsys.readouterr()
    given = ",".join(map(str, marks))
    code = cli.run(["track-check", str(out), "--marks-mm", given, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_stops_of_a_hand_are_found_where_the_ruler_says(folder, capsys):
    code, found = checked(folder, capsys)
    assert (code, found["good"]) == (0, True)
    assert found["miss_m"] < 1e-3 and found["turn_rad"] < np.radians(0.3)
    for k, stop in enumerate(found["stops"]):
        begins_s = k * (REST_S + PUSH_S)
        assert stop["from_s"] == pytest.approx(begins_s, abs=0.35)
        assert stop["to_s"] == pytest.approx(begins_s + REST_S, abs=0.35)
    assert found["noise_m"] == pytest.approx(3e-4 / np.sqrt(2), rel=0.5)  # of the tremor


def test_wrong_height_is_told_by_the_length(folder, capsys):
    """Tags said to be 0.04 m over the floor seem smaller by 0.04 of 1.2 m."""
    code, found = checked(folder, capsys, "0.04")
    assert (code, found["good"]) == (1, False)
    assert found["scale"] == pytest.approx(1.16 / 1.2, abs=0.002)
    assert "3.3 % too short: see --height" in found["sentence"]


def test_other_marks_than_stops_are_refused(folder, capsys):
    with pytest.raises(ValueError, match=r"4 stops are seen \(0.*\), but 3 marks are given"):
        checked(folder, capsys, marks=(0, 100, 200))
    with pytest.raises(ValueError, match="--marks-mm 0,0: must be two numbers or more that rise"):
        cli.run(["track-check", str(folder / "ruler0.csv"), "--marks-mm", "0,0"])
