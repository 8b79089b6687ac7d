# SPDX-License-Identifier: Apache-2.0
"""Robots that touch: their commands are checked where nothing else moves them."""

import os
import subprocess

import numpy as np
import pytest

from twinmill.data.checks.apart import apart
from twinmill.data.measurement import clean_measurements, load_measurements
from twinmill.model.model_file import ModelFile

BODY_RADIUS_M = 0.1
NEAR_M = 0.25  # between centres: a TurboPi's corners are 0.124 m from its middle


@pytest.fixture(scope="module")
def jam(tmp_path_factory):
    """Three robots of a milling table that push each other for most of a minute in MuJoCo."""
    if not os.environ.get("TWIN_RUN"):
        pytest.skip("TWIN_RUN does not name the program")
    path = tmp_path_factory.mktemp("jam") / "jam.lcmlog"
    words = ("--n", 3, "--seed", 2, "--behavior", "milling_cmaes", "--duration-s", 60)
    words += ("--log", path)
    subprocess.run([os.environ["TWIN_RUN"], *map(str, words)], check=True, capture_output=True)
    return path


def test_what_is_kept_is_all_that_lies_apart(jam):
    tracks = [m.track for m in clean_measurements([jam])]
    mine, *others = tracks
    kept = apart(mine, others, BODY_RADIUS_M)
    away_m = np.min(
        [
            np.hypot(*(mine.pose[:, :2] - o.pose[:, :2]).T)  # all are seen in the same frames
            for o in others
        ],
        axis=0,
    )
    usable = mine.segment >= 0
    assert np.array_equal(kept.segment >= 0, usable & (away_m >= NEAR_M))
    assert 0.1 < np.mean(kept.segment[usable] >= 0) < 0.6
    within = np.diff(kept.segment) == 0
    assert np.all(np.diff(kept.pose_t_s)[within & (kept.segment[1:] >= 0)] < 0.05)


def test_a_jam_is_no_mistake_of_the_columns(jam):
    """The twin's own log, signs, columns, axes and clocks as they are."""
    model = ModelFile.load("turbopi.toml").model
    read = load_measurements([jam], model)
    assert [str(f) for f in read.findings] == []
    assert len(read) == 3
