# SPDX-License-Identifier: Apache-2.0
"""`twin_sweep --dask` on two machines: one that dies loses nothing."""

import os
import signal

import pytest
from network import run_session


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may lay a cable between networks")
def test_a_machine_that_dies_loses_nothing_and_the_bytes_are_the_same(tmp_path):
    run = run_session("cluster_session.py", tmp_path)
    assert run["machines"] == ["10.77.0.1", "10.77.0.2"]
    assert run["died"] == -signal.SIGKILL
    assert run["kept"] == run["parts"] > 6 and run["same"]
