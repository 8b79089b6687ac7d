# SPDX-License-Identifier: Apache-2.0
"""Handlers of signals that are lent to something else for a while."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from types import FrameType
from typing import Any

Handler = Callable[[int, FrameType | None], object] | int | None


def put_back(before: Mapping[Any, Handler]) -> None:
    """Puts handlers back, as `signal.signal` gave them when it set others.

    It gives None for one that is not Python's own, as PYTHONFAULTHANDLER and PYTHONDEVMODE install
    for SIGABRT, and takes none back: such a signal does from now on what it does by default.
    """
    for number, handler in before.items():
        signal.signal(number, signal.SIG_DFL if handler is None else handler)
