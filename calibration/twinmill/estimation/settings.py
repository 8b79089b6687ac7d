# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide when a fit ends; reports and JSON output print them."""

from dataclasses import dataclass

from twinmill.settings import Numbers, number


@dataclass(frozen=True)
class FitSettings(Numbers):
    """When a fit ends."""

    rounds: int = number(12, "steps of Levenberg and Marquardt, at most")
    tolerance: float = number(1e-2, "fall of the cost, of 100 independent errors, that ends a fit")


FIT_SETTINGS = FitSettings()
