# SPDX-License-Identifier: Apache-2.0
"""Where the fit of an effect begins that has a place, a moment or a limit.

The errors change with such a quantity in no smooth way, so that a fit finds what is near its begin
alone. Of a grid of values the one is taken that explains most of what is left, if all else were
linear.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
import twinmill_native as native

from twinmill.estimation.score_fit import ScoreFit
from twinmill.model.parameters import (
    LEVER_EFFECT,
    Parameter,
    catalogue,
    effect_names,
    effect_parameters,
    lasts_for_a_while,
    with_role,
)
from twinmill.predict.datasets import Dataset, ErrorDataset, Trajectory
from twinmill.predict.windows import CHANNELS, HORIZONS_S

PLACES = 9  # along each side of the floor that was driven
RADII = (0.12, 0.2, 0.35)  # of a patch, as a share of the longer side ...
LEAST_RADIUS_M = 0.15  # ... and at least
LIMITS = np.geomspace(0.25, 8.0, 16)  # times the usual one
EVERY_S = 2.0  # between moments ...
FINER = 10  # times which begin and end are looked for anew about those of the grid
MOST_MOMENTS = 100  # ... of which there are no more
SHORTEST_S = 4.0  # of what lasts for a while; what is shorter is a single moment
NEVER_S = 1e5  # later than any log ends
MARGIN = 0.05  # share of a log at each end, within which a moment is none


@dataclass(frozen=True)
class Candidate:
    """An effect that might be added, and the data sets and models that it might be added to."""

    name: str
    datasets: Sequence[ErrorDataset]
    models: Sequence[native.Model]

    @property
    def instance(self) -> str:
        """Name of the effect once it is added."""
        count = self.models[0].effects.count(self.name)
        return f"{self.name}#{count + 1}" if count else self.name

    @property
    def logs(self) -> list[Trajectory]:
        """Those data sets that are logs."""
        return [d for d in self.datasets if isinstance(d, Trajectory)]

    def named(self, role: str) -> list[str]:
        """Full names of the effect's parameters of a role."""
        return [f"{self.instance}.{key}" for key in with_role(self.name, role)]

    def changes(
        self, rows: Sequence[np.ndarray], values: Callable[[list[Parameter]], np.ndarray]
    ) -> list[np.ndarray]:
        """(B, R) by which each data set's rows change with the effect.

        Args:
            rows: (R,) of each data set, without it.
            values: (B, P) values of its P parameters.
        """
        found = []
        for dataset, model, row in zip(self.datasets, self.models, rows, strict=True):
            model = model.copy()
            model.add_effect(self.name)
            parameters = effect_parameters(model, effect_names(model)[-1], fresh=True)
            names = [p.name for p in parameters]
            found.append(row - dataset.rows(model, names, values(parameters)))
        return found


@dataclass(frozen=True)
class Left:
    """Prediction errors that no change of a fit's free parameters can reduce, to first order.

    All are weighted such that their squares add up to the fit's cost. A candidate that is not in
    the model yet is compared with them: what of it the free parameters could do, too, is taken off.

    Attributes:
        weights: for each data set (R,), by which its R errors are multiplied: roots of their
            weights in the fit's cost.
        rests: for each data set (R,) weighted errors, without units, less their part along the
            columns of the free parameters.
        bases: for each data set its R rows of an orthonormal basis of these P columns. Below all
            data sets, P rows of the priors belong to the basis, and are not kept here: so the rows
            of the data sets alone are orthonormal only as far as the priors are weak.
    """

    weights: Sequence[np.ndarray]
    rests: Sequence[np.ndarray]
    bases: Sequence[np.ndarray]

    @classmethod
    def of(cls, fit: ScoreFit, basis: np.ndarray, rest: np.ndarray) -> "Left":
        """Errors that a fit leaves; see `projected`."""
        rows, _ = fit.state
        ends = np.cumsum([len(r) for r in rows])
        parts = (np.split(whole[: ends[-1]], ends[:-1]) for whole in (rest, basis))
        return cls([np.sqrt(fit.weight(i, r)) for i, r in enumerate(rows)], *parts)

    def at(self, members: Sequence[int]) -> "Left":
        """Errors of some data sets alone: a candidate changes nothing in the others."""
        kinds = (self.weights, self.rests, self.bases)
        return Left(*([kind[i] for i in members] for kind in kinds))

    def products(self, columns: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """(S, k) products of S times k changes with what is left, and (S, k, k) with each other.

        Args:
            columns: (S, k, R) of each data set.
        """
        moment = gram = free = np.asarray(0.0)
        for w, rest, basis, c in zip(self.weights, self.rests, self.bases, columns, strict=True):
            whitened = w * c
            moment = moment + whitened @ rest
            gram = gram + whitened @ whitened.swapaxes(1, 2)
            free = free + whitened @ basis
        return moment, gram - free @ np.swapaxes(free, 1, 2)

    def products_of_shares(
        self, changes: Sequence[np.ndarray], shares: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Products with changes that are there for a share of each prediction's time.

        A share is that of all channels of a prediction, so that these are summed first.

        Args:
            changes: (k, R) of each data set.
            shares: (S, W, H) of each data set.
        """
        moment = gram = free = np.asarray(0.0)
        parts = zip(self.weights, self.rests, self.bases, changes, shares, strict=True)
        for w, rest, basis, change, share in parts:
            share = share.reshape(len(share), -1).astype(float)
            whitened, rest, basis = (
                a.reshape(len(a) // len(CHANNELS), len(CHANNELS), a.shape[1])
                for a in ((w * change).T, rest[:, None], basis)
            )
            moment = moment + share @ _over_channels(whitened, rest)
            gram = gram + share**2 @ _over_channels(whitened, whitened)
            free = free + share @ _over_channels(whitened, basis)
        count, k = len(shares[0]), len(changes[0])
        free = free.reshape(count, k, self.bases[0].shape[1])
        return moment, gram.reshape(count, k, k) - free @ free.swapaxes(1, 2)


def _over_channels(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(P, k * j) sums over channels of products of (P, C, k) and (P, C, j)."""
    return (a.swapaxes(1, 2) @ b).reshape(len(a), a.shape[2] * b.shape[2])


def projected(fit: ScoreFit) -> tuple[np.ndarray, np.ndarray]:
    """Free columns of a fit, and the rest of all rows, whitened, its prior's P rows last.

    Returns:
        (R + P, P) orthonormal columns of what is free; (R + P,) rows less their part along these.
    """
    left, columns, _ = fit.whitened(range(len(fit.datasets)))
    if not len(fit.x):
        return np.zeros((len(left), 0)), left
    padded = np.concatenate([left, (fit.usual - fit.x) / fit.std * -1])
    basis = np.linalg.qr(np.vstack([columns, np.diag(1 / fit.std)]))[0]
    return basis, padded - basis @ (basis.T @ padded)


class Starts(Protocol):
    """Starts of one effect, and how the rows change from each."""

    def best(self, left: Left) -> dict[str, float]:
        """Start that explains most of the errors, as values by name."""
        ...


def starts_of(
    name: str,
    models: Sequence[native.Model],
    datasets: Sequence[ErrorDataset],
    rows: Sequence[np.ndarray],
) -> Starts | None:
    """Starts of an effect; None if it has no place, moment or limit.

    Args:
        name: of the effect.
        models: without it, one for each data set.
        datasets: that the rows are of.
        rows: (R,) of each data set.
    """
    candidate = Candidate(name, datasets, models)
    if with_role(name, "moment"):
        return Whiles.of(candidate, rows) if lasts_for_a_while(name) else _moments(candidate, rows)
    if with_role(name, "place"):
        return _places(candidate, rows) if candidate.logs else None
    if name == LEVER_EFFECT:
        return Told.of_lever(candidate)
    return Grid.of(candidate, rows) if with_role(name, "limit") else None


@dataclass(frozen=True)
class Told:
    """A start that the data sets tell by themselves."""

    start: dict[str, float]

    @classmethod
    def of_lever(cls, candidate: Candidate) -> "Told | None":
        """Where the point is tracked, the median of the logs whose check tells it; None if none."""
        told = [lever_m for d in candidate.logs if (lever_m := d.measurement.lever_m)]
        if not told:
            return None
        names = [f"{candidate.instance}.{key}" for key in ("x_m", "y_m")]
        return cls(dict(zip(names, np.median(told, axis=0).tolist(), strict=True)))

    def best(self, left: Left) -> dict[str, float]:
        """See Starts."""
        return self.start


@dataclass(frozen=True)
class Grid:
    """Limits, and (S, 1, R) by which each data set's rows change at usual strength from each."""

    starts: list[dict[str, float]]
    columns: list[np.ndarray]

    @classmethod
    def of(cls, candidate: Candidate, rows: Sequence[np.ndarray]) -> "Grid":
        """Grid for an effect with a limit: about the usual one."""
        card = {p["name"]: p for p in catalogue()[candidate.name]["parameters"]}
        limits = {f"{candidate.instance}.{k}": card[k] for k in with_role(candidate.name, "limit")}
        starts = [
            {name: float(min(k * p["default"], p["max"])) for name, p in limits.items()}
            for k in LIMITS
        ]

        def values(parameters: list[Parameter]) -> np.ndarray:
            return np.array([[start.get(p.name, p.value) for p in parameters] for start in starts])

        return cls(starts, [c[:, None] for c in candidate.changes(rows, values)])

    def best(self, left: Left) -> dict[str, float]:
        """See Starts."""
        return self.starts[int(np.argmax(_gains(*left.products(self.columns))))]


@dataclass(frozen=True)
class Switched:
    """Starts of an effect that is on in some places, or from some moment on.

    While it is on it is always the same. So a prediction changes by the share of its time in which
    it is on, and one pass over the logs for each size, with the effect on all the time, tells of
    all starts.

    Attributes:
        starts: S of them.
        changes: (k, R) by which each data set's rows change by each of k sizes at usual strength.
        shares: (S, W, H) of each data set: of each prediction's time that it is on.
    """

    starts: list[dict[str, float]]
    changes: list[np.ndarray]
    shares: list[np.ndarray]

    def best(self, left: Left) -> dict[str, float]:
        """See Starts."""
        products = left.products_of_shares(self.changes, self.shares)
        return self.starts[int(np.argmax(_gains(*products)))]


@dataclass(frozen=True)
class Whiles:
    """Starts of an effect that begins at one moment and ends at another; see Switched.

    Of a while that is what begins with it, less what begins where it ends.

    Attributes:
        keys: full names of begin and end.
        at_s: (T,) moments, s since the first command.
        changes: see Switched; of what never ends.
        datasets: of which they are.
    """

    keys: list[str]
    at_s: np.ndarray
    changes: list[np.ndarray]
    datasets: Sequence[Dataset]

    @classmethod
    def of(cls, candidate: Candidate, rows: Sequence[np.ndarray]) -> "Whiles":
        """Trial stretches of an effect that begins and ends."""
        begin, end = candidate.named("moment")
        changes = _always_on(candidate, rows, {begin: 0.0, end: NEVER_S})
        return cls([begin, end], _grid_s(candidate), changes, candidate.datasets)

    def best(self, left: Left) -> dict[str, float]:
        """See Starts; a robot may stand at a moment of the grid, where no fit gets on from."""
        every_s = (self.at_s[-1] - self.at_s[0]) / (len(self.at_s) - 1)
        beside_s = np.linspace(-every_s, every_s, 2 * FINER + 1)
        found_s = self._among(self.at_s, left)
        fine_s = np.unique(found_s[:, None] + beside_s)
        return dict(zip(self.keys, self._among(fine_s, left).tolist(), strict=True))

    def _among(self, at_s: np.ndarray, left: Left) -> np.ndarray:
        """(2,) begin and end of these moments (T,) that take most of the rest."""
        count = len(at_s)
        columns = (
            (c * _of_rows(_since(d, at_s))[:, None]).reshape(1, -1, c.shape[1])
            for c, d in zip(self.changes, self.datasets, strict=True)
        )
        moment, gram = left.products(columns)
        moment = moment.reshape(count, -1)
        gram = gram.reshape(count, moment.shape[1], count, -1).swapaxes(1, 2)
        a, b = np.triu_indices(count, 1)
        long = at_s[b] - at_s[a] >= min(SHORTEST_S, at_s[-1] - at_s[0])
        a, b = a[long], b[long]
        between = gram[a, a] + gram[b, b] - gram[a, b] - gram[b, a]
        k = int(np.argmax(_gains(moment[a] - moment[b], between)))
        return at_s[[a[k], b[k]]]


def _always_on(
    candidate: Candidate, rows: Sequence[np.ndarray], on: dict[str, float]
) -> list[np.ndarray]:
    """(k, R) by which each data set's rows change by each size alone, where `on` holds."""
    sizes = candidate.named("size")

    def values(parameters: list[Parameter]) -> np.ndarray:
        off = {p.name: on.get(p.name, p.usual) for p in parameters}
        own = {p.name: p.value for p in parameters}
        return np.array([[(off | {s: own[s]})[p.name] for p in parameters] for s in sizes])

    return candidate.changes(rows, values)


def _moments(candidate: Candidate, rows: Sequence[np.ndarray]) -> Switched:
    """Trial moments of an effect that begins at one, and never ends."""
    (begin,) = candidate.named("moment")
    at_s = _grid_s(candidate)
    changes = _always_on(candidate, rows, {begin: 0.0})
    shares = [_since(d, at_s) for d in candidate.datasets]
    return Switched([{begin: float(t_s)} for t_s in at_s], changes, shares)


def _grid_s(candidate: Candidate) -> np.ndarray:
    """(T,) moments over the time of all logs, s since the first command."""
    times_s = np.concatenate([d.start_s for d in candidate.logs])
    low_s, high_s = np.quantile(times_s, (MARGIN, 1 - MARGIN))
    return np.linspace(low_s, high_s, int(np.clip((high_s - low_s) / EVERY_S, 2, MOST_MOMENTS)))


def _since(dataset: Dataset, at_s: np.ndarray) -> np.ndarray:
    """(T, W, H) share of each prediction's time that is after each moment."""
    assert isinstance(dataset, Trajectory)
    ahead_s = np.array(HORIZONS_S)
    end_s = dataset.start_s[:, None] + ahead_s
    return np.clip((end_s - at_s[:, None, None]) / ahead_s, 0, 1).astype(np.float32)


def _places(candidate: Candidate, rows: Sequence[np.ndarray]) -> Switched:
    """Trial places of an effect with a round one: over the floor that was driven."""
    keys = [f"{candidate.instance}.{key}" for key in ("x_m", "y_m", "radius_m")]
    tracks = [d.measurement.track for d in candidate.logs]
    xy = np.concatenate([t.pose[t.segment >= 0, :2] for t in tracks])
    low, high = np.nanquantile(xy, 0.03, axis=0), np.nanquantile(xy, 0.97, axis=0)
    side_m = float(np.max(high - low))
    places = [*product(*np.linspace(low, high, PLACES).T)]
    nearest_m = [np.nanmin(np.hypot(*(xy[::20] - place).T)) for place in places]
    circles = [
        (*place, radius_m)
        for radius_m in sorted({max(LEAST_RADIUS_M, share * side_m) for share in RADII})
        for place, away_m in zip(places, nearest_m, strict=True)
        if away_m < radius_m
    ]
    entry = {p["name"]: p for p in catalogue()[candidate.name]["parameters"]}
    middle = (low + high) / 2
    everywhere = dict(zip(keys, (*middle.tolist(), entry["radius_m"]["max"]), strict=True))
    return Switched(
        [dict(zip(keys, map(float, circle), strict=True)) for circle in circles],
        _always_on(candidate, rows, everywhere),
        [_inside(d, np.array(circles)) for d in candidate.datasets],
    )


def _inside(dataset: Dataset, circles: np.ndarray) -> np.ndarray:
    """(S, W, H) share of each prediction's poses that are inside each of (S, 3) circles."""
    assert isinstance(dataset, Trajectory)
    x_m, y_m = np.ascontiguousarray(dataset.measurement.track.pose[:, :2].T)
    first = dataset.windows.starts[:, None]
    last = np.maximum(dataset.windows.ends, first)
    steps = np.maximum(last - first, 1)
    shares = np.empty((len(circles), *last.shape), np.float32)
    places, at = np.unique(circles[:, :2], axis=0, return_inverse=True)
    for number, (x, y) in enumerate(places):  # all at once fill the memory
        square = (x_m - x) ** 2 + (y_m - y) ** 2
        for s in np.flatnonzero(at == number):
            count = np.cumsum(square < circles[s, 2] ** 2, dtype=np.int32)
            shares[s] = (count[last] - count[first]) / steps
    return shares


def _of_rows(shares: np.ndarray) -> np.ndarray:
    """(S, W, H) shares to (S, R): the same for all channels of a prediction."""
    return np.repeat(shares.reshape(len(shares), -1), len(CHANNELS), axis=1)


def _gains(moment: np.ndarray, gram: np.ndarray) -> np.ndarray:
    """(S,) fall of the squares by k columns with these (S, k) products and (S, k, k) squares."""
    whole = gram + 1e-9 * np.eye(gram.shape[-1])
    return np.sum(moment * np.linalg.solve(whole, moment[..., None])[..., 0], axis=1)
