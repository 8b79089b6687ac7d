# SPDX-License-Identifier: Apache-2.0
"""Words on one robot agree in number with several of them: by English grammar."""

import re
from pathlib import Path

import pytest

from twinmill.robots import hold, tell
from twinmill.robots.countdown import (
    HELD_BY_ANOTHER,
    NONE_BEGUN,
    NOT_BEGUN,
    NOT_HEARD_SINCE,
    STOPPED,
    UNHEARD,
)
from twinmill.robots.fleet import AWAITS_START, HIDES_START
from twinmill_cli import several

COMMAND = Path(__file__).parents[2] / "firmware" / "core" / "command.c"
STATES = [state for state in vars(hold).values() if isinstance(state, hold.State)]
WORDS = {
    *(state.words for state in STATES if state.stands),
    *(state.before for state in STATES if state.before),
    *re.findall(r'return "(.+)";', COMMAND.read_text()),
    *(tell.NO_KEY, tell.NO_SIGNATURE, tell.UNSEALED, tell.NEVER_HEARD),
    *(
        f"was {words}"
        for words in (HELD_BY_ANOTHER, NONE_BEGUN, NOT_BEGUN, NOT_HEARD_SINCE, STOPPED, UNHEARD)
    ),
    "was started anew, and has forgotten it",
    "a start that it waits for plays milling",
    f"stands still, and {HIDES_START}",
    f"stands still, {AWAITS_START}, and has not signed yet for whom",
}
# A start, a command or another operator is one.
OF_SOMETHING_ELSE = (
    *("after it was made", "or was made before", "start is over", "forgotten it"),
    *("whose command was", "operator who was", "of the start was"),
)
SINGULAR = r"\b(its|it|was|has|is|signs|the robot|the robot's)\b"


@pytest.mark.parametrize("words", sorted(WORDS))
def test_what_is_said_of_several_robots_has_no_singular(words):
    told = several.of(["R01", "R02"], words)
    for other in OF_SOMETHING_ELSE:
        told = told.replace(other, "")
    assert not re.search(SINGULAR, told), told
    assert several.of(["R01"], words) == words
