# SPDX-License-Identifier: Apache-2.0
"""Order of words in a command line to the swarm: an option may stand before the command's name.

Imports nothing: it is asked before the command's own module is there.
"""

from collections.abc import Collection, Sequence

GROUP = "swarm"
TO_ROBOTS = ("start", "stop", "arm", "select", "status")
VERBS = (*TO_ROBOTS, "metrics", "plot", "watch", "compare", "phase", "matters", "ask")
# Options of these commands behind which a value stands, as Typer has them from their functions.
VALUED = {
    "--at", "--at-least", "--behavior", "--channel-prefix", "--connect", "--draws", "--duration-s",
    "--experiments", "--first-seed", "--goal", "--host", "--in-s", "--key", "--lcm-url",
    "--link-timeout-s", "--map-seeds", "--margin", "--model", "--n", "--odd", "--only", "--out",
    "--output", "--rival", "--robots", "--save", "--seeds", "--spread-m", "--start",
    "--target-radius-m", "--timeout-s", "--x", "--y", "-b", "-m", "-o",
}  # fmt: skip
LIKE_OPTION = 0.8  # difflib's ratio of behaviour and behavior is 0.94, of in and in-s 0.67


def in_order(words: Sequence[str]) -> list[str]:
    """Words of a command line, the group's and the command's name before options they stand behind.

    `swarm --robots 1 stop` and `--robots 1 Swarm stop` are `swarm stop --robots 1`. A word that is
    the value of an option is no name; other words stay as they are.
    """
    first = _with_first(words, {GROUP})
    if "".join(first[:1]).lower() != GROUP:
        return [*words]
    return [GROUP, *_with_first(first[1:], VERBS)]


def verb_of(words: Sequence[str]) -> str:
    """The first word behind the group's name that is no option, be it no command; may be empty."""
    words = in_order(words)
    place = 1 if words[:1] == [GROUP] else len(words)
    while place < len(words) and words[place].startswith("-"):
        place += 2 if _takes_value(words[place].lower()) else 1
    return "".join(words[place : place + 1]).lower()


def _with_first(words: Sequence[str], names: Collection[str]) -> list[str]:
    """These words, the first that is one of some names before options that stood before it."""
    place = 0
    while place < len(words) and words[0].startswith("-"):
        word = words[place].lower()
        if word in names:
            before = [word for word in words[:place] if word != "--"]
            return [words[place], *before, *words[place + 1 :]]
        place += 2 if _takes_value(word) else 1
    return [*words]


def _takes_value(word: str) -> bool:
    """An option whose value is the next word; so is one that is misspelled."""
    if word in VALUED or not word.startswith("--") or word == "--" or "=" in word:
        return word in VALUED
    import difflib  # slow to import, and hardly ever needed

    return bool(difflib.get_close_matches(word.strip("-"), _NAMES, 1, LIKE_OPTION))


_NAMES = [option.removeprefix("--") for option in sorted(VALUED) if option.startswith("--")]
