# SPDX-License-Identifier: Apache-2.0
"""Cameras that overlap: their clocks, who follows a robot, and what a page shows of them."""

import http.client
import json
import sys
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
import turbopi

from twinmill.track.camera import Camera
from twinmill.track.floor import View
from twinmill.track.live import FrameDetections, publish
from twinmill.track.page import Page, drawn
from twinmill.track.paths import RobotPath, Tags
from twinmill.track.together import clocks, compared, merged, on_clock

sys.path.insert(0, str(Path(__file__).parent))
from rendering import Lens, Scene, Tag, circle, still

RATE_HZ, SECONDS = 30.0, 40.0
LEFT, RIGHT = (-2.0, 0.3), (-0.3, 2.0)  # x that each sees
LATE_S = 7.342  # the second film began so much later
OFF_M = 0.003  # and its floor was measured so much off


def drive(t_s):
    """(N, 3) to and fro through both views, with curves and a stop."""
    phase = 0.35 * np.minimum(t_s, 30.0)
    x, y = 1.5 * np.sin(phase), 0.4 * np.sin(2.3 * phase)
    return np.column_stack([x, y, np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))])


def film(sees, start_s, seed, seconds=SECONDS, off_m=0.0, path=drive):
    """Film of a camera on its own clock: noise of 0.2 mm and 0.2 degrees."""
    random = np.random.default_rng(seed)
    t_s = np.arange(0, seconds, 1 / RATE_HZ)
    pose = path(t_s + start_s) + random.normal(size=(len(t_s), 3)) * [2e-4, 2e-4, 3.5e-3]
    hidden = (pose[:, 0] < sees[0]) | (pose[:, 0] > sees[1])
    pose[:, 0] += off_m
    pose[hidden] = np.nan
    whole = np.where(hidden, np.nan, 0.2)
    return [RobotPath(4, t_s, pose, whole, 500 * whole, 0)]


def test_the_clock_of_a_film_is_found_from_a_robot_that_two_cameras_see():
    films = [film(LEFT, 0.0, 1), film(RIGHT, LATE_S, 2, 25.0, OFF_M)]
    first, second = clocks(films, ["a", "b"])
    assert first is None
    # A floor that is off by 3 mm is no matter of time; of noise 0.2 mm at 0.4 m/s remains little.
    assert second.shift_s == pytest.approx(LATE_S, abs=0.3e-3)
    assert second.apart_m == pytest.approx(OFF_M, rel=0.1)
    assert second.apart_rad == pytest.approx(np.sqrt(2) * 3.5e-3, rel=0.15)
    given = compared(films[0], on_clock(films[1], LATE_S))
    assert given.apart_m == pytest.approx(second.apart_m, rel=0.05)


def test_three_films_in_a_row_are_chained_by_their_neighbours():
    far = film((1.0, 3.0), 3.0, 3)  # of the first it sees nothing
    films = [film((-2.0, 0.0), 0.0, 1), far, film((-0.5, 1.4), LATE_S, 2)]
    _, last, middle = clocks(films, ["a", "b", "c"])
    assert middle.shift_s == pytest.approx(LATE_S, abs=1e-3)
    assert last.shift_s == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize("why", ["apart", "still"])
def test_films_that_cannot_be_placed_are_refused(why):
    if why == "apart":
        films = [film((-2.0, -0.5), 0.0, 1), film((0.5, 2.0), 1.0, 2)]
    else:
        stands = still(0.1, 0.2, 0.3)
        films = [film(LEFT, 0.0, k, path=stands) for k in (1, 2)]
    with pytest.raises(ValueError, match=r"b\.mp4: when it began cannot be found.*start_s"):
        clocks(films, ["a.mp4", "b.mp4"])


def test_a_robot_goes_from_camera_to_camera_without_a_gap_or_a_jump():
    films = [film(LEFT, 0.0, 1), on_clock(film(RIGHT, 0.007, 2), 0.007)]
    (path,) = merged(films)
    assert (np.diff(path.t_s) > 0).all() and path.valid.mean() > 0.97
    miss = (path.pose - drive(path.t_s))[path.valid]
    assert np.abs(miss[:, :2]).max() < 1.5e-3
    # One camera at a time: its frames, not both's.
    assert len(path.t_s) < 1.1 * len(films[0][0].t_s)


LENSES = [Lens((640, 360), (300.0, 300.0), (320.0, 180.0), (0.0, 0.0, 0.0, 0.0), (x, 0.0, 2.0), 0.0,
               0.0) for x in (-0.7, 0.7)]  # fmt: skip
TAGS = [Tag(1, circle(-0.9, 0.0, 0.3, 0.9, 0.3), 0.2), Tag(2, still(0.0, 0.1, 0.5), 0.2)]


def view_of(lens):
    camera = Camera(lens.size_px, lens.matrix, np.zeros(5))
    return View(camera, lens.rotation, np.array(lens.position_m), 0.0)


def test_live_each_robot_is_one_cameras_and_the_other_takes_it_when_that_loses_it():
    scenes = [Scene(lens, TAGS, RATE_HZ) for lens in LENSES]
    covered = [replace(scenes[0], tags=TAGS[:1])]

    def frames(k):
        for n in range(16):
            scene = covered[0] if k == 0 and n >= 6 else scenes[k]  # robot 2 is hidden from it
            yield 1000 + n / RATE_HZ, scene.frame(n)

    said = []
    counts = list(
        publish([frames(0), frames(1)], list(map(view_of, LENSES)), Tags(0.2, 0.12),
                lambda *message: said.append(message))
    )  # fmt: skip
    assert counts[-1].frames == 32
    poses = [turbopi.pose_t.decode(data) for channel, data in said if channel == "R02_POSE"]
    stamps = [p.utime_us for p in poses if p.valid]
    # A pose for each moment, but while the camera that lost it still held it.
    assert 16 - 6 <= len(stamps) <= 17
    for pose in poses:
        if pose.valid:
            assert pose.position_m[:2] == pytest.approx([0.0, 0.1], abs=6e-3)


def test_a_page_shows_each_cameras_picture_with_what_was_found():
    picture = np.full((360, 640, 3), 120, np.uint8)
    corners = np.array([[[100, 100], [140, 100], [140, 140], [100, 140]]], float)
    sight = FrameDetections(
        0, 1000.0, picture, np.array([7]), corners, {7: np.array([0.5, -1, 1])}, [9]
    )
    page = Page(2)
    try:
        page.show(sight)
        where = urlsplit(page.url)
        answers = {}
        for path in (where.path, where.path + "state.json", "/", where.path + "camera/0"):
            link = http.client.HTTPConnection(where.hostname, where.port, timeout=20)
            link.request("GET", path)
            answer = link.getresponse()
            answers[path] = answer.status, answer.read(1000)
            link.close()
    finally:
        page.close()
    status, text = answers[where.path]
    assert status == 200 and b'src="camera/0"' in text and b'src="camera/1"' in text
    (robot,) = json.loads(answers[where.path + "state.json"][1])["robots"]
    assert (robot["robot_id"], robot["x_m"], robot["lost"]) == (7, 0.5, False)
    assert robot["theta_deg"] == pytest.approx(np.degrees(1))
    assert answers["/"][0] == 404  # without the secret there is nothing
    assert answers[where.path + "camera/0"][1].startswith(b"--frame\r\nContent-Type: image/jpeg")
    shown = cv2.imdecode(np.frombuffer(drawn(sight, 30.0), np.uint8), cv2.IMREAD_COLOR)
    green = (shown[..., 1] > 150) & (shown[..., 2] < 110) & (shown[..., 0] < 110)
    assert green[95:145, 95:145].any() and green[70:95, 115:125].any()  # square, and arrow upwards


def test_a_port_that_is_taken_is_one_sentence():
    page = Page(1)
    try:
        with pytest.raises(ValueError, match=r"port=\d+: cannot be used"):
            Page(1, urlsplit(page.url).port)
    finally:
        page.close()
