# SPDX-License-Identifier: Apache-2.0
"""One model, and each robot by itself: what is missing, with probabilities."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

from twinmill.arguments import option
from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement, of_one_robot
from twinmill.data.steady_table import SteadyTable
from twinmill.defaults import Verdict
from twinmill.diagnosis.sheet import chance_of_stale, fitted_to, is_sheet
from twinmill.estimation.opened import Opened
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.not_shown import not_shown
from twinmill.fitting.opening import open_measurements
from twinmill.inference.always import always_of
from twinmill.inference.answer import RobotAnswer, answer
from twinmill.inference.curve import log_odds_of_curve
from twinmill.inference.discrepancy import SIZES
from twinmill.inference.duties import written_on
from twinmill.inference.formula import Formula, formula_of
from twinmill.inference.found_model import found_model, with_formula
from twinmill.inference.keeping import is_own
from twinmill.inference.kept import kept
from twinmill.inference.lateness import lateness
from twinmill.inference.planar import PlanarProblem, problem_of
from twinmill.inference.prior import Always
from twinmill.inference.search import Evidence, Search
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import Numbers, Table, table_of
from twinmill.inference.tables import searched
from twinmill.inference.unnamed import Unnamed, likeliest, unnamed
from twinmill.model.late import Late
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import with_role

HELD, HELD_OWN = "infer: the logs hold", "infer: the model's own logs hold"
ONE = (
    "one robot's commands and poses are judged at a time: give logs of one robot, or let each be "
    "judged by itself (tm.diagnose in Python, whose result has `robots`)"
)
APART = (
    "diagnose: these are logs and tables of steady speeds, which are judged apart; give either, "
    "then add what it shows to the model, and give the other with that model"
)
OWN_OF_TABLES = (
    "diagnose: tables of steady speeds are judged without own logs, since what a model misses "
    f"there is known of logs alone; leave {option('own')} away"
)
OWN = "give own logs of the robot that is judged, or none"


@dataclass(frozen=True)
class Inference:
    """Verdict of a robot's logs, or of tables, on a model.

    Attributes:
        answer: verdict, effects and dependences with their probabilities.
        left: curves of the dependences that are sure, or of the likeliest.
        formula: the likeliest one for the first of these; None where there is none.
        measurements: of the logs, or the tables.
        always: what the model misses in its own logs, too; None where that is not known.
        before: these logs and the model as given. The score of all three is that of `compare`: RMS
            of predictions 0.1 to 2 s ahead over the noise floor, of a table that of its readings,
            which nothing here minimises.
        refitted: with the base's posterior numbers where no effect is new.
        after: with the likeliest set of new effects and a formula that holds, and base and effects
            at the posterior that they have beside it and its unnamed dependence, which itself is in
            no model; as `refitted` without either.
        opened: these logs with the model of `refitted`.
        not_shown: effects that these logs cannot show by their kind, and why.
        strangers: sentences on own logs that are not the model's.
        late: how late the motion is in the likeliest model.
        told_here: the base was fitted to one of these logs, so that all it misses there is told.
        curved: the duty table of the last two has more nodes than that of the model as given.
        table: evidence of all hypotheses.
    """

    answer: RobotAnswer
    left: tuple[Unnamed, ...]
    formula: Formula | None
    measurements: Sequence[Measurement | SteadyTable]
    always: Always | None
    before: Comparison
    refitted: Comparison
    after: Comparison
    opened: Sequence[Opened]
    not_shown: dict[str, str]
    strangers: tuple[str, ...]
    late: Late
    told_here: bool
    curved: bool
    table: Table = field(repr=False)

    @property
    def verdict(self) -> Verdict:
        """On the motion."""
        return self.answer.verdict

    @property
    def of_tables(self) -> bool:
        """True if tables of steady speeds were judged, all their robots together."""
        return isinstance(self.measurements[0], SteadyTable)

    @property
    def finds(self) -> bool:
        """True if the model can have what was found."""
        return bool(self.answer.added) or bool(self.formula and self.formula.holds)

    @property
    def lasting(self) -> tuple[str, ...]:
        """The likeliest set of missing effects, without what is of a moment."""
        return tuple(name for name in self.answer.added if not with_role(name, "moment"))

    @property
    def holds(self) -> bool:
        """True if one of the findings is sure, or predictions are better with them."""
        sure = any(f.certainty == "sure" for f in self.answer.findings)
        return sure or self.after.score < self.refitted.score

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that a better model gets: those that last, where what was found holds."""
        return self.lasting if self.holds else ()

    def steps(self) -> list[dict[str, Any]]:
        """Scores of the model as given, of its base, and with what was found.

        The score between two effects that were found together is null.
        """
        names = [*self.answer.added, *(["equation"] if self.formula and self.formula.holds else [])]
        steps = [("refit", self.refitted.score), *((name, None) for name in names[:-1])]
        steps += [(name, self.after.score) for name in names[-1:]]
        first = {"effect": None, "score_heldout": self.before.score}
        return [first, *({"effect": e, "score_heldout": score} for e, score in steps)]

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill diagnose --json`."""
        kernels = self.always.kernels if self.always else ()
        wander = self.always.sizes_of_wander().items() if self.always else ()
        told = self.answer.to_json()
        told["rest"] |= {"curves": [one.to_json() for one in self.left], "proven": None}
        if self.formula and self.formula.holds:
            told["rest"] |= {"formula": self.formula.text, "proven": self.formula.to_json()}
        robots = {m.robot_id for m in self.measurements}
        return {
            **told,
            "robot_id": robots.pop() if len(robots) == 1 else None,
            "log": self.measurements[0].log_name,
            "logs": [*dict.fromkeys(m.log_name for m in self.measurements)],
            "always": {
                "effects": list(self.always.effects) if self.always else [],
                "depends_on": [{"name": name, "size": size} for name, size in kernels],
                "wander": {word: dict(zip(map(str, SIZES), p, strict=True)) for word, p in wander},
            },
            "score": self.before.score,
            "score_refit": self.refitted.score,
            "score_after": self.after.score,
            "not_identifiable": [{"effect": e, "why": w} for e, w in self.not_shown.items()],
            "robots_off": [],
            "late": self.late.to_json(),
            "steps": self.steps(),
            "next_experiment": None,
            "warnings": [*self.strangers, *self.before.warnings],
            "settings": {name: value for name, value, _ in PRIORS.listed()},
        }


def infer(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable] = (),
    progress: Callable[[str], None] = lambda _: None,
    *,
    without: Collection[str] = (),
    of_a_kind: bool = False,
) -> Inference:
    """Probabilities of what a model lacks, from one robot in one log or several.

    Args:
        measurements: of the logs, which are judged together.
        model_file: the model.
        own: of the logs that the model was fitted to, with that robot: what it misses there, too,
            is no news. Without them its file may tell that of other logs; a model of which no log
            told the numbers is fitted to the judged logs first.
        progress: told in words what is being done.
        without: effects that do not compete.
        of_a_kind: the model is that of several robots, whose numbers differ.

    Raises:
        LogError: these are several robots, or both logs and tables.
        ModelError: what the file keeps cannot be read.
    """
    if tables := _tables(measurements, own):
        return judge_tables(tables, model_file, progress, without=without)
    runs = of_one_robot(measurements, HELD, ONE)
    given = open_measurements(runs, model_file)
    problem, told = prepared(runs, model_file, own, progress, without=without, of_a_kind=of_a_kind)
    search = Search(problem, progress).run()
    table = table_of(search)
    found = answer(table)
    if told.base is not model_file:
        found = found.with_stale(chance_of_stale(problem, model_file, runs[0].robot_id))
    named = likeliest(search, [f.effect for f in found.findings])
    left = unnamed(search, named, problem.motion, found.sure_words) if named else ()
    written, formula = likeliest(search, found.added), None
    sure = [word for word, p in found.depends_on.items() if p >= PRIORS.sure]
    if written and sure:
        progress("formula")
        formula = formula_of(search, written, problem.motion, sure)
    progress("scores")
    late = lateness(found.numbers, problem.same_clock)
    judged = _Judged(table, found, left, formula, late, _is_curved(written))
    return _scored(judged, given, model_file, told)


def prepared(
    runs: Sequence[Measurement],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable],
    progress: Callable[[str], None],
    *,
    without: Collection[str] = (),
    of_a_kind: bool = False,
) -> tuple[PlanarProblem, "Told"]:
    """Logs of a robot, ready for inference, and what was known before; see `infer`."""
    told = _told(runs, model_file, own, progress)
    problem = problem_of(
        runs, told.base, told.always, sheet=told.here, without=without, of_a_kind=of_a_kind
    )
    return problem, told


def judge_tables(
    tables: Sequence[SteadyTable],
    model_file: ModelFile,
    progress: Callable[[str], None] = lambda _: None,
    *,
    without: Collection[str] = (),
) -> Inference:
    """Probabilities of what a model lacks, from tables of robots of its kind.

    Args:
        tables: of all robots, which are judged together.
        model_file: the model.
        progress: told in words what is being done.
        without: effects that do not compete.

    Raises:
        LogError: the model's drive is of no such table.
    """
    told = _told_by_tables(tables, model_file, progress)
    sheet = model_file if told.here else None
    search = searched(tables, told.base, sheet, progress, without=without)
    table = table_of(search)
    found = answer(table)
    if told.base is not model_file:
        found = found.with_stale(chance_of_stale(search.problem, model_file, tables[0].robot_id))
    progress("scores")
    late = lateness(found.numbers, same_clock=True)
    given = open_measurements(tables, model_file)
    judged = _Judged(table, found, (), None, late, _is_curved(likeliest(search, found.added)))
    return _scored(judged, given, model_file, told)


def _is_curved(own: Evidence | None) -> bool:
    return own is not None and log_odds_of_curve(own) > 0


def _tables(
    measurements: Sequence[Measurement | SteadyTable], own: Sequence[Measurement | SteadyTable]
) -> list[SteadyTable]:
    """The tables, if there are no logs; none if there are no tables."""
    tables = [m for m in measurements if isinstance(m, SteadyTable)]
    if tables and len(tables) < len(measurements):
        raise LogError(f"{APART}.")
    if tables and own:
        raise LogError(f"{OWN_OF_TABLES}.")
    return tables


def _told_by_tables(
    tables: Sequence[SteadyTable], model_file: ModelFile, progress: Callable[[str], None]
) -> "Told":
    if is_sheet(model_file):
        progress("fitting the base")
        return Told(fitted_to(tables, model_file), None, True, ())
    other = model_file.known_from_other_logs([t.log_sha256 for t in tables])
    return Told(model_file, None, not other, ())


@dataclass(frozen=True)
class Told:
    """Knowledge before logs are judged.

    Attributes:
        base: model that effects are compared beside: as given, or fitted to these logs.
        always: what it misses in other logs.
        here: these logs alone told the base's numbers.
        strangers: sentences on own logs that are not the model's.
    """

    base: ModelFile
    always: Always | None
    here: bool
    strangers: tuple[str, ...]


def _told(
    runs: Sequence[Measurement],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable],
    progress: Callable[[str], None],
) -> Told:
    if own:
        progress("what the model misses in its own log")
        robot = runs[0].track.robot_id
        always = always_of(of_one_robot(own, HELD_OWN, OWN, robot), model_file)
        return Told(model_file, always, is_own(runs, model_file), strangers(own, model_file))
    if is_sheet(model_file):
        progress("fitting the base")
        return Told(fitted_to(runs, model_file), None, True, ())
    here = is_own(runs, model_file)
    return Told(model_file, None if here else kept(model_file), here, ())


@dataclass(frozen=True)
class _Judged:
    """Answer before any score: evidence, what has no name, its formula, lateness, its table."""

    table: Table
    answer: RobotAnswer
    left: tuple[Unnamed, ...]
    formula: Formula | None
    late: Late
    curved: bool


def _scored(
    judged: _Judged, given: Sequence[Opened], model_file: ModelFile, told: Told
) -> Inference:
    found, formula = judged.answer, judged.formula
    several = len({o.measurement.robot_id for o in given}) > 1
    common = written_on(model_file, judged.curved)
    if not several:
        common = given[0].with_model(common).model
    there = told.always.effects if told.always else ()

    def under(
        numbers: Numbers, effects: Sequence[str], beside: Formula | None = None
    ) -> list[Opened]:
        own = found_model(common, numbers, effects)
        model = (with_formula(own, beside) if beside else own).model
        return [o.aligned(model) for o in given]

    base = under(found.refit, there)
    holds = formula if formula and formula.holds else None
    after = under(found.numbers, (*there, *found.added), holds) if found.added or holds else base
    return Inference(
        found,
        judged.left,
        formula,
        [o.measurement for o in given],
        told.always,
        before=comparison(model_file, given),
        refitted=comparison(model_file, base),
        after=comparison(model_file, after),
        opened=base,
        not_shown=not_shown(given),
        strangers=told.strangers,
        late=judged.late,
        told_here=told.here,
        curved=judged.curved,
        table=judged.table,
    )


def strangers(own: Sequence[Measurement | SteadyTable], model_file: ModelFile) -> tuple[str, ...]:
    """Sentences on own logs to which the model was not fitted, as its file knows; one at most."""
    hashes = [m.log_sha256 for m in own]
    if not own or not model_file.known_from_other_logs(hashes):
        return ()
    names = ", ".join(dict.fromkeys(m.log_name for m in own))
    fitted = ", ".join(model_file.fit.get("logs", [])) or "others"
    return (
        f"{names}: {model_file.path.name} was fitted to {fitted}, not to this; if robot and clocks "
        f"are not the same, what differs between them is told as new. Give {option('own')} the log "
        "that the model was fitted to.",
    )


def infer_robots(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable] = (),
    progress: Callable[[str], None] = lambda _: None,
    *,
    without: Collection[str] = (),
) -> list[Inference]:
    """`infer` for each robot of the logs by itself, in the order of their numbers.

    All robots of tables are judged together, so that there is one answer.

    Args:
        measurements: of the logs.
        model_file: the model of all of them.
        own: of the logs that it was fitted to, with one of the robots at least; what it misses of
            a robot that is not among these is not known.
        progress: told in words what is being done.
        without: effects that do not compete.

    Raises:
        LogError: these are both logs and tables.
        ModelError: what the file keeps cannot be read.
    """
    if tables := _tables(measurements, own):
        return [judge_tables(tables, model_file, progress, without=without)]
    robots, known = _robots(measurements), _robots(own)

    def judged(k: int, robot: int) -> Inference:
        of = f"R{robot:02d} ({k + 1} of {len(robots)}), " if len(robots) > 1 else ""
        runs = of_one_robot(measurements, HELD, ONE, robot)
        strange = robot not in known and set(known) & set(robots)
        return infer(
            runs,
            model_file,
            () if strange else own,
            lambda said: progress(of + said),
            without=without,
            of_a_kind=len(robots) > 1,
        )

    return [judged(k, robot) for k, robot in enumerate(robots)]


def _robots(measurements: Sequence[Measurement | SteadyTable]) -> list[int]:
    return sorted({m.track.robot_id for m in measurements if isinstance(m, Measurement)})
