# SPDX-License-Identifier: Apache-2.0
"""Errors of the standard streams that say which of them failed."""

from collections.abc import Iterator
from contextlib import contextmanager

STDOUT_NAME, STDERR_NAME = "standard output", "standard error"


@contextmanager
def naming(stream: str) -> Iterator[None]:
    """Has an OSError raised meanwhile name a stream, unless it names a file already."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or stream
        raise
