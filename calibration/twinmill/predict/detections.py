# SPDX-License-Identifier: Apache-2.0
"""Frames of one robot with the poses of all robots around it, and how likely a model finds them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.camera_frames import Frames
from twinmill.data.track import Track
from twinmill.model.parameters import CLOCK, CLOCK_RATE
from twinmill.predict.modelled_log import ModelledLog

BLOCK_S = 4.0  # errors of detections within a block are correlated
# Poses are never better known than this: markers sit off the wheels' centre, cameras off theirs.
LEAST_M, LEAST_RAD = 0.003, 0.005
SURE = 1e-3  # no frame is ever surer: one strange bit must not decide
VOTE_ERROR = 0.01  # of voted bits that no count of frames explains
UNSEEN_FRAMES = 64  # at the start: the vote may remember frames from before the log


@dataclass
class Detections:
    """One robot in one log.

    Attributes:
        label, robot_id, log_sha256: which.
        place: of the robot among `tracks`.
        tracks: of all robots in the log.
        frames: of this robot.
        usable: (K,) bool, every robot is tracked.
        offset_s, rate: capture's clock against the robot's.
        clock_free: the offset was found from this log itself.
        blur: standard deviations of a pose, m and rad.
        block: (K,) number of the 4 s block of each frame; half: (K,) which half it belongs to.
    """

    label: str
    robot_id: int
    log_sha256: str
    place: int
    tracks: list[Track]
    frames: Frames
    usable: np.ndarray
    offset_s: float
    rate: float
    clock_free: bool
    blur: tuple[float, float]
    block: np.ndarray
    half: np.ndarray
    _seen: tuple[Any, Any] = field(default=(None, None), repr=False)
    _placed: tuple[Any, Any] = field(default=(None, None), repr=False)
    _votes: tuple[Any, Any] = field(default=(None, None), repr=False)

    @property
    def bits(self) -> np.ndarray:
        """(K,) bool that were reported: raw, or voted where the log has no others."""
        return self.frames.raw if self.frames.has_raw else self.frames.voted

    def poses(self, age_s: float, pick: slice = slice(None)) -> np.ndarray:
        """(K, N, 3) poses of all robots when the pictures were taken; NaN where untracked."""
        key = (pick.step, age_s)
        if self._placed[0] != key:
            t_s = self._capture_s(age_s)[pick]
            placed = np.stack([pose_at(track, t_s) for track in self.tracks], axis=1)
            self._placed = (key, placed)
        return self._placed[1]

    def view(self, model: native.Model, pick: slice = slice(None)) -> np.ndarray:
        """(K,) probability that the robot of `model` (its own) has another in view."""
        detection = model.detection_model()
        age_s = detection["age_s"] + (0.0 if self.frames.stamped else detection["delay_s"])
        geometry = ("range_m", "softness_m", "cone_rad", "pan_rad", "hide_radius_m")
        key = (pick.step, age_s, *(detection[g] for g in geometry))
        if self._seen[0] != key:
            poses = self.poses(age_s, pick)
            self._seen = (key, native.in_view(model, self.place, poses, *self.blur))
        return self._seen[1]

    def chance(self, model: native.Model, pick: slice = slice(None)) -> np.ndarray:
        """(K,) probability that the frame shows a target."""
        detection = model.detection_model()
        view = self.view(model, pick)
        chance = view * (1 - detection["miss_rate"]) + (1 - view) * detection["false_rate"]
        return np.clip(chance, SURE, 1 - SURE)

    def reported(self, model: native.Model, raw: bool) -> np.ndarray:
        """(K,) chance of the raw bit, or of the voted one."""
        chance = self.chance(model)
        return chance if raw else majority(chance, int(model.detection_model()["vote_frames"]))

    def likelihood(self, model: native.Model, pick: slice = slice(None)) -> np.ndarray:
        """(K,) log likelihood of what the robot reported; NaN where nothing can be said.

        Raw bits are independent draws, and voted ones follow from them. Without raw bits only
        every Nth frame counts, of a vote of N: neighbouring votes share their frames.

        Args:
            model: of this robot.
            pick: of the frames.
        """
        frames = int(model.detection_model()["vote_frames"])
        if not self.frames.has_raw:
            return self._voted_alone(model, frames)[pick]
        chance = self.chance(model, pick)
        raw = self.frames.raw[pick]
        told = np.log(np.where(raw, chance, 1 - chance)) + self._of_votes(frames, pick)
        return np.where(self.usable[pick], told, np.nan)

    def voted(self, frames: int) -> np.ndarray:
        """(K,) bool: strict majority of the newest `frames` raw bits, as the firmware votes."""
        count = np.concatenate([[0], np.cumsum(self.frames.raw)])
        end = np.arange(1, len(count))
        begin = np.maximum(end - frames, 0)
        return 2 * (count[end] - count[begin]) > end - begin

    def _of_votes(self, frames: int, pick: slice) -> np.ndarray:
        """(K,) log likelihood of the votes, given the raw bits and of how many they are taken."""
        key = (pick.step, frames)
        if self._votes[0] != key:
            right = self.voted(frames)[pick] == self.frames.voted[pick]
            vote = np.full(right.shape, np.log(VOTE_ERROR))
            vote[right] = np.log(1 - VOTE_ERROR)
            vote[np.arange(len(self.frames.raw))[pick] < UNSEEN_FRAMES] = 0
            self._votes = (key, vote * self.frames.has_vote)
        return self._votes[1]

    def _voted_alone(self, model: native.Model, frames: int) -> np.ndarray:
        told = np.full(len(self.frames.voted), np.nan)
        each = slice(frames - 1, None, frames)
        chance = np.clip(majority(self.chance(model), frames, each), SURE, 1 - SURE)
        told[each] = np.log(np.where(self.frames.voted[each], chance, 1 - chance))
        told[~self.usable] = np.nan
        return told

    def _capture_s(self, age_s: float) -> np.ndarray:
        robot_s = self.frames.t_s - age_s
        return robot_s * (1 + self.rate) + self.offset_s


def majority(chance: np.ndarray, frames: int, of: slice = slice(None)) -> np.ndarray:
    """(K,) probability that more than half of the newest `frames` independent bits are 1.

    Poisson-binomial distribution by convolution (Wang 1993, Statistica Sinica 3, 295); at the start
    bits before the first count as it.

    Args:
        chance: (N,) of each bit.
        frames: that vote.
        of: the K frames whose votes are asked.
    """
    padded = np.concatenate([np.full(frames - 1, chance[0]), chance])
    counts = np.zeros((len(chance[of]), frames + 1))
    counts[:, 0] = 1
    for k in range(frames):
        p = padded[k : k + len(chance), None][of]
        kept = counts * (1 - p)
        kept[:, 1:] += counts[:, :-1] * p
        counts = kept
    return counts[:, frames // 2 + 1 :].sum(axis=1)


def thue_morse(number: np.ndarray) -> np.ndarray:
    """(N,) 0 or 1: the sequence 0 1 1 0 1 0 0 1 ... at these places, which no rhythm follows."""
    return np.array([bin(int(n)).count("1") % 2 for n in number])


def pose_at(track: Track, t_s: np.ndarray) -> np.ndarray:
    """(K, 3) poses between the measured ones; NaN where the robot is not tracked."""
    after = np.clip(np.searchsorted(track.pose_t_s, t_s), 1, len(track.pose_t_s) - 1)
    before = after - 1
    whole = (track.segment[after] >= 0) & (track.segment[after] == track.segment[before])
    whole &= (t_s >= track.pose_t_s[0]) & (t_s <= track.pose_t_s[-1])
    span_s = track.pose_t_s[after] - track.pose_t_s[before]
    part = ((t_s - track.pose_t_s[before]) / span_s)[:, None]
    pose = track.pose[before] * (1 - part) + track.pose[after] * part
    return np.where(whole[:, None], pose, np.nan)


def all_detections(logs: Sequence[Any]) -> list[Detections]:
    """Robots that reported bits while at least one other was tracked.

    Args:
        logs: with their models and clocks; those without frames, and tables, are passed over.
    """
    found = []
    by_log: dict[str, list[ModelledLog]] = {}
    for modelled in logs:
        if isinstance(modelled, ModelledLog):
            by_log.setdefault(modelled.measurement.log_sha256, []).append(modelled)
    for together in by_log.values():
        for own, modelled in enumerate(together):
            if len(together) > 1 and modelled.measurement.frames is not None:
                made = detections_of(together, own)
                if made.usable.any():
                    found.append(made)
    return found


def detections_of(together: list[ModelledLog], own: int) -> Detections:
    """Detections of one robot of a log that has frames; the others contribute their tracks."""
    modelled = together[own]
    noise, frames = modelled.known_noise.to_json(), modelled.measurement.frames
    assert frames is not None
    block = ((frames.t_s - frames.t_s[0]) // BLOCK_S).astype(int)
    made = Detections(
        label=modelled.measurement.label,
        robot_id=modelled.measurement.track.robot_id,
        log_sha256=modelled.measurement.log_sha256,
        place=own,
        tracks=[s.measurement.track for s in together],
        frames=frames,
        usable=np.ones(len(frames.t_s), bool),
        offset_s=modelled.model.get(CLOCK),
        rate=modelled.model.get(CLOCK_RATE) * 1e-6,
        clock_free=modelled.clock_free,
        blur=(max(noise["sensor_m"], LEAST_M), max(noise["sensor_rad"], LEAST_RAD)),
        block=block,
        half=thue_morse(block),
    )
    made.usable = np.isfinite(made.poses(0.0)).all(axis=(1, 2))
    return made
