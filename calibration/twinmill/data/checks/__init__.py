# SPDX-License-Identifier: Apache-2.0
"""Mistakes of the input, looked for before any physics.

A few simple mistakes are tried: if one of them explains the log far better than it is, it is said
in a sentence with its evidence and its remedy. Effects of physics are no mistakes: wheels that slip
or a heading that is a few degrees off are left to the diagnosis.
"""

import twinmill_native as native

from twinmill.data.checks.commands import Subject, check_commands, check_drift, check_drive
from twinmill.data.checks.exchange import check_exchange
from twinmill.data.checks.finding import InputFinding
from twinmill.data.checks.geometry import body_by_command
from twinmill.data.checks.series import check_length, check_poses, check_track
from twinmill.data.track import Track

__all__ = ["InputFinding", "check_poses", "check_tracks"]


def check_tracks(
    tracks: list[tuple[str, Track]], model: native.Model | None = None
) -> list[InputFinding]:
    """Findings on cleaned tracks.

    Args:
        tracks: name of the log, and the track of one robot in it.
        model: tells what wheels do. Without one, only velocity commands are checked.
    """
    found = check_length(tracks)
    by_log: dict[str, list] = {}
    for label, track in tracks:
        own = check_drive(track, model, label) if model else []
        own += check_track(track, label)
        found += own
        body = body_by_command(model, track.command_kind)
        if body is None or any(f.fatal for f in own):
            continue
        subject = Subject(label, track, body)
        wrong, search, explained = check_commands(subject)
        if explained is None:
            found += wrong
        else:
            by_log.setdefault(label, []).append((subject, search, explained, wrong))
    for judged in by_log.values():
        exchanged, who = check_exchange([row[:3] for row in judged])
        found += exchanged
        for subject, search, explained, wrong in judged:
            if subject.track.robot_id in who:
                continue
            found += wrong
            if not any(f.fatal for f in wrong) and not subject.track.same_clock:
                found += check_drift(subject, search, explained)
    wrong_robots = {(f.log_name, f.robot_id) for f in found if f.fatal}
    return [f for f in found if f.fatal or (f.log_name, f.robot_id) not in wrong_robots]
