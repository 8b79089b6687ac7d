# SPDX-License-Identifier: Apache-2.0
"""The page on Python: its blocks run in their order, and do what the page says of them."""

import re
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot as plt

import twinmill as tm

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
from site_hooks import run  # noqa: E402

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_what_is_there_is_kept_unless_forced(tmp_path):
    """As section 8 says; the truth is in the files."""
    t_s = np.arange(0, 3, 0.02)
    pose = np.column_stack([0.1 * t_s, 0 * t_s, 0 * t_s])
    told = [[0.1, 0.0], [0.0, 0.0]]
    log = tm.Log.from_arrays(t_s, pose, [0.0, 2.0], told, kind="twist", same_clock=True)
    model = tm.Model.load("turbopi.toml")
    writers = {
        "a.lcmlog": log.save,
        "a.mcap": partial(log.export, to="mcap"),
        "a.toml": model.save,
        "a.urdf": partial(model.export, to="urdf"),
    }
    for name, write in writers.items():
        (tmp_path / name).write_text("mine")
        with pytest.raises(ValueError, match=r"force=True"):
            write(tmp_path / name)
        assert (tmp_path / name).read_bytes() == b"mine"
        write(tmp_path / name, force=True)
        assert (tmp_path / name).read_bytes() != b"mine"


def test_all_blocks_of_the_page_run(tmp_path, monkeypatch, capsys):
    run(f"python {ROOT}/examples/make_recording.py", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(ROOT / "build/bin"), prepend=":")
    names: dict = {}
    blocks = BLOCK.findall((ROOT / "docs/python.md").read_text())
    assert len(blocks) == 10  # eight tasks, two with a second one
    with pd.option_context("display.width", 60):  # of a narrow window, in which pandas cuts
        for block in blocks:
            exec(block, names)
    printed = capsys.readouterr().out
    assert all(column in printed for column in names["table"].columns)  # which the page explains
    plt.close(names["figure"])
    assert "base.yaw_gain" not in names["fit"].stderr.dropna()
    # As examples/make_recording.py hides it.
    table = names["table"]
    assert table.index[0] == "with coasting" and table.loc["as fitted", "p_chance"] < 0.05
    found = names["added"].table().set_index("name").loc["coasting.deceleration_mps2"]
    assert found["value"] == pytest.approx(0.7, abs=3 * found["std"])
    assert {"range_m", "seed", "circliness"} == set(names["rows"][0])
    assert len(names["seen"]) == len(names["poses"])
    made = {"residuals.png", "params.csv", "tables", "turbopi.urdf", "better.toml", "report"}
    assert made <= {path.name for path in tmp_path.iterdir()}
