# SPDX-License-Identifier: Apache-2.0
"""Options before the name of a command to the swarm are read as behind it."""

import shlex
import sys

import pytest
import typer

from twinmill_cli import early, main
from twinmill_cli.lazy import LazyCommand
from twinmill_cli.word_order import VALUED, VERBS, in_order


@pytest.fixture(scope="module")
def commands():
    """Typer's commands below `swarm`, by name."""
    below = typer.main.get_group(main.app).commands["swarm"].command().commands
    return {n: c.command() if isinstance(c, LazyCommand) else c for n, c in below.items()}


def options_of(commands):
    """Names of all options, by whether a value stands behind them."""
    names = {True: set(), False: set()}
    for command in commands.values():
        for param in command.get_params(typer.Context(command)):
            if param.param_type_name == "option":
                names[not param.is_flag].update(param.opts, param.secondary_opts)
    return names


def test_names_and_options_are_those_that_typer_has(commands):
    assert {*VERBS} == {*commands}
    assert options_of(commands)[True] == VALUED


def test_every_command_to_the_swarm_has_its_options_on_either_side(commands):
    """By Typer: an option is one before the name wherever it is one behind it."""
    for name, command in commands.items():
        for param in command.get_params(typer.Context(command)):
            if param.param_type_name != "option":
                continue
            for option in param.opts:
                words = [option] if param.is_flag else [option, "stop" if name != "stop" else "arm"]
                assert in_order(["swarm", *words, name]) == ["swarm", name, *words]
                assert in_order([*words, "swarm", name]) == ["swarm", name, *words]


@pytest.mark.parametrize(
    ("words", "ordered"),
    [
        ("swarm --behavior stop start --arm", "swarm start --behavior stop --arm"),
        ("swarm --behaviour stop start", "swarm start --behaviour stop"),
        ("swarm --behavior stop", "swarm --behavior stop"),
        ("swarm --behavior=stop start", "swarm start --behavior=stop"),
        ("swarm -b stop start stop", "swarm start -b stop stop"),
        ("swarm --json -- stop", "swarm stop --json"),
        ("swarm stop -- --robots 1", "swarm stop -- --robots 1"),
        ("swarm robot03 --json stop", "swarm robot03 --json stop"),
        ("SWARM --json stop", "swarm stop --json"),
        ("swarm -h", "swarm -h"),
        ("--help", "--help"),
        ("import --robots 1 swarm stop", "import --robots 1 swarm stop"),
    ],
)
def test_what_is_no_name_stays_where_it_is(words, ordered):
    assert in_order(shlex.split(words)) == shlex.split(ordered)


@pytest.mark.parametrize("words", ["swarm start --json", "swarm --json start"])
def test_a_command_that_moves_robots_is_one_before_it_is_imported(monkeypatch, words):
    """By it a signal that was ignored at first is heard."""
    monkeypatch.setattr(sys, "argv", ["twinmill", *words.split()])
    assert early.verb() == "start"


def test_another_command_of_the_swarm_is_read_so_too(twinmill):
    code, out, _ = twinmill("swarm", "--json", "--lcm-url", "memq://", "status")
    assert code == 1 and '"verb": "status"' in out
