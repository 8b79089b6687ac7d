# SPDX-License-Identifier: Apache-2.0
"""The published equations and nothing else, in NumPy: an independent program beside the twin.

Vega et al. 2024 (arXiv 2410.16444): unicycles that turn to one side while they see nobody in a cone
and to the other while they do. Nothing of the twin is in it.
"""

from dataclasses import dataclass

import numpy as np

LAST_S, SAMPLE_S = 10.0, 0.1
Each = float | np.ndarray  # the same in all worlds, or one for each


@dataclass(frozen=True)
class Points:
    """Swarms of points, W at once.

    Attributes:
        n: robots.
        v_mps, omega_radps: of the robots; the sign is that of a turn while somebody is seen.
        range_m, cone_rad: of what they see; the full angle.
        target_radius_m: of the disc that is seen; 0: the other's centre.
        miss_rate, false_rate: of single frames.
        delay_steps: how old what they see is.
        spread: standard deviation over robots of the factors on speed and on turn rate.
        side_m: of the square that they start in.
        exact: they move along arcs; else by forward Euler, as published.
        period_s: of a step.
    """

    n: int = 6
    v_mps: Each = 0.25
    omega_radps: Each = float(np.radians(45))
    range_m: Each = 1.1
    cone_rad: Each = float(np.radians(49))
    target_radius_m: float = 0.0
    miss_rate: Each = 0.0
    false_rate: Each = 0.0
    delay_steps: int = 0
    spread: Each = 0.0
    side_m: float = 1.2
    exact: bool = False
    period_s: float = 0.022

    def run(self, worlds: int, seed: int, duration_s: float = 120.0) -> "Ends":
        """Runs all worlds to their end."""
        random = np.random.default_rng(seed)
        shape = (worlds, self.n)
        xy = random.uniform(-self.side_m / 2, self.side_m / 2, (*shape, 2))
        theta = random.uniform(-np.pi, np.pi, shape)
        factors = 1 + _column(self.spread)[None] * random.standard_normal((2, *shape))
        v, omega = _column(self.v_mps) * factors[0], _column(self.omega_radps) * factors[1]
        steps = round(duration_s / self.period_s)
        stride = round(SAMPLE_S / self.period_s)
        old, samples = [], []
        for step in range(1, steps + 1):
            old.append(self._seen(xy, theta, random))
            seen = old.pop(0) if len(old) > self.delay_steps else np.zeros(shape, bool)
            turn = np.where(seen, omega, -omega)
            xy = xy + self._moved(v, turn, theta)
            theta = theta + turn * self.period_s
            if (steps - step) * self.period_s < LAST_S and (steps - step) % stride == 0:
                samples.append(_measured(xy, theta, _column(self.range_m)))
        return Ends(*np.mean(samples, axis=0))

    def _seen(self, xy: np.ndarray, theta: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """(W, n) what each robot's camera says."""
        dx, dy = (xy[:, None, :, k] - xy[:, :, None, k] for k in (0, 1))
        distance = np.hypot(dx, dy)
        np.einsum("wii->wi", distance)[:] = np.inf  # nobody sees himself
        cos, sin = np.cos(theta)[..., None], np.sin(theta)[..., None]
        bearing = np.abs(np.arctan2(cos * dy - sin * dx, cos * dx + sin * dy))
        half = _column(self.cone_rad)[..., None] / 2
        if self.target_radius_m:
            half = half + np.arcsin(np.minimum(self.target_radius_m / distance, 1))
        inside = (bearing < half) & (distance < _column(self.range_m)[..., None])
        seen = inside.any(axis=2)
        if np.any(self.miss_rate) or np.any(self.false_rate):
            wrong = np.where(seen, _column(self.miss_rate), _column(self.false_rate))
            seen ^= random.random(seen.shape) < wrong
        return seen

    def _moved(self, v: np.ndarray, turn: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """(W, n, 2) way of one step."""
        length, along = v * self.period_s, theta
        if self.exact:  # the chord of an arc
            half = turn * self.period_s / 2
            length, along = length * np.sinc(half / np.pi), theta + half
        return length[..., None] * np.stack([np.cos(along), np.sin(along)], axis=-1)


@dataclass(frozen=True)
class Ends:
    """Means over the last 10 s of each world, (W,) each.

    Attributes:
        circliness: (max r - min r) / min r of the distances from the middle.
        radius_m: their mean.
        rotation: mean of sin of the angle from the way outward to the way ahead.
        groups: of robots closer than the view range.
    """

    circliness: np.ndarray
    radius_m: np.ndarray
    rotation: np.ndarray
    groups: np.ndarray

    @property
    def classes(self) -> np.ndarray:
        """(W,) names, by circliness below 0.2 and up to 1, turning together, one group."""
        turning = np.abs(self.rotation) > 0.9
        return np.select(
            [
                (self.circliness < 0.2) & turning,
                self.circliness < 0.2,
                self.circliness < 1,
                self.groups < 1.5,
            ],
            ["milling", "jammed", "ellipsoidal", "cluster"],
            "separated",
        )


def _column(value: Each) -> np.ndarray:
    """One value, or one per world, as a column: (1, 1) or (W, 1)."""
    return np.atleast_1d(value)[:, None]


def _measured(xy: np.ndarray, theta: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """(4, W) in the order of Ends."""
    out = xy - xy.mean(axis=1, keepdims=True)
    r = np.hypot(out[..., 0], out[..., 1])
    rotation = (out[..., 0] * np.sin(theta) - out[..., 1] * np.cos(theta)) / r
    distance = np.hypot(*(xy[:, None, :, k] - xy[:, :, None, k] for k in (0, 1)))
    near = distance < range_m[..., None]
    for _ in range(int(np.ceil(np.log2(xy.shape[1])))):
        near = near @ near
    groups = (1 / near.sum(axis=2)).sum(axis=1)
    return np.array([(r.max(1) - r.min(1)) / r.min(1), r.mean(1), rotation.mean(1), groups])
