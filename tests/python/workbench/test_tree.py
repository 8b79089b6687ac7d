# SPDX-License-Identifier: Apache-2.0
"""Models tried, values set by hand, and the files of both. No log is needed."""

import shlex
import tomllib

import pytest

from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.set_values import with_values
from twinmill.workbench.tree import Tree
from twinmill_cli import main as cli


@pytest.fixture
def model(tmp_path, model_text, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fitted = "[base.std]\nmotor_lag_s = 0.01\nforward_gain = 0.02\n"
    covariance = (
        '[fit.covariance]\nnames = ["base.motor_lag_s", "base.forward_gain"]\n'
        "values = [[1e-4, 0.0], [0.0, 4e-4]]\n"
    )
    effect = '[[effect]]\nname = "coasting"\ndeceleration_mps2 = 0.7\n'
    text = model_text("hand", forward_gain=1.1) + fitted + covariance + effect
    (tmp_path / "model.toml").write_text(text)
    return ModelFile.load("model.toml")


def test_only_what_was_set_is_another_and_is_not_certain_any_more(model):
    text = with_values(model, {"base.motor_lag_s": 0.09, "coasting.deceleration_mps2": 0.5}, "me")
    old, new = tomllib.loads(model.text), tomllib.loads(text)
    assert new["base"]["motor_lag_s"] == 0.09
    assert new["effect"][0]["deceleration_mps2"] == 0.5
    assert new["base"]["std"] == {"forward_gain": 0.02}
    assert new["fit"]["covariance"] == {"names": ["base.forward_gain"], "values": [[4e-4]]}
    assert (new["parent"], new["created_by"]) == (model.hash, "me")
    assert new["robot"] == old["robot"]


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("base.motorlag_s", 0.1, r"no quantity.*nearest known is 'base\.motor_lag_s'"),
        ("base.motor_lag_s", -1.0, "within 0 to 2"),
    ],
)
def test_a_wrong_name_or_value_is_one_sentence(model, name, value, why):
    with pytest.raises(ModelError, match=why):
        with_values(model, {name: value}, "me")


def test_undo_goes_back_and_redo_forth_until_something_else_is_tried(model):
    tree = Tree(model, "model.toml")
    first = tree.set({"base.motor_lag_s": 0.09})
    second = tree.set({"base.forward_gain": 1.0})
    tree.undo()
    assert tree.current == first
    tree.undo()
    assert tree.current.number == 0 and not tree.can_undo
    tree.redo()
    tree.redo()
    assert tree.current == second and not tree.can_redo
    tree.undo()
    third = tree.set({"base.yaw_gain": 0.9})
    assert not tree.can_redo
    assert third.values == {"base.motor_lag_s": 0.09, "base.yaw_gain": 0.9}


def test_a_tree_is_the_same_after_it_was_written_and_read(model):
    tree = Tree(model, "model.toml")
    tree.set({"base.motor_lag_s": 0.09})
    tree.undo()
    other = Tree(model, "model.toml")
    other.restore(tree.to_json())
    assert other.to_json() == tree.to_json()
    assert other.can_redo


def test_the_commands_shown_write_the_very_file(model, tmp_path):
    tree = Tree(model, "model.toml")
    tree.set({"base.motor_lag_s": 0.0912345678})
    number = tree.set({"coasting.deceleration_mps2": 0.5}).number
    commands, text = tree.written(number, "mine.toml")
    for command in commands:
        cli.run(shlex.split(command)[1:])
    assert (tmp_path / "mine.toml").read_text() == text
