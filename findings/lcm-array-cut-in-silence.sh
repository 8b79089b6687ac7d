#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# lcm-gen 1.3.1 (Debian 12): of a list that is too long for a field the first values are sent, without a word.
#
# Guess: an error, as for one that is too short ("pack expected 3 items for packing (got 2)").
# Seen: double at[3] takes [1, 2, 3, 4] and sends 1, 2, 3, in the code that lcm-gen makes for Python. A
#   quaternion with w first, put into a vector of three, arrives as w, x, y.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
apt-get -o APT::Sandbox::User=root --quiet=2 download liblcm-bin=1.3.1+repack1-3 liblcm1=1.3.1+repack1-3
for package in *.deb; do dpkg -x "$package" .; done
library=$(dirname "$(find "$PWD" -name 'liblcm.so*' | head -n 1)")
echo 'package spot; struct place_t { double at[3]; }' >place_t.lcm
LD_LIBRARY_PATH=$library usr/bin/lcm-gen -p place_t.lcm
python3 - <<'PY'
import struct

from spot import place_t

place = place_t()
place.at = [1.0, 2.0, 3.0, 4.0]
print("four values arrive as", place_t.decode(place.encode()).at)
assert tuple(place_t.decode(place.encode()).at) == (1.0, 2.0, 3.0)
place.at = [1.0, 2.0]
try:
    place.encode()
    raise SystemExit("two values are sent, too")
except struct.error as error:
    print("two values:", error)
PY
