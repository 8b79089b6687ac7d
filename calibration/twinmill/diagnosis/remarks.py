# SPDX-License-Identifier: Apache-2.0
"""What to keep in mind of a diagnosis, and what to drive next."""

import numpy as np

from twinmill.diagnosis.encoders import geometry_notes, time_base_notes
from twinmill.diagnosis.evidence import State
from twinmill.diagnosis.omnibus import Omnibus
from twinmill.diagnosis.ranking import Ranked
from twinmill.diagnosis.search import ALPHA, DELAY, Search
from twinmill.model.model_file import ModelFile

NOISIER = 2.0  # drive noise over that of the model file, beyond which it is a finding


def noisier(model_file: ModelFile, state: State) -> list[str]:
    """A note for each scene whose drive noise is far above what another log told."""
    if model_file.model.get("noise.drive_mps") <= 0:
        return []
    notes = []
    usual = model_file.model.get("noise.drive_mps")
    for scene in state.scenes:
        if scene.noise is None:
            continue
        ratio = scene.noise.position.drive / usual
        if ratio > NOISIER:
            notes.append(
                f"{scene.measurement.label}: the random disturbance of the motion is {ratio:.1f} "
                "times what the model file says; no effect that follows from commands, place or "
                "time is like that (slipping wheels or a rough floor may be)."
            )
    return notes


def _clock_notes(state: State, names: list[str]) -> list[str]:
    if any(s.clock_free for s in state.scenes):
        return [
            "The clock offset was found from this log itself, so a delay of the commands cannot be "
            "told from it; a calibration log on the same clocks would part them."
        ]
    if DELAY in names:
        return [
            "That it is a delay and no clock that is off rests on the calibration log: if a clock "
            "was set since then, make another."
        ]
    return []


def notes_of(state: State, omnibus: Omnibus, names: list[str]) -> list[str]:
    """Sentences on the clocks, on encoders, and on what was left before."""
    return [
        *time_base_notes(state.scenes),
        *geometry_notes(state.model),
        *_clock_notes(state, names),
        *_known_notes(omnibus),
    ]


def _known_notes(omnibus: Omnibus) -> list[str]:
    """What is left, and was left before."""
    if not omnibus.old:
        return []
    return [
        f"What still depends on {' and '.join(omnibus.old)} was left by this model before, in the "
        "log that it was fitted to."
    ]


def not_identifiable(done: Search) -> list[tuple[str, str]]:
    """Effects that could be there and not be seen."""
    limit = 2 * np.log(max(len(done.rounds[0].screening.found), 1) / ALPHA)
    hidden = [(name, "the log has no drive on which it acts") for name in done.blind]
    for s in done.rounds[0].screening.found:
        if 9 * s.expected < limit * s.excess:
            hidden.append((s.candidate.effect, "three times its usual strength would not show"))
    return hidden


def next_experiment(verdict: str, ranking: list[Ranked], done: Search) -> dict | None:
    """What to drive next, in words; the script itself is designed by `twinmill next`."""
    hidden = [name for name, _ in not_identifiable(done)]
    if verdict == "ambiguous":
        group = next(r.group for r in ranking if r.group is not None)
        same = [r.effect for r in ranking if r.group == group]
        return {
            "script": None,
            "separates": same,
            "why": f"this log cannot tell {' from '.join(same)}: drive all three axes at five or "
            "more duties, from rest and through zero, on clocks tied by a calibration log",
        }
    if hidden:
        return {
            "script": None,
            "separates": hidden,
            "why": "these effects leave no trace in this log: drive sideways as well, and at five "
            "or more duties on all axes",
        }
    return None
