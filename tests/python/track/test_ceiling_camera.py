# SPDX-License-Identifier: Apache-2.0
"""`twinmill track` on rendered films whose truth is known; the renderer has none of its code."""

import csv
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import turbopi

from twinmill.data.importers.plain import Columns, read_poses
from twinmill.data.log import read_log
from twinmill.track.boards import Board
from twinmill.track.camera import Camera, read_camera
from twinmill.track.detect import Sightings, centres
from twinmill.track.film import Film
from twinmill.track.floor import Floor, View, look
from twinmill.track.live import publish
from twinmill.track.locate import locate
from twinmill.track.paths import Tags, follow
from twinmill.track.quality import judge
from twinmill_cli import main as cli

sys.path.insert(0, str(Path(__file__).parent))
from rendering import Lens, Scene, Tag, board_view, circle, still

FRAMES, RATE_HZ, HEIGHT_M = 48, 30.0, 0.12
HIDDEN_S = (0.5, 0.8)
LENS = Lens()
FLOOR = [
    Tag(500 + k, still(x, y, 0.4 * k), 0.12, 0.0, lies=True)
    for k, (x, y) in enumerate([(-1.3, -1.1), (1.4, -1.0), (1.3, 0.9), (-1.2, 0.85)])
]
ROBOTS = [
    Tag(1, circle(-0.7, 0.2, 0.3, 0.9, 0.3)),
    Tag(2, circle(0.5, -0.4, 0.4, -0.7, 2.0), hidden_s=(HIDDEN_S,)),
    Tag(3, circle(0.6, 0.45, 0.3, 4.0, 1.0)),  # 1.2 m/s, once round in the film
]


def camera_toml(lens, exposure_s=0.003, line_delay_s=25e-6):
    (fx, fy), (cx, cy) = lens.focal_px, lens.centre_px
    return f"""[lens]
width_px = {lens.size_px[0]}
height_px = {lens.size_px[1]}
focal_x_px = {fx}
focal_y_px = {fy}
centre_x_px = {cx}
centre_y_px = {cy}
distortion = {[*lens.distortion, 0.0]}
[shutter]
exposure_s = {exposure_s}
line_delay_s = {line_delay_s}
"""


def floor_toml(tags):
    places = [(tag.number, *tag.path(np.zeros(1))[0, :2]) for tag in tags]
    return "".join(f"[[tag]]\nnumber = {n}\nx_m = {x}\ny_m = {y}\n" for n, x, y in places)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the files of the camera and the floor, a film, and its first frames."""
    path = tmp_path_factory.mktemp("track")
    (path / "camera.toml").write_text(camera_toml(LENS))
    (path / "floor.toml").write_text(floor_toml(FLOOR))
    film = Scene(LENS, FLOOR + ROBOTS, RATE_HZ, exposure_s=0.003, line_delay_s=25e-6)
    film.write(str(path / "run.mp4"), FRAMES)
    film.write(str(path / "short.mp4"), 3)
    replace(film, tags=FLOOR).write(str(path / "empty.mp4"), 2)
    return path


def track(folder, *arguments, video="run.mp4"):
    height = [] if "--height" in arguments else ["--height", str(HEIGHT_M)]
    words = ["track", str(folder / video), *height, *map(str, arguments)]
    for option, name in (("--lens", "camera.toml"), ("--floor", "floor.toml")):
        words += [] if option in words else [option, str(folder / name)]
    return cli.run(words)


@pytest.fixture(scope="module")
def tracked(folder):
    """Output of the command for the film, and its rows by robot: t_s, pose, valid."""
    found = track(folder, "--robots", "1-3", "--out", folder / "poses.csv", "--json")
    with (folder / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    return found, {
        tag.number: np.array(
            [
                [float(r[c] or "nan") for c in ("t_s", "x_m", "y_m", "theta_rad", "valid")]
                for r in rows
                if int(r["robot_id"]) == tag.number
            ]
        )
        for tag in ROBOTS
    }


def errors(tag, rows):
    """(N, 3) m, m, rad of the valid rows, at the times that they say."""
    good = rows[rows[:, 4] == 1]
    miss = good[:, 1:4] - tag.path(good[:, 0])
    miss[:, 2] = np.angle(np.exp(1j * miss[:, 2]))
    return good[:, 0], miss


@pytest.mark.parametrize("tag", ROBOTS, ids=lambda tag: f"robot {tag.number}")
def test_poses_are_within_3_mm_and_1_degree(tracked, tag):
    _, miss = errors(tag, tracked[1][tag.number])
    assert len(miss) >= FRAMES - round(0.3 * RATE_HZ)
    assert np.sqrt(np.mean(np.sum(miss[:, :2] ** 2, axis=1))) < 3e-3
    assert np.degrees(np.sqrt(np.mean(miss[:, 2] ** 2))) < 1


def test_robots_that_move_opposite_to_their_headings_are_told_with_the_other_drawing(
    folder, tracked, tmp_path, capsys
):
    """The film shows tags as OpenCV draws them; read as AprilTag's they stand on their head."""
    found = track(folder, "--family", "tag36h11", "--out", tmp_path / "p.csv")
    told = [word for word in found["warnings"] if "opposite to its heading" in word]
    assert [word.split()[1] for word in told] == ["1", "2", "3"]
    assert all("track it with --family apriltag_36h11" in word for word in told)
    assert not any("opposite" in word for word in tracked[0]["warnings"])
    assert told[1] in " ".join(capsys.readouterr().out.split())
    family = re.search(r"--family (\S+);", told[0])[1]
    drawn = track(folder, "--family", family, "--out", tmp_path / "q.csv", video="short.mp4")
    turned = re.findall(r"--heading-offset-deg R\d\d=180", " ".join(told))
    assert len(turned) == 3
    for k, (poses, options) in enumerate((("p.csv", turned), ("q.csv", []))):
        out = tmp_path / f"{k}.lcmlog"
        words = [w for option in options for w in option.split()]
        cli.run(["import", "--poses", str(tmp_path / poses), *words, "--out", str(out)])
        log = read_log(out)
        for tag in ROBOTS:
            robot = log.robots[tag.number]
            t_s = log.t0_utime_us / 1e6 + robot.pose_t_s[robot.valid]
            off_rad = robot.pose[robot.valid, 2] - tag.path(t_s)[:, 2]
            assert np.degrees(np.abs(np.angle(np.exp(1j * off_rad))).mean()) < 1
    assert not any("opposite" in word for word in drawn["warnings"])


def test_tags_of_aruco_are_followed_too(tmp_path):
    def of_aruco(tag, number):
        return replace(tag, number=number, family=cv2.aruco.DICT_6X6_250)

    floor = [of_aruco(tag, tag.number - 400) for tag in FLOOR]
    robots = [of_aruco(tag, tag.number + 40) for tag in ROBOTS[:2]]
    (tmp_path / "camera.toml").write_text(camera_toml(LENS))
    (tmp_path / "floor.toml").write_text(floor_toml(floor))
    scene = Scene(LENS, floor + robots, RATE_HZ, exposure_s=0.003, line_delay_s=25e-6)
    scene.write(str(tmp_path / "run.mp4"), 4)
    track(tmp_path, "--family", "6x6_250", "--out", tmp_path / "p.csv")
    rows = np.genfromtxt(tmp_path / "p.csv", delimiter=",", names=True)
    for tag in robots:
        own = rows[rows["robot_id"] == tag.number]
        columns = ("t_s", "x_m", "y_m", "theta_rad", "valid")
        _, miss = errors(tag, np.column_stack([own[name] for name in columns]))
        assert len(miss) == 4 and np.abs(miss[:, :2]).max() < 3e-3
        assert np.degrees(np.abs(miss[:, 2]).max()) < 1.5
    with pytest.raises(ValueError, match="--family 6x6: is none of 4x4_100"):
        track(tmp_path, "--family", "6x6", "--out", tmp_path / "q.csv")


def test_stamps_are_the_middle_of_the_exposure_of_the_tags_rows(tracked):
    # A stamp late by t puts the robot ahead by t times its speed, all the way round.
    tag = ROBOTS[2]
    t_s, miss = errors(tag, tracked[1][3])
    speed = (tag.path(t_s + 1e-4) - tag.path(t_s - 1e-4))[:, :2] / 2e-4
    design = np.column_stack([speed.ravel(), np.tile([1, 0], len(t_s)), np.tile([0, 1], len(t_s))])
    late_s = np.linalg.lstsq(design, miss[:, :2].ravel(), rcond=None)[0][0]
    assert abs(late_s) < 0.3e-3


def test_a_robot_that_is_hidden_is_lost_and_keeps_its_name(tracked):
    rows = tracked[1][2]
    start_s = np.arange(FRAMES) / RATE_HZ
    hidden = (start_s >= HIDDEN_S[0]) & (start_s < HIDDEN_S[1])
    assert np.array_equal(rows[:, 4] == 0, hidden)
    told = {robot["robot_id"]: robot for robot in tracked[0]["robots"]}
    assert told[2]["lost_share"] == pytest.approx(hidden.mean())
    assert told[2]["longest_gap_s"] == pytest.approx((hidden.sum() + 1) / RATE_HZ, abs=2e-3)
    assert told[1]["lost_share"] == told[1]["longest_gap_s"] == 0


def test_camera_is_where_it_hangs(tracked):
    found = tracked[0]
    assert found["camera_height_m"] == pytest.approx(LENS.position_m[2], abs=5e-3)
    assert found["camera_tilt_rad"] == pytest.approx(LENS.tilt_rad, abs=2e-3)


def test_noise_that_is_told_is_that_of_the_errors(tracked):
    # Of the errors, what a slow wave of the true path's length does not follow.
    told = {robot["robot_id"]: robot for robot in tracked[0]["robots"]}[1]
    t_s, miss = errors(ROBOTS[0], tracked[1][1])
    rest = miss - np.column_stack(
        [np.polyval(np.polyfit(t_s, column, 3), t_s) for column in miss.T]
    )
    assert 0.4 < told["position_noise_m"] / rest[:, :2].std() < 2
    assert 0.4 < told["heading_noise_rad"] / rest[:, 2].std() < 2


def test_import_reads_what_was_written(folder, tracked):
    series = read_poses(folder / "poses.csv", Columns())
    assert [s.robot_id for s in series] == [1, 2, 3]
    assert [int(s.valid.sum()) for s in series] == [
        int(np.sum(tracked[1][n][:, 4])) for n in (1, 2, 3)
    ]
    assert all(np.allclose(s.position_m[s.valid, 2], HEIGHT_M) for s in series)


def test_same_film_same_bytes(folder, tmp_path):
    for name in ("a.csv", "b.csv"):
        track(folder, "--out", tmp_path / name, "--json", video="short.mp4")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def view_of(lens, line_delay_s=0.0):
    camera = Camera(lens.size_px, lens.matrix, np.array([*lens.distortion, 0.0]), 0.0, line_delay_s)
    return View(camera, lens.rotation, np.array(lens.position_m), 0.0)


def corners_of(tag, t_s):
    """(N, 4, 2) px of a tag's corners by the renderer's projection; t_s is (N,)."""
    half = tag.size_m / 2
    arms = np.array([[half, half], [half, -half], [-half, -half], [-half, half]])
    x, y, theta = (column[:, None] for column in tag.path(np.asarray(t_s)).T)
    c, s = np.cos(theta), np.sin(theta)
    px, py = x + c * arms[:, 0] - s * arms[:, 1], y + s * arms[:, 0] + c * arms[:, 1]
    solid = np.stack([px, py, np.full(px.shape, tag.height_m)], axis=-1)
    return LENS.project(solid.reshape(-1, 3)).reshape(-1, 4, 2)


def test_squares_without_noise_are_found_exactly():
    t_s = np.linspace(0, 5, 40)
    corners = corners_of(ROBOTS[0], t_s)
    squares = locate(view_of(LENS), corners, 0.10, HEIGHT_M)
    truth = ROBOTS[0].path(t_s)
    assert np.abs(squares.pose[:, :2] - truth[:, :2]).max() < 1e-6
    assert np.abs(np.angle(np.exp(1j * (squares.pose[:, 2] - truth[:, 2])))).max() < 1e-5
    assert squares.side_m == pytest.approx(0.10, rel=1e-5)
    seen_m = view_of(LENS).on_plane(centres(corners), HEIGHT_M)
    # Diagonals cross at the middle but for the lens's bend within a tag.
    assert np.abs(seen_m - truth[:, :2]).max() < 2e-4


def test_one_impossible_sighting_is_left_out_and_a_move_by_hand_is_not():
    t_s = np.arange(30) / 30
    corners = corners_of(ROBOTS[0], t_s)
    corners[10] += 300.0  # another thing that looks like it, once
    corners[20:] += [150.0, 40.0]  # the robot was carried
    seen = Sightings(np.arange(30), np.full(30, 1), corners)
    (path,) = follow(t_s, seen, view_of(LENS), Tags(0.10, HEIGHT_M))
    assert np.flatnonzero(~path.valid).tolist() == [10] and path.odd == 1


def test_of_two_tags_of_a_number_in_a_frame_the_squarer_counts():
    t_s = np.arange(10) / 30
    corners = corners_of(ROBOTS[0], t_s)
    bent = corners[4] + [[8, 0], [0, 0], [0, 0], [0, 0]]
    seen = Sightings(
        np.insert(np.arange(10), 4, 4), np.full(11, 1), np.insert(corners, 4, bent + 100, axis=0)
    )
    (path,) = follow(t_s, seen, view_of(LENS), Tags(0.10, HEIGHT_M))
    assert np.abs(path.pose[:, :2] - ROBOTS[0].path(t_s)[:, :2]).max() < 1e-6


@pytest.mark.parametrize(
    ("points", "y_m", "words"),
    [
        (
            6,
            0.5,
            r"miss the picture by .* px \(.* mm\); without tag 502 the rest miss by 0\.0 px: "
            r"measure anew where it is, or take it out of the floor file\.",
        ),
        (6, 0.9, r"without tag 502 .* edge of the picture, where the lens may be wrong"),
        (
            4,
            0.5,
            r"check the places of tag 500, tag 501, tag 502, tag 503.* a fifth point would show",
        ),
    ],
)
def test_a_floor_tag_that_was_measured_10_cm_wrong_is_refused(points, y_m, words):
    """Near the edge of the picture the lens may be wrong instead: boards are seldom shown there."""
    places = [(-1.3, -1.1), (1.4, -1.0), (1.3, y_m), (-1.2, 0.85), (0.1, -1.2), (-0.2, 1.0)]
    tags = [Tag(500 + k, still(*xy, 0.3), 0.12, 0.0) for k, xy in enumerate(places[:points])]
    corners = np.concatenate([corners_of(tag, np.zeros(1)) for tag in tags])
    seen = Sightings(np.zeros(points, int), 500 + np.arange(points), corners)
    measured = np.array(places[:points])
    floor = Floor(measured, np.full((points, 2), np.nan), seen.number)
    camera = view_of(LENS).camera
    assert look(camera, floor, seen).error_px < 0.5
    measured[2, 0] += 0.1
    with pytest.raises(ValueError, match=words):
        look(camera, floor, seen)


@pytest.mark.parametrize(
    ("height_m", "bend", "warns"), [(HEIGHT_M, 1, False), (0.17, 1, True), (HEIGHT_M, 0, True)]
)
def test_a_wrong_height_or_lens_bends_corners_and_is_warned_of(height_m, bend, warns):
    """Tags of 20 cm, all over the picture; a lens file without the bend that the lens has."""
    t_s = np.arange(20) / 30
    tag = Tag(1, circle(0.1, 0.0, 1.0, 9.0, 0.0), 0.2)
    true = view_of(LENS)
    camera = replace(true.camera, distortion=bend * true.camera.distortion)
    view = replace(true, camera=camera)
    seen = Sightings(np.arange(20), np.full(20, 1), corners_of(tag, t_s))
    tags = Tags(0.2, height_m)
    quality = judge(follow(t_s, seen, view, tags), view, tags)
    assert [w.startswith("the tags' corners miss by") for w in quality.warnings] == [True] * warns


@pytest.mark.parametrize("place_m", [(0.1, -0.3), (1.6, 0.7)], ids=["below the camera", "far"])
def test_noise_over_the_floor_is_that_of_tags_put_there(place_m):
    """Corners off by 0.3 px at random; the tag stands, so that all that moves is noise."""
    t_s, tag = np.arange(600) / 30, Tag(1, still(*place_m, 0.7), 0.1)
    corners = corners_of(tag, t_s) + np.random.default_rng(3).normal(0, 0.3, (600, 4, 2))
    seen, tags = Sightings(np.arange(600), np.full(600, 1), corners), Tags(0.1, HEIGHT_M)
    (path,) = follow(t_s, seen, view_of(LENS), tags)
    quality = judge([path], view_of(LENS), tags)
    place_m, heading_rad = path.pose[:, :2].std(axis=0), path.pose[:, 2].std()
    (near_m, far_m), (near_rad, far_rad) = (
        quality.position_over_floor_m, quality.heading_over_floor_rad,
    )  # fmt: skip
    assert 0.9 * near_m < np.sqrt(np.mean(place_m**2)) < 1.1 * far_m < 2.2 * near_m
    assert 0.9 * near_rad < heading_rad < 1.1 * far_rad < 2.2 * near_rad
    best = quality.robots[0].corner_position_m
    assert best == pytest.approx(np.sqrt(np.mean(place_m**2)), rel=0.15)


def test_two_robots_of_one_number_are_refused():
    t_s = np.arange(10) / 30
    corners = np.concatenate([corners_of(ROBOTS[0], t_s), corners_of(ROBOTS[2], t_s[6:])])
    seen = Sightings(np.append(np.arange(10), np.arange(6, 10)), np.full(14, 1), corners)
    with pytest.raises(ValueError, match=r"number 1 was seen twice in one picture \(frame 6\)"):
        follow(t_s, seen, view_of(LENS), Tags(0.10, HEIGHT_M))


def test_live_two_robots_of_one_number_are_refused():
    twins = [ROBOTS[0], replace(ROBOTS[2], number=1)]
    frames = iter([(1000.0, Scene(LENS, twins).frame(0))])
    with pytest.raises(ValueError, match="number 1 was seen twice"):
        list(publish([frames], [view_of(LENS)], Tags(0.10, HEIGHT_M), lambda *message: None))


def test_shear_of_a_rolling_shutter_is_taken_out():
    delay_s, tag, frame_s = 30e-6, ROBOTS[2], np.arange(40) / 30
    corners = corners_of(tag, frame_s)
    for _ in range(6):  # each corner is seen when its row is read
        times_s = frame_s[:, None] + delay_s * corners[..., 1]
        corners = np.stack([corners_of(tag, times_s[:, k])[:, k] for k in range(4)], axis=1)
    seen = Sightings(np.arange(40), np.full(40, 3), corners)

    def worst_rad(line_delay_s):
        view = view_of(LENS, line_delay_s)
        (path,) = follow(frame_s, seen, view, Tags(0.10, HEIGHT_M))
        miss = path.pose - tag.path(path.t_s if line_delay_s else path.t_s + delay_s * 540)
        return np.abs(np.angle(np.exp(1j * miss[2:-2, 2]))).max()

    assert worst_rad(delay_s) < 0.1 * worst_rad(0.0)


def test_live_poses_are_published_as_motion_capture_does():
    film = Scene(LENS, FLOOR + ROBOTS[:2], RATE_HZ, exposure_s=0.003)
    first, said = 13, []
    frames = ((1000 + k / RATE_HZ, film.frame(k)) for k in range(first, first + 5))
    view = replace(view_of(LENS), camera=replace(view_of(LENS).camera, exposure_s=0.003))
    tags = Tags(0.10, HEIGHT_M, frozenset({1, 2}))
    counts = list(publish([frames], [view], tags, lambda *message: said.append(message)))
    poses = [(channel, turbopi.pose_t.decode(data)) for channel, data in said]
    of = {n: [p for channel, p in poses if channel == f"R{n:02d}_POSE"] for n in (1, 2)}
    assert [p.valid for p in of[1]] == [1] * 5 and counts[-1].poses[1] == 5
    assert [p.valid for p in of[2]] == [1, 1, 0, 0, 0]
    for k, pose in enumerate(of[1]):
        t_s = (first + k) / RATE_HZ + 0.0015
        assert (pose.robot_id, pose.seq) == (1, k)
        assert pose.utime_us == pytest.approx(1e6 * (1000 + t_s), abs=1)
        assert pose.position_m[:2] == pytest.approx(
            ROBOTS[0].path(np.array([t_s]))[0, :2], abs=3e-3
        )


def test_a_camera_is_tracked_until_it_ends(folder, capsys):
    words = ["--lens", "camera.toml", "--floor", "floor.toml", "--height", str(HEIGHT_M)]
    files = [str(folder / w) if w.endswith(".toml") else w for w in words]
    found = cli.run(["track", "--camera", str(folder / "run.mp4"), "--lcm-url", "memq://", *files,
                     "--json"])  # fmt: skip
    assert found["frames"] == FRAMES - 30  # the first 30 find the floor
    assert found["poses"] == {robot: FRAMES - 30 for robot in (1, 2, 3)}


def test_frames_that_were_dropped_leave_the_others_their_stamps(folder, tmp_path):
    dropped = (5, 6, 20)
    chosen = "*".join(f"not(eq(n,{k}))" for k in dropped)
    subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-i", folder / "run.mp4", "-vf", f"select='{chosen}'",
         "-vsync", "vfr", "-c:v", "mpeg4", tmp_path / "gaps.mp4"], check=True,
    )  # fmt: skip
    stamps = [stamp_s for stamp_s, _ in Film(tmp_path / "gaps.mp4").frames()]
    kept = [k for k in range(FRAMES) if k not in dropped]
    assert stamps == pytest.approx(np.array(kept) / RATE_HZ, abs=1e-4)


@pytest.mark.parametrize("kind", ["charuco", "checkerboard"])
def test_lens_is_found_from_a_film_of_a_board(tmp_path, kind):
    lens = Lens((640, 360), (467.0, 468.0), (317.0, 182.0), (-0.12, 0.03, 0.0005, -0.0003))
    charuco, square_px = Board(), 80
    drawn = charuco.drawn(square_px)
    if kind == "checkerboard":
        drawn = np.kron(np.indices((5, 8)).sum(axis=0) % 2 * 255, np.ones((square_px, square_px)))
        drawn = np.pad(drawn, square_px, constant_values=255)
    writer = cv2.VideoWriter(
        str(tmp_path / "board.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 5, lens.size_px
    )
    for seed in range(18):
        writer.write(board_view(lens, drawn, square_px, 0.036, seed))
    writer.release()
    words = ["track-calibrate", str(tmp_path / "board.avi"), "--out", str(tmp_path / "c.toml")]
    squares = [] if kind == "charuco" else ["--board", kind, "--squares", "8x5"]
    found = cli.run([*words, *squares, "--json", "--line-delay-us", "20"])
    assert found["views"] >= 8 and found["error_px"] < 0.5
    camera = read_camera(tmp_path / "c.toml")
    assert camera.line_delay_s == pytest.approx(20e-6)
    # Rays over the part of the picture that boards were in, but for the camera's own small turn,
    # which the floor's points find.
    v, u = np.mgrid[40:330:30, 60:590:30].astype(float)
    truth = lens.rays(u, v).reshape(-1, 3) @ lens.rotation.T
    got = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    slope = got[:, :2] - truth[:, :2]
    assert np.sqrt(np.mean((slope - slope.mean(axis=0)) ** 2)) * 467 < 0.5  # px


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--size", "0.2"], "tags look 0.10. m wide"),
        (["--robots", "1,9"], "tag 9 was in none of 3 frames, those of 1, 2, 3 were"),
        (["--robots", "1-"], "numbers and ranges"),
        (["--robots", "100"], "not in 0..99"),
        (["--camera", "0"], "one of them"),
        (["--rate-hz", "0"], "above 0"),
        (["--height", "7"], "--height"),
        (["--commands", "none.csv", "--start-s", "3"], "no --start-s"),
        (["--commands", "none.csv"], "none.csv"),
        (["--out", "run.mp4"], "exists"),
        (["--floor", "none.toml"], "no floor file"),
        (["--lens", "floor.toml"], "twinmill track calibrate"),
    ],
)
def test_mistakes_on_the_command_line_get_one_sentence(folder, monkeypatch, arguments, words):
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    with pytest.raises(ValueError, match=words):
        track(folder, *arguments, video="short.mp4")
    assert sorted(folder.iterdir()) == before


def test_commands_of_the_only_robot_need_no_number(folder, tmp_path):
    """As a publisher writes them; three frames are too few to place them, and that comes then."""
    sent = tmp_path / "sent.csv"
    sent.write_text("t_s,vx_mps,vy_mps,omega_radps\n0,0.1,0,0\n1,0,0,0\n")
    with pytest.raises(ValueError, match="robot_id is missing"):
        track(folder, "--robots", "1-3", "--commands", sent, video="short.mp4")
    with pytest.raises(ValueError, match="where the film begins"):
        track(folder, "--robots", "1", "--commands", sent, video="short.mp4")


def test_a_film_that_is_none_or_shows_no_robot_is_said(folder, tmp_path):
    (tmp_path / "text.mp4").write_text("no film")
    with pytest.raises(ValueError, match="no video"):
        track(folder, video=tmp_path / "text.mp4")
    with pytest.raises(ValueError, match="no such file"):
        track(folder, video="absent.mp4")
    with pytest.raises(ValueError, match="no robot's tag was found in 2 frames"):
        track(folder, "--out", tmp_path / "o.csv", video="empty.mp4")
    assert not (tmp_path / "o.csv").exists()


def test_a_film_that_breaks_off_is_read_so_far_and_that_is_said(folder, tmp_path, capsys):
    Scene(LENS, FLOOR + ROBOTS).write(str(tmp_path / "whole.avi"), 6, "MJPG")
    data = (tmp_path / "whole.avi").read_bytes()
    (tmp_path / "cut.avi").write_bytes(data[: len(data) * 6 // 10])
    found = track(folder, "--out", tmp_path / "o.csv", video=tmp_path / "cut.avi")
    assert 2 <= found["frames"] < 6 == found["frames_in_file"]
    (camera,) = found["cameras"]
    assert camera["missing_s"] == pytest.approx((6 - found["frames"]) / RATE_HZ)
    words = f"The film breaks off: the last {camera['missing_s']:.2f} of its 0.20 s"
    assert words in capsys.readouterr().out


def points(rows):
    return "".join(f"[[point]]\nu_px={u}\nv_px={v}\nx_m={x}\ny_m={y}\n" for u, v, x, y in rows)


SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SEEN = LENS.project(np.column_stack([SQUARE, np.zeros(4)]))


def test_points_measured_by_tape_do_as_well_as_tags(folder, tmp_path):
    (tmp_path / "tape.toml").write_text(points(np.hstack([SEEN, SQUARE])))
    found = track(folder, "--floor", tmp_path / "tape.toml", "--out", tmp_path / "o.csv", "--json",
                  video="short.mp4")  # fmt: skip
    assert found["camera_height_m"] == pytest.approx(LENS.position_m[2], abs=1e-3)
    assert found["floor_error_px"] < 1e-2


@pytest.mark.parametrize("moved_px", [0.0, 0.01])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (2, 0, 3, 1), (0, 1, 2, 3, 4)])
@pytest.mark.parametrize("turn_rad", [0.0, 0.3, np.pi / 2])
def test_a_camera_that_looks_exactly_straight_down_is_found(moved_px, order, turn_rad):
    """A pinhole 2.5 m over the floor: u = 640 + 900 x / 2.5, v = 360 - 900 y / 2.5."""
    lens = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]])
    camera = Camera((1280, 720), lens, np.zeros(5))
    place_m = np.array([[-1, -0.7], [1, -0.7], [1, 0.7], [-1, 0.7], [0, 0]])[list(order)]
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    pixel = [640, 360] + 360 * (place_m @ [[c, s], [-s, c]]) * [1, -1]
    pixel[0, 0] += moved_px
    tag = np.full(len(order), -1)
    nothing = Sightings(*np.empty((2, 0), int), np.empty((0, 4, 2)))
    view = look(camera, Floor(place_m, pixel, tag), nothing)
    np.testing.assert_allclose(view.position_m, [0, 0, 2.5], atol=1e-6 + 0.1 * moved_px)
    assert view.error_px < 1e-3 + moved_px
    with pytest.raises(ValueError, match="mirrored"):
        look(camera, Floor(place_m * [1, -1], pixel, tag), nothing)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (points(np.hstack([SEEN, SQUARE])[:3]), "has 3 floor points, and 4"),
        (points(np.hstack([SEEN, SQUARE * [1, 0]])), "all on one line"),
        (points(np.hstack([SEEN, SQUARE * [-1, 1]])), "mirrored"),
        (points(np.hstack([SEEN, SQUARE[[0, 2, 1, 3]]])), "miss the picture by"),
        ("[[point]]\nu_px=1\nx_m=2\ny_m=3\n", "'v_px' is missing"),
        ("[[tag]]\nnumber=3\nx_m=2\ny_m=3\n", "tag 3 is no floor tag"),
        (floor_toml(FLOOR) + floor_toml(FLOOR[:1]), "listed twice"),
        (floor_toml(FLOOR).replace("500", "555"), "tags 555 are nowhere in the film"),
        ("[[tag]\n", "no floor file"),
    ],
)
def test_floor_files_that_fix_no_plane_are_refused(folder, tmp_path, text, words):
    (tmp_path / "floor.toml").write_text(text)
    with pytest.raises(ValueError, match=words):
        track(folder, "--floor", tmp_path / "floor.toml", "--out", tmp_path / "o.csv",
              video="short.mp4")  # fmt: skip


def test_lens_of_another_resolution_is_refused(folder, tmp_path):
    (tmp_path / "c.toml").write_text(camera_toml(replace(LENS, size_px=(1280, 720))))
    with pytest.raises(ValueError, match="1920x1080, but the lens was calibrated at 1280x720"):
        track(folder, "--lens", tmp_path / "c.toml", "--out", tmp_path / "o.csv", video="short.mp4")


def test_the_report_can_be_read_by_programs(folder, tmp_path, capsys):
    track(folder, "--out", tmp_path / "o.csv", "--json", video="short.mp4")
    told = json.loads(capsys.readouterr().out)
    assert told["frames"] == 3 and "meaning" in told and told["robots"][0]["robot_id"] == 1
    assert told["robots"][0]["position_noise_m"] is None  # three frames tell of none
