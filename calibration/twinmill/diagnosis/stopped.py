# SPDX-License-Identifier: Apache-2.0
"""Result of a diagnosis that Ctrl-C stopped: its findings by then, within a moment.

Who stops it does not want to wait: nothing is fitted any more, and nothing is said to be sure that
was not weighed against what else could be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from twinmill.diagnosis.finding import of_all, part_of_all
from twinmill.diagnosis.findings import not_weighed
from twinmill.diagnosis.outliers import Outlier
from twinmill.diagnosis.rest import Rest
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.trials import REFIT
from twinmill.diagnosis.verdict import lacking
from twinmill.fitting.compare import Comparison
from twinmill.fitting.opening import Opened

NOTHING = "Stopped before all was tried; nothing had been found."
NOTHING_TRIED = "Stopped before there was an answer; nothing can be said."


@dataclass
class Course:
    """Findings of a diagnosis so far, written down as it goes.

    Attributes:
        opened, before: measurements with the model as given, and how it compares.
        unseen: effects that they cannot show, and why.
        off: robots that differ from the others.
        searches: as they began, the newest last.
        motion: the diagnosis of the motion, before cameras are looked at.
    """

    opened: Sequence[Opened] = ()
    before: Comparison | None = None
    unseen: Mapping[str, str] = field(default_factory=dict)
    off: Sequence[Outlier] = ()
    searches: list[Search] = field(default_factory=list)
    motion: Diagnosis | None = None

    @property
    def search(self) -> Search | None:
        """The newest that has tried anything; None if none has."""
        return next((s for s in reversed(self.searches) if s.rounds), None)

    def told(self) -> Diagnosis | None:
        """Diagnosis from the findings by now; None if nothing was tried."""
        if self.motion:
            return stopped(self.motion, "Stopped before the cameras were looked at.")
        return self._found_so_far(self.search) if self.search else None

    def _found_so_far(self, done: Search) -> Diagnosis:
        done.stopped = True
        found, start = not_weighed(done), done.rounds[0].before
        steps = [(f, done.round_of(f).accepted.held_score) for f in dict.fromkeys(done.found)]
        refits = [t.held_score for t in done.rounds[0].trials if t.names == (REFIT,)]
        left, first = (max(t.fit.held_square - 1, 0.0) for t in (done.last, start))
        rest = left / max(first, left, 1e-9)
        part, found = part_of_all(found, rest), of_all(found, rest)
        own = [r.sentence for r in self.off]
        so_far = f"Stopped before all was tried. So far: {lacking(found)}" if found else NOTHING
        effects = [f for f in found if f.effect != REFIT]
        missing = "ambiguous" if effects and effects[0].group else "effect_missing"
        return Diagnosis(
            verdict=missing if effects else "cannot_tell",
            sentence=" ".join([*own, so_far]),
            before=self.before,
            score_refit=min([start.held_score, *refits]),
            findings=found,
            ranking=[],
            not_identifiable=[*self.unseen.items()],
            rest=Rest(part * rest, False, [], looked_at=False),
            late=None,
            search=done,
            opened=self.opened,
            modelled=[r.modelled for r in self.before.robots],
            steps=[(None, start.held_score), *steps],
            notes=[],
            next_experiment=None,
            robots_off=tuple(self.off),
        )


def stopped(diagnosis: Diagnosis, why: str) -> Diagnosis:
    """A diagnosis that is whole, of which what follows was stopped; why in a sentence."""
    diagnosis.search.stopped = True
    return replace(diagnosis, sentence=f"{why} So far: {diagnosis.sentence}")
