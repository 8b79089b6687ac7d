# SPDX-License-Identifier: Apache-2.0
"""The file of the robot's program, as the Debian package carries it."""

import subprocess

from rig import BUILD, KERNEL, SUITE

# In bytes, of 1000 to the kilobyte.
SIZE_LIMIT = 100_000
# Of both kits' computers: the linker starts on a page what is read-only once it runs.
LARGEST_PAGE = 16384


def program():
    return BUILD / f"{KERNEL}.{SUITE}.root/usr/bin/turbopi"


def elf(*options) -> str:
    command = ["aarch64-linux-gnu-readelf", "--wide", *options, program()]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_file_is_small(rig):
    size = program().stat().st_size
    print(f"hil: {size} bytes")
    assert size < SIZE_LIMIT


def test_what_a_fault_could_be_used_for_is_closed(rig):
    """Read-only after the start, to the page; no stack that runs; calls that check their room."""
    segments = [line.split() for line in elf("--segments").splitlines()]
    relro = next(words for words in segments if words[:1] == ["GNU_RELRO"])
    assert (int(relro[2], 16) + int(relro[5], 16)) % LARGEST_PAGE == 0
    stack = next(words for words in segments if words[:1] == ["GNU_STACK"])
    assert "E" not in "".join(stack[6:-1])
    assert "BIND_NOW" in elf("--dynamic") and "Type:                              DYN" in elf("-h")
    symbols = elf("--dyn-syms")
    assert "__stack_chk_fail" in symbols and "__snprintf_chk" in symbols
