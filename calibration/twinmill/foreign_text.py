# SPDX-License-Identifier: Apache-2.0
"""Text that comes from elsewhere: messages of robots, files of others, output of other programs.

It may hold escape sequences that rewrite a terminal, marks that turn the order of a line round, or
pages of characters. Before it is shown, logged or written to a table it goes through this module.
"""

NAME_MAX = 48  # characters of a name or a version, as on the robot
LINE_MAX = 100  # characters of a reason: robots give at most 96
MESSAGE_MAX = 4000  # characters of a sentence that quotes such texts
REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


def printable(text: str) -> str:
    """Control, format, surrogate and unassigned characters replaced; line breaks stay.

    Args:
        text: any text.

    Returns:
        A text of the same length.
    """
    if text.isprintable():
        return text
    return "".join(c if c == "\n" or c.isprintable() else REPLACEMENT for c in text)


def plain_line(text: str, most: int = LINE_MAX) -> str:
    """One line of printable characters, cut where it is longer.

    Args:
        text: any text.
        most: characters that are left at most; a cut ends in an ellipsis.
    """
    line = printable(" ".join(text[: 4 * most].split()))
    is_cut = len(line) > most or len(text) > 4 * most
    return f"{line[: most - 1]}{ELLIPSIS}" if is_cut else line


def first_line(text: object) -> str:
    """A name as an error quotes it: of several lines, which are a file's text, the first and cut.

    Args:
        text: a path, or what was given for one.

    Returns:
        A text of one line as it is.
    """
    first, *others = str(text).strip().splitlines() or [""]
    return f"{plain_line(first)} {ELLIPSIS}" if others else str(text)
