# SPDX-License-Identifier: Apache-2.0
"""`twinmill threshold`: the green that a robot looks for, from pictures of its own camera."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import SshConfig
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    import twinmill_native as native
    from rich import box as frame
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    from twinmill.files import check_new_file, replacing
    from twinmill.robots.remote import Remote
    from twinmill.terminal import Fitting
    from twinmill.threshold import pictures as source
    from twinmill.threshold.box import KEYS, Ball, Box, Fitted, evaluate, find_ball, fit_box
    from twinmill.threshold.pictures import Picture
    from twinmill.threshold.show import draw

DEFAULT_MIN_BLOB_PX = 300  # of the robot's program


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("threshold")(_threshold)


def _threshold(
    *,
    images: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[IMAGE...]", help="PNG, JPEG, or raw YUYV frames (*.yuyv)."),
    ] = None,
    camera: Annotated[
        str, typer.Option("--camera", metavar="DEVICE", help="Or a camera here: /dev/video0.")
    ] = "",
    robot: Annotated[
        str, typer.Option("--robot", metavar="HOST", help="Or a robot's, by ssh; it stops for it.")
    ] = "",
    ball: Annotated[
        list[str] | None,
        typer.Option(
            "--ball", metavar="X,Y,R", help="Where the ball is, in pixels: once, or per picture."
        ),
    ] = None,
    size: Annotated[str, typer.Option("--size", help="Of raw frames.")] = "640x480",
    count: Annotated[int, typer.Option("--count", min=1, max=100, help="Of live frames.")] = 10,
    min_blob_px: Annotated[
        int, typer.Option("--min-blob-px", min=0, help="As in the robot's configuration.")
    ] = DEFAULT_MIN_BLOB_PX,
    config: Annotated[
        Path | None, typer.Option("--config", metavar="FILE", help="Put the limits in there.")
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Put them in the robot's own configuration.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="PNG", help="Show before and after.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace PNG if it exists.")] = False,
    ssh_config: SshConfig = None,
    as_json: AsJson = False,
) -> int:
    """Find the limits of colour that hold the green ball, and nothing else.

    Pictures from different places and lights make better limits. Whether they
    do is judged by the robot's own threshold and blob code. Nothing is written
    if ball and background cannot be told apart.

    Example: twinmill threshold a.png b.png --picture seen.png --config turbopi.conf
    """
    if [bool(images), bool(camera), bool(robot)].count(True) != 1:
        raise ValueError("threshold: give pictures, or --camera, or --robot: one of them.")
    if write and not robot:
        raise ValueError("--write needs --robot: whose configuration is it?")
    if picture:
        check_new_file(picture, force, [*(images or []), config])
    size_px = _parse_size(size)
    remote = Remote(robot, ssh_config) if robot else None
    with busy("looking"):
        taken = _take(images or [], camera, remote, count, size_px=size_px)
        balls = _balls(taken, ball or [])
        fitted = fit_box(taken, balls, min_blob_px)
        before = [evaluate(*both, native.green_box()) for both in zip(taken, balls, strict=True)]
        if picture:
            draw(picture, taken, balls, before=before, after=fitted.results)
    settings = dict(zip(KEYS, fitted.box, strict=True))
    if not fitted.problem:
        if config:
            write_settings(config, settings)
        if write:
            remote.run("configure", *(f"{key}={value}" for key, value in settings.items()))
            remote.run("restart")
    _tell(taken, balls, fitted, before, as_json=as_json)
    return 1 if fitted.problem else 0


def _parse_size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)x(\d+)", text)
    if not found or int(found[1]) % 2 or 0 in (int(found[1]), int(found[2])):
        raise ValueError(f"--size {text}: must be WIDTHxHEIGHT with an even width, as 640x480.")
    return int(found[1]), int(found[2])


def _take(
    images: list[Path], camera: str, remote: Remote | None, count: int, *, size_px: tuple[int, int]
) -> list[Picture]:
    if images:
        return source.read_pictures(images, size_px)
    if camera:
        return source.from_camera(camera, count, size_px)
    return source.from_robot(remote, count, size_px)


def _balls(pictures: list[Picture], given: list[str]) -> list[Ball]:
    if not given:
        return [find_ball(picture) for picture in pictures]
    balls = [_parse_ball(text) for text in given]
    if len(balls) not in (1, len(pictures)):
        raise ValueError(f"--ball: {len(balls)} given for {len(pictures)} pictures: one, or each.")
    balls = balls * len(pictures) if len(balls) == 1 else balls
    for picture, ball in zip(pictures, balls, strict=True):
        height, width = picture.yuyv.shape[0], picture.yuyv.shape[1] // 2
        if not (0 <= ball.x_px < width and 0 <= ball.y_px < height):
            raise ValueError(f"{picture.name}: the ball is not in its {width}x{height} pixels.")
    return balls


def _parse_ball(text: str) -> Ball:
    try:
        ball = Ball(*map(float, text.split(",")))
    except (TypeError, ValueError):
        ball = Ball(0, 0, 0)
    if not 3 <= ball.radius_px < 2000:
        raise ValueError(f"--ball {text}: must be X,Y,R in pixels with R of at least 3.")
    return ball


def write_settings(path: Path, settings: dict[str, int]) -> None:
    """Sets keys of a configuration file; all other lines stay as they are."""
    lines = path.read_text().splitlines() if path.exists() else []
    kept = [line for line in lines if line.partition("=")[0].strip() not in settings]
    kept += [f"{key} = {value}" for key, value in settings.items()]
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o644
    with replacing(path, force=True, mode=mode) as new:
        new.write_text("\n".join(kept) + "\n")


def _tell(
    pictures: list[Picture], balls: list[Ball], fitted: Fitted, before: list, *, as_json: bool
) -> None:
    rows = [
        {
            "name": picture.name,
            "ball_px": [ball.x_px, ball.y_px, ball.radius_px],
            "hit_frac": after.hit_frac,
            "ball_blob_px": after.ball_blob_px,
            "false_px": after.false_px,
            "false_blob_px": after.false_blob_px,
            "false_px_before": old.false_px,
        }
        for picture, ball, after, old in zip(pictures, balls, fitted.results, before, strict=True)
    ]
    data = {
        "separable": not fitted.problem,
        "problem": fitted.problem or None,
        "box": dict(zip(KEYS, fitted.box, strict=True)),
        "pictures": rows,
    }
    table = Table(box=frame.SIMPLE_HEAD)
    for column in ("picture", "of the ball", "ball's blob", "largest false blob", "false pixels"):
        table.add_column(column, justify="left" if column == "picture" else "right")
    for row in rows:
        table.add_row(
            row["name"],
            f"{100 * row['hit_frac']:.0f} %",
            f"{row['ball_blob_px']} px",
            f"{row['false_blob_px']} px",
            f"{row['false_px']} (before {row['false_px_before']})",
        )
    words = f"Cannot be told apart: {fitted.problem}." if fitted.problem else _options(fitted.box)
    deliver(data, Group(Fitting(table), Text(words, "red" if fitted.problem else "")), as_json)


def _options(box: Box) -> str:
    return " ".join(f"--set {key}={value}" for key, value in zip(KEYS, box, strict=True))
