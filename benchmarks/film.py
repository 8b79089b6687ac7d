# SPDX-License-Identifier: Apache-2.0
"""Share of hidden effects that `diagnose` names though poses come from a film.

    nice .venv/bin/python benchmarks/film.py --n 40 --seed 1 --out film

Robots and hidden effects are drawn as in `twinmill lab challenge`; drives stay in the picture.
Each frame of 1920x1080 at 30 Hz is rendered about the tag, with blur of motion, a rolling shutter,
noise and a JPEG's losses, by the renderer of the tests, and tracked; the four floor tags are
measured by a tape that is off by 1 mm. The model is the one of that robot from another log.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import cv2
import lcm
import numpy as np
import turbopi

import twinmill as tm
from twinmill.data.lcm_log import log_file
from twinmill.model.model_file import write_whole
from twinmill.track.camera import Camera
from twinmill.track.detect import Detector, gather
from twinmill.track.floor import Floor, View, look
from twinmill.track.paths import RobotPath, Tags, follow
from twinmill_lab.challenge.cases import Case, draw, draw_robots
from twinmill_lab.challenge.command import base_of
from twinmill_lab.challenge.run import EPOCH_US, ROBOT_ID, STEP_S, Motion, play, write_log
from twinmill_lab.challenge.scoring import scored

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/python/track"))
from rendering import Lens, Scene, Tag, still

DURATION_S, BASE_S = 40.0, 90.0
RATE_HZ, EXPOSURE_S, LINE_DELAY_S = 30.0, 0.005, 20e-6
HEIGHT_M, SIZE_M, TAPE_M = 0.12, 0.10, 1e-3
IN_VIEW_M = (4.2, 2.2)  # of the floor at the tag's height, along the picture's sides
FLOOR_M = ((-1.9, -1.0), (1.9, -1.0), (1.9, 0.9), (-1.9, 0.9))
AROUND_PX, JPEG_QUALITY = 60, 85
POSE = f"R{ROBOT_ID:02d}_POSE"


@dataclass(frozen=True)
class Shot:
    """A case that stays in the picture.

    Attributes:
        case: of the challenge.
        motion: of its robot.
        lens: of a camera over the middle of its way.
    """

    case: Case
    motion: Motion
    lens: Lens


def shots(seed: int) -> Iterator[Shot]:
    """Cases with one effect hidden, without end."""
    robots = draw_robots(seed)
    for number in count():
        case = draw(number, seed, robots, DURATION_S)
        if case.kind not in ("one", "cousin"):
            continue
        motion = play(case.plan, case.hidden, forces=True)
        low, high = motion.pose[:, :2].min(axis=0), motion.pose[:, :2].max(axis=0)
        along, across = high - low
        if max(along, across) > IN_VIEW_M[0] or min(along, across) > IN_VIEW_M[1]:
            continue
        middle = (low + high) / 2
        turn_rad = 0.05 + (np.pi / 2 if across > along else 0)
        lens = Lens(position_m=(*middle, 2.5), tilt_rad=0.04, roll_rad=turn_rad)
        yield Shot(case, motion, lens)


def view_of(shot: Shot, random: np.random.Generator) -> View:
    """The camera as its user finds it, from floor tags and a tape."""
    lens = shot.lens
    c, s = np.cos(lens.roll_rad), np.sin(lens.roll_rad)
    places = np.array(FLOOR_M) @ [[c, s], [-s, c]] + lens.position_m[:2]
    tags = [Tag(500 + k, still(*xy, 0.3 * k), 0.12, 0.0, lies=True) for k, xy in enumerate(places)]
    seen = gather([Detector().find(Scene(lens, tags, seed=shot.case.number).frame(0))])
    measured = places + random.normal(0, TAPE_M, places.shape)
    camera = Camera(
        lens.size_px, lens.matrix, np.array([*lens.distortion, 0.0]), EXPOSURE_S, LINE_DELAY_S
    )
    numbers = np.array([t.number for t in tags])
    return look(camera, Floor(measured, np.full(measured.shape, np.nan), numbers), seen)


def tracked(shot: Shot) -> RobotPath:
    """Path of the robot that `twinmill track` finds in the film."""
    steps_s = np.arange(len(shot.motion.pose)) * STEP_S

    def path(t_s: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(t_s, steps_s, c) for c in shot.motion.pose.T])

    tag = Tag(ROBOT_ID, path, SIZE_M, HEIGHT_M)
    scene = Scene(shot.lens, [], RATE_HZ, EXPOSURE_S, LINE_DELAY_S, seed=shot.case.number)
    view = view_of(shot, np.random.default_rng([shot.case.number, 6]))
    detector, found = _detector_of_parts(shot.lens), []
    frames = range(3, int((steps_s[-1] - 0.1) * RATE_HZ))
    for k in frames:
        picture, corner = scene.part(k, tag, AROUND_PX)
        _, coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        numbers, corners = detector.find(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))
        found.append((numbers, corners + corner))
    seen, stamp_s = gather(found), np.array(frames) / RATE_HZ
    (robot,) = follow(stamp_s, seen, view, Tags(SIZE_M, HEIGHT_M, frozenset({ROBOT_ID})))
    return robot


def _detector_of_parts(lens: Lens) -> Detector:
    """For pieces: what is too small for a tag is a share of the whole picture's width."""
    detector = Detector()
    settings = detector._detector.getDetectorParameters()
    settings.minMarkerPerimeterRate *= lens.size_px[0] / (2 * AROUND_PX)
    detector._detector.setDetectorParameters(settings)
    return detector


def write_film_log(capture: Path, robot: RobotPath, offset_s: float, out: Path) -> None:
    """The log with the film's poses in place of the motion capture's."""
    events = [(e.timestamp, e.channel, e.data) for e in lcm.EventLog(str(capture), "r")]
    events = [event for event in events if event[1] != POSE]
    for k, (t_s, pose) in enumerate(zip(robot.t_s, robot.pose, strict=True)):
        said = turbopi.pose_t()
        said.utime_us = EPOCH_US + round(1e6 * (t_s + offset_s))
        said.robot_id, said.seq, said.valid = ROBOT_ID, k, int(np.isfinite(pose[0]))
        half = pose[2] / 2
        said.position_m = [pose[0], pose[1], HEIGHT_M]
        said.orientation_wxyz = [np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)]
        events.append((said.utime_us, POSE, said.encode()))
    with log_file(out) as log:
        for event in sorted(events, key=lambda event: event[0]):
            log.write_event(*event)


def miss_of(shot: Shot, robot: RobotPath) -> dict:
    """RMS errors of the film's poses."""
    steps_s = np.arange(len(shot.motion.pose)) * STEP_S
    good = robot.valid
    truth = [np.interp(robot.t_s[good], steps_s, c) for c in shot.motion.pose.T]
    miss = robot.pose[good] - np.column_stack(truth)
    turn = np.angle(np.exp(1j * miss[:, 2]))
    return {
        "lost_share": float(1 - good.mean()),
        "position_m": float(np.sqrt(np.mean(np.sum(miss[:, :2] ** 2, axis=1)))),
        "heading_rad": float(np.sqrt(np.mean(turn**2))),
    }


def judged(shot: Shot, folder: Path, seed: int) -> dict:
    """Answers to a case from motion capture and from film, side by side."""
    case = shot.case
    base = tm.Model.load(base_of(folder, case.robot, case.plan.robot, seed=seed, duration_s=BASE_S))
    capture, film = (folder / f"{case.number}_{what}.lcmlog" for what in ("capture", "film"))
    write_log(case.plan, shot.motion, capture)
    row = {"case": case.number, "hidden": case.hidden[0].name, "kind": case.kind}
    row["capture"] = _said(case, capture, base)
    if row["capture"]["named"]:
        robot = tracked(shot)
        row["miss"] = miss_of(shot, robot)
        write_film_log(capture, robot, case.plan.robot.offset_s, film)
        row["film"] = _said(case, film, base)
    return row


def _said(case: Case, log: Path, base: tm.Model) -> dict:
    found = scored(case, tm.diagnose(log, base).to_json())
    return {
        "named": found["outcome"]["first"],
        "sure": found["outcome"]["verdict_right"],
        "verdict": found["verdict"],
        "said": found["said"],
    }


def main() -> None:
    """Judges cases until so many were named from the motion capture; goes on where it was."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--n", type=int, default=40, help="effects named from motion capture")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("film"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for shot in shots(options.seed):
        kept = options.out / f"{shot.case.number}.json"
        if not kept.exists():
            started = time.monotonic()
            row = judged(shot, options.out, options.seed)
            write_whole(kept, json.dumps(row | {"time_s": time.monotonic() - started}))
        rows.append(json.loads(kept.read_text()))
        both = [r for r in rows if "film" in r]
        named = sum(r["film"]["named"] for r in both)
        print(f"{named} of {len(both)} from the film; {len(rows)} judged", file=sys.stderr)
        if len(both) >= options.n:
            break
    lost = [r["case"] for r in both if not r["film"]["named"]]
    print(json.dumps({"named": named, "of": len(both), "judged": len(rows), "lost": lost}))


if __name__ == "__main__":
    main()
