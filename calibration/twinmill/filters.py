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


class Swing:
    """An oscillator that is driven by a push, over steps: dr/dt = w^2 (push - s) - 2 z w r.

    Exact where each push holds for its step. A step of no length leaves all as it is.

    Args:
        step_s: (N,)
        rate: w, 1/s.
        damping: z, below 1.
    """

    def __init__(self, step_s: np.ndarray, rate: float, damping: float) -> None:
        self._step_s, self._rate, self._damping = step_s, rate, damping
        self._turned = native.swing_of(step_s, rate, damping)

    def around(self, pushes: np.ndarray) -> np.ndarray:
        """(2, N) means over steps of s and of r = ds/dt, from rest, around (N,) pushes."""
        return native.swung(pushes, self._step_s, self._turned, self._rate, self._damping)


def faded(keep: np.ndarray, pushes: np.ndarray) -> np.ndarray:
    """(N, ...) y[n] = keep[n] y[n - 1] + pushes[n], from rest."""
    flat = (np.ascontiguousarray(a).reshape(len(a), -1) for a in (keep, pushes))
    return native.faded(*flat).reshape(keep.shape)
