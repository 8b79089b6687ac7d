# SPDX-License-Identifier: Apache-2.0
"""The simplest formula for what is left, chosen on one half of the blocks and proven on the other.

Stretches of the logs alternate between two halves. On each half in turn a formula is chosen: of all
forms, the one of fewest numbers among those that predict left-out stretches of that half equally
well; then terms beside it, as long as they help. What was chosen is judged on the other half, which
neither chose nor fitted it: by an F test, and by the chance of so large a fall under random signs
of blocks (both exact for what they assume; the larger chance counts). So one formula is tested a
half, however many were tried, and both halves together count twice (Bonferroni), or four times
where a second one is tested that was chosen at larger weights. Of two that are
proven, the one that gains more on both halves is told.
"""

from collections.abc import Sequence
from dataclasses import replace
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
from twinmill.diagnosis.forms import (
    MOST_NUMBERS,
    Form,
    Motion,
    from_library,
    on_and_off,
    own_forms,
    sized,
)
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.formula_telling import TRIED, stability, told
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.term import TIME, Term
from twinmill.fitting.opening import Opened
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.parameters import drives_sideways

FEWEST = 4  # stretches
SHORTLIST = 60  # forms that are weighed again once it is known what noise remains
MOST_SCALED = 100.0  # of the square of a channel
HEAVY = 4.0  # times the weight of rows, where nothing is proven at their own
MOST_TERMS = 3
ALL_SIGNS = 12  # up to so many blocks all signs are tried ...
DRAWN = 4095  # ... of more so many
LEVELS = (-0.7, -0.35, 0.0, 0.35, 0.7)  # of a wave that is sharpened


def formula_of(
    fit: ScoreFit,
    *,
    logs: Sequence[tuple[int, Opened]],
    velocities: Sequence[np.ndarray],
    terms: Sequence[Term],
    changes: Columns,
    rival: Sequence[np.ndarray] = (),
) -> Formula | None:
    """The formula for what a fit leaves; None if none is proven.

    Args:
        fit: of the model that lacks it.
        logs: place among the fit's data sets, and the log.
        velocities: (N, 3) of the body in each, as the final model moves.
        terms: of the library.
        changes: of all logs' rows by each.
        rival: (R,) of each log's rows by what the formula must outdo; empty if nothing.
    """
    pairs = zip(logs, velocities, strict=True)
    motions = [Motion.of(own, v, HORIZONS) for (_, own), v in pairs]
    model = fit.models[logs[0][0]]
    rows = Evidence(logs, motions, fit, changes)
    if len(rows.parts) < FEWEST:
        return None
    beat_radps = beat_of([m.own for m in motions])
    own = own_forms(motions, beat_radps, drives_sideways(model), bool(model.wheels()))
    command_unit = "rad/s" if model.drive == "wheel_speed" else ""  # a duty is a plain figure
    forms = [*from_library(terms, command_unit), *sized(own, motions)]
    pool = Pool(forms, rows.raw(forms))
    other = rows.of_all(rival) if len(rival) else None
    half = np.arange(len(rows.parts)) % 2 == 0
    proofs = [proof for own in (half, ~half) if (proof := _proven(rows, pool, own, other))]
    for proof in sorted(proofs, key=lambda p: -_net(rows, p)):
        rows.weighed(proof.scale)
        again = stability(rows, pool, proof.chosen.forms[0])
        if again >= SETTINGS.formula_again:
            whole = _completed(rows, pool, proof)
            return told(rows, whole, len(forms), again)
    return None


def _completed(rows: Evidence, pool: Pool, proof: Proof) -> Proof:
    """With the form that has a proven one as a part, where both halves together ask for it.

    One of two parts of a direction may be too small to be seen in one half.
    """
    if len(proof.chosen.forms) > 1:
        return proof
    own = proof.chosen.forms[0]
    more = [k for k, f in enumerate(pool.forms) if _has(f, own)]
    every = np.ones(len(rows.parts), bool)
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
    """What a proven formula gains on each stretch of both halves, fitted to all others."""
    rows.weighed(np.ones(len(rows.stretch)))
    every = np.ones(len(rows.parts), bool)
    last = proof.chosen.forms[-1]
    width = len(last.shapes)
    raw = proof.chosen.raw
    sums = Sums.of(rows, Pool([last], raw[:, -width:]), raw[:, :-width])
    return float(sums.held_out(every)[0]) - SETTINGS.each * proof.chosen.numbers


def _proven(rows: Evidence, pool: Pool, half: np.ndarray, rival: np.ndarray | None) -> Proof | None:
    """Chooses on a half and judges on the other; None where that does not bear it out.

    What the floor took for noise, as what sways after each start, weighs next to nothing. So where
    nothing is proven, what swings and takes much is looked for at larger weights.

    Args:
        rows: are weighed anew.
        pool: to choose from.
        half: (S,) of the stretches.
        rival: (R, 1) raw column of what it must outdo.
    """
    tries = (_proven_at(rows, pool, half, rival, weight=w) for w in (1.0, HEAVY))
    return next((proof for proof in tries if proof), None)


def _proven_at(
    rows: Evidence, pool: Pool, half: np.ndarray, rival: np.ndarray | None, *, weight: float
) -> Proof | None:
    """The same with rows that weigh so many times what they do; above 1 of what swings alone."""
    rows.weighed(np.full(len(rows.stretch), weight))
    some = pool.some([k for k, f in enumerate(pool.forms) if f.damping]) if weight > 1 else pool
    sums = Sums.of(rows, some, pool.raw[:, :0])
    net = sums.held_out(half) - SETTINGS.each * np.array([f.numbers for f in some.forms])
    best = np.argsort(-net)[:SHORTLIST]
    left = rows.left[half[rows.stretch]]
    if net[best[0]] <= (SETTINGS.formula_takes * left @ left if weight > 1 else 0):
        return None
    first = some.some(best[:1])
    rows.weighed(weight * _scales(rows, first.raw, half))
    chosen = _chosen(rows, pool, some.some(best), half)
    if not chosen or (rival is not None and _outdone(rows, chosen, rival, half)):
        return None
    proof = _proof(rows, chosen, half, tests=2 if weight == 1 else 4)
    if proof.chance > SETTINGS.formula_chance or proof.takes < SETTINGS.formula_takes:
        return None
    return proof


def _outdone(rows: Evidence, chosen: Chosen, rival: np.ndarray, half: np.ndarray) -> bool:
    """Whether a rival predicts left-out stretches as well."""
    one = Pool([Form("motion", ("1",), "", sizes=(1.0,))], rival)
    sums = Sums.of(rows, one, rival[:, :0])
    return bool(sums.held_out(half)[0] >= chosen.gain - _alike(chosen.gain))


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
        fitting = [k for k, f in enumerate(pool.forms) if _fits_beside(f, found)]
        if not fitting:
            break
        short = pool.some(fitting)
    return found if found.forms else None


def _worth(more: Chosen, less: Chosen, tried: int) -> bool:
    """Whether what is chosen beside the rest gains more than the best of so many would."""
    rise = more.net - less.net
    if not less.forms:
        return rise > 0
    return rise > max(2 * np.log(tried), SETTINGS.formula_beside * less.gain)


def _fits_beside(form: Form, found: Chosen) -> bool:
    states = bool(form.state) + sum(bool(f.state) for f in found.forms)
    shapes = len(form.shapes) + sum(len(f.shapes) for f in found.forms)
    same = form.adds_to == found.forms[0].adds_to
    return same and states < 2 and shapes <= MOST_NUMBERS and form not in found.forms


def _best(rows: Evidence, pool: Pool, half: np.ndarray, found: Chosen) -> Chosen | None:
    """The simplest that gains as much as any beside what was found, its constant polished."""
    gains = Sums.of(rows, pool, found.raw).held_out(half)
    net = gains - SETTINGS.each * np.array([f.numbers for f in pool.forms])
    if net.max() <= 0:
        return None
    near = np.flatnonzero(net >= net.max() - _alike(net.max()))
    simplest = min(near, key=lambda k: (_complexity(pool.forms[k]), -net[k]))
    tops = dict.fromkeys([int(simplest), int(np.argmax(net))])
    polished = [_polished(rows, pool.some([k]), half, found) for k in tops]
    plainer = [f for c in polished if (f := c.forms[-1].plainer)]
    for form in sized(plainer, rows.motions):
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
    """With the best constants near the form's, and sharpened where that is simpler or better."""
    best = best_of(rows, one, half, found)
    for part, name in product((1.0, 0.25), best.forms[-1].searched):
        tried = best.forms[-1].near(name, part * TRIED)
        best = max(best, made(rows, tried, half, found), key=lambda c: c.gain)
    form = best.forms[-1]
    if form.group != TIME or not form.constant:
        return best
    numbers = fitted(rows, best, half)[-2:] * form.strengths
    near = form.near("constant", TRIED[::2] / 4)
    sharp = [s for w in near for s in on_and_off(w, numbers, LEVELS)]
    other = made(rows, sharp, half, found)
    return other if other.net > best.net - _alike(best.net) else best


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
        chance = max(_by_signs(np.bincount(block, (x @ numbers) * left)), _by_f(x, left, errors))
    return Proof(chosen, min(1.0, tests * chance), float(gain / max(total, 1e-9)), rows.scale)


def _by_signs(pushes: np.ndarray) -> float:
    """Chance of so large a sum of the blocks' parts if each had a random sign."""
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
