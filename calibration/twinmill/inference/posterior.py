# SPDX-License-Identifier: Apache-2.0
"""Posterior probabilities of what is missing, from a table of evidence and prior odds.

Three kinds of hypotheses compete: effects of the catalogue with or without a dependence that is a
thing of its own; a dependence alone; and an unnamed thing that an effect mimics, of which the
dependence is the part that the effect's form does not take. The data cannot tell the first from
the last by likelihood where both hold the same columns; the prior of the sizes does.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from twinmill.inference.discrepancy import TIME
from twinmill.inference.search import log_prior_of_effects
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import Entry, Table, subsets
from twinmill.model.parameters import catalogue_name

DRAWS = 400  # of blocks


@dataclass(frozen=True)
class Belief:
    """One hypothesis and its probability.

    Attributes:
        effects: of the catalogue that are missing, each kind once; without what the base always
            lacked, which is no news.
        mimicked: effects in whose place one unnamed thing is; empty if none is.
        entry: of the table.
        words: dependences.
        always: effects that the base always lacked, which its model has.
        log_own: Bayes factor of these in the base's own log, which `probability` holds.
        probability: of it.
    """

    effects: tuple[str, ...]
    mimicked: tuple[str, ...]
    words: tuple[str, ...]
    entry: Entry
    always: tuple[str, ...]
    log_own: float
    probability: float

    @property
    def nothing(self) -> bool:
        """Nothing is missing but better numbers of the base."""
        return not (self.effects or self.mimicked or self.words)

    @property
    def outside(self) -> bool:
        """Something without a name is missing, alone or beside effects of the catalogue."""
        return bool(self.words or self.mimicked)

    @property
    def fitted(self) -> tuple[str, ...]:
        """Effects that its model has, those that are mimicked too."""
        return (*self.effects, *self.mimicked)


def beliefs(table: Table) -> list[Belief]:
    """All hypotheses with their probabilities, which add up to one."""
    rows = [row for entry in table.entries for row in _rows(entry, table)]
    logs = np.array([row.log for row in rows])
    nothing = np.array([set(r.entry.effects) == set(r.no_news) and not r.entry.words for r in rows])
    blocks = np.array([row.entry.blocks for row in rows])
    p = probabilities(logs, blocks, nothing)
    return [_belief(row, float(v), table) for row, v in zip(rows, p, strict=True)]


def probabilities(logs: np.ndarray, blocks: np.ndarray, nothing: np.ndarray) -> np.ndarray:
    """(H,) probabilities of hypotheses.

    Which thing is missing follows from the evidence. That anything is missing is averaged over
    blocks of time that are drawn again and again (Bayesian bootstrap; pseudo-BMA+ of Yao et al.
    2018, Bayesian Analysis 13): what few blocks speak for, or some against, is not sure.

    Args:
        logs: (H,) log posterior, up to a constant.
        blocks: (H, B) log density of each block, which `logs` hold.
        nothing: (H,) bool, nothing is missing.
    """
    rest = logs - blocks.sum(axis=1)
    count = blocks.shape[1]
    drawn = np.random.default_rng(0).dirichlet(np.ones(count), DRAWS) * count
    each = blocks @ drawn.T + rest[:, None]
    p = np.exp(each - logsumexp(each, axis=0)).mean(axis=1)
    some = np.exp(logs - logsumexp(logs[~nothing]))
    p[~nothing] = some[~nothing] * (1 - p[nothing].sum())
    return p


@dataclass(frozen=True)
class _Row:
    """An entry with one meaning of its effects, and its log posterior up to a constant."""

    entry: Entry
    log: float
    mimicked: tuple[str, ...] = ()
    no_news: tuple[str, ...] = ()
    always: tuple[str, ...] = ()
    log_own: float = 0.0


def _belief(row: _Row, probability: float, table: Table) -> Belief:
    """Belief in one effect; repeated begins and ends are no effect, but a dependence on time.

    What comes and goes once, in several steps, is one thing of a kind.
    """
    entry = row.entry
    at_moments = [n for n in map(catalogue_name, entry.effects) if n in table.kinds.at_moments]
    swells = table.swells.get(entry.effects)
    steps = [n for n in at_moments if n != swells] if len(at_moments) > 1 else []

    def once(effects: Iterable[str]) -> tuple[str, ...]:
        return tuple(n for n in dict.fromkeys(map(catalogue_name, effects)) if n not in steps)

    again = steps and swells is None and TIME not in entry.words
    words = (TIME, *entry.words) if again else entry.words
    real = once(n for n in entry.effects if n not in (*row.mimicked, *row.no_news))
    like = tuple(n for n in once(row.mimicked) if n not in real)
    return Belief(real, like, words, entry, once(row.always), row.log_own, probability)


def _rows(entry: Entry, table: Table) -> list[_Row]:
    """All meanings of an entry."""
    count = len(entry.effects)
    stale = np.log(PRIORS.stale if entry.stale else 1 - PRIORS.stale)
    each = np.log(PRIORS.outside / len(table.words))
    other = len(entry.words) * each if entry.words else np.log(1 - PRIORS.outside)
    real = stale + other + log_prior_of_effects(count, len(table.candidates)) + entry.log_evidence
    rows = [_Row(entry, float(real))]
    for known in table.no_news.get(entry.effects, []):
        others = [catalogue_name(n) for n in entry.effects if n not in known.formal]
        kin = [_kinship(catalogue_name(n), known.words, table) for n in known.formal]
        like = float(np.log(kin).sum())
        rest = log_prior_of_effects(len(others), len(table.candidates))
        log = float(stale + other + like + rest + entry.log_evidence + known.log_odds)
        no_news = (*known.always, *known.formal)
        rows.append(_Row(entry, log, no_news=no_news, always=known.always, log_own=known.log_own))
    for names, log_evidence in zip(subsets(entry.effects), entry.log_mimicked, strict=True):
        if np.isfinite(log_evidence):
            # the first word is no further thing, but the part that the effects' forms do not take
            like = sum(_log_likeness(catalogue_name(n), entry.words, table) for n in names)
            rest = log_prior_of_effects(count - len(names), len(table.candidates))
            log = float(stale + other + like + rest + log_evidence)
            rows.append(_Row(entry, log, mimicked=names))
    return rows


def _log_likeness(effect: str, words: tuple[str, ...], table: Table) -> float:
    """Log probability that an unnamed thing with these dependences looks like an effect."""
    kin = _kinship(effect, words, table)
    return float(np.log(PRIORS.alike * kin + (1 - PRIORS.alike) / len(table.candidates)))


def _kinship(effect: str, words: tuple[str, ...], table: Table) -> float:
    """Probability of an effect among those that depend on one of these; 0 if on none."""

    def of_kind(word: str) -> list[str]:
        return [n for n in table.candidates if word in table.kinds.told_by[n]]

    return max((1 / len(of_kind(w)) for w in words if effect in of_kind(w)), default=0.0)
