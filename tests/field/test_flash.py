# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot flash`: installs the program over a real ssh; each failure has a name."""

import os
import shutil

import pytest
from network import run_session

from twinmill.robots.remote import _ssh_failure
from twinmill.robots.robot_update import parse_target

REQUIRED = ("dropbear", "dropbearkey", "ssh", "ssh-keygen", "dpkg-deb", "mount")
FAILURES = (
    "wrong architecture",
    "no permission",
    "no space",
    "not installable",
    "no package",
    "service dies",
    "bad configuration",
    "no camera",
    "no telemetry",
)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see flash_session.py."""
    missing = [name for name in REQUIRED if not shutil.which(name)]
    missing += [name for name in ("TURBOPI", "TWIN_RUN") if not os.environ.get(name)]
    if missing:
        pytest.skip(f"not here: {', '.join(missing)}")
    if os.geteuid() != 0:
        pytest.skip("only root may let an ssh server change users")
    return run_session("flash_session.py", tmp_path_factory.mktemp("flash"))


def only(run: dict) -> dict:
    (robot,) = run["robots"]
    return robot


def test_dry_run_says_what_would_be_done_and_does_nothing(session):
    for robot in session["dry_run"]["robots"]:
        assert any("-1~deb12 over nothing" in step for step in robot["would"])
        assert any("behavior = diffusing" in step for step in robot["would"])
    assert session["dry_run"]["code"] == 0 and not session["touched_by_dry_run"]


def test_two_robots_run_what_was_installed(session):
    assert session["first"]["code"] == 0
    for robot in session["first"]["robots"]:
        # The stand-in's pack of 8 V, and frames thirty times a second.
        assert robot["ok"] and robot["battery_V"] == 8.0 and "fps" in robot["camera"]
        assert robot["version"] == session["version"]


def test_number_and_behaviour_are_set_and_the_rest_is_kept(session):
    for robot_id, text in zip((3, 4), session["configs"], strict=True):
        lines = text.splitlines()
        assert f"robot_id = {robot_id}" in lines and 'behavior = "diffusing"' in lines
        assert text.count("robot_id") == 1 and text.count("behavior") == 1
        assert "board = stub" in lines and "width_px = 64" in lines


def test_tables_of_ones_own_are_put_on_the_robot(session):
    own = session["own"]
    assert own["put"]["code"] == 0 and own["same"]
    assert 'behavior = "spin"' in own["config"] and 'table = "0,2,0,2"' in own["config"]
    robot = only(own["bad"])
    assert own["bad"]["code"] == 1 and robot["kind"] == "bad behaviours"
    assert "line 1: table 'ahead' must be" in robot["sentence"]


def test_a_mill_of_two_bits_that_was_found_drives_the_robot_and_is_recognised(session):
    found = session["found"]
    assert found["put"]["code"] == 0
    assert 'bit1 = "left"' in found["config"] and 'bit2 = "right"' in found["config"]
    # Robots that see by both halves; the flashed program gave the first one's duties.
    assert found["class"] == "milling"
    assert [len(shares) for shares in found["bits"].values()] == [2] * 5


def test_rollback_goes_to_the_package_before(session):
    assert only(session["no_previous"])["kind"] == "no previous"
    assert session["second"]["code"] == 0
    assert [version[-8:] for version in session["installed"][:2]] == ["-2~deb12"] * 2
    assert session["rollback"]["code"] == 0 and session["back_to"].endswith("-1~deb12")


def test_one_robot_that_fails_does_not_hold_up_another(session):
    kinds = {robot["host"]: robot["kind"] for robot in session["mixed"]["robots"]}
    assert kinds == {
        "robot03": "",
        "robot09": "no answer",
        "robot08": "no key",
        "nobody7.invalid": "no host",
    }
    assert session["mixed"]["code"] == 1


@pytest.mark.parametrize("kind", FAILURES)
def test_every_failure_has_its_name_and_its_exit_code(session, kind):
    run = session["failures"][kind]
    assert run["code"] == 1 and only(run)["kind"] == kind and only(run)["sentence"]


def test_bad_configuration_leaves_the_old_one(session):
    assert session["failures"]["config kept"]
    assert "milling" in only(session["failures"]["bad configuration"])["sentence"]


def test_reason_for_a_package_that_cannot_be_installed_is_apts_own(session):
    sentence = only(session["failures"]["not installable"])["sentence"]
    assert "needs liblcm1 but it is not installable" in sentence
    assert "Nothing was changed" in sentence


def test_robot_with_another_debian_is_refused_by_its_name(session):
    sentence = only(session["failures"]["no package"])["sentence"]
    assert "runs Debian 11" in sentence and "12" in sentence


def test_vendors_services_are_stopped_with_consent_alone(session):
    vendor = session["vendor"]
    refused = only(vendor["refused"])
    assert refused["kind"] == "in use" and "turbopi.service" in refused["sentence"]
    assert "hw_wifi" not in refused["sentence"] and vendor["untouched"]
    assert vendor["taken"]["code"] == 0
    assert vendor["during"] == [
        "hw_wifi.service.active",
        "hw_wifi.service.enabled",
        "twinmill-robot.service.enabled",
    ]


def test_vendors_services_come_back_and_ours_goes(session):
    vendor = session["vendor"]
    assert vendor["back"]["code"] == 0
    assert set(vendor["before"]) - set(vendor["after"]) == {"twinmill-robot.service.enabled"}
    assert not set(vendor["after"]) - set(vendor["before"])
    assert only(vendor["again"])["kind"] == "nothing taken"


def test_limits_of_colour_come_from_the_robots_camera_into_its_configuration(session):
    told = session["threshold"]
    assert told["code"] == 0 and told["separable"] and len(told["pictures"]) == 2
    # Where the disc was drawn.
    assert told["pictures"][0]["ball_px"] == pytest.approx([100, 90, 30], abs=2)
    lines = told["config"].splitlines()
    assert all(f"{key} = {value}" in lines for key, value in told["box"].items())


def test_two_robots_of_one_number_are_refused(session):
    assert session["same_number"]["code"] == 1
    assert "would both be robot 3" in session["same_number"]["complaint"]


def test_nothing_is_left_behind(session):
    assert session["left_in_tmp"] == []


@pytest.mark.parametrize(
    ("text", "host", "robot_id"),
    [
        ("robot03.local", "robot03.local", 3),
        ("pi@turbopi-12", "pi@turbopi-12", 12),
        ("192.168.9.103=3", "192.168.9.103", 3),
        ("pi4-robot07.lan", "pi4-robot07.lan", 7),
    ],
)
def test_number_is_the_last_in_the_first_name(text, host, robot_id):
    target = parse_target(text)
    assert (target.host, target.robot_id) == (host, robot_id)


@pytest.mark.parametrize("text", ["192.168.9.103", "robot", "a=100", "a=x", "=3", "-oProxy=1"])
def test_host_without_a_number_is_refused(text):
    with pytest.raises(ValueError, match="which robot"):
        parse_target(text)


def test_changed_host_key_is_named():
    said = "@@@ WARNING @@@\nHost key verification failed."  # OpenSSH's words
    assert _ssh_failure(said).kind == "host key"
