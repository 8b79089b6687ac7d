# SPDX-License-Identifier: Apache-2.0
"""The package in a Debian with systemd: what a user installs, starts, kills and removes."""

import pytest
import turbopi
from rig import SYSTEM_LIMIT_S, ZERO
from robot import CONFIG, HEIGHT_PX, LEFT, SERVICE, WIDTH_PX, Watched

# systemd is slow in an emulator; without it nothing would stop the motors at all.
STOP_LIMIT_S = 10.0
SETTINGS = {
    # The module's own label.
    "gpio_chip": "hilboard",
    "width_px": WIDTH_PX,
    "height_px": HEIGHT_PX,
    # So that it is no missing frame that stops the motors.
    "frame_timeout_ms": 10000,
    "frozen_ms": 0,
}
# In tenths, of systemd's own examination: 0 is safest, 100 is no sandbox at all.
EXPOSURE_LIMIT = 20


def run(system, *command):
    """Runs a program that must succeed. Returns when it ended (guest, s)."""
    end = system.run(*command, limit_s=SYSTEM_LIMIT_S)
    assert end.code == 0, command
    return end.t_s


@pytest.fixture(scope="module")
def configured(installed):
    lines = "".join(f"{key} = {value}\\n" for key, value in SETTINGS.items())
    run(installed, "/bin/sh", "-c", f"printf '{lines}' >> {CONFIG}")
    return installed


@pytest.fixture
def driving(configured):
    """The service, driving since somebody pressed the button."""
    robot = Watched(configured)
    configured.systemctl("restart", SERVICE)
    robot.show_until(lambda: any(t.frame_utime_us for t in robot.telemetry()))
    robot.press()
    robot.drive_until(LEFT)
    return robot


def wait_for_zero(robot, since_s):
    robot.rig.wait(lambda: robot.wire() == ZERO, SYSTEM_LIMIT_S, "zero")
    return robot.stopped_s(since_s) - since_s


def test_service_drives_as_its_own_user(driving):
    users = "test $(stat -c %U /proc/$(systemctl show -P MainPID twinmill-robot)) = turbopi"
    run(driving.rig, "/bin/sh", "-c", users)


def test_stopping_the_service_stops_the_motors(driving):
    begin_s = driving.since(0)[-1].t_s
    driving.rig.systemctl("stop", SERVICE)
    assert wait_for_zero(driving, begin_s) < STOP_LIMIT_S


def test_reloading_the_service_stops_the_motors_and_keeps_it(driving):
    """The main process stays; its button starts the robot again."""
    begin_s = driving.since(0)[-1].t_s
    run(driving.rig, "/bin/sh", "-c", f"systemctl show -P MainPID {SERVICE} > /before")
    driving.rig.systemctl("reload", SERVICE)
    assert wait_for_zero(driving, begin_s) < STOP_LIMIT_S
    run(driving.rig, "/bin/sh", "-c", f"systemctl show -P MainPID {SERVICE} | cmp - /before")
    driving.show_until(lambda: driving.telemetry()[-1].mode == turbopi.telemetry_t.MODE_STOPPED)
    driving.press()
    driving.drive_until(LEFT)


def test_killing_all_of_the_service_stops_the_motors_and_starts_it_again(driving):
    before_s = driving.since(0)[-1].t_s
    driving.rig.systemctl("kill", "-s", "KILL", SERVICE)
    assert wait_for_zero(driving, before_s) < STOP_LIMIT_S
    driving.rig.wait(
        lambda: driving.rig.run("/bin/systemctl", "is-active", SERVICE).code == 0,
        SYSTEM_LIMIT_S,
        "the service",
    )
    assert driving.wire() == ZERO


def test_service_runs_in_a_sandbox_that_systemd_calls_safe(installed):
    run(installed, "/usr/bin/systemd-analyze", "security", f"--threshold={EXPOSURE_LIMIT}", SERVICE)


def test_wrong_configuration_is_told_once_not_tried_for_ever(installed):
    run(installed, "/bin/sh", "-c", f"cp {CONFIG} /kept; echo nonsense >> {CONFIG}")
    installed.run("/bin/systemctl", "restart", SERVICE, limit_s=SYSTEM_LIMIT_S)
    run(installed, "/bin/sh", "-c", f"sleep 3; systemctl is-failed {SERVICE}")
    run(installed, "/bin/sh", "-c", f"test $(systemctl show -P NRestarts {SERVICE}) = 0")
    run(installed, "/bin/sh", "-c", f"cp /kept {CONFIG}; systemctl reset-failed {SERVICE}")


def test_removing_the_package_stops_the_motors(driving):
    begin_s = driving.since(0)[-1].t_s
    run(driving.rig, "/usr/bin/dpkg", "-r", "turbopi")
    assert wait_for_zero(driving, begin_s) < STOP_LIMIT_S
    assert driving.rig.run("/bin/systemctl", "is-active", SERVICE).code != 0


def test_purging_leaves_nothing(installed):
    run(installed, "/usr/bin/dpkg", "--purge", "turbopi")
    wants = "/etc/systemd/system/multi-user.target.wants"
    run(
        installed,
        "/bin/sh",
        "-c",
        f"! ls {wants}/{SERVICE} /etc/turbopi /usr/lib/sysusers.d/twinmill*",
    )
