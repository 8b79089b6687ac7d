# SPDX-License-Identifier: Apache-2.0
"""Report of a proven formula: numbers with intervals, stability, a curve."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from twinmill.chance import t_quantile
from twinmill.diagnosis.evidence import Chosen, Evidence, Pool, Proof, Sums, best_of, made
from twinmill.diagnosis.formula import Curve, Formula, Number
from twinmill.diagnosis.recurring import comes_again
from twinmill.diagnosis.settings import SETTINGS
from twinmill.formulas.forms import (
    ANGLES,
    USUAL,
    Form,
    names_in,
    variable_of,
)
from twinmill.formulas.term import CHANNELS, SPEEDS
from twinmill.formulas.units import units_of

TRIED = np.linspace(-1, 1, 9)  # constants within a form's spread, and again within a fourth
DRAWS = 40  # resamplings of the stretches
SLOPE = 0.01  # of a constant's logarithm
LARGEST_LOG = 5.0
BINS = 14  # of the curve that a report draws
HALF_A_BIN = np.cos(np.pi / BINS)  # least cosine of an angle in a bin, from its middle


# -- telling ---------------------------------------------------------------------------------------


def told(rows: Evidence, proof: Proof, tried: int, again: float) -> Formula:
    """With numbers from all blocks, their intervals, and where the formula holds."""
    every = np.ones(len(rows.parts), bool)
    found = Chosen((), np.zeros((len(rows.stretch), 0)), 0.0)
    for form in proof.chosen.forms:
        best = best_of(rows, Pool([form], rows.raw([form])), every, found)
        for name in form.searched:
            near = best.forms[-1].near(name, TRIED / 4)
            best = max(best, made(rows, near, every, found), key=lambda c: c.gain)
        found = best
    names = names_in([t for f in found.forms for t in (*f.texts, *f.rates)])
    seen = {n: rows.motion.names[n] for n in names}
    numbers = _numbers(rows, found)
    return Formula(
        forms=found.forms,
        numbers=numbers,
        takes=proof.takes,
        chance=proof.chance,
        tried=tried,
        again=again,
        holds={n: (float(v.min()), float(v.max())) for n, v in seen.items()},
        curve=_curve(rows, found.forms, numbers) if found.forms[0].of_one_value else None,
    )


def drives_back(rows: Evidence, formula: Formula) -> bool:
    """True if a formula of a speed alone turns that speed round, somewhere that these logs reach.

    On a drive that repeats itself a few speeds are passed at the same moments alone, and a formula
    of the speed stands for what happens then. Held at that speed the robot would drive backwards.
    """
    forms = formula.forms
    axis = {"motion": "", **dict(zip(CHANNELS, SPEEDS, strict=True))}.get(forms[0].adds_to)
    others = {*names_in([t for f in forms for t in f.texts])} - {axis}
    if axis is None or any(f.rates for f in forms) or (axis and others):
        return False
    numbers = np.array([n.value for n in formula.numbers if n.name])
    motion = rows.motion
    every = motion.names[axis] if axis else np.ones(len(motion.velocity))
    added = np.hstack([motion.values(f).T for f in forms]) @ numbers[: _shapes(forms)]
    for part in motion.parts:
        speed, after = every[part], every[part] + added[part]
        usual = np.sqrt(np.mean(speed[speed != 0] ** 2)) if speed.any() else np.inf
        if np.min(after * np.sign(speed)) < -SETTINGS.formula_back * usual:
            return True
    return False


def _shapes(forms: Sequence[Form]) -> int:
    return sum(len(f.shapes) for f in forms)


def _curve(rows: Evidence, forms: Sequence[Form], numbers: Sequence[Number]) -> Curve:
    """Rest in bins of the first variable of the first term, and the formula there."""
    name, carrier = variable_of(forms)
    inside, middles, period = _bins(rows.motion.names[name], name, forms[0])
    by = f"*{carrier}" if carrier else ""
    bins = [Form(forms[0].adds_to, (f"{text}{by}",), "", sizes=(1.0,)) for text in inside]
    x = rows.seen(rows.raw(bins))
    gram = x.T @ x
    ridge = 1e-3 * np.trace(gram) / len(gram) * np.eye(len(gram))
    inverse = np.linalg.inv(gram + ridge)
    drawn = _drawn(rows, forms, [n.value for n in numbers if n.name], bins)
    apart = np.eye(len(gram)) - 1 / len(gram)  # what all bins share is a gain of the base
    left = inverse @ (x.T @ rows.left) * USUAL[forms[0].adds_to]
    spread = np.sqrt(np.diag(apart @ inverse @ apart)) * USUAL[forms[0].adds_to]
    return Curve(name, carrier, period, middles, left + np.mean(drawn - left), spread, drawn)


def _bins(at: np.ndarray, name: str, form: Form) -> tuple[list[str], np.ndarray, float]:
    """Texts that are 1 in each bin of a variable, their middles, and its period; 0 if it has none.

    What swings often enough in the logs is laid over one period.
    """
    waves, rate = form.wave
    again = waves == name and comes_again(rate, np.ptp(at))
    if again or name in ANGLES:
        angles = np.linspace(-np.pi, np.pi, BINS, endpoint=False) + np.pi * again
        times = rate if again else 1.0
        inside = [f"(cos({times:.6g}*{name} - {a:.4f}) > {HALF_A_BIN:.6f})" for a in angles]
        return inside, angles / times, 2 * np.pi / times if again else 0.0
    edges = np.unique(np.quantile(at, np.linspace(0, 1, BINS + 1)))
    edges[-1] += 1e-9 + 1e-6 * abs(edges[-1])
    inside = [f"({name} >= {a!r})*({name} < {b!r})" for a, b in pairwise(edges.tolist())]
    return inside, (edges[1:] + edges[:-1]) / 2, 0.0


def _drawn(
    rows: Evidence, forms: Sequence[Form], values: Sequence[float], bins: Sequence[Form]
) -> np.ndarray:
    """(B,) the formula in bins, as what is left there is fitted: by least squares on carriers."""
    whole = np.hstack([rows.motion.values(f).T for f in forms]) @ np.array(values)
    weights = [rows.motion.values(b)[0] for b in bins]
    return np.array([w @ whole / max(w @ w, 1e-12) for w in weights])


def _numbers(rows: Evidence, found: Chosen) -> tuple[Number, ...]:
    """Values and intervals: the jackknife over stretches, the constants' slopes beside."""
    constants = [(k, name) for k, f in enumerate(found.forms) for name in f.searched]
    plain = rows.seen(found.raw)
    x = np.column_stack([plain, *(_slope(rows, found, k, name) for k, name in constants)])
    grams = np.array([x[p].T @ x[p] for p in rows.parts])
    moments = np.array([x[p].T @ rows.left[p] for p in rows.parts])
    gram, moment = grams.sum(0), moments.sum(0)
    ridge = 1e-9 * np.diag(np.maximum(np.diag(gram), 1e-12))
    values = np.linalg.solve(gram + ridge, moment)
    apart = [
        np.linalg.solve(gram - g + ridge, moment - m) - values
        for g, m in zip(grams, moments, strict=True)
    ]
    count = len(rows.parts)
    half = t_quantile(0.975, count - 1) * np.sqrt(
        (count - 1) / count * np.sum(np.square(apart), axis=0)
    )
    strengths = np.concatenate([f.strengths for f in found.forms])
    units = [unit for f in found.forms for unit in units_of(f)]
    own = _of_all(rows, found) * strengths
    told = [
        Number(f"p{k}", float(v), float(v - h), float(v + h), unit)
        for k, (v, h, unit) in enumerate(zip(own, half[: len(own)] * strengths, units, strict=True))
    ]
    for (k, name), h in zip(constants, half[len(own) :], strict=True):
        at, by = getattr(found.forms[k], name), float(np.exp(min(h, LARGEST_LOG)))
        unit = found.forms[k].unit if name == "constant" else "1"
        told.append(Number("", at, at / by, at * by, unit))
    return tuple(told)


def _of_all(rows: Evidence, found: Chosen) -> np.ndarray:
    x = rows.seen(found.raw)
    return np.linalg.lstsq(x, rows.left, rcond=None)[0]


def _slope(rows: Evidence, found: Chosen, k: int, name: str) -> np.ndarray:
    """(R,) change of the rows by the logarithm of one of the k-th term's constants."""
    form = found.forms[k]
    first = sum(len(f.shapes) for f in found.forms[:k])
    own = _of_all(rows, found)[first : first + len(form.shapes)] * form.strengths
    at = getattr(form, name)
    up, down = (replace(form, **{name: at * b}) for b in (1 + SLOPE, 1 - SLOPE))
    above, below = (rows.seen(rows.raw([f])) @ (own / f.strengths) for f in (up, down))
    return (above - below) / (2 * SLOPE)


def stability(rows: Evidence, pool: Pool, first: Form) -> float:
    """Share of resamplings of the stretches in which a form of the same kind gains most."""
    sums = Sums.of(rows, pool, pool.raw[:, :0])
    cost = SETTINGS.each * np.array([f.numbers for f in pool.forms])
    random, count, same = np.random.default_rng(1), len(rows.parts), 0
    for _ in range(DRAWS):
        weight = np.bincount(random.integers(count, size=count), minlength=count).astype(float)
        push = np.tensordot(weight, sums.moments, 1)
        gain = np.einsum("tk,tk->t", sums.fitted(weight), push) - cost
        best = pool.forms[int(np.argmax(gain))]
        alike = best.group == first.group or (best.is_late and first.is_late)
        same += alike and best.adds_to == first.adds_to
    return same / DRAWS
