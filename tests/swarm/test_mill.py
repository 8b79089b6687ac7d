# SPDX-License-Identifier: Apache-2.0
"""Eight TurboPis, with nothing but the defaults of twin_run, mill; in MuJoCo as in the plane.

A mill is what Vega et al. 2024 (arXiv 2410.16444) call one: circliness below 0.2. The class asks
for bodies apart and one sense of rotation besides. Rings stand after a minute; how round one is, is
decided by the robots that the seed draws. So the share is measured where runs are cheap, in the
plane, and MuJoCo, which knows forces, must give the same robots the same ring.
"""

import json
import os
import subprocess

import pytest
from scipy.stats import binomtest

TWIN_RUN = os.environ.get("TWIN_RUN", "")
PLANAR_SEEDS, MUJOCO_RUNS = range(1, 101), 2
# A tenth of the threshold: other rings than these would be told apart by it.
CIRCLINESS_TOLERANCE = 0.02

pytestmark = pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the program")


def ring(folder, plant: str, seed: int) -> dict:
    """Output of twin_run for the last of 120 s."""
    command = [TWIN_RUN, "--plant", plant, "--n", 8, "--duration-s", 120, "--json"]
    command += ["--seed", seed, "--pose-rate-hz", 1, "--log", folder / "run.lcmlog", "--force"]
    told = subprocess.run(list(map(str, command)), capture_output=True, check=True, timeout=600)
    return json.loads(told.stdout)


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    folder = tmp_path_factory.mktemp("planar")
    return {seed: ring(folder, "planar", seed) for seed in PLANAR_SEEDS}


def test_most_swarms_of_eight_mill(planar):
    mills = sum(run["class"] == "milling" for run in planar.values())
    # One chance in a thousand that no more than half do and so many were found.
    assert binomtest(mills, len(planar), 0.5, alternative="greater").pvalue < 0.001, mills


def test_mujoco_gives_the_same_robots_the_same_ring(planar, tmp_path):
    # Where the plane's discs touch, the narrower hulls of MuJoCo need not.
    free = [seed for seed, run in planar.items() if run["metrics"]["contacts"] == 0]
    for seed in free[:MUJOCO_RUNS]:
        metrics = ring(tmp_path, "mujoco", seed)["metrics"]
        assert metrics["circliness"] == pytest.approx(
            planar[seed]["metrics"]["circliness"], abs=CIRCLINESS_TOLERANCE
        )
        assert metrics["groups"] == 1 and metrics["contacts"] == 0
        assert metrics["rotation"] > 0.9
