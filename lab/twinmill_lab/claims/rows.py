# SPDX-License-Identifier: Apache-2.0
"""A number of ours beside the reference's, and whether they agree."""

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import binom

from twinmill.report import Figure
from twinmill.swarm.classes import interval

# Some hundred numbers are compared: at 3.5 standard deviations one in twenty such pages would
# find a difference where there is none.
SIGMAS = 3.5
LENGTH_OFF = 0.05  # the reference's own radii change by 9 % between steps of 5 and 22 ms


@dataclass(frozen=True)
class Row:
    """One number.

    Attributes:
        what: it is of.
        value, low, high: ours with its 95 % interval.
        reference: lowest and highest that the reference has; None: it has none.
        agrees: within sampling error; None without a reference.
        rule: by which they agree.
        known: why it is known to differ.
        unit: "%" for shares, which are kept as fractions.
        by: what figures need: kind, value on the axis.
    """

    what: str
    value: float
    low: float
    high: float
    reference: tuple[float, float] | None
    agrees: bool | None
    rule: str = ""
    unit: str = ""
    by: dict = field(default_factory=dict)
    known: str = ""

    @property
    def surprises(self) -> bool:
        """True if it differs from the reference and no known reason explains it."""
        return self.agrees is False and not self.known

    def to_json(self) -> dict:
        """Plain values."""
        return vars(self)


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper with what became of it.

    Attributes:
        name: in commands and file names.
        sentence: the claim.
        seen: whether our runs do what it says; None of a question, which claims nothing.
        finding: ours, in words.
        transcript: titles, each with commands and what they printed.
    """

    name: str
    title: str
    sentence: str
    seen: bool | None
    finding: str
    rows: list[Row]
    figures: list[Figure]
    transcript: list[tuple[str, str]] = field(default_factory=list)

    @property
    def outcome(self) -> str:
        """Verdict on the claim in two words."""
        return {True: "as published", False: "not seen", None: "measured"}[self.seen]

    @property
    def agrees(self) -> bool:
        """True if each number that has a reference agrees with it, or is known not to."""
        return not any(row.surprises for row in self.rows)

    @property
    def count(self) -> tuple[int, int]:
        """Numbers that agree, of those that have a reference."""
        known = [row.agrees for row in self.rows if row.agrees is not None]
        return sum(known), len(known)

    def to_json(self) -> dict:
        """Without the pictures."""
        return {
            "name": self.name,
            "claim": self.sentence,
            "finding": self.finding,
            "seen": self.seen,
            "agrees": self.agrees,
            "numbers": [row.to_json() for row in self.rows],
        }


def off_by(ours: float, seeds: int, reference: float, reference_seeds: int) -> float:
    """Difference in standard deviations of two binomial samples, pooled, held off 0 and 1."""
    pooled = (ours * seeds + reference * reference_seeds + 1) / (seeds + reference_seeds + 2)
    return (ours - reference) / np.sqrt(pooled * (1 - pooled) * (1 / seeds + 1 / reference_seeds))


def share(
    what: str,
    hits: np.ndarray,
    reference: float | tuple[float, float] | None,
    reference_seeds: int = 100,
    **by,
) -> Row:
    """How many runs did it; of a reference from..to, the nearest value counts."""
    value, (low, high) = float(hits.mean()), interval(hits.sum(), hits.size)
    if reference is None:
        return Row(what, value, low, high, None, None, unit="%", by=by)
    bounds = _bounds(reference)
    off = off_by(value, hits.size, float(np.clip(value, *bounds)), reference_seeds)
    rule = f"{off:+.1f} standard deviations"
    return Row(what, value, low, high, bounds, bool(abs(off) < SIGMAS), rule, "%", by)


def mean(
    what: str,
    values: np.ndarray,
    reference: float | tuple[float, float] | None,
    rounding: float = 0.0,
    **by,
) -> Row:
    """A mean over runs, against one over as many that was rounded."""
    value, error = float(values.mean()), float(values.std(ddof=1) / np.sqrt(values.size))
    low, high = value - 1.96 * error, value + 1.96 * error
    if reference is None:
        return Row(what, value, low, high, None, None, by=by)
    bounds = _bounds(reference)
    off = value - float(np.clip(value, *bounds))
    off /= np.hypot(np.sqrt(2) * error, rounding / np.sqrt(12))
    rule = f"{off:+.1f} standard deviations"
    return Row(what, value, low, high, bounds, bool(abs(off) < SIGMAS), rule, by=by)


def median(
    what: str,
    values: np.ndarray,
    reference: float | tuple[float, float] | None,
    *,
    margin: float,
    unit: str = "",
    **by,
) -> Row:
    """A median over runs, with the interval of its order statistics, to within a margin."""
    ordered = np.sort(values)
    ends = binom.ppf([0.025, 0.975], ordered.size, 0.5).astype(int)
    low, high = ordered[np.minimum(ends, ordered.size - 1)]
    value = float(np.median(ordered))
    bounds = None if reference is None else _bounds(reference)
    agrees = None if bounds is None else bounds[0] - margin <= value <= bounds[1] + margin
    rule = f"to {margin:.2g}{' ' + unit if unit else ''}" if bounds else ""
    return Row(what, value, float(low), float(high), bounds, agrees, rule, unit, by)


def length(what: str, values_m: np.ndarray, reference_m: float, **by) -> Row:
    """Median of lengths against a reference, with a fixed share of it as tolerance."""
    return median(what, values_m, reference_m, margin=LENGTH_OFF * reference_m, unit="m", **by)


def _bounds(reference: float | tuple[float, float]) -> tuple[float, float]:
    return reference if isinstance(reference, tuple) else (reference, reference)
