# SPDX-License-Identifier: Apache-2.0
"""The numbers that can move an answer: prior probabilities, prior widths, and what words mean."""

from dataclasses import dataclass

from twinmill.settings import Numbers, number


@dataclass(frozen=True)
class Priors(Numbers):
    """Prior knowledge; no case set a number. Sizes are standard deviations."""

    effects: float = number(1.0, "expected number of missing effects, over the whole catalogue")
    further: float = number(0.1, "factor on the prior odds of each effect after the first")
    outside: float = number(0.3, "probability that something outside the catalogue is there")
    alike: float = number(
        0.5, "share of unnamed things that look like an effect which depends on the same"
    )
    stale: float = number(0.1, "probability that the base is known no better than a data sheet")
    size: float = number(2.0, "size of an effect, times its card's default strength")
    far: float = number(
        0.1, "share of effects whose sizes have a standard deviation ten times that"
    )
    gain_drift: float = number(0.02, "drift of gains between logs of one robot, relative")
    lag_drift: float = number(0.05, "drift of the motor lag between logs, relative")
    sheet: float = number(
        0.15, "error of a data sheet's speeds, and of a discrepancy in another log, relative"
    )
    form: float = number(0.15, "mean error of an effect's formula, relative to its size")
    moments: float = number(0.05, "expected share of half seconds in which something happens")
    sudden: float = number(0.5, "gain error at such a moment; push over the usual speed")
    sure: float = number(0.9, "posterior probability from which an answer is called sure")
    member: float = number(0.05, "posterior probability from which a name belongs to a group")


PRIORS = Priors()
