# SPDX-License-Identifier: Apache-2.0
"""Names what a model lacks, says so when nothing is missing, and when the data cannot tell."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement, unsteady
from twinmill.data.steady_table import SteadyTable
from twinmill.diagnosis import moments
from twinmill.diagnosis.apart import apart, runs_with_own, tells_more
from twinmill.diagnosis.cameras import with_detections
from twinmill.diagnosis.doubts import (
    acted_on,
    at_bounds,
    beside_more,
    beside_stale,
    of_another_form,
    of_many,
    of_no_right_model,
    undetermined,
    undone,
    within_the_table,
)
from twinmill.diagnosis.finding import Finding, doubted, of_all, part_of_all
from twinmill.diagnosis.findings import (
    beside_the_base,
    findings_of,
    lateness,
    ranking_of,
    slight_lags,
    steps_of,
    with_stale_numbers,
)
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.notes import (
    answers_notes,
    disturbed_notes,
    few_commands_notes,
    geometry_notes,
    heading_notes,
    held_notes,
    irregularity_notes,
    is_random,
    lag_notes,
    marker_notes,
    missed_notes,
    random_in_words,
    scatters_of,
    time_base_notes,
)
from twinmill.diagnosis.outliers import (
    Outlier,
    odd_of_two,
    odd_runs,
    one_by_one,
    outliers,
    spread_of_lags_s,
)
from twinmill.diagnosis.resolution import resolutions
from twinmill.diagnosis.rest import Doubted, Rest, formulas_of, rest_of
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.rivals import less_each
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.search import search
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.stopped import Course
from twinmill.diagnosis.taking import doubtful_moments, needless, taken, tuned
from twinmill.diagnosis.ties import instead_of_drift
from twinmill.diagnosis.trials import (
    REFIT,
    State,
    Trial,
    begun_nearer,
    cross_validate,
    on_base_of,
    with_base,
    without_effect,
)
from twinmill.diagnosis.verdict import VerdictInputs, drifted
from twinmill.fitting.compare import GOOD, Comparison, comparison, of_others
from twinmill.fitting.fit import base_names, effects_free
from twinmill.fitting.not_shown import CANNOT, not_shown, robot_of
from twinmill.fitting.opening import (
    Opened,
    judged,
    lateness_changes,
    open_measurements,
    thinned,
    untold_parts,
    with_own_gains,
    with_own_lags,
)
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    BASE_GAINS,
    LAG,
    base_parameters,
    catalogue,
    catalogue_of,
    is_local,
    making_late,
    needing,
)
from twinmill.predict.datasets import thinning

CHANGING = (
    "how late the robot follows its commands changes within the log, so that no lag and no delay "
    "holds for all of it; look at what sent the commands, and log again"
)
ANSWERED = "the commands answer how the robot strayed, and noise may look like it then"


def diagnose(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    progress: Callable[[str], None] = lambda _: None,
    excluded: Collection[str] = (),
    *,
    stoppable: bool = False,
) -> Diagnosis:
    """Diagnoses all measurements with one model.

    Args:
        measurements: one robot, or several of a kind.
        model_file: the model; what other logs told of it is held, its gains may drift.
        progress: told in words what is being done.
        excluded: effects that are not to be thought of.
        stoppable: Ctrl-C ends it, and what was found until then is told; if nothing was tried yet
            there is nothing to tell, and KeyboardInterrupt goes on.

    Raises:
        LogError: no measurement can be judged.
    """
    course = Course()
    try:
        return _diagnosed(measurements, model_file, progress, excluded, course=course)
    except KeyboardInterrupt:
        told = course.told() if stoppable else None
        if told is None:
            raise
        return told


def _diagnosed(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    progress: Callable[[str], None],
    excluded: Collection[str],
    *,
    course: Course,
) -> Diagnosis:
    """Runs the diagnosis and writes its progress down in its course."""
    progress("finding the noise floor")
    opened = open_measurements(measurements, model_file)
    before = comparison(model_file, opened)
    unseen = not_shown(opened) | _changing(opened, model_file)
    course.opened, course.before, course.unseen = opened, before, unseen
    known = thinned_to_search(with_own_gains(judged(opened)))

    def look(at: Sequence[Opened], doing: str = "") -> tuple[Sequence[Opened], State, Search]:
        if doing:
            progress(doing)
        first = first_state(at, model_file, {*excluded, *unseen})
        done = search(first, progress, known=usual, begun=course.searches.append)
        course.searches.append(done)
        return at, first, done

    first = first_state(known, model_file, {*excluded, *unseen})
    usual = model_file.usual_score([o.measurement.log_sha256 for o in known])
    off = odd_of_two(known, first, GOOD * usual, progress)
    if off:
        known = thinned_to_search(_without(judged(opened), off))
        first = first_state(known, model_file, {*excluded, *unseen})
    odd = odd_runs(known, first, GOOD * usual, progress)
    runs_off = [] if all(r.by_own_numbers for r in odd) else odd
    course.off = off
    known, first, done = look(_without_runs(known, runs_off))
    lags_s = 0.0
    runs = [] if off else runs_with_own(known, first, done.last, usual)
    if runs:
        own = look(runs, "looking again, each run with its numbers")
        if tells_more(own[-1].last, done.last):
            known, first, done = own
        else:
            runs = []
            course.searches.append(done)
    if odd and not (runs_off or runs):
        runs_off = odd
        known, first, done = look(_without_runs(known, odd), "looking again without odd runs")
    if not (off or runs):
        progress("looking for robots that differ")
        alone = one_by_one(known, done, progress)
        course.off = off = outliers(alone)
        gone = {r.robot_id for r in off}
        lags_s = spread_of_lags_s([a for a in alone if a.robot_id not in gone])
        if off or lags_s:
            known = _without(known, off)
            known = with_own_lags(known, lags_s) if lags_s else known
            again = "looking again without them" if off else "looking again, each with its lag"
            known, first, done = look(known, again)
    progress("looking for what no effect explains")
    course.motion = _concluded(
        opened,
        known=known,
        first=first,
        done=done,
        model_file=model_file,
        before=before,
        unseen=unseen,
        off=off,
        runs_off=runs_off,
        lags_s=lags_s,
    )
    return _robots_first(with_detections(course.motion, model_file, progress, excluded))


def _robots_first(diagnosis: Diagnosis) -> Diagnosis:
    """With robots or runs that differ at the head of the sentence; the rest is on the others."""
    off = {r.robot_id: r.sentence for r in diagnosis.robots_off}
    left = len(diagnosis.robots) - len(off)
    if diagnosis.runs_off:
        off = {r.log_sha256: r.sentence for r in diagnosis.runs_off}
        left = len(diagnosis.opened) - len(off)
    if not off:
        return diagnosis
    return replace(
        diagnosis, sentence=" ".join([*off.values(), of_others(left, diagnosis.sentence)])
    )


def _as_given(before: Comparison, opened: Sequence[Opened], known: Sequence[Opened]) -> float:
    """Score of the model as given, of the measurements that the search saw."""
    seen = {id(o.measurement) for o in known}
    pairs = zip(before.robots, opened, strict=True)
    return replace(before, robots=[r for r, o in pairs if id(o.measurement) in seen]).score


def _without(opened: Sequence[Opened], off: Sequence[Outlier]) -> list[Opened]:
    gone = {r.robot_id for r in off}
    return [o for o in opened if robot_of(o) not in gone]


def _without_runs(opened: Sequence[Opened], off: Sequence[Outlier]) -> list[Opened]:
    gone = {r.log_sha256 for r in off}
    return [o for o in opened if o.measurement.log_sha256 not in gone]


def first_state(
    opened: Sequence[Opened], model_file: ModelFile, excluded: Collection[str]
) -> State:
    """Where the search starts: the model as given, and what is free in it without being a finding.

    The base of a model that other logs told is held, but for gains that drift with battery and
    heat, and for speeds at duties that those logs hardly had. A base that was fitted to these very
    logs moves with whatever is added. The numbers of a data sheet are a candidate like any effect:
    `refit`.
    """
    model = model_file.model
    hashes = [o.measurement.log_sha256 for o in opened]
    told = model_file.known_from_other_logs(hashes)
    owned = {p.name for o in opened for p in o.data.own}
    names = [n for n in base_names(model, opened, told) if n not in owned]
    free = []
    if told and model.drive == "duty":
        gains = [n for n in BASE_GAINS if n in names]
        free = [replace(p, std=SETTINGS.drift_std) for p in base_parameters(opened[0].model, gains)]
        unsure = model_file.unsure_speeds()
        speeds = base_parameters(opened[0].model, unsure)
        free += [replace(p, std=min(p.std, unsure[p.name])) for p in speeds]
    elif model_file.fitted_on(hashes):
        free = base_parameters(opened[0].model, names) + effects_free(opened[0].model, opened)
    base = tuple(n for n in names if n != LAG and n not in {p.name for p in free})
    excluded = {*excluded, *_by_clocks(opened)}
    return State(
        [o.data for o in opened],
        [o.model for o in opened],
        tuple(free),
        base,
        frozenset(excluded),
        told_speeds=bool(told) and model.drive == "duty",
    )


def _by_clocks(opened: Sequence[Opened]) -> set[str]:
    """Effects that the clocks make meaningless: offsets are fitted, or known to be none."""
    logs = [o for o in opened if o.floor]
    if any(not o.same_clock for o in logs):
        return {*needing("clocks"), *making_late("delay")}
    return set(making_late("clock")) if any(o.one_clock for o in logs) else set()


def _changing(opened: Sequence[Opened], model_file: ModelFile) -> dict[str, str]:
    """Effects that make late, where logs tell no lateness since it changes within all of them."""
    known = [o for o in opened if o.data is not None]
    told = model_file.known_from_other_logs([o.measurement.log_sha256 for o in known])
    return {name: CHANGING for part in untold_parts(known, told) for name in making_late(part)}


def _concluded(
    opened: Sequence[Opened],
    *,
    known: Sequence[Opened],
    first: State,
    done: Search,
    model_file: ModelFile,
    before: Comparison,
    unseen: dict[str, str],
    off: Sequence[Outlier],
    runs_off: Sequence[Outlier],
    lags_s: float,
) -> Diagnosis:
    """Diagnosis from the search of the motion, before cameras are looked at."""
    hashes = [o.measurement.log_sha256 for o in known]
    without = less_each(done, known)
    less, formulas = without.less, without.formulas
    start, last = done.rounds[0].before, done.last
    given = _as_given(before, opened, known)
    findings, chain = findings_of(done, less)
    findings = with_stale_numbers(
        findings,
        last.state.model,
        lag_std_s=model_file.lag_std_s(hashes),
        clock_std_s=model_file.clock_std_s(hashes),
        stds=model_file.effect_stds,
        slight=slight_lags(done, first, given),
    )
    if first.told_speeds:
        findings = within_the_table(findings, less, last)
    few = few_commands_notes(known)
    if few:
        findings = beside_stale(findings)
    findings = at_bounds(without.doubted(undone(undetermined(findings), last), last))
    in_doubt = _doubted(findings, less, known)
    whole = [_with_all_starts(o, opened) for o in known]
    models = zip(whole, last.state.models, strict=True)
    fitted = {id(o.measurement): o.with_fitted(m) for o, m in models}
    after = [fitted.get(id(o.measurement), o) for o in opened]
    modelled = [r.modelled.fitted(o.model) for r, o in zip(before.robots, after, strict=True)]
    scatters = scatters_of(after, [s.noise and s.noise_at_speed for s in modelled], model_file)
    random = is_random(scatters, last.held_score)
    rest = rest_of(
        formulas,
        last.fit,
        start.fit,
        known=model_file.left_over(hashes),
        whole=whole,
        random=random,
        without=in_doubt,
    )
    answers = answers_notes(known)
    if answers and last.held_score <= SETTINGS.answered:
        rest = rest.as_answers()
    if answers and start.held_score <= SETTINGS.answered:
        findings = [f if f.effect == REFIT else doubted(f, ANSWERED) for f in findings]
    if rest.proven and rest.proven.is_late:
        late = [f.effect for f in findings if f.effect in needing("changes")]
        instead = None if rest.proven.instead_of else _lacking(late, less, known)
        better = (instead and instead.formula(last.fit)) or rest.proven
        rest = replace(rest, proven=tuned(last.fit, better))
    base = tuple(base_names(first.model, known, model_file.known_from_other_logs(hashes)))
    rest = rest.at_few_commands() if few else rest
    findings = _beside_formula(findings, last, rest, len(set(hashes)))
    cards = catalogue_of(last.state.model)
    findings = of_many(beside_more(of_another_form(findings, rest), rest, cards))
    findings = of_no_right_model(findings, rest, last.held_score)
    if rest.proven and _gains_nothing(rest.proven, findings, with_base(last, base)[0], start.fit):
        rest = replace(rest, proven=None)
    findings.sort(key=lambda f: -f.share)  # where no order of the chain has falling shares
    steps = [(None, start.held_score), *steps_of(findings, chain, done.start, last)]
    findings = beside_the_base(findings, first.model, told=model_file.lag_std_s(hashes) > 0)
    rest = rest.with_findings(findings)
    usual = model_file.usual_score(hashes)
    events = rest.moments or rest.events.later
    news = findings or events or rest.proven or SETTINGS.common * last.held_score > usual
    rest = rest if news else rest.as_before()
    unsure = all(f.certainty == "doubtful" for f in findings if f.effect != REFIT)
    if rest.firm and unsure and not rest.depends_on:
        rest = rest.most_likely(acted_on(findings, 0.0))
    disturbed = [] if events else disturbed_notes(after)
    noise = irregularity_notes(after, scatters)
    named = {name for f in findings for name in (f.effect, *(f.group or ()))}
    faint = [(name, why) for name, why in done.faint if name not in named]
    faint_names = [name for name, _ in faint]
    of_base = [(name, why) for name, why in done.in_the_base if name not in named]
    hidden = [*faint, *of_base, *unseen.items()]
    refit = _refit(done, findings)
    own = apart(known, last, before)
    weighed = VerdictInputs(
        given,
        start.held_score,
        refit,
        last.held_score,
        findings,
        rest,
        faint_names,
        _instead_of_drift(given, done, first, usual),
        noise,
        usual,
        disturbed,
        random,
        () if rest.events.later else unsteady([o.measurement for o in known]),
        own,
        _drift(given, first, done.start, last),
        random_in_words(scatters, [r.noise for r in modelled], model_file.model) if random else "",
    )
    if weighed.verdict == "outside_catalogue":
        rest = rest.with_first(acted_on(findings, rest.least))
        weighed = replace(weighed, rest=rest)
    drives = drives_for(faint_names, _shown(done, named), first.model.wheel_kind)
    same_clock = all(o.same_clock for o in known if o.floor)
    late = lateness(done, findings, same_clock)
    drive = _next(findings, drives, faint, weighed.verdict, same_clock=same_clock)
    to_look_at = moments.to_look_at(rest.moments)
    alone = to_look_at and not drive
    return Diagnosis(
        verdict=weighed.verdict,
        sentence=weighed.sentence,
        before=before,
        score_refit=refit,
        findings=of_all(findings, rest.share),
        ranking=ranking_of(done, findings),
        not_identifiable=hidden,
        rest=replace(rest, share=part_of_all(findings, rest.share) * rest.share),
        late=late if any(o.floor for o in known) and not lateness_changes(known) else None,
        search=done,
        opened=after,
        modelled=modelled,
        steps=steps,
        notes=[
            *time_base_notes(modelled),
            *geometry_notes(last.state.model),
            *noise,
            *disturbed,
            *held_notes(known, findings),
            *lag_notes(lags_s),
            *marker_notes(modelled),
            *([] if own or runs_off else missed_notes(before)),
            *heading_notes(last.fit.datasets, last.state.models),
            *few,
            *answers,
            *weighed.notes,
            *([f"{to_look_at[0].upper()}{to_look_at[1:]}."] if alone else []),
        ],
        next_experiment=_after_a_look(drive, to_look_at),
        robots_off=tuple(off),
        runs_off=tuple(runs_off),
        robots=tuple(resolutions([_with_found(o, fitted, last.state.model) for o in opened])),
        base_names=base,
        apart=own,
    )


def thinned_to_search(opened: Sequence[Opened]) -> list[Opened]:
    """Measurements with as many starts of predictions as a search looks at."""
    data = [o.data for o in opened]
    return thinned(opened, thinning(data, SETTINGS.starts, SETTINGS.starts_apart_s))


def _with_all_starts(own: Opened, opened: Sequence[Opened]) -> Opened:
    """One of the measurements as it was opened, with what is its own in the search."""
    whole = next(o for o in opened if o.measurement is own.measurement)
    if own.floor is None:
        return own
    data = replace(whole.data, own=own.data.own, by_run=own.data.by_run)
    return replace(own, data=data, floor=whole.floor)


def _beside_formula(
    findings: Sequence[Finding], last: Trial, rest: Rest, runs: int
) -> list[Finding]:
    """Findings, those doubtful that are at a place or for a while and bring nothing beside it."""
    local = [f.effect for f in findings if f.certainty != "doubtful" and is_local(f.effect)]
    gone = needless(last.fit, rest.proven, local, runs) if rest.proven else []
    why = "the formula that was proven for the rest, fitted in its place, leaves no more than it"
    return [doubted(f, why) if f.effect in gone else f for f in findings]


def _drift(given: float, first: State, start: State, last: Trial) -> Finding | None:
    """Gains of the base that were far off, with what they take beside all that was found.

    Args:
        given: score of the model as given.
        first: where the search started, and what was free there.
        start: the same with gains nearer.
        last: the final trial.
    """
    names = {p.name for p in first.free if p.name.startswith("base.")}
    own = [e for e in last.fit.shared_estimates() if e.name in names]
    if not own or not begun_nearer(first, start):
        return None
    own.sort(key=lambda e: -last.fit.moved[e.name])
    rise = on_base_of(first, last, names).held_score ** 2 - last.held_score**2
    share = rise / max(given**2 - min(last.held_score**2, 1.0), 1e-9)
    return Finding(REFIT, None, own, float(np.clip(share, 0.0, 1.0)), "sure")


def _gains_nothing(
    proven: Formula, findings: Sequence[Finding], whole: ScoreFit, first: ScoreFit
) -> bool:
    """True if left-out data do not bear a formula out, once the base is refitted beside it.

    Args:
        proven: the formula.
        findings: beside it.
        whole: all that was found, fitted with the base.
        first: of the model as given.
    """
    found = taken(
        whole,
        proven,
        beside=(),
        runs=len({d.measurement.log_sha256 for d in whole.datasets}),
        passing=doubtful_moments(findings, proven),
        given=first.held_square,
    )
    return bool(found.gains_nothing)


def _doubted(
    findings: Sequence[Finding], less: dict[str, Trial], known: Sequence[Opened]
) -> Doubted | None:
    """The effects that are in doubt, and the fit without them."""
    return _lacking([f.effect for f in findings if f.certainty == "doubtful"], less, known)


def _lacking(
    effects: Sequence[str], less: dict[str, Trial], known: Sequence[Opened]
) -> Doubted | None:
    """Those of some effects that were fitted, and the fit without them."""
    names = tuple(name for name in effects if name in less)
    if not names:
        return None
    trial = less[names[0]]
    for name in names[1:]:
        trial = without_effect(trial, name)
    formulas = formulas_of(known, trial.fit, forms_alone=True)
    return Doubted(names, formulas, trial.fit) if formulas else None


def _with_found(own: Opened, fitted: dict[int, Opened], model: native.Model) -> Opened:
    """As it was fitted, or one that was left out with the model of the others."""
    return fitted.get(id(own.measurement)) or own.aligned(model)


def _refit(done: Search, findings: Sequence[Finding]) -> float:
    """Score after a refit of the base alone, with its lag if nothing else was found."""
    if findings and all(f.effect == REFIT for f in findings):
        return done.last.held_score
    start = done.rounds[0].before
    trial = next((t for t in done.rounds[0].trials if t.names == (REFIT,)), None)
    if trial is None and start.state.base:
        trial = cross_validate(start, (REFIT,))
    return min(start.held_score, trial.held_score) if trial else start.held_score


def _instead_of_drift(score: float, done: Search, first: State, usual: float) -> list[str]:
    """Effects that would take what drifting gains took, where nothing else was found."""
    last = done.last.held_score
    gains = {p.name for p in first.free} & set(BASE_GAINS)
    if done.found or not gains or not drifted(score, last, usual):
        return []
    return instead_of_drift(first, done.rounds[0].before, done.settings)


def _shown(done: Search, named: Collection[str]) -> list[str]:
    """Effects that were named, or would be if one more of them were there."""
    names = {name for name, _ in done.without_trace if name not in named} | {REFIT}
    return [s.name for s in done.rounds[-1].screened if s.name not in names]


# What shows an effect, by the words of its card's `identify`.
DRIVES = {
    "straight": "straight on",
    "strafe": "sideways",
    "diagonal": "diagonally",
    "spin": "turns on the spot",
    "arcs": "arcs of several speeds and radii",
    "levels": "at five or more duties",
    "steps": "from rest",
    "stops": "stops from several speeds",
    "reversals": "forward straight to back without a pause",
    "headings": "along four headings",
    "places": "all over the floor",
    "long": "for two minutes or more",
}


def drives_for(
    hidden: Sequence[str], seen: Sequence[str], wheel_kind: str
) -> tuple[str, list[str]]:
    """Drives that the wheels allow and no effect shown asks for, and the hidden effects that do."""
    cards = catalogue()
    had = {t for name in seen for t in cards[name]["identify"]} | CANNOT.get(wheel_kind, set())
    asked = {name: set(cards[name]["identify"]) - had for name in hidden}
    every = set().union(*asked.values())
    words = ", ".join(words for t, words in DRIVES.items() if t in every)
    return words, [name for name, drives in asked.items() if drives]


def _after_a_look(drive: dict | None, look: str) -> dict | None:
    """The next drive, once what is to be looked at first was."""
    if not drive or not look:
        return drive
    return {**drive, "why": f"first {look}; then: {drive['why']}"}


def _next(
    findings,
    drives: tuple[str, list[str]],
    hidden: list[tuple[str, str]],
    verdict: str,
    *,
    same_clock: bool,
) -> dict | None:
    """Next drive in words; the script itself is designed by `twinmill next`."""
    tied = next((f.group for f in findings if f.group), None)
    if verdict == "ambiguous" and tied:
        clocks = "" if same_clock else ", on clocks tied by a calibration log"
        return {
            "script": None,
            "separates": list(tied),
            "why": f"this log cannot tell {' from '.join(tied)}: drive all its axes at five or "
            f"more duties, from rest and through zero{clocks}",
        }
    if hidden:
        words, shown = drives
        names = shown or [name for name, _ in hidden]
        ask = f"drive {words}" if words else "`twinmill twin effects NAME` says what shows one"
        leave = "leaves" if len(names) == 1 else "leave"
        return {
            "script": None,
            "separates": names,
            "why": f"{', '.join(names)} {leave} no trace in this log: {ask}",
        }
    return None
