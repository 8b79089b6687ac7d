# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot threshold`: the green that a robot looks for, from pictures of its own camera."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.done import decide
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
    from twinmill.threshold.box import (
        COLOURS,
        KEYS,
        Ball,
        Fitted,
        PictureResult,
        ball_pixels,
        evaluate,
        find_ball,
        fit_box,
        overlap,
    )
    from twinmill.threshold.pictures import Picture
    from twinmill.threshold.show import draw

DEFAULT_MIN_BLOB_PX = 300  # of the robot's program
MOST_BITS = 4


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("threshold")(_threshold)


def _threshold(
    *,
    images: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[IMAGE...]",
            help="PNG, JPEG, or raw YUYV frames (*.yuyv); red=IMAGE: of that ball.",
        ),
    ] = None,
    camera: Annotated[
        str,
        typer.Option(
            "--camera", metavar="DEVICE", help="Use a camera of this machine: /dev/video0."
        ),
    ] = "",
    robot: Annotated[
        str,
        typer.Option(
            "--robot", metavar="HOST", help="Use a robot's camera, by ssh; the robot stops for it."
        ),
    ] = "",
    ball: Annotated[
        list[str] | None,
        typer.Option(
            "--ball", metavar="X,Y,R", help="Where the ball is, in pixels: once, or per picture."
        ),
    ] = None,
    size: Annotated[str, typer.Option("--size", help="Size of raw frames.")] = "640x480",
    count: Annotated[
        int, typer.Option("--count", min=1, max=100, help="Number of live frames.")
    ] = 10,
    min_blob_px: Annotated[
        int,
        typer.Option(
            "--min-blob-px", min=0, help="Smallest blob, as in the robot's configuration."
        ),
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
    """Find the colour limits that select the green ball, and nothing else.

    Pictures from different places and lights make better limits. Whether they
    do is judged by the robot's own threshold and blob code. Nothing is written
    if ball and background cannot be told apart.

    With pictures of several colours, as red=c.png, the first is the robot's
    bit 1, the next its bit 2, and so on; colours that overlap are named.

    Example: twinmill robot threshold a.png b.png --picture seen.png --config turbopi.conf
    """
    if [bool(images), bool(camera), bool(robot)].count(True) != 1:
        raise ValueError("threshold: give pictures, or --camera, or --robot: one of them.")
    if write and not robot:
        raise ValueError("--write needs --robot: whose configuration is it?")
    colours, paths = _named(images or [])
    if picture:
        check_new_file(picture, force, [*paths, config])
    size_px = _parse_size(size)
    remote = Remote(robot, ssh_config) if robot else None
    with busy("looking"):
        taken = _take(paths, camera, remote, count, size_px=size_px)
        colours = colours or ["green"] * len(taken)
        balls = _balls(taken, colours, ball or [])
        found = _fit(taken, colours, balls, min_blob_px)
        before = [evaluate(*both, native.green_box()) for both in zip(taken, balls, strict=True)]
        results = {name: iter(fitted.results) for name, fitted in found.items()}
        after = [next(results[name]) for name in colours]
        if picture:
            draw(picture, taken, balls, before=before, after=after)
    settings = _settings(found)
    good = not _problem(found)
    if good and config:
        write_settings(config, settings)
    if good and write and remote:
        remote.run("configure", *(f"{key}={value}" for key, value in settings.items()))
        remote.run("restart")
        decide(0)
    _tell(taken, balls, found, before=before, after=after, as_json=as_json)
    return 0 if good else 1


def _named(images: list[str]) -> tuple[list[str], list[Path]]:
    """Colour and file of each picture; without any name all show the green ball."""
    pairs = [("green", image) if Path(image).exists() else _pair(image) for image in images]
    return [name for name, _ in pairs], [Path(path) for _, path in pairs]


def _pair(image: str) -> tuple[str, str]:
    name, equals, path = image.partition("=")
    if not equals:
        return "green", image
    if name not in COLOURS:
        raise ValueError(f"{image}: '{name}' must be one of {', '.join(COLOURS)}.")
    return name, path


def _fit(
    pictures: list[Picture], colours: list[str], balls: list[Ball], min_blob_px: int
) -> dict[str, Fitted]:
    """Limits of each colour, in the order of the pictures; those of the others are kept out."""
    groups = {
        name: [k for k, other in enumerate(colours) if other == name]
        for name in dict.fromkeys(colours)
    }
    if len(groups) > MOST_BITS:
        raise ValueError(f"{len(groups)} colours: a robot looks for at most {MOST_BITS}.")

    def of(rows: list[int]) -> tuple[list[Picture], list[Ball]]:
        return [pictures[k] for k in rows], [balls[k] for k in rows]

    found = {}
    for name, rows in groups.items():
        rest = [k for k in range(len(pictures)) if k not in rows]
        others = ball_pixels(*of(rest)) if rest else None
        found[name] = fit_box(*of(rows), min_blob_px, others=others)
    return found


def _problem(found: dict[str, Fitted]) -> str:
    """Reason why the limits cannot be used; empty if they can."""
    problems = [fitted.problem for fitted in found.values() if fitted.problem]
    problems += [
        f"{a} and {b} overlap: a robot would take one for the other" for a, b in _overlaps(found)
    ]
    return "; ".join(problems)


def _overlaps(found: dict[str, Fitted]) -> list[tuple[str, str]]:
    return [
        (a, b) for a, b in itertools.combinations(found, 2) if overlap(found[a].box, found[b].box)
    ]


def _settings(found: dict[str, Fitted]) -> dict[str, int | str]:
    """Keys of the robot's configuration: the first colour's limits, then bits of the others."""
    first, *others = (fitted.box for fitted in found.values())
    settings: dict[str, int | str] = dict(zip(KEYS, first, strict=True))
    for number, box in enumerate(others, 2):
        settings[f"bit{number}"] = ",".join(["all", *map(str, box)])
    return settings


def _parse_size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]+)x([0-9]+)", text)
    if not found or int(found[1]) % 2 or 0 in (int(found[1]), int(found[2])):
        raise ValueError(f"--size {text}: must be WIDTHxHEIGHT with an even width, as 640x480.")
    return int(found[1]), int(found[2])


def _take(
    images: list[Path], camera: str, remote: Remote | None, count: int, *, size_px: tuple[int, int]
) -> list[Picture]:
    if images:
        return source.read_pictures(images, size_px)
    if remote:
        return source.from_robot(remote, count, size_px)
    return source.from_camera(camera, count, size_px)


def _balls(pictures: list[Picture], colours: list[str], given: list[str]) -> list[Ball]:
    if not given:
        return [find_ball(*both) for both in zip(pictures, colours, strict=True)]
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


def write_settings(path: Path, settings: dict[str, int | str]) -> None:
    """Sets keys of a configuration file; all other lines stay as they are."""
    lines = path.read_text().splitlines() if path.exists() else []
    kept = [line for line in lines if line.partition("=")[0].strip() not in settings]
    kept += [f"{key} = {value}" for key, value in settings.items()]
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o644
    with replacing(path, force=True, mode=mode) as new:
        new.write_text("\n".join(kept) + "\n")


def _tell(
    pictures: list[Picture],
    balls: list[Ball],
    found: dict[str, Fitted],
    *,
    before: list[PictureResult],
    after: list[PictureResult],
    as_json: bool,
) -> None:
    rows: list[dict[str, Any]] = [
        {
            "name": picture.name,
            "ball_px": [ball.x_px, ball.y_px, ball.radius_px],
            "hit_frac": now.hit_frac,
            "ball_blob_px": now.ball_blob_px,
            "false_px": now.false_px,
            "false_blob_px": now.false_blob_px,
            "false_px_before": old.false_px,
        }
        for picture, ball, now, old in zip(pictures, balls, after, before, strict=True)
    ]
    problem, settings = _problem(found), _settings(found)
    data = {
        "separable": not problem,
        "problem": problem or None,
        "box": {key: settings[key] for key in KEYS},
        "colours": {name: list(fitted.box) for name, fitted in found.items()},
        "overlaps": _overlaps(found),
        "settings": settings,
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
    options = " ".join(f"--set {key}={value}" for key, value in settings.items())
    words = f"Cannot be told apart: {problem}." if problem else options
    deliver(data, Group(Fitting(table), Text(words, "red" if problem else "")), as_json)
