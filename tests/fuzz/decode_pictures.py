# SPDX-License-Identifier: Apache-2.0
"""Reads pictures by Pillow and by OpenCV, each with a JPEG decoder of its own. Usage: FILE..."""

import sys
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

for path in map(Path, sys.argv[1:]):
    with suppress(OSError, SyntaxError, ValueError), Image.open(path) as picture:
        picture.load()
    data = np.frombuffer(path.read_bytes(), np.uint8)
    if len(data):
        cv2.imdecode(data, cv2.IMREAD_COLOR)
