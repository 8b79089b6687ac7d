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


def swung(
    pushes: np.ndarray, step_s: np.ndarray, rate: float, damping: float
) -> tuple[np.ndarray, np.ndarray]:
    """Means over steps of s and of r = ds/dt, from rest: dr/dt = w^2 (push - s) - 2 z w r.

    Exact where each push holds for its step. A step of no length leaves both as they are.

    Args:
        pushes: (N,) what s tends to.
        step_s: (N,)
        rate: w, 1/s.
        damping: z, below 1.
    """
    fast = rate * np.sqrt(1 - damping**2)
    fade = np.exp(-damping * rate * step_s)
    cos, sin = fade * np.cos(fast * step_s), fade * np.sin(fast * step_s) / fast
    own = cos + damping * rate * sin
    bands = np.zeros((4, 2 * len(pushes)))  # of s and r in turn, below the diagonal
    bands[0] = 1.0
    bands[1, 1:-1:2] = -sin[1:]
    bands[2, 0:-2:2] = -own[1:]
    bands[2, 1:-1:2] = damping * rate * sin[1:] - cos[1:]
    bands[3, 0:-2:2] = rate**2 * sin[1:]
    given = np.column_stack([(1 - own) * pushes, rate**2 * sin * pushes]).ravel()
    found, _ = dtbtrs(bands, given, uplo="L", diag="U")
    ends = found.reshape(-1, 2)
    changes = np.diff(ends, axis=0, prepend=np.zeros((1, 2)))
    lasting = np.where(step_s > 0, step_s, np.inf)
    speeding = (changes[:, 1] + 2 * damping * rate * changes[:, 0]) / lasting
    means = np.where(step_s > 0, pushes - speeding / rate**2, ends[:, 0])
    return means, np.where(step_s > 0, changes[:, 0] / lasting, ends[:, 1])


def faded(keep: np.ndarray, pushes: np.ndarray) -> np.ndarray:
    """(N,) y[n] = keep[n] y[n - 1] + pushes[n], from rest."""
    found, _ = dtbtrs([np.ones(len(keep)), np.append(-keep[1:], 0.0)], pushes, uplo="L", diag="U")
    return found
