# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm metrics` on a live bus, against the logs that the same swarms wrote."""

import json
from dataclasses import replace

import numpy as np
import pytest
import twinmill_native as native
from network import run_twin_session

from twinmill.data.log import read_log
from twinmill.swarm.metrics import swarm_metrics

DRIVERS = {"robots": "", "twins": "TWIN_"}
RANGE_M, BODY_RADIUS_M = 1.1, 0.1  # turbopi.toml
HALF_STEP_S = 0.025  # poses come four times as often


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("metrics")


@pytest.fixture(scope="module")
def session(folder):
    """Record of the session: see metrics_session.py."""
    return run_twin_session("metrics_session.py", folder)


def logged(path, prefix, first_utime_us, last_utime_us):
    """Metrics by the log of the span that was measured live."""
    log = read_log(path, prefix)
    first_s, last_s = ((t - log.t0_utime_us) / 1e6 for t in (first_utime_us, last_utime_us))
    robots = {}
    for i, robot in log.robots.items():
        t_s = robot.pose_t_s
        span = (t_s > first_s - 1e-6) & (t_s < last_s + HALF_STEP_S)
        names = ("pose_t_s", "pose", "z_m", "valid")
        robots[i] = replace(robot, **{name: getattr(robot, name)[span] for name in names})
    return swarm_metrics(replace(log, robots=robots), RANGE_M, BODY_RADIUS_M)


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("look", [4, -1])
def test_live_is_what_the_log_of_the_same_run_tells(session, folder, driver, look):
    swarms = json.loads(session["both"]["lines"][look])["swarms"]
    (live,) = (swarm for swarm in swarms if swarm["channel_prefix"] == DRIVERS[driver])
    span = live["first_utime_us"], live["last_utime_us"]
    series = logged(folder / driver, DRIVERS[driver], *span)
    assert live["class"] == series.final
    for key, values in (("metrics", series.mean), ("now", series.values[-1])):
        got = [np.nan if live[key][n] is None else live[key][n] for n in native.METRICS]
        # A busy machine loses a message now and then; one step more in the mean is beyond this.
        np.testing.assert_allclose(got, values, rtol=1e-3, atol=1e-4, err_msg=key)
    if look == -1:
        assert (span[1] - span[0]) / 1e6 == pytest.approx(11, abs=0.5)


def test_a_look_a_second_until_ctrl_c(session):
    looks = [json.loads(line) for line in session["both"]["lines"]]
    steps_s = np.diff([look["utime_us"] for look in looks]) / 1e6
    assert np.median(steps_s) == pytest.approx(1, abs=0.2)
    assert [s["channel_prefix"] for s in looks[-1]["swarms"]] == ["", "TWIN_"]
    assert [s["source"] for s in looks[-1]["swarms"]] == ["twin", "twin"]
    assert session["both"]["code"] == 0


def test_a_prefix_leaves_the_others_out(session):
    head = session["one"]["lines"][0].split()
    assert head in (["TWIN_R.."], ["TWIN_R..", "twin"])  # who speaks is said every 5 s
    assert session["one"]["code"] == 0


def test_an_empty_bus_is_one_sentence(session):
    looks = [json.loads(line) for line in session["empty"]["lines"]]
    assert all(look["swarms"] == [] for look in looks)
    assert "nobody was heard" in looks[-1]["note"]
    assert session["empty"]["code"] == 1
