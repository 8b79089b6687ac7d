# SPDX-License-Identifier: Apache-2.0
"""Films as ffmpeg writes them: what is said to break off does, and what is whole is not."""

import subprocess

import numpy as np
import pytest

from twinmill.track.film import Film

SIZE_PX = (160, 120)
EVEN_S = np.arange(60) / 30
SLOWED_S = np.append(np.arange(30) / 30, 1 + np.arange(30) / 15)  # a webcam, as it gets dark
CODECS = {"mkv": "mpeg4", "mp4": "mpeg4", "mov": "mpeg4", "avi": "mpeg4", "ts": "mpeg4"}


@pytest.fixture
def film(tmp_path):
    """A film of 30 frames at 30 Hz and 30 more at that rate or half of it."""

    def make(container, stamps_s=EVEN_S, *options):
        path = tmp_path / f"film.{container}"
        second_hz = round(1 / (stamps_s[-1] - stamps_s[-2]))
        stamp = f"round(if(lt(N,30),N/30,1+(N-30)/{second_hz})/TB)"
        pictures = f"testsrc=size={SIZE_PX[0]}x{SIZE_PX[1]}:rate=30,setpts='{stamp}'"
        subprocess.run(
            ["ffmpeg", "-loglevel", "error", "-f", "lavfi", "-i", pictures, "-frames:v", "60",
             "-vsync", "vfr", "-c:v", CODECS[container], "-g", "10", *options, path],
            check=True,
        )  # fmt: skip
        return path

    return make


def read(path, rate_hz=None):
    opened = Film(path, rate_hz)
    return opened, [(stamp_s, picture.shape[1::-1]) for stamp_s, picture in opened.frames()]


@pytest.mark.parametrize("container", CODECS)
@pytest.mark.parametrize("stamps_s", [EVEN_S, SLOWED_S], ids=["even", "slowed"])
def test_a_whole_film_lasts_as_long_as_its_container_says(film, container, stamps_s):
    """The rate may change, too: OpenCV counts 90 frames for the 60 in Matroska and AVI."""
    opened, frames = read(film(container, stamps_s))
    assert [stamp_s for stamp_s, _ in frames] == pytest.approx(stamps_s, abs=1e-3)
    assert opened.duration_s == pytest.approx(stamps_s[-1] + 1 / 30, abs=0.05)
    assert opened.missing_s < 1e-6


@pytest.mark.parametrize("container", ["mkv", "avi"])
@pytest.mark.parametrize("rate_hz", [None, 30.0])
def test_a_film_that_was_cut_lacks_what_was_after_the_cut(film, container, rate_hz):
    path = film(container, SLOWED_S)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    opened, frames = read(path, rate_hz)
    assert 10 < len(frames) < 50
    assert opened.missing_s == pytest.approx(SLOWED_S[-1] - SLOWED_S[len(frames) - 1], abs=0.05)


def test_a_container_that_tells_no_duration_is_not_said_to_break_off(film):
    opened, frames = read(film("mkv", EVEN_S, "-f", "matroska", "-live", "1"))
    assert (opened.count, opened.duration_s, opened.missing_s) == (0, 0, 0)
    assert len(frames) == 60


@pytest.mark.parametrize("turned_deg", [90, 180, 270])
def test_a_film_of_a_phone_that_was_held_otherwise_is_turned_and_that_is_known(
    film, tmp_path, turned_deg
):
    path = tmp_path / "turned.mp4"
    subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-i", film("mp4"), "-c", "copy",
         "-metadata:s:v", f"rotate={turned_deg}", path], check=True,
    )  # fmt: skip
    opened, frames = read(path)
    size_px = SIZE_PX if turned_deg == 180 else SIZE_PX[::-1]
    assert opened.turned_deg in (turned_deg, 360 - turned_deg)
    assert opened.size_px == size_px and {size for _, size in frames} == {size_px}
    assert len(frames) == 60 and opened.missing_s < 1e-6
