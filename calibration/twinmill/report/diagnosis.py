# SPDX-License-Identifier: Apache-2.0
"""A diagnosis as tables, for the terminal and as a section of a report."""

from collections.abc import Sequence
from dataclasses import replace
from math import isnan

import twinmill_native as native
from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.data.checks.settings import CHECKS
from twinmill.diagnosis.explain import Explanation
from twinmill.diagnosis.moments import did
from twinmill.diagnosis.outliers import Outlier, in_words
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT, REFIT_IN_WORDS
from twinmill.fitting.not_shown import robot_of
from twinmill.fitting.settings import FLOOR_SETTINGS
from twinmill.listing import listed
from twinmill.model.parameters import ParameterEstimate, catalogue
from twinmill.report import Figure, Section, comparisons, detections, formula, show, tables
from twinmill.report.charted import charts
from twinmill.report.error_figures import waterfall
from twinmill.report.sections import robot_pictures
from twinmill.report.tables import VERDICTS, Cell, Table, Tone, number, rounded, tone

TOO_FEW = (
    f"Among fewer than {SETTINGS.fewest_robots} robots none can be called the outlier, and an "
    "effect of one is searched in all: where their scores differ (twinmill compare), give each a "
    "log of its own."
)

NOTHING_GAINED = (
    "No refit improves the held-out error significantly: the new file has the parameters of the "
    "model as given."
)

Steps = Sequence[tuple[str | None, float]]  # what came into the model, and the score then


def findings(diagnosis: Diagnosis) -> Table:
    """Findings, most important first, and the unexplained error."""
    rows = []
    for f in diagnosis.findings:
        names = f" or {' or '.join(f.group[1:])}" if f.group else ""
        certainty: Tone = "good" if f.certainty == "sure" else "warn"
        rows.append(
            [
                Cell(f"{_named(f.effect)}{names}", "good"),
                Cell(f.takes, "", f.share),
                Cell(f.certainty, certainty),
                Cell(estimates(f.parameters)),
            ]
        )
    if rows:
        rest = diagnosis.rest
        most, other = ("most likely ", " or ") if rest.likely else ("", ", ")
        on = f"depends {most}on {other.join(rest.depends_on)}" if rest.depends_on else ""
        rows.append(
            [
                Cell("unexplained", "dim"),
                Cell(f"{100 * rest.share:.0f} %", "dim", rest.share),
                Cell(
                    diagnosis.rest_certainty if diagnosis.is_left else "no more than noise", "dim"
                ),
                Cell(on if diagnosis.is_left else "", "dim"),
            ]
        )
    return Table(
        "What was found",
        ["effect", "share of error", "certainty", "estimates"],
        rows,
        "Share: of the squared error above the noise floor, on held-out data, that the effect "
        "removes once those above it are in the model; with the unexplained part they add up to "
        "100 %. Estimates: ± one standard error; a 95 % interval is about twice that to each side.",
        words=(0, 2, 3),
        lists=(3,),
    )


def ranking(diagnosis: Diagnosis) -> Table:
    """Table of all effects that were tried, best first, with scores and estimates."""
    rows = []
    for r in diagnosis.ranking:
        found = diagnosis.finding(r.effect)
        rows.append(
            [
                Cell(_named(r.effect), "good" if found else "dim"),
                Cell(number(r.score_heldout), tone(r.score_heldout)),
                Cell(f"{r.p_value:.3f}"),
                Cell("" if r.group is None else str(r.group)),
                Cell(estimates((found or r).parameters)),
            ]
        )
    return Table(
        "Effects that were tried",
        ["effect", "held-out\nscore", "p", "group", "estimates"],
        rows,
        "Found effects are coloured. The search adds one effect per step. Score and the estimates "
        "of effects that were not found are of the step that tried them, with all that was found "
        "before; p: probability of such a gain if nothing were missing, corrected for the number "
        "of effects; effects with the same group number cannot be distinguished in this log.",
        words=(0, 4),
        lists=(4,),
    )


def unseen(diagnosis: Diagnosis) -> Table:
    """Effects that are not identifiable in these logs."""
    rows = [[Cell(effect), Cell(why)] for effect, why in diagnosis.not_identifiable]
    return Table("What this log cannot show", ["effect", "why"], rows, words=(0, 1))


def each_robot(diagnosis: Diagnosis) -> Table:
    """Each robot's deviation, and the smallest that its logs would have shown."""
    off = {o.robot_id: _said_of(o.sentence) for o in diagnosis.robots_off}
    count = len(diagnosis.robots)
    too_few = 1 < count < SETTINGS.fewest_robots and not off
    of_few = _alone(diagnosis) if count == 1 else "not compared" if too_few else "as the model"
    adequate = diagnosis.verdict == "model_adequate"
    usual = of_few if count < SETTINGS.fewest_robots else "as the model" if adequate else "as all"
    if diagnosis.apart and diagnosis.apart.whose == "robots":
        usual = "of its own numbers"
    rows = [
        [
            Cell(f"R{r.robot_id:02d}", "bad" if r.robot_id in off else ""),
            Cell(off.get(r.robot_id, usual)),
            *(Cell("-" if d is None else f"{100 * d:.1f} %") for d in (r.speed, r.turn)),
        ]
        for r in diagnosis.robots
    ]
    return Table(
        "Each robot",
        ["robot", "it is", "detectable\nin speed", "in turning"],
        rows,
        "Detectable: smallest deviation of all its speeds, or turn rates, from the model that "
        "would have been significant. Smaller ones are possible, and those at some commands only."
        + (f" {TOO_FEW}" if too_few else ""),
        words=(1,),
    )


def _would_show(diagnosis: Diagnosis) -> list[str]:
    """Smallest significant deviation in these logs, over all robots; nothing if unknown."""
    told = []
    of_which = {
        "speed": "speed",
        "turn": "turning",
        "ahead": "speed ahead alone",
        "sideways": "speed sideways alone",
    }
    for key, name in of_which.items():
        known = [100 * d for r in diagnosis.robots if (d := getattr(r, key)) is not None]
        if known:
            ends = dict.fromkeys(f"{of(known):.1f}" for of in (min, max))
            told.append(f"{' to '.join(ends)} % in {name}")
    if not told:
        return []
    shown = listed(told)
    return [f"These logs would have shown a difference of {shown}; a smaller one may be there."]


def _alone(diagnosis: Diagnosis) -> str:
    """Findings beyond doubt about the only robot, in words."""
    if diagnosis.verdict == "model_adequate":
        return "as the model"
    told = [f for f in diagnosis.findings if f.effect in catalogue() and f.certainty != "doubtful"]
    others = [f" or {' or '.join(f.group[1:])}" if f.group else "" for f in told]
    words = [in_words(f.parameters) + other for f, other in zip(told, others, strict=True)]
    return "; ".join(words) or "the only one, so not compared"


def _said_of(sentence: str) -> str:
    """Sentence on a robot, without its name before and the full stop behind."""
    return (sentence.partition(": ")[2] or sentence).rstrip(".")


def robots_off(diagnosis: Diagnosis) -> Table:
    """Robots that differ from the others."""
    rows = [
        [
            Cell(off.label, "bad"),
            Cell(off.effect or "not in the catalogue"),
            Cell(number(off.score_before), tone(off.score_before)),
            Cell(number(off.score_after), tone(off.score_after)),
            Cell(f"{off.p_value:.1g}"),
            Cell(estimates(off.parameters)),
        ]
        for off in diagnosis.robots_off
    ]
    return Table(
        "Robots that differ from the others",
        ["robot", "effect", "score,\nshared", "score,\nown", "p", "estimates"],
        rows,
        "Held-out scores with the model shared by all robots, and with the robot's own parameters. "
        "The search for effects that all have left these robots out.",
        words=(1, 5),
        lists=(5,),
    )


def moments(diagnosis: Diagnosis) -> Table:
    """Transient events that neither commands nor findings explain."""
    rows = [
        [
            Cell(f"{m.log} R{m.robot_id:02d}"),
            Cell(f"{m.t_s:.1f}"),
            Cell("-" if isnan(m.way) else f"{m.way:.2f}"),
            Cell(did(m.what, m.way).removeprefix("it ")),
        ]
        for m in diagnosis.rest.moments
    ]
    return Table(
        "Transient events",
        ["log", "begins\ns", "distance\ndriven", "the robot"],
        rows,
        "Times at which a robot deviated from its prediction. Distance driven: over the predicted "
        "distance, in the half second with the largest deviation: 1 is all of it, less than 0 is "
        "backwards.",
        words=(0, 3),
    )


def lines(diagnosis: Diagnosis) -> list[str]:
    """Sentences on what the tables do not contain."""
    told = [*diagnosis.notes, *formula.sentences(diagnosis.rest)]
    if diagnosis.late and (late := _late(diagnosis)):
        told.append(late)
    return told


def next_run(diagnosis: Diagnosis) -> str:
    """Purpose of another run, in one sentence; empty if the logs leave nothing open."""
    return f"{diagnosis.next_experiment['why']}." if diagnosis.next_experiment else ""


def _late(diagnosis: Diagnosis) -> str:
    """The robot's response time, where that was a finding."""
    late = diagnosis.late
    if late is None or late.sum_std_s is None:
        return ""
    whose = " on average, each with its own" if late.spread_s else " in total"
    total = f"{rounded(late.sum_s, late.sum_std_s)} ± {late.sum_std_s:.1g} s{whose}"
    if late.parted:
        return f"Response time {total}: {late.lag_s:.2f} s lag, {late.delay_s:.2f} s delay."
    if late.lag_s is not None:
        rest_s = round(late.sum_s - late.lag_s, 2) + 0.0  # no minus before nothing
        return (
            f"Response time {total}: {late.lag_s:.2f} s lag; {rest_s:.2f} s delay or clock offset."
        )
    return f"Response time {total}: these logs cannot separate lag and delay."


def terminal(diagnosis: Diagnosis, commands: show.Commands = ()) -> RenderableType:
    """Text of a diagnosis, with the commands that follow."""
    return Group(*_said(diagnosis), *_next(diagnosis, commands))


def _said(diagnosis: Diagnosis) -> list[RenderableType]:
    parts: list[RenderableType] = [
        Text(diagnosis.sentence, show.STYLES[_tone_of(diagnosis)]),
        Text(
            f"score {number(diagnosis.before.score)} as given, "
            f"{number(diagnosis.score_refit)} after a refit of the base{_each(diagnosis)} "
            f"(on held-out data{_without(diagnosis)})"
        ),
        Text(),
    ]
    parts += [show.table(t) for t in (*_tables(diagnosis), *_detection_steps(diagnosis))]
    told = [Text(line) for line in lines(diagnosis)]
    return [*parts, *told, *show.warned(diagnosis.before.warnings)]


def _tone_of(diagnosis: Diagnosis) -> Tone:
    return "bad" if diagnosis.robots_off or diagnosis.runs_off else VERDICTS[diagnosis.verdict]


def _each(diagnosis: Diagnosis) -> str:
    """That each has numbers of its own, where they differ."""
    own = diagnosis.apart
    return f" with numbers of its own for each {own.whose[:-1]}" if own else ""


def _without(diagnosis: Diagnosis) -> str:
    """The robots that the search did not see: those that move otherwise than the rest."""
    gone = [off.label for off in diagnosis.robots_off if off.models]
    return f", without {', '.join(gone)}" if gone else ""


def _next(diagnosis: Diagnosis, commands: show.Commands) -> list[Text]:
    step = next_run(diagnosis)
    told = [Text(f"Next run: {step}")] if step else []
    return told + show.typed_next(commands)


def terminal_explanation(
    result: Explanation, commands: show.Commands = (), not_written: str = ""
) -> RenderableType:
    """Text of the whole loop, with the commands that follow.

    Args:
        result: the model and its diagnosis.
        commands: to type next, each with its purpose.
        not_written: said in place of where the model was written.
    """
    return Group(
        *([Text(result.now, show.STYLES["good"]), Text("Without it:")] if result.now else []),
        *_said(_as_fitted(result)),
        Text(),
        show.table(tables.steps(_labelled(result.steps, bool(result.diagnosis.apart)))),
        *([show.table(tables.parameters(result.parameters))] if result.parameters else []),
        *(Text(line) for line in formula.taken(result.formula)),
        *([Text(result.left_out)] if result.left_out else []),
        *([Text(NOTHING_GAINED)] if not result.gained else []),
        Text(not_written or f"Written: {result.path}"),
        *_next(result.diagnosis, commands),
    )


def _as_fitted(result: Explanation) -> Diagnosis:
    """The diagnosis with the estimates of the last fit, so that each has one standard error."""
    last = {e.name: e for e in result.parameters}
    findings = [
        replace(f, parameters=[last.get(e.name, e) for e in f.parameters])
        for f in result.diagnosis.findings
    ]
    return replace(result.diagnosis, findings=findings)


def section(
    diagnosis: Diagnosis, commands: show.Commands = (), steps: Steps | None = None
) -> Section:
    """The page of a diagnosis: verdict, figures, tables and the commands that follow.

    Args:
        diagnosis: the result.
        commands: what to type then, each with why.
        steps: scores after each step; None: those of the diagnosis.
    """
    before, steps = diagnosis.before, steps or diagnosis.steps
    refitted = f"base refitted{_each(diagnosis)}, held out"
    scores = [("as given", before.score), (refitted, diagnosis.score_refit)]
    if len(steps) > 1:
        scores.append(("with all that was found, held out", steps[-1][1]))
    if len(diagnosis.detection_steps) > 1:
        scores += [
            ("detections", diagnosis.detection_steps[0][1]),
            ("detections, found", diagnosis.detection_steps[-1][1]),
        ]
    return Section(
        f"What {before.model_name} lacks",
        [(label, number(value), tone(value)) for label, value in scores],
        "\n".join(diagnosis.lines),
        comparisons.facts(before),
        [
            *_detection_figures(diagnosis),
            *_gains(steps, bool(diagnosis.apart)),
            *formula.figures(diagnosis.rest),
            *robot_pictures(before),
        ],
        [*_tables(diagnosis), *_detection_steps(diagnosis), *_detection_tables(diagnosis)],
        charts=charts(before, found_models(diagnosis)),
        next_step=next_run(diagnosis),
        commands=[(f"{why}:", command) for why, command in commands],
        notes=[*_would_show(diagnosis), *lines(diagnosis)],
        warnings=before.warnings,
        folded=[deciding(diagnosis)],
    )


def explanation_section(
    result: Explanation, commands: show.Commands = (), not_written: str = ""
) -> Section:
    """The page of the whole loop: that of its diagnosis, and what was fitted and written then."""
    page = section(_as_fitted(result), commands, result.steps)
    return replace(
        page,
        verdict="\n".join([*([f"{result.now} Without it:"] if result.now else []), page.verdict]),
        tables=[*page.tables, tables.parameters(result.parameters)],
        notes=[
            *page.notes,
            *formula.taken(result.formula),
            *([result.left_out] if result.left_out else []),
            *([NOTHING_GAINED] if not result.gained else []),
            not_written or f"Written: `{result.path}`",
        ],
    )


def deciding(diagnosis: Diagnosis) -> Table:
    """Thresholds of search, noise floor and input checks, each with its meaning."""
    numbers = [
        *diagnosis.search.settings.listed(),
        *FLOOR_SETTINGS.listed(),
        *CHECKS.listed(),
    ]
    rows = [[Cell(name), Cell(f"{value:g}"), Cell(what)] for name, value, what in numbers]
    note = "Scores are relative to the noise floor: 1.0 is right. Costs are -2 log-likelihoods."
    return Table("Thresholds", ["name", "value", "meaning"], rows, note, words=(0, 2))


def found_models(diagnosis: Diagnosis) -> list[tuple[str, native.Model] | None]:
    """Each robot's model with what was found, and its name; None where that is as given.

    A robot that differs has its own effect as well.
    """
    name = " and ".join(diagnosis.motion) or "its base refitted"
    common = f"with {name}" if diagnosis.findings else ""
    off = {
        r.robot_id: (_with_own(common, r), iter(r.models)) for r in diagnosis.robots_off if r.models
    }
    beside = []
    for own in diagnosis.opened:
        label, models = off.get(robot_of(own), (common, iter(())))
        model = next(models, own.model) if own.floor else own.model
        beside.append((label, model) if label else None)
    return beside


def _with_own(common: str, robot: Outlier) -> str:
    if robot.effect is None:
        return common
    name = "gains" if robot.by_gains else robot.effect
    return f"{common} and its own {name}" if common else f"with its own {name}"


def _tables(diagnosis: Diagnosis) -> list[Table]:
    made = (
        findings(diagnosis),
        each_robot(diagnosis),
        robots_off(diagnosis),
        moments(diagnosis),
        ranking(diagnosis),
        unseen(diagnosis),
    )
    return [t for t in made if t.rows]


def _detection_steps(diagnosis: Diagnosis) -> list[Table]:
    return (
        [detections.steps(diagnosis.detection_steps)] if len(diagnosis.detection_steps) > 1 else []
    )


def _detection_tables(diagnosis: Diagnosis) -> list[Table]:
    """Predicted and measured detections, with the effects that were found if there are any."""
    found = diagnosis.detections_after or diagnosis.detections
    return detections.confusion_tables(found) if found else []


def _detection_figures(diagnosis: Diagnosis) -> list[Figure]:
    """Figures of the camera's bits, with the model as given and with the findings."""
    if not diagnosis.detections:
        return []
    after = diagnosis.detections_after
    found = (
        [detections.field_of_view(after, "What the camera sees, effects added")] if after else []
    )
    return [detections.field_of_view(diagnosis.detections), *found]


def _gains(steps: Steps, own: bool) -> list[Figure]:
    """The score after each step, as a figure; nothing where there is none."""
    labelled = _labelled(steps, own)
    return [waterfall(labelled)] if len(labelled) > 1 else []


def _labelled(steps: Steps, own: bool) -> list[tuple[str, float]]:
    """Steps of the waterfall; `own`: from the first on each robot or run has its own numbers."""
    names = {None: "own numbers, held out" if own else "as given, held out", REFIT: REFIT_IN_WORDS}
    return [(names.get(effect, f"+ {effect}"), score) for effect, score in steps]


def _named(effect: str) -> str:
    """Name of an effect as in the sentence of the verdict."""
    return REFIT_IN_WORDS if effect == REFIT else effect


def estimates(parameters: Sequence[ParameterEstimate]) -> str:
    """Names, values and standard errors, in a line."""
    return ", ".join(map(tables.estimate, parameters))
