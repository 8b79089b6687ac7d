# SPDX-License-Identifier: Apache-2.0
"""twin/view: pictures, videos and the window, as a user of twin_run gets them."""

import cmath
import itertools
import json
import os
import shutil
import signal
import subprocess
import time

import lcm
import numpy as np
import pytest
import turbopi
from PIL import Image
from scipy.ndimage import label

TWIN_RUN = os.environ.get("TWIN_RUN", "")
pytestmark = pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the program")
NO_DISPLAY = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}


def run(*arguments):
    command = [TWIN_RUN, "--plant", "planar", *map(str, arguments)]
    return subprocess.run(command, env=NO_DISPLAY, capture_output=True, text=True, timeout=120)


def wait_until(condition, timeout_s=30.0):
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, "it did not come"
        time.sleep(0.1)


def last_blob_px(log):
    events = lcm.EventLog(str(log), "r")
    messages = [turbopi.telemetry_t.decode(e.data) for e in events if "R00_TELEM" in e.channel]
    return messages[-1].blob_px


def balls_px(picture):
    """Sizes of the green balls in a picture outside its corner; a view that sees is paler."""
    image = np.asarray(Image.open(picture)).astype(int)
    image[468:, 948:] = 0
    red, green, blue = np.moveaxis(image, 2, 0)
    found, _ = label((green > 2 * red) & (green > 2 * blue))
    return np.bincount(found.ravel())[1:]


def test_robots_that_drive_apart_stay_in_view(tmp_path):
    picture = tmp_path / "a.png"
    for seed in (1, 2, 3):
        run(
            *("--n", 8, "--behavior", "diffusing", "--duration-s", 30, "--seed", seed),
            *("--log", tmp_path / "a.lcmlog", "--picture", picture, "--force"),
        )
        assert len(balls_px(picture)) == 8, seed


def seeds_with_a_neighbour_ahead(tmp_path, words):
    """Seeds that put robot 1 before robot 0, somewhat to the right: the corner's words are left."""
    for seed in range(200):
        log = tmp_path / f"start{seed}.lcmlog"
        assert run(*words, "--duration-s", 0.02, "--seed", seed, "--log", log).returncode == 0
        events = lcm.EventLog(str(log), "r")
        first = {e.channel: e.data for e in reversed([e for e in events if "POSE" in e.channel])}
        eye, other = (turbopi.pose_t.decode(first[f"R{i:02d}_POSE"]) for i in (0, 1))
        away = complex(*other.position_m[:2]) - complex(*eye.position_m[:2])
        half_turn = complex(eye.orientation_wxyz[0], eye.orientation_wxyz[3])
        bearing_rad = cmath.phase(away / half_turn**2)
        if 0.3 < abs(away) < 0.7 and -0.3 < bearing_rad < -0.1:
            yield seed


def test_the_robot_whose_camera_is_in_the_corner_stands_on_a_white_disc(tmp_path):
    words = ("--n", 3, "--duration-s", 0.02, "--log", tmp_path / "a.lcmlog")
    run(*words, "--picture", tmp_path / "a.png")
    image = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    image[468:, 948:] = 0
    white, _ = label(image.min(axis=2) > 200)
    sizes_px = np.bincount(white.ravel())[1:]
    assert np.count_nonzero(sizes_px > 500) == 1


def test_picture_shows_the_frame_that_the_firmware_was_given(tmp_path):
    words = ("--n", 2, "--spread-m", 0.6)
    for seed in itertools.islice(seeds_with_a_neighbour_ahead(tmp_path, words), 2):
        log, picture = tmp_path / f"{seed}.lcmlog", tmp_path / f"{seed}.png"
        done = run(
            *(*words, "--sensor", "camera", "--duration-s", 0.1, "--seed", seed),
            *("--log", log, "--picture", picture),
        )
        assert done.returncode == 0, done.stderr
        image = np.asarray(Image.open(picture)).astype(int)
        assert image.shape == (720, 1280, 3)
        # The corner is half as wide and high as the frame: a quarter of its pixels.
        red, green, blue = np.moveaxis(image[468:708, 948:1268], 2, 0)
        corner_px = np.sum((green > 1.5 * red) & (green > 1.5 * blue))
        blob_px = last_blob_px(log)
        assert blob_px > 1000
        assert 4 * corner_px == pytest.approx(blob_px, rel=0.15)


def test_video_has_thirty_frames_a_second(tmp_path):
    video = tmp_path / "a.mp4"
    done = run("--n", 2, "--duration-s", 1, "--log", tmp_path / "a.lcmlog", "--video", video)
    assert done.returncode == 0, done.stderr
    show = "stream=nb_frames,width,height,r_frame_rate"
    probe = ["ffprobe", "-v", "error", "-of", "json", "-show_entries", show, video]
    stream = json.loads(subprocess.check_output(probe))["streams"][0]
    assert (stream["width"], stream["height"]) == (1280, 720)
    assert stream["r_frame_rate"] == "30/1"
    assert 29 <= int(stream["nb_frames"]) <= 31
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.lcmlog", "a.mp4"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--picture", "/nonexistent/a.png"], "cannot be written"),
        (["--video", "/dev/null"], "no ordinary file"),
        (["--view"], "needs a display"),
    ],
)
def test_mistakes_end_in_one_sentence(tmp_path, arguments, words):
    done = run("--n", 1, "--duration-s", 0.1, "--log", tmp_path / "a.lcmlog", *arguments)
    assert done.returncode == 1
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


class Screen:
    """A display without a monitor, and the window of twin_run on it."""

    def __init__(self, *arguments):
        read, write = os.pipe()
        self.server = subprocess.Popen(
            # Without -noreset it starts anew, and refuses all, whenever its last client leaves.
            ["Xvfb", "-noreset", "-displayfd", str(write), "-screen", "0", "1280x900x24"],
            pass_fds=[write],
            stderr=subprocess.DEVNULL,
        )
        os.close(write)
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()
        self.env = {**NO_DISPLAY, "DISPLAY": f":{number}"}
        wait_until(self.answers)
        self.run = subprocess.Popen(
            [TWIN_RUN, "--plant", "planar", "--view", "--json", *map(str, arguments)],
            env=self.env,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self):
        try:
            wait_until(self.window)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in (self.run, self.server):
            if process.poll() is None:
                process.send_signal(signal.SIGKILL)
            process.wait()

    def answers(self):
        size = ["xdotool", "getdisplaygeometry"]
        return subprocess.run(size, env=self.env, capture_output=True).returncode == 0

    def window(self):
        search = ["xdotool", "search", "--name", "^twin_run$"]
        return subprocess.run(search, env=self.env, capture_output=True, text=True).stdout.strip()

    def press(self, key):
        subprocess.run(["xdotool", "key", "--window", self.window(), key], env=self.env, check=True)

    def zoom_in(self, notches):
        click = ["click", "--repeat", str(notches), "5"]
        command = ["xdotool", "mousemove", "--window", self.window(), "300", "300", *click]
        subprocess.run(command, env=self.env, check=True)

    def result(self):
        return json.loads(self.run.communicate(timeout=60)[0])


needs_display = pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")), reason="Xvfb or xdotool is not there"
)


@needs_display
def test_space_pauses_and_goes_on(tmp_path):
    log = ("--duration-s", 4, "--realtime-factor", 1, "--log", tmp_path / "a.lcmlog")
    with Screen("--n", 1, *log) as screen:
        screen.press("space")
        time.sleep(8)
        assert screen.run.poll() is None, "the run ended in spite of the pause"
        screen.press("space")
        result = screen.result()
    assert result["simulated_s"] == pytest.approx(4, abs=0.02)
    assert not result["interrupted"]


@needs_display
@pytest.mark.parametrize("zooms", [False, True])
def test_window_follows_until_the_person_moves_the_camera(tmp_path, zooms):
    picture = tmp_path / "a.png"
    run_s = ("--behavior", "diffusing", "--duration-s", 30, "--realtime-factor", 5)
    with Screen("--n", 6, *run_s, "--log", tmp_path / "a.lcmlog", "--picture", picture) as screen:
        if zooms:
            screen.zoom_in(20)
        screen.result()
    seen = balls_px(picture)
    assert len(seen) < 6 if zooms else len(seen) == 6


@needs_display
def test_escape_ends_the_run_and_keeps_its_log(tmp_path):
    log = tmp_path / "a.lcmlog"
    with Screen("--n", 1, "--realtime-factor", 1, "--log", log) as screen:
        screen.press("Right")  # pauses, and steps
        screen.press("Escape")
        result = screen.result()
    assert result["interrupted"]
    assert log.exists()
