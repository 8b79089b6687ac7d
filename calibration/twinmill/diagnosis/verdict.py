# SPDX-License-Identifier: Apache-2.0
"""The verdict of a diagnosis, and its sentence: findings first, then what is left."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from twinmill.defaults import Verdict
from twinmill.diagnosis.apart import Apart, of_runs
from twinmill.diagnosis.finding import Finding, of_all, part_of_all
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.rest import FEW, MOMENTS, NOISE, WANDERS, Rest
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.ties import of_levels
from twinmill.diagnosis.trials import REFIT, REFIT_IN_WORDS
from twinmill.fitting.compare import GOOD, LACKING, MISSING

CHANGED = (
    "What changed between them is outside the catalogue: look at battery, load, wheels and floor."
)


@dataclass(frozen=True)
class VerdictInputs:
    """Scores, findings and rest that decide the verdict.

    Attributes:
        score: of the model as given, as `compare` has it, without robots that differ.
        first, refit, last: held-out scores: where the search started, with the base refitted, with
            what was found.
        hidden: effects that data of this kind could show, and these data do not.
        imitators: effects that would take what drifting gains took.
        noises: what was said of unusual noise.
        known: score that is no news: that of the model on the logs that it was fitted to.
        disturbed: what was said of stretches that are judged nowhere.
        random: the motion is so much less regular than the model says that something is there.
        drift: gains of the base that were far off, with the share of the squared error that they
            take beside what was found; None if they were not.
        disturbed_by: by how much at random, in words; empty if that is not told.
        unsteady: what the input tells of commands that act later from some time on, in sentences.
        apart: numbers in which robots or runs differ; None where one set does as well.
    """

    score: float
    first: float
    refit: float
    last: float
    findings: Sequence[Finding]
    rest: Rest
    hidden: Collection[str]
    imitators: Collection[str]
    noises: Sequence[str]
    known: float
    disturbed: Sequence[str] = ()
    random: bool = False
    unsteady: Sequence[str] = ()
    apart: Apart | None = None
    drift: Finding | None = None
    disturbed_by: str = ""

    @property
    def effects(self) -> list[Finding]:
        """Findings but for stale numbers of the base."""
        return [f for f in self.findings if f.effect != REFIT]

    @property
    def verdict(self) -> Verdict:
        """One of the verdicts that `Diagnosis.verdict` lists; runs that differ no effect makes."""
        return "outside_catalogue" if self._only_runs else self._within

    @property
    def _only_runs(self) -> bool:
        """Runs differ, and no effect is found beside that."""
        return of_runs(self.apart) and not self.effects

    @property
    def _within(self) -> Verdict:
        """The verdict on what is left beside numbers of each robot's or run's own."""
        if self._all_doubtful:
            return "model_adequate"
        if self._within_told:
            return "cannot_tell"
        outweighed = self._noise_outweighs or self._rest_outweighs or self._of_another_form
        if self.effects and not (outweighed or self._proven_instead):
            top = self.effects[0]
            return "ambiguous" if top.group else "effect_missing"
        if self._wanders:
            return "cannot_tell"
        if self._outside or self.rest.moments or (self.effects and self.score > MISSING):
            return "outside_catalogue"
        if self.random and (self.effects or self._unexplained):
            return "outside_catalogue"
        if self.effects:
            return "cannot_tell"
        if self._unexplained or self.noises:
            return "cannot_tell"
        enough = not (self.silent or self._instead or self._refit_leaves)
        if self._stale and enough:
            return "refit_enough"
        unsure = not enough or self.last > MISSING
        return "cannot_tell" if unsure else "model_adequate"

    @property
    def _all_doubtful(self) -> list[Finding]:
        """Effects of which none is beyond doubt, where the model as given misses nothing."""
        doubtful = all(f.certainty == "doubtful" for f in self.effects)
        passes = self.score <= GOOD  # as compare says
        well = passes and not (self.rest.depends_on or self.noises or self.silent)
        return self.effects if doubtful and well else []

    @property
    def _within_told(self) -> str:
        """Effects that are no more than what other logs told may be wrong by, where all are."""
        told = self.effects and all(f.within_told for f in self.effects)
        well = self.score <= SETTINGS.worse and not (self.rest.depends_on or self.noises)
        return " or ".join(f.effect for f in self.effects) if told and well else ""

    @property
    def _instead(self) -> list[str]:
        """Effects that would do what other numbers of the base did."""
        return [*dict.fromkeys([*self._rivals_of_refit, *(self.imitators if self._stale else ())])]

    @property
    def _rivals_of_refit(self) -> tuple[str, ...]:
        groups = [f.group[1:] for f in self.findings if f.effect == REFIT and f.group]
        return groups[0] if groups else ()

    @property
    def _stale(self) -> bool:
        """The base's numbers are: a finding, or gains that were let drift took the error."""
        drift = not of_runs(self.apart) and drifted(self.score, self.last, self.known)
        return bool(self.findings) or drift

    @property
    def _refit_leaves(self) -> bool:
        """The base's numbers were stale, and more is left than is usual."""
        return self._stale and self.last > GOOD * self.known

    @property
    def silent(self) -> list[str]:
        """Effects of the drive that only several levels of the command show, and these data do not.

        Without them a robot that is driven at other commands may do something else altogether.
        """
        levels = of_levels()
        return [n for n in self.hidden if n in levels]

    @property
    def _outside(self) -> bool:
        """Something is left that no effect takes: it depends on something, or it is much.

        Less is enough where the smooth response predicts much of it.
        """
        depends = bool(self.rest.again or self._continuous)
        return depends or self.last > (MISSING if self._firm else SETTINGS.worse) * self.known

    @property
    def _unexplained(self) -> bool:
        """More is left than is usual, and neither an effect nor a formula takes it."""
        return self.last > (GOOD if self._firm else MISSING) * self.known

    @property
    def _wanders(self) -> bool:
        """More is left than is usual, and it wanders by itself."""
        return bool(self.rest.by_itself) and self.last > GOOD * self.known

    @property
    def _size(self) -> str:
        """By how much what is left wanders by itself, after a comma; empty if that is not known."""
        words = self.rest.by_itself.words if self.rest.by_itself else ""
        return f", {words}" if words else ""

    @property
    def _firm(self) -> bool:
        """The smooth response predicts much of what is left."""
        return self.rest.firm and self.rest.share > SETTINGS.much_left

    @property
    def _noise_outweighs(self) -> bool:
        """The motion is far noisier than it was, and what was found takes little beside."""
        if not self.noises:
            return False
        with_base = sum(f.share for f in self.findings)
        return self._taken < 0.5 and with_base < SETTINGS.nearly_all

    @property
    def _of_another_form(self) -> bool:
        """Most of what was found stands for something else of another form, and no more is sure."""
        if any(f.certainty != "doubtful" and f.share > SETTINGS.much for f in self.effects):
            return False
        return sum(f.share for f in self.effects if f.wrong_form) > self._taken / 2

    @property
    def _rest_outweighs(self) -> bool:
        """No effect is beyond doubt, none takes nearly all, and much is left that is no noise."""
        if not all(f.certainty == "doubtful" for f in self.effects):
            return False
        if self._one_takes_all:
            return False
        if self._continuous and self.rest.share > SETTINGS.much:
            return True
        no_noise = self.rest.firm or self.rest.by_itself
        return bool(no_noise) and self.rest.share > min(self._taken, SETTINGS.much_left)

    @property
    def _proven_instead(self) -> Formula | None:
        """A formula that was proven in place of all effects that were found, all of them doubtful.

        It takes more than they do, on stretches that neither chose nor fitted it. Where one of them
        takes nearly all, the formula is another form of it.
        """
        proven = self.rest.proven
        if not (proven and self.effects) or self._one_takes_all:
            return None
        instead = all(
            f.certainty == "doubtful" and f.effect in proven.instead_of for f in self.effects
        )
        return proven if instead else None

    @property
    def _one_takes_all(self) -> bool:
        """One effect alone takes nearly all, and none of another form stands behind it."""
        return any(f.share >= SETTINGS.nearly_all and not f.wrong_form for f in self.effects)

    @property
    def _taken(self) -> float:
        """Share of the squared error that effects take."""
        return sum(f.share for f in self.effects)

    @property
    def sentence(self) -> str:
        """The verdict for people, after what the input and what robots or runs differ in."""
        apart = [self.apart.sentence] if self.apart else []
        apart += [CHANGED] if self._only_runs else []
        return " ".join([*self.unsteady, *apart, *self._refitted_first, self._own])

    @property
    def _refitted_first(self) -> list[str]:
        """Numbers of the base that took most before anything was looked for, if something is left.

        No finding says so, as the base's numbers are let drift.
        """
        told = len(self.effects) < len(self.findings) or not (self.effects or self._unexplained)
        known = told or not drifted(self.score, self.first, self.known)
        if known or not (self.drift and self.drift.share > 1 / 2):
            return []
        return [
            f"The base model's numbers were stale, and were refitted first: {_values(self.drift)} "
            f"take {self.drift.takes} of the squared error. Shares are of what they leave."
        ]

    @property
    def _nothing(self) -> str:
        if self._only_runs:
            return "Within each run nothing"
        return "Nothing else" if self.unsteady or self.apart else "Nothing"

    @property
    def _own(self) -> str:
        """Verdict without the words that stand before it."""
        verdict = self._within
        if verdict == "model_adequate":
            maybe = " or ".join(f.effect for f in self._all_doubtful)
            there = f" {maybe} may be there, and is too small to be sure." if maybe else ""
            apart = " Stretches unlike all the rest are left out." if self.disturbed else ""
            shown = f"{self._nothing} is missing that these logs would show.{apart}"
            return f"{shown}{there}{self._as_before}"
        if verdict == "cannot_tell" and self._within_told:
            return (
                "The model misses by no more than speeds may be wrong by that another log told; "
                f"{self._within_told} may be there, and is too small to be sure."
            )
        if verdict == "cannot_tell" and self._wanders:
            return self._by_itself
        if verdict == "cannot_tell" and self.effects:
            names = " or ".join(f.effect for f in self.effects)
            return (
                f"The model misses by a little more than the noise (score {self.score:.2f}); "
                f"{names} may be there, or something of another form."
            )
        if verdict == "cannot_tell" and self._unexplained:
            misses = f"the model misses by more than the noise (score {self.last:.2f})"
            if self.unsteady:
                return (
                    f"That may be why {misses}: no effect and no formula that was tried takes it."
                )
            return (
                f"{misses[0].upper()}{misses[1:]}, and these logs do not tell why: no effect and "
                f"no formula that was tried takes it.{self._most_likely}"
            )
        if verdict == "cannot_tell" and self.random:
            return self._at_random
        if verdict == "cannot_tell" and self.noises:
            random = self.rest.by_itself and not self.rest.depends_on
            by_itself = f": it wanders by itself{self._size}."
            why = by_itself if random else ", and these logs do not tell why."
            return (
                "Nothing was found that follows from the commands, but the motion is far less "
                f"regular than the model file says{why}"
            )
        if verdict == "cannot_tell" and self.last > MISSING:
            return f"{self._nothing} new is missing that these logs would show.{self._as_before}"
        if verdict == "cannot_tell":
            seen = (
                "The base model's numbers were stale, and a refit takes the error away"
                if self._stale
                else f"{self._nothing} is missing that these logs would show"
            )
            if self._instead:
                return (
                    f"{seen}; so would {' or '.join(self._instead)}, and these logs cannot tell "
                    "them apart."
                )
            if not self.silent:
                return (
                    "The base model's numbers were stale, and a refit takes most of the error away."
                    f"{self._as_before}"
                )
            return f"{seen}, but these logs cannot show {', '.join(self.silent)}."
        if verdict == "refit_enough" and self.apart:
            return f"No effect is missing beside that.{self._as_before}"
        if verdict == "refit_enough":
            effect = "No other effect" if self.unsteady else "No effect"
            stale = next((f for f in self.findings if f.effect == REFIT), self.drift)
            values = f" ({_values(stale)})" if stale else ""
            return (
                f"{effect} is missing; the base model's numbers were stale{values}, and a refit is "
                f"enough.{self._as_before}"
            )
        if verdict in ("effect_missing", "ambiguous"):
            return f"{lacking(of_all(self.findings, self.rest.share))}{self._left}"
        return self._outside_sentence

    @property
    def _at_random(self) -> str:
        """The model leaves no more than what is random, of which there is more than it says."""
        almost = "" if self.last <= GOOD else "almost "
        words = self.disturbed_by or self._size.removeprefix(", ")
        by = f" {words}," if words else ""
        on = f"depends most likely on {' or '.join(self.rest.depends_on)}"
        if_any = f" If that depends on anything, it {on}." if self.rest.depends_on else ""
        return (
            f"The model predicts {almost}as well as these logs allow, but the motion is disturbed "
            f"at random,{by} far more than the model file says. {self._nothing} is missing that "
            f"these logs would show.{if_any}"
        )

    @property
    def _by_itself(self) -> str:
        """The model leaves more than the noise, and that is random, or may be."""
        maybe = " or ".join(_plain(f) for f in self.findings)
        part = f" Part of it may be {maybe}." if maybe else ""
        if self.rest.depends_on:
            return (
                f"The model misses by more than the noise (score {self.last:.2f}), and what is "
                f"left depends {self.rest.on}. By the same commands once more only what wanders "
                f"would be otherwise.{part}"
            )
        return (
            f"The model misses by more than the noise (score {self.last:.2f}), and what is left is "
            f"random: it wanders by itself{self._size}. No formula of the commands, place or time "
            f"that was tried explains it.{part}"
        )

    @property
    def _as_before(self) -> str:
        """Sentence for errors as small as those in the logs that the model was fitted to."""
        if self.last <= GOOD:
            return ""
        if self.rest.by_itself:
            may = "may wander" if self.rest.depends_on else "wanders"
            return f" What is left (score {self.last:.2f}) {may} by itself{self._size}."
        if self.last > SETTINGS.news * self.known:
            return (
                f" The model misses by a little more than the noise (score {self.last:.2f}): more "
                "of these drives would tell why."
            )
        return (
            " The model misses as it did on the logs that it was fitted to (score "
            f"{self.last:.2f}, there {self.known:.2f}): explain those first."
        )

    @property
    def _most_likely(self) -> str:
        """On what something depends of which nothing else is known."""
        return f" It depends {self.rest.on}." if self.rest.likely else ""

    @property
    def _left(self) -> str:
        """Sentence on the rest, where it is more than the noise."""
        events = f" {self.rest.events.sentence}".rstrip()
        if self.last <= GOOD or self.rest.share < SETTINGS.nothing_left:
            return events
        on = self.rest.on
        depends = f", and depends {on}" if on else ""
        share = f"{100 * part_of_all(self.findings, self.rest.share) * self.rest.share:.0f} %"
        if self.rest.certainty == WANDERS:
            return f" {share} is left, which seems to wander by itself{self._size}.{events}"
        if not on and self.rest.certainty == NOISE:
            return f" {share} is left, which may be noise.{events}"
        if not on and self.rest.certainty == FEW:
            return (
                f" {share} is left, well above the noise, but in too few stretches of these logs "
                f"to tell what it is.{events}"
            )
        return (
            f" Something else is left: {share} of the squared error above the noise{depends}; no "
            f"effect of the catalogue takes it.{events}"
        )

    @property
    def _continuous(self) -> list[str]:
        """Lasting dependences of the rest; none where several may be it, or none is."""
        names = [name for name in self.rest.depends_on if name != MOMENTS]
        none = len(names) > 1 or self.rest.wanders
        return [] if self.rest.likely and none else names

    @property
    def _outside_sentence(self) -> str:
        events, on = self.rest.events.sentence, self.rest.on
        if events and not (self._outside or on):
            alone = ", or at changes of the command" if self.rest.events.at_changes else " alone"
            return f"What is missing acts at single moments{alone}. {events}"
        proven = self._proven_instead
        named = [] if proven else [_plain(f) for f in self.effects]
        named += ["a refit of the base"] if len(self.effects) < len(self.findings) else []
        also = f" Part of it is explained by {' and '.join(named)}." if named else ""
        if proven:
            own = of_all(self.findings, self.rest.share)
            effects = [_named(f) for f in own if f.effect != REFIT]
            also += f" It was found in place of {_in_turn(effects)}."
        is_told = self.rest.depends_on and not self.rest.likely
        taken = sum(f.share for f in self.findings) > self.rest.share
        if self.noises and not (events or is_told or self.rest.firm or taken):
            what = "Something random disturbs the motion that no effect of the catalogue describes."
            return f"{what}{self._most_likely}{also}"
        by_itself = "it wanders by itself, or " if self.rest.wanders else ""
        depends = f"it depends {on}" if on else f"{by_itself}no formula that was tried describes it"
        what = f": {proven.equals}" if proven else ""
        if taken and named and not proven:
            most = _in_turn([_named(f) for f in of_all(self.findings, self.rest.share)])
            return (
                f"Most of the squared error is taken by {most}. Something outside the catalogue is "
                f"left; {depends}. {events}"
            ).rstrip()
        return f"Something outside the catalogue is there{what}; {depends}.{also} {events}".rstrip()

    @property
    def notes(self) -> list[str]:
        """Sentences on doubts, and on what was left before."""
        whys = dict.fromkeys(f.why for f in self.findings if f.why)
        doubts = [
            f"Doubtful ({', '.join(_plain(f) for f in self.findings if f.why == why)}): {why}."
            for why in whys
        ]
        if self.rest.again:
            doubts.append(
                f"At least {100 * self.rest.again:.0f} % of the squared error of way in half a "
                "second comes again where the robot comes by again: the floor is not the same "
                "everywhere. No score shows it, since no command tells it."
            )
        old = self.rest.old
        if old:
            doubts.append(
                f"What still depends on {' and '.join(old)} was left by this model before, in the "
                "log that it was fitted to."
            )
        return doubts


def drifted(score: float, last: float, known: float) -> bool:
    """True if gains that were let drift took the error.

    Args:
        score: of the model as given.
        last: held out, with drifted gains and what was found.
        known: that is no news.
    """
    return score > GOOD * known and last < SETTINGS.drifted * score


def lacking(findings: Sequence[Finding]) -> str:
    """Lack of a model, in a sentence."""
    return f"{LACKING}{_in_turn([_named(f) for f in findings])}."


def _in_turn(names: list[str]) -> str:
    """`a`, `a and b`, or `a; b; and c`: names may hold commas."""
    if len(names) < 3:
        return " and ".join(names)
    return "; ".join([*names[:-1], f"and {names[-1]}"])


def _plain(finding: Finding) -> str:
    """A finding's name for people."""
    return REFIT_IN_WORDS if finding.effect == REFIT else finding.effect


def _named(finding: Finding) -> str:
    """A finding in the sentence, with what it takes."""
    takes = finding.takes
    if finding.effect == REFIT:
        values = _values(finding)
        instead = f", or {' or '.join(finding.group[1:])} instead" if finding.group else ""
        share = f"; {takes}" if finding.share >= 0.005 else ""  # else robots' own gains took it
        doubt = ", doubtful" if finding.certainty == "doubtful" else ""
        return f"{REFIT_IN_WORDS} ({values}{share}{doubt}){instead}"
    name = f"{finding.effect} beside the model's own" if finding.again else finding.effect
    if finding.group:
        name = f"one of {' or '.join(finding.group)}, which these logs cannot tell apart"
    doubt = ", doubtful" if finding.certainty == "doubtful" else ""
    beside = f"; {finding.beside}" if finding.beside else ""
    return f"{name} ({takes}{doubt}{beside})"


def _values(stale: Finding) -> str:
    """The numbers of the base that moved most, as far as a sentence holds them."""
    return ", ".join(f"{e.short} {e.value:.3g}{e.of_unit}" for e in stale.parameters[:3])
