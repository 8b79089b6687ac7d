# SPDX-License-Identifier: Apache-2.0
"""Numbers of things in words: `1 robot`, `2 robots`."""


def counted(count: int, one: str, many: str = "") -> str:
    """The number and its noun, in the singular if it is 1.

    Args:
        count: how many.
        one: singular; with the verb where the sentence has one, as "pose is".
        many: plural; `one` with an s unless given.
    """
    return f"{count} {one if count == 1 else many or one + 's'}"
