# SPDX-License-Identifier: Apache-2.0
"""Leads the user's browser to an address that holds a secret, and nobody else.

A browser's command line can be read by all users of the machine, so the secret must not be in it.
There is the path of a file, which only its owner can read.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from markupsafe import Markup

PAGE = Markup("""<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={url}">
<title>Twinmill</title>
<a href="{url}">Workbench</a>
""")


@contextmanager
def address_file(path: Path, url: str) -> Iterator[Path]:
    """A page that goes on to the address at once; gone at the end.

    Args:
        path: where it is put; what a killed program left there is replaced.
        url: the address.

    Raises:
        OSError: it cannot be made.
    """
    path.unlink(missing_ok=True)
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w") as file:
        file.write(PAGE.format(url=url))
    try:
        yield path
    finally:
        with suppress(OSError):
            path.unlink()
