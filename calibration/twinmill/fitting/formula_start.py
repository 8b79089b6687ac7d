# SPDX-License-Identifier: Apache-2.0
"""Where the fit of a formula begins: its rates at the time constant that explains most.

A number in a rate is a time constant or its inverse. Begun far off, or with the sign that lets the
state grow, no fit finds it. So several are tried, and the sign that is stable is kept.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import twinmill_native as native

from twinmill.estimation.equations import finite
from twinmill.estimation.opened import Opened
from twinmill.estimation.score_fit import ScoreFit
from twinmill.fitting.opening import Judged, judged
from twinmill.model.parameters import EFFECT_STEP, UNKNOWN, Parameter, words
from twinmill.predict.datasets import ErrorDataset

RATES = ("state_rate", "second_rate")
TIMES_S = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
NEAR = 30.0  # times where it begins: beyond that a state is at once where it goes, or never
ROUNDS = 3  # of the fit of the other numbers at each start


def with_time_constants(
    fresh: Sequence[Parameter], texts: dict[str, str], opened: Sequence[Opened]
) -> list[Parameter]:
    """A formula's numbers, those of its rates begun where the others then explain most.

    As they were where there is no such number, or none of the starts is within its bounds and keeps
    the state finite.

    Args:
        fresh: all numbers of the formula.
        texts: of the formula.
        opened: measurements with models that have it.
    """
    named = words(" ".join(texts.get(rate) or "" for rate in RATES))
    timed = [p for p in fresh if p.name.rpartition(".")[2] in named]
    others = [p for p in fresh if p not in timed]
    known = judged(opened)
    best, least = None, np.inf
    for value in _starts(timed) if timed else ():
        begun = [_begun_at(p, value) for p in timed]
        cost = _cost(known, begun, others)
        if cost < least:
            best, least = {p.name: p for p in begun}, cost
    return [best.get(p.name, p) for p in fresh] if best else list(fresh)


def _starts(timed: Sequence[Parameter]) -> list[float]:
    """Rates and times, of both signs, within the bounds of all these numbers."""
    sizes = sorted({*TIMES_S, *(1 / t for t in TIMES_S)})
    both = [sign * size for size in sizes for sign in (1.0, -1.0)]
    return [value for value in both if all(p.min <= value <= p.max for p in timed)]


def _begun_at(p: Parameter, value: float) -> Parameter:
    """Parameter that begins at another value, whose sign it keeps."""
    ends = sorted((value / NEAR, value * NEAR))
    size = abs(value)
    return replace(
        p,
        value=value,
        usual=value,
        min=max(p.min, ends[0]),
        max=min(p.max, ends[1]),
        std=UNKNOWN * size,
        step=EFFECT_STEP * size,
    )


def _cost(
    known: Sequence[Judged], begun: Sequence[Parameter], others: Sequence[Parameter]
) -> float:
    """Cost of the data at these numbers, others fitted; infinite where a state grows."""
    models = [o.model.copy() for o in known]
    for model in models:
        for p in (*begun, *others):
            model.set(p.name, p.value)
    data = [o.data for o in known]
    if not all(finite(d, m) for d, m in zip(data, models, strict=True)):
        return np.inf
    fit = ScoreFit(data, models, _sized(data, models, others)).fit(ROUNDS)
    cost = fit.cost(fit.state[0], fit.x)
    return cost if np.isfinite(cost) else np.inf


def sized(fresh: Sequence[Parameter], opened: Sequence[Opened]) -> list[Parameter]:
    """Numbers of a formula with starts, priors and difference steps of a size that acts.

    Nobody but the formula knows in which unit it has its numbers, so that 1 may be nothing or
    absurd. The reach of a number is the change of it that alters predictions by as much as they err
    now, to first order; it bounds the start, widens the prior and bounds the step of differences.

    Args:
        fresh: the numbers, with bounds of the card.
        opened: logs with models that have the formula.

    Returns:
        The same numbers in their order; as they were where a number changes no prediction.
    """
    known = judged(opened)
    return _sized([o.data for o in known], [o.model for o in known], fresh)


def _sized(
    data: Sequence[ErrorDataset], models: Sequence[native.Model], fresh: Sequence[Parameter]
) -> list[Parameter]:
    fit = ScoreFit(data, models, fresh)
    rows, slopes = fit.state
    errors = np.linalg.norm(np.concatenate(rows))
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        slopes_of = [np.linalg.norm(_slopes_by(fit, slopes, p.name)) for p in fresh]
        reaches = [float(errors / slope) for slope in slopes_of]
    return [
        replace(
            p,
            value=min(p.value, reach),
            std=max(p.std, UNKNOWN * reach),
            step=min(p.step, EFFECT_STEP * reach),
        )
        if 0 < reach < np.inf
        else p
        for p, reach in zip(fresh, reaches, strict=True)
    ]


def _slopes_by(fit: ScoreFit, slopes: Sequence[np.ndarray], name: str) -> np.ndarray:
    """(R,) slopes of all data sets by a parameter; those that lack it are left out."""
    own = [
        s[:, names.index(name)] for s, names in zip(slopes, fit.names, strict=True) if name in names
    ]
    return np.concatenate([np.zeros(0), *own])
