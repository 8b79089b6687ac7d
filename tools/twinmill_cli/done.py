# SPDX-License-Identifier: Apache-2.0
"""Deeds of the command that runs: whom it told anything, and what became of that.

Whatever fails, its last words and its exit code follow from these alone. It imports nothing that
could be what fails.
"""

from __future__ import annotations

from collections.abc import Callable

# Before robots were told anything, by the word behind `swarm`.
NOTHING = {
    "": "",  # a command to no robot
    "stop": "NOTHING WAS STOPPED: switch off by hand what drives.",
}
NOTHING_SAID = "Nothing was said to any robot."
# After that, where nobody knows what became of it.
UNKNOWN = {
    "stop": "Stop was said, and who obeyed it is not known: SWITCH OFF BY HAND what still drives.",
    "start": "Robots were told something, and may drive: `twinmill swarm stop` stops them.",
    "arm": "Robots were told that they may be started; nothing moves by that.",
    "select": "Robots were told what to do; those that drive drive on.",
}
STAYS_TRUE = "What was told of robots before stays true."


class Deeds:
    """Record of one command.

    Attributes:
        has_begun: all that every command needs is imported.
        code: the exit code of what cannot be undone; None: there is nothing of that.
        outcome: a sentence on what became of robots; empty: nobody knows.
        told: the one that somebody was told last, be it behind other words.
        has_said: robots were told something.
    """

    def __init__(self, *, has_begun: bool = False) -> None:
        self.has_begun = has_begun
        self.code: int | None = None
        self.outcome, self.told = "", ""
        self.has_said: Callable[[], bool] = lambda: False

    @property
    def is_told(self) -> bool:
        """Somebody was told the outcome."""
        return bool(self.outcome) and self.told.endswith(self.outcome)

    def last_words(self, verb: str) -> str:
        """Sentence for the end of a command that failed; empty of one that speaks to no robot.

        Args:
            verb: the word behind `swarm`, if any.
        """
        if self.outcome:
            return STAYS_TRUE if self.is_told else self.outcome
        if self.has_said():
            return UNKNOWN.get(verb, "")
        return NOTHING.get(verb, NOTHING_SAID)


_now = Deeds()


def now() -> Deeds:
    """Those of the command that runs."""
    return _now


def begin() -> None:
    """A command begins, and has done nothing."""
    global _now
    _now = Deeds(has_begun=True)


def decide(code: int, outcome: str = "") -> None:
    """Keeps the exit code of what became of robots from any later Ctrl-C, or failure.

    Args:
        code: the exit code.
        outcome: as of `became`; empty: as it was.
    """
    _now.code, _now.outcome = code, outcome or _now.outcome


def decided_or(code: int) -> int:
    """The exit code that was decided; another where none was."""
    return code if _now.code is None else _now.code


def is_decided() -> bool:
    """Something was done that cannot be undone, and need not be done again."""
    return _now.code is not None


def speaks(has_said: Callable[[], bool]) -> None:
    """From now on robots may be told something; the function knows whether they were."""
    _now.has_said = has_said


def became(outcome: str) -> None:
    """Keeps what became of robots, whether or not it can be told; empty: nobody knows any more."""
    _now.outcome = outcome


def told(outcome: str) -> None:
    """Somebody was told that."""
    _now.told = outcome
