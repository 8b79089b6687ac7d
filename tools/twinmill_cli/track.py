# SPDX-License-Identifier: Apache-2.0
"""`twinmill track` and `track-calibrate`: poses from a film of tagged robots, and its lens."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import LcmUrl
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import numpy as np
    from rich import box as frame
    from rich.console import Console, Group
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
    from rich.table import Table
    from rich.text import Text

    from twinmill.data.bus import open_bus
    from twinmill.data.importers.plain import Columns, read_commands
    from twinmill.files import check_new_file
    from twinmill.track.align import align, shifted
    from twinmill.track.boards import Board
    from twinmill.track.camera import Camera, read_camera
    from twinmill.track.detect import ROBOTS, Detector, gather
    from twinmill.track.film import Film, LiveCamera
    from twinmill.track.floor import View, look, read_floor
    from twinmill.track.lens import Calibration, calibrate, pick_views
    from twinmill.track.live import find_view, publish
    from twinmill.track.paths import RobotPath, Tags, follow, write_poses
    from twinmill.track.quality import Quality, judge
    from twinmill_cli.numbers import parse_numbers

WHOLE = 0.98  # of the frames that a container promises; some count them wrongly by a few

Rate = Annotated[
    float | None,
    typer.Option("--rate-hz", help="The frames' rate, where the file's stamps are no good."),
]
ExposureMs = Annotated[
    float | None, typer.Option("--exposure-ms", min=0, max=1000, help="Of each row.")
]
LineDelayUs = Annotated[
    float | None,
    typer.Option("--line-delay-us", min=0, max=1000, help="Rolling shutter: from row to row."),
]
Force = Annotated[bool, typer.Option("--force", help="Replace what exists.")]


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    app.command("track", no_args_is_help=True)(_track)
    app.command("track-calibrate", no_args_is_help=True)(_calibrate)


def _track(
    lens: Annotated[
        Path,
        typer.Option("--lens", metavar="TOML", show_default=False, help="Of track-calibrate."),
    ],
    floor: Annotated[
        Path,
        typer.Option("--floor", metavar="TOML", show_default=False, help="Points on the floor."),
    ],
    height_m: Annotated[
        float,
        typer.Option("--height", metavar="M", show_default=False, help="Of the tags over it."),
    ],
    video: Annotated[Path | None, typer.Argument(metavar="[VIDEO]", show_default=False)] = None,
    camera: Annotated[
        str, typer.Option("--camera", metavar="DEVICE", help="Or live: 0, or /dev/video0.")
    ] = "",
    robots: Annotated[
        str, typer.Option("--robots", metavar="IDS", help="As 1-8,12; default: all seen.")
    ] = "",
    size_m: Annotated[
        float, typer.Option("--size", metavar="M", help="Side of the tags' black square.")
    ] = 0.10,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="CSV", help="The poses; default: VIDEO's name."),
    ] = None,
    rate_hz: Rate = None,
    exposure_ms: ExposureMs = None,
    line_delay_us: LineDelayUs = None,
    start_s: Annotated[
        float, typer.Option("--start-s", help="Stamp of the first frame on the other clock.")
    ] = 0.0,
    commands: Annotated[
        Path | None,
        typer.Option("--commands", metavar="CSV", help="Or the commands, to find it by."),
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration-s", min=0.1, help="Live; else until Ctrl-C.")
    ] = None,
    lcm_url: LcmUrl = "",
    force: Force = False,
    as_json: AsJson = False,
) -> dict:
    """Find tagged robots in a film of one camera over the floor, and write their poses.

    The CSV is what `twinmill import --poses` reads. With --camera the poses
    are published on the bus, as those of a motion capture.

    Example: twinmill track run.mp4 --lens camera.toml --floor floor.toml --height 0.12
    """
    if commands and (camera or start_s):
        raise ValueError("--commands: say when a film began; give it a video, and no --start-s.")
    if bool(video) == bool(camera):
        raise ValueError("track: give a video, or --camera: one of them.")
    wanted = frozenset(parse_numbers("--robots", robots, ROBOTS)) if robots else None
    if not 0.01 <= size_m <= 1 or not 0 <= height_m <= 5:
        raise ValueError("track: --size must be in 0.01..1 m, --height in 0..5 m.")
    tags = Tags(size_m, height_m, wanted)
    eye = _shutter(read_camera(lens), exposure_ms, line_delay_us)
    if camera:
        return _live(camera, eye, floor, tags, lcm_url, duration_s, as_json)
    out = out or Path(f"{video.stem}.csv")
    check_new_file(out, force)
    measured, film = read_floor(floor), _film(video, rate_hz)
    _check_size(str(video), film.size_px, eye)
    only = next(iter(wanted)) if wanted and len(wanted) == 1 else None
    orders = read_commands(commands, Columns(robot_id=only)) if commands else []
    detector, stamp_s, found = Detector(), [], []
    for at_s, picture in _shown(f"looking for tags in {video}", film):
        stamp_s.append(start_s + at_s)
        found.append(detector.find(picture))
    seen = gather(found)
    view = look(eye, measured, seen)
    paths = follow(np.array(stamp_s), seen, view, tags)
    if orders:
        start_s = align(paths, orders)
        paths = shifted(paths, start_s)
    quality = judge(paths, view, size_m)
    write_poses(out, paths, height_m, force)
    strangers = sorted(set(seen.number.tolist()) & set(ROBOTS) - {p.robot_id for p in paths})
    data = {
        "out": str(out),
        "frames": len(found),
        "frames_in_file": film.count,
        "start_s": start_s,
        "strangers": strangers,
        **quality.to_json(),
    }
    notes = [f"The film began at {start_s:.2f} s of the commands."] if orders else []
    if len(found) < WHOLE * film.count:
        notes.append(f"! The film breaks off: of {film.count} frames {len(found)} can be read.")
    if strangers:
        notes.append(f"! Tags that were not asked for: {', '.join(map(str, strangers))}.")
    notes += [f"! {warning}" for warning in quality.warnings]
    deliver(data, _text(out, paths, quality, view, notes), as_json)
    return data


def _film(video: Path, rate_hz: float | None) -> Film:
    if rate_hz is not None and not 0 < rate_hz <= 10000:
        raise ValueError(f"--rate-hz {rate_hz:g}: must be above 0.")
    return Film(video, rate_hz)


def _shutter(camera: Camera, exposure_ms: float | None, line_delay_us: float | None) -> Camera:
    """The camera with what the command line says of its shutter."""
    if exposure_ms is not None:
        camera = replace(camera, exposure_s=1e-3 * exposure_ms)
    if line_delay_us is not None:
        camera = replace(camera, line_delay_s=1e-6 * line_delay_us)
    return camera


def _check_size(who: str, size_px: tuple[int, int], camera: Camera) -> None:
    if size_px != camera.size_px:
        raise ValueError(
            f"{who}: is {size_px[0]}x{size_px[1]}, but the lens was calibrated at "
            f"{camera.size_px[0]}x{camera.size_px[1]}; film both with the same settings."
        )


def _shown(what: str, film: Film) -> Iterator[tuple[float, np.ndarray]]:
    """The film's frames, with progress and time left on stderr if that is a terminal."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        yield from progress.track(film.frames(), total=film.count or None, description=what)


def _text(
    out: Path, paths: list[RobotPath], quality: Quality, view: View, notes: list[str]
) -> Group:
    table = Table(box=frame.SIMPLE_HEAD)
    for name in ("robot", "lost", "longest gap", "left out", "corners", "noise", "heading"):
        table.add_column(name, justify="right")
    for robot in quality.robots:
        table.add_row(
            str(robot.robot_id),
            f"{100 * robot.lost_share:.1f} %",
            f"{robot.longest_gap_s:.2f} s",
            str(robot.odd),
            f"{robot.error_px:.2f} px",
            f"{1e3 * robot.position_noise_m:.2f} mm",
            f"{np.degrees(robot.heading_noise_rad):.2f}°",
        )
    where = (
        f"The camera is {view.position_m[2]:.2f} m over the floor, tilted by "
        f"{np.degrees(view.tilt_rad):.1f}°; the floor's points miss by {view.error_px:.2f} px."
    )
    head = f"{out}: {len(paths)} robots, {len(paths[0].t_s)} frames at {quality.rate_hz:.1f} Hz"
    return Group(Text(head), table, *map(Text, [*notes, where, quality.sentence]))


def _live(
    name: str,
    eye: Camera,
    floor: Path,
    tags: Tags,
    lcm_url: str,
    duration_s: float | None,
    as_json: bool,
) -> dict:
    """Publishes until the time is over, the camera ends, or Ctrl-C."""
    measured, bus = read_floor(floor), open_bus(lcm_url)
    source = LiveCamera(name, eye.size_px)
    try:
        _check_size(f"--camera {name}", source.size_px, eye)
        frames = source.frames()
        view = find_view(frames, eye, measured)
        count, start_s = None, time.monotonic()
        console = Console(stderr=True)
        with console.status("waiting for frames") as status:
            try:
                for count in publish(frames, view, tags, bus.publish):
                    took_s = time.monotonic() - start_s
                    status.update(f"{count.frames / took_s:.0f} Hz, poses {count.poses}")
                    if duration_s and took_s >= duration_s:
                        break
            except KeyboardInterrupt:
                pass
    finally:
        source.close()
    if count is None:
        raise ValueError(f"--camera {name}: gave no more frames; see that it is still plugged in.")
    took_s = time.monotonic() - start_s
    data = {
        "frames": count.frames,
        "poses": count.poses,
        "rate_hz": count.frames / took_s,
        "floor_error_px": view.error_px,
    }
    told = ", ".join(f"{robot}: {n}" for robot, n in sorted(count.poses.items())) or "none"
    deliver(data, f"{count.frames} frames at {data['rate_hz']:.0f} Hz; poses {told}", as_json)
    return data


def _calibrate(
    video: Annotated[Path, typer.Argument(metavar="VIDEO", show_default=False)],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="TOML", help="The camera's file.")
    ] = Path("camera.toml"),
    board: Annotated[str, typer.Option("--board", help="charuco or checkerboard.")] = "charuco",
    squares: Annotated[str, typer.Option("--squares", help="Across and down, all.")] = "7x5",
    square_m: Annotated[
        float, typer.Option("--square", metavar="M", help="Side of one, measured.")
    ] = 0.036,
    exposure_ms: ExposureMs = None,
    line_delay_us: LineDelayUs = None,
    force: Force = False,
    as_json: AsJson = False,
) -> dict:
    """Find a camera's lens from a film of a board that is moved about before it.

    The board is that of `twinmill tags --board`, or a checkerboard. Show it in
    all parts of the picture and tilted to all sides; move slowly, and keep it
    flat. Focus, zoom and resolution must be those of the runs.

    Example: twinmill track-calibrate board.mp4 --out camera.toml
    """
    check_new_file(out, force)
    pattern, film = _board(board, squares, square_m), _film(video, None)
    pictures = (picture for _, picture in _shown(f"looking for the board in {video}", film))
    views, frames = pick_views(pictures, pattern)
    times_s = (1e-3 * (exposure_ms or 0.0), 1e-6 * (line_delay_us or 0.0))
    found = calibrate(views, film.size_px, *times_s)
    found.camera.write(out, found.notes(), force)
    data = {"out": str(out), "frames": frames, **found.to_json()}
    deliver(data, _lens_text(out, found), as_json)
    return data


def _board(kind: str, squares: str, square_m: float) -> Board:
    across, _, down = squares.partition("x")
    if kind not in ("charuco", "checkerboard"):
        raise ValueError(f"--board {kind}: must be charuco or checkerboard.")
    if not (across.isdigit() and down.isdigit() and min(int(across), int(down)) >= 4):
        raise ValueError(f"--squares {squares}: must be as 7x5, at least 4 each way.")
    if kind == "charuco" and int(across) * int(down) > 200:
        raise ValueError(f"--squares {squares}: a ChArUco board has at most 200 here.")
    if not 0.001 <= square_m <= 1:
        raise ValueError(f"--square {square_m:g}: must be in 0.001..1 m.")
    return Board(kind, (int(across), int(down)), square_m)


def _lens_text(out: Path, found: Calibration) -> str:
    matrix = found.camera.matrix
    lines = [
        f"{out}: focal length {matrix[0, 0]:.1f} ± {found.focal_std_px:.1f} px, centre "
        f"{matrix[0, 2]:.1f}, {matrix[1, 2]:.1f} px, from {found.views} views",
        f"Corners miss by {found.error_px:.2f} px; the board was seen in "
        f"{100 * found.covered:.0f} % of the picture.",
        *(f"! {advice}" for advice in found.advice),
    ]
    return "\n".join(lines)
