# SPDX-License-Identifier: Apache-2.0
"""Tables of which each holds one robot (`poses_R0.csv`, `poses_R1.csv`): whose each is."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from twinmill.arguments import option
from twinmill.data.importers.series import CommandSeries, PoseSeries
from twinmill.data.log import LogError

PATTERN = re.compile(r"[*?\[]")
WORD = re.compile(r"[^\W\d_]+|\d+")
OF_ROBOT = re.compile(r"^(r|robot|bot|id|agent)$", re.IGNORECASE)  # before a robot's number
LARGEST = 99

Given = Path | Sequence[Path] | None
Series = TypeVar("Series", PoseSeries, CommandSeries)


def files_of(given: Given, name: str) -> tuple[Path, ...]:
    """The files that are given; a name with * or ? that is no file stands for those that fit it.

    Raises:
        LogError: none fits, or one is given twice.
    """
    found: list[Path] = []
    for path in [given] if isinstance(given, str | Path) else given or ():
        own = [Path(path)]
        if PATTERN.search(own[0].name) and not own[0].exists():
            own = sorted(own[0].parent.glob(own[0].name))
        if not own:
            raise LogError(f"{option(name, str(path))}: no file has such a name; correct it.")
        found += own
    if twice := [path for path, times in Counter(found).items() if times > 1]:
        raise LogError(f"{option(name, str(twice[0]))}: is given twice; name each file once.")
    return tuple(found)


def robot_numbers(
    poses: Sequence[Path], commands: Sequence[Path], robots: dict[str, int]
) -> dict[Path, int]:
    """Number of each file's robot, of kinds of which there are several files.

    The number is what is in one name and not in the others; else files of poses and of commands
    whose names differ by the same words are numbered in the order of those of poses. A file is
    absent where its name does not tell.

    Args:
        poses: files.
        commands: files.
        robots: robot_id by a word in the names.
    """
    numbers: dict[Path, int] = {}
    own = [_own_words(paths) for paths in (poses, commands) if len(paths) > 1]
    for words in own:
        told = {path: _told(path, words[path], robots) for path in words}
        if None not in told.values() and len(set(told.values())) == len(told):
            numbers |= told
    if not numbers and len(own) == 2 and sorted(own[0].values()) == sorted(own[1].values()):
        order = [words for words in own[0].values() if words]
        if len({*map(tuple, order)}) == len(own[0]):
            numbers = {p: order.index(words) + 1 for kind in own for p, words in kind.items()}
    return numbers


def _own_words(paths: Iterable[Path]) -> dict[Path, list[str]]:
    """Words and numbers in each name that are not in all."""
    words = {path: [w.lower() for w in WORD.findall(path.name.split(".")[0])] for path in paths}
    counts = [Counter(own) for own in words.values()]
    common = counts[0].copy()
    for count in counts:
        common &= count
    return {path: sorted((Counter(own) - common).elements()) for path, own in words.items()}


def _told(path: Path, own: list[str], robots: dict[str, int]) -> int | None:
    """Number of a robot by a word of the name, by the only number of its own, or by `robot 3`."""
    stem = path.name.split(".")[0]
    words = WORD.findall(stem)
    named = {robots[word] for word in (stem, *words) if word in robots}
    if named:
        return named.pop() if len(named) == 1 else None
    digits = {int(word) for word in own if word.isdecimal() and int(word) <= LARGEST}
    if len(digits) > 1:
        pairs = pairwise(words)
        digits &= {int(n) for word, n in pairs if n.isdecimal() and OF_ROBOT.match(word)}
    return digits.pop() if len(digits) == 1 else None


def read_each(
    paths: Sequence[Path],
    numbers: dict[Path, int],
    read: Callable[[Path], list[Series]],
    what: str,
) -> list[Series]:
    """Series of all files, of which each must have robots of its own.

    A file that cannot be read is left out, with its reason, if another can.

    Args:
        paths: files of one kind.
        numbers: robot_id by file, where its name tells it.
        read: reads one.
        what: `poses` or `commands`.

    Raises:
        LogError: two files hold the same robot, or none can be read.
    """
    found: list[Series] = []
    left_out: list[LogError] = []
    holder: dict[int, Path] = {}
    for path in paths:
        try:
            own = read(path)
        except LogError as error:
            left_out.append(error)
            continue
        for series in own:
            if series.robot_id == numbers.get(path):
                series.warnings.insert(0, f"{path.name} is taken for robot {series.robot_id}.")
            if series.robot_id in holder:
                raise LogError(
                    f"{holder[series.robot_id].name} and {path.name} both hold {what} of robot "
                    f"{series.robot_id}; give other robots other numbers, for example with "
                    f"{option('robot', {path.name.split('.')[0]: 'ID'})}, and other runs logs of "
                    "their own."
                )
            holder[series.robot_id] = path
            found.append(series)
    if not found:
        raise left_out[0]
    found[0].warnings.extend(f"Left out: {reason}" for reason in left_out)
    return found
