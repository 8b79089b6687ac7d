# SPDX-License-Identifier: Apache-2.0
"""A swarm of a true model is seldom called wrong; one blind robot is seen."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native
from scipy.stats import binom

from twinmill.defaults import FALSE_ALARMS, least_seeds
from twinmill.model.model_file import ModelFile
from twinmill.swarm.compare import (
    blocks,
    compared,
    least_spread,
    plain,
    rank_test,
    twin_values,
)
from twinmill_cli.main import run

SECONDS, SEEDS, PAIRS = 60, 39, 80
SCALE = (1.1, 0.1)
LEAST = least_spread(compared(False))
CHANGES = {"robot.body_radius_m": 0.1, "sensor.target_radius_m": 0.1}


def cell_of(text: str) -> native.Cell:
    model = native.Model.from_toml(text, "test")
    for name, value in CHANGES.items():
        model.set(name, value)
    angle = np.arange(6) * np.pi / 3
    poses = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), angle + 0.3 * angle**2])
    return native.Cell(model, [[100, -500, 100, 500]] * 6, 6, poses=poses.tolist())


@pytest.fixture(scope="module")
def text():
    return ModelFile.load("paper.toml").text


@pytest.fixture(scope="module")
def pool(text):
    """Blocks of 160 runs of one model from one start."""
    cell, names = cell_of(text), compared(False)
    count = SECONDS * 20
    return np.array(
        [blocks(twin_values(cell, s, 6, SCALE, count=count), names) for s in range(160)]
    )


def test_true_models_are_called_wrong_at_the_stated_rate(pool):
    # Exchangeable runs: each p-value is at or below k / (S + 1) with that probability, exactly.
    random, results = np.random.default_rng(7), []
    for floor in range(PAIRS):
        others = random.choice(np.delete(np.arange(len(pool)), floor), SEEDS, replace=False)
        results.append(rank_test(pool[floor], pool[others], LEAST))
    alarms = sum(result.differs for result in results)
    p_values = np.array([(r.p_value, r.p_band) for r in results])
    print(alarms, "of", PAIRS, "false alarms; mean p", p_values.mean(axis=0))
    assert alarms <= binom.ppf(0.9999, PAIRS, FALSE_ALARMS)
    # Uniform on 1/40 .. 1: a mean of 0.51, standard deviation 0.29 / sqrt(80).
    assert np.all(np.abs(p_values.mean(axis=0) - 0.51) < 5 * 0.29 / np.sqrt(PAIRS))


def test_one_blind_robot_is_seen(text, pool):
    blind = cell_of(text + "\n[robots.R02]\nrange_m = 0.0\n")
    found = 0
    for seed in range(10):
        floor = blocks(
            twin_values(blind, 500 + seed, 6, SCALE, count=SECONDS * 20), compared(False)
        )
        result = rank_test(floor, pool[seed : seed + 50], LEAST)
        found += result.differs and result.left is not None
    print(found, "of 10 found")
    assert found >= 9


def test_the_moment_of_leaving_is_the_first_outside_the_band():
    random = np.random.default_rng(3)
    twins = random.normal(size=(60, 20, 2))
    floor = random.normal(size=(20, 2)) * 0.3
    floor[12:, 1] += 30
    result = rank_test(floor, twins, np.full(2, 0.1))
    assert result.left == (12, 1) and result.differs
    inside = (floor[:12] > result.low[:12]) & (floor[:12] < result.high[:12])
    assert inside.all()
    assert least_seeds() == 39  # 1 / (39 + 1) is half of 5 %


def test_scaled_metrics_come_back_in_their_units():
    names = compared(True)
    values = np.full((80, len(native.METRICS)), 0.5)
    values[:, native.METRICS.index("groups")] = 2
    back = plain(blocks(values, names), names)
    assert back.shape == (2, len(names))
    expected = [2.0 if name == "groups" else 0.5 for name in names]
    assert back[0] == pytest.approx(expected)


@pytest.mark.skipif(not os.environ.get("TWIN_RUN"), reason="TWIN_RUN does not name the program")
def test_a_log_against_the_model_that_made_it_and_one_with_a_blind_robot(
    tmp_path, monkeypatch, text
):
    monkeypatch.chdir(tmp_path)
    true = text.replace("body_radius_m = 0", "body_radius_m = 0.1")
    true = true.replace("target_radius_m = 0 ", "target_radius_m = 0.1 ")
    Path("true.toml").write_text(true)
    Path("blind.toml").write_text(true + "\n[robots.R02]\nrange_m = 0.0\n")
    common = ["--plant", "planar", "--n", "6", "--duration-s", "40", "--seed", "77"]
    for name in ("true", "blind"):
        made = [
            os.environ["TWIN_RUN"],
            *common,
            "--model",
            f"{name}.toml",
            "--log",
            f"{name}.lcmlog",
        ]
        subprocess.run(made, check=True, capture_output=True)
    same = run(["compare-swarm", "true.lcmlog", "--model", "true.toml"])
    other = run(["compare-swarm", "blind.lcmlog", "--model", "true.toml", "--out", "report"])
    assert not same.test.differs
    assert other.test.differs and other.test.left
    assert "band" in Path("report/index.html").read_text()
    with pytest.raises(ValueError, match="no behaviour 'mill'"):
        run(["compare-swarm", "true.lcmlog", "--model", "true.toml", "--behavior", "mill"])
