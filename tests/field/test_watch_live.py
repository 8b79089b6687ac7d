# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm watch` on a live bus: robots and twins at once, against their own logs."""

from importlib.util import find_spec

import lcm
import numpy as np
import pytest
import turbopi
from network import run_twin_session

from twinmill.extras import missing

needs_viewer = pytest.mark.skipif(find_spec("rerun") is None, reason=missing("rerun"))
EVERYONE = ["R00", "R01", "TWIN_R00", "TWIN_R01"]
DRIVERS = {"robots": "", "twins": "TWIN_"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("watch")


@pytest.fixture(scope="module")
def session(folder):
    """Record of the session: see watch_session.py."""
    return run_twin_session("watch_session.py", folder)


def payloads(log):
    by_channel = {}
    for event in lcm.EventLog(str(log), "r"):
        by_channel.setdefault(event.channel, []).append(event.data)
    return by_channel


def logged(folder, driver):
    """Robots or twins on the bus alone; truth and the operator's link are not for watchers."""
    said = payloads(folder / driver)
    return {c: d for c, d in said.items() if "TRUTH" not in c and not c.endswith("_LINK")}


def test_robots_and_twins_are_told_apart(session):
    assert session["robots"] == EVERYONE


def test_all_that_was_said_is_heard_once_and_in_order(session, folder):
    heard = payloads(folder / "heard")
    said = logged(folder, "robots") | logged(folder, "twins")
    # What runs is told at the start and every 5 s: four seconds may lack it.
    assert {c for c in said if not c.endswith("_RUN")} <= set(heard) <= set(said)
    for channel, got in heard.items():
        begin = said[channel].index(got[0])
        assert got == said[channel][begin : begin + len(got)], channel
    # Four seconds of 120 poses a second, less what a busy machine takes to begin.
    assert all(len(heard[f"{name}_POSE"]) > 100 for name in EVERYONE)


@needs_viewer
def test_command_shows_both_where_they_were(session, folder):
    from rerun.chunk import RrdReader

    assert session["said"]["robots"] == EVERYONE
    shown = {}
    for chunk in RrdReader(folder / "shown.rrd").stream().collect().stream():
        batch = chunk.to_record_batch()
        for column in batch.schema.names:
            if column.split("/")[-1].endswith("translation"):
                rows = [row[0] for row in batch[column].to_pylist() if row]
                shown.setdefault(chunk.entity_path, []).extend(map(tuple, rows))
    assert set(shown) == {f"/{driver}/R0{robot}" for driver in DRIVERS for robot in (0, 1)}
    for driver, prefix in DRIVERS.items():
        for robot in (0, 1):
            messages = logged(folder, driver)[f"{prefix}R0{robot}_POSE"]
            xy_m = [turbopi.pose_t.decode(data).position_m[:2] for data in messages]
            there = {tuple(np.float32(place)) for place in xy_m}
            places = {tuple(np.float32(place[:2])) for place in shown[f"/{driver}/R0{robot}"]}
            assert len(places) > 100
            assert places <= there
