# SPDX-License-Identifier: Apache-2.0
"""Sentences of the library write options as their reader gives them: in Python, or in a shell."""

import pytest

import twinmill as tm
from twinmill.arguments import option, options, spelled
from twinmill_cli import main as cli
from twinmill_cli.spelling import typed

# What is to be said of an import, and the words by which Python and a shell take it.
SAID = [
    ({"same_clock": True}, None, "same_clock=True", "--same-clock"),
    ({"formula": False}, None, "formula=False", "--no-formula"),
    ({"full_duty": None}, None, "full_duty", "--full-duty"),
    ({"pose_shift_s": -0.25}, None, "pose_shift_s=-0.25", "--pose-shift-s=-0.25"),
    ({"pose_shift_s": -0.25}, 2, "pose_shift_s={2: -0.25}", "--pose-shift-s R02=-0.25"),
    ({"exchange": [(3, 5)]}, None, "exchange=[(3, 5)]", "--exchange R03=R05"),
    (
        {"flip": ["y_m", "theta_rad"], "heading_offset_deg": 90},
        None,
        "flip=['y_m', 'theta_rad'], heading_offset_deg=90",
        "--flip y_m --flip theta_rad --heading-offset-deg 90",
    ),
    ({"rename": {"a b": "x_m"}}, 7, "rename={7: {'a b': 'x_m'}}", "--rename R07='a b=x_m'"),
]


@pytest.mark.parametrize(("given", "robot_id", "python", "shell"), SAID)
def test_options_are_written_as_python_and_as_the_shell_take_them(given, robot_id, python, shell):
    assert options(given, robot_id) == python
    with spelled(typed):
        assert options(given, robot_id) == shell
    assert options(given, robot_id) == python
    if None not in given.values():
        known = {name: None for name in given} | eval(f"dict({python})")
        assert known == {k: v if robot_id is None else {robot_id: v} for k, v in given.items()}


def test_one_mistake_is_told_to_each_in_his_own_words(tmp_path):
    """A file that is there already is the simplest."""
    out = tmp_path / "m.toml"
    tm.Model.load("turbopi.toml").save(out)
    with pytest.raises(ValueError, match=r"exists; .* replace it with force=True\.$"):
        tm.Model.load("turbopi.toml").save(out)
    with pytest.raises(ValueError, match=r"exists; .* replace it with --force\.$"):
        cli.run(["set", "base.motor_lag_s=0.1", "--model", "turbopi.toml", "-o", str(out)])
    assert option("force", True) == "force=True"  # the command has left nothing behind
