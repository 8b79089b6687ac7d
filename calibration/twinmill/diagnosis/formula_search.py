# SPDX-License-Identifier: Apache-2.0
"""The simplest formula for what is left, chosen on one half of the blocks and proven on the other.

Stretches of the logs alternate between two halves. On each half in turn a formula is chosen: of all
forms, the one of fewest numbers among those that predict left-out stretches of that half equally
well; then terms beside it, as long as they help. What was chosen is judged on the other half, which
neither chose nor fitted it: by an F test, and by the chance of so large a fall under random signs
of blocks (both exact for what they assume; the larger chance counts). So one formula is tested a
half, however many were tried, and both halves together count twice (Bonferroni). Where a half tests
one more that was chosen at larger weights, or that comes and goes by the clock, that counts four
times, and a third one six times. Of those that are proven, the one that gains most on both halves
is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from twinmill.chance import f_above
from twinmill.diagnosis.columns import Columns
from twinmill.diagnosis.evidence import (
    HORIZONS,
    Chosen,
    Evidence,
    Pool,
    Proof,
    Sums,
    best_of,
    fitted,
    made,
)
from twinmill.diagnosis.families.of_time import beat_of
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.formula_telling import TRIED, drives_back, stability, told
from twinmill.diagnosis.recurring import Recurring
from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.opening import Opened
from twinmill.fitting.score_fit import ScoreFit
from twinmill.formulas.forms import (
    MOST_NUMBERS,
    Form,
    Motion,
    from_library,
    own_forms,
    sized,
)
from twinmill.formulas.term import TIME, Term
from twinmill.model.parameters import drives_sideways

FEWEST = 4  # stretches
SHORTLIST = 60  # forms that are weighed again once it is known what noise remains
MOST_SCALED = 100.0  # of the square of a channel
HEAVY = 4.0  # times the weight of rows, where nothing is proven at their own
MOST_TERMS = 3
ALL_SIGNS = 12  # up to so many blocks all signs are tried ...
DRAWN = 4095  # ... of more so many
NEAR = 10  # best forms: where one of these is of time, all that comes by the clock is tried


@dataclass(frozen=True)
class Rival:
    """Competing explanation that a formula must outdo.

    Attributes:
        changes: (R,) of each log's rows by it.
        numbers: that were fitted to all rows.
    """

    changes: Sequence[np.ndarray]
    numbers: int


def formula_of(
    fit: ScoreFit,
    *,
    logs: Sequence[tuple[int, Opened]],
    velocities: Sequence[np.ndarray],
    terms: Sequence[Term],
    changes: Columns,
    rival: Rival | None = None,
) -> Formula | None:
    """The formula for what a fit leaves; None if none is proven.

    Args:
        fit: of the model that lacks it.
        logs: place among the fit's data sets, and the log.
        velocities: (N, 3) of the body in each, as the final model moves.
        terms: of the library.
        changes: of all logs' rows by each.
        rival: what the formula must outdo.
    """
    opened = [own for _, own in logs]
    motion = Motion.of(opened, velocities, HORIZONS)
    model = fit.models[logs[0][0]]
    rows = Evidence(logs, motion, fit, changes)
    if len(rows.parts) < FEWEST:
        return None
    own = own_forms(motion.names, beat_of(opened), drives_sideways(model), bool(model.wheels()))
    command_unit = "rad/s" if model.drive == "wheel_speed" else ""  # a duty is a plain figure
    forms = [*from_library(terms, command_unit), *sized(own, motion)]
    pool = Pool(forms, rows.raw(forms))
    alone = Sums.of(rows, pool, pool.raw[:, :0])
    clock = Recurring(rows)
    half = np.arange(len(rows.parts)) % 2 == 0
    found: list[Proof] = []
    for chooses in (half, ~half):
        found += _proven(rows, pool, alone, chooses, rival=rival, clock=clock)
    return _borne_out(rows, pool, clock, found)


def _borne_out(
    rows: Evidence, pool: Pool, clock: Recurring, proofs: Sequence[Proof]
) -> Formula | None:
    """Proven formula that resamplings bear out, of these the one that gains most on both halves."""
    for proof in sorted(proofs, key=lambda p: -_net(rows, p)):
        first = proof.chosen.forms[0]
        rows.weighed(proof.scale)
        again = stability(rows, _with(pool, proof) if first.recurs else pool, first)
        if again >= SETTINGS.formula_again:
            tried = len(pool.forms) + (clock.tried if first.recurs else 0)
            whole = _completed(rows, pool, proof, clock)
            formula = told(rows, whole, tried, again)
            if drives_back(rows, formula):
                continue
            goes_on = first.recurs and clock.goes_on(whole.chosen.raw[:, :1])
            return replace(formula, goes_on=goes_on)
    return None


def _with(pool: Pool, proof: Proof) -> Pool:
    """With the first form of a proof, which is not among those of a pool."""
    first = proof.chosen.forms[0]
    return Pool([*pool.forms, first], np.hstack([pool.raw, proof.chosen.raw[:, :1]]))


def _completed(rows: Evidence, pool: Pool, proof: Proof, clock: Recurring) -> Proof:
    """With the form that has a proven one as a part, where both halves together ask for it.

    One of two parts of a direction may be too small to be seen in one half. Of what comes and goes
    by the clock both halves together tell the period best.
    """
    own, every = proof.chosen.forms[0], np.ones(len(rows.parts), bool)
    if own.recurs:
        better, raw = clock.best(every), proof.chosen.raw[:, 1:]
        forms = (*better.forms, *proof.chosen.forms[1:])
        chosen = replace(proof.chosen, forms=forms, raw=np.hstack([better.raw, raw]))
        return replace(proof, chosen=chosen)
    if len(proof.chosen.forms) > 1:
        return proof
    more = [k for k, f in enumerate(pool.forms) if _has(f, own)]
    if not more:
        return proof
    nothing = Chosen((), np.zeros((len(rows.stretch), 0)), 0.0)
    known = best_of(rows, Pool([own], proof.chosen.raw), every, nothing)
    best = max((best_of(rows, pool.some([k]), every, nothing) for k in more), key=lambda c: c.net)
    return replace(proof, chosen=best) if best.net > known.net else proof


def _has(form: Form, part: Form) -> bool:
    where = [(f.adds_to, f.group, f.rates) for f in (form, part)]
    return where[0] == where[1] and {*form.texts} > {*part.texts}


def _net(rows: Evidence, proof: Proof) -> float:
    """Gain of a proven formula on each stretch of both halves, fitted to all others."""
    rows.weighed(np.ones(len(rows.stretch)))
    every = np.ones(len(rows.parts), bool)
    last = proof.chosen.forms[-1]
    width = len(last.shapes)
    raw = proof.chosen.raw
    sums = Sums.of(rows, Pool([last], raw[:, -width:]), raw[:, :-width])
    return float(sums.held_out(every)[0]) - SETTINGS.each * proof.chosen.numbers


def _proven(
    rows: Evidence,
    pool: Pool,
    alone: Sums,
    half: np.ndarray,
    *,
    rival: Rival | None,
    clock: Recurring,
) -> list[Proof]:
    """Chooses on a half and judges on the other; none where that does not bear it out.

    What the floor took for noise, as what sways after each start, weighs next to nothing. So where
    nothing is proven, what swings and takes much is looked for at larger weights. Where time is
    near the best, so is what comes and goes by the clock.

    Args:
        rows: are weighed anew.
        pool: to choose from.
        alone: of each form of it, as rows weigh at first.
        half: (S,) of the stretches.
        rival: what it must outdo.
        clock: over the same rows.
    """
    rows.weighed(np.ones(len(rows.stretch)))
    net = _promised(alone, pool.forms, half)
    best = np.argsort(-net)[:SHORTLIST]
    tested = []
    if net[best[0]] > 0:
        tested += _judged(rows, pool, pool.some(best), half, rival=rival, tests=2)
    if not any(_holds(proof) for proof in tested):
        tested += _that_swings(rows, pool, alone, half, rival=rival, before=len(tested))
    found = [proof for proof in tested if _holds(proof)]
    is_of_time = all(proof.chosen.forms[0].group == TIME for proof in found)
    if is_of_time and any(pool.forms[k].group == TIME for k in best[:NEAR]):
        first = _by_the_clock(rows, half, clock)
        tests = 2 * (len(tested) + 1)
        found += filter(_holds, _judged(rows, pool, first, half, rival=rival, tests=tests))
    return found


def _holds(proof: Proof) -> bool:
    """True if the half that judged it bears it out."""
    return proof.chance <= SETTINGS.formula_chance and proof.takes >= SETTINGS.formula_takes


def _promised(alone: Sums, forms: Sequence[Form], half: np.ndarray) -> np.ndarray:
    """(T,) what each form gains on left-out stretches of a half, less what its numbers cost."""
    return alone.held_out(half) - SETTINGS.each * np.array([f.numbers for f in forms])


def _that_swings(
    rows: Evidence,
    pool: Pool,
    alone: Sums,
    half: np.ndarray,
    *,
    rival: Rival | None,
    before: int,
) -> list[Proof]:
    """Proofs of swinging terms alone, by rows that weigh more, after so many tests of a half."""
    rows.weighed(np.full(len(rows.stretch), HEAVY))
    swinging = np.flatnonzero([f.damping > 0 for f in pool.forms])
    sums = alone.some(swinging).of_rows_that_weigh(HEAVY)
    net = _promised(sums, [pool.forms[k] for k in swinging.tolist()], half)
    best = np.argsort(-net)[:SHORTLIST]
    left = rows.left[half[rows.stretch]]
    if net[best[0]] <= SETTINGS.formula_takes * left @ left:
        return []
    tests = 2 * (before + 1)
    short = pool.some(swinging[best])
    return _judged(rows, pool, short, half, rival=rival, tests=tests, weight=HEAVY)


def _by_the_clock(rows: Evidence, half: np.ndarray, clock: Recurring) -> Pool:
    """Pool for part of each period, chosen anew by the noise that then remains."""
    plain = np.ones(len(rows.stretch))
    rows.weighed(plain)
    rows.weighed(_scales(rows, clock.best(half).raw, half))
    best = clock.best(half)
    rows.weighed(plain)
    return best


def _judged(
    rows: Evidence,
    pool: Pool,
    short: Pool,
    half: np.ndarray,
    *,
    rival: Rival | None,
    tests: int,
    weight: float = 1.0,
) -> list[Proof]:
    """The proof on the other half of what is chosen on one; none if nothing is, or it is outdone.

    Args:
        rows: that weigh so many times what they do.
        pool: of which terms after the first are.
        short: of which the first is, the best in front.
        half: (S,) of the stretches.
        rival: what it must outdo.
        tests: that its chance counts for, of both halves.
        weight: of the rows.
    """
    rows.weighed(weight * _scales(rows, short.some([0]).raw, half))
    chosen = _chosen(rows, pool, short, half)
    if not chosen or (rival and _outdone(rows, chosen, rival, half)):
        return []
    return [_proof(rows, chosen, half, tests=tests)]


def _outdone(rows: Evidence, chosen: Chosen, rival: Rival, half: np.ndarray) -> bool:
    """True if a rival predicts left-out stretches as well.

    Its numbers were fitted to these as well: what each takes there by chance goes off.
    """
    one = Pool([Form("motion", ("1",), "", sizes=(1.0,))], rows.of_all(rival.changes))
    gain = Sums.of(rows, one, one.raw[:, :0]).held_out(half)[0] - SETTINGS.each * rival.numbers
    return bool(gain >= chosen.gain - _alike(chosen.gain))


def _scales(rows: Evidence, raw: np.ndarray, half: np.ndarray) -> np.ndarray:
    """(R,) weights with which what these columns leave of each channel counts as noise."""
    (x, _), own = rows.lifted(raw), half[rows.stretch]
    numbers = np.linalg.solve(x[own].T @ x[own] + np.eye(x.shape[1]), x[own].T @ rows.left[own])
    after = rows.left[own] - x[own] @ numbers
    channel = rows.channel[own]
    size = rows.channel.max() + 1
    before, after = (np.bincount(channel, v**2, size) for v in (rows.left[own], after))
    ratio = np.where(after > 0, before / np.maximum(after, 1e-12), 1.0)
    return np.sqrt(np.clip(ratio, 1.0, MOST_SCALED))[rows.channel]


# -- choosing --------------------------------------------------------------------------------------


def _chosen(rows: Evidence, pool: Pool, short: Pool, half: np.ndarray) -> Chosen | None:
    """The simplest terms that predict left-out stretches of a half as well as any.

    Args:
        rows: as they are weighed.
        pool: of which the terms after the first are.
        short: of which the first is.
        half: (S,) of the stretches.
    """
    found = Chosen((), np.zeros((len(rows.stretch), 0)), 0.0)
    while len(found.forms) < MOST_TERMS:
        best = _best(rows, short, half, found)
        if best is None or not _worth(best, found, len(short.forms)):
            break
        found = best
        fitting = _fitting_beside(pool.forms, found)
        if not fitting:
            break
        short = pool.some(fitting)
    return found if found.forms else None


def _worth(more: Chosen, less: Chosen, tried: int) -> bool:
    """True if the choice beside the rest gains more than the best of so many would by chance."""
    rise = more.net - less.net
    if not less.forms:
        return rise > 0
    return rise > max(2 * np.log(tried), SETTINGS.formula_beside * less.gain)


def _fitting_beside(forms: Sequence[Form], found: Chosen) -> list[int]:
    """Numbers of those that one effect `equation` can have with what was found."""
    to, state = found.forms[0].adds_to, any(f.state for f in found.forms)
    most = MOST_NUMBERS - sum(f.places for f in found.forms)
    return [
        k
        for k, f in enumerate(forms)
        if f.adds_to == to and not (state and f.state) and f.places <= most and f not in found.forms
    ]


def _best(rows: Evidence, pool: Pool, half: np.ndarray, found: Chosen) -> Chosen | None:
    """The simplest that gains as much as any beside what was found, its constant polished."""
    gains = Sums.of(rows, pool, found.raw).held_out(half)
    net = gains - SETTINGS.each * np.array([f.numbers for f in pool.forms])
    if net.max() <= 0:
        return None
    near = np.flatnonzero(net >= net.max() - _alike(net.max()))
    simplest = min(near.tolist(), key=lambda k: (_complexity(pool.forms[k]), -net[k]))
    tops = dict.fromkeys([simplest, int(np.argmax(net))])
    polished = [_polished(rows, pool.some([k]), half, found) for k in tops]
    plainer = [f for c in polished if (f := c.forms[-1].plainer)]
    for form in sized(plainer, rows.motion):
        polished.append(_polished(rows, Pool([form], rows.raw([form])), half, found))
    most = max(c.net for c in polished)
    close = [c for c in polished if c.net >= most - _alike(most)]
    return min(close, key=lambda c: (_complexity(c.forms[-1]), -c.gain))


def _alike(gain: float) -> float:
    """By how much less a simpler formula may gain."""
    return max(SETTINGS.tie, SETTINGS.formula_alike * gain)


def _complexity(form: Form) -> int:
    """Numbers; a state, and moments of one run, count as one more each."""
    return form.numbers + len(form.rates) + form.names_time


def _polished(rows: Evidence, one: Pool, half: np.ndarray, found: Chosen) -> Chosen:
    """With the best constants near the form's."""
    best = best_of(rows, one, half, found)
    for part, name in product((1.0, 0.25), best.forms[-1].searched):
        tried = best.forms[-1].near(name, part * TRIED)
        best = max(best, made(rows, tried, half, found), key=lambda c: c.gain)
    return best


# -- proof -----------------------------------------------------------------------------------------


def _proof(rows: Evidence, chosen: Chosen, half: np.ndarray, *, tests: int) -> Proof:
    """Judges on the half that did not choose, as one of so many tests (Bonferroni)."""
    numbers = fitted(rows, chosen, half)
    judging = ~half[rows.stretch]
    x, left = rows.seen(chosen.raw)[judging], rows.left[judging]
    gain = 2 * numbers @ (x.T @ left) - np.sum((x @ numbers) ** 2)
    total = float(left @ left)
    _, block = np.unique(rows.block[judging], return_inverse=True)
    chance = 1.0
    if gain > 0:
        errors = np.sum((left / rows.scale[judging]) ** 2)
        fresh = rows.fresh(judging, left - x @ numbers)
        pushes = np.bincount(block, (x @ numbers) * left)
        chance = max(_by_signs(pushes, fresh), _by_f(x, left, fresh * errors))
    return Proof(chosen, min(1.0, tests * chance), float(gain / max(total, 1e-9)), rows.scale)


def _by_signs(pushes: np.ndarray, fresh: float = 1.0) -> float:
    """Chance of so large a sum of the blocks' parts if each had a random sign.

    Args:
        pushes: of the blocks.
        fresh: share of them that no block before tells, whose signs alone are of their own: the
            chance of all that is its power of that of n blocks, as 2^-n is.
    """
    return _of_all_signs(pushes) ** fresh


def _of_all_signs(pushes: np.ndarray) -> float:
    if len(pushes) <= ALL_SIGNS:
        signs = np.array(list(product((1.0, -1.0), repeat=len(pushes))))
        return float(np.mean(signs @ pushes >= pushes.sum() * (1 - 1e-12)))
    signs = np.random.default_rng(1).choice([-1.0, 1.0], (DRAWN, len(pushes)))
    return float((1 + np.sum(signs @ pushes >= pushes.sum())) / (1 + DRAWN))


def _by_f(x: np.ndarray, left: np.ndarray, errors: float) -> float:
    """F test of (R, K) columns where (R,) rows tell so many independent errors."""
    total, k = float(left @ left), x.shape[1]
    push = x.T @ left
    fall = float(np.linalg.lstsq(x.T @ x, push, rcond=None)[0] @ push)
    if errors - k < 1:
        return 1.0
    rest = max(total - fall, 1e-9) / (errors - k)
    return f_above(fall / k / rest, k, errors - k)
