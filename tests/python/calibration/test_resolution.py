# SPDX-License-Identifier: Apache-2.0
"""How small a difference of a robot its log would have shown: one that is made so is tried."""

import os
import subprocess

import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.resolution import Resolution, resolutions
from twinmill.experiment.rich_script import write_rich_script
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile

ROBOTS, SLOW, DURATION_S = 3, 2, 45.0
NOISE = (
    "[noise]\nsensor_m = 0.002\nsensor_rad = 0.01\ndrive_mps = 0.006\ndrive_radps = 0.03\n"
    "drive_s = 0.2\ndrive_turn_s = 0.2\n"
)


@pytest.fixture(scope="module")
def drive(tmp_path_factory, model_text):
    """Robots of the twin that are alike but for one, of less of one number; and their model."""
    folder = tmp_path_factory.mktemp("alike")
    write_rich_script(folder / "script.csv", DURATION_S, 1)
    given = model_text("alike") + NOISE
    (folder / "given.toml").write_text(given)

    def run(slower: float, number: str = "theta_a1"):
        robots = f"[robots.R{SLOW:02d}]\n{number} = {1 - slower}\n"
        (folder / "true.toml").write_text(given + robots)
        command = [os.environ.get("TWIN_RUN", "twin_run"), "--plant", "planar", "--n", ROBOTS]
        command += ["--model", folder / "true.toml", "--script", folder / "script.csv"]
        command += [
            "--spread-m",
            12,
            "--pose-rate-hz",
            20,
            "--log",
            folder / "run.lcmlog",
            "--force",
        ]
        subprocess.run([str(word) for word in command], check=True, capture_output=True)
        model_file = ModelFile.load(str(folder / "given.toml"))
        return load_measurements([folder / "run.lcmlog"], model_file.model), model_file

    return run


@pytest.fixture(scope="module")
def told(drive) -> Resolution:
    """Smallest differences that a log of such robots shows."""
    (*_, last) = resolutions(open_measurements(*drive(0.0)))
    assert last.robot_id == SLOW
    return last


@pytest.mark.parametrize(("key", "number"), [("speed", "theta_a1"), ("ahead", "forward_gain")])
@pytest.mark.parametrize(("times", "named"), [(1.5, [SLOW]), (0.5, [])])
def test_what_is_larger_is_named_and_what_is_smaller_is_not(drive, told, key, number, times, named):
    found = diagnose(*drive(times * getattr(told, key), number), lambda words: None)
    assert [r.robot_id for r in found.robots_off] == named
    assert [r.robot_id for r in found.robots] == list(range(ROBOTS))
