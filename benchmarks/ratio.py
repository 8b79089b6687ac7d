# SPDX-License-Identifier: Apache-2.0
"""A measured ratio of two things that were measured in turn, and what it should be."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Ratio:
    """`a : b`, of pairs measured one right after the other."""

    name: str
    a: float
    b: float
    unit: str
    low: float
    ratio: float
    high: float
    at_least: float | None = None
    at_most: float | None = None
    skipped: str = ""
    says: str = ""  # in its own words

    @property
    def met(self) -> bool:
        """True if the median lies where the benchmark promises."""
        too_low = self.at_least is not None and self.ratio < self.at_least
        too_high = self.at_most is not None and self.ratio > self.at_most
        return not (self.skipped or too_low or too_high)

    @property
    def goal(self) -> str:
        """The goal; empty if there is none."""
        if self.at_least is not None:
            return f">= {self.at_least:g}"
        return "" if self.at_most is None else f"<= {self.at_most:g}"


def paired(name: str, a: np.ndarray, b: np.ndarray, unit: str, **goal: float) -> Ratio:
    """Median and 10th and 90th percentile of a / b; of a and b the medians."""
    low, middle, high = np.percentile(np.asarray(a) / np.asarray(b), [10, 50, 90])
    return Ratio(name, float(np.median(a)), float(np.median(b)), unit, low, middle, high, **goal)


def single(name: str, a: float, b: float, unit: str, **goal: float | str) -> Ratio:
    """A / b of two numbers that do not vary."""
    return Ratio(name, a, b, unit, a / b, a / b, a / b, **goal)


def skipped(name: str, why: str) -> Ratio:
    """Row that gives the reason why nothing could be measured here."""
    nothing = float("nan")
    return Ratio(name, nothing, nothing, "", nothing, nothing, nothing, skipped=why)
