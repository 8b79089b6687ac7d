# SPDX-License-Identifier: Apache-2.0
"""Linear filters with a short memory, forward in time.

`scipy.signal` does the same, and takes four tenths of a second to import.
"""

import numpy as np
import twinmill_native as native
from numpy.typing import ArrayLike


def filtered(
    numerator: ArrayLike, denominator: ArrayLike, signal: np.ndarray, axis: int = 0
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
    found = native.filtered(np.array(numerator, float), np.array(denominator, float),
                            np.ascontiguousarray(x.reshape(len(x), -1)))  # fmt: skip
    return np.moveaxis(found.reshape(x.shape), 0, axis)


def faded(keep: np.ndarray, pushes: np.ndarray) -> np.ndarray:
    """(N, ...) y[n] = keep[n] y[n - 1] + pushes[n], from rest."""
    flat = (np.ascontiguousarray(a).reshape(len(a), -1) for a in (keep, pushes))
    return native.faded(*flat).reshape(keep.shape)
