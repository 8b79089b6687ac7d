# SPDX-License-Identifier: Apache-2.0
"""One guest for all tests of a run; without one they are skipped, and say why.

A test that fails while the machine kept the guest from running is run again: pytest's --only-rerun.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rig import KERNEL, SUITE, SYSTEM_LIMIT_S, CannotRun, Rig, StoodStill, prepare, prepare_system

GUESTS: list[Rig] = []  # that were booted


def _judge(failure: Exception):
    """Raises what a failure was: the program's, or that of a machine that had other work."""
    stood_s = [length_s for guest in GUESTS for length_s in guest.standstills]
    if stood_s and isinstance(failure, (AssertionError, TimeoutError)):
        words = f"the guest stood still {len(stood_s)} times, up to {max(stood_s):.2f} s: {failure}"
        print(f"hil: {words}")
        raise StoodStill(words) from failure
    raise failure


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem):
    try:
        return (yield)
    except Exception as failure:
        _judge(failure)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    try:
        return (yield)
    except Exception as failure:
        _judge(failure)


def boot(image: Callable[[], Path], name: str, **options) -> Iterator[Rig]:
    """Boots what a function of rig.py has built."""
    try:
        built = image()
    except CannotRun as reason:
        print(f"hil: skipped: {reason}")
        pytest.skip(str(reason))
    with Rig(built, name, **options) as rig:
        GUESTS.append(rig)
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
