#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# lcm-gen 1.3.1 (Debian 12): a list of booleans in a message can be read once; then it is empty.
#
# Guess: a field `boolean seen[3]` of a message that was decoded is a list or a tuple of bool, as one of int8_t
#   is a tuple of numbers.
# Seen: it is an iterator that is used up by whoever looks first: of three robots, two of them seen, any() says
#   True and sum() after it 1, a second sum() 0; a print of the list leaves none for the filter behind it.
#   np.array of it is one object, which is True. encode() of what was decoded raises TypeError, so that the
#   message cannot be sent on. lcm 1.5.3 of PyPI makes a list, from the same file, with the same fingerprint.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
apt-get -o APT::Sandbox::User=root --quiet=2 download liblcm-bin=1.3.1+repack1-3 liblcm1=1.3.1+repack1-3
for package in *.deb; do dpkg -x "$package" .; done
library=$(dirname "$(find "$PWD" -name 'liblcm.so*' | head -n 1)")
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet lcm==1.5.3 numpy==2.4.6
echo 'package spot; struct camera_t { boolean seen[3]; int8_t id[3]; }' >camera_t.lcm
LD_LIBRARY_PATH=$library usr/bin/lcm-gen -p --ppath debian camera_t.lcm
venv/bin/lcm-gen -p --ppath pypi camera_t.lcm
venv/bin/python - <<'PY'
import importlib
import sys

import numpy as np


def maker(folder):
    """Class of the message, as it was made in that folder."""
    sys.path.insert(0, folder)
    kind = importlib.import_module("spot").camera_t
    sys.path.remove(folder)
    for name in [name for name in sys.modules if name.split(".")[0] == "spot"]:
        del sys.modules[name]
    return kind


def again(kind):
    """A message with two robots of three seen, as it arrives."""
    camera = kind()
    camera.seen, camera.id = [True, False, True], [1, 2, 3]
    return kind.decode(camera.encode())


def looked(kind):
    camera = again(kind)
    return any(camera.seen), sum(camera.seen), sum(camera.seen), tuple(camera.id)


debian, pypi = maker("debian"), maker("pypi")
print("any, sum, sum, numbers: Debian", looked(debian), "PyPI", looked(pypi))
assert looked(debian) == (True, 1, 0, (1, 2, 3)) and looked(pypi) == (True, 2, 2, (1, 2, 3))
mask = np.array(again(debian).seen)
print("as an array:", mask.shape, bool(mask), np.array(again(pypi).seen).shape)
assert mask.shape == () and bool(mask) and np.array(again(pypi).seen).shape == (3,)
assert debian._get_packed_fingerprint() == pypi._get_packed_fingerprint()
again(pypi).encode()
try:
    again(debian).encode()
    raise SystemExit("what was decoded can be sent on now")
except TypeError as error:
    print("sent on:", error)
PY
