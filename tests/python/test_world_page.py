# SPDX-License-Identifier: Apache-2.0
"""The page on obstacles: with the files on it, its commands but for sweeps run as printed."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

PAGE = Path(__file__).parents[2] / "docs/world.md"

pytestmark = pytest.mark.skipif(
    not os.environ.get("TWIN_RUN"), reason="TWIN_RUN does not name the program"
)


def test_the_commands_of_the_page_run_with_its_files(tmp_path):
    page = PAGE.read_text()
    before, *parts = page.split("```toml\n")
    for part in parts:
        text, _, after = part.partition("```")
        name = re.findall(r"`(\w+\.toml)`", before)[-1]
        (tmp_path / name).write_text(text)
        before = after
    assert {f.name for f in tmp_path.iterdir()} == {
        *("defend.toml", "defenders.toml", "behaviors.toml")
    }
    programs = {
        "twin_run": [os.environ["TWIN_RUN"]],
        "twinmill": [sys.executable, "-c", "from twinmill_cli.main import main; main()"],
    }
    of_one_run, _ = page.split("## Did they keep it out?")  # sweeps take minutes
    lines = re.findall(r"^    (.+)$", of_one_run, re.M)
    assert len(lines) == 3
    for line in lines:
        program, *words = shlex.split(line)
        done = subprocess.run(
            [*programs[program], *words], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    bodies = pd.read_csv(tmp_path / "tables/body.csv", comment="#")
    assert set(bodies["name"]) == {"goal", "fence", "evader"}
    evader = bodies.query("name == 'evader'")  # along y = -1 from x = -2, at 0.2 m/s
    x_m = np.interp(10.0, evader["t_s"], evader["from_m_0"])
    assert x_m == pytest.approx(-2 + 10 * 0.2, abs=0.01)
    assert set(evader.query("t_s < 10")["from_m_1"]) == {-1.0}
