# SPDX-License-Identifier: Apache-2.0
"""One guest for all tests of a run; without one they are skipped, and say why."""

import pytest
from rig import CannotRun, Rig, prepare


@pytest.fixture(scope="session")
def image():
    try:
        return prepare()
    except CannotRun as reason:
        print(f"hil: skipped: {reason}")
        pytest.skip(str(reason))


@pytest.fixture(scope="session")
def rig(image):
    with Rig(image, "drive") as rig:
        print(f"hil: {rig.boot_s:.1f} s to boot; console: {rig.console}")
        yield rig
