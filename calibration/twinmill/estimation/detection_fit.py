# SPDX-License-Identifier: Apache-2.0
"""Fits quantities of the camera to detections, and judges them on frames that were not fitted to.

`DetectionFit` answers what a search asks of `ScoreFit`. Its inside differs, since a detection is a
draw with a chance that the model predicts: it has a likelihood, and no noise floor over which an
error could be whitened. The likelihood has edges where a frame leaves the cone, hence no slopes: a
grid finds where to begin, and Powell's method goes on from there. Each half of the frames is judged
by a fit to the other.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from itertools import product

import numpy as np
import twinmill_native as native

from twinmill.estimation.detection_evidence import VOTE_WEIGHT, HeldOutFrames, weigh
from twinmill.model.parameters import Parameter, ParameterEstimate, stated_names
from twinmill.predict.detections import Detections

MOST_FRAMES = 10000  # a fit takes every Nth frame beyond
STRENGTHS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # times the usual one: where a fit may begin
FAR = (5.0, 10.0)  # more of them where only one quantity is looked for
MOST_EXTRA = 20  # frames of a vote beyond the model's
WIDER = 6  # times a step is doubled until the likelihood falls by more than its grain
FALL = 1.0  # of the log likelihood on both sides together: less may be the grain of frames
REACH = 0.5  # times the usual strength: how far a fit goes from where it begins


class DetectionFit:
    """A model of the camera fitted to detections; `x` holds the values, the models have them.

    Args:
        datasets: frames with poses.
        models: one for each data set (of its own robot).
        shared: parameters of all robots, but for what the model states of a robot.
    """

    def __init__(
        self,
        datasets: Sequence[Detections],
        models: Sequence[native.Model],
        shared: Sequence[Parameter],
    ) -> None:
        self.datasets, self.shared = list(datasets), list(shared)
        self.models = [m.copy() for m in models]
        self.x = np.array([p.value for p in shared], float)
        self.passes = 0
        self._stated = [
            stated_names(m, d.robot_id) for d, m in zip(self.datasets, self.models, strict=True)
        ]
        self._halves: list[np.ndarray] = []
        count = sum(len(d.frames.t_s) for d in self.datasets)
        raw = all(d.frames.has_raw for d in self.datasets)  # else few frames count as it is
        self._thin = slice(None, None, max(1, -(-count // MOST_FRAMES)) if raw else 1)

    # -- fit ------------------------------------------------------------------------------------

    def begin_at_best(self, fresh: Sequence[Parameter]) -> None:
        """Begins with what is new, the last ones, at the best of a grid of values."""
        head = self.x[: len(self.x) - len(fresh)]
        rows = [np.concatenate([head, row]) for row in starts(fresh)]
        self.x = max(rows, key=self.likelihood)

    def fit(self) -> "DetectionFit":
        """Maximises the likelihood of all frames and of each half; the models have the former."""
        self.x = self._maximised(self.x)
        self._halves = [self._maximised(self.x, 1 - half) for half in (0, 1)]
        self._put(self.x)
        return self

    def likelihood(self, x: np.ndarray, half: int | None = None, thin: bool = True) -> float:
        """Log likelihood at (P,) values, of the frames of one half or of both."""
        self._put(x)
        self.passes += 1
        pick = self._thin if thin else slice(None)
        total = 0.0
        for data, model in zip(self.datasets, self.models, strict=True):
            told = data.likelihood(model, pick)
            total += np.nansum(told if half is None else told[data.half[pick] == half])
        return float(total) * (self._thin.step if thin else 1)

    def _put(self, x: np.ndarray) -> None:
        """Puts values into the models."""
        for model, stated in zip(self.models, self._stated, strict=True):
            for p, value in zip(self.shared, x, strict=True):
                if p.name not in stated:
                    model.set(p.name, float(np.clip(value, p.min, p.max)))

    def _maximised(self, begin: np.ndarray, half: int | None = None) -> np.ndarray:
        """Values near `begin` with the greatest likelihood."""
        return maximised(lambda x: self.likelihood(x, half), begin, self.shared)

    # -- held out -------------------------------------------------------------------------------

    @cached_property
    def held_out(self) -> HeldOutFrames:
        """Predictions of either half by the fit to the other."""
        models = []
        for values in self._halves:
            self._put(values)
            models.append([m.copy() for m in self.models])
        self._put(self.x)
        return HeldOutFrames.of(self.datasets, models)

    @property
    def held_scores(self) -> np.ndarray:
        """(1,) RMS error of all chances over what such chances must err."""
        return np.array([self.held_out.score(self.datasets)])

    @property
    def held_cost(self) -> float:
        """-2 times the held-out log likelihood."""
        return -2.0 * sum(float(np.nansum(told)) for told in self.held_out.log_likelihood)

    @property
    def errors(self) -> np.ndarray:
        """(R,) reported bits less their chances, in all frames that count."""
        pairs = zip(self.datasets, self.models, strict=True)
        return np.concatenate(
            [(d.bits - d.reported(m, d.frames.has_raw))[d.usable] for d, m in pairs]
        )

    def against(self, less: "DetectionFit") -> tuple[float, float, float]:
        """As `ScoreFit.against`, over the excess with which blocks scatter."""
        found = weigh(self.datasets, self.held_out, less.held_out)
        return (
            2 * found.gain / found.excess,
            2 * found.log_ratio / found.excess,
            found.blocks_t,
        )

    # -- what the parameters change ---------------------------------------------------------------

    def trace(self, without: "DetectionFit", times: float) -> float:
        """Expected fall of the cost were the parameters so many times their usual strength.

        Twice the divergence (Kullback and Leibler 1951) from a fit without them, of the better
        sign.
        """
        told = []
        for sign in (-1, 1):
            self._put(np.array([p.usual + times * sign * p.strength for p in self.shared]))
            told.append(sum(_divergence(*each) for each in self._beside(without)))
        return 2 * max(told)

    def changed(self, before: "DetectionFit") -> float:
        """Share of the bits, raw or voted, that the difference to another fit changes."""
        raw, voted, count = 0.0, 0.0, 0
        for data, own, other in self._beside(before):
            raw += float(np.abs(data.chance(own) - data.chance(other))[data.usable].sum())
            voted += _votes_that_differ(data, own, other)
            count += int(data.usable.sum())
        return max(raw, voted) / count

    @property
    def in_view(self) -> float:
        """Share of the frames that have another robot in view, by the models' geometry."""
        pairs = zip(self.datasets, self.models, strict=True)
        return float(np.mean(np.concatenate([d.view(m)[d.usable] for d, m in pairs])))

    def _beside(
        self, other: "DetectionFit"
    ) -> Iterable[tuple[Detections, native.Model, native.Model]]:
        """Each data set with its model here and there."""
        return zip(self.datasets, self.models, other.models, strict=True)

    # -- uncertainty ----------------------------------------------------------------------------

    @cached_property
    def estimates(self) -> list[ParameterEstimate]:
        """Values with standard errors from the curvature of the likelihood, one by one."""
        made = []
        middle = self.likelihood(self.x, thin=False)
        for i, p in enumerate(self.shared):
            value, std = float(self.x[i]), self._std(i, middle)
            at_bound, known = bool(value in (p.min, p.max)), bool(np.isfinite(std))
            made.append(ParameterEstimate(p.name, value, std, p.unit, at_bound, known))
        self._put(self.x)
        return made

    def shared_estimates(self) -> list[ParameterEstimate]:
        """Estimates of shared parameters: here all, as no robot has a fitted camera of its own."""
        return self.estimates

    def _std(self, i: int, middle: float) -> float:
        """Error of one value: the shortest steps both ways that fall by more than the grain."""
        p = self.shared[i]
        for k in range(WIDER):
            step = 0.1 * abs(p.strength) * 2**k
            sides = np.clip(self.x[i] + np.array([-step, step]), p.min, p.max)
            fall = 2 * middle
            for side in sides:
                moved = self.x.copy()
                moved[i] = side
                fall -= self.likelihood(moved, thin=False)
            if fall > FALL:
                return float(np.sqrt(np.sum((sides - self.x[i]) ** 2) / (2 * fall)))
        return float("nan")


def maximised(
    worth: Callable[[np.ndarray], float],
    begin: np.ndarray,
    parameters: Sequence[Parameter],
    grain: float = 1e-2,
) -> np.ndarray:
    """Values within reach that are worth most, without derivatives (Powell 1964).

    Args:
        worth: of (P,) values.
        begin: (P,) near which they are looked for.
        parameters: P of them, with bounds and usual strengths.
        grain: to which values are found, times these.
    """
    if not len(begin):
        return begin
    unit = np.array([abs(p.strength) for p in parameters])
    low, high = (np.array([getattr(p, k) for p in parameters]) for k in ("min", "max"))
    low, high = np.maximum(low, begin - REACH * unit), np.minimum(high, begin + REACH * unit)
    from scipy.optimize import minimize  # most logs have no detections

    found = minimize(
        lambda x: -worth(x * unit),
        np.clip(begin, low, high) / unit,
        method="Powell",
        bounds=list(zip(low / unit, high / unit, strict=True)),
        options={"xtol": grain, "ftol": 1e-6, "maxiter": 3},
    )
    values = found.x * unit
    return values if worth(values) > worth(begin) else begin


def starts(fresh: Sequence[Parameter]) -> list[np.ndarray]:
    """Grid of (P,) values at which a fit of new numbers may begin."""
    grids = [_grid(p, far=len(fresh) == 1) for p in fresh]
    return [np.array(row) for row in product(*grids)]


def is_count(parameter: Parameter) -> bool:
    """True of a whole number, which has no slope."""
    return parameter.name.endswith("_frames")


def _grid(parameter: Parameter, far: bool) -> list[float]:
    """Neutral and values on both sides of it, within bounds."""
    p = parameter
    if is_count(p):
        return [float(n) for n in range(-MOST_EXTRA, MOST_EXTRA + 1)]
    steps = [*STRENGTHS, *(FAR if far else ())]
    values = {p.usual + s * p.strength for s in [0.0, *steps, *(-s for s in steps)]}
    return sorted({float(np.clip(v, p.min, p.max)) for v in values})


def _divergence(data: Detections, own: native.Model, other: native.Model) -> float:
    """Expected log likelihood ratio of a model to another one, were it true."""
    p, q = (data.chance(m)[data.usable] for m in (own, other))
    raw = float(np.sum(p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))
    return raw + VOTE_WEIGHT * _votes_that_differ(data, own, other)


def _votes_that_differ(data: Detections, own: native.Model, other: native.Model) -> int:
    """Number of frames in which the raw bits give one vote by a model and another by the other."""
    frames = [int(m.detection_model()["vote_frames"]) for m in (own, other)]
    if not data.frames.has_raw or frames[0] == frames[1]:
        return 0
    return int((data.voted(frames[0]) != data.voted(frames[1]))[data.usable].sum())
