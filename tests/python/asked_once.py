# SPDX-License-Identifier: Apache-2.0
"""Diagnoses of the same logs by the same model, made once for all tests that ask for them.

So are what a model always misses in its own logs, and runs designed for the same diagnosis. That a
diagnosis of the same log is the same again is a claim of its own, in
`calibration/test_inference.py`.
"""

import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.experiment import design
from twinmill.inference.always import Always, always_of
from twinmill.model.model_file import ModelFile

MOST = 8  # results that are kept: each holds the arrays of its logs


class Once:
    """Results by what was asked for; what is told meanwhile is told again."""

    def __init__(self) -> None:
        self._known: OrderedDict[Hashable, tuple[Any, list[str]]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[..., Any], progress: Callable[[str], None]) -> Any:
        """The result of `make`, which is called with a listener unless the key is known."""
        if key in self._known:
            found, words = self._known[key]
            for said in words:
                progress(said)
            return found
        words = []

        def heard(said: str) -> None:
            words.append(said)
            progress(said)

        found = make(heard)
        self._known[key] = found, words
        if len(self._known) > MOST:
            self._known.popitem(last=False)
        return found


class AskedOnce:
    """A function that judges logs, which is not called again for what it has judged.

    Args:
        judge: with the arguments of `diagnose`.
    """

    def __init__(self, judge: Callable[..., Any]) -> None:
        self.judge, self._once = judge, Once()

    def __call__(self, measurements, model_file, own=(), progress=lambda _: None, *, without=()):
        return self._once.get(
            _hash_of(measurements, model_file, own, without),
            lambda heard: self.judge(measurements, model_file, own, heard, without=without),
            progress,
        )


class AlwaysOnce:
    """`always_of`, which is not called again for the same logs and model."""

    def __init__(self) -> None:
        self._once = Once()

    def __call__(self, measurements: Sequence[Measurement], model_file: ModelFile) -> Always:
        return self._once.get(
            _hash_of(measurements, model_file, (), ()),
            lambda _: always_of(measurements, model_file),
            lambda _: None,
        )


class DesignedOnce:
    """`design`, which is not called again for one result of a diagnosis."""

    def __init__(self) -> None:
        self._once, self._design = Once(), design.design

    def __call__(self, found, model_file, limits, progress) -> design.Plan:
        def make(heard: Callable[[str], None]) -> tuple[design.Plan, Any]:
            # The diagnosis is kept, so that no other one gets its id.
            return self._design(found, model_file, limits, heard), found

        key = id(found), str(model_file.path), model_file.text, limits
        return self._once.get(key, make, progress)[0]


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
