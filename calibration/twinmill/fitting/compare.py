# SPDX-License-Identifier: Apache-2.0
"""Compares a model with measurements: how wrong it is, against the log's own floor, and where."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement, unsteady
from twinmill.data.steady_table import SteadyTable
from twinmill.estimation.equations import idle, said_of_unseen, unseen
from twinmill.estimation.opened import NoiseFloor, Opened
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    CLOCK,
    HEADING,
    ParameterEstimate,
    instance_of,
    starting_angles,
    unevenness,
)
from twinmill.predict.datasets import total_score
from twinmill.predict.detection_errors import DetectionComparison, compare_detections
from twinmill.predict.detections import all_detections
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.regimes import Regime, where_it_fails
from twinmill.predict.steady_errors import SteadyComparison, compare_steady
from twinmill.predict.steady_states import SteadyStates
from twinmill.predict.whiteness import memory, p_value
from twinmill.predict.windows import CHANNELS, HORIZONS_S, Windows, rms

# Scores: stop; something is missing; the best model found is not good enough, or data leaked.
GOOD, MISSING, SUSPECT = 1.15, 1.3, 0.9
LACKING = "Missing: "  # how a sentence on what a model lacks begins
TELLING = 0.1  # of the most uneven wheel; the angle of one that is less so is hardly told
NAMED = 3  # robots that are missed; of more the number is told


@dataclass(frozen=True)
class RobotComparison:
    """One robot in one log.

    Attributes:
        modelled: measurement, model with the clock used, noise.
        windows: where predictions start and end.
        errors: (W, H, 3) measured less predicted, seen from the start; m, m, rad; NaN where a bump
            hides them.
        floor: of the log, and where it comes from.
        score: RMS over horizons and channels of error over floor; NaN without a floor.
        where: regimes.
        phases: moments of the periods of the model's formulas at which the log begins.
        unseen: names of formulas that recur and that this log does not show.
    """

    modelled: ModelledLog
    windows: Windows
    errors: np.ndarray
    floor: NoiseFloor
    score: float
    where: list[Regime]
    phases: tuple[ParameterEstimate, ...] = ()
    unseen: tuple[str, ...] = ()

    @property
    def measurement(self) -> Measurement:
        """The robot in its log."""
        return self.modelled.measurement

    @property
    def robot_id(self) -> int:
        """Its number."""
        return self.measurement.track.robot_id

    @property
    def model(self) -> native.Model:
        """Model of the robot, on the clock used."""
        return self.modelled.model

    @property
    def size(self) -> int:
        """How many values were predicted: the errors of the largest are shown."""
        return len(self.windows.starts)

    @property
    def time_offset_s(self) -> float:
        """Capture's clock less the robot's."""
        return self.model.get(CLOCK)

    @property
    def held_heading_rad(self) -> float | None:
        """Where the robot heads in a log that does not record it; None where it was recorded."""
        recorded = self.measurement.track.has_heading
        return None if recorded else self.model.get(HEADING)

    @property
    def wheel_angles_rad(self) -> dict[str, float] | None:
        """Where uneven wheels begin the log, -pi..pi; None where the model does not act by it."""
        angles_rad = {
            w["name"]: float(np.angle(np.exp(1j * p.value)))
            for w, p in zip(self.model.wheels(), starting_angles(self.model), strict=False)
        }
        uneven = {w: unevenness(self.model, w) for w in angles_rad}
        least = TELLING * max(uneven.values(), default=0.0)
        return {w: a for w, a in angles_rad.items() if uneven[w] >= least} or None

    @property
    def whiteness(self) -> float:
        """P-value that its errors are noise: `twinmill.predict.whiteness`."""
        return p_value(memory(self.errors), self.floor.memories)

    def error_rows(self) -> list[dict[str, Any]]:
        """errors[] of the interface: one row per channel and horizon."""
        found = rms(self.errors)
        return [
            {
                "channel": channel,
                "unit": unit,
                "horizon_s": horizon_s,
                "rms": float(found[h, c]),
                "floor": float(self.floor.rms[h, c]),
                "ratio": float(found[h, c] / self.floor.rms[h, c]),
            }
            for c, (channel, unit) in enumerate(CHANNELS)
            for h, horizon_s in enumerate(HORIZONS_S)
        ]

    def to_json(self) -> dict[str, Any]:
        """One entry of robots[]."""
        return {
            "robot_id": self.robot_id,
            "log": self.measurement.log_name,
            "score": self.score,
            "score_by_chance": list(self.floor.by_chance),
            "whiteness_p": self.whiteness,
            "floor_kind": self.floor.kind,
            "noise": self.modelled.known_noise.to_json(),
            "errors": self.error_rows(),
            "where": [r.to_json() for r in self.where],
            "time_offset_s": self.time_offset_s,
            "held_heading_rad": self.held_heading_rad,
            "wheel_angles_rad": self.wheel_angles_rad,
            "phases": [p.to_json() for p in self.phases],
            "time_base": base.to_json() if (base := self.measurement.time_base) else None,
        }


@dataclass(frozen=True)
class Comparison:
    """All robots of all logs and tables against one model.

    Attributes:
        detections: of their cameras, or None.
        about: number of the one robot that something was added to; None where that is of all.
    """

    model_name: str
    robots: list[RobotComparison | SteadyComparison]
    warnings: list[str]
    detections: DetectionComparison | None = None
    about: int | None = None

    @property
    def score(self) -> float:
        """Geometric mean over robots, none counted below 1; NaN if no log gives a floor."""
        known = [r.score for r in self.robots if np.isfinite(r.score)]
        return total_score(known) if known else float("nan")

    @property
    def main(self) -> RobotComparison | SteadyComparison:
        """The robot with the most predictions."""
        return max(self.robots, key=lambda r: r.size)

    @property
    def worst(self) -> RobotComparison | SteadyComparison:
        """The robot that the model misses most; tables stand for all their robots."""
        return self._most_missed(self.robots)

    @property
    def shown(self) -> RobotComparison | SteadyComparison:
        """The robot whose errors are shown: that which something was added to, or the worst."""
        own = [r for r in self.robots if r.robot_id == self.about]
        return self._most_missed(own or self.robots)

    @staticmethod
    def _most_missed(
        robots: list[RobotComparison | SteadyComparison],
    ) -> RobotComparison | SteadyComparison:
        main = max(robots, key=lambda r: r.size)
        if isinstance(main, SteadyComparison):
            return main
        logs = [r for r in robots if not isinstance(r, SteadyComparison)]
        return max(logs, key=lambda r: (np.nan_to_num(r.score, nan=-1.0), r.size))

    @property
    def missed(self) -> list[RobotComparison | SteadyComparison]:
        """Robots that the model misses while it predicts others, worst first."""
        over = sorted((r for r in self.robots if r.score > MISSING), key=lambda r: -r.score)
        return over if any(r.score <= MISSING for r in self.robots) else []

    @property
    def verdict(self) -> str:
        """Meaning of the score, after the input's word on when commands act."""
        told = unsteady([r.measurement for r in self.robots])
        return " ".join([*told, self._own_verdict("nothing else" if told else "nothing")])

    def _own_verdict(self, nothing: str) -> str:
        """Meaning of the score alone; where some robots are missed and others not, of both."""
        missed = self.missed
        if not missed:
            return _meaning(self.score, nothing)
        others = [r.score for r in self.robots if r.score <= MISSING]
        named = [f"{r.measurement.label} (score {r.score:.3g})" for r in missed[:NAMED]]
        more = len(missed) - len(named)
        named += [f"{more} more"] if more else []
        rest = _of_others(len(others), _meaning(total_score(others), nothing))
        return f"Missed: {', '.join(named)}. {rest}"

    def error_rows(self) -> list[dict[str, Any]]:
        """errors[] of the interface, of all that the score is of: root mean squares over robots.

        Each robot of each log counts by its predictions; one without a floor has no score.
        """
        cells: dict[tuple[str, str, float], list[tuple[int, dict[str, Any]]]] = {}
        scored = [r for r in self.robots if np.isfinite(r.score)] or self.robots
        for robot in scored:
            for row in robot.error_rows():
                key = (row["channel"], row["unit"], row["horizon_s"])
                cells.setdefault(key, []).append((robot.size, row))
        return [_together(own) for own in cells.values()]

    def to_json(self) -> dict[str, Any]:
        """The interface's object; what is of one robot is of the one that it misses most."""
        return {
            "model": self.model_name,
            **self.worst.to_json(),
            "score": self.score,
            "errors": self.error_rows(),
            "verdict": self.verdict,
            "robots": [r.to_json() for r in self.robots],
            "bits": self.detections.to_json() if self.detections else None,
            "warnings": self.warnings,
        }


def _together(rows: Sequence[tuple[int, dict[str, Any]]]) -> dict[str, Any]:
    """One row of errors in the place of several, each of so many predictions."""
    (_, first), *others = rows
    if not others:
        return first
    sizes, own = zip(*rows, strict=True)
    squares = np.square([[row[name] for name in ("rms", "floor", "ratio")] for row in own])
    means = np.sqrt(np.average(squares, axis=0, weights=sizes))
    return first | dict(zip(("rms", "floor", "ratio"), means.tolist(), strict=True))


def _of_others(count: int, sentence: str) -> str:
    """A sentence on all robots but those that were named before."""
    return f"{'The other' if count == 1 else 'All others'}: {sentence[0].lower()}{sentence[1:]}"


def _meaning(score: float, nothing: str) -> str:
    """Score in plain words, one sentence.

    Args:
        score: to judge.
        nothing: that, or nothing else where the input told something.
    """
    if not np.isfinite(score):
        return "No score: no log tells its noise from the motion."
    if score < SUSPECT:
        return "Predicts better than the noise estimate: this log shows nothing to improve."
    if score <= GOOD:
        return f"As good as this log can tell: {nothing} is missing that it would show."
    if score <= MISSING:
        return (
            "Close to what this log can tell; a small effect may be missing, or parameters are "
            "stale."
        )
    return "Something is missing in the model, or its parameters are stale."


def compare_robot(own: Opened) -> RobotComparison | SteadyComparison:
    """Compares one robot; its model and clock are taken as they are."""
    modelled = own.modelled()
    if isinstance(modelled, SteadyStates):
        return compare_steady(modelled)
    windows, floor = Windows.of(own.track), own.known_floor
    errors = np.where(floor.keep[:, None, None], windows.errors(modelled), np.nan)
    regimes = where_it_fails(modelled, windows, errors, floor.rms) if own.data else []
    gone = tuple(unseen(own.data, own.model)) if own.data else ()
    phases = tuple(replace(p, seen=p.seen and _of(p) not in gone) for p in own.phases)
    return RobotComparison(
        modelled, windows, errors, floor, own.score, regimes, phases=phases, unseen=gone
    )


def _of(phase: ParameterEstimate) -> str:
    """The formula whose phase it is."""
    return instance_of(phase.name)


def comparison(
    model_file: ModelFile, opened: Sequence[Opened], fitted_name: str = ""
) -> Comparison:
    """Comparison of measurements as they stand; a model fitted to them goes by its new name."""
    warnings = _warnings([o.measurement for o in opened])
    warnings += [f"{o.floor.reason}." for o in opened if o.floor and o.floor.reason]
    known = [(o.model, o.data) for o in opened if o.data is not None]
    warnings += idle([data for _, data in known], [model for model, _ in known])
    robots = [compare_robot(o) for o in opened]
    logs = [r for r in robots if isinstance(r, RobotComparison)]
    warnings += [said for r in logs for said in said_of_unseen(r.measurement.label, r.unseen)]
    return Comparison(fitted_name or model_file.path.name, robots, warnings)


def _warnings(measurements: Sequence[Measurement | SteadyTable]) -> list[str]:
    """Warnings of each measurement; one for all robots of a log is told once, of the log."""
    said: dict[tuple[str, str], list[str]] = {}
    for m in measurements:
        for words in m.warnings:
            said.setdefault((m.log_name, words), []).append(m.label)
    robots = Counter(m.log_name for m in measurements)
    found = []
    for (log, words), labels in said.items():
        of_all = len(labels) == robots[log] > 1
        words = words.removeprefix(f"{log}: ")  # of the file itself, which the label names
        found += [f"{log}: {words}"] if of_all else [f"{label}: {words}" for label in labels]
    return found


def compare(measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile) -> Comparison:
    """Compares a model with every robot of every log.

    A clock offset that the model knows or the log declares is used; else each log's own is found.
    """
    opened = open_measurements(measurements, model_file)
    found = comparison(model_file, opened)
    detections = compare_detections(
        all_detections([r.modelled for r in found.robots]), model_file.model
    )
    return replace(found, detections=detections)
