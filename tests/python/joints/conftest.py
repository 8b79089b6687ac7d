# SPDX-License-Identifier: Apache-2.0
"""Searches in the same log of joints by the same MJCF are made once for all tests here."""

import hashlib
import pickle
from collections.abc import Callable, Iterator

import pytest
from asked_once import Once

from twinmill.inference.search import Search
from twinmill.joints import diagnose
from twinmill.joints.always import Always
from twinmill.joints.plant import Plant

ONCE, SEARCHED = Once(), diagnose._searched


def searched(plant: Plant, always: Always | None, progress: Callable[[str], None]) -> Search:
    """`_searched`, which is not called again for the same log, MJCF and knowledge."""
    mjcf = plant.mjcf
    asked = plant.series.log, str(mjcf.path), mjcf.text, mjcf.hook, always
    key = hashlib.sha256(pickle.dumps(asked)).hexdigest()
    return ONCE.get(key, lambda heard: SEARCHED(plant, always, heard), progress)


@pytest.fixture(scope="module", autouse=True)
def searched_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnose, "_searched", searched)
        yield
