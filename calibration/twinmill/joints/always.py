# SPDX-License-Identifier: Apache-2.0
"""Effects that an MJCF lacks in the log that it was made with, too: no news in another one.

The likeliest set of effects of that log is part of the base of a later one, with the posterior of
its numbers and of the base's, as much less certain as they drift between logs (Kennedy and O'Hagan
2001, J. R. Stat. Soc. B 63). Dependences without a name are not kept: their functions are of a
log's own ranges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from twinmill.inference.prior import Prior
from twinmill.inference.search import Search
from twinmill.inference.settings import PRIORS
from twinmill.joints.hook import Held
from twinmill.joints.plant import CLOCK, JointModel
from twinmill.model.parameters import Parameter, instance_of


@dataclass(frozen=True)
class Always:
    """Effects that a model lacks in its own log, with its numbers there.

    Attributes:
        effects: names; a kind once.
        labels: N numbers of the base and of these.
        mean, cov: (N,), (N, N) given that log.
    """

    effects: tuple[str, ...]
    labels: tuple[str, ...]
    mean: np.ndarray
    cov: np.ndarray


def always_of(search: Search) -> Always:
    """The likeliest set of effects of a model's own log, with the numbers of its fit."""
    own = search.fitted[search.likely()[0]]
    h = own.hypothesis
    mean, cov = h.posterior(own.linear)
    mean = np.clip(mean, h.low, h.high)
    kept = [k for k, n in enumerate(h.labels) if h.named[k] and n != CLOCK]
    return Always(h.effects, tuple(h.labels[k] for k in kept), mean[kept], cov[np.ix_(kept, kept)])


def of_hook(hook: Sequence[Held]) -> Always:
    """Effects in a model's hook, their numbers as exact as what an own log tells exactly."""
    model = JointModel({}, {})
    model.effects = [name for name, _ in hook]
    each = zip(model.instances, hook, strict=True)
    told = {f"{name}.{key}": value for name, (_, own) in each for key, value in own.items()}
    mean = np.array(list(told.values()))
    return Always(tuple(model.effects), tuple(told), mean, np.zeros((len(mean), len(mean))))


def with_always(model: JointModel, prior: Prior, always: Always, own: Sequence[Parameter]) -> Prior:
    """Prior of the base of a later log, with its effects of the own log.

    Args:
        model: of the base with these effects, whose numbers are set.
        prior: without them.
        always: of the own log.
        own: numbers of its effects.
    """
    names = [*prior.names, *(p.name for p in own)]
    first, count = len(prior.names), len(names)
    mean = np.r_[prior.mean[:first], np.zeros(len(own)), prior.mean[first:]]
    cov = block_diag(prior.cov[:first, :first], np.eye(len(own)), prior.cov[first:, first:])
    at = [names.index(label) for label in always.labels]
    drift = [PRIORS.gain_drift if instance_of(n) == "base" else PRIORS.sheet for n in always.labels]
    mean[at] = always.mean
    cov[np.ix_(at, at)] = always.cov + np.diag((np.array(drift) * always.mean) ** 2)
    for name, value in zip(names, mean[:count], strict=True):
        model.set(name, float(value))
    return replace(
        prior,
        names=names,
        mean=mean,
        cov=cov,
        step=np.r_[prior.step, [p.step for p in own]],
        low=np.r_[prior.low, [p.min for p in own]],
        high=np.r_[prior.high, [p.max for p in own]],
        sheet=np.r_[prior.sheet, np.zeros(len(own))],
    )
