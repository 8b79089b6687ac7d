# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot flash`: puts the robot's program on many robots at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import URL
from twinmill_cli.done import decide
from twinmill_cli.lazy import working
from twinmill_cli.options import LcmUrl, SshConfig
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from concurrent.futures import Future, ThreadPoolExecutor

    from rich import box
    from rich.console import Group
    from rich.progress import TaskID
    from rich.table import Table
    from rich.text import Text

    from twinmill.robots.fleet import Fleet
    from twinmill.robots.key import load_or_make
    from twinmill.robots.package import Packages, read_package
    from twinmill.robots.robot_update import (
        Outcome,
        Target,
        UpdateRequest,
        hand_back,
        parse_target,
        update,
    )
    from twinmill.swarm.behaviors import find_file, read_tables
    from twinmill.terminal import Fitting, progress_words

AT_ONCE = 16


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("flash")(_flash)


def _flash(
    hosts: Annotated[
        list[str],
        typer.Argument(
            metavar="HOST[=ID]",
            show_default=False,
            help="Robots by ssh name; ID: the number in the name, if not given.",
        ),
    ],
    *,
    behavior: Annotated[
        str, typer.Option("--behavior", "-b", help="Play it: milling, or one of behaviors.toml.")
    ] = "",
    behaviors: Annotated[
        Path | None,
        typer.Option(
            "--behaviors",
            metavar="FILE",
            help="Tables of your own, for `twinmill swarm` to name; default: behaviors.toml, if "
            "--behavior is in it.",
        ),
    ] = None,
    package: Annotated[
        Path | None, typer.Option("--package", metavar="DEB", help="This one; default: build it.")
    ] = None,
    setting: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="A key of its configuration; repeatable."),
    ] = None,
    rollback: Annotated[
        bool, typer.Option("--rollback", help="Go back to the package before, kept on the robot.")
    ] = False,
    take_over: Annotated[
        bool,
        typer.Option(
            "--take-over",
            help="Stop and disable other services that drive the robot, the vendor's.",
        ),
    ] = False,
    give_back: Annotated[
        bool,
        typer.Option("--hand-back", help="Undo --take-over: their services run again, ours not."),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Look at the robots, say what would be done.")
    ] = False,
    wait_s: Annotated[float, typer.Option("--wait-s", min=1, help="For telemetry.")] = 20.0,
    ssh_config: SshConfig = None,
    key: Annotated[
        Path | None,
        typer.Option(
            "--key",
            metavar="FILE",
            help="The operator's key; made if it is not there. Default: twinmill/swarm.key in "
            "~/.config.",
        ),
    ] = None,
    lcm_url: LcmUrl = URL,
    as_json: AsJson = False,
) -> int:
    """Install the robot's program on several robots at once, and check that each runs.

    Needs ssh with a key, and sudo without password, on Raspberry Pi OS (64 bit).
    Robots stop while they are updated, and stand after it. Exit code 1 if any
    failed; each says why.

    Example: twinmill robot flash robot03.local robot04.local --behavior milling
    """
    targets = [parse_target(host) for host in hosts]
    _refuse_twins(targets)
    settings = _parse_settings(setting or [])
    file = behaviors or find_file()
    tables = read_tables(file) if file and (behaviors or behavior) else {}
    if behavior:
        settings |= {"behavior": behavior, "table": tables.get(behavior, "")}
    if (rollback or give_back) and (settings or package or behaviors):
        raise ValueError(
            "--rollback and --hand-back change nothing else: give no --behavior, --behaviors, "
            "--set, --package."
        )
    if give_back and (rollback or take_over or dry_run):
        raise ValueError("--hand-back stands alone: give no --rollback, --take-over, --dry-run.")
    given = read_package(package) if package else None
    own_key = load_or_make(key)
    request = UpdateRequest(
        packages=None if rollback else Packages(given),
        settings=settings,
        behaviors=file if behaviors or behavior in tables else None,
        take_over=take_over,
        dry_run=dry_run,
        wait_s=wait_s,
        ssh_config=ssh_config,
        key=own_key,
    )
    if give_back:
        outcomes = [hand_back(target, ssh_config) for target in targets]
    else:
        outcomes = _update_all(targets, request, Fleet(lcm_url, key=own_key))
    data = {
        "ok": all(outcome.ok for outcome in outcomes),
        "dry_run": dry_run,
        "package": given.path.name if given else None,
        "robots": [outcome.to_json() for outcome in outcomes],
    }
    if not dry_run:
        decide(0 if data["ok"] else 1)
    deliver(data, _plans(outcomes) if dry_run else _table(outcomes), as_json)
    return 0 if data["ok"] else 1


def _refuse_twins(targets: list[Target]) -> None:
    """Two robots of one number would speak on the same channels."""
    for k, target in enumerate(targets):
        for other in targets[:k]:
            if target.robot_id == other.robot_id:
                raise ValueError(
                    f"{other.host} and {target.host} would both be robot {target.robot_id}; "
                    "write HOST=ID."
                )


def _parse_settings(pairs: list[str]) -> dict[str, str]:
    for pair in pairs:
        if "=" not in pair or not pair.partition("=")[0].isidentifier():
            raise ValueError(f"--set {pair}: must be KEY=VALUE; turbopi --print-config lists keys.")
    return dict(pair.split("=", 1) for pair in pairs)


def _update_all(targets: list[Target], request: UpdateRequest, fleet: Fleet) -> list[Outcome]:
    """All at once, one line of progress each on stderr, while this thread hears the bus."""
    with progress_words(transient=False) as progress, ThreadPoolExecutor(AT_ONCE) as pool:
        futures: list[Future[Outcome]] = []
        for target in targets:
            line = progress.add_task(f"{target.host}: waits", total=1)

            def say(step: str, line: TaskID = line, target: Target = target) -> None:
                progress.update(line, description=f"{target.host}: {step}")

            futures.append(pool.submit(update, target, request, fleet, say))
        while not all(future.done() for future in futures):
            fleet.listen(0.1)
        return [future.result() for future in futures]


def _plans(outcomes: list[Outcome]) -> Group:
    lines = []
    for outcome in outcomes:
        head = f"{outcome.target.host} (robot {outcome.target.robot_id})"
        words = [f"  would {step}" for step in outcome.would] or [f"  {outcome.sentence}"]
        lines.append(Text("\n".join([head, *words]), "" if outcome.ok else "red"))
    return Group(*lines)


def _table(outcomes: list[Outcome]) -> Group:
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("host", "robot", "result", "before", "version", "battery", "camera"):
        table.add_column(column)
    for outcome in outcomes:
        volts = outcome.battery_V
        table.add_row(
            outcome.target.host,
            f"R{outcome.target.robot_id:02d}",
            Text("ok", "green") if outcome.ok else Text(outcome.kind, "red"),
            outcome.before or "-",
            outcome.version or "-",
            f"{volts:.2f} V" if volts == volts else "-",
            outcome.camera or "-",
        )
    failed = [
        Text(f"{outcome.target.host}: {outcome.sentence}", "red")
        for outcome in outcomes
        if not outcome.ok
    ]
    return Group(Fitting(table), *failed)
