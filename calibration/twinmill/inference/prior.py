# SPDX-License-Identifier: Apache-2.0
"""Knowledge of a base model before a log is seen: a joint normal distribution."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import twinmill_native as native
from scipy.linalg import block_diag

from twinmill.inference.candidate import FAR, size_std
from twinmill.inference.discrepancy import Kernel, dependence_of
from twinmill.inference.duties import TABLE, refined
from twinmill.inference.hidden import Hidden
from twinmill.inference.lasting import Lasting
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Usual
from twinmill.inference.settings import PRIORS
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    BASE_GAINS,
    CLOCK,
    CLOCK_RATE,
    LAG,
    USUAL_STD,
    WHERE_OR_WHEN,
    Parameter,
    base_parameters,
    duty_table,
    effect_names,
    effect_parameters,
    gains_of,
    instance_of,
    newest_instance,
)

CLOCK_STD_S = 1.0  # of an offset that nothing is known of, about the best that was looked for
RATE_STD_PPM = 30.0  # of two quartz clocks; see shared conventions in docs/conventions.md
SAME_STD_S, SAME_STD_PPM = 1e-4, 0.01  # of one clock that stamps all
LEAST_STD = 1e-6  # relative, so that no direction is certain
ROUGH = 0.3  # largest relative error of a speed of the duty table, which neighbours tell as well


@dataclass(frozen=True)
class Always:
    """Errors of a model in the log that it was fitted to, which are no news in another.

    Attributes:
        effects: of the catalogue, that the base lacks there.
        labels: names of the base's and the effects' numbers, and of weights of its discrepancy, N
            of them.
        mean, cov: (N,), (N, N) of these.
        kernels: name and size of each kernel of the discrepancy.
        wander: probabilities of each of SIZES, by kernel whose function holds for one log alone;
            what is left of one is the probability of none.
        lasting: kernels whose function holds for every log, and which its own does not ask for.
        rate: of moments.
        usual, top: scale of the kernels, see `Motion`.
        noise: as it may be in another log.
        hidden: what its own log tells of other effects.
    """

    effects: tuple[str, ...]
    labels: tuple[str, ...]
    mean: np.ndarray
    cov: np.ndarray
    kernels: tuple[tuple[str, float], ...]
    wander: dict[str, np.ndarray]
    lasting: dict[str, Lasting]
    rate: Rate
    usual: np.ndarray
    top: np.ndarray
    noise: Usual
    hidden: Hidden

    def sizes_of_wander(self) -> dict[str, np.ndarray]:
        """(S,) probabilities of each of SIZES of a wander, by dependence."""
        found: dict[str, np.ndarray] = {}
        for name, chance in self.wander.items():
            word = dependence_of(name)
            found[word] = found.get(word, 0) + chance
        return found


@dataclass(frozen=True)
class Prior:
    """A normal distribution of the base's numbers and of the weights of its discrepancy.

    Attributes:
        names: quantities of the base, P of them.
        mean, cov: (P + K,), (P + K, P + K).
        step, low, high: (P,) of finite differences, and bounds.
        columns: (K, W, C) of the discrepancy.
        sheet: (P,) how much less well than others each is known from a data sheet alone; 0 where
            no data sheet tells it.
        known: other logs told the base; in its own log its numbers are what they are fitted to.
        off: (P, Q) root of the covariance by which a data sheet's numbers are off; None where each
            is by itself, as `sheet` says.
    """

    names: list[str]
    mean: np.ndarray
    cov: np.ndarray
    step: np.ndarray
    low: np.ndarray
    high: np.ndarray
    columns: np.ndarray = field(repr=False)
    sheet: np.ndarray
    known: bool = True
    off: np.ndarray | None = None

    @property
    def stale(self) -> np.ndarray:
        """(P + K, P + K) covariance of a base of which nothing is known but a data sheet."""
        cov, count = self.cov.copy(), len(self.names)
        off = self.off
        if off is None:
            off = np.diag(self.sheet * PRIORS.sheet * self.mean[:count])
        cov[:count, :count] += off @ off.T
        return cov

    @property
    def faster(self) -> list[np.ndarray]:
        """(P + K, P + K) covariance of a base all of whose speeds are off by one factor.

        As by another battery, or by another motor or gear, which are farther off: that has one
        number where a data sheet has many. None of a base that has no speeds.
        """
        table = [name.startswith(TABLE) for name in self.names]
        speeds = table if any(table) else [name in BASE_GAINS for name in self.names]
        count, size = len(self.names), PRIORS.sheet * self.mean[: len(self.names)]
        if not any(speeds):
            return []
        off = np.where(speeds, size, 0.0)
        late = np.where([name == LAG for name in self.names], self.sheet * size, 0.0)
        found = []
        for wide in (1.0, FAR):
            cov = self.cov.copy()
            cov[:count, :count] += wide**2 * np.outer(off, off) + np.diag(late**2)
            found.append(cov)
        return found

    def before_any_log(self) -> "Prior":
        """As a fit begins: from a data sheet, whose lag is a guess."""
        cov = self.stale
        for k, name in enumerate(self.names):
            if name == LAG:
                cov[k, k] += USUAL_STD[LAG] ** 2
        return replace(self, cov=cov, known=False)

    def of_a_kind(self, spread: float) -> "Prior":
        """Prior of one robot among several of a kind, whose numbers differ.

        Args:
            spread: relative standard deviation of speeds among them.
        """
        cov = self.cov.copy()
        for k, share in enumerate(self.sheet):
            cov[k, k] += (share * spread * self.mean[k]) ** 2
        return replace(self, cov=cov)

    def without(self, names: Collection[str]) -> "Prior":
        """A prior that has no discrepancy yet, without some quantities."""
        at = [k for k, name in enumerate(self.names) if name not in names]
        own = {f: getattr(self, f)[at] for f in ("mean", "step", "low", "high", "sheet")}
        kept = [self.names[k] for k in at]
        return replace(self, names=kept, cov=self.cov[np.ix_(at, at)], **own)

    def with_columns(self, columns: np.ndarray) -> "Prior":
        """With a discrepancy more, (K, W, C), whose weights have a standard normal distribution."""
        return replace(
            self,
            mean=np.r_[self.mean, np.zeros(len(columns))],
            cov=block_diag(self.cov, np.eye(len(columns))),
            columns=np.concatenate([self.columns.reshape(-1, *columns.shape[1:]), columns]),
        )


def base_prior(
    model: native.Model,
    model_file: ModelFile,
    *,
    same_clock: bool,
    known: bool,
    effects: Sequence[str],
) -> Prior:
    """From a model file: values, the covariance that a fit wrote, and how gains drift since.

    Args:
        model: of the robot, with the nodes of `duties.refined` if it is told duties.
        model_file: its file.
        same_clock: one clock stamps all, or other logs gave the offset.
        known: other logs gave the offset.
        effects: that the model has beside those of its file; their numbers are the card's priors.
    """
    names = [*gains_of(model)]
    names += [LAG] * (model.get(LAG) > 0)
    names += [CLOCK, CLOCK_RATE]
    of_effects = _fitted_effects(model, model_file)
    names += [p.name for p in of_effects]
    table = duty_table(model_file.model)
    cov = _told(model_file, [*table, *names], same_clock, known)
    if table:
        names = [*duty_table(model), *names]
        fine = refined(model_file)
        rest = len(names) - len(fine.weights)
        weights = block_diag(fine.weights, np.eye(rest))
        cov = weights @ cov @ weights.T + np.diag(np.r_[fine.std_mps, np.zeros(rest)] ** 2)
    own = [p for name in effects for p in effect_parameters(model, newest_instance(model, name))]
    base = names[: len(names) - len(of_effects)]
    parts = [*base_parameters(model, base), *of_effects, *own]
    drifts = [(PRIORS.sheet * p.value) ** 2 for p in of_effects]
    cov += np.diag(np.r_[np.zeros(len(base)), drifts])
    cov = block_diag(cov, np.diag([size_std(p) ** 2 for p in own]))
    names += [p.name for p in own]
    value = np.array([p.value for p in parts])
    return Prior(
        names,
        value,
        cov + drift(names, value),
        np.array([p.step for p in parts]),
        np.array([p.min for p in parts]),
        np.array([p.max for p in parts]),
        np.zeros((0, 0, 3)),
        np.array([0 if n in (CLOCK, CLOCK_RATE) else 2 if n == LAG else 1 for n in names]),
    )


def _fitted_effects(model: native.Model, model_file: ModelFile) -> list[Parameter]:
    """Numbers of the file's effects that a fit told, but for places and times of one log."""
    known = set(model_file.covariance.names)
    return [
        p
        for instance in effect_names(model_file.model)
        for p in effect_parameters(model, instance)
        if p.name in known and p.role not in WHERE_OR_WHEN
    ]


def _told(model_file: ModelFile, names: Sequence[str], same_clock: bool, known: bool) -> np.ndarray:
    """(P, P) covariance of named quantities, as a model file tells it."""
    model = model_file.model
    cov = np.zeros((len(names),) * 2)
    fitted = model_file.covariance.of(names)
    own = [names.index(n) for n in fitted.names]
    cov[np.ix_(own, own)] = fitted.values
    unsure = model_file.unsure_speeds()
    for k, name in enumerate(names):
        if name in unsure:
            _set_std(cov, k, min(unsure[name], ROUGH * model.get(name)))
        elif name == CLOCK:
            cov[k, k] = (
                model_file.clock_std_s([]) ** 2 + SAME_STD_S**2 if same_clock else CLOCK_STD_S**2
            )
        elif name == CLOCK_RATE:
            one = model.clock_same and not known
            cov[k, k] = SAME_STD_PPM**2 if one else RATE_STD_PPM**2
    return cov


def _set_std(cov: np.ndarray, k: int, std: float) -> None:
    """Sets a standard deviation; correlations stay, so that the matrix stays a covariance."""
    if cov[k, k] > 0:
        share = std / np.sqrt(cov[k, k])
        cov[k] *= share
        cov[:, k] *= share
    cov[k, k] = std**2


def drift(names: Sequence[str], value: np.ndarray) -> np.ndarray:
    """(P, P) covariance of the change of a base's numbers between two logs."""
    share = [
        PRIORS.lag_drift if n == LAG else PRIORS.gain_drift if n.endswith("_gain") else LEAST_STD
        for n in names
    ]
    return np.diag((np.array(share) * value[: len(names)]) ** 2 + LEAST_STD**2)


def with_always(
    prior: Prior, always: Always, found: Sequence[Kernel], *, same_clock: bool
) -> Prior:
    """The prior of a later log: numbers and discrepancy as the base's own log gave them.

    Of a discrepancy that is not lasting only the size is known, and of an offset of clocks nothing
    where they may have been set anew.

    Args:
        prior: from the model file.
        always: of the base's own log.
        found: kernels of the later log.
        same_clock: the offset of the clocks is that of the own log.
    """
    size = dict(always.kernels)
    there = [k for k in found if k.name in size]
    labels = labels_of(prior, always, found)
    columns = [size[k.name] * k.columns for k in there]
    count = len(prior.names)
    mean = np.r_[prior.mean, np.zeros(len(labels) - count)]
    cov = np.diag(np.r_[np.zeros(count), np.ones(len(labels) - count)])
    cov[:count, :count] = prior.cov
    known = {n: k for k, n in enumerate(always.labels)}
    own = [k for k, n in enumerate(labels) if n in known and (same_clock or n != CLOCK)]
    index = [known[labels[k]] for k in own]
    mean[own] = always.mean[index]
    cov[np.ix_(own, own)] = always.cov[np.ix_(index, index)]
    told = [k for k in own if k < count]
    cov[np.ix_(told, told)] += drift([prior.names[k] for k in told], mean[told])
    for k in own:  # what the base lacks is known less well than its own numbers
        scale = 1.0 if k >= count else 0.0 if _is_base(labels[k]) else mean[k]
        cov[k, k] += (PRIORS.sheet * scale) ** 2
    return replace(
        prior, mean=mean, cov=cov, columns=np.concatenate(columns) if columns else prior.columns
    )


def labels_of(prior: Prior, always: Always, found: Sequence[Kernel]) -> list[str]:
    """Names of the numbers of a later log's prior: of the base, then weights of its discrepancy."""
    names = {name for name, _ in always.kernels}
    there = [k for k in found if k.name in names]
    return [*prior.names, *(label for k in there for label in weight_labels(k))]


def _is_base(name: str) -> bool:
    return instance_of(name) in ("base", "clock")


def weight_labels(kernel: Kernel) -> list[str]:
    """One for each weight of a kernel."""
    return [f"{kernel.name} {k}" for k in range(len(kernel.columns))]
