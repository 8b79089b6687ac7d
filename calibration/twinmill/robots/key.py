# SPDX-License-Identifier: Apache-2.0
"""The operator's key, each robot's own that follows from it, and signatures: firmware/RADIO.md."""

import hmac
import os
import re
import secrets
from collections.abc import Callable
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from shlex import quote

from twinmill.arguments import option

KEY_BYTES, TAG_BYTES = 32, 16


def default_path() -> Path:
    """Where the user's own key is; raises ValueError if there is no home folder."""
    try:
        config = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    except RuntimeError as error:
        raise ValueError(
            f"{option('key')}: must be given, since this user has no home folder."
        ) from error
    return Path(config) / "twinmill" / "swarm.key"


def of_operator(path: Path | None, on_new: Callable[[str], None]) -> bytes:
    """The operator's key: a file that is named must be there, the user's own is made at first use.

    Args:
        path: of the file; None: the user's own.
        on_new: is told a sentence if one is made: robots have another, or none.

    Raises:
        ValueError: as of load() and load_or_make().
        OSError: it cannot be read.
    """
    if path:
        return load(path)
    file = default_path()
    is_new = not _is_there(file)
    key = load_or_make(file)
    if is_new:
        on_new(
            f"a new operator's key was made, {file}, which no robot has yet: `twinmill robot flash "
            f"HOST` brings robots theirs. If they were flashed with another, name its file: "
            f"{option('key')}."
        )
    return key


def load_or_make(path: Path | None = None) -> bytes:
    """The operator's key; one is made if there is none yet.

    Raises:
        ValueError: the file is no key, or others may read it, or none can be made.
        OSError: it cannot be read.
    """
    file = path or default_path()
    if not _is_there(file):
        try:
            _make(file)
        except OSError as error:
            raise ValueError(
                f"{file}: there is no operator's key here, and none can be made "
                f"({error.strerror}); copy the operator's, and name it: {option('key')}."
            ) from error
    return load(file)


def load(path: Path | None = None) -> bytes:
    """The operator's key.

    Raises:
        ValueError: there is none, the file is no key, or others may read it.
        OSError: it cannot be read.
    """
    file = path or default_path()
    told = option("key", str(file)) if path else f"the operator's key, {file}"
    if not _is_there(file):
        named = f" {told}" if path else ""
        if str(path).startswith("~"):
            raise ValueError(
                f"{told}: there is no key here, for a shell makes a home folder of `~` only at the "
                f"beginning of a word without quotes, not behind `--key=`; was "
                f"{option('key', str(file.expanduser()))} meant?"
            )
        raise ValueError(
            f"{told}: there is no key here, so no robot's answer is believed; "
            "copy the operator's, or make one and bring it to robots: "
            f"`twinmill robot flash HOST{named}`."
        )
    if not file.is_file():
        raise ValueError(
            f"{told}: is no file, which is read again, but a folder or a pipe, as `<(...)` makes "
            "one; name the file of a key itself."
        )
    mode = file.stat().st_mode & 0o777
    if mode & 0o077:
        raise ValueError(
            f"{told}: others may read it (mode {mode:o}): "
            f"`chmod 600 {quote(str(file))}` if nobody has, else make a new one (remove it, and "
            "flash the robots again)."
        )
    text = file.read_bytes().strip()
    if not re.fullmatch(rb"[0-9a-f]{%d}" % (2 * KEY_BYTES), text):
        raise ValueError(
            f"{told}: is no key, which is {2 * KEY_BYTES} hexadecimal digits "
            f"(0-9, a-f) in small letters, and this has {len(text)} characters; "
            "copy the operator's file again, or make a new one (remove it, and flash the "
            "robots again)."
        )
    return bytes.fromhex(text.decode())


def _is_there(file: Path) -> bool:
    """Raises OSError where that cannot be told, as of a link that leads to itself."""
    with suppress(FileNotFoundError, NotADirectoryError):
        return bool(file.stat())
    return False


def _make(file: Path) -> None:
    """Whole or not at all; one that another process made meanwhile stays."""
    file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    part = file.with_name(f".{file.name}.{os.getpid()}")
    handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        os.write(handle, f"{secrets.token_hex(KEY_BYTES)}\n".encode())
        os.close(handle)
        with suppress(FileExistsError):
            os.link(part, file)
    finally:
        part.unlink()


def of_robot(key: bytes, robot_id: int) -> bytes:
    """The key that a robot has: it says nothing of the operator's, nor of other robots'."""
    return blake2b(f"twinmill robot {robot_id}".encode(), key=key, digest_size=KEY_BYTES).digest()


def name(key: bytes) -> str:
    """Eight digits by which a key is told from another; robots say theirs."""
    return blake2b(b"twinmill key name", key=key, digest_size=4).hexdigest()


def sign(key: bytes, message: bytes) -> bytes:
    """The message, which ends in its tag, with the right one."""
    body = message[:-TAG_BYTES]
    return body + blake2b(body, key=key, digest_size=TAG_BYTES).digest()


def is_signed(key: bytes, message: bytes) -> bool:
    """It was signed with this key."""
    return len(message) > TAG_BYTES and hmac.compare_digest(sign(key, message), message)
