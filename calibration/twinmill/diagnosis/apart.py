# SPDX-License-Identifier: Apache-2.0
"""Numbers of the base in which robots of a kind, or runs of one robot, differ: each has its own.

A number that is constant within a run and differs between runs looks like a place or a time where
one set of numbers stands for all. It is told first, by what each run tells of it alone.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import twinmill_native as native

from twinmill.chance import chi2_above, f_above
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import State, Trial, fitted
from twinmill.fitting.compare import GOOD, Comparison
from twinmill.fitting.fit import base_names
from twinmill.fitting.opening import OWN, Opened, with_own_of_runs
from twinmill.fitting.score_fit import ScoreFit
from twinmill.listing import listed
from twinmill.model.parameters import (
    BASE_GAINS,
    GAINS,
    LAG,
    ParameterEstimate,
    base_parameters,
)
from twinmill.predict.datasets import Trajectory

Whose = Literal["robots", "runs"]
LATE_LEAST_S = 0.002  # by which lags differ at least, where that is told
GAIN_WORDS = {GAINS[0]: "speed", GAINS[1]: "turning"}
SCALED = {GAINS[0]: BASE_GAINS[:2], GAINS[1]: BASE_GAINS[2:]}  # what of the base a gain scales


@dataclass(frozen=True)
class Differing:
    """One number of which each has its own.

    Attributes:
        name: in the model.
        values: by robot or run, as `R03` or `run3.lcmlog`.
    """

    name: str
    values: Mapping[str, float]

    @property
    def middle(self) -> float:
        """Middle of all values."""
        return float(np.mean([*self.values.values()]))

    @property
    def std(self) -> float:
        """Standard deviation among them."""
        return float(np.std([*self.values.values()], ddof=1))

    @property
    def words(self) -> str:
        """Difference in words: the quantity, from where to where."""
        low, high = (of(self.values, key=self.values.get) for of in (min, max))
        told = " to ".join(f"{self._told(self.values[who])} of {who}" for who in (low, high))
        return f"{'motor lag' if self.name == LAG else GAIN_WORDS[self.name]} ({told})"

    def _told(self, value: float) -> str:
        """One of the values in words."""
        if self.name == LAG:
            return f"{value:.3f} s"
        return f"{100 * (value / self.middle - 1):+.1f} %"

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {"name": self.name, "std": self.std, "values": dict(self.values)}


@dataclass(frozen=True)
class Apart:
    """Robots or runs that differ by more than one set of numbers can stand for.

    Attributes:
        whose: what differs.
        numbers: of which each has its own, those that tell most first.
        score_alike: held out, of what was found with one set of numbers for all.
        score_own: the same with numbers of its own for each.
        missed: of runs those that the model as given misses, where it predicts others.
    """

    whose: Whose
    numbers: tuple[Differing, ...]
    score_alike: float
    score_own: float
    missed: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """For people, before all else."""
        differ = listed([n.words for n in self.numbers])
        return (
            f"{self.whose.capitalize()} differ in {differ}: one set of numbers for all leaves a "
            f"score of {self.score_alike:.2f}, numbers of its own for each {self.whose[:-1]} "
            f"{self.score_own:.2f}.{self._odd}"
        )

    @property
    def _odd(self) -> str:
        """Which of the runs the model as given does not know."""
        if not self.missed:
            return ""
        return f" The model as given misses {listed(self.missed)}, and predicts the others."

    def spread(self, name: str) -> float:
        """Standard deviation of a number among them; 0 of what does not differ."""
        return next((n.std for n in self.numbers if n.name == name), 0.0)

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {**vars(self), "numbers": [n.to_json() for n in self.numbers]}


def apart(opened: Sequence[Opened], last: Trial, before: Comparison) -> Apart | None:
    """In what those differ that have numbers of their own; None where one set does as well.

    Args:
        opened: of the search, in its order.
        last: the final trial.
        before: of the model as given.
    """
    numbers = _differing(last.state)
    if not numbers:
        return None
    alike = fitted(_alike(opened, last.state)).held_score
    if alike <= SETTINGS.news * last.held_score:
        return None
    by_run = any(isinstance(d, Trajectory) and d.by_run for d in last.fit.datasets)
    if not by_run:
        return Apart("robots", numbers, alike, last.held_score)
    return Apart("runs", numbers, alike, last.held_score, _missed(last.fit.datasets, before))


def _missed(datasets: Sequence[Trajectory], before: Comparison) -> tuple[str, ...]:
    """Labels of runs of which all robots are missed, where those of others are not."""
    keys, labels = _whose(datasets)
    missed = {r.measurement.log_sha256 for r in before.missed}
    missed -= {r.measurement.log_sha256 for r in before.robots if r not in before.missed}
    return tuple(labels[key] for key in dict.fromkeys(keys) if key in missed)


def of_runs(found: Apart | None) -> bool:
    """True if runs were found to differ, and not robots."""
    return found is not None and found.whose == "runs"


def runs_with_own(
    opened: Sequence[Opened], first: State, last: Trial, usual: float
) -> list[Opened]:
    """Runs with numbers of their own, where these tell that they differ; else none.

    Of several robots each run of each has its own; runs differ where all robots do so alike.

    Args:
        opened: of the search.
        first: where it started.
        last: the final trial, of one set of numbers for all.
        usual: score that is no news.
    """
    logs = {o.measurement.log_sha256 for o in opened}
    if len(logs) < 2 or not all(o.floor for o in opened) or last.held_score <= GOOD * usual:
        return []
    own = with_own_of_runs(opened)
    numbers = _differing(replace(first, datasets=[o.data for o in own]))
    return with_own_of_runs(opened, {n.name: n.std for n in numbers}) if numbers else []


def tells_more(own: Trial, alike: Trial) -> bool:
    """True if numbers of each run leave little of the error that one set for all leaves.

    What acts at some commands, at a place or from a moment on makes runs differ, too, if each has
    its own share of it; but then much is left within them. Two runs show least of that.
    """
    runs = {d.measurement.log_sha256 for d in own.fit.datasets}
    within = SETTINGS.within_two_runs if len(runs) == 2 else SETTINGS.within_runs
    evidence, without_best, _ = own.fit.against(alike.fit)
    left, before = (max(t.fit.held_square - 1, 0.0) for t in (own, alike))
    beyond = evidence > SETTINGS.passing and without_best > SETTINGS.without_best
    return beyond and left < within * before


def middles(fit: ScoreFit, found: Apart) -> list[ParameterEstimate]:
    """Numbers of the base that stand for those that differ: their middle, as wide as they differ.

    Of runs also the gains, since no other run has one's own; each robot keeps its gains.
    """
    model = fit.models[0]
    told = []
    for number in found.numbers:
        if number.name != LAG and found.whose == "robots":
            continue
        for name in SCALED.get(number.name, (LAG,)):
            (p,) = base_parameters(model, [name])
            times = 1.0 if number.name == LAG else p.value
            value, std = number.middle * times, number.std * times
            told.append(ParameterEstimate(name, value, std, p.unit, False, True, words=p.words))
    return told


def _differing(state: State) -> tuple[Differing, ...]:
    """Numbers of robots' or runs' own that are not one, by the chi2 test of one common value.

    The base is held: what all have in common would make each as unsure as they differ.
    """
    if not any(p.name in OWN for d in state.datasets for p in d.own):
        return ()
    free = tuple(p for p in state.begun() if not p.name.startswith("base."))
    fit, found = fitted(replace(state, free=free)).fit, []
    whose, labels = _whose(fit.datasets)
    robots = [d.robot_id if d.by_run else 0 for d in fit.datasets]
    for name in OWN:
        own = [fit.own_estimates(i).get(name) for i in range(len(fit.datasets))]
        by_both = {(r, w): e for r, w, e in zip(robots, whose, own, strict=True) if e}
        told = [(*both, e) for both, e in by_both.items()]
        if len({w for _, w, _ in told}) < 2:
            continue
        values, away, chance = _of_each(told)
        number = Differing(name, {labels[w]: value for w, value in values.items()})
        least = LATE_LEAST_S if name == LAG else SETTINGS.spread
        if chance < SETTINGS.odd_chance and number.std > least:
            found.append((away, number))
    return tuple(number for _, number in sorted(found, key=lambda f: -f[0]))


def _of_each(
    told: Sequence[tuple[int, str, ParameterEstimate]],
) -> tuple[dict[str, float], float, float]:
    """Splits a number into a robot's part and a run's: values, and the two scatters.

    Args:
        told: robot, whose, and estimate; where robots differ, one robot for all.

    Returns:
        By whose; how far they are from one value, as chi2; and the chance of that if they are one.
        What robots disagree in beyond their errors makes the runs' parts as unsure; where each
        robot has a run of its own, what is the robot's and what is the run's are not told apart.
    """
    robots, runs = (list(dict.fromkeys(column)) for column in list(zip(*told, strict=True))[:2])
    design = np.zeros((len(told), len(robots) + len(runs) - 1))
    for row, (robot, run, _) in zip(design, told, strict=True):
        row[robots.index(robot)] = 1
        if run != runs[0]:
            row[len(robots) + runs.index(run) - 1] = 1
    free, beside = len(runs) - 1, len(told) - design.shape[1]
    told_apart = len(robots) == 1 or beside > 0
    if not told_apart or np.linalg.matrix_rank(design) < design.shape[1]:
        return {run: e.value for _, run, e in told}, 0.0, 1.0
    values, stds = np.array([[e.value, e.std] for _, _, e in told]).T
    whitened = design / stds[:, None]
    found, *_ = np.linalg.lstsq(whitened, values / stds, rcond=None)
    parts = np.append(0.0, found[len(robots) :])
    spread = np.linalg.inv(whitened.T @ whitened)[len(robots) :, len(robots) :]
    away = float(parts[1:] @ np.linalg.solve(spread, parts[1:]))
    scale = float(np.sum((values / stds - whitened @ found) ** 2)) / max(beside, 1)
    one = f_above(away / scale / free, free, beside) if scale > 1 else chi2_above(away, free)
    by_whose = dict(zip(runs, values.mean() + parts - parts.mean(), strict=True))
    return by_whose, away, one


def _whose(datasets: Sequence[Trajectory]) -> tuple[list[str], dict[str, str]]:
    """Key of the robot or run whose numbers each has, and labels; logs of one name are numbered."""
    if not any(d.by_run for d in datasets):
        keys = [f"R{d.robot_id:02d}" for d in datasets]
        return keys, {key: key for key in keys}
    logs = [d.measurement for d in datasets]
    keys, labels = [m.log_sha256 for m in logs], {}
    for key, name in dict(zip(keys, (m.log_name for m in logs), strict=True)).items():
        labels[key] = f"{name} ({1 + len(labels)})" if name in labels.values() else name
    return keys, labels


def _alike(opened: Sequence[Opened], state: State) -> State:
    """State with one set of numbers for all, free; of runs that differ robots keep gains."""
    middle_s = float(np.mean([m.get(LAG) for m in state.models]))
    models = [_of_all(m, middle_s) for m in state.models]
    by_run = any(isinstance(d, Trajectory) and d.by_run for d in state.datasets)
    kept = GAINS if by_run and len({d.robot_id for d in state.datasets}) > 1 else ()
    data = [without_own(d, kept) for d in state.datasets]
    known = {p.name for p in state.free}
    names = [n for n in base_names(models[0], opened) if n not in known]
    free = (*state.begun(), *base_parameters(models[0], names))
    return replace(state, datasets=data, models=models, free=free)


def _of_all(model: native.Model, lag_s: float) -> native.Model:
    model = model.copy()
    for name, value in [(LAG, lag_s), *((gain, 1.0) for gain in GAINS)]:
        model.set(name, value)
    return model


def without_own(data: Trajectory, kept: Collection[str]) -> Trajectory:
    """Without what its robot has of its own, but for what is kept."""
    if not isinstance(data, Trajectory):
        return data
    own = tuple(p for p in data.own if p.name not in OWN or p.name in kept)
    return replace(data, own=own, by_run=False)
