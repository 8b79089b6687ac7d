# SPDX-License-Identifier: Apache-2.0
"""Films of a ceiling camera: three containers, an even rate and one that slows, turned pictures."""

import subprocess
from fractions import Fraction
from pathlib import Path

from interop.cells import Told, reads

SIZE_PX = (160, 120)
COUNT, RATE_HZ = 60, 30
CONTAINERS = ("mkv", "mp4", "avi")
RATES_HZ = {"even": 30, "slowed": 15}  # of the second half: a webcam, as it gets dark
TURNED = "turned"
LONG_ENOUGH = 0.02  # of the duration may be missing


def _stamp(k: int, second_hz: int) -> Fraction:
    """When frame k was taken, s."""
    half = COUNT // 2
    return Fraction(k, RATE_HZ) if k < half else 1 + Fraction(k - half, second_hz)


def _read(folder: Path) -> Told:
    from twinmill.track.film import Film

    told = {}
    for path in sorted(folder.glob("*_.*")):
        rate, container = path.stem[:-1], path.suffix[1:].upper()
        film = Film(path)
        if rate == TURNED:
            told[f"{container}, turned by a quarter"] = film.size_px == SIZE_PX[::-1]
            continue
        stamps_s = [at_s for at_s, _ in film.frames()]
        right = [float(_stamp(k, RATES_HZ[rate])) for k in range(COUNT)]
        told[f"{container}, {rate}: stamps"] = len(stamps_s) == COUNT and all(
            abs(a - b) < 1e-3 for a, b in zip(stamps_s, right, strict=True)
        )
        told[f"{container}, {rate}: whole"] = film.missing_s < LONG_ENOUGH * film.duration_s
    return told


@reads("film", "ffmpeg", "ffmpeg", ours=_read)
def ffmpeg(folder: Path) -> None:
    """Debian's program, which can say of MP4 alone that it is to be turned."""
    _write("ffmpeg", folder)
    turned = ["-c", "copy", "-metadata:s:v", "rotate=90"]
    _run("ffmpeg", "-i", folder / "even_.mp4", *turned, folder / f"{TURNED}_.mp4")


@reads("film", "FFmpeg 9 (imageio-ffmpeg)", "imageio-ffmpeg==0.8.1", ours=_read)
def ffmpeg_9(folder: Path) -> None:
    """The newest, as it comes with a wheel."""
    import imageio_ffmpeg

    program = imageio_ffmpeg.get_ffmpeg_exe()
    _write(program, folder)
    for container in CONTAINERS:
        given = ["-display_rotation", "90", "-i", folder / "even_.mp4", "-c", "copy"]
        _run(program, *given, folder / f"{TURNED}_.{container}")


def _write(program: str, folder: Path) -> None:
    """Each rate in each container."""
    for rate, second_hz in RATES_HZ.items():
        half = COUNT // 2
        stamp = f"round(if(lt(N,{half}),N/{RATE_HZ},1+(N-{half})/{second_hz})/TB)"
        pictures = f"testsrc=size={SIZE_PX[0]}x{SIZE_PX[1]}:rate={RATE_HZ},setpts='{stamp}'"
        for container in CONTAINERS:
            given = ["-f", "lavfi", "-i", pictures, "-frames:v", str(COUNT), "-fps_mode", "vfr"]
            _run(program, *given, "-c:v", "mpeg4", folder / f"{rate}_.{container}")


def _run(program: str, *arguments: str | Path) -> None:
    subprocess.run([program, "-loglevel", "error", *arguments], check=True)


@reads("film", "PyAV", "av==18.1.0", "numpy==2.4.6", ours=_read)
def pyav(folder: Path) -> None:
    """A newer FFmpeg, by its libraries."""
    import av
    import numpy as np

    for rate, second_hz in RATES_HZ.items():
        for container in CONTAINERS:
            with av.open(str(folder / f"{rate}_.{container}"), "w") as film:
                stream = film.add_stream("mpeg4", rate=RATE_HZ)
                stream.width, stream.height = SIZE_PX
                stream.codec_context.time_base = Fraction(1, RATE_HZ)
                for k in range(COUNT):
                    grey = np.full((SIZE_PX[1], SIZE_PX[0], 3), 4 * k, np.uint8)
                    frame = av.VideoFrame.from_ndarray(grey, format="rgb24")
                    frame.pts, frame.time_base = (
                        int(_stamp(k, second_hz) * RATE_HZ),
                        Fraction(1, 30),
                    )
                    film.mux(stream.encode(frame))
                film.mux(stream.encode())
