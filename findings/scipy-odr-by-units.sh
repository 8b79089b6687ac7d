#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# SciPy 1.17.1: orthogonal distance regression of a speed on a duty in percent is plain least squares.
#
# Guess: a fit that allows for errors in both variables is not drawn to zero by the noise of x, and does not
#   depend on the units, where neither error is given.
# Seen: where x goes from 0 to 100 with noise of 20, and y to 0.36, the slope is 0.68 of the true one, as that
#   of polyfit; with x in units of y's size 0.79. Only with sx and sy given it is right. Distances are
#   measured as if one of x were one of y, so moving a point along x costs far more than along y.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$work/venv/bin/python" -W ignore - <<'PY'
import numpy as np
from scipy import odr

random, slope = np.random.default_rng(0), 0.0036
duty = np.linspace(0, 100, 2000)
seen = duty + random.normal(0, 20, duty.size)
speed = slope * duty + random.normal(0, 0.002, duty.size)


def fitted(x, unit=1.0, **errors):
    data = odr.RealData(x * unit, speed, **errors)
    return odr.ODR(data, odr.unilinear, beta0=[slope / unit, 0]).run().beta[0] * unit / slope


shares = [np.polyfit(seen, speed, 1)[0] / slope, fitted(seen), fitted(seen, slope),
          fitted(seen, sx=20, sy=0.002)]
print("least squares {:.3f}, ODR {:.3f}, ODR in other units {:.3f}, with errors {:.3f}".format(*shares))
assert np.allclose(shares, [0.678, 0.678, 0.793, 1.007], atol=0.005)
PY
