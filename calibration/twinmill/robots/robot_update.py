# SPDX-License-Identifier: Apache-2.0
"""One robot gets the program: checked, copied, installed, configured, restarted, heard."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import NamedTemporaryFile

from twinmill.arguments import option
from twinmill.robots.fleet import Fleet
from twinmill.robots.key import of_robot
from twinmill.robots.package import Package, Packages
from twinmill.robots.remote import Remote, RemoteError

INSTALL_S = 300
CAMERA_S = 5.0  # from the first telemetry until a camera must have opened


@dataclass(frozen=True)
class Target:
    """A host and the number of the robot that it is."""

    host: str
    robot_id: int


def parse_target(text: str) -> Target:
    """Reads HOST or HOST=ID; without ID, the last number in the host's first name.

    Raises:
        ValueError: there is no number in 0..99.
    """
    host, _, number = text.partition("=")
    if not number:
        name = host.rpartition("@")[2].partition(".")[0]
        found = re.findall(r"[0-9]+", "" if name.isdigit() else name)
        number = found[-1] if found else ""
    if not re.fullmatch(r"[0-9]{1,2}", number) or host.startswith("-") or not host:
        raise ValueError(f"{text}: which robot is it? Write HOST=ID with an ID in 0..99.")
    return Target(host, int(number))


@dataclass(frozen=True)
class UpdateRequest:
    """Update that is asked for.

    Attributes:
        packages: to install from; None: go back to the package before.
        settings: of the configuration, KEY to value, besides the robot's number.
        behaviors: file of tables of the user's own to put there; None: leave what is there.
        take_over: stop and disable other services that drive the robot.
        dry_run: only look.
        wait_s: for telemetry.
        key: the operator's; the robot gets its own of it.
    """

    packages: Packages | None
    settings: dict[str, str]
    behaviors: Path | None
    take_over: bool
    dry_run: bool
    wait_s: float
    ssh_config: Path | None
    key: bytes


@dataclass
class Outcome:
    """Result for one robot: ok, or the kind of failure and a sentence."""

    target: Target
    ok: bool = False
    kind: str = ""
    sentence: str = ""
    before: str = ""
    version: str = ""
    battery_V: float = float("nan")
    camera: str = ""
    would: list[str] = field(default_factory=list)

    def to_json(self) -> dict:
        """As printed."""
        return {"host": self.target.host, "robot_id": self.target.robot_id} | {
            key: value for key, value in vars(self).items() if key != "target"
        }


def update(
    target: Target, request: UpdateRequest, fleet: Fleet, progress: Callable[[str], None]
) -> Outcome:
    """Does what is wished.

    Args:
        target: the robot.
        request: what to do.
        fleet: somebody else listens to it meanwhile.
        progress: told the step that begins.
    """
    outcome = Outcome(target)
    try:
        _update(target, request, fleet, progress, outcome=outcome)
        outcome.ok = True
    except RemoteError as error:
        outcome.kind, outcome.sentence = error.kind, str(error)
    progress("done" if outcome.ok else outcome.kind)
    return outcome


def hand_back(target: Target, ssh_config: Path | None) -> Outcome:
    """Gives the robot back to the services that had it before `take_over`."""
    outcome = Outcome(target)
    try:
        Remote(target.host, ssh_config).run("hand_back")
        outcome.ok = True
    except RemoteError as error:
        outcome.kind, outcome.sentence = error.kind, str(error)
    return outcome


def _update(
    target: Target,
    request: UpdateRequest,
    fleet: Fleet,
    progress: Callable[[str], None],
    *,
    outcome: Outcome,
) -> None:
    remote = Remote(target.host, request.ssh_config)
    progress("looking")
    found = remote.run("probe")
    outcome.before = found.get("installed", "")
    package = _choose(request, found, progress)
    settings = {"robot_id": str(target.robot_id), **request.settings}
    if request.dry_run:
        outcome.would = _plan(request, package, found, settings)
        return
    if found.get("others"):
        progress("taking over")
        remote.run("take_over")
    if package is None:
        progress("going back")
        remote.run("rollback", timeout_s=INSTALL_S)
    else:
        progress("copying")
        upload = _upload(remote, package.path)
        progress("installing")
        remote.run("install", upload, timeout_s=INSTALL_S)
        progress("configuring")
        if request.behaviors:
            remote.run("behaviors", _upload(remote, request.behaviors))
        _bring_key(remote, of_robot(request.key, target.robot_id))
        remote.run("configure", *(f"{key}={value}" for key, value in settings.items()))
    progress("restarting")
    stopped_us = int(remote.run("restart")["stopped_us"])
    progress("waiting for telemetry")
    version = package.version if package else found["previous"]
    _hear(target, version, stopped_us, request.wait_s, fleet=fleet, outcome=outcome)


def _choose(
    request: UpdateRequest, found: dict[str, str], progress: Callable[[str], None]
) -> Package | None:
    """The package for a robot; None: the one before. All that can be refused is refused here."""
    if found.get("others") and not request.take_over:
        raise RemoteError(
            "in use",
            f"these services of it drive the robot: {found['others']}. Give "
            f"{option('take_over', True)} to stop "
            f"and disable them; {option('hand_back', True)} undoes that.",
        )
    if request.packages is None:
        if "previous" not in found:
            raise RemoteError(
                "no previous", f"no package before is kept on it: give {option('package')} FILE."
            )
        return None
    try:
        package = request.packages.for_release(found["release"], progress)
    except ValueError as error:
        raise RemoteError("no package", str(error)) from error
    if package.architecture != found["architecture"]:
        raise RemoteError(
            "wrong architecture",
            f"its system is {found['architecture']}, the package is for {package.architecture}: "
            "does its card have the 64-bit Raspberry Pi OS?",
        )
    if int(found["free_kb"]) < package.needed_kb:
        raise RemoteError(
            "no space",
            f"{found['free_kb']} KB are free on it, {package.needed_kb} KB are needed: remove "
            "something.",
        )
    return package


def _bring_key(remote: Remote, key: bytes) -> None:
    with NamedTemporaryFile() as file:  # nobody else may read it, here and there
        file.write(f"{key.hex()}\n".encode())
        file.flush()
        remote.run("key", _upload(remote, Path(file.name)))


def _upload(remote: Remote, path: Path) -> str:
    upload = remote.run("upload")["upload"]
    remote.copy(path, upload)
    return upload


def _plan(
    request: UpdateRequest, package: Package | None, found: dict[str, str], settings: dict[str, str]
) -> list[str]:
    before = found.get("installed") or "nothing"
    others = [f"stop and disable {name}" for name in found.get("others", "").split()]
    if package is None:
        return [
            *others,
            f"go back from {before} to {found['previous']}",
            "restart twinmill-robot.service",
        ]
    changed = ", ".join(f"{key} = {value}" for key, value in settings.items())
    return [
        *others,
        f"copy {package.path.name}, {package.path.stat().st_size // 1024} KB",
        f"install {package.version} over {before}",
        *([f"put {request.behaviors} there"] if request.behaviors else []),
        "bring it its key",
        f"set {changed}",
        "restart twinmill-robot.service and wait for telemetry",
    ]


def _hear(
    target: Target,
    version: str,
    since_us: int,
    wait_s: float,
    *,
    fleet: Fleet,
    outcome: Outcome,
) -> None:
    def heard() -> bool:
        robot = fleet.robots.get(target.robot_id)
        said = [robot.telemetry, robot.run] if robot else [None]
        return all(message and message.utime_us > since_us for message in said)

    if not _wait(heard, wait_s):
        raise RemoteError(
            "no telemetry",
            f"runs, but R{target.robot_id:02d} was not heard in {wait_s:g} s: is lcm_url in its "
            "configuration this network's, with ttl=1?",
        )
    robot = fleet.robots[target.robot_id]
    _wait(lambda: robot.camera not in ("lost", "no frames"), CAMERA_S)
    outcome.version, outcome.camera = robot.run.version, robot.camera
    outcome.battery_V = robot.telemetry.battery_V
    if not version.startswith(outcome.version):
        raise RemoteError(
            "other version",
            f"installed {version}, but R{target.robot_id:02d} says {outcome.version}: has another "
            "robot the same number?",
        )
    if robot.is_double:
        hosts = ", ".join(robot.hosts)
        raise RemoteError("two robots", f"two robots say that they are this one: {hosts}.")
    if not _wait(lambda: robot.link is not None, CAMERA_S):
        raise RemoteError("not signed", "runs, but does not sign with the key that it was brought.")
    if robot.camera in ("lost", "no frames"):
        raise RemoteError("no camera", "runs, but its camera gives no pictures: is it plugged in?")


def _wait(condition: Callable[[], bool], timeout_s: float) -> bool:
    end_s = time.monotonic() + timeout_s
    while not (met := condition()) and time.monotonic() < end_s:
        time.sleep(0.05)
    return met
