#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# NumPy 2.4.6: one lost heading erases all that come after it.
#
# Guess: np.unwrap leaves NaN where it stands, and joins what is before and after as if it were not there, or
#   at least starts anew behind it.
# Seen: 3 of 6 headings that were measured are NaN, since the corrections are summed up from the first on. A
#   frame that a tracker lost ends the run, and nothing is said. Unwrap what is finite alone.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet numpy==2.4.6
"$work/venv/bin/python" - <<'PY'
import numpy as np

heading = np.array([3.0, 3.1, np.nan, -3.1, -3.0, -2.9])
turned = np.unwrap(heading)
print(turned)
assert np.isfinite(turned[:2]).all() and np.isnan(turned[2:]).all()
there = np.isfinite(heading)
assert np.allclose(np.unwrap(heading[there])[2], 2 * np.pi - 3.1)
PY
