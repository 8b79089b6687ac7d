# SPDX-License-Identifier: Apache-2.0
"""Linear filters with a short memory, forward in time.

A recursive filter is the solution of a triangular system with a few diagonals. LAPACK solves that;
`scipy.signal` does the same, and takes four tenths of a second to import.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dtbtrs


def filtered(
    numerator: Sequence[float], denominator: Sequence[float], signal: np.ndarray, axis: int = 0
) -> np.ndarray:
    """Output y of a filter that begins at rest: sum_k a_k y[n - k] = sum_k b_k x[n - k].

    Args:
        numerator: b; b[0] first.
        denominator: a; its first is 1.
        signal: x, of any shape.
        axis: of time.
    """
    if not np.size(signal):
        return np.array(signal, float)
    x = np.moveaxis(np.asarray(signal, float), axis, 0)
    flat = x.reshape(len(x), -1)
    now, *before = numerator
    pushes = now * flat
    for k, share in enumerate(before, 1):
        pushes[k:] += share * flat[:-k]
    diagonals = np.repeat(np.asarray(denominator, float)[:, None], len(flat), axis=1)
    found, _ = dtbtrs(diagonals, pushes, uplo="L", diag="U")
    return np.moveaxis(found.reshape(x.shape), 0, axis)


def faded(keep: np.ndarray, pushes: np.ndarray) -> np.ndarray:
    """(N,) y[n] = keep[n] y[n - 1] + pushes[n], from rest."""
    found, _ = dtbtrs([np.ones(len(keep)), np.append(-keep[1:], 0.0)], pushes, uplo="L", diag="U")
    return found
