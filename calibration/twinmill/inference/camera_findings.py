# SPDX-License-Identifier: Apache-2.0
"""From the posterior over sets of what cameras lack to findings, of all cameras or of one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinmill.inference.answer import Named, certain_of
from twinmill.inference.camera_search import CameraSearch, Lacks
from twinmill.inference.camera_set import CameraSet, Lack
from twinmill.inference.settings import PRIORS
from twinmill.predict.detection_errors import brier_ratio
from twinmill.predict.detections import Detections


@dataclass(frozen=True)
class OffCamera:
    """A robot whose camera differs from the others'.

    Attributes:
        robot_id: its number.
        findings: what it lacks alone.
        nothing: probability that it lacks nothing alone.
        score_before, score_after: of its bits with what all lack, and with its own, too.
        score_others: of the others' bits with what all lack.
    """

    robot_id: int
    findings: list[Named]
    nothing: float
    score_before: float
    score_after: float
    score_others: float

    @property
    def sentence(self) -> str:
        """In plain words."""
        names = " and ".join(
            f"one of {', '.join(f.group)}" if f.certainty == "group" else f.effect
            for f in self.findings
        )
        return f"The camera of R{self.robot_id:02d} differs: it lacks {names}."

    def to_json(self) -> dict[str, Any]:
        """Fields of `robots_off`."""
        told = [f.to_json() for f in self.findings]
        why = (
            f"the detections of its camera err {self.score_before:.2f} times as much as they "
            f"should with the model of all, those of the others {self.score_others:.2f} times; "
            f"what it lacks alone makes it {self.score_after:.2f}"
        )
        return {
            "robot_id": self.robot_id,
            "effect": " + ".join(f.effect for f in self.findings),
            "score_before": self.score_before,
            "score_after": self.score_after,
            "p_value": None,
            "why": why,
            "sentence": self.sentence,
            "parameters": [
                {**p, "name": f"{f['effect']}.{p['name']}"} for f in told for p in f["parameters"]
            ],
            "smallest_shown": {},
            "findings": told,
            "probability": {"nothing": self.nothing},
        }


@dataclass(frozen=True)
class Findings:
    """Answers to the question what all cameras lack, or one alone.

    Attributes:
        named: effects that are told, surest first.
        lacks: the same, as a set has them.
        nothing: probability that there is none.
        effects: probability of each, likeliest first.
    """

    named: list[Named]
    lacks: Lacks
    nothing: float
    effects: dict[str, float]


@dataclass(frozen=True)
class _Asked:
    """The posterior over sets where the question is what all cameras lack, or one alone."""

    search: CameraSearch
    dispersion: float
    posterior: dict[Lacks, float]

    def named(self, lack: Lack) -> Named:
        """An effect of the likeliest set.

        Its share is the part of the log likelihood, of what that set gains, that it alone brings.
        """
        best = next(iter(self.posterior))
        every = [(frozenset(map(str, lacks)), p) for lacks, p in self.posterior.items()]
        p, group, total, certainty = certain_of(str(lack), {str(own) for own in best}, every)
        whole, less, none = (
            self.search.set_of(lacks).laplace.log_likelihood
            for lacks in (best, best - {lack}, frozenset())
        )
        share = float(np.clip((whole - less) / max(whole - none, 1e-9), 0, 1))
        return Named(
            lack.effect, p, (lack.effect, *group[1:]), total, certainty, share, self._numbers(lack)
        )

    def _numbers(self, lack: Lack) -> dict[str, tuple[float, float]]:
        """Numbers of an effect and their standard deviations, over all sets that hold it."""
        sets = {lacks: p for lacks, p in self.posterior.items() if lack in lacks}
        shares = np.array(list(sets.values())) / sum(sets.values())
        each = [self.search.fitted[lacks].estimates(self.dispersion) for lacks in sets]
        found = {}
        for label in (label for label in each[0] if label[0] == lack):
            values, stds = np.array([numbers[label] for numbers in each]).T
            mean = float(shares @ values)
            spread = float(np.sqrt(shares @ (stds**2 + (values - mean) ** 2)))
            found[label[1]] = mean, spread
        return found


def findings_of(search: CameraSearch, dispersion: float, robot: int | None = None) -> Findings:
    """Effects of the likeliest set that are told: sure or a group, or doubtful where some is sure.

    Args:
        search: that was run.
        dispersion: of the blocks.
        robot: that alone lacks them; None: all cameras do.
    """
    asked = _Asked(search, dispersion, search.posterior(dispersion, robot))
    chance: dict[str, float] = {}
    nothing = 0.0
    for lacks, p in asked.posterior.items():
        own = [lack for lack in lacks if lack.robot == robot]
        nothing += 0.0 if own else p
        for lack in own:
            chance[lack.effect] = chance.get(lack.effect, 0.0) + p
    named: dict[Lack, Named] = {}
    for lack in next(iter(asked.posterior)):
        if lack.robot == robot:
            found = asked.named(lack)
            doubtful = nothing <= 1 - PRIORS.sure and found.probability >= PRIORS.member
            if found.certainty != "doubtful" or doubtful:
                named[lack] = found
    order = sorted(named, key=lambda own: (-named[own].probability, own.effect))
    every = dict(sorted(chance.items(), key=lambda item: -item[1]))
    return Findings([named[lack] for lack in order], frozenset(named), nothing, every)


def off_cameras(search: CameraSearch, dispersion: float, common: Lacks) -> list[OffCamera]:
    """Robots whose camera lacks something alone.

    Args:
        search: that was run.
        dispersion: of the blocks.
        common: what all are told to lack.
    """
    cameras, shared, found = search.fitter.cameras, search.set_of(common), []
    best = next(iter(search.posterior(dispersion)))
    for robot in sorted({lack.robot for lack in best if lack.robot is not None}):
        told = findings_of(search, dispersion, robot)
        if told.named:
            own = search.set_of(common | told.lacks)
            its = [c.robot_id == robot for c in cameras]
            before, after = (score_of(cameras, s, its) for s in (shared, own))
            others = score_of(cameras, shared, [not i for i in its])
            found.append(OffCamera(robot, told.named, told.nothing, before, after, others))
    return found


def score_of(cameras: Sequence[Detections], own: CameraSet, which: Sequence[bool]) -> float:
    """Brier score of some cameras' bits over its expectation: 1.0 is as good as a right model."""
    raw = all(c.frames.has_raw for c in cameras)
    chance, bits = [], []
    for camera, model, use in zip(cameras, own.models, which, strict=True):
        if use:
            chance.append(camera.reported(model, raw)[camera.usable])
            bits.append((camera.frames.raw if raw else camera.frames.voted)[camera.usable])
    return brier_ratio(np.concatenate(chance), np.concatenate(bits))
