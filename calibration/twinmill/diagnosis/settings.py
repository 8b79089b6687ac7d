# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide a diagnosis, in one record: reports and JSON output print it.

A step that needs another number to be quick or exact (a grid, a count of random signs) keeps it to
itself; here is what moves a verdict. Those of the noise floor stand in `fitting/settings.py`, those
of the checks of the input in `data/checks/settings.py`.
"""

from dataclasses import dataclass, replace

from twinmill.settings import Numbers, number


@dataclass(frozen=True)
class Settings(Numbers):
    """Thresholds of the diagnosis; scores are over the noise floor, where 1.0 is right."""

    # The search: which effect is accepted.
    starts: int = number(3000, "predictions; of more, every Nth start is looked at ...")
    few_starts: int = number(300, "the same where hundreds of things are tried ...")
    starts_apart_s: float = number(1.0, "... but starts are no further apart, s")
    evidence: float = number(16.0, "least fall of the held-out cost (-2 log likelihood)")
    passing: float = number(30.0, "the same of an effect of a while, which is fitted to all of it")
    without_best: float = number(8.0, "the same without the block with the most evidence")
    lasts: float = number(0.3, "share of it without the best 3 s, if an effect is of a while")
    without_visit: float = number(4.0, "the same of an effect of a place, seen at visits alone")
    drowned: float = number(1.15, "score from which on what else is missing drowns evidence ...")
    less_evidence: float = number(9.0, "... so that this much is enough ...")
    blocks_t: float = number(3.7, "... if blocks agree: t of the relative fall over blocks")
    worth: float = number(0.01, "least share of the first excess that an effect takes ...")
    enough: float = number(0.1, "... or this fall of the squared score, if that is less")
    below: float = number(0.1, "the same share once the score is below 1 ...")
    least_below: float = number(0.2, "... but so much of the squared score at least ...")
    most_below: float = number(0.5, "... and at most")
    strong: float = number(1.5, "times the evidence with which less is enough below 1 ...")
    least_strong: float = number(0.08, "... namely this share of the squared score")
    fitted: int = number(7, "candidates that are fitted in each round")
    pairs: int = number(3, "pairs that are tried where no single candidate is accepted")
    most: int = number(6, "rounds")
    rival: float = number(0.7, "share of an effect's promise, with which another may replace it")
    exchanged: int = number(3, "most of these that are fitted, for each effect")
    usual: float = number(1.5, "times the evidence where the known score is no worse")
    strictest: float = number(3.0, "the evidence is raised at most so many times")
    common: float = number(1.01, "times a score: no worse")
    news: float = number(1.1, "times the known score: less is no news")
    traced: float = number(3.0, "times its usual strength, at which an effect must show ...")
    faint: float = number(16.0, "... by this fall of the cost, or these logs cannot show it")
    bits: float = number(0.005, "share of detections that an effect of the camera changes ...")
    bits_in_view: float = number(0.02, "... or of those with a robot in view, or without")
    late_s: float = number(0.025, "delay of a camera that may be a clock offset, s")
    drift_std: float = number(0.04, "by which gains wander with battery and heat: share of them")

    # What stands in one group.
    alike: float = number(0.95, "canonical correlation of signatures from which two are one")
    unlike: float = number(0.3, "cosine of what two take, up to which they explain other things")
    tie: float = number(6.0, "difference of the held-out cost that decides nothing")
    as_good: float = number(0.7, "share of its evidence that another brings that leaves nothing")
    each: float = number(2.0, "what a fitted number costs where candidates are compared")
    imitates: float = number(0.95, "share of what the base takes, that another answer takes")
    group: int = number(4, "most members of a group")
    misses: float = number(1.5, "score of a final model whose errors are not noise")
    outdoes: float = number(1.15, "a formula outdoes an effect that takes so many times more ...")
    outdoes_by: float = number(6.0, "... and so much more of the cost ...")
    kept: float = number(0.5, "... unless the effect keeps this share beside the formula ...")
    nothing_beside: float = number(0.05, "... and if it keeps no more than this, it is doubtful")

    # Doubts.
    within: float = number(2.0, "standard deviations: what differs by less is an error")
    stated_lag: float = number(0.05, "standard deviation of a motor lag that no log told, a share")
    told_lag: float = number(0.15, "share of a robot's lateness by which it may be off as well")
    told_speeds: float = number(0.015, "share of the way by which speeds of another log may be off")
    same_way: float = number(0.1, "... and share of a bend's own change: two such bends are one")
    beyond: float = number(3.0, "usual sizes, or standard deviations at a bound: too far ...")
    near: float = number(0.5, "... if another leaves less than this more of the squared score")
    weighty: float = number(0.1, "share of the loudest visit that another must bring to count")
    away_s: float = number(2.0, "s between two visits of a place")
    again_m: float = number(0.1, "from a place that it comes by again ...")
    comes_by: float = number(0.25, "... on less of its way a loss may be of that place")
    rim: float = number(0.15, "... of its middle: so much of its while on either side may be off")
    other_commands: float = number(0.3, "of the time, that commands beyond 95 % of the others last")
    undone: float = number(0.35, "cosine against each other of what two effects do")
    of_a_kind: int = number(3, "effects of a kind, or all doubtful, which are one of another form")
    slight: float = number(0.3, "share of what is left that a second finding must take")
    much_left: float = number(0.3, "share left, beyond which no name is sure")
    lag_leaves: float = number(0.12, "share left, beyond which no lag is sure")
    wheel_leaves: float = number(
        0.05, "the same of a weak wheel or a marker aside, if it depends on what these cannot do"
    )
    no_right_model: float = number(1.15, "score beyond which no name is sure ...")
    left_by_right: float = number(0.04, "... if so large a share is left that depends on nothing")
    form_takes: float = number(0.15, "share of what is left, by which a finding has another form")
    nearly_all: float = number(0.85, "... beyond which share it is still the same physics")
    same: float = number(0.8, "cosine of what two take, from which they take the same errors ...")
    same_fall: float = number(0.85, "... if one takes this share of what the other takes")
    same_in_time: float = number(0.7, "the same cosine of a loss from a moment on and of heat ...")
    same_at_bound: float = number(0.5, "... which at its bound need take this share alone")
    nothing: float = number(0.01, "chance of such sizes if there were no effect")
    companion_evidence: float = number(9.0, "fall of the cost if a size changed with the drive")
    companion_t: float = number(3.0, "the same over blocks: standard errors from zero")
    companion_change: float = number(0.15, "least change of the size per standard deviation")
    other_form: float = number(
        0.25, "the same change, from which there is something of another form"
    )
    one_heading: float = number(0.9, "mean direction of headings, beyond which they are one")

    # What is left.
    nothing_left: float = number(0.02, "share of the first excess: where less is left, nothing is")
    level: float = number(1.03, "score up to which nothing is left that could depend on anything")
    dependence_chance: float = number(0.01, "that a dependence is named where nothing is left")
    beside: float = number(0.1, "by which a dependence must raise what better ones take ...")
    as_much: float = number(0.9, "... unless it takes this share of what the best one takes")
    likely: float = number(
        9.0, "fall of the cost from which the best dependences are likely, if something is left"
    )
    again: float = number(2.0, "times what the model left in other logs: less is no news")
    likely_ones: int = number(3, "dependences that are named where none is beyond chance, at most")
    formula_chance: float = number(0.02, "that a formula is offered where nothing is left ...")
    formula_takes: float = number(0.1, "... and its least share of that on the other half")
    formula_again: float = number(0.5, "share of resamplings in which its dependence must win")
    formula_alike: float = number(0.05, "share of the gain that a simpler formula may lack")
    formula_beside: float = number(0.1, "share of the gain that one more term must add")
    formula_goes_on: float = number(
        0.5, "share of its gain on the last 40 % of a log that the first 60 % must predict"
    )
    formula_back: float = number(
        0.25, "share of the usual speed at which a formula of that speed may drive back"
    )
    answered: float = number(1.7, "score up to which answers of a controller may be all")
    no_noise: float = number(
        1.5, "errors of so many times the noise are none, however few there are"
    )
    firm_t: float = number(3.0, "t over blocks: the smooth response predicts better ...")
    firm_fall: float = number(0.2, "... or it does by this share of both squares ...")
    firm_blocks: int = number(
        3, "... in so many blocks, and in so many times more than where it is as much worse"
    )
    far: float = number(6.0, "times the median squared error: a single moment ...")
    several: int = number(4, "... of which so many are no accident")
    place_chance: float = number(0.01, "that errors repeat so at a place, of the model ...")
    place_chance_of_floor: float = number(0.05, "... and of the smooth response, too ...")
    place_share: float = number(0.1, "... if this share of their square repeats")

    # Robots that differ.
    fewest_robots: int = number(3, "robots below which none is called different")
    odd: float = number(3.5, "robust standard deviations from the median")
    odd_evidence: float = number(16.0, "least fall of the held-out cost, for one robot")
    odd_chance: float = number(0.005, "that one of robots that are alike is called different")
    spread: float = number(0.01, "by which robots of a kind differ at least")
    spread_of_effects: float = number(
        0.03, "by which they differ at least in an effect, of its usual size"
    )
    camera_spread: float = number(
        0.1, "scatter of the logarithm of errors among cameras that are alike, over all frames ..."
    )
    camera_spread_in_view: float = number(0.2, "... and over frames with a robot in view")
    resolved: float = number(4.0, "standard errors, from which a robot's difference would be seen")
    within_runs: float = number(
        0.25, "share of the excess that is left within runs, if they are told to differ ..."
    )
    within_two_runs: float = number(0.05, "... or within two, of which numbers take more by chance")
    noisy: float = number(4.0, "times the sensor noise of the others, from which it is said")

    # The verdict.
    drifted: float = number(0.85, "share of the score that drifting gains leave, if stale")
    much: float = number(0.1, "share of the squared error that is much")
    worse: float = number(1.5, "score over the usual one, beyond which it is a finding")
    irregular: float = number(2.2, "noise floor over the model's noise, which is said ...")
    random: float = number(3.0, "... and from which something random is there that was not ...")
    random_alone: float = number(4.5, "... and the same at a score at which nothing is left")

    def stricter(self, times: float) -> "Settings":
        """Settings that require so many times the evidence."""
        times = min(max(times, 1.0), self.strictest)
        raised = ("evidence", "passing", "without_best", "without_visit", "less_evidence")
        return replace(self, **{k: times * getattr(self, k) for k in raised})


SETTINGS = Settings()
