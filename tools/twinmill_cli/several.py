# SPDX-License-Identifier: Apache-2.0
"""Words on one robot, said of several: robots, the library and the tool give them for one."""

import re
from collections.abc import Sized

# As they stand in the words: `it` may be a command, a start or a fault, and stays as it is then.
OF_SEVERAL = {
    "its program was": "their programs were",
    "its script is": "their scripts are",
    "its button was": "their buttons were",
    "its motor board": "their motor boards",
    "its signature is": "their signatures are",
    "its signed answer has": "their signed answers have",
    "its word": "their word",
    "reach it, and it may": "reach them, and they may",
    "heard of it": "heard of them",
    "its link": "their link",
    "its operator": "their operator",
    "holds it": "holds them",
    "it had": "they had",
    "it was last heard": "they were last heard",
    "it waited": "they waited",
    "begin by itself": "begin by themselves",
    "its version": "their versions",
    "it did": "they did",
    "it was halted": "they were halted",
    "it obeyed": "they obeyed",
    "it stood": "they stood",
    "it has": "they have",
    "has it": "have they",
    "it stands": "they stand",
    "it waits": "they wait",
    "it signs": "they sign",
    "arm it": "arm them",
    "brings it one": "brings each one",
    "the robot has": "the robots have",
    "the robot's program": "the robots' programs",
    "the robot's configuration": "the robots' configurations",
    "and has forgotten": "and have forgotten",
    "and was not": "and were not",
    "and is left alone": "and are left alone",
    "was started, and drives": "were started, and drive",
    "and drives": "and drive",
    "and stands": "and stand",
    "waits for a start and begins by itself": "wait for a start and begin by themselves",
    "and has not confirmed": "and have not confirmed",
    "and has not signed": "and have not signed",
    "and obeys": "and obey",
}
VERBS = {
    "was": "were",
    "is": "are",
    "has": "have",
    "signs": "sign",
    "says": "say",
    "drives": "drive",
    "goes": "go",
    "stands": "stand",
}
PATTERN = re.compile(rf"\b({'|'.join(OF_SEVERAL)})\b")


def of(robots: Sized, words: str) -> str:
    """Words on one robot, as they are said of these; a verb may stand first, behind their names."""
    if len(robots) == 1:
        return words
    words = re.sub(r"^\w+", lambda verb: VERBS.get(verb[0], verb[0]), words)
    return PATTERN.sub(lambda found: OF_SEVERAL[found[1]], words)
