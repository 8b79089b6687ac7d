# SPDX-License-Identifier: Apache-2.0
"""Fits free quantities to whitened one-step errors: robust, within bounds, with uncertainties."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from twinmill.model.freedom import Estimate, Free
from twinmill.predict.problem import CLOCK, CLOCK_RATE, GAINS, Scene

HUBER_SIGMA = 3.5
BLOCK_S = 4.0  # errors of one block may hang together; blocks do not
SEEN = 0.5  # times the prior's width: a wider estimate is the prior's, not the log's
RATE_PRIOR_PPM = 30.0  # of ordinary crystals against each other
ALIKE = 0.03  # standard deviation of gains among robots of a kind where the model tells none
AT_BOUND = 0.01  # share of the range that counts as at the bound
CHORDS = 3  # steps with the same slopes


@dataclass(frozen=True)
class Solution:
    """Result of a fit: estimates of the shared quantities, each measurement's own, chi2.

    The own ones are clock and gains, by name, where these were free.
    """

    estimates: list[Estimate]
    own: list[dict[str, Estimate]]
    chi2: float

    @property
    def clocks(self) -> list[dict[str, Estimate]]:
        """Offset and rate by measurement; empty where they were not free."""
        return [{k: e for k, e in own.items() if k in (CLOCK, CLOCK_RATE)} for own in self.own]


def solve(
    scenes: list[Scene],
    free: list[Free],
    masks: list[np.ndarray] | None = None,
    rounds: int = 40,
    precision: float = 1e-9,
) -> Solution:
    """Fits, and leaves the values in the scenes' models.

    Args:
        scenes: measurements; each with a free clock gets an offset and a rate of its own, each with
            free gains these.
        free: quantities shared by all, but for a robot of which the model states its own.
        masks: (S,) bool per scene: the steps to fit on; all if None.
        rounds: at most so many evaluations.
        precision: relative change of chi2 at which the fit ends.
    """
    system = System(scenes, free, masks)
    if not system.unknowns:
        left = np.clip(system.residuals(system.start), -HUBER_SIGMA, HUBER_SIGMA)
        return Solution([], [{} for _ in scenes], float(np.mean(left**2)))
    found = least_squares(
        system.residuals,
        system.start,
        jac=system.jacobian,
        loss="huber",
        f_scale=HUBER_SIGMA,
        bounds=(system.low, system.high),
        x_scale=np.maximum(system.step, 1e-9),
        xtol=1e-7,
        ftol=precision,
        max_nfev=rounds,
    )
    system.store(found.x)
    return system.solution(found.x)


def excited(scenes: list[Scene], base: list[Free], others: list[Free]) -> list[Free]:
    """Those base quantities that the logs tell beside the others: the rest would only wander."""
    system = System(scenes, base + others)
    jacobian = system.jacobian(system.start)
    std = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
    return [f for f, s in zip(base, std, strict=False) if s < SEEN * f.prior_std]


def _clock_quantities(scene: Scene) -> list[Free]:
    """Offset and rate of one measurement's clock."""
    offset_s, rate_ppm = scene.model.get(CLOCK), scene.model.get(CLOCK_RATE)
    return [
        Free(CLOCK, "s", offset_s, offset_s - 0.3, offset_s + 0.3, 0.3, 0.002),
        Free(CLOCK_RATE, "ppm", 0.0, -500.0, 500.0, RATE_PRIOR_PPM, 5.0, rate_ppm),
    ]


def gain_spread(model, name: str) -> float:
    """Standard deviation of one of GAINS among robots: the model's, or a usual one."""
    return model.get(f"idiosyncrasy.{name}_std") or ALIKE


def _gain_quantities(scene: Scene) -> list[Free]:
    """What is one robot's own, not stated by the model file."""
    model = scene.model
    return [
        Free(n, "1", 1.0, 0.2, 3.0, gain_spread(model, n), 0.002, model.get(n))
        for n in GAINS
        if n not in scene.stated
    ]


def huber(z: np.ndarray) -> float:
    """Robust chi2 of whitened errors (Huber 1964)."""
    size = np.abs(z)
    return float(np.where(size < HUBER_SIGMA, z**2, HUBER_SIGMA * (2 * size - HUBER_SIGMA)).sum())


class System:
    """The stacked residuals of all scenes, and a prior row for each unknown."""

    def __init__(
        self, scenes: list[Scene], free: list[Free], masks: list[np.ndarray] | None = None
    ) -> None:
        self.scenes, self.free = scenes, free
        self.masks = masks or [np.ones(len(s.grid.source), bool) for s in scenes]
        self.columns = []  # per scene: places of its names in the vector of unknowns
        unknowns = list(free)
        for scene in scenes:
            stated = scene.stated
            own = [i for i, f in enumerate(free) if f.name not in stated]
            alone = _clock_quantities(scene) if scene.clock_free else []
            alone += _gain_quantities(scene) if scene.gains_free else []
            own += range(len(unknowns), len(unknowns) + len(alone))
            unknowns += alone
            self.columns.append(own)
        self.unknowns = unknowns
        self.low, self.high, self.step, self.prior, centre = (
            np.array([getattr(u, key) for u in unknowns])
            for key in ("min", "max", "step", "prior_std", "start")
        )
        margin = 1e-6 * (self.high - self.low)
        self.centre = centre
        begin = np.array([u.start if u.begin is None else u.begin for u in unknowns])
        self.start = np.clip(begin, self.low + margin, self.high - margin)

    def _names(self, i: int) -> list[str]:
        return [self.unknowns[c].name for c in self.columns[i]]

    def _whitened(self, rows: np.ndarray) -> np.ndarray:
        """(B, P) unknowns to (B, R) whitened errors of all scenes, then the prior's rows."""
        parts = []
        for i, (scene, mask) in enumerate(zip(self.scenes, self.masks, strict=True)):
            # Rows that differ only in other scenes' clocks are one to this scene.
            own, place = np.unique(rows[:, self.columns[i]], axis=0, return_inverse=True)
            white = scene.whitened(self._names(i), own)[:, mask].reshape(len(own), -1)
            parts.append(white[place.ravel()])
        return np.concatenate([*parts, (rows - self.centre) / self.prior], axis=1)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """(R,) whitened errors at the unknowns x, then the prior's rows."""
        return self._whitened(x[None])[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """One-sided differences, upwards unless the bound is nearer than the step."""
        step = np.where(x + self.step <= self.high, self.step, -self.step)
        values = self._whitened(np.vstack([x, x + np.diag(step)]))
        return ((values[1:] - values[0]) / step[:, None]).T

    def newton(self, slopes: np.ndarray, masks: list[np.ndarray]) -> np.ndarray:
        """Unknowns that fit the masked steps, from the start by Newton steps of these slopes.

        Args:
            slopes: (R, P) jacobian at the start, all steps.
            masks: (S,) bool per scene.
        """
        rows = np.concatenate([np.repeat(m, 3) for m in masks] + [np.ones(len(self.start), bool)])
        own, x, left = slopes[rows], self.start, self.residuals(self.start)[rows]
        for _ in range(CHORDS):
            weight = np.minimum(1, HUBER_SIGMA / np.maximum(np.abs(left), 1e-12))
            normal = own.T @ (own * weight[:, None])
            moved = np.clip(
                x - np.linalg.solve(normal, own.T @ (left * weight)), self.low, self.high
            )
            then = self.residuals(moved)[rows]
            if huber(then) >= huber(left):
                break
            x, left = moved, then
        return x

    def store(self, x: np.ndarray) -> None:
        """Puts the unknowns into the scenes' models."""
        for i, scene in enumerate(self.scenes):
            for name, value in zip(self._names(i), x[self.columns[i]], strict=True):
                scene.model.set(name, float(value))

    def solution(self, x: np.ndarray) -> Solution:
        """Estimates and what they leave at x."""
        residual = self.residuals(x)
        std = self._standard_errors(self.jacobian(x), residual)
        estimates = [self._estimate(u, x[p], std[p]) for p, u in enumerate(self.unknowns)]
        shared = len(self.free)
        own = [{estimates[c].name: estimates[c] for c in cs if c >= shared} for cs in self.columns]
        data = np.clip(residual[: -len(x)], -HUBER_SIGMA, HUBER_SIGMA)
        return Solution(estimates[:shared], own, float(np.mean(data**2)))

    def _estimate(self, unknown: Free, value: float, std: float) -> Estimate:
        near = AT_BOUND * (unknown.max - unknown.min)
        at_bound = value - unknown.min < near or unknown.max - value < near
        return Estimate(
            unknown.name,
            float(value),
            float(std),
            unknown.unit,
            bool(at_bound),
            bool(std < SEEN * unknown.prior_std),
        )

    def blocks(self) -> np.ndarray:
        """(R,) number of the 4 s block that each whitened error belongs to, over all scenes."""
        label = np.concatenate(
            [
                np.repeat(1e6 * i + s.grid.t_s[m] // BLOCK_S, 3)
                for i, (s, m) in enumerate(zip(self.scenes, self.masks, strict=True))
            ]
        )
        return np.unique(label, return_inverse=True)[1]

    def _standard_errors(self, jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Sandwich over 4 s blocks (Liang and Zeger 1986): honest where errors hang together."""
        bread = np.linalg.pinv(jacobian.T @ jacobian)
        weight = np.minimum(1, HUBER_SIGMA / np.maximum(np.abs(residual), 1e-12))
        pull = jacobian * (residual * weight)[:, None]
        label = self.blocks()
        sums = np.zeros((label.max() + 1, len(bread)))
        np.add.at(sums, label, pull[: len(label)])
        prior = np.diag(1 / self.prior**2)
        covariance = bread @ (sums.T @ sums + prior) @ bread
        return np.sqrt(np.maximum(np.diag(covariance), np.diag(bread)))
