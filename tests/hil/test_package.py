# SPDX-License-Identifier: Apache-2.0
"""The package in a Debian with systemd: what a user installs, starts, kills and removes."""

import pytest
from rig import ZERO
from robot import HEIGHT_PX, LEFT, WIDTH_PX, Watched

# systemd is slow in an emulator; without it nothing would stop the motors at all.
STOP_LIMIT_S = 10.0
SETTINGS = {
    "gpio_chip": "/dev/gpiochip1",
    "width_px": WIDTH_PX,
    "height_px": HEIGHT_PX,
    # So that it is no missing frame that stops the motors.
    "frame_timeout_ms": 10000,
}
COMMAND_LIMIT_S = 120


def run(system, *command):
    """Runs a program that must succeed. Returns when it ended (guest, s)."""
    end = system.run(*command, limit_s=COMMAND_LIMIT_S)
    assert end.code == 0, command
    return end.t_s


def systemctl(system, *words):
    return run(system, "/bin/systemctl", *words)


@pytest.fixture(scope="module")
def installed(system):
    systemctl(system, "is-system-running", "--wait")
    # What it depends on is unpacked, but dpkg has not been told.
    run(system, "/usr/bin/dpkg", "--force-depends", "-i", "/turbopi.deb")
    lines = "".join(f"{key} = {value}\\n" for key, value in SETTINGS.items())
    run(system, "/bin/sh", "-c", f"printf '{lines}' >> /etc/turbopi/turbopi.conf")
    return system


@pytest.fixture
def driving(installed):
    """The service, driving since somebody pressed the button."""
    robot = Watched(installed)
    systemctl(installed, "restart", "turbopi")
    robot.show_until(lambda: any(t.frame_utime_us for t in robot.telemetry()))
    robot.press()
    robot.drive_until(LEFT)
    return robot


def wait_for_zero(robot, since_s):
    robot.rig.wait(lambda: robot.wire() == ZERO, COMMAND_LIMIT_S, "zero")
    return robot.stopped_s(since_s) - since_s


def test_service_drives_as_its_own_user(driving):
    users = "test $(stat -c %U /proc/$(systemctl show -P MainPID turbopi)) = turbopi"
    run(driving.rig, "/bin/sh", "-c", users)


def test_stopping_the_service_stops_the_motors(driving):
    begin_s = driving.since(0)[-1].t_s
    systemctl(driving.rig, "stop", "turbopi")
    assert wait_for_zero(driving, begin_s) < STOP_LIMIT_S


def test_killing_all_of_the_service_stops_the_motors_and_starts_it_again(driving):
    before_s = driving.since(0)[-1].t_s
    systemctl(driving.rig, "kill", "-s", "KILL", "turbopi")
    assert wait_for_zero(driving, before_s) < STOP_LIMIT_S
    driving.rig.wait(
        lambda: driving.rig.run("/bin/systemctl", "is-active", "turbopi").code == 0,
        COMMAND_LIMIT_S,
        "the service",
    )
    assert driving.wire() == ZERO


def test_removing_the_package_stops_the_motors(driving):
    begin_s = driving.since(0)[-1].t_s
    run(driving.rig, "/usr/bin/dpkg", "-r", "turbopi")
    assert wait_for_zero(driving, begin_s) < STOP_LIMIT_S
    assert driving.rig.run("/bin/systemctl", "is-active", "turbopi").code != 0
