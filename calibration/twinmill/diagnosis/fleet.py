# SPDX-License-Identifier: Apache-2.0
"""Several robots of one model: what all of them lack, and in what one of them differs.

Each robot is judged by itself; `robots.shared` tells what they lack together. The size of what all
lack is the mean over robots, whose own sizes may scatter (random effects: DerSimonian and Laird
1986, Controlled Clinical Trials 7).
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.defaults import Verdict
from twinmill.diagnosis.infer import Inference, infer_robots
from twinmill.diagnosis.sheet import is_sheet
from twinmill.estimation.opened import Opened
from twinmill.fitting.compare import Comparison, RobotComparison
from twinmill.inference.answer import (
    LIKELY,
    Answer,
    Named,
    RobotAnswer,
    answer,
    certain_of,
    summed,
    told,
    units_of,
    verdict_of,
)
from twinmill.inference.cameras import Cameras, judge_cameras
from twinmill.inference.differ import odd, slopes
from twinmill.inference.duties import written_on
from twinmill.inference.posterior import Belief
from twinmill.inference.robots import Shared, shared
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Steps, StepsOfLog
from twinmill.model.late import Late
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import BASE_GAINS, LAG, gains_of, key_of, with_role

REFIT = "refit"  # name of a robot's own speeds and lag, as of a refit of the base


@dataclass(frozen=True)
class Differs:
    """One robot that differs from the others.

    Attributes:
        robot_id: its number.
        name: effect or dependence that it lacks beside what all do; or `REFIT`.
        probability: of that.
        numbers: parameter -> (value, standard deviation); of its own speeds and lag, over those of
            the model.
        others_of_group: effects of which it may be one as well; the probability is that of any.
        is_effect: the catalogue has it.
        scores: of the model as given, and of its own with what was found.
        others: median score of the other robots with the model as given.
    """

    robot_id: int
    name: str
    probability: float
    numbers: dict[str, tuple[float, float]]
    others_of_group: tuple[str, ...]
    is_effect: bool
    scores: tuple[float, float]
    others: float

    def to_json(self) -> dict[str, Any]:
        """Fields of `robots_off` of the interface, but for its sentences."""
        return {
            "robot_id": self.robot_id,
            "effect": self.name,
            "probability": self.probability,
            "group": [self.name, *self.others_of_group] if self.others_of_group else None,
            "score_before": self.scores[0],
            "score_after": self.scores[1],
            "p_value": None,
            "parameters": [
                {"name": name, "value": value, "std": std, "unit": self._unit(name)}
                for name, (value, std) in self.numbers.items()
            ],
            "smallest_shown": {},
        }

    def _unit(self, name: str) -> str:
        return units_of(self.name).get(key_of(name), "1") if self.is_effect else "1"


@dataclass(frozen=True)
class Fleet:
    """Verdict of several robots' logs on one model.

    Attributes:
        answer: on what all robots lack.
        shared: posterior of what they lack together, and each beside that.
        robots: each judged in the light of the others, by number.
        cameras: what their cameras lack; None where none reported anything.
        differs: robots that differ: effects first, then what has no name, each the surest first.
    """

    answer: Answer
    shared: Shared
    robots: list[Inference]
    differs: list[Differs]
    cameras: Cameras | None

    @property
    def verdict(self) -> Verdict:
        """On motion and cameras."""
        found = self.answer.verdict
        return self.cameras.verdict(found) if self.cameras else found

    @property
    def measurements(self) -> list[Measurement | SteadyTable]:
        """All runs of all robots."""
        return [m for robot in self.robots for m in robot.measurements]

    @property
    def opened(self) -> list[Opened]:
        """Logs of all robots, each with its refitted base."""
        return [o for robot in self.robots for o in robot.opened]

    @property
    def before(self) -> Comparison:
        """All robots with the model as given."""
        return _joined([robot.before for robot in self.robots])

    @property
    def refitted(self) -> Comparison:
        """All robots, each with its refitted base."""
        return _joined([robot.refitted for robot in self.robots])

    @property
    def after(self) -> Comparison:
        """All robots, each with what was found in it."""
        return _joined([robot.after for robot in self.robots])

    @property
    def finds(self) -> bool:
        """True if a model can have what was found."""
        of_cameras = self.cameras.added if self.cameras else ()
        return bool(of_cameras) or any(robot.finds for robot in self.robots)

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that a better model of all gets: those that last, of motion and cameras."""
        lasting = (name for name in self.answer.added if not with_role(name, "moment"))
        return (*lasting, *(self.cameras.added if self.cameras else ()))

    @property
    def added_alone(self) -> list[Differs]:
        """Differences of one robot that a better model has: lasting effects, or its own gains."""
        return [
            one
            for one in self.differs
            if one.name == REFIT or (one.is_effect and not with_role(one.name, "moment"))
        ]

    @property
    def not_shown(self) -> dict[str, str]:
        """Effects that the logs of no robot can show, and why."""
        first, *others = [robot.not_shown for robot in self.robots]
        return {name: why for name, why in first.items() if all(name in o for o in others)}

    @property
    def strangers(self) -> tuple[str, ...]:
        """Sentences on own logs that are not the model's."""
        return tuple(dict.fromkeys(said for robot in self.robots for said in robot.strangers))

    @property
    def model(self) -> native.Model:
        """With what was found in most robots, its numbers the means over them."""
        models = [one.model for one in self.after.robots]
        alike = [m for m in models if set(self.answer.added) <= set(m.effects)] or models
        model = alike[0].copy()
        names = [entry["name"] for entry in model.values()]
        own = [m for m in alike if [entry["name"] for entry in m.values()] == names]
        for name in names:
            model.set(name, float(np.mean([m.get(name) for m in own])))
        return model

    @property
    def late(self) -> Late:
        """How late the motion of a robot of these is; how they differ is in its uncertainty."""
        return _late([robot.late for robot in self.robots])

    def steps(self) -> list[dict[str, Any]]:
        """Scores of the model as given, of refitted bases, and with what was found."""
        steps: list[tuple[str | None, float]] = [(None, self.before.score)]
        steps.append((REFIT, self.refitted.score))
        if self.answer.added:
            steps.append((" and ".join(self.answer.added), self.after.score))
        return [{"effect": name, "score_heldout": score} for name, score in steps]

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill diagnose --json`."""
        told = {
            **self.answer.to_json(),
            "shared": self.shared.to_json(),
            "logs": list(dict.fromkeys(m.log_name for m in self.measurements)),
            "score": self.before.score,
            "score_refit": self.refitted.score,
            "score_after": self.after.score,
            "not_identifiable": [{"effect": e, "why": w} for e, w in self.not_shown.items()],
            "robots_off": [one.to_json() for one in self.differs],
            "late": self.late.to_json(),
            "steps": self.steps(),
            "next_experiment": None,
            "warnings": [*self.strangers, *self.before.warnings],
            "settings": {name: value for name, value, _ in PRIORS.listed()},
        }
        return self.cameras.joined(told) if self.cameras else told


def judge_fleet(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable] = (),
    progress: Callable[[str], None] = lambda _: None,
    *,
    without: Collection[str] = (),
) -> Fleet:
    """Probabilities of what a model of several robots lacks; arguments as of `infer`."""
    alone = infer_robots(measurements, model_file, own, progress, without=without)
    progress("what all robots lack")
    found = shared([robot.table for robot in alone])
    robots = [
        replace(robot, answer=_in_the_light(robot, every))
        for robot, every in zip(alone, found.beliefs, strict=True)
    ]
    of_all = _of_all(found, robots)
    logs = [one.modelled for robot in robots for one in robot.before.robots]
    cameras = judge_cameras(logs, model_file, progress, without)
    return Fleet(of_all, found, robots, _differs(found, robots, of_all, model_file), cameras)


def _in_the_light(robot: Inference, every: list[Belief]) -> RobotAnswer:
    """Answer on a robot by beliefs that know the others; its base is as stale as it was."""
    return answer(robot.table, every).with_stale(robot.answer.stale)


def _of_all(found: Shared, robots: Sequence[Inference]) -> Answer:
    """Answer on what all robots lack, by the sets of it."""
    every = [(things - found.words, things & found.words, p) for things, p in found.sets.items()]
    outside = sum(p for _, words, p in every if words)
    effects = {name: p for name, p in found.things.items() if name not in found.words}
    words = {name: p for name, p in found.things.items() if name in found.words}
    of_effects = summed((own, p) for own, _, p in every)
    best = max(of_effects, key=of_effects.__getitem__)
    named = [_named(name, best, every, robots) for name in sorted(best, key=lambda n: -effects[n])]
    findings = told(named) if found.nothing <= 1 - PRIORS.sure else []
    stale = float(np.median([robot.answer.stale for robot in robots]))
    likely = {word: p for word, p in words.items() if p > LIKELY}
    share = np.mean([robot.answer.share for robot in robots]) if likely else 0.0
    return Answer(
        verdict_of(found.nothing, outside * float(share), findings, refit=stale > LIKELY),
        findings,
        found.nothing,
        outside,
        stale,
        effects,
        likely,
        float(share),
        tuple(sorted(best)),
    )


def _named(
    name: str,
    best: frozenset[str],
    every: list[tuple[frozenset[str], frozenset[str], float]],
    robots: Sequence[Inference],
) -> Named:
    """An effect that all lack, its share and its numbers over the robots that tell them."""
    certainty = certain_of(name, best, [(effects, p) for effects, _, p in every])
    own = [f for robot in robots for f in robot.answer.findings if f.effect == name]
    keys = own[0].numbers if own else {}
    numbers = {key: pooled(np.array([f.numbers[key] for f in own])) for key in keys}
    return Named(name, *certainty, float(np.mean([f.share for f in own] or [0.0])), numbers)


def pooled(each: np.ndarray) -> tuple[float, float]:
    """Mean of a number over robots, and its standard deviation.

    Args:
        each: (R, 2) values and standard deviations; NaN where these are not known.
    """
    if not np.isfinite(each[:, 1]).all():
        return float(each[:, 0].mean()), float("nan")
    value, variance = each[:, 0], each[:, 1] ** 2
    fixed = 1 / variance
    middle = fixed @ value / fixed.sum()
    scale = fixed.sum() - (fixed**2).sum() / fixed.sum()
    more = fixed @ (value - middle) ** 2 - (len(value) - 1)
    between = max(0.0, more / scale) if len(value) > 1 else 0.0
    weight = 1 / (variance + between)
    return float(weight @ value / weight.sum()), float(weight.sum() ** -0.5)


def _differs(
    found: Shared, robots: Sequence[Inference], of_all: Answer, model_file: ModelFile
) -> list[Differs]:
    every = []
    numbers = _own_numbers(robots, model_file)
    for robot, beside, (chance, gains) in zip(robots, found.own, numbers, strict=True):
        rows = _beside(robot.answer, beside, found.words, of_all.added)
        if not rows and chance > LIKELY:
            rows = [(REFIT, chance, gains, (), False)]
        every += [
            Differs(
                robot.measurements[0].robot_id,
                *row,
                (robot.before.score, robot.after.score),
                float(np.median([r.before.score for r in robots if r is not robot])),
            )
            for row in rows
        ]
    return sorted(every, key=lambda one: (not one.is_effect, -one.probability))


def _beside(
    own: Answer, beside: dict[str, float], words: frozenset[str], of_all: Collection[str]
) -> list[tuple[str, float, dict[str, tuple[float, float]], tuple[str, ...], bool]]:
    """Name, probability, numbers and group of what a robot lacks beside what all do."""
    rows: list[tuple[str, float, dict[str, tuple[float, float]], tuple[str, ...], bool]] = []
    for f in own.findings:
        chance = min(1.0, sum(beside.get(name, 0.0) for name in f.group))
        if f.effect not in of_all and chance > LIKELY:
            numbers = {f"{f.effect}.{key}": value for key, value in f.numbers.items()}
            rows.append((f.effect, chance, numbers, f.group[1:], True))
    things = ((word, p) for word, p in beside.items() if word in words and p > LIKELY)
    return [*rows, *((word, p, {}, (), False) for word, p in things)]


def _own_numbers(
    robots: Sequence[Inference], model_file: ModelFile
) -> list[tuple[float, dict[str, tuple[float, float]]]]:
    """For each robot the probability to have speeds or a lag of its own, and these."""
    sheet = is_sheet(model_file)
    each = [_speeds(robot, model_file) for robot in robots]
    names = [*each[0]]
    chance = np.zeros((len(names), len(robots)))
    for k, name in enumerate(names):
        values, stds = np.array([own[name] for own in each]).T
        share = 2.0 if name == LAG else 1.0  # as of `Prior.sheet`
        chance[k] = odd(values, stds, share, None if sheet else 1.0)
    return [
        (
            float(p),
            {n: own[n] for n, odds in zip(names, chance[:, r], strict=True) if odds > LIKELY},
        )
        for r, (p, own) in enumerate(zip(chance.max(axis=0), each, strict=True))
    ]


def _speeds(robot: Inference, model_file: ModelFile) -> dict[str, tuple[float, float]]:
    """Speeds along the axes and lag over those of the given model, with standard deviations.

    What was found in the robot stays in; the base has the given numbers again.
    """
    given = written_on(model_file, robot.curved)
    axes = dict(zip(BASE_GAINS, range(3), strict=True))
    rows = []
    for one in robot.after.robots:
        model = one.model.copy()
        for entry in given.values():
            if entry["name"].startswith("base.") and entry["name"] != LAG:
                model.set(entry["name"], entry["value"])
        if not isinstance(one, RobotComparison):
            continue
        steps = Steps([StepsOfLog(one.measurement)])
        predicted = steps.predicted(model)
        rows.append((predicted + steps.errors(model)[0], predicted, steps.block))
    measured, predicted = (np.concatenate([row[k] for row in rows]) for k in (0, 1))
    blocks = np.concatenate([row[2] + 1000 * k for k, row in enumerate(rows)])
    value, std = slopes(measured, predicted, blocks)
    found = {name: (float(value[axes[name]]), float(std[axes[name]])) for name in gains_of(given)}
    numbers = robot.answer.numbers
    if LAG in numbers.labels and given.get(LAG) > 0:
        at = numbers.labels.index(LAG)
        lag = numbers.mean[at] / given.get(LAG), np.sqrt(numbers.cov[at, at]) / given.get(LAG)
        found[LAG] = float(lag[0]), float(lag[1])
    return found


def _late(each: Sequence[Late]) -> Late:
    def mean(key: str) -> float | None:
        values = [getattr(late, key) for late in each]
        return None if None in values else float(np.mean(values))

    sums = np.array([late.sum_s for late in each])
    stds = np.array([late.sum_std_s or 0.0 for late in each])
    spread_s = float(np.sqrt(max(0.0, sums.var(ddof=1) - np.mean(stds**2))))
    std_s = float(np.hypot(np.sqrt(np.mean(stds**2) / len(each)), spread_s))
    return Late(
        sum_s=float(sums.mean()),
        sum_std_s=std_s,
        delay_s=mean("delay_s"),
        lag_s=mean("lag_s"),
        clock_s=mean("clock_s"),
        parted=each[0].parted,
        spread_s=spread_s,
    )


def _joined(each: Sequence[Comparison]) -> Comparison:
    """One comparison of the robots of several."""
    robots = [robot for one in each for robot in one.robots]
    return replace(each[0], robots=robots, warnings=[w for one in each for w in one.warnings])
