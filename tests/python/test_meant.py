# SPDX-License-Identifier: Apache-2.0
"""A command line that is refused names what was meant, and that is then no wrong command line."""

import re

import pytest

BUS = ["--lcm-url", "memq://"]
WRONG_COMMAND_LINE = 2


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        (["swarm", "start", *BUS], ["-behavior", "milling"]),
        (["swarm", "start", *BUS], ["-behavior=milling"]),
        (["swarm", "start", *BUS], ["-behaviour", "milling"]),
        (["swarm", "start", *BUS], ["-partial"]),
        (["swarm", "start", *BUS], ["milling"]),
        (["swarm", "start", *BUS], ["1,2"]),
        (["swarm", "start", *BUS], ["--robots", "1", "2"]),
        (["swarm", "select", "milling", *BUS], ["1,2"]),
        (["swarm", "arm", *BUS], ["1,2"]),
        (["fit", "a.lcmlog", "-o", "b.toml"], ["-model", "turbopi"]),
        (["robot", "flash", "x"], ["-ssh-config", "my file"]),
    ],
)
def test_what_was_meant_is_named_as_it_is_to_be_typed(twinmill, key_file, tmp_path, command, wrong):
    key = ["--key", key_file] if command[0] == "swarm" else []
    code, _, err = twinmill(*command, *key, *wrong)
    (told,) = re.findall(r"was `(.*)` meant\?", err)
    assert code == WRONG_COMMAND_LINE
    right = [word.replace("'", "") for word in re.findall(r"'[^']*'|\S+", told)]
    code, _, err = twinmill(*command, *key, *right)
    assert code != WRONG_COMMAND_LINE, err


def test_the_value_of_an_argument_that_was_given_a_name(twinmill, key_file):
    _, _, err = twinmill("swarm", "select", "--behavior", "milling")
    (told,) = re.findall(r"was `twinmill (.*)` meant, without --behavior\?", err)
    code, _, err = twinmill(*told.split(), *BUS, "--key", key_file)
    assert code == 1 and "no robot was heard" in err


@pytest.mark.parametrize("words", [["-x"], ["milling", "diffusing"], ["--", "-behavior"]])
def test_nothing_is_guessed_where_nothing_fits(twinmill, words):
    code, _, err = twinmill("swarm", "start", *words)
    assert code == WRONG_COMMAND_LINE and "meant" not in err


def test_a_value_right_behind_its_short_option_is_one(twinmill):
    """`-mmodel` names a model `model`, as getopt(3) has it."""
    code, _, err = twinmill("compare", "nowhere.lcmlog", "-mmodel")
    assert code == 1 and "meant" not in err
