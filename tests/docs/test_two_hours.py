# SPDX-License-Identifier: Apache-2.0
"""The page for an unknown robot: its commands exist and run, its table of wheels is algebra's."""

import re
import shlex
import sys
from pathlib import Path

import pytest
import twinmill_native as native

from twinmill_cli.guide import ANSWERS
from twinmill_cli.main import BELOW, COMMANDS, LazyCommand

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
from site_hooks import commands_of, run  # noqa: E402

PAGE = (ROOT / "docs/two-hours.md").read_text()
SHOWN = re.findall(r"^\$ (twinmill .*)$", PAGE, flags=re.MULTILINE)
# Minutes of judging, which the tutorial's test and the site's build run.
LONG = (" compare ", " diagnose ", " explain ", " plot ", "better.toml")


@pytest.mark.parametrize("line", SHOWN)
def test_each_command_and_its_options_exist(line):
    words = shlex.split(line)[1:]
    name = BELOW.get(words[0], {}).get(words[1], words[0])
    module = {name: module for name, module, _ in COMMANDS}[name]
    command = LazyCommand(name, module, "").command()
    known = {option for p in command.params for option in p.opts}
    assert [w for w in words[1:] if w.startswith("-") and w not in known] == []


def test_the_answers_are_those_of_the_guide():
    assert [" | ".join(row) for row in ANSWERS if f"| {' | '.join(row)} |" not in PAGE] == []


def test_what_takes_seconds_runs(tmp_path):
    quick = [c for c in commands_of(PAGE) if not any(word in f" {c} " for word in LONG)]
    assert len(quick) >= 7
    for command in quick:
        run(command, tmp_path)
    made = {"mine.toml", "wheels.lcmlog", "first.lcmlog", "drive.py", "drive_bag"}
    assert made <= {p.name for p in tmp_path.iterdir()}
    compile((tmp_path / "drive.py").read_text(), "drive.py", "exec")


def body_velocity(kind, driven):
    """Velocity with wheels rolling forward at 1 rad/s: least squares without slip."""
    text = (
        f'name = "m"\n[base]\ndrive = "wheel_speed"\nwheels = "{kind}"\ncontrol_period_s = 0.02\n'
    )
    model = native.Model.from_toml(text, "m")
    return model.body_velocity([float(driven(wheel["words"])) for wheel in model.wheels()])


def test_the_table_says_where_one_mecanum_wheel_alone_takes_the_robot():
    rows = re.findall(r"^\| (front|rear) (left|right) \| ([^|]*) \|$", PAGE, re.MULTILINE)
    assert len(rows) == 4
    for end, side, said in rows:
        vx, vy, omega = body_velocity("mecanum", lambda w, at=f"{end} {side}": w.startswith(at))
        assert vx > 0 and said.startswith("forward")
        assert ("to the left" in said, "to the right" in said) == (vy > 1e-9, vy < -1e-9)
        assert ("turns left" in said, "turns right" in said) == (omega > 0, omega < 0)


def test_the_page_says_how_a_side_of_plain_wheels_alone_turns_the_robot():
    sides = re.findall(r"(left|right) alone turns (left|right)", PAGE)
    assert len(sides) == 2
    for side, said in sides:
        _, _, omega = body_velocity("differential", lambda w, side=side: f" {side} " in w)
        assert said == ("left" if omega > 0 else "right")
