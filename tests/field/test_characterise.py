# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot characterise`: plays a script, logs it; stops the robot on any failure."""

import os

import pytest
from network import run_session

from twinmill_cli.characterise import check_script

pytestmark = pytest.mark.skipif(
    not os.environ.get("TWIN_RUN"), reason="TWIN_RUN does not name the program"
)
PERIOD_US = 22_000  # the model's control period
CUT_SHORT = (
    "key",
    "ctrl_c",
    "stopped_by_another",
    "full_disk",
    "lost_poses",
    "lost_telemetry",
)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see characterise_session.py."""
    return run_session("characterise_session.py", tmp_path_factory.mktemp("characterise"))


def test_script_is_played_and_all_that_is_heard_is_logged(session):
    played = session["played"]
    assert played["code"] == 0 and played["ended"] == "played to its end"
    kinds = ("ACK", "LINK", "POSE", "RUN", "SIGNED_ACK", "TELEMETRY")
    assert played["channels"] == [f"R03_{kind}" for kind in kinds]
    assert played["in_order"] and played["mode_after"] == "stopped"
    # The script's own rows: 0 until 0.4 s, 50 % until 1.2 s, -50 % until 2 s.
    for t_us, *duties in played["duties"]:
        near_a_change = min(abs(t_us - at_us) for at_us in (400_000, 1_200_000)) < PERIOD_US
        expected = 0 if t_us < 400_000 else 50 if t_us < 1_200_000 else -50
        assert near_a_change or duties == [expected] * 4
    assert played["duties"][-1][0] == pytest.approx(2_000_000, abs=2 * PERIOD_US)


@pytest.mark.parametrize("how", CUT_SHORT)
def test_whatever_goes_wrong_stops_the_robot_and_keeps_the_log(session, how):
    run = session[how]
    assert run["code"] == 1 and run["mode_after"] == "stopped" and run["log"]
    assert run["ended"].startswith("stopped: ") and "NOT ALL STAND" not in run["ended"]
    # 60 s long, the script was left within a second or, where the robot was not heard, three.
    assert run["drove_after_act_s"] < 4


def test_reasons_are_told(session):
    ended = {how: session[how]["ended"] for how in CUT_SHORT}
    assert "key" in ended["key"] and "Ctrl-C" in ended["ctrl_c"]
    assert ended["stopped_by_another"] == "stopped: stopped by another command"
    assert "the log cannot be written" in ended["full_disk"]
    assert "pose" in ended["lost_poses"] and "telemetry" in ended["lost_telemetry"]


def test_script_above_the_cap_is_refused_before_anything_moves(session):
    assert session["too_fast"]["code"] == 1 and not session["too_fast"]["log"]
    assert "70 % at 0.4 s" in session["too_fast"]["complaint"]


def test_a_robot_that_another_holds_is_left_alone(session):
    held = session["held_by_another"]
    assert held["code"] == 1 and held["mode_after"] == "running"
    assert "held by another operator or terminal; it is left alone" in held["complaint"]


def test_cap_counts_what_inputs_make_of_the_wheels(tmp_path):
    script = tmp_path / "s.csv"
    # The vendor's mixing: a turn of 0.5 is 63 % of duty more on one side.
    script.write_text("t_s,speed_input,turn_input\n0,20,0.5\n1,0,0\n")
    assert check_script(script, 83) == 1.0
    with pytest.raises(ValueError, match="83 %"):
        check_script(script, 82)
