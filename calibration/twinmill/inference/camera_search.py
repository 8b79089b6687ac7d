# SPDX-License-Identifier: Apache-2.0
"""Search over sets of effects that cameras lack, and the posterior over these sets.

Nothing is accepted or refused on the way: a set that was fitted competes in the end.
"""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from twinmill.inference.camera_set import CameraFitter, CameraSet, Lack
from twinmill.inference.posterior import probabilities
from twinmill.inference.search import MOST, WORTH, log_prior_of_effects
from twinmill.inference.table import BEYOND
from twinmill.model.parameters import catalogue
from twinmill.predict.detections import SURE, Detections

Lacks = frozenset[Lack]


class CameraSearch:
    """Sets that were fitted; the likeliest grows until no set beside it is likelier.

    Args:
        fitter: of the cameras.
        candidates: effects that compete.
        progress: told in words what is being done.
    """

    def __init__(
        self,
        fitter: CameraFitter,
        candidates: Sequence[Lack],
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.fitter, self.candidates, self.progress = fitter, list(candidates), progress
        self.fitted: dict[Lacks, CameraSet] = {frozenset(): fitter.fit(())}
        self._blocks: dict[Lacks, np.ndarray] = {}

    def run(self) -> "CameraSearch":
        """Each effect is added to the likeliest set, or takes the place of one, until it stays."""
        while True:
            best = self.likeliest()
            self._grow(best, self.candidates)
            for lack in best:
                instead = [c for c in self.candidates if c.robot in (None, lack.robot)]
                self._grow(best - {lack}, instead)
            if self.likeliest() == best:
                return self

    def set_of(self, lacks: Lacks) -> CameraSet:
        """A set that was fitted, or the part of one that is fitted now."""
        if lacks not in self.fitted:
            whole = next(own for names, own in self.fitted.items() if lacks < names)
            rest = [lack for lack in whole.lacks if lack in lacks]
            self.fitted[lacks] = self.fitter.fit(rest, whole)
        return self.fitted[lacks]

    def likeliest(self, dispersion: float = 1.0) -> Lacks:
        """The set of the greatest posterior."""
        return max(self.fitted, key=lambda lacks: self.log_posterior(lacks, dispersion))

    def log_posterior(self, lacks: Lacks, dispersion: float = 1.0) -> float:
        """Log evidence and prior of a set that was fitted."""
        return self.fitted[lacks].log_evidence(dispersion) + self.log_prior(lacks)

    def log_prior(self, lacks: Collection[Lack]) -> float:
        """Log prior: of what all lack, and of what each robot does beside it, as if alone."""
        own = {lack.robot: 0 for lack in self.candidates}
        for lack in lacks:
            own[lack.robot] += 1
        return sum(log_prior_of_effects(count, len(catalogue())) for count in own.values())

    def posterior(self, dispersion: float, robot: int | None = None) -> dict[Lacks, float]:
        """Probability of each set, likeliest first, where the question is if anything is missing.

        Args:
            dispersion: of the blocks.
            robot: of which something may be missing alone; None: of all.
        """
        sets = list(self.fitted)
        logs = np.array([self.log_posterior(lacks, dispersion) for lacks in sets])
        blocks = np.array([self._blocks_of(lacks) for lacks in sets])
        nothing = np.array([all(lack.robot != robot for lack in lacks) for lacks in sets])
        p = probabilities(logs, blocks / dispersion, nothing).tolist()
        found = dict(zip(sets, p, strict=True))
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def dispersion(self) -> float:
        """By how much blocks scatter more than the likeliest set says they would; at least 1.

        Its log odds against a set with one effect more gain (y - p) l in a frame whose bit y has
        the chance p and log odds ratio l. Squares of the gains of blocks over their variance are 1
        where frames are independent; the median over all such effects is taken.
        """
        best = self.likeliest()
        ratios = [
            _scatter(self.fitter.cameras, self.fitted[best], self.fitted[more])
            for lack in self.candidates
            if lack.robot is None and (more := best | {lack}) != best and more in self.fitted
        ]
        known = [ratio for ratio in ratios if np.isfinite(ratio)]
        return max(1.0, float(np.median(known))) if known else 1.0

    def _grow(self, lacks: Lacks, among: Sequence[Lack]) -> None:
        """Fits a set with one effect more, of each of some; those that are likely anew as a whole.

        The numbers of the others stay at first, and what is unlikely so is left as it is.
        """
        if len(lacks) >= MOST:
            return
        self.progress(f"effect {len(lacks) + 1}")
        begin = self.set_of(lacks)
        fresh = [more for lack in among if (more := lacks | {lack}) not in self.fitted]
        for more in fresh:
            (lack,) = more - lacks
            self.fitted[more] = self.fitter.with_more(begin, lack)
        least = self.log_posterior(self.likeliest()) - BEYOND
        for more in fresh if begin.numbers else ():
            own = self.fitted[more]
            worth = own.log_evidence() > begin.log_evidence() + WORTH
            if worth and self.log_posterior(more) > least:
                self.fitted[more] = self.fitter.fit(own.lacks, own)

    def _blocks_of(self, lacks: Lacks) -> np.ndarray:
        """(B,) log likelihood of each block of each camera."""
        if lacks not in self._blocks:
            pairs = zip(self.fitter.cameras, self.fitted[lacks].models, strict=True)
            told = [np.bincount(c.block, np.nan_to_num(c.likelihood(m))) for c, m in pairs]
            self._blocks[lacks] = np.concatenate(told)
        return self._blocks[lacks]


def _scatter(cameras: Sequence[Detections], one: CameraSet, other: CameraSet) -> float:
    """Squares of the gains of blocks of one set against another, over their variance by it."""
    squares = variance = 0.0
    for camera, *models in zip(cameras, one.models, other.models, strict=True):
        use = np.isfinite(camera.likelihood(models[0]))
        p, q = (
            np.clip(camera.reported(m, camera.frames.has_raw), SURE, 1 - SURE)[use] for m in models
        )
        odds = np.log(p / (1 - p)) - np.log(q / (1 - q))
        gains = np.bincount(camera.block[use], (camera.bits[use] - p) * odds)
        squares += float(np.sum(gains**2))
        variance += float(np.sum(p * (1 - p) * odds**2))
    return squares / variance if variance > 0 else np.nan
