# SPDX-License-Identifier: Apache-2.0
"""Record of a search, round by round."""

from dataclasses import dataclass, field

import numpy as np

from twinmill.diagnosis.screening import Screened
from twinmill.diagnosis.settings import Settings
from twinmill.diagnosis.trials import REFIT, State, Trial
from twinmill.model.parameters import LAG, LAG_EFFECT, catalogue_name


@dataclass
class Round:
    """One step of a search."""

    before: Trial
    screened: list[Screened]
    trials: list[Trial]
    accepted: Trial | None = None
    tied: list[Trial] = field(default_factory=list)

    def p_value(self, trial: Trial) -> float:
        """Bound of the chance of such evidence if nothing were missing, for all candidates."""
        return float(min(1.0, len(self.screened) * np.exp(-max(trial.evidence / 2, 0.0))))


@dataclass
class Search:
    """A whole search: rounds, the last trial, and what was dropped again.

    Attributes:
        start: where it started, with gains of the base nearer that were far off.
        stopped: by Ctrl-C, before the diagnosis was whole.
    """

    start: State
    rounds: list[Round]
    last: Trial
    dropped: list[str]
    settings: Settings
    stopped: bool = False

    @property
    def found(self) -> list[str]:
        """Names accepted and kept, in order."""
        names = [n for r in self.rounds if r.accepted for n in r.accepted.names]
        return [n for n in names if n not in self.dropped]

    def round_of(self, name: str) -> Round:
        """The last round in which an effect was accepted."""
        return next(r for r in reversed(self.rounds) if r.accepted and name in r.accepted.names)

    def imitators_of(self, name: str) -> list[Trial]:
        """Other trials of its round that took nearly as much, where the final model misses by far.

        Then its errors are no noise, and a few percent between two trials decide nothing.
        """
        this = self.round_of(name)
        if self.last.held_score <= self.settings.misses:
            return []
        before = this.before.held_score**2
        least = self.settings.imitates * (before - this.accepted.held_score**2)
        others = [t for t in this.trials if t is not this.accepted]
        return [t for t in others if before - t.held_score**2 > least]

    @property
    def faint(self) -> list[tuple[str, str]]:
        """Effects that could be there and not be seen, and why; none that the model has.

        Beside a slew limit that is in the model, another one does nothing: so it has no trace.
        """
        had = {catalogue_name(name) for name in self.last.state.model.effects}
        had |= {name for name, _ in self.in_the_base}
        return [(name, why) for name, why in self.without_trace if name not in had]

    @property
    def in_the_base(self) -> list[tuple[str, str]]:
        """Effects without a trace since a free number of the base does the same, and which."""
        free = {p.name for p in self.last.state.free}
        why = f"in the model already, as {LAG}: a log tells their sum alone"
        return [(n, why) for n, _ in self.without_trace if n == LAG_EFFECT and LAG in free]

    @property
    def without_trace(self) -> list[tuple[str, str]]:
        """Effects of which one more would not be seen, and why; none that a trial made likely."""
        trials = [t for t in self.rounds[-1].trials if t.evidence > self.settings.evidence]
        seen = {REFIT, *(n for t in trials for n in t.names)}
        hidden = []
        for s in self.rounds[-1].screened:
            if s.name in seen:
                continue
            if s.size < 1e-6:
                hidden.append((s.name, "the data have no drive on which it acts"))
            elif self.settings.traced**2 * s.size < self.settings.faint:
                hidden.append((s.name, "even three times its usual size would not be visible"))
        return hidden

    @property
    def passes(self) -> int:
        """How often a plant ran over a whole data set, on the average."""
        fits = [t.fit for r in self.rounds for t in (r.before, *r.trials)]
        return round(sum(f.passes for f in fits) / max(len(self.last.state.datasets), 1))
