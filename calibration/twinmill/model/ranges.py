# SPDX-License-Identifier: Apache-2.0
"""Intervals of a model's numbers, and samples of them that go together, for randomisation."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import tomlkit
import twinmill_native as native
from scipy.stats import norm

from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import NORMAL_95, effect_names

CUT = 0.005  # of a normal outside its bounds; less changes its mean by 1.5 % of its std, or less
ROUNDS = 200  # of samples drawn anew because they were out of bounds
SPREAD = {"theta_a1": "idiosyncrasy.theta_a1_std", "theta_a2": "idiosyncrasy.theta_a2_std"}


@dataclass(frozen=True)
class Quantity:
    """A number of the model that is known to within an interval.

    Attributes:
        name, unit: in the model.
        value: most likely.
        std: half a 95 % interval over 1.96.
        min, max: bounds of the quantity.
        source: `fit` (its errors go together with others'), `std` (they do not) or `robots` (how
            robots of the kind differ).
    """

    name: str
    unit: str
    value: float
    std: float
    min: float
    max: float
    source: str

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval, cut at the bounds."""
        half = NORMAL_95 * self.std
        return max(self.min, self.value - half), min(self.max, self.value + half)

    @property
    def outside(self) -> float:
        """Share of its normal that lies out of bounds."""
        ends = norm(self.value, self.std)
        return float(ends.cdf(self.min) + ends.sf(self.max))

    def to_json(self) -> dict[str, Any]:
        """Its fields and interval."""
        low, high = self.interval
        return {**vars(self), "low": low, "high": high}


@dataclass(frozen=True)
class Ranges:
    """Quantities, how they go together, and samples.

    Attributes:
        quantities: P of them.
        covariance: (P, P), of the normal before bounds cut it off.
        samples: (N, P), all within bounds.
        seed: of the samples.
        tried: draws that it took: those out of bounds were drawn anew.
    """

    quantities: list[Quantity]
    covariance: np.ndarray
    samples: np.ndarray
    seed: int
    tried: int

    @property
    def truncated(self) -> list[Quantity]:
        """Those that a bound cuts off so far that samples have another mean and covariance."""
        return [q for q in self.quantities if q.outside > CUT]

    def to_json(self) -> dict[str, Any]:
        """For all three files."""
        return {
            "seed": self.seed,
            "truncated": [q.name for q in self.truncated],
            "quantities": [q.to_json() for q in self.quantities],
            "covariance": self.covariance.tolist(),
            "samples": self.samples.tolist(),
        }


def quantities(file: ModelFile, model: native.Model) -> list[Quantity]:
    """Those with a standard error in the model file; clocks are of a log and not among them.

    Args:
        file: with the errors.
        model: with the values: the file's, or that of one of its robots.
    """
    covariance = file.covariance
    fitted = dict(zip(covariance.names, np.sqrt(np.diag(covariance.values)), strict=True))
    stds = {**_stds(file), **fitted}
    found = []
    for v in model.values():
        name = v["name"]
        spread = model.get(SPREAD[name]) if name in SPREAD else 0.0
        std = spread or stds.get(name, 0.0)
        if name.startswith("clock") or not (np.isfinite(std) and std > 0):
            continue
        source = "robots" if spread else "fit" if name in fitted else "std"
        ends = float(v["min"]), float(v["max"])
        found.append(Quantity(name, v["unit"], float(v["value"]), float(std), *ends, source))
    return found


def _stds(file: ModelFile) -> dict[str, float]:
    """Standard errors in the tables `std` of a model file, by the quantities' full names."""
    document = tomlkit.parse(file.text).unwrap()
    tables = {k: t for k, t in document.items() if isinstance(t, dict)}
    tables |= dict(zip(effect_names(file.model), document.get("effect", []), strict=True))
    stds = {}
    for section, table in tables.items():
        for key, std in table.get("std", {}).items():
            each = enumerate(std) if isinstance(std, list) else [("", std)]
            for i, value in each:
                name = f"{section}.{key}" if i == "" else f"{section}.{key}.{i}"
                stds[name] = float(value)
    return stds


def ranges(file: ModelFile, model: native.Model, count: int, seed: int) -> Ranges:
    """Intervals and samples.

    Raises:
        ValueError: the model knows no error of its numbers, or is too near to its bounds.
    """
    known = quantities(file, model)
    if not known:
        raise ValueError(
            f"{file.path}: has no standard errors; fit it to logs first (twinmill fit), "
            "or write what you know into a table std."
        )
    covariance = np.diag([q.std**2 for q in known])
    fit = file.covariance
    place = {name: i for i, name in enumerate(fit.names)}
    own = [i for i, q in enumerate(known) if q.source == "fit"]
    theirs = [place[known[i].name] for i in own]
    covariance[np.ix_(own, own)] = fit.values[np.ix_(theirs, theirs)]
    try:
        samples, tried = sampled(known, covariance, count, seed)
    except ValueError as error:
        raise ValueError(f"{file.path}: {error}") from error
    return Ranges(known, covariance, samples, seed, tried)


def sampled(
    known: list[Quantity], covariance: np.ndarray, count: int, seed: int
) -> tuple[np.ndarray, int]:
    """(count, P) of the multivariate normal within the bounds, and how many draws that took.

    What lies outside is drawn anew.

    Raises:
        ValueError: nearly all samples lie outside, as the end of a sentence.
    """
    random = np.random.default_rng(seed)
    mean, low, high = (np.array([getattr(q, k) for q in known]) for k in ("value", "min", "max"))
    kept = np.zeros((0, len(known)))
    outside = np.zeros(len(known))
    for done in range(ROUNDS):
        drawn = random.multivariate_normal(mean, covariance, size=count, method="eigh")
        out = (drawn < low) | (drawn > high)
        outside += out.sum(axis=0)
        good = np.flatnonzero(~out.any(axis=1))
        if len(kept) + len(good) >= count:
            last = int(good[count - len(kept) - 1]) if count > len(kept) else -1
            return np.vstack([kept, drawn[good]])[:count], done * count + last + 1
        kept = np.vstack([kept, drawn[good]])
    worst = known[int(np.argmax(outside))]
    raise ValueError(
        f"hardly any sample is within all bounds; {worst.name} = {worst.value:g} with a std of "
        f"{worst.std:g} is often outside {worst.min:g} to {worst.max:g}: record logs that tell it."
    )
