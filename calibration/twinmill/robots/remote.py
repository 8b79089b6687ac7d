# SPDX-License-Identifier: Apache-2.0
"""Commands on a robot, through the user's own ssh: its keys, its configuration, its known hosts."""

import re
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from twinmill.foreign_text import MESSAGE_MAX, plain_line

CONNECT_S = 8
ROBOT_SCRIPT = Path(__file__).with_name("robot.sh")


# What ssh says, and what that means for the user. The first that fits.
SSH_FAILURES = (
    ("could not resolve", "no host", "no such host: is the name right, and the robot on?"),
    ("host key verification", "host key", "its host key is not known, or another: ssh to it once"),
    ("permission denied", "no key", "takes no key of yours: ssh-copy-id to it first"),
    ("", "no answer", "does not answer: is it on, on this network, with ssh enabled?"),
)


class RemoteError(ValueError):
    """A failure on or on the way to a robot.

    Attributes:
        kind: in a word or two, for programs.
    """

    def __init__(self, kind: str, sentence: str):
        super().__init__(plain_line(sentence, MESSAGE_MAX))  # quotes what programs there said
        self.kind = plain_line(kind)


@dataclass(frozen=True)
class Remote:
    """A robot by its ssh name, as pi@robot03.local."""

    host: str
    ssh_config: Path | None = None

    def run(self, step: str, *arguments: str, timeout_s: float = 60) -> dict[str, str]:
        """Runs one step of robot.sh there.

        Returns:
            The lines KEY=VALUE that it printed.

        Raises:
            RemoteError: it failed; the step's own words.
        """
        command = "sh -s -- " + shlex.join([step, *arguments])
        said = self._ssh(command, ROBOT_SCRIPT.read_bytes(), timeout_s)
        lines = said.decode(errors="replace").splitlines()
        pairs = (line.split("=", 1) for line in lines if "=" in line)
        return {key: plain_line(value, MESSAGE_MAX) for key, value in pairs}

    def copy(self, source: Path, target: str, timeout_s: float = 300) -> None:
        """Copies a file to a path there that the user may write; removed again if it fails.

        Raises:
            RemoteError: it failed, for want of space most of all.
        """
        to = shlex.quote(target)
        command = f"cat > {to} || {{ code=$?; rm -f {to}; exit $code; }}"
        self._ssh(command, source.read_bytes(), timeout_s)

    def fetch(self, path: str, timeout_s: float = 300) -> bytes:
        """Takes a file from there, and removes it there.

        Raises:
            RemoteError: it failed.
        """
        at = shlex.quote(path)
        return self._ssh(f"cat {at} && rm -f {at}", b"", timeout_s)

    def _ssh(self, command: str, text: bytes, timeout_s: float) -> bytes:
        if not shutil.which("ssh"):
            raise RemoteError("no ssh", "ssh is not installed here: install openssh-client.")
        options = ["-o", "BatchMode=yes", "-o", f"ConnectTimeout={CONNECT_S}"]
        options += ["-o", "ServerAliveInterval=5"]
        options += ["-F", str(self.ssh_config)] if self.ssh_config else []
        try:
            done = subprocess.run(
                ["ssh", *options, "--", self.host, command],
                input=text,
                capture_output=True,
                timeout=timeout_s,
            )
        except subprocess.TimeoutExpired as error:
            raise RemoteError("no answer", f"no answer for {timeout_s:g} s.") from error
        said = done.stderr.decode(errors="replace")
        if done.returncode == 255:
            raise _ssh_failure(said)
        if done.returncode != 0:
            raise _step_failure(said)
        return done.stdout


def _ssh_failure(said: str) -> RemoteError:
    kind, sentence = next(words for sign, *words in SSH_FAILURES if sign in said.lower())
    lines = [line for line in said.splitlines() if line.strip()]
    return RemoteError(kind, f"{sentence} ({lines[-1].strip()})" if lines else f"{sentence}.")


def _step_failure(said: str) -> RemoteError:
    """robot.sh says `failed: KIND: SENTENCE`; anything else comes from a program it called."""
    found = re.search(r"^failed: ([^:]+): (.*)", said, re.MULTILINE)
    if found:
        return RemoteError(found[1], found[2])
    if "no space left" in said.lower():
        return RemoteError("no space", "its disk is full.")
    last = said.strip().splitlines()[-1:] or ["it said nothing"]
    return RemoteError("failed", f"a command on the robot failed: {last[0]}")
