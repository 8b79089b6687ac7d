# SPDX-License-Identifier: Apache-2.0
"""Lists of robots on the command line."""

import re


def parse_numbers(option: str, text: str, allowed: range) -> list[int]:
    """Numbers of a text like 1-8,12, in ascending order.

    Raises:
        ValueError: it is no such text, or has a number that is not allowed.
    """
    numbers: set[int] = set()
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d{1,4})\s*(?:-\s*(\d{1,4})\s*)?", part)
        if not found or (found[2] and int(found[2]) < int(found[1])):
            raise ValueError(f"{option} {text}: must be numbers and ranges, as 1-8,12.")
        numbers |= set(range(int(found[1]), int(found[2] or found[1]) + 1))
    if wrong := sorted(numbers - set(allowed)):
        raise ValueError(
            f"{option} {text}: {wrong[0]} is not in {allowed.start}..{allowed.stop - 1}."
        )
    return sorted(numbers)
