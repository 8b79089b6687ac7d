# SPDX-License-Identifier: Apache-2.0
"""Puts a script together, move by move, that parts most within the time and the floor given."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import SHORTEST_LOG_S, Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.data.track import Track
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.fleet import Fleet
from twinmill.diagnosis.infer import Inference
from twinmill.experiment.hypotheses import Hypotheses, candidate_effects, hypotheses_of, question
from twinmill.experiment.information import CandidateEffect, FisherInformation
from twinmill.experiment.moves import Axis, Move, duty_axes, family, twist_axes
from twinmill.experiment.played import LEAD_S, Played, Rows, rows_of
from twinmill.experiment.power import power
from twinmill.experiment.relevance import relevance
from twinmill.fitting.fit import base_names
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import base_parameters, catalogue_of
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.residual import StepGrid
from twinmill.predict.windows import Windows, score

ENOUGH_CHI2 = 20.0  # a margin of this is about what an acceptance needs
BESIDES = 0.05  # weight of effects that are not in question: once these are seen, they count
WANDER_M = 0.08  # of a real robot from the predicted path within a minute, beside the candidates'
SHORTEST_RUN_S = SHORTEST_LOG_S + 3  # as much may be left where no further move fits
CENTRE = np.zeros(3)
DRIVES = ("duty", "twist")  # of robots that play scripts
NO_LOG = (
    "only steady-state tables were given; the next run is designed for the noise and the clocks "
    "of a log, so give one of any drive in their place."
)


@dataclass(frozen=True)
class Limits:
    """Space, time and commands that the user has for a run.

    Attributes:
        duration_s: longest run.
        floor_m: along and across the robot at its start.
        max_duty: highest duty, 0..1; of a robot told velocities, share of the highest in its logs.
    """

    duration_s: float
    floor_m: tuple[float, float]
    max_duty: float


@dataclass(frozen=True)
class Chance:
    """Probability that the run tells one effect, before it and after it.

    Attributes:
        effect, rival: and the effect that could imitate it best after the run; None: the base.
        margin_before, margin: chi2 that no rival can imitate, over the scatter of the log.
        power_before, power: chance that the effect is named if it is the one.
    """

    effect: str
    rival: str | None
    margin_before: float
    margin: float
    power_before: float
    power: float


@dataclass(frozen=True)
class Plan:
    """The script and what is predicted of it.

    Attributes:
        why: what the logs leave open.
        moves, rows: the script.
        chances: one per effect in question, surest first.
        pose_t_s, paths: (N,) s, and (V, N, 3) m, m, rad: the model's path, then with each effect.
        limits: that it was made for.
        radius_m: of the robot's body.
        robot_id: of the log.
    """

    why: str
    moves: list[Move]
    rows: Rows
    chances: list[Chance]
    pose_t_s: np.ndarray
    paths: np.ndarray
    limits: Limits
    radius_m: float
    robot_id: int

    @property
    def predicted_power(self) -> float:
        """Chance of the right name if each effect in question is as probable."""
        return float(np.mean([c.power for c in self.chances]))

    @property
    def separates(self) -> list[str]:
        """Effects that the run would more probably name than not."""
        return [c.effect for c in self.chances if c.power > 0.5]

    @property
    def extent_m(self) -> np.ndarray:
        """(2,) floor that the body sweeps on the predicted paths: along, across."""
        at = self.paths[..., :2].reshape(-1, 2)
        return np.ptp(at, axis=0) + 2 * self.radius_m

    def to_json(self) -> dict[str, Any]:
        """The interface's object, but for the path."""
        return {
            "separates": self.separates,
            "predicted_power": self.predicted_power,
            "why": self.why,
            "duration_s": self.rows.end_s,
            "floor_used_m": self.extent_m.tolist(),
            "moves": [m.name for m in self.moves],
            "effects": [vars(c) for c in self.chances],
        }


def plan_run(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    limits: Limits,
    progress: Callable[[str], None] = lambda _: None,
    *,
    own: Sequence[Measurement | SteadyTable] = (),
) -> Plan:
    """Diagnoses logs, and designs the run that best names what they leave open.

    Args:
        measurements: the logs so far.
        model_file: that they are diagnosed with.
        limits: time, floor, duty.
        progress: told in words what is being done.
        own: of the logs that the model was fitted to.

    Raises:
        ValueError: no script can be within these limits, or none shows what is in question.
    """
    check(measurements, model_file, limits)
    found = diagnose(measurements, model_file, own, progress)
    return design(found, model_file, limits, progress)


def design(
    found: Inference | Fleet,
    model_file: ModelFile,
    limits: Limits,
    progress: Callable[[str], None],
) -> Plan:
    """Designs the run that best names what the diagnosis leaves open.

    Args:
        found: diagnosis of the logs so far.
        model_file: that the diagnosis was given. Its score on other logs says what it lacks in
            drives that these logs do not have; its base is refitted to all that the run shows.
        limits: time, floor, duty; as `check` let them pass.
        progress: told in words what is being done.

    Raises:
        ValueError: there is no log, or no move shows what is in question.
    """
    logs = [o for o in found.opened if o.floor]
    hashes = [o.measurement.log_sha256 for o in logs]
    usual = model_file.usual_score(hashes)
    moves = family(_axes([o.track for o in logs], model_file.model, limits))
    progress("playing the moves in the twin")
    names = base_names(model_file.model, logs, model_file.known_from_other_logs(hashes))
    asked = hypotheses_of(found, base_parameters(model_file.model, names))
    modelled = log_of(asked.state.logs)
    predicted = Played.of([[m] for m in moves], modelled).modelled(modelled, CENTRE)
    known = candidate_effects(
        asked.state.logs, predicted, state=asked.state, asked=asked, usual=usual
    )
    fisher = FisherInformation(asked.state.free, known)
    told = np.sum([fisher.told(s) for s in asked.state.logs], axis=0)
    names, why = question(asked, known, _tempered(fisher, told), ENOUGH_CHI2)
    wanted = {i: with_effect(modelled.model, s) for i, s in enumerate(known) if s.name in names}
    if not wanted:
        raise ValueError(f"{why} No move that the twin can play shows any of them.")
    progress("choosing moves")
    floor = Floor(limits, modelled, list(wanted.values()))
    worth = partial(_worth, fisher, wanted=list(wanted))
    chosen = choose(moves, worth, told=told, predicted=fisher.predicted(predicted), floor=floor)
    progress("checking the whole script")
    whole = Played.of([chosen], modelled)
    planned = whole.modelled(modelled, CENTRE)
    after = told + fisher.predicted(planned)[0]
    outlook = _Outlook(asked, fisher, wanted, usual)
    return Plan(
        why=why,
        moves=chosen,
        rows=rows_of(chosen, modelled.measurement.track.command_kind),
        chances=outlook.chances(told, after, planned),
        pose_t_s=whole.pose_t_s - whole.pose_t_s[0],
        paths=np.array([whole.path(m, CENTRE) for m in floor.models]),
        limits=limits,
        radius_m=modelled.model.get("robot.body_radius_m"),
        robot_id=modelled.measurement.track.robot_id,
    )


def log_of(logs: list[ModelledLog]) -> ModelledLog:
    """The first log: clock, noise and rate of poses are taken to be the same in the next.

    Raises:
        ValueError: there is none.
    """
    logs = [log for log in logs if log.noise]
    if not logs:
        raise ValueError(NO_LOG)
    return logs[0]


def check(
    measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile, limits: Limits
) -> None:
    """Raises ValueError, before the long work, where no script can be."""
    logs = [m for m in measurements if isinstance(m, Measurement)]
    if not logs:
        raise ValueError(NO_LOG)
    model = model_file.model.for_robot(logs[0].track.robot_id)
    modelled = ModelledLog(logs[0], model, StepGrid.of(logs[0]), clock_free=True)
    if modelled.model.drive not in DRIVES:
        raise ValueError(
            f"the model is driven by {modelled.model.drive}, which is measured and not commanded; "
            f"scripts can be designed for robots driven by {' or '.join(DRIVES)}."
        )
    if limits.duration_s < SHORTEST_RUN_S:
        raise ValueError(
            f"a run of {limits.duration_s:g} s is too short: no model is judged on less than "
            f"{SHORTEST_LOG_S:g} s, and moves come whole; allow {SHORTEST_RUN_S:g} s."
        )
    floor, axes = (
        Floor(limits, modelled, []),
        _axes([m.track for m in logs], modelled.model, limits),
    )
    if not any(floor.holds([m]) for m in family(axes)):
        size = "x".join(f"{side:g}" for side in limits.floor_m)
        need_m = 2 * (modelled.model.get("robot.body_radius_m") + WANDER_M)
        raise ValueError(
            f"no move fits on a floor of {size} m: the robot's body and what it may stray take "
            f"{need_m:.2g} m each way; allow more."
        )


def _axes(tracks: Sequence[Track], model: native.Model, limits: Limits) -> list[Axis]:
    """Ways to drive within the limits; velocities as high as any in the logs are known to be safe.

    Raises:
        ValueError: the logs tell the robot no velocity.
    """
    if model.drive == "duty":
        return duty_axes(limits.max_duty, model.wheel_kind)
    told = np.vstack([track.command[:, :3] for track in tracks])
    axes = twist_axes(limits.max_duty * np.abs(told).max(axis=0))
    if not axes:
        raise ValueError(
            "the logs tell the robot no velocity but zero, so nothing says how fast it may drive; "
            "give a log in which it drives."
        )
    return axes


class Floor:
    """Keeps the robot on the floor, whichever of the effects it has."""

    def __init__(self, limits: Limits, modelled: ModelledLog, richer: list[native.Model]) -> None:
        self.modelled, self.limits = modelled, limits
        self.models = [modelled.model, *richer]
        radius_m = modelled.model.get("robot.body_radius_m")
        self.room_m = np.array(limits.floor_m) / 2 - radius_m - WANDER_M

    def holds(self, moves: list[Move]) -> bool:
        """True if these moves, one after the other, stay on the floor."""
        played = Played.of([moves], self.modelled)
        return all(
            np.all(np.abs(played.path(model, CENTRE)[:, :2]) <= self.room_m)
            for model in self.models
        )


def with_effect(model: native.Model, effect: CandidateEffect) -> native.Model:
    """The model with the effect at its strength."""
    richer = model.copy()
    richer.add_effect(effect.name)
    for name, value in zip(effect.whole.names, effect.whole.target[0], strict=True):
        richer.set(f"{effect.name}.{name}", value)
    return richer


def choose(
    moves: list[Move],
    worth_of: Callable[[np.ndarray], np.ndarray],
    *,
    told: np.ndarray,
    predicted: np.ndarray,
    floor: Floor,
) -> list[Move]:
    """Greedy: each time the move that adds most per second and still stays on the floor.

    Args:
        moves: M of them.
        worth_of: (..., C, C) products of what runs tell to (...,) what they are worth.
        told: (C, C) of the runs so far.
        predicted: (M, C, C) of each move.
        floor: with its limits.
    """
    left_s = floor.limits.duration_s - 2 * LEAD_S
    duration_s = np.array([m.duration_s for m in moves])
    chosen: list[Move] = []
    while True:
        worth = worth_of(told + predicted) - worth_of(told)
        worth = np.where(duration_s <= left_s, worth / duration_s, -np.inf)
        order = [int(k) for k in np.argsort(worth)[::-1] if np.isfinite(worth[k])]
        best = next((k for k in order if floor.holds([*chosen, moves[k]])), None)
        if best is None:
            break
        chosen.append(moves[best])
        told = told + predicted[best]
        left_s -= duration_s[best]
    return chosen


def _worth(fisher: FisherInformation, grams: np.ndarray, wanted: list[int]) -> np.ndarray:
    """(...,) sum of what is reached of an ample margin: of the effects in question, then of all."""
    margins = _tempered(fisher, grams).min(axis=-1)
    reached = margins / (margins + ENOUGH_CHI2)
    return reached[..., wanted].sum(axis=-1) + BESIDES * reached.sum(axis=-1)


def _tempered(fisher: FisherInformation, grams: np.ndarray) -> np.ndarray:
    """(..., T, 1 + J) margins over the scatter of the log."""
    excess = np.array([s.excess for s in fisher.candidate_effects])
    return fisher.margins(grams) / excess[:, None]


@dataclass(frozen=True)
class _Outlook:
    """Predicted evidence for the effects in question.

    Attributes:
        asked, fisher: the question, and what runs tell of all effects.
        wanted: by place in the fisher the model with the effect.
        usual: score of the model on the logs that it was fitted to.
    """

    asked: Hypotheses
    fisher: FisherInformation
    wanted: dict[int, native.Model]
    usual: float

    def chances(self, told: np.ndarray, after: np.ndarray, planned: ModelledLog) -> list[Chance]:
        """Chance of each effect before and after the planned run, surest first."""
        before_chi2, before = self._power(told, [])
        chi2, then = self._power(after, [planned])
        chances = []
        for row, place in enumerate(self.wanted):
            nearest = int(chi2[row].argmin())
            chances.append(
                Chance(
                    self.fisher.candidate_effects[place].name,
                    self.fisher.candidate_effects[nearest - 1].name if nearest else None,
                    float(before_chi2[row].min()),
                    float(chi2[row].min()),
                    float(before[row]),
                    float(then[row]),
                )
            )
        return sorted(chances, key=lambda c: -c.power)

    def _power(
        self, grams: np.ndarray, planned: list[ModelledLog]
    ) -> tuple[np.ndarray, np.ndarray]:
        """(T, 1 + J) margins of the wanted over the scatter, and (T,) chances to be named."""
        state, candidate_effects = self.asked.state, self.fisher.candidate_effects
        margins = _tempered(self.fisher, grams)[list(self.wanted)]
        driven = [(s, f) for s, f in zip(state.logs, state.floors, strict=True) if s.noise]
        scores = [score(Windows.of(s.measurement.track).errors(s), f) for s, f in driven]
        logs = [*(s for s, _ in driven), *planned]
        floors = [*(f for _, f in driven), *(driven[0][1] for _ in planned)]
        scores += [max(1.0, self.usual, *scores) for _ in planned]
        matter = relevance(logs, floors, scores, self.fisher, grams=grams, richer=self.wanted)
        cards = catalogue_of(state.logs[0].model)
        entries = [cards[candidate_effects[i].name] for i in self.wanted]
        return margins, power(
            margins,
            np.array([len(e["parameters"]) for e in entries]),
            candidates=len(candidate_effects),
            relevance=matter,
            fitted=np.array([e["name"] in self.asked.fitted for e in entries]),
        )
