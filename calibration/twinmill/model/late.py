# SPDX-License-Identifier: Apache-2.0
"""How late the motion follows its commands: lag, delay, and the offset of two clocks."""

from dataclasses import dataclass
from typing import Any

import twinmill_native as native

from twinmill.model.parameters import LAG, catalogue_name, effect_names, late_part


@dataclass(frozen=True)
class Late:
    """How late the motion follows its commands.

    Attributes:
        sum_s, sum_std_s: lag and delay together; with the clocks' offset where that is not known.
        delay_s, lag_s, clock_s: its parts; None where the data cannot part them.
        parted: whether they can.
        spread_s: standard deviation of lags of which each robot or run has its own, also in
            sum_std_s; 0 where there is one.
    """

    sum_s: float
    sum_std_s: float | None
    delay_s: float | None
    lag_s: float | None
    clock_s: float | None
    parted: bool
    spread_s: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return vars(self)


def late_parts(model: native.Model) -> dict[str, list[str]]:
    """Names of what makes a model late: lag, delay, clock."""
    parts: dict[str, list[str]] = {"lag": [LAG], "delay": [], "clock": []}
    for instance in effect_names(model):
        if late := late_part(catalogue_name(instance)):
            kind, key = late
            parts[kind].append(f"{instance}.{key}")
    return parts
