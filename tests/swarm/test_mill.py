# SPDX-License-Identifier: Apache-2.0
"""Eight TurboPis in MuJoCo, with nothing but the defaults of twin_run, mill.

A mill is what Vega et al. 2024 (arXiv 2410.16444) call one: circliness below 0.2. The class asks
for bodies apart and one sense of rotation besides.
"""

import json
import os
import subprocess

import pytest

TWIN_RUN = os.environ.get("TWIN_RUN", "")
SEEDS = (1, 2, 3)


@pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the program")
def test_eight_mill_for_most_seeds(tmp_path):
    found = []
    for seed in SEEDS:
        command = [TWIN_RUN, "--mjcf", "turbopi.xml", "--n", 8, "--duration-s", 40, "--json"]
        command += ["--seed", seed, "--pose-rate-hz", 10, "--log", tmp_path / "run.lcmlog"]
        told = subprocess.run(list(map(str, command)), capture_output=True, check=True, timeout=600)
        found.append(json.loads(told.stdout)["class"])
    assert found.count("milling") > len(SEEDS) / 2, found
