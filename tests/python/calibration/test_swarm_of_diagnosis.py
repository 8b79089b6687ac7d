# SPDX-License-Identifier: Apache-2.0
"""Verdict of `diagnose` on a swarm as a whole, after it judged each robot by itself."""

import os
import subprocess
from pathlib import Path

import pytest

from twinmill.model.model_file import ModelFile
from twinmill_cli.swarm_as_whole import judge_swarm

pytestmark = pytest.mark.skipif(
    not os.environ.get("TWIN_RUN"), reason="TWIN_RUN does not name the program"
)


def record(folder: Path, model: str, *options: str) -> Path:
    (folder / "model.toml").write_text(model)
    command = [os.environ["TWIN_RUN"], "--plant", "planar", "--n", "6", "--seed", "77"]
    command += ["--model", "model.toml", "--log", "run.lcmlog", "--force", *options]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / "run.lcmlog"


@pytest.fixture
def true() -> str:
    text = ModelFile.load("paper.toml").text.replace("body_radius_m = 0", "body_radius_m = 0.1")
    return text.replace("target_radius_m = 0 ", "target_radius_m = 0.1 ")


def judged(tmp_path: Path, log: Path, model: str, found=()) -> tuple[str, dict | None]:
    (tmp_path / "judge.toml").write_text(model)
    loaded = ModelFile.load(str(tmp_path / "judge.toml")).model
    return judge_swarm(log, "", loaded, bool(found))


def test_a_model_that_fails_each_robot_is_not_held_against_the_swarm():
    note, swarm = judge_swarm(Path("none"), "outside_catalogue", None, True)
    assert swarm is None and "once the model predicts each robot" in note


def test_a_true_model_makes_swarms_like_the_recorded_one(tmp_path, true):
    note, swarm = judged(tmp_path, record(tmp_path, true, "--duration-s", "40"), true)
    assert not swarm["differs"] and "could be one of the twin's 50" in note


def test_a_blind_robot_shows_in_the_swarm(tmp_path, true):
    blind = true + "\n[robots.R02]\nrange_m = 0.0\n"
    log = record(tmp_path, blind, "--duration-s", "60")
    note, swarm = judged(tmp_path, log, true, ["lag_by_duty"])
    assert swarm["differs"] and "with what was found: The floor's run is not one" in note
    assert "`collision` or `occlusion`" in note


def test_a_swarm_that_cannot_be_compared_is_said_so(tmp_path, true):
    note, swarm = judged(tmp_path, record(tmp_path, true, "--duration-s", "3"), true)
    assert swarm is None and "is too short" in note
    script = tmp_path / "s.csv"
    script.write_text("t_s,speed_input,turn_input\n0,50,0\n2,0,0\n")
    note, swarm = judged(tmp_path, record(tmp_path, true, "--script", str(script)), true)
    assert swarm is None and "all must play a table of behaviour" in note
