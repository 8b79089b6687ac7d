# SPDX-License-Identifier: Apache-2.0
"""A stop reaches a robot on whatever network it is by now."""

import os

import pytest
from network import run_session

pytestmark = pytest.mark.skipif(
    not os.environ.get("TURBOPI"), reason="TURBOPI does not name the program"
)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see link_session.py."""
    if os.geteuid() != 0:
        pytest.skip("only root may join two network namespaces")
    return run_session("link_session.py", tmp_path_factory.mktemp("link"))


def test_stop_is_heard_on_a_wireless_network_that_was_made_anew(session):
    assert session["wifi_made_anew"]


def test_stop_is_heard_after_the_move_from_cable_to_wireless(session):
    assert session["moved_to_wifi"]


def test_stop_is_heard_on_the_network_that_is_not_the_robots_way_out(session):
    assert session["on_the_second_network"]


def test_stop_is_obeyed_by_unicast_and_a_start_is_not(session):
    assert session["by_unicast"] == {"stands": True, "started": False, "by_name": True}
