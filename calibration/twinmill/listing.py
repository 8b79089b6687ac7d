# SPDX-License-Identifier: Apache-2.0
"""Words one after the other, as sentences have them."""

from collections.abc import Sequence


def listed(words: Sequence[str]) -> str:
    """`a`, `a and b`, or `a, b and c`; at least one."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
