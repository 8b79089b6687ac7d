# SPDX-License-Identifier: Apache-2.0
"""Measurements that are compared with a model: the cleaned runs of each robot in each log."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.camera_frames import Frames, frames_of
from twinmill.data.checks import (
    InputFinding,
    check_commanded,
    check_driven,
    check_poses,
    check_recorded,
    check_stamps,
    of_all_robots,
    own_option,
)
from twinmill.data.checks.bodies import give_back
from twinmill.data.checks.lateness import Lateness
from twinmill.data.cuts import without
from twinmill.data.log import Log, LogError, RobotLog, read_log
from twinmill.data.steady_table import SteadyTable, is_steady_table, read_steady_tables
from twinmill.data.time_base import TimeBase, find_time_base, retimed
from twinmill.data.track import SILENCE_S, SMOOTH_S, Track, local_line, make_track

MOST_POSES = 20_000  # of all robots in all logs, about: more make no fit better, and all slower
SLOWEST = 4  # frames of which one is kept: the shortest horizon must hold some
SHORTEST_LOG_S = 10.0  # below it no regime is seen twice


@dataclass(frozen=True)
class Measurement:
    """One robot in one log.

    Attributes:
        log_name, log_sha256: where it comes from.
        track: cleaned arrays.
        warnings: sentences of reading and cleaning.
        recorded_utime_us: earliest stamp in the log, us since the Unix epoch.
        time_base: of the log, where it was not what the stamps say; `track` has it put right.
        frames: of the robot's camera; None if the log tells of none.
        findings: mistakes of the input with which it can be judged.
        simulated: the log says that the twin made it.
    """

    log_name: str
    log_sha256: str
    track: Track
    warnings: list[str]
    recorded_utime_us: int
    time_base: TimeBase | None = None
    frames: Frames | None = None
    findings: tuple[InputFinding, ...] = ()
    simulated: bool = False

    @classmethod
    def live(cls, track: Track) -> "Measurement":
        """Measurement of a robot that is heard now, from no file."""
        return cls("live", "", track, track.notes, 0)

    @property
    def label(self) -> str:
        """Short name of log and robot."""
        return f"{self.log_name} R{self.track.robot_id:02d}"

    @property
    def robot_id(self) -> int:
        """Number of the robot in the log."""
        return self.track.robot_id

    def __repr__(self) -> str:
        return f"Measurement({self.label})"

    @property
    def same_clock(self) -> bool:
        """The log says that one clock stamped commands and poses."""
        return self.track.same_clock

    @property
    def steady(self) -> bool:
        """One offset of the clocks may hold for the whole log, and so for another one."""
        return self.time_base is None and all(f.steady for f in self.findings)

    @property
    def lateness(self) -> Lateness | None:
        """How much later it follows its commands at some times than at others; None: it does not.

        Or nothing more is known of it.
        """
        return next((f.lateness for f in self.findings if f.lateness), None)

    @property
    def lever_m(self) -> tuple[float, float] | None:
        """The tracked point ahead and left of the point that the robot turns about, if far off."""
        return next((f.lever_m for f in self.findings if f.lever_m), None)

    @property
    def lateness_changes(self) -> bool:
        """No one number of lag, delay or clock holds for the whole log, nor for another one."""
        return not all(f.steady for f in self.findings)

    def punctual(self) -> "Measurement":
        """Run whose commands act when they did, had all come as late as the first."""
        if self.lateness is None:
            return self
        acting_s = self.lateness.acting_s(self.track.command_t_s)
        return replace(self, track=replace(self.track, command_t_s=acting_s))

    @cached_property
    def played(self) -> native.Track:
        """Commands and poses for the native module.

        Where telemetry falls silent the robot's watchdog stops it, so a zero command is put in.
        """
        return _played(self.track, self.track.heading_rad)

    @cached_property
    def started(self) -> native.Track:
        """Track with smoothed headings, for predictions over windows.

        A prediction goes where its first heading points, and one reading of it is noisier than the
        few around it.
        """
        smooth_rad = self.track.heading_smooth
        return _played(
            self.track, np.where(np.isnan(smooth_rad), self.track.heading_rad, smooth_rad)
        )

    def __getstate__(self) -> dict[str, Any]:
        """Without what is made of it for the native module, which has addresses in it."""
        return {k: v for k, v in vars(self).items() if k not in ("played", "started")}

    def with_pose(self, pose: np.ndarray) -> "Measurement":
        """Run with other poses (N, 3), all else unchanged."""
        smooth_rad = self.track.heading_smooth
        if self.track.has_heading:
            t_s, segment = self.track.pose_t_s, self.track.segment
            smooth_rad, _ = local_line(t_s, pose[:, 2], segment, SMOOTH_S)
        track = replace(self.track, pose=pose, heading_smooth=smooth_rad)
        return replace(self, track=track)

    def without(self, stretches_s: list[tuple[float, float]], why: str) -> "Measurement":
        """Run less the poses within stretches of capture's clock."""
        t_s, segment = self.track.pose_t_s, self.track.segment
        inside = np.zeros(len(t_s), bool)
        for begin_s, end_s in stretches_s:
            inside |= (t_s >= begin_s) & (t_s <= end_s)
        smooth_rad = np.where(inside, np.nan, self.track.heading_smooth)
        kept = without(segment, inside)
        track = replace(self.track, segment=kept, heading_smooth=smooth_rad)
        return replace(self, track=track, warnings=[*self.warnings, why])


def unsteady(measurements: Sequence[Measurement | SteadyTable]) -> list[str]:
    """Sentences on when commands act by the input: after the motion, or later from some time on."""
    runs = [m for m in measurements if isinstance(m, Measurement)]
    told = [
        (m.label, _taken_into_account(f))
        for m in runs
        for f in m.findings
        if f.two_clocks or not f.steady
    ]
    if len(runs) == 1:
        return [f"{what[0].upper()}{what[1:]}." for _, what in told]
    return [f"{label}: {what}." for label, what in told]


def _taken_into_account(finding: InputFinding) -> str:
    known = ", which is taken into account" if finding.lateness else ""
    return f"{finding.what}{known}"


class Measurements(list[Measurement | SteadyTable]):
    """Usable measurements, and the findings about the input.

    Attributes:
        excluded: one sentence on each robot, log or table that cannot be judged.
        findings: mistakes of the input; robots with a fatal one are left out.
    """

    def __init__(
        self,
        judged: list[Measurement | SteadyTable],
        excluded: list[str],
        findings: list[InputFinding],
    ) -> None:
        super().__init__(judged)
        self.excluded, self.findings = excluded, findings

    @property
    def tracks(self) -> list[tuple[str, Track]]:
        """Name of the log and track of each robot."""
        return [(m.log_name, m.track) for m in self if isinstance(m, Measurement)]

    def excluding_wrong(self, findings: Sequence[InputFinding]) -> "Measurements":
        """These without the robots that more findings say to be wrong.

        Raises:
            BadInputError: nothing is left.
        """
        found = [*self.findings, *findings]
        bad = {(f.log_name, f.robot_id) for f in found if f.fatal}
        left = [
            _with_findings(m, findings)
            for m in self
            if isinstance(m, SteadyTable) or (m.log_name, m.track.robot_id) not in bad
        ]
        if bad and not left:
            raise BadInputError([f for f in found if f.fatal])
        reasons = [f"Left out: {f}" for f in findings if f.fatal]
        kept = [f for f in found if f.fatal or (f.log_name, f.robot_id) not in bad]
        return Measurements(left, [*self.excluded, *reasons], kept)


def _with_findings(
    measurement: Measurement | SteadyTable, findings: Sequence[InputFinding]
) -> Measurement | SteadyTable:
    """With its own findings, and without the whiles whose commands do not belong to its motion."""
    if isinstance(measurement, SteadyTable):
        return measurement
    name = (measurement.log_name, measurement.track.robot_id)
    own = tuple(f for f in findings if (f.log_name, f.robot_id) == name)
    for f in own:
        if f.cut_s:
            measurement = measurement.without(list(f.cut_s), f"Cut: {f.what}.")
    return replace(measurement, findings=(*measurement.findings, *own)) if own else measurement


class BadInputError(LogError):
    """Nothing is left to judge, because the input is wrong; `findings` say how."""

    def __init__(self, findings: list[InputFinding]) -> None:
        super().__init__(" ".join(map(str, findings)))
        self.findings = findings


def findings_of(error: LogError) -> list[InputFinding]:
    """Findings about the input that an error carries; none if it is of another kind."""
    if isinstance(error, BadInputError):
        return error.findings
    said = " ".join(str(error).split()).removesuffix(".")
    return [
        InputFinding(
            "nothing in the log can be judged", said, "correct it, or give another log", True
        )
    ]


def load_measurements(
    paths: Sequence[Path | Log | SteadyTable], model: native.Model | None = None
) -> Measurements:
    """Reads logs and cleans every robot in them; reads steady-state tables (.csv).

    A robot or a log that cannot be judged is left out, with the reason, if another can.

    Args:
        paths: logs and tables; those that were read already, too.
        model: tells what the wheels do, so that commands can be checked against the motion.

    Raises:
        BadInputError: by their findings, nothing is left that could be judged.
        LogError: nothing could be read that could be judged; why not the first.
    """
    cleaned = clean_measurements(paths, model)
    return cleaned.excluding_wrong(check_driven(cleaned.tracks, model))


def clean_measurements(
    paths: Sequence[Path | Log | SteadyTable], model: native.Model | None = None
) -> Measurements:
    """Measurements cleaned but not checked against the motion, which takes longest."""
    judged: list[Measurement | SteadyTable] = []
    excluded: list[LogError] = []
    findings: list[InputFinding] = []
    named: dict[str, str] = {}  # first name of each content
    for path in paths:
        try:
            if isinstance(path, SteadyTable):
                judged.append(path)
                continue
            if isinstance(path, Path) and is_steady_table(path):
                judged += read_steady_tables(path)
                continue
            log = path if isinstance(path, Log) else read_log(path)
            _check_new(log, named)
        except LogError as error:
            excluded.append(error)
            continue
        name, count = log.path.name, len(log.robots)
        robots, exchanged = give_back(log.robots, name)
        of_log: list[InputFinding] = [*exchanged]
        for robot in robots.values():
            own = own_option(robot.robot_id, count)
            wrong = check_commanded(robot, name) or check_poses(robot, name, own)
            wrong = wrong or check_stamps(robot, model, name, own)
            of_log += wrong
            if any(f.fatal for f in wrong):
                continue
            try:
                judged.append(_measured(log, robot, len(paths) * count))
            except LogError as error:
                excluded.append(error)
        findings += of_all_robots(of_log, {name: count})
    if not (judged or findings):
        raise excluded[0]
    read = Measurements(judged, [f"Left out: {error}" for error in excluded], [])
    return read.excluding_wrong([*findings, *check_recorded(read.tracks, model)])


def _check_new(log: Log, named: dict[str, str]) -> None:
    """A run that counts twice makes intervals too narrow, and its held-out blocks were fitted."""
    first = named.get(log.sha256)
    if first is not None:
        raise LogError(
            f"{log.path.name}: the same recording as {first}, which is used; a run counts once, so "
            "name each once."
        )
    named[log.sha256] = log.path.name


def _measured(log: Log, robot: RobotLog, runs: int) -> Measurement:
    """One robot of a log, cleaned; of so many robots and logs in all.

    Raises:
        LogError: too little of it can be used.
    """
    name = log.path.name
    base = find_time_base(robot)
    try:
        track = make_track(thinned(retimed(robot, base) if base else robot, runs))
    except LogError as error:
        raise LogError(f"{name}: {error}") from error
    _check_length(name, track)
    return Measurement(
        log_name=name,
        log_sha256=log.sha256,
        track=track,
        warnings=[*log.warnings, *([f"{base}; put right."] if base else []), *track.notes],
        recorded_utime_us=log.t0_utime_us,
        time_base=base,
        frames=frames_of(robot) if robot.has_heading else None,
        simulated=robot.source == "twin",
    )


def thinned(robot: RobotLog, runs: int) -> RobotLog:
    """The robot with every k-th pose where there are more in so many runs than a fit needs."""
    every = min(len(robot.pose_t_s) * runs // MOST_POSES, SLOWEST)
    if runs < 2 or every < 2:
        return robot
    pose = {k: getattr(robot, k)[::every] for k in ("pose_t_s", "pose", "z_m", "valid")}
    return replace(robot, **pose)


def _check_length(name: str, track: Track) -> None:
    usable_s = np.count_nonzero(track.segment >= 0) * track.timing.pose_period_s
    if usable_s < SHORTEST_LOG_S:
        raise LogError(
            f"{name}: robot {track.robot_id} has {usable_s:.1f} s of usable poses; a model "
            f"cannot be judged on less than {SHORTEST_LOG_S:g} s, so record a longer run."
        )


def _played(track: Track, heading_rad: np.ndarray) -> native.Track:
    t_s, command, battery_V = track.command_t_s, track.command, track.battery_V
    if track.telemetry:
        silent = np.flatnonzero(np.diff(t_s) > SILENCE_S)
        t_s = np.insert(t_s, silent + 1, t_s[silent] + SILENCE_S)
        command = np.insert(command, silent + 1, 0.0, axis=0)
        battery_V = np.insert(battery_V, silent + 1, battery_V[silent])
    pose = np.column_stack([track.pose[:, :2], heading_rad])
    return native.Track(
        *(np.ascontiguousarray(a, float) for a in (t_s, command, battery_V, track.pose_t_s, pose)),
        np.ascontiguousarray(track.segment, np.int64),
    )


def of_one_robot(
    measurements: Sequence[Measurement | SteadyTable],
    whose: str,
    remedy: str,
    robot: int | None = None,
) -> list[Measurement]:
    """Runs of one robot, where commands and poses of one are judged.

    Args:
        measurements: of all that was given.
        whose: begin of the sentence where they are not, up to what they hold.
        remedy: its end.
        robot: its number, where others may be there, too; None: it is alone.

    Raises:
        LogError: they are of several robots, of others or of none.
    """
    runs = [m for m in measurements if isinstance(m, Measurement)]
    ids = sorted({m.track.robot_id for m in runs})
    chosen = [m for m in runs if robot in (None, m.track.robot_id)]
    known = f"R{ids[0]:02d}" + (f" to R{ids[-1]:02d}" if len(ids) > 1 else "") if ids else ""
    if len(runs) < len(measurements):
        held = "a table of steady speeds"
    elif not chosen:
        held = f"no robot {robot}, but {known}"
    elif robot is None and len(ids) > 1:
        held = f"{len(ids)} robots ({known})"
    else:
        return chosen
    raise LogError(f"{whose} {held}; {remedy}.")
