# SPDX-License-Identifier: Apache-2.0
"""Predicted against measured detections: how often they agree, and where they do not."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.predict.detections import Detections

RANGE_BINS, BEARING_BINS = 8, 24
SHOWN = 1.6  # ranges up to so many times the model's are shown


@dataclass(frozen=True)
class Confusion:
    """Counts of frames, by what the model predicts (more likely than not) and what was measured."""

    true_positive: int
    false_negative: int
    false_positive: int
    true_negative: int

    @classmethod
    def of(cls, predicted: np.ndarray, measured: np.ndarray) -> "Confusion":
        """The four counts of (K,) bools each."""
        pairs = ((True, True), (False, True), (True, False), (False, False))
        counts = [int(np.sum((predicted == p) & (measured == m))) for p, m in pairs]
        return cls(*counts)

    @property
    def frames(self) -> int:
        """How many frames were counted."""
        return sum(vars(self).values())

    @property
    def agreement(self) -> float:
        """Share of frames in which both say the same."""
        return (self.true_positive + self.true_negative) / max(self.frames, 1)

    def to_json(self) -> dict[str, Any]:
        """The four counts: the model's answer is true or false by what was measured."""
        return dict(vars(self))


@dataclass(frozen=True)
class DetectionComparison:
    """All robots of all logs that reported detections.

    Attributes:
        predicted: (K,) probability that the frame shows a target, misses and false ones included.
        in_view: (K,) bool, geometry alone.
        measured: (K,) bool.
        robot: (K,) place in `labels`.
        range_m, bearing_rad: (K,) of the nearest other robot; the bearing from the heading, left
            positive.
        reach_m, half_rad: of the model's camera, for pictures.
        raw: measured detections are those of single frames; false if only the vote's were logged.
        vote_agreement: share of frames whose voted bit follows from the raw ones; None without.
    """

    labels: list[str]
    predicted: np.ndarray
    in_view: np.ndarray
    measured: np.ndarray
    robot: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    reach_m: float
    half_rad: float
    raw: bool
    vote_agreement: float | None

    @property
    def confusion(self) -> Confusion:
        """Confusion of geometry and measured detections."""
        return Confusion.of(self.in_view, self.measured)

    @property
    def score(self) -> float:
        """RMS error of the predicted chances over what such chances must err: 1.0 is right."""
        return brier_ratio(self.predicted, self.measured)

    def by_robot(self) -> list[tuple[str, Confusion, float]]:
        """Label, confusion and score of each."""
        rows = []
        for i, label in enumerate(self.labels):
            own = self.robot == i
            confusion = Confusion.of(self.in_view[own], self.measured[own])
            rows.append((label, confusion, brier_ratio(self.predicted[own], self.measured[own])))
        return rows

    def cells(self) -> list[dict[str, Any]]:
        """Counts over range and bearing of the nearest robot, cells without frames left out."""
        range_edges = np.linspace(0, SHOWN * self.reach_m, RANGE_BINS + 1)
        bearing_edges = np.linspace(-np.pi, np.pi, BEARING_BINS + 1)
        r = np.digitize(self.range_m, range_edges) - 1
        b = np.clip(np.digitize(self.bearing_rad, bearing_edges) - 1, 0, BEARING_BINS - 1)
        cells = []
        for i in range(RANGE_BINS):
            for k in range(BEARING_BINS):
                here = (r == i) & (b == k)
                if here.any():
                    cells.append(
                        {
                            "range_m": [range_edges[i], range_edges[i + 1]],
                            "bearing_rad": [bearing_edges[k], bearing_edges[k + 1]],
                            **Confusion.of(self.in_view[here], self.measured[here]).to_json(),
                            "frames": int(here.sum()),
                            "predicted_share": float(self.predicted[here].mean()),
                            "measured_share": float(self.measured[here].mean()),
                        }
                    )
        return cells

    def to_json(self) -> dict[str, Any]:
        """The key `bits`."""
        return {
            "frames": self.confusion.frames,
            "bit": "raw" if self.raw else "voted",
            "score": self.score,
            "agreement": self.confusion.agreement,
            "confusion": self.confusion.to_json(),
            "vote_agreement": self.vote_agreement,
            "robots": [
                {"robot": label, **confusion.to_json(), "score": score}
                for label, confusion, score in self.by_robot()
            ],
            "cells": self.cells(),
        }


def brier_ratio(chance: np.ndarray, bit: np.ndarray) -> float:
    """Root of the Brier score over what it would be were the chances true (Brier 1950)."""
    return float(np.sqrt(np.sum((bit - chance) ** 2) / np.sum(chance * (1 - chance))))


def compare_detections(
    cameras: list[Detections], model: native.Model
) -> DetectionComparison | None:
    """Compares a model's detections with those of all robots; None if no robot reported any."""
    return compared(cameras, model) if cameras else None


def compared(cameras: list[Detections], model: native.Model) -> DetectionComparison:
    """Compares a model's detections with those of all robots, one of which reported some.

    Raw detections are compared where every log has them, else voted ones with the vote predicted.

    Args:
        cameras: frames with poses.
        model: of all robots; each takes its own overrides.
    """
    raw = all(s.frames.has_raw for s in cameras)
    parts = [_of_robot(s, model.for_robot(s.robot_id), raw) for s in cameras]
    predicted, in_view, measured, range_m, bearing_rad, votes = (
        np.concatenate(c) for c in zip(*parts, strict=True)
    )
    robot = np.concatenate([np.full(len(p[0]), i) for i, p in enumerate(parts)])
    detection = model.detection_model()
    return DetectionComparison(
        [s.label for s in cameras],
        *(predicted, in_view, measured, robot, range_m, bearing_rad),
        detection["range_m"],
        detection["cone_rad"] / 2,
        raw,
        float(votes.mean()) if raw and len(votes) else None,
    )


def _of_robot(camera: Detections, model: native.Model, raw: bool) -> tuple[np.ndarray, ...]:
    """Predicted, in view, measured, range and bearing; and whether each vote follows, if `raw`."""
    use, frames = camera.usable, int(model.detection_model()["vote_frames"])
    poses = camera.poses(0.0)
    gap = poses[:, :, :2] - poses[:, camera.place : camera.place + 1, :2]
    distance_m = np.hypot(gap[..., 0], gap[..., 1])
    distance_m[:, camera.place] = np.inf
    nearest = distance_m[use].argmin(axis=1)
    row = np.arange(len(nearest))
    to = gap[use][row, nearest]
    bearing = np.arctan2(to[:, 1], to[:, 0]) - poses[use, camera.place, 2]
    return (
        camera.reported(model, raw)[use],
        camera.view(model)[use] > 0.5,
        (camera.frames.raw if raw else camera.frames.voted)[use],
        distance_m[use][row, nearest],
        np.angle(np.exp(1j * bearing)),
        (camera.voted(frames) == camera.frames.voted)[use]
        if raw and camera.frames.has_vote
        else np.empty(0),
    )
