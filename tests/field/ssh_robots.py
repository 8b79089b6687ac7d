# SPDX-License-Identifier: Apache-2.0
"""Robots to flash: a real ssh server each, and below it a pretended Debian with the real program.

Each robot is a folder: `system` is its file system (robot.sh's TURBOPI_ROOT), `bin` has stand-ins
for what would change this machine. The package is unpacked by the real dpkg-deb, and the service is
the program that it brought.
"""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

STUBS = {
    "id": 'cat "$ROBOT/uid"',
    "sudo": "echo 'sudo: a password is required' >&2; exit 1",
    "dpkg": """
case $1 in
    --print-architecture) cat "$ROBOT/architecture" ;;
    --audit) ;;
    --purge | --remove) : >"$ROBOT/installed" ;;
    *)  for package; do :; done
        conf=$ROBOT/system/etc/turbopi/turbopi.conf
        cp -a "$conf" "$ROBOT/kept.conf"
        dpkg-deb --extract "$package" "$ROBOT/system"
        mv "$ROBOT/kept.conf" "$conf"
        dpkg-deb --field "$package" Version >"$ROBOT/installed" ;;
esac""",
    "apt-get": """
for last; do :; done
[ "$last" != update ] || exit 0
if [ -e "$ROBOT/apt_fails" ]; then
    echo " turbopi : Depends: liblcm1 but it is not installable"
    echo "E: Unable to correct problems, you have held broken packages."
    exit 100
fi
case "$*" in *--simulate*) ;; *) dpkg --install "$last" ;; esac""",
    "dpkg-query": """
case "$*" in *Architecture*) exit 0 ;; esac
[ ! -s "$ROBOT/installed" ] || echo "installed $(cat "$ROBOT/installed")" """,
    "df": 'echo "header"; echo "disk 1000000 1 $(cat "$ROBOT/free_kb") 1% /"',
    "systemctl": """
units=$ROBOT/units
for name; do :; done
case $1 in
    --quiet) [ -e "$units/$name.${2#is-}" ] ;;
    enable) : >"$units/$name.enabled" ;;
    disable) rm -f "$units/$name.enabled" "$units/$name.active" ;;
    start)
        [ "$name" = twinmill-robot.service ] || { : >"$units/$name.active" && exit 0; }
        [ -e "$ROBOT/dies" ] && exit 0
        turbopi --config "$ROBOT/system/etc/turbopi/turbopi.conf" >"$ROBOT/journal" 2>&1 &
        echo $! >"$ROBOT/pid" ;;
    stop) kill "$(cat "$ROBOT/pid")" 2>/dev/null ;;
    is-active) kill -0 "$(cat "$ROBOT/pid" 2>/dev/null || echo none)" 2>/dev/null ;;
esac""",
    "v4l2-ctl": 'cat "$ROBOT/camera.yuyv"',
    "journalctl": 'echo "turbopi: cannot do it"',
}
SETTINGS = """\
robot_id = 0
behavior = milling
camera = "stub:{folder}/frames.yuyv"
board = stub
panel = none
width_px = 64
height_px = 48
lcm_url = "udpm://239.255.76.67:7667?ttl=0"
key_file = "{folder}/system/etc/turbopi/key"
run_dir = ""
"""


def make_package(folder: Path, program: Path, version: str, architecture: str) -> Path:
    """A Debian package of this machine's program."""
    staged = folder / f"staged-{version}-{architecture}"
    for path in ("usr/bin", "etc/turbopi", "DEBIAN"):
        (staged / path).mkdir(parents=True)
    shutil.copy(program, staged / "usr/bin/turbopi")
    (staged / "etc/turbopi/turbopi.conf").write_text("robot_id = 0\nbehavior = milling\n")
    (staged / "DEBIAN/control").write_text(
        f"Package: turbopi\nVersion: {version}\nArchitecture: {architecture}\n"
        "Maintainer: nobody <nobody@example.invalid>\nInstalled-Size: 300\nDescription: test\n"
    )
    path = folder / f"turbopi_{version}_{architecture}.deb"
    subprocess.run(["dpkg-deb", "--build", "-Znone", staged, path], check=True, capture_output=True)
    return path


class SshRobot:
    """One robot with its ssh server."""

    def __init__(self, folder: Path, name: str, port: int, key: Path):
        self.folder, self.name, self.port = folder / name, name, port
        system = ("var/lib", "usr/bin", "etc/turbopi", "etc/systemd/system")
        for path in ("bin", "units", *(f"system/{path}" for path in system)):
            (self.folder / path).mkdir(parents=True)
        (self.folder / "system/etc/os-release").write_text('VERSION_ID="12"\n')
        for stub, text in STUBS.items():
            path = self.folder / "bin" / stub
            path.write_text(f"#!/bin/sh\n{text}\n")
            path.chmod(0o755)
        self.write(uid="0", architecture="amd64", free_kb="500000", installed="")
        grey = bytes([126, 128, 126, 128]) * (64 * 48 // 2)
        (self.folder / "frames.yuyv").write_bytes(grey * 3000)
        self.config.write_text(SETTINGS.format(folder=self.folder))
        host_key = self.folder / "host_key"
        subprocess.run(
            ["dropbearkey", "-t", "ed25519", "-f", host_key], check=True, capture_output=True
        )
        path = f"{self.folder}/bin:{self.folder}/system/usr/bin:{os.environ['PATH']}"
        forced = (
            f"env ROBOT={self.folder} TURBOPI_ROOT={self.folder}/system PATH={path} "
            'sh -c "$SSH_ORIGINAL_COMMAND"'
        )
        server = ["dropbear", "-F", "-e", "-s", "-p", f"127.0.0.1:{port}", "-r", str(host_key)]
        self.server = subprocess.Popen(
            [*server, "-P", str(self.folder / "ssh.pid"), "-c", forced], stderr=subprocess.DEVNULL
        )
        self.ssh_config = (
            f"Host {name}\n  HostName 127.0.0.1\n  Port {port}\n  User root\n"
            f"  IdentityFile {key}\n  IdentitiesOnly yes\n"
            "  StrictHostKeyChecking no\n  UserKnownHostsFile /dev/null\n  LogLevel ERROR\n"
        )

    @property
    def config(self) -> Path:
        return self.folder / "system/etc/turbopi/turbopi.conf"

    def write(self, **files: str) -> None:
        """Sets what the stand-ins answer."""
        for name, text in files.items():
            (self.folder / name).write_text(text)

    def add_service(self, name: str, command: str) -> None:
        """A service that runs and starts with the robot."""
        unit = self.folder / "system/etc/systemd/system" / name
        unit.write_text(f"[Service]\nExecStart={command}\n")
        for state in ("active", "enabled"):
            (self.folder / "units" / f"{name}.{state}").touch()

    def services(self) -> list[str]:
        """Which services run, and which start with the robot."""
        return sorted(path.name for path in (self.folder / "units").iterdir())

    def end(self) -> None:
        """Ends the server and the program."""
        self.server.terminate()
        if (self.folder / "pid").exists():
            try:
                os.kill(int((self.folder / "pid").read_text()), signal.SIGTERM)
            except ProcessLookupError:
                return
            time.sleep(0.3)
