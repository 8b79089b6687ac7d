# SPDX-License-Identifier: Apache-2.0
"""Mistakes of the input, looked for before any physics.

A few simple mistakes are tried: if one of them explains the log far better than it is, it is said
in a sentence with its evidence and its remedy. Effects of physics are no mistakes: wheels that slip
or a heading that is a few degrees off are left to the diagnosis.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import twinmill_native as native

from twinmill.data.checks.alternatives import Explained, Search
from twinmill.data.checks.apart import apart
from twinmill.data.checks.clocks import check_lateness, check_one_clock
from twinmill.data.checks.commands import (
    body_by_command,
    check_commands,
    check_drive,
    check_exchange,
    check_foreign,
    check_lever,
    check_wheels,
)
from twinmill.data.checks.finding import CheckedTrack, InputFinding
from twinmill.data.checks.rolling import check_rolling
from twinmill.data.checks.series import (
    check_changes,
    check_commanded,
    check_length,
    check_poses,
    check_track,
)
from twinmill.data.checks.stamps import check_stamps
from twinmill.data.track import Track

__all__ = [
    "InputFinding",
    "check_changes",
    "check_commanded",
    "check_driven",
    "check_poses",
    "check_recorded",
    "check_stamps",
    "check_tracks",
    "of_all_robots",
    "own_option",
]

Tracks = list[tuple[str, Track]]  # name of the log, and one robot in it


def check_tracks(tracks: Tracks, model: native.Model | None = None) -> list[InputFinding]:
    """Findings on cleaned tracks.

    Args:
        tracks: name of the log, and the track of one robot in it.
        model: tells what wheels do. Without one, only velocity commands are checked.
    """
    found = check_recorded(tracks, model)
    wrong = _wrong(found)
    right = [(label, t) for label, t in tracks if (label, t.robot_id) not in wrong]
    found += check_driven(right, model)
    wrong = _wrong(found)
    return [f for f in found if f.fatal or (f.log_name, f.robot_id) not in wrong]


def _wrong(found: list[InputFinding]) -> set[tuple[str, int]]:
    """Log and robot of those that cannot be judged."""
    return {(f.log_name, f.robot_id) for f in found if f.fatal}


def check_recorded(tracks: Tracks, model: native.Model | None) -> list[InputFinding]:
    """Findings that each track shows by itself: kind of drive, timing, noise, length; quick."""
    found = check_length(tracks)
    robots = Counter(label for label, _ in tracks)
    for label, track in tracks:
        own = own_option(track.robot_id, robots[label])
        found += check_drive(track, model, label) if model else check_rolling(track, label)
        found += check_wheels(track, model, label) if model else []
        found += check_track(track, label, own)
    return of_all_robots(found, robots)


def check_driven(tracks: Tracks, model: native.Model | None) -> list[InputFinding]:
    """Commands against poses: signs, columns, axes, units, clocks, names. A second a robot.

    Without a model also how late a robot is on one clock: nothing else tells it then.
    """
    found: list[InputFinding] = []
    by_log: dict[str, list[tuple[CheckedTrack, Search, Explained, list[InputFinding]]]] = {}
    robots = Counter(label for label, _ in tracks)
    for label, track in tracks:
        body = body_by_command(model, track.command_kind)
        if body is None:
            continue
        if model is not None:
            others = [t for name, t in tracks if name == label and t is not track]
            track = apart(track, others, model.get("robot.body_radius_m"))
        checked = CheckedTrack(label, track, body, own_option(track.robot_id, robots[label]))
        wrong, search, explained = check_commands(checked)
        if search is None or explained is None:
            found += wrong
        else:
            by_log.setdefault(label, []).append((checked, search, explained, wrong))
    for judged in by_log.values():
        exchanged, who = check_exchange([row[:3] for row in judged])
        found += exchanged
        for checked, search, explained, wrong in judged:
            if checked.track.robot_id in who:
                continue
            found += wrong
            if any(f.fatal for f in wrong):
                continue
            if model is None or "marker_offset" not in model.effects:
                found += check_lever(checked, search, explained)
            found += check_foreign(checked, search, explained)
            if not wrong:
                of_time = check_lateness(checked, search, explained)
                found += of_time or check_one_clock(
                    checked, search, explained, delays=model is None
                )
    return of_all_robots(found, robots)


def own_option(robot_id: int, robots: int) -> int | None:
    """The robot that options are to name; None where its log has no other."""
    return robot_id if robots > 1 else None


def of_all_robots(found: list[InputFinding], robots: Mapping[str, int]) -> list[InputFinding]:
    """Findings, with one remedy for all robots of a log where each of them has the same.

    Args:
        found: of robots.
        robots: how many each log has, by its name.
    """
    plain = [f.remedy_of_all or f.remedy for f in found]
    alike = Counter((f.log_name, remedy) for f, remedy in zip(found, plain, strict=True))
    return [
        replace(f, remedy=remedy) if alike[f.log_name, remedy] == robots[f.log_name] > 1 else f
        for f, remedy in zip(found, plain, strict=True)
    ]
