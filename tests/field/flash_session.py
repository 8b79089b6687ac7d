# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot flash` on pretended robots, in every way that it can end.

Usage: flash_session.py FOLDER, in a network and with mounts of its own, with TURBOPI set. Prints
what happened as JSON.
"""

import json
import multiprocessing
import os
import re
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from found_swarm import BITS, find_mill, metrics_of, swarm_words
from ssh_robots import SshRobot, make_package

from twinmill.threshold.pictures import from_rgb
from twinmill_cli import main as cli


def let_in(folder: Path) -> Path:
    """Makes a key pair, and gives root a home folder with it: the server looks nowhere else."""
    key, home = folder / "key", folder / "home"
    (home / ".ssh").mkdir(parents=True, mode=0o700)
    home.chmod(0o700)
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key], check=True)
    (home / ".ssh/authorized_keys").write_text(key.with_suffix(".pub").read_text())
    (home / ".ssh/authorized_keys").chmod(0o600)
    users = Path("/etc/passwd").read_text()
    users = re.sub(r"^root:.*$", f"root:x:0:0:root:{home}:/bin/sh", users, flags=re.MULTILINE)
    (folder / "passwd").write_text(users)
    subprocess.run(["mount", "--bind", folder / "passwd", "/etc/passwd"], check=True)
    (folder / "shells").write_text("/bin/sh\n")
    if Path("/etc/shells").exists():
        subprocess.run(["mount", "--bind", folder / "shells", "/etc/shells"], check=True)
    return key


class Flasher:
    """Runs the command as a user would, with this session's ssh configuration."""

    def __init__(self, config: Path):
        self._config = config

    def run(self, *arguments: str) -> dict:
        """Its exit code, its JSON, and what it complained of."""
        said, complaint = StringIO(), StringIO()
        with redirect_stdout(said), redirect_stderr(complaint):
            try:
                options = ("--json", "--ssh-config", str(self._config), "--wait-s", "4")
                options += ("--key", str(self._config.with_name("operator.key")))
                code = cli.run(["flash", *options, *map(str, arguments)])
            except ValueError as error:
                return {"code": 1, "complaint": str(error), "robots": []}
        return {"code": code, "complaint": complaint.getvalue(), **json.loads(said.getvalue())}


def failures(flash: Flasher, robot: SshRobot, package: Path) -> dict:
    """Each way to fail, one after the other, on one robot."""
    run = {}
    host = robot.name

    def attempt(name: str, broken: dict, healthy: dict) -> None:
        robot.write(**broken)
        run[name] = flash.run(host, "--package", package)
        for key in broken.keys() - healthy.keys():
            (robot.folder / key).unlink()
        robot.write(**healthy)

    attempt("wrong architecture", {"architecture": "arm64"}, {"architecture": "amd64"})
    attempt("no permission", {"uid": "1000"}, {"uid": "0"})
    attempt("no space", {"free_kb": "100"}, {"free_kb": "500000"})
    attempt("not installable", {"apt_fails": ""}, {})
    attempt("no package", {"system/etc/os-release": 'VERSION_ID="11"\n'},
            {"system/etc/os-release": 'VERSION_ID="12"\n'})  # fmt: skip
    attempt("service dies", {"dies": ""}, {})
    before = robot.config.read_text()
    run["bad configuration"] = flash.run(host, "--package", package, "--behavior", "dance")
    run["config kept"] = robot.config.read_text() == before
    robot.config.write_text(re.sub("camera.*", 'camera = "/dev/no-video"', before))
    run["no camera"] = flash.run(host, "--package", package)
    robot.config.write_text(re.sub("lcm_url.*", 'lcm_url = ""', before))
    run["no telemetry"] = flash.run(host, "--package", package)
    robot.config.write_text(before)
    run["no dpkg package"] = flash.run(host, "--package", "/etc/passwd")
    return run


def beside(work, *arguments):
    """Does something in a process of its own. Returns what waits for its result."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    context.Process(target=lambda: there.send(work(*arguments)), daemon=True).start()
    there.close()
    return here.recv


def threshold(robot: SshRobot, config: Path) -> dict:
    """Limits from frames of the robot's camera, put into its configuration."""
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    rgb = np.where(
        ((x - 100) ** 2 + (y - 90) ** 2 < 900)[..., None], (40, 170, 60), (128, 120, 125)
    )
    noise = np.random.default_rng(1).normal(0, 3, (2, *rgb.shape))
    frames = [from_rgb("", np.clip(rgb + n, 0, 255)).yuyv.tobytes() for n in noise]
    (robot.folder / "camera.yuyv").write_bytes(b"".join(frames))
    said = StringIO()
    arguments = ["--robot", robot.name, "--size", "320x240", "--write", "--json"]
    with redirect_stdout(said):
        code = cli.run(["threshold", *arguments, "--ssh-config", str(config)])
    return {"code": code, **json.loads(said.getvalue()), "config": robot.config.read_text()}


def vendor(flash: Flasher, robot: SshRobot, package: Path) -> dict:
    """A robot on which the vendor's program runs, and what must not be stopped."""
    robot.add_service("turbopi.service", "/usr/bin/python3 /home/pi/TurboPi/TurboPi.py")
    robot.add_service("hw_wifi.service", "/usr/bin/python3 /home/pi/hiwonder-toolbox/hw_wifi.py")
    before = robot.services()
    refused = flash.run(robot.name, "--package", package)
    untouched = robot.services() == before
    taken = flash.run(robot.name, "--package", package, "--take-over")
    during = robot.services()
    back = flash.run(robot.name, "--hand-back")
    after = robot.services()
    for state in ("active", "enabled"):
        (robot.folder / "units" / f"turbopi.service.{state}").unlink()
    return {"refused": refused, "untouched": untouched, "taken": taken, "during": during,
            "back": back, "before": before, "after": after,
            "again": flash.run(robot.name, "--hand-back")}  # fmt: skip


def own_tables(flash: Flasher, robot: SshRobot, folder: Path, package: Path) -> dict:
    """A table of the user's own is put on a robot; then a file that holds none."""
    good, bad = folder / "own.toml", folder / "bad.toml"
    good.write_text('ahead = "0,0.5,100,0"\nspin = "0,2,0,2"\n')
    bad.write_text('ahead = "0,0.5,101,0"\n')
    arguments = ("robot04", "--package", package, "--behaviors")
    there = robot.folder / "system/etc/turbopi/behaviors.toml"
    put = flash.run(*arguments, good, "--behavior", "spin")
    refused = flash.run(*arguments, bad)
    return {"put": put, "bad": refused, "config": robot.config.read_text(),
            "same": there.read_text() == good.read_text()}  # fmt: skip


def found_mill(flash: Flasher, robot: SshRobot, folder: Path, package: Path) -> dict:
    """A mill of two bits that was found is put on a robot; that robot's program drives the twin."""
    found, name = find_mill(folder)
    bits = [word for k, sector in enumerate(BITS) for word in ("--set", f"bit{k + 1}={sector}")]
    put = flash.run(robot.name, "--package", package, "--behaviors", found / "behaviors.toml",
                    "--behavior", name, *bits)  # fmt: skip
    system, log = robot.folder / "system", folder / "mill.lcmlog"
    words = swarm_words(found, name, system / "etc/turbopi/behaviors.toml")
    words += ("--hil", "1", "--firmware", str(system / "usr/bin/turbopi"))
    twin = [os.environ["TWIN_RUN"], *words, "--duration-s", "24", "--log", log]
    subprocess.run(twin, check=True, capture_output=True)
    said = metrics_of(log, found)
    return {"put": put, "config": robot.config.read_text(), "class": said["class"],
            "bits": said["bits"]}  # fmt: skip


def main(folder: Path) -> dict:
    program = Path(os.environ["TURBOPI"])
    key = let_in(folder)
    version = subprocess.run(
        [program, "--version"], capture_output=True, text=True, check=True
    ).stdout.split()[1]
    old = make_package(folder, program, f"{version}-1~deb12", "amd64")
    new = make_package(folder, program, f"{version}-2~deb12", "amd64")
    robots = [SshRobot(folder, f"robot0{i}", 2200 + i, key) for i in (3, 4, 5)]
    config = folder / "ssh_config"
    other_key = folder / "other"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", other_key], check=True)
    config.write_text(
        "".join(robot.ssh_config for robot in robots)
        + "Host robot09\n  HostName 127.0.0.1\n  Port 2209\n"
        + robots[0].ssh_config.replace("robot03", "robot08").replace(str(key), str(other_key))
    )
    flash, result, both = Flasher(config), {"version": version}, ("robot03", "robot04")
    try:
        failed = beside(failures, flash, robots[2], new)
        result["dry_run"] = flash.run(*both, "--package", old, "--dry-run", "-b", "diffusing")
        result["touched_by_dry_run"] = (robots[0].folder / "system/usr/bin/turbopi").exists()
        result["first"] = flash.run(*both, "--package", old, "--behavior", "diffusing")
        result["configs"] = [robot.config.read_text() for robot in robots[:2]]
        result["no_previous"] = flash.run("robot03", "--rollback")
        result["second"] = flash.run(*both, "--package", new)
        result["vendor"] = vendor(flash, robots[1], new)
        result["own"] = own_tables(flash, robots[1], folder, new)
        result["found"] = found_mill(flash, robots[1], folder, new)
        result["installed"] = [(robot.folder / "installed").read_text().strip() for robot in robots]
        result["rollback"] = flash.run("robot03", "--rollback")
        result["back_to"] = (robots[0].folder / "installed").read_text().strip()
        result["mixed"] = flash.run("robot03", "robot09", "robot08", "nobody7.invalid",
                                    "--package", new)  # fmt: skip
        result["failures"] = failed()
        result["threshold"] = threshold(robots[1], config)
        result["same_number"] = flash.run("robot03", "robot04=3", "--package", new)
        result["left_in_tmp"] = sorted(path.name for path in Path("/tmp").glob("turbopi.??????"))
    finally:
        for robot in robots:
            robot.end()
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
