# SPDX-License-Identifier: Apache-2.0
"""A session at the workbench without any screen: logs, models tried, predictions, scores, findings.

Opened in stages, each slower than the one before: `read` gives the paths, `measure` what can be
predicted, `judge` the floor and the clock of one robot at a time. The checks of the commands take
longest: they are made elsewhere, and `exclude_wrong` takes in what they found.
"""

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.charts.arrays import Arrays, RobotView
from twinmill.data.checks import InputFinding
from twinmill.data.log import Log, RobotLog, read_log
from twinmill.data.measurement import Measurements, clean_measurements
from twinmill.data.steady_table import is_steady_table
from twinmill.estimation.opened import Opened
from twinmill.estimation.score_fit import ScoreFit
from twinmill.files import replacing
from twinmill.fitting.add import begun_at_best, with_effect, with_own
from twinmill.fitting.fit import base_names
from twinmill.fitting.opening import on_clock_of_others, open_measurements
from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import (
    CLOCK,
    Parameter,
    all_effect_parameters,
    base_parameters,
)
from twinmill.predict.datasets import Trajectory, total_score
from twinmill.predict.detections import Detections, detections_of
from twinmill.predict.regimes import Regime, where_it_fails
from twinmill.predict.windows import Windows
from twinmill.workbench.knobs import Knob, knobs
from twinmill.workbench.next_run import next_command, then_commands
from twinmill.workbench.swarm import swarm_commands, without_poses
from twinmill.workbench.tree import Score, Tree
from twinmill.workbench.worker import Done, Work

FORESEEN_ROUNDS = 2  # of the fit that gives a first answer
FORESEEN_WINDOWS = 1500  # of the robots that it is about
DRAGGED_EVERY = 2  # windows: while a knob is turned one in so many tells the clock
DRAGGED_STEP_S = 0.004  # of the clock, by which the slope of the errors is found
DRAGGED_MOST_S = 0.1  # that the clock moves at once


class OpenedView(RobotView):
    """One robot that was judged, with its floor and clock."""

    def __init__(self, opened: Opened) -> None:
        super().__init__(opened.measurement, opened.floor, not opened.same_clock)
        self.opened = opened
        self._drawn: list[tuple[native.Model, int, Arrays]] = []

    def predicted(self, model: native.Model, every: int = 1) -> Arrays:
        """As of any view; that of the last two models is known, one of which is drawn beside."""
        for known, thinned, arrays in self._drawn:
            if known is model and thinned == every:
                return arrays
        arrays = super().predicted(model, every)
        self._drawn = [(model, every, arrays), *self._drawn[:1]]
        return arrays

    @cached_property
    def sparse(self) -> Trajectory:
        """Few windows of one that has a floor: they tell the clock at once and nearly as well."""
        data, every = self.opened.data, DRAGGED_EVERY
        windows = Windows(self.windows.starts[::every], self.windows.ends[::every])
        few = Trajectory.at(self.measurement, windows)
        return few.over(data.floor, data.keep[::every])


@dataclass(frozen=True)
class Beside:
    """Another model that is drawn beside the one shown.

    Attributes:
        label: for people.
        opened: each robot with it, by index.
    """

    label: str
    opened: Mapping[int, Opened]


class Session:
    """One model, at first as given, and all logs given.

    Args:
        logs: LCM logs.
        model: name of the model file, here or among the installed models.

    Attributes:
        robots: views of the robots that were judged, by place in `measurements`.
        checked: the commands were held against the motion, and `exclude_wrong` was told.
        held: names that a fit leaves alone.
        diagnosis: as `diagnose --json` gives it, and of which model; None before.
        plan: the next run, as the worker told it, or None.
        swarm: what the twin's swarms did, or None.
        beside: another model that is drawn beside the one shown, or None.

    Raises:
        ModelError: no such model.
    """

    def __init__(self, logs: Sequence[Path], model: str) -> None:
        for path in logs:
            if is_steady_table(path):
                raise ModelError(
                    f"{path}: is a steady-state table; the workbench shows logs. "
                    "`twinmill compare` reads it."
                )
        self.paths = list(logs)
        self.given = ModelFile.load(model)
        self.tree = Tree(self.given, model)
        self.logs: list[Log] = []
        self.measurements = Measurements([], [], [])
        self.robots: dict[int, OpenedView] = {}
        self.checked = False
        self.held: set[str] = set()
        self.diagnosis: dict | None = None
        self.plan: dict | None = None
        self.swarm: dict | None = None
        self.beside: Beside | None = None
        self._files = {0: self.given}
        self._bits: dict[int, Detections | None] = {}
        self._dragged: dict[str, float] = {}
        self._previewed: dict[int, Opened] = {}
        self._passing: dict[int, Opened] = {}
        self._clocks: dict[int, float] = {}  # as the hand goes on, they come nearer to the best
        self._settled: dict[tuple[int, int], Opened] = {}
        self._previews: dict[tuple, dict[int, Opened]] = {}

    # -- opening --------------------------------------------------------------------------------

    def read(self) -> None:
        """Reads the logs.

        Raises:
            LogError: one cannot be read.
        """
        self.logs = [read_log(path) for path in self.paths]

    def measure(self) -> None:
        """Cleans the robots' runs.

        Raises:
            LogError: no run can be judged.
        """
        self.measurements = clean_measurements(self.logs, self.given.model)

    @property
    def unjudged(self) -> list[int]:
        """Places in `measurements` of those that `judge` has not seen."""
        return [k for k in range(len(self.measurements)) if k not in self.robots]

    def judge(self, index: int) -> None:
        """Finds clock and noise floor of one robot."""
        (opened,) = open_measurements([self.measurements[index]], self.given)
        self.robots = {**self.robots, index: OpenedView(opened)}
        self.settled(self.tree.current.number, index)  # a screen that asks does not wait

    def exclude_wrong(self, findings: Sequence[InputFinding]) -> None:
        """Leaves out the robots that the checks of the commands found to be wrong.

        Raises:
            BadInputError: none is left.
        """
        before, self.checked = self.measurements, True
        self.measurements = before.excluding_wrong(
            [f for f in findings if f not in before.findings]
        )
        if [*map(id, self.measurements)] == [*map(id, before)]:
            return  # what is shown, or comes soon, stays
        places = {id(m): k for k, m in enumerate(self.measurements)}
        kept = {k: places[id(m)] for k, m in enumerate(before) if id(m) in places}
        seen = {before[k].label for k in self.robots}
        self.robots = {kept[k]: view for k, view in self.robots.items() if k in kept}
        for known in (self._bits, self._settled, self._previews):
            known.clear()
        self.beside = None
        self.forget()
        for k in self.unjudged:  # of which something was cut out
            if self.measurements[k].label in seen:
                self.judge(k)

    def conclude(self) -> None:
        """After the last robot: clocks that several share, and the score of all."""
        all_opened = [view.opened for view in self.robots.values()]
        for k, view in self.robots.items():
            on_clock = on_clock_of_others(view.opened, all_opened)
            if on_clock is not view.opened:
                self.robots[k] = OpenedView(on_clock)
                for known in [key for key in self._settled if key[1] == k]:
                    del self._settled[known]
        self._previews.clear()
        self.score_now(exact=self.tree.current.number == 0)

    def raw(self, index: int) -> RobotLog:
        """Recorded log of a robot that is predicted."""
        of = self.measurements[index]
        log = next(log for log in self.logs if log.sha256 == of.log_sha256)
        return log.robots[of.track.robot_id]

    @property
    def notes(self) -> list[str]:
        """Faults of the input, and the parts of it that were left out."""
        mild = [str(f) for f in self.measurements.findings if not f.fatal]
        return [*self.measurements.excluded, *mild]

    # -- the model shown ------------------------------------------------------------------------

    @property
    def model_file(self) -> ModelFile:
        """Where the tree stands."""
        return self._file(self.tree.current.number)

    def _file(self, number: int) -> ModelFile:
        if number not in self._files:
            self._files[number] = self.tree.model_file(number)
        return self._files[number]

    @property
    def is_outdated(self) -> bool:
        """True if the file of the model as given holds another one by now, or is gone."""
        try:
            return self.given.path.read_text() != self.given.text
        except OSError:
            return True

    @property
    def is_dragged(self) -> bool:
        """True if a hand holds a knob."""
        return bool(self._dragged)

    @property
    def is_passing(self) -> bool:
        """True if the model shown is not in the tree: a hand holds a knob, or a fit goes on."""
        return bool(self._dragged or self._previewed)

    def knobs(self) -> list[Knob]:
        """Knobs of the model where the tree stands."""
        tried = self.tree.current
        told = self.tree.model_file(tried.parent) if tried.values else self.model_file
        return knobs(self.model_file, told, self._judged)

    def drag(self, name: str, value: float) -> None:
        """Moves a quantity, to be seen and not yet to be kept.

        Raises:
            ModelError: it has no such quantity, or the value is outside its bounds.
        """
        bounds = {v["name"]: v for v in self.model_file.model.values()}.get(name)
        if bounds is None:
            raise ModelError(f"{name}: is no quantity of this model.")
        if not bounds["min"] <= value <= bounds["max"]:
            raise ModelError(
                f"{name} = {value:g}: must be within {bounds['min']:g} to {bounds['max']:g}."
            )
        self._previewed, self.beside = {}, None
        self._dragged = {**self._dragged, name: value}
        self._passing = {}

    def keep(self) -> None:
        """Makes what was dragged a model of its own."""
        values = {n: v for n, v in self._dragged.items() if v != self.model_file.model.get(n)}
        self.forget()
        if values:
            self.tree.set(values)

    def forget(self) -> None:
        """Shows the model where the tree stands."""
        self._dragged, self._passing, self._clocks, self._previewed = {}, {}, {}, {}

    def try_beside(self, effect: str, index: int, robot_id: int | None = None) -> None:
        """Draws what an effect would change beside the model where the tree stands."""
        self.beside = Beside(beside_label(effect, robot_id), self.preview(effect, index, robot_id))

    def show(self, previewed: dict[int, Opened]) -> None:
        """Shows what `preview` gave until something else is shown, beside the model as it is."""
        self.forget()
        self._previewed = previewed
        self.beside = self._before(self.tree.current.number)

    def _before(self, number: int) -> Beside:
        return Beside("before", {k: self.settled(number, k) for k in self.robots})

    def preview(self, effect: str, index: int, robot_id: int | None = None) -> dict[int, Opened]:
        """About what a fit, or the addition of an effect, will come to: all robots by index.

        A few steps of the fit to as many robots as an answer at once can be about; `index` is one.
        What was previewed once is known from then on. With `robot_id` that robot alone has the
        effect.
        """
        held, seen = frozenset(self.held), len(self.robots)
        asked = (self.tree.current.number, held, seen, effect, index, robot_id)
        if asked not in self._previews:
            self._previews[asked] = self._preview_of(effect, index, robot_id)
        return self._previews[asked]

    def _preview_of(self, effect: str, index: int, robot_id: int | None) -> dict[int, Opened]:
        number = self.tree.current.number
        model, fresh = self._file(number).model.copy(), []
        free = [p for p in self._free(model) if p.name not in self.held]
        if effect:
            model, _, fresh = with_effect(model, effect, {}, robot_id)
        members = self._foremost(index)
        known = [_from_here(self.settled(number, k)) for k in members]
        if fresh:
            without = ScoreFit([o.data for o in known], [o.model for o in known], free)
            fresh = begun_at_best(effect, fresh, without, robot_id)
        if robot_id is not None:
            known, shared = with_own(known, robot_id, fresh), free
        else:
            shared = [*free, *fresh]
        known = [o.with_model(model) for o in known]
        fit = ScoreFit([o.data for o in known], [o.model for o in known], shared)
        if fresh:
            fit.begin_at_best(fresh)
        fit.fit(rounds=FORESEEN_ROUNDS)
        for p in fit.shared_values:
            model.set(p.name, p.value)
        fitted = {k: o.with_fitted(m) for k, o, m in zip(members, known, fit.models, strict=True)}
        others = set(self.robots) - set(members)
        return fitted | {k: self.settled(number, k).with_model(model) for k in others}

    def _foremost(self, index: int) -> list[int]:
        """One robot, and of the others as many as an answer at once can be about."""
        order = [index, *(k for k in self.robots if k != index)]
        members, windows = [], 0
        for k in order:
            data = self.robots[k].opened.data
            windows += len(self.robots[k].windows.starts) if data is not None else 0
            if data is not None and (not members or windows <= FORESEEN_WINDOWS):
                members.append(k)
        return members

    def place_of(self, robot_id: int) -> int:
        """Place of the first measurement of a robot."""
        return next(k for k, m in enumerate(self.measurements) if m.track.robot_id == robot_id)

    @property
    def _judged(self) -> list[Opened]:
        """Those that have a floor."""
        opened = [view.opened for view in self.robots.values()]
        return [o for o in opened if o.data is not None]

    def _free(self, model: native.Model) -> list[Parameter]:
        """Parameters that a fit of these logs moves."""
        base = base_parameters(model, base_names(model, self._judged))
        return [*base, *all_effect_parameters(model)]

    def set(self, name: str, value: float) -> None:
        """Drags a quantity to a value and keeps it."""
        self.drag(name, value)
        self.keep()

    def undo(self) -> None:
        """To the model before."""
        self.forget()
        self.beside = None
        self.tree.undo()

    def redo(self) -> None:
        """Takes an undo back."""
        self.forget()
        self.beside = None
        self.tree.redo()

    def go(self, number: int) -> None:
        """To any model tried."""
        self.forget()
        self.beside = None
        self.tree.go(number)

    def save(self, path: Path) -> list[str]:
        """Writes the model file where the tree stands, whole or not at all.

        Returns:
            The commands that write the same file.

        Raises:
            ModelError: it is the model as given, is there already, or cannot be written.
        """
        if self.tree.current.number == 0:
            raise ModelError(f"{self.tree.name}: is the model as given; there is nothing to save.")
        commands, text = self.tree.written(self.tree.current.number, str(path))
        with replacing(path, force=None) as temporary:
            temporary.write_text(text)
        return commands

    # -- predictions and scores -----------------------------------------------------------------

    def settled(self, number: int, index: int) -> Opened:
        """One robot with a model of the tree, on the clock that suits it best."""
        opened = self.robots[index].opened
        if number == 0:
            return opened
        if (number, index) not in self._settled:
            self._settled[number, index] = opened.aligned(self._file(number).model)
        return self._settled[number, index]

    def shown(self, index: int) -> Opened:
        """One robot with the model shown: in the tree, to come, or under a hand."""
        if index in self._previewed:
            return self._previewed[index]
        settled = self.settled(self.tree.current.number, index)
        dragged, passing = self._dragged, self._passing  # a hand goes on meanwhile
        if not dragged:
            return settled
        if index not in passing:
            model = self.model_file.model.copy()
            for name, value in dragged.items():
                model.set(name, value)
            passing[index] = self._on_clock(index, settled.with_model(model))
        return passing[index]

    def _on_clock(self, index: int, dragged: Opened) -> Opened:
        """One under a hand, its clock's offset one step of Gauss and Newton nearer to the best."""
        if dragged.same_clock or dragged.data is None:
            return dragged
        at_s = self._clocks.get(index, dragged.model.get(CLOCK))
        few = self.robots[index].sparse
        here, there = few.rows(dragged.model, [CLOCK], np.array([[at_s], [at_s + DRAGGED_STEP_S]]))
        slope = (there - here) / DRAGGED_STEP_S
        step_s = -(slope @ here) / max(slope @ slope, 1e-12)
        self._clocks[index] = at_s + float(np.clip(step_s, -DRAGGED_MOST_S, DRAGGED_MOST_S))
        dragged.model.set(CLOCK, self._clocks[index])
        return dragged

    def passing_score(self, index: int) -> float:
        """About that of the model shown, from as many robots as can be asked at once."""
        return total_score([self.shown(k).score for k in self._foremost(index)])

    def score_beside(self, index: int) -> float:
        """Score of the model beside."""
        known = self.beside.opened
        return total_score([known[k].score for k in self._foremost(index) if k in known])

    def beside_of(self, index: int) -> tuple[str, native.Model] | None:
        """Label and model of one robot that is drawn beside the model shown."""
        if self.beside is None or index not in self.beside.opened:
            return None
        return self.beside.label, self.beside.opened[index].model

    def detections(self, index: int) -> Detections | None:
        """Detections of its camera, with the paths of its log's other robots; None without them."""
        if index not in self._bits and not self.unjudged:
            self._bits[index] = self._detections_of(index)
        return self._bits.get(index)

    def _detections_of(self, index: int) -> Detections | None:
        log = self.measurements[index].log_sha256
        members = [k for k in self.robots if self.measurements[k].log_sha256 == log]
        if len(members) < 2 or self.measurements[index].frames is None:
            return None
        logs = [self.robots[k].modelled(self.robots[k].opened.model) for k in members]
        own = members.index(index)
        logs[own] = self.robots[index].opened.modelled()
        made = detections_of(logs, own)
        return made if made.usable.any() else None

    def own_scores(self) -> dict[int, float]:
        """Score of each robot where the tree stands; NaN without a floor."""
        return self._own_scores(self.tree.current.number)

    def _own_scores(self, number: int) -> dict[int, float]:
        return {k: self.settled(number, k).score for k in self.robots}

    def regimes(self, index: int) -> list[Regime]:
        """Where the model shown fails one robot; none without a floor."""
        view, model = self.robots[index], self.shown(index).model
        if view.opened.data is None:
            return []
        return where_it_fails(view.modelled(model), view.windows, view.errors(model), view.floor)

    def moments(self, index: int, group: str, regime: str) -> tuple[np.ndarray, float]:
        """(K,) s, starts of the predictions in a regime, and that of the worst."""
        return self.robots[index].moments(self.shown(index).model)[group, regime]

    def score_now(self, exact: bool = False) -> None:
        """Scores all robots where the tree stands, unless that is known."""
        tried = self.tree.current  # a hand may lead the tree elsewhere meanwhile
        if self.unjudged or not self.checked or tried.number in self.tree.scores:
            return
        known = [s for s in self._own_scores(tried.number).values() if np.isfinite(s)]
        total = total_score(known) if known else float("nan")
        of_file = self._file(tried.number)
        fitted_here = of_file.fitted_on([m.log_sha256 for m in self.measurements])
        heldout = None if fitted_here or tried.values else total
        self.tree.scores[tried.number] = Score(total, heldout, exact)

    # -- long work ------------------------------------------------------------------------------

    def work(self, kind: str, effect: str = "", options: Mapping | None = None) -> Work:
        """Task for a worker on the model where the tree stands."""
        number = self.tree.current.number
        if kind in ("next", "swarm"):
            name, text = self.tree.file_name(number), self.tree.tried[number].text
            return Work(kind, name, text, of=number, options=options, given=self.given.text)
        if kind in ("read", "diagnose", "compare"):
            return Work(kind, self.tree.file_name(number), self.tree.tried[number].text, of=number)
        names = {k.name for k in self.knobs() if k.fitted}
        held, robot_id = tuple(sorted(self.held & names)), (options or {}).get("robot_id")
        what = [effect] if effect else []
        if robot_id is not None:
            what += ["--robot", str(robot_id)]
        holds = [word for name in held for word in ("--hold", name)]
        verb = ("twin", "add") if kind == "add" else (kind,)
        words = (*verb, *what, *holds, *map(str, self.paths))
        command = self.tree.command_to_come(number, words)
        name, text = self.tree.file_name(number), self.tree.tried[number].text
        return Work(kind, name, text, command, effect, held, number, words, robot_id=robot_id)

    def take(self, done: Done) -> None:
        """Takes in what a worker did."""
        work, result = done.work, done.result
        if work.kind == "diagnose":
            self.diagnosis = {**result, "of": work.of}
        elif work.kind == "next":
            self.plan = dict(result) | {"commands": self._next_commands(work, result)}
        elif work.kind == "swarm":
            chain = self.tree.written(work.of, work.model)[0]
            commands = [*chain, *swarm_commands(work.model, work.options)]
            self.swarm = {**result, "commands": commands}
        elif work.kind == "compare":
            before = self.tree.scores.get(work.of)
            heldout = before.heldout if before else None
            self.tree.scores[work.of] = Score(result["score"], heldout, True)
        else:
            self._grow(work, result, done.text)

    def _next_commands(self, work: Work, plan: Mapping) -> list[str]:
        """That design the same run, play it and judge it; first those that make the model."""
        chain = self.tree.written(work.of, work.model)[0]
        own = shlex.join(next_command(self.paths, work.model, work.options))
        return [*chain, own, *then_commands(self.paths, work.model, plan)]

    def _grow(self, work: Work, result: Mapping, text: str) -> None:
        label = f"+ {effect_of(work.effect, work.robot_id)}" if work.effect else "fitted"
        made = self.tree.add(work.of, work.words, label, text)
        self.forget()
        self.beside = self._before(work.of)
        score = result.get("score_after")
        if score is not None:
            self.tree.scores[made.number] = Score(score, result.get("heldout_after"), True)

    # -- state ----------------------------------------------------------------------------------

    def to_json(self) -> dict:
        """State that must not be lost: models, held knobs, findings, of swarms all but poses."""
        return {
            "tree": self.tree.to_json(),
            "held": sorted(self.held),
            "diagnosis": self.diagnosis,
            "plan": self.plan,
            "swarm": without_poses(self.swarm) if self.swarm else None,
            "key": self.key,
        }

    @property
    def key(self) -> str:
        """Hash of the logs that were read, and of the model as given."""
        words = " ".join([*(log.sha256 for log in self.logs), self.given.hash])
        return hashlib.sha256(words.encode()).hexdigest()

    def restore(self, data: Mapping) -> None:
        """Restores the state from `to_json`, of equal logs and model; does nothing without data.

        Raises:
            ModelError: it is of others.
        """
        if not data:
            return
        if data.get("key") != self.key:
            raise ModelError(
                "The session that is kept there is of other logs or another model; name another "
                f"file with {option('state')}."
            )
        self.tree.restore(data["tree"])
        self.held = set(data["held"])
        self.diagnosis = data["diagnosis"]
        self.plan = data.get("plan")
        self.swarm = data.get("swarm")


def effect_of(effect: str, robot_id: int | None) -> str:
    """An effect, and whose it is."""
    return effect if robot_id is None else f"{effect} of R{robot_id:02d}"


def beside_label(effect: str, robot_id: int | None) -> str:
    """Label of the model with an effect, drawn beside."""
    return f"with {effect_of(effect, robot_id)}"


def _from_here(opened: Opened) -> Opened:
    """Log whose clock a fit looks for from where it is."""
    own = tuple(p.at(opened.model.get(p.name)) for p in opened.data.own)
    return replace(opened, data=replace(opened.data, own=own))
