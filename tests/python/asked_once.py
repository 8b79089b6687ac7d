# SPDX-License-Identifier: Apache-2.0
"""Diagnoses of the same logs by the same model, made once for all tests that ask for them.

That a diagnosis of the same log is the same again is a claim of its own, in
`calibration/test_inference.py`.
"""

import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.model.model_file import ModelFile

MOST = 8  # results that are kept: each holds the arrays of its logs


class AskedOnce:
    """A function that judges logs, which is not called again for what it has judged.

    Args:
        judge: with the arguments of `diagnose`; what it tells of its progress is told again.
    """

    def __init__(self, judge: Callable[..., Any]) -> None:
        self.judge = judge
        self._known: OrderedDict[str, tuple[Any, list[str]]] = OrderedDict()

    def __call__(self, measurements, model_file, own=(), progress=lambda _: None, *, without=()):
        key = _hash_of(measurements, model_file, own, without)
        if key in self._known:
            found, words = self._known[key]
            for said in words:
                progress(said)
            return found
        words = []

        def heard(said: str) -> None:
            words.append(said)
            progress(said)

        found = self.judge(measurements, model_file, own, heard, without=without)
        self._known[key] = found, words
        if len(self._known) > MOST:
            self._known.popitem(last=False)
        return found


def _hash_of(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable],
    without: Sequence[str],
) -> str:
    """SHA-256 of all that a diagnosis depends on; what was computed from it is left out."""
    logs = [[_plain(m) for m in some] for some in (measurements, own)]
    asked = logs, str(model_file.path), model_file.text, sorted(without)
    return hashlib.sha256(pickle.dumps(asked)).hexdigest()


def _plain(one: Measurement | SteadyTable) -> Measurement | SteadyTable:
    return replace(one, track=replace(one.track)) if isinstance(one, Measurement) else one
