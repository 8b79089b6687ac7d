# SPDX-License-Identifier: Apache-2.0
"""Effects that a formula without a name outdoes: other physics stands behind them.

What is not in the catalogue is taken in part by the effect that is most like it, surely and with a
wrong name. Then a formula of the library takes more on left-out parts than the effect does, each
with one free factor beside all else that was found. Where it takes little more, and leaves the
effect nothing, the effect is doubtful.

An effect that is there in another formula leaves a rest, which a second effect takes. Then formulas
that make up the first one, each with a number of its own, take the rest as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinmill.diagnosis.finding import Finding, doubted
from twinmill.diagnosis.rest import Formulas, Products, formulas_of
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT, Trial, without_effect
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import Term
from twinmill.model.parameters import is_local, with_role


@dataclass(frozen=True)
class Rival:
    """A formula that takes more than an effect does; `outdoes` if by so much that it is right."""

    term: Term
    outdoes: bool


@dataclass(frozen=True)
class Without:
    """The final state without each effect.

    Attributes:
        less: refitted without it, by effect.
        formulas: over the logs, as the final model moves.
        rivals: formulas that take a little more than an effect does, by effect.
    """

    less: dict[str, Trial]
    formulas: Formulas | None
    rivals: dict[str, Term]

    def doubted(self, findings: Sequence[Finding], last: Trial) -> list[Finding]:
        """Findings, doubtful where a formula takes more, or another form of a larger one as much.

        Args:
            findings: of the final state.
            last: that state.
        """

        def judged(finding: Finding) -> Finding:
            term = self.rivals.get(finding.effect)
            if term is None:
                larger = self._in_whose_place(finding, findings, last)
                why = f"{larger} in another form takes what it takes"
                return doubted(finding, why) if larger else finding
            why = (
                f"{term.formula} in {term.adds_to} takes more than it and leaves it nothing, so "
                "that it may have another form"
            )
            return doubted(finding, why)

        return [judged(f) for f in findings]

    def _in_whose_place(
        self, finding: Finding, findings: Sequence[Finding], last: Trial
    ) -> str | None:
        """A larger effect of which another form does what this one does; None if there is none."""
        name = finding.effect
        if self.formulas is None or finding.certainty == "doubtful" or name not in self.less:
            return None
        larger = [f.effect for f in findings if f.share > finding.share and f.effect in self.less]
        if not larger:
            return None
        own, families = self._done_by(name, last), self._families()
        done = (
            n
            for n in larger
            if in_another_form(own, self._done_by(n, last), families, local=is_local(name))
        )
        return next(done, None)

    def _done_by(self, name: str, last: Trial) -> Products:
        """Columns of an effect before all formulas, with the rest without it."""
        assert self.formulas is not None
        less = self.less[name].fit
        return self.formulas.products(less, self.formulas.changed(less, last.fit))

    def _families(self) -> list[np.ndarray]:
        """(1 + T,) bool each, of formulas that are judged together; the first is an effect."""
        assert self.formulas is not None
        of = [None, *((t.group, t.family) for t in self.formulas.terms)]
        return [np.array([own == kind for own in of]) for kind in dict.fromkeys(of[1:])]


def less_each(done: Search, opened: Sequence[Opened]) -> Without:
    """Final state refitted without each finding in turn; outdone findings are dropped.

    Args:
        done: what is outdone moves from its findings to what was dropped.
        opened: its measurements, in its order.
    """
    less = {n: without_effect(done.last, n) for n in dict.fromkeys(done.found) if n != REFIT}
    formulas = formulas_of(opened, done.last.fit)
    rivals: dict[str, Term] = {}
    for name in list(less):
        rival = rival_of(formulas, name, less[name], done.last) if formulas else None
        if rival is None:
            continue
        if not rival.outdoes:
            rivals[name] = rival.term
            continue
        done.last = less[name]
        done.dropped.append(name)
        less = {n: without_effect(done.last, n) for n in less if n != name}
        formulas = formulas_of(opened, done.last.fit)
    return Without(less, formulas, rivals)


def rival_of(formulas: Formulas, name: str, less: Trial, whole: Trial) -> Rival | None:
    """The formula that takes more than an effect, if there is one, and does what the effect does.

    Args:
        formulas: over the logs.
        name: of the effect.
        less: without the effect.
        whole: with it; the way from one to the other is the effect as it was found.
    """
    products = formulas.products(less.fit, formulas.changed(less.fit, whole.fit))
    own, *gains = products.each_held_out
    if is_local(name):  # one block may hold all of it, so that the others tell nothing of its size
        own = products.taken[0]
    own = max(own, 0.0)
    for k in np.argsort(gains)[::-1]:
        if gains[k] <= own + SETTINGS.outdoes_by:
            return None
        if with_role(name, "moment") and formulas.terms[k].is_step:
            continue  # the same, at a moment that is not fitted
        both = products.only(np.isin(np.arange(1 + len(gains)), [0, 1 + k]))
        beside = both.held_out(np.ones(2, bool)) - gains[k]
        outdoes = gains[k] > SETTINGS.outdoes * own and beside < SETTINGS.kept * own
        if outdoes or beside < SETTINGS.nothing_beside * own:
            return Rival(formulas.terms[k], bool(outdoes))
    return None


def in_another_form(
    own: Products, larger: Products, families: Sequence[np.ndarray], *, local: bool
) -> bool:
    """True if formulas of a larger effect take the share that a smaller one takes beside it.

    Args:
        own: what the smaller one does, the first column, with what is left without it.
        larger: the same of the larger one.
        families: (T,) bool each, of the formulas among the columns.
        local: the smaller one is at a place or for a while.
    """
    effect = np.arange(len(own.seen)) == 0
    # One block may hold all of what is local, so that the others tell nothing of its size.
    taken = max(float(own.taken[0]) if local else own.held_out(effect), 0.0)
    for family in families:
        if not larger.holds(family, effect):
            continue
        gain = own.held_out(family)
        beside = own.held_out(family | effect) - gain
        if gain > SETTINGS.as_good * taken and beside < SETTINGS.kept * taken:
            return True
    return False
