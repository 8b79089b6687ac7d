#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# OpenCV 5.0.0.93: in a film whose rate changes a seek goes to another frame, and says the one asked for.
#
# Guess: CAP_PROP_POS_FRAMES = 60 is followed by frame 60 in MP4, whose header counts frames, and
#   CAP_PROP_POS_MSEC = 3000 by the frame of that time.
# Seen, of 50 frames at 30 Hz and 50 at 15 Hz (a webcam as it gets dark): MP4 gives frame 76, at 3.40 s, for
#   either, and POS_FRAMES says 61 after it; a seek by time goes by number and mean rate. Matroska: frame 60
#   is right, 90 is frame 80, and 3000 ms are 3667. Only reading all frames in turn is right.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet opencv-python-headless==5.0.0.93
cd "$work"
stamp="round(if(lt(N,50),N/30,50/30+(N-50)/15)/TB)"
for end in mp4 mkv; do
    ffmpeg -loglevel error -f lavfi -i "testsrc=size=320x240:rate=30,setpts='$stamp'" -frames:v 100 \
        -vsync vfr -c:v mpeg4 "film.$end"
done
"$work/venv/bin/python" - <<'PY'
import cv2
import numpy as np


def frames(name):
    film = cv2.VideoCapture(name)
    while (read := film.read())[0]:
        yield film.get(cv2.CAP_PROP_POS_MSEC), read[1].astype(int)


def sought(name, unit, place):
    """Number of the frame after a seek, its stamp in ms, and the number that is said to be next."""
    stamps, pictures = zip(*frames(name))
    film = cv2.VideoCapture(name)
    film.set(unit, place)
    picture = film.read()[1]
    k = int(np.argmin([np.abs(picture - other).mean() for other in pictures]))
    return k, round(stamps[k]), int(film.get(cv2.CAP_PROP_POS_FRAMES))


by_number, by_time = cv2.CAP_PROP_POS_FRAMES, cv2.CAP_PROP_POS_MSEC
seen = {end: [sought(f"film.{end}", *asked)[:3] for asked in
              ((by_number, 60), (by_number, 90), (by_time, 3000))] for end in ("mp4", "mkv")}
print(seen)
assert seen["mp4"][0] == (76, 3400, 61) and seen["mp4"][2][:2] == (76, 3400)
assert seen["mkv"][0][0] == 60 and seen["mkv"][1][0] == 80 and seen["mkv"][2][1] == 3667
PY
