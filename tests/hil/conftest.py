# SPDX-License-Identifier: Apache-2.0
"""One guest for all tests of a run; without one they are skipped, and say why."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rig import KERNEL, SUITE, SYSTEM_LIMIT_S, CannotRun, Rig, prepare, prepare_system


def boot(image: Callable[[], Path], name: str, **options) -> Iterator[Rig]:
    """Boots what a function of rig.py has built."""
    try:
        built = image()
    except CannotRun as reason:
        print(f"hil: skipped: {reason}")
        pytest.skip(str(reason))
    with Rig(built, name, **options) as rig:
        print(f"hil: {rig.boot_s:.1f} s to boot; console: {rig.console}")
        yield rig


@pytest.fixture(scope="session")
def rig():
    yield from boot(prepare, f"drive.{KERNEL}.{SUITE}")


@pytest.fixture(scope="session")
def system():
    yield from boot(prepare_system, f"system.{SUITE}", memory_mb=1024)


@pytest.fixture(scope="session")
def installed(system):
    """The package installed, as a user does it."""
    system.systemctl("is-system-running", "--wait")
    assert system.run("/usr/bin/dpkg", "-i", "/turbopi.deb", limit_s=SYSTEM_LIMIT_S).code == 0
    return system
