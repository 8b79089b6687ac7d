# SPDX-License-Identifier: Apache-2.0
"""`twinmill track`, its lens and its proof: poses from films of tagged robots."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import LcmUrl, parse_numbers
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import numpy as np
    from rich import box as frame
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    from twinmill.counted import counted
    from twinmill.data.bus import open_bus
    from twinmill.data.importers.plain import Columns, read_commands, read_poses
    from twinmill.files import check_new_file
    from twinmill.numbers_typed import typed_float, typed_int
    from twinmill.terminal import Fitting, PlainConsole, progress_bar
    from twinmill.track.align import align
    from twinmill.track.boards import KINDS, Board
    from twinmill.track.camera import Camera, read_camera
    from twinmill.track.detect import ROBOTS, Detector, Sightings, gather
    from twinmill.track.film import Film, LiveCamera
    from twinmill.track.floor import Floor, View, look, read_floor
    from twinmill.track.lens import Calibration, calibrate, pick_views
    from twinmill.track.live import find_view, publish
    from twinmill.track.page import Page
    from twinmill.track.paths import RobotPath, Tags, follow, write_poses
    from twinmill.track.quality import Quality, judge
    from twinmill.track.ruler import Ruler, against_ruler
    from twinmill.track.together import Pair, clocks, compared, merged, on_clock

MISSING = 0.02  # of a film's duration: some round it, and sound may outlast the pictures

Rate = Annotated[
    float | None,
    typer.Option("--rate-hz", help="The frames' rate, where the file's stamps are no good."),
]
ExposureMs = Annotated[
    float | None, typer.Option("--exposure-ms", min=0, max=1000, help="Exposure time of each row.")
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
    app.command("track-check", no_args_is_help=True)(_check)


def _track(
    lens: Annotated[
        list[Path],
        typer.Option(
            "--lens",
            metavar="TOML",
            show_default=False,
            help="Lens file that `track calibrate` wrote; one for all cameras, or one for each.",
        ),
    ],
    floor: Annotated[
        list[Path],
        typer.Option(
            "--floor", metavar="TOML", show_default=False, help="Points on the floor; likewise."
        ),
    ],
    height_m: Annotated[
        float,
        typer.Option(
            "--height",
            metavar="M",
            show_default=False,
            help="Height of the tags above the floor, m.",
        ),
    ],
    *,
    videos: Annotated[
        list[Path] | None, typer.Argument(metavar="[VIDEO]...", show_default=False)
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(
            "--camera", metavar="DEVICE", help="Live camera: 0, or /dev/video0; repeatable."
        ),
    ] = None,
    robots: Annotated[
        str, typer.Option("--robots", metavar="IDS", help="Numbers, as 1-8,12; default: all seen.")
    ] = "",
    size_m: Annotated[
        float, typer.Option("--size", metavar="M", help="Side of the tags' black square.")
    ] = 0.10,
    family: Annotated[
        str,
        typer.Option(
            "--family",
            metavar="NAME",
            help="Family of tags, by OpenCV: 4x4_50, apriltag_25h9; or by AprilTag: tag36h11.",
        ),
    ] = "apriltag_36h11",
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="CSV", help="The poses; default: VIDEO's name."),
    ] = None,
    rate_hz: Rate = None,
    exposure_ms: ExposureMs = None,
    line_delay_us: LineDelayUs = None,
    start_s: Annotated[
        list[float] | None,
        typer.Option(
            "--start-s",
            help="Stamp of the first frame on the other clock; of each film, or of the first.",
        ),
    ] = None,
    commands: Annotated[
        Path | None,
        typer.Option(
            "--commands", metavar="CSV", help="Command table, to find that stamp by the motion."
        ),
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration-s", min=0.1, help="Live; else until Ctrl-C.")
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0: any that is free.")
    ] = 0,
    lcm_url: LcmUrl = "",
    force: Force = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Find tagged robots in films of cameras over the floor, and write their poses.

    The CSV is what `twinmill import --poses` reads. Several films of one run are
    joined: their clocks by robots that two cameras see at once. With --camera the
    poses are published on the bus, as those of a motion capture, and a page shows
    the pictures with what was found.

    Example: twinmill track run.mp4 --lens camera.toml --floor floor.toml --height 0.12
    """
    videos, camera, starts_s = videos or [], camera or [], start_s or []
    if commands and (camera or starts_s):
        raise ValueError("--commands: say when a film began; give it a video, and no --start-s.")
    if bool(videos) == bool(camera):
        raise ValueError("track: give videos, or --camera: one of them.")
    wanted = frozenset(parse_numbers("--robots", robots, ROBOTS)) if robots else None
    if not 0.01 <= size_m <= 1 or not 0 <= height_m <= 5:
        raise ValueError("track: --size must be in 0.01..1 m, --height in 0..5 m.")
    tags, count = Tags(size_m, height_m, wanted, family), len(videos or camera)
    Detector(family)  # a wrong name is told before the films are read
    eyes = [
        _shutter(read_camera(path), exposure_ms, line_delay_us)
        for path in _each("--lens", lens, count)
    ]
    floors = _each("--floor", floor, count)
    if camera:
        return _live(
            names=camera,
            eyes=eyes,
            floors=floors,
            tags=tags,
            lcm_url=lcm_url,
            duration_s=duration_s,
            port=port,
            as_json=as_json,
        )
    out = out or Path(f"{videos[0].stem}.csv")
    check_new_file(out, force, [*videos, *lens, *floor, commands])
    if len(starts_s) not in (0, 1, count):
        raise ValueError(f"--start-s: {len(starts_s)} are given for {count} films; give one each.")
    measured = [read_floor(path) for path in floors]
    films = [_film(video, rate_hz) for video in videos]
    for film, eye in zip(films, eyes, strict=True):
        _check_size(str(film.path), film.size_px, eye)
    only = next(iter(wanted)) if wanted and len(wanted) == 1 else None
    orders = read_commands(commands, Columns(robot_id=only)) if commands else []
    found = _found(films, eyes, measured, tags, starts_s=starts_s)
    paths, begins_s = found.paths, found.starts_s[0]
    if orders:
        begins_s = align(paths, orders)
        paths = on_clock(paths, begins_s)
    quality = judge(paths, found.views[0], tags)
    write_poses(out, paths, height_m, force)
    strangers = sorted(found.numbers & set(ROBOTS) - {p.robot_id for p in paths})
    data = {
        "out": str(out),
        "frames": sum(found.frames),
        "frames_in_file": sum(film.count for film in films),
        "start_s": begins_s,
        "strangers": strangers,
        **quality.to_json(),
        "cameras": found.to_json(),
    }
    notes = [f"The film began at {begins_s:.2f} s of the commands."] if orders else []
    if strangers:
        notes.append(f"! Tags that were not asked for: {', '.join(map(str, strangers))}.")
    notes += [f"! {warning}" for warning in quality.warnings]
    deliver(data, _text(out, paths, quality, [*notes, *found.notes()]), as_json)
    return data


@dataclass(frozen=True)
class _Found:
    """Tags found in films, in their order.

    Attributes:
        films: which.
        frames: how many of each could be read.
        numbers: of all tags.
        views: their cameras.
        starts_s: what was added to their stamps.
        pairs: how each agrees with those before it; None if no robot is in two.
        paths: of the robots, through all films.
    """

    films: list[Film]
    frames: list[int]
    numbers: set[int]
    views: list[View]
    starts_s: list[float]
    pairs: list[Pair | None]
    paths: list[RobotPath]

    def to_json(self) -> list[dict[str, Any]]:
        """One object for each camera."""
        return [
            {
                "video": str(film.path),
                "frames": frames,
                "duration_in_file_s": film.duration_s,
                "missing_s": film.missing_s,
                "turned_deg": film.turned_deg,
                "start_s": start_s,
                "camera_height_m": float(view.position_m[2]),
                "camera_tilt_rad": view.tilt_rad,
                "floor_error_px": view.error_px,
                "apart_m": pair and pair.apart_m,
                "apart_rad": pair and pair.apart_rad,
                "overlap_s": pair and pair.overlap_s,
            }
            for film, frames, view, start_s, pair in zip(
                self.films, self.frames, self.views, self.starts_s, self.pairs, strict=True
            )
        ]

    def notes(self) -> list[str]:
        """Sentences on the films and on where their cameras are."""
        many, said = len(self.films) > 1, []
        for k, (film, view) in enumerate(zip(self.films, self.views, strict=True)):
            of = f" {film.path}" * many
            if film.missing_s > MISSING * film.duration_s:
                words = (
                    f"the last {film.missing_s:.2f} of its {film.duration_s:.2f} s are not there."
                )
                said.append(f"! The film{of} breaks off: {words}")
            if film.turned_deg:
                words = f"its pictures turned by {film.turned_deg} degrees, and so they are"
                said.append(
                    f"The film{of} wants {words}; lens and floor must be of pictures that are, too."
                )
            said.append(
                f"The camera{f' of {film.path}' * many} is {view.position_m[2]:.2f} m over the "
                f"floor, tilted by {np.degrees(view.tilt_rad):.1f}°; the floor's points miss by "
                f"{view.error_px:.2f} px."
            )
            if k:
                said.append(_pair_words(film.path, self.starts_s[k], self.pairs[k]))
        return said


def _found(
    films: list[Film],
    eyes: list[Camera],
    measured: list[Floor],
    tags: Tags,
    *,
    starts_s: list[float],
) -> _Found:
    """Looks for tags, puts each film on the floor and all on the first's clock, and joins them."""
    stamps_s, seen = zip(*(_looked(film, tags.family) for film in films), strict=True)
    views = [look(*row) for row in zip(eyes, measured, seen, strict=True)]
    numbers = {n for tagged in seen for n in tagged.number.tolist()}
    if len(films) > 1 and (missing := (tags.robots or frozenset()) - numbers):
        raise ValueError(
            f"--robots: tag {min(missing)} is in none of the films; see which tag is on which "
            "robot."
        )
    tracked = []
    for stamp_s, tagged, view in zip(stamps_s, seen, views, strict=True):
        there = tags.robots and tags.robots & set(tagged.number.tolist())
        own = replace(tags, robots=there) if there and len(films) > 1 else tags
        tracked.append(follow(stamp_s, tagged, view, own))
    pairs, starts_s = _placed(tracked, starts_s, [str(film.path) for film in films])
    tracked = [on_clock(*row) for row in zip(tracked, starts_s, strict=True)]
    paths = merged(tracked) if len(films) > 1 else tracked[0]
    return _Found(
        films=films,
        frames=list(map(len, stamps_s)),
        numbers=numbers,
        views=views,
        starts_s=starts_s,
        pairs=pairs,
        paths=paths,
    )


def _looked(film: Film, family: str) -> tuple[np.ndarray, Sightings]:
    """Stamps of a film's frames, and the tags in them."""
    detector, stamp_s, found = Detector(family), [], []
    for at_s, picture in _shown(f"looking for tags in {film.path}", film):
        stamp_s.append(at_s)
        found.append(detector.find(picture))
    return np.array(stamp_s), gather(found)


def _each(option: str, given: list[Path], count: int) -> list[Path]:
    """One for each camera."""
    if len(given) not in (1, count):
        raise ValueError(
            f"{option}: {len(given)} are given for {count} cameras; give one for all, or one for "
            "each in their order."
        )
    return given * count if len(given) == 1 else given


def _placed(
    tracked: list[list[RobotPath]], starts_s: list[float], names: list[str]
) -> tuple[list[Pair | None], list[float]]:
    """How far apart cameras are where they overlap, and what is added to each film's stamps."""
    if len(tracked) == 1:
        return [None], starts_s or [0.0]
    if len(starts_s) == len(tracked):
        first = on_clock(tracked[0], starts_s[0])
        rest = zip(tracked[1:], starts_s[1:], strict=True)
        return [None, *(compared(first, on_clock(p, s)) for p, s in rest)], starts_s
    pairs = clocks(tracked, names)
    first_s = starts_s[0] if starts_s else 0.0
    return pairs, [first_s + (pair.shift_s if pair else 0.0) for pair in pairs]


def _pair_words(video: Path, shift_s: float, pair: Pair | None) -> str:
    if pair is None:
        return f"{video} begins at {shift_s:.3f} s; no robot is seen by two cameras at once."
    return (
        f"{video} begins at {shift_s:.3f} s; where two cameras see a robot, {pair.overlap_s:.1f} s "
        f"in all, they are {1e3 * pair.apart_m:.1f} mm and {np.degrees(pair.apart_rad):.2f}° apart."
    )


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
    with progress_bar(counted=False) as progress:
        yield from progress.track(film.frames(), total=film.count or None, description=what)


def _text(out: Path, paths: list[RobotPath], quality: Quality, notes: list[str]) -> Group:
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
    robots, frames = counted(len(paths), "robot"), counted(len(paths[0].t_s), "frame")
    head = f"{out}: {robots}, {frames} at {quality.rate_hz:.1f} Hz"
    return Group(Text(head), Fitting(table), *map(Text, [*notes, quality.sentence]))


def _live(
    names: list[str],
    eyes: list[Camera],
    floors: list[Path],
    tags: Tags,
    *,
    lcm_url: str,
    duration_s: float | None,
    port: int,
    as_json: bool,
) -> dict[str, Any]:
    """Publishes until the time is over, the cameras end, or Ctrl-C."""
    measured, bus = [read_floor(floor) for floor in floors], open_bus(lcm_url)
    page, sources = Page(len(names), port), []
    console = PlainConsole(stderr=True)
    try:
        for name, eye in zip(names, eyes, strict=True):
            sources.append(LiveCamera(name, eye.size_px))
            _check_size(f"--camera {name}", sources[-1].size_px, eye)
        frames = [source.frames() for source in sources]
        views = [find_view(*row, tags.family) for row in zip(frames, eyes, measured, strict=True)]
        console.print(f"What the cameras see: {page.url}", soft_wrap=True)
        count, start_s = None, time.monotonic()
        with console.status("waiting for frames") as status:
            try:
                for count in publish(frames, views, tags, bus.publish):
                    page.show(count.sight)
                    took_s = time.monotonic() - start_s
                    status.update(f"{count.frames / took_s:.0f} Hz, poses {count.poses}")
                    if duration_s and took_s >= duration_s:
                        break
            except KeyboardInterrupt:
                pass
    finally:
        page.close()
        for source in sources:
            source.close()
    if count is None:
        raise ValueError(
            f"--camera {names[0]}: gave no more frames; see that it is still plugged in."
        )
    took_s = time.monotonic() - start_s
    data = {
        "frames": count.frames,
        "poses": count.poses,
        "rate_hz": count.frames / took_s,
        "floor_error_px": max(view.error_px for view in views),
    }
    told = ", ".join(f"{robot}: {n}" for robot, n in sorted(count.poses.items())) or "none"
    deliver(
        data, f"{counted(count.frames, 'frame')} at {data['rate_hz']:.0f} Hz; poses {told}", as_json
    )
    return data


def _calibrate(
    video: Annotated[Path, typer.Argument(metavar="VIDEO", show_default=False)],
    *,
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
) -> dict[str, Any]:
    """Calibrate a camera's lens from a film of a board that is moved in front of it.

    The board is that of `twinmill track tags --board`, or a checkerboard. Show
    it in all parts of the picture and tilted to all sides; move slowly, and keep
    it flat. Focus, zoom and resolution must be those of the runs.

    Example: twinmill track calibrate board.mp4 --out camera.toml
    """
    check_new_file(out, force, [video])
    pattern, film = _board(board, squares, square_m), _film(video, None)
    pictures = (picture for _, picture in _shown(f"looking for the board in {video}", film))
    views, frames = pick_views(pictures, pattern)
    times_s = (1e-3 * (exposure_ms or 0.0), 1e-6 * (line_delay_us or 0.0))
    found = calibrate(views, film.size_px, *times_s)
    found.camera.write(out, found.notes(), force)
    data = {"out": str(out), "frames": frames, **found.to_json()}
    deliver(data, _lens_text(out, found), as_json)
    return data


def _board(name: str, squares: str, square_m: float) -> Board:
    across, _, down = squares.partition("x")
    kind = next((k for k in KINDS if k == name), None)
    if kind is None:
        raise ValueError(f"--board {name}: must be charuco or checkerboard.")
    try:
        fits = min(typed_int(across), typed_int(down)) >= 4
    except ValueError:
        fits = False
    if not fits:
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


def _check(
    poses: Annotated[Path, typer.Argument(metavar="POSES", show_default=False)],
    marks_mm: Annotated[
        str,
        typer.Option(
            "--marks-mm", metavar="MM,...", show_default=False, help="Where it stopped, in order."
        ),
    ],
    *,
    robot: Annotated[
        int | None, typer.Option("--robot", min=0, max=99, help="The sheet's number.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Check the accuracy of poses: a printed sheet pushed by hand along a ruler.

    Film a sheet on the floor that lies still for two seconds at each of some
    marks of a ruler, and let `track` find it. No robot is needed. Exit code 1
    says that a stop is off by more than 3 mm or 1 degree.

    Example: twinmill track check ruler.csv --marks-mm 0,100,200,300
    """
    sheets = [s for s in read_poses(poses, Columns()) if robot in (None, s.robot_id)]
    if len(sheets) != 1:
        seen = ", ".join(str(s.robot_id) for s in read_poses(poses, Columns()))
        raise ValueError(f"{poses}: holds poses of {seen}; say whose with --robot.")
    found = against_ruler(sheets[0], _marks_m(marks_mm))
    data = {
        "poses": str(poses),
        "good": found.good,
        "miss_m": found.miss_m,
        "turn_rad": found.turn_rad,
        "scale": found.scale,
        "noise_m": found.noise_m,
        "noise_rad": found.noise_rad,
        "stops": [{**asdict(stop), "miss_m": stop.miss_m} for stop in found.stops],
        "sentence": found.sentence,
    }
    deliver(data, _ruler_text(found), as_json)
    return 0 if found.good else 1


def _marks_m(text: str) -> list[float]:
    try:
        marks_m = [1e-3 * typed_float(word) for word in text.split(",")]
    except ValueError:
        marks_m = []
    if len(marks_m) < 2 or not all(0 < b - a < 100 for a, b in pairwise(marks_m)):
        raise ValueError(f"--marks-mm {text}: must be two numbers or more that rise, as 0,100,200.")
    return marks_m


def _ruler_text(found: Ruler) -> Group:
    table = Table(box=frame.SIMPLE_HEAD)
    for name in ("mark", "lay still", "along", "off", "across", "turned"):
        table.add_column(name, justify="right")
    for stop in found.stops:
        table.add_row(
            f"{1e3 * stop.mark_m:g} mm",
            f"{stop.from_s:.1f} to {stop.to_s:.1f} s",
            f"{1e3 * stop.along_m:.1f} mm",
            f"{1e3 * (stop.along_m - stop.mark_m):+.1f} mm",
            f"{1e3 * stop.across_m:+.1f} mm",
            f"{np.degrees(stop.turn_rad):+.2f}°",
        )
    noise = (
        f"At rest a pose wanders by {1e3 * found.noise_m:.2f} mm and "
        f"{np.degrees(found.noise_rad):.2f}°, the hand's tremor included; lengths are "
        f"{100 * found.scale:.2f} % of the ruler's."
    )
    return Group(Fitting(table), Text(noise), Text(found.sentence))
