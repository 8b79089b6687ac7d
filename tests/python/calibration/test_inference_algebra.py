# SPDX-License-Identifier: Apache-2.0
"""Noise, evidence and prior odds of the inference against dense algebra and other libraries."""

from dataclasses import replace
from itertools import product
from math import comb, log
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import block_diag, toeplitz
from scipy.special import logsumexp
from scipy.stats import expon, multivariate_normal, norm

from twinmill.inference import formal, hidden, lasting, moments
from twinmill.inference.answer import Named, verdict_of
from twinmill.inference.candidate import Candidate
from twinmill.inference.discrepancy import (
    OF_FORM,
    SIZES,
    STEP,
    _way_since_back,
    forms_of,
    in_another_log,
    kernels,
    way_aside,
)
from twinmill.inference.evidence import Bank, Linear, gains_by_size
from twinmill.inference.hypothesis import Hypothesis
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Course, Noise, Usual, fit_noise, usual_after
from twinmill.inference.planar import planar_kinds
from twinmill.inference.posterior import beliefs
from twinmill.inference.robots import _log_before, _Robot
from twinmill.inference.screening import _products, _products_of_whiles, gains_of_pairs
from twinmill.inference.search import log_prior_of_effects
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion
from twinmill.inference.table import Entry, NoNews, Table, swells_once
from twinmill.model.parameters import Parameter

STEP_S = 0.1


def dense_covariance(sensor, drive, gain, memory_s, pace):
    """Covariance of e = AR(1) disturbance + differences of white noise, by the definition.

    Each push of the disturbance is as large as the pace of its step makes it.
    """
    a, count = np.exp(-STEP_S / memory_s), len(pace)
    push = np.sqrt(drive**2 + gain**2 * pace**2) * np.r_[1, np.full(count - 1, np.sqrt(1 - a**2))]
    response = toeplitz(a ** np.arange(count), np.zeros(count)) * push
    difference = np.zeros(count)
    difference[:2] = 2 * sensor**2, -(sensor**2)
    return response @ response.T + toeplitz(difference)


@pytest.mark.parametrize(
    "sensor, drive, gain, memory_s",
    [(3e-4, 5e-4, 1e-6, 0.15), (2e-3, 1e-3, 2e-3, 0.5), (1e-4, 1e-4, 3e-3, 1.0)],
)
def test_whitened_errors_have_the_likelihood_of_the_dense_covariance(sensor, drive, gain, memory_s):
    """Two stretches of a robot that stands, drives and hurries; they know nothing of each other."""
    random = np.random.default_rng(1)
    stretches, count = [slice(0, 150), slice(150, 400)], 400
    pace = np.abs(random.normal(size=count)) * (random.random(count) > 0.3)
    covariance = block_diag(
        *(dense_covariance(sensor, drive, gain, memory_s, pace[part]) for part in stretches)
    )
    rows = np.zeros((count, 3))
    rows[:, 0] = random.multivariate_normal(np.zeros(count), covariance)
    course = Course(STEP_S, stretches, pace)
    noise = Noise(*(np.full(3, size) for size in (sensor, drive, gain, memory_s)), course)
    white = noise.whiten(rows)[:count]
    ours = -0.5 * white @ white - noise.log_sizes(np.array([True, False, False])).sum()
    ours -= 0.5 * count * np.log(2 * np.pi)
    exact = multivariate_normal(np.zeros(count), covariance).logpdf(rows[:, 0])
    assert ours == pytest.approx(exact, abs=1e-6)


def test_the_size_of_a_wander_in_a_later_log_is_that_of_its_own_give_or_take_what_drifts():
    """Sizes drawn as the docstring says, and counted."""
    random, half = np.random.default_rng(4), np.log(STEP)
    for k, size in enumerate(SIZES):
        own = np.log(size) + random.uniform(-half, half, 40_000)
        later = own + PRIORS.sheet * random.normal(size=len(own))
        bins = np.abs(later[:, None] - np.log(SIZES)) < half
        assert in_another_log(0.7 * np.eye(4)[k]) == pytest.approx(
            0.7 * bins.mean(axis=0), abs=0.02
        )


def test_a_noise_is_known_as_well_as_many_logs_of_it_scatter():
    """Fits to forty series of the dense covariance, against the spread that one of them tells."""
    count, logs = 600, np.log([1e-3, 1e-3, 2e-3, 0.4])
    random = np.random.default_rng(5)
    pace = np.abs(random.normal(size=count)) * (random.random(count) > 0.4)
    covariance = dense_covariance(*np.exp(logs), pace)
    noise = Noise(*np.exp(logs)[:, None], Course(STEP_S, [slice(0, count)], pace))
    none, usual = np.zeros((0, count, 1)), Usual.about(noise)
    errors = random.multivariate_normal(np.zeros(count), covariance, size=40)[..., None]
    found = np.array([fit_noise(one, none, noise, usual).logs[:, 0] for one in errors])
    of_one = [
        usual_after(one, none, fit_noise(one, none, noise, usual)).cov[0] for one in errors[:5]
    ]
    told = np.mean([np.diag(cov) for cov in of_one], axis=0) - PRIORS.sheet**2
    assert np.sqrt(told) == pytest.approx(found.std(axis=0), rel=0.5)


def test_a_noise_is_news_where_it_left_what_is_usual():
    usual = Usual(np.zeros((4, 1)), 0.04 * np.eye(4)[None])

    def growth(log_size):
        logs = np.array([0.0, 0.0, log_size, 0.0])
        noise = Noise(*np.exp(logs)[:, None], Course(STEP_S, [], np.zeros(0)))
        by_scipy = [
            multivariate_normal(np.zeros(4), cov * np.eye(4)).logpdf(logs) for cov in (1.04, 0.04)
        ]
        assert usual.log_growth(noise) == pytest.approx(by_scipy[0] - by_scipy[1])
        return usual.log_growth(noise)

    assert growth(0.1) < growth(-0.6) < 0 < growth(1.0)


def test_evidence_is_that_of_the_marginal_normal_distribution():
    random = np.random.default_rng(2)
    y, x, f = random.normal(size=40), random.normal(size=(5, 40)), random.normal(size=(3, 40))

    def dense(columns):
        return multivariate_normal(np.zeros(40), np.eye(40) + columns.T @ columns).logpdf(y)

    constant = -0.5 * 40 * np.log(2 * np.pi)
    linear = Linear.of(y, x)
    assert linear.log_evidence + constant == pytest.approx(dense(x))
    gains, _ = gains_by_size(*linear.projected(f, f @ f.T), SIZES)
    for gain, size in zip(gains, SIZES, strict=True):
        both = dense(np.concatenate([x, size * f]))
        assert gain == pytest.approx(both - dense(x))
    more = linear.with_columns(f)
    both = np.concatenate([x, f])
    normal = both @ both.T + np.eye(8)
    assert more.mean == pytest.approx(np.linalg.solve(normal, both @ y))
    assert more.residuals == pytest.approx(y - np.linalg.solve(normal, both @ y) @ both)
    assert more.covariance == pytest.approx(np.linalg.inv(normal))


def test_evidence_of_huge_columns_that_are_nearly_alike_is_that_of_their_singular_values():
    """An effect near which the motion is unstable has such slopes."""
    random = np.random.default_rng(3)
    y, one, other = random.normal(size=(3, 60))
    x = 1e9 * np.array([one, one + 1e-9 * other])
    _, sizes, ways = np.linalg.svd(x, full_matrices=False)
    along = ways @ y
    left = y @ y - np.sum(along**2 * sizes**2 / (1 + sizes**2))
    wanted = -left / 2 - np.log1p(sizes**2).sum() / 2
    assert Linear.of(y, x).log_evidence == pytest.approx(wanted, rel=1e-6)


def test_chances_of_all_sets_of_moments_add_up_to_one():
    for rate in (Rate(), Rate(0.1), Rate(0.3, 2.0, 50.0)):
        on = np.arange(13)
        sets = [log(comb(12, k)) for k in on]
        assert logsumexp(rate.log_chance(on, 12) + sets) == pytest.approx(0, abs=1e-9)


def test_two_moments_of_a_shift_are_found_and_no_third():
    """White errors of unit size, shifted in bins 4 and 20 to 21 of thirty bins of five rows."""
    random = np.random.default_rng(3)
    y = random.normal(size=150)
    white = np.zeros((31, 4, 150))
    for b in range(31):
        white[b, 0, : 5 * b] = 8.0
    y[20:25] += 8.0
    y[100:110] -= 8.0
    flat = white.reshape(31 * 4, -1)
    found = moments.find(Linear.of(y, np.zeros((1, 150))), Bank(white), flat @ flat.T, 1.5)
    on = found.on[: found.likeliest(Rate())]
    assert {(m.begin, m.end) for m in on} == {(4, 5), (20, 22)}
    assert found.after(0.05).there > 0.95
    quiet = moments.find(Linear.of(random.normal(size=150), np.zeros((1, 150))), Bank(white),
                         flat @ flat.T, 1.5)  # fmt: skip
    assert quiet.after(0.05).there < 0.05


def test_the_gain_of_moments_is_that_of_their_columns():
    """The greedy search adds up to the evidence with all columns at once."""
    random = np.random.default_rng(5)
    white = random.normal(size=(31, 4, 150)).cumsum(axis=0)
    flat = white.reshape(31 * 4, -1)
    y = random.normal(size=150) + 3 * (white[8, 1] - white[6, 1]) + white[20, 3] - white[19, 3]
    linear = Linear.of(y, random.normal(size=(2, 150)))
    found = moments.find(linear, Bank(white), flat @ flat.T, 1.5)
    assert len(found.on) >= 2
    together = linear.with_columns(np.concatenate([m.white for m in found.on]))
    gain = together.log_evidence - linear.log_evidence
    assert found.gains[-1] == pytest.approx(gain)


def motion(count=300):
    random = np.random.default_rng(4)
    moved = random.normal(size=(count, 3)) * (0.02, 0.02, 0.1)
    return Motion(
        moved, moved, np.arange(count) * STEP_S, np.full(count, STEP_S),
        random.uniform(-1, 1, size=(count, 2)), random.uniform(-np.pi, np.pi, count),
        np.sqrt((moved**2).mean(axis=0)), np.array([0.06, 0.06, 0.3, 0.08, 0.3]),
    )  # fmt: skip


@pytest.mark.parametrize("word", ["time", "place", "heading"])
def test_a_gain_kernel_of_size_one_is_a_gain_error_of_one(word):
    """The prior variance of the gain, averaged over the log, is one: that is what a size means."""
    m = motion()
    gains = [k for k in kernels(m) if k.depends_on == word and "gain" in k.name]
    assert len(gains) >= 3
    for k in gains:
        moves = np.abs(k.columns).max(axis=0) > 0
        variance = np.sum(k.columns**2, axis=0)[moves] / m.moved[moves] ** 2
        assert variance.mean() == pytest.approx(1, rel=0.15), k.name


def test_what_two_effects_gain_together_is_the_evidence_of_their_columns():
    """Two columns that nearly cancel gain little alone, and much together."""
    random = np.random.default_rng(6)
    base, first, third = random.normal(size=(3, 80))
    second = -first + 0.05 * random.normal(size=80)
    white = {"a": 3 * first[None], "b": 3 * second[None], "c": np.array([third, third**2])}
    linear = Linear.of(4.0 * (white["a"] + white["b"])[0] + random.normal(size=80), base[None])
    found = gains_of_pairs(linear, white)
    for (a, b), gain in found.items():
        both = linear.with_columns(np.concatenate([white[a], white[b]]))
        assert gain == pytest.approx(both.log_evidence - linear.log_evidence)
    assert max(found, key=found.__getitem__) == ("a", "b")


def test_products_of_whiles_are_those_of_their_columns():
    random = np.random.default_rng(8)
    white, base, y = (random.normal(size=s) for s in ((5, 2, 60), (3, 60), 60))
    ends, linear = np.array([(0, 2), (1, 4), (3, 4)]), Linear.of(y, base)
    whole = _products(white[ends[:, 0]] - white[ends[:, 1]], linear)
    for found, wanted in zip(_products_of_whiles(white, ends, linear), whole, strict=True):
        assert found == pytest.approx(wanted)


class OneAdded(Hypothesis):
    """Three numbers of a base, and one of an effect."""

    of_effects = property(lambda self: np.arange(4) == 3)


@pytest.mark.parametrize("low, high", [(-np.inf, np.inf), (0.0, 0.75)])
def test_always_there_against_new_is_the_ratio_of_the_joint_evidence_of_both_logs(
    monkeypatch, low, high
):
    """Two logs share a base; an effect within bounds is in both, or in the later one alone.

    The effect is integrated over by the trapezoidal rule, the base by its covariance.
    """
    monkeypatch.setattr(hidden, "PRIORS", replace(PRIORS, sheet=0.0))
    random = np.random.default_rng(11)
    own, later = random.normal(size=(4, 30)), random.normal(size=(4, 40))
    truth = np.array([0.3, -1.0, 0.5, 0.8])
    y_own, y_later = (truth @ x + random.normal(size=x.shape[1]) for x in (own, later))

    def joint(effect_in_own: bool) -> float:
        first = own * np.array([1, 1, 1, effect_in_own])[:, None]
        x = np.concatenate([first, later], axis=1)
        of_base = multivariate_normal(cov=x[:3].T @ x[:3] + np.eye(x.shape[1]))
        size = np.linspace(*np.clip([low, high], -9 * PRIORS.size, 9 * PRIORS.size), 4001)
        left = np.r_[y_own, y_later] - size[:, None] * x[3]
        prior = norm(0, PRIORS.size)
        log_density = prior.logpdf(size) - np.log(prior.cdf(high) - prior.cdf(low))
        weight = np.gradient(size) * np.where(np.isin(size, size[[0, -1]]), 0.5, 1)
        return logsumexp(log_density + of_base.logpdf(left), b=weight)

    def flat(rows: np.ndarray) -> np.ndarray:
        return rows.reshape(*rows.shape[:-2], -1)

    base = Linear.of(y_own, own[:3])
    parameter = Parameter("motor_lag.extra_s", "s", 1.0, -9.0, 9.0, 0.0, 1.0, 0.1)
    columns = {"motor_lag": Candidate("motor_lag", [parameter], own[None, 3:, :].swapaxes(1, 2))}
    told = hidden.Hidden.of(columns, base, flat, np.eye(3))
    prior = block_diag(base.covariance, PRIORS.size**2)
    h = OneAdded(
        effects=("motor_lag",),
        model=None,
        labels=("base.a", "base.b", "base.c", "motor_lag.extra_s"),
        named=np.ones(4, bool),
        mean=np.r_[base.mean, 0.0],
        cov=prior,
        low=np.r_[np.full(3, -np.inf), low],
        high=np.r_[np.full(3, np.inf), high],
        step=np.ones(4),
        value=np.zeros(4),
        grid={},
        slopes=later[:, :, None],
        errors=y_later[:, None],
    )
    always, log_factor = told.explained(h, ("motor_lag",), np.arange(3))
    none = np.zeros((0, y_later.size))
    fitter = SimpleNamespace(whiten=flat, always=none, gram_always=none @ none.T)
    there, new = (each.log_evidence(each.linear(fitter)) for each in (always, h))
    assert there + log_factor - new == pytest.approx(joint(True) - joint(False), abs=1e-5)


def test_a_dependence_that_was_always_there_is_told_by_the_joint_evidence_of_both_logs(monkeypatch):
    """Two logs share a base and the weights of a kernel; the gain is that in the later log."""
    monkeypatch.setattr(lasting, "PRIORS", replace(PRIORS, sheet=0.0))
    random = np.random.default_rng(12)
    own, later = random.normal(size=(5, 30)), random.normal(size=(5, 40))  # three of the base
    own[3:] *= 3
    truth = np.array([0.3, -1.0, 0.5, 0.2, -0.3])
    y_own, y_later = (truth @ x + random.normal(size=x.shape[1]) for x in (own, later))

    def log_density(y, x, size):
        scaled = x * np.r_[np.ones(3), np.full(2, size)][:, None]
        return multivariate_normal(cov=scaled.T @ scaled + np.eye(len(y))).logpdf(y)

    def of_later(size):
        both = np.r_[y_own, y_later], np.concatenate([own, later], axis=1)
        return log_density(*both, size) - log_density(y_own, own, size)

    base = Linear.of(y_own, own[:3])
    told = lasting.Lasting.of(np.ones(4), own[3:], base, np.eye(3))
    root = np.linalg.cholesky(base.covariance)
    known = Linear.of(y_later - base.mean @ later[:3], root.T @ later[:3])
    found = told.gains(known, told.columns(later[3:], later[:3]))
    assert found == pytest.approx([of_later(size) - of_later(0.0) for size in SIZES])


OF_TIME = ("battery_sag", "heat_gain", "abrupt_loss", "transient_loss")
OF_OTHERS = ("wheel_gain", "dead_zone", "motor_lag", "marker_offset", "floor_patch", "yaw_lag")


def table(entries, swells=()):
    """Evidence table for ten effects, four of which act with time."""
    kinds = planar_kinds()
    words = ("time", "place")
    return Table(entries, {}, {}, 1.0, OF_TIME + OF_OTHERS, words, {}, dict(swells), kinds)


def entry(effects, words, log_evidence, mimicked=None):
    mimicked = tuple(mimicked or [-np.inf] * (2 ** len(effects) - 1))
    blocks = np.full(6, log_evidence / 6)
    return Entry(effects, False, words, log_evidence, mimicked, blocks, 1.0)


def test_flat_evidence_leaves_the_prior_odds():
    """Nothing : one named effect : a dependence = (1 - q) : (1 - q) / 10 : q / 2, q = outside."""
    q = PRIORS.outside
    found = beliefs(
        table([entry((), (), 0), entry(("battery_sag",), (), 0), entry((), ("time",), 0)])
    )
    odds = np.array([b.probability for b in found])
    assert odds.sum() == pytest.approx(1)
    assert odds / odds[0] == pytest.approx([1, PRIORS.effects / 10, q / 2 / (1 - q)])


def test_where_no_name_is_sure_the_verdict_is_of_what_is_expected_to_take_most():
    """As docs/inference.md says: a name takes 0.4 of a half, what has no name more or less."""
    doubtful = Named("floor_patch", 0.4, ("floor_patch",), 0.4, "doubtful", 0.5, {})
    certain = replace(doubtful, probability=0.95, group_probability=0.95, certainty="sure")
    assert verdict_of(0.01, 0.19, [doubtful], refit=False) == "effect_missing"
    assert verdict_of(0.01, 0.21, [doubtful], refit=False) == "outside_catalogue"
    assert verdict_of(0.01, 0.99, [certain, doubtful], refit=False) == "effect_missing"
    assert verdict_of(0.01, 0.0, [], refit=False) == "outside_catalogue"
    assert verdict_of(0.4, 0.5, [], refit=False) == "cannot_tell"


def test_what_one_block_alone_speaks_for_is_less_sure():
    """Equal evidence in all blocks or in one: drawn again, the one is often absent."""
    even = np.full(8, 1.5)
    single = np.r_[12.0, np.zeros(7)]

    def sure(blocks):
        found = Entry(("battery_sag",), False, (), 12.0, (-np.inf,), blocks, 0.0)
        none = Entry((), False, (), 0.0, (), np.zeros(8), 0.0)
        return beliefs(table([none, found]))[1].probability

    assert sure(even) > 0.999
    assert sure(single) < 0.9


@pytest.mark.parametrize("effect, kin", [("battery_sag", 1 / 4), ("wheel_gain", 0)])
def test_an_unnamed_thing_looks_rather_like_an_effect_that_depends_on_the_same(effect, kin):
    """Odds of effect and mimic at the same evidence, by the prior that docs/inference.md states."""
    for density in (20, 1 / 20):
        entries = [entry((), (), -50), entry((effect,), ("time",), 0, [log(density)])]
        found = beliefs(table(entries))
        real, mimic = (sum(b.probability for b in found if c(b)) for c in
                       (lambda b: effect in b.effects, lambda b: effect in b.mimicked))  # fmt: skip
        alike = PRIORS.alike * kin + (1 - PRIORS.alike) / 10
        assert mimic / real == pytest.approx(density * alike / (PRIORS.effects / 10))


def test_an_error_of_formulas_has_the_evidence_of_its_own_prior():
    """Densities of all data at once, by SciPy: sizes are shares of what the others change."""
    random = np.random.default_rng(5)
    x, size = random.normal(size=(3, 40)), 2.0
    y = x.T @ [0.4, -0.3, 0.8] + random.normal(size=40)
    prior = np.array([0.5, 0.7, 1.1])  # standard deviations; the last two are of the effect
    h = SimpleNamespace(
        labels=("base.forward_gain", "lateral_slip.a", "lateral_slip.b"),
        mean=np.zeros(3), low=np.full(3, -np.inf), high=np.full(3, np.inf),
        cov=np.diag(prior**2), instance=lambda name: name,
    )  # fmt: skip
    linear = Linear.of(y, prior[:, None] * x)
    h.posterior = lambda own: (prior * own.mean, prior[:, None] * own.covariance * prior)

    def log_density(std):
        cov = np.eye(40) + (x.T * std**2) @ x
        return multivariate_normal(np.zeros(40), cov).logpdf(y)

    usual = np.linalg.norm(x[1:], axis=1) * np.sqrt(2)
    each = [
        log_density(np.r_[prior[0], (prior[1:] ** -2 + (usual / (s * size)) ** 2) ** -0.5])
        for s in SIZES
    ]
    expected = logsumexp(each, b=OF_FORM) - log_density(prior)
    found = formal.log_odds(h, linear, {"lateral_slip": size}, norms=np.linalg.norm(x, axis=1))
    assert found == pytest.approx(expected, abs=1e-8)


def test_an_error_that_looks_like_a_one_sided_effect_has_its_sign():
    """Half normal priors, integrated by SciPy; the data ask for the other sign."""
    random = np.random.default_rng(6)
    x, size = random.normal(size=(2, 40)), 2.0
    y = x.T @ [0.4, -0.5] + random.normal(size=40)
    prior = np.array([0.5, 0.7])
    h = SimpleNamespace(
        labels=("base.forward_gain", "stiction.a"),
        mean=np.zeros(2), low=np.array([-np.inf, 0.0]), high=np.full(2, np.inf),
        cov=np.diag(prior**2), instance=lambda name: name,
    )  # fmt: skip
    linear = Linear.of(y, prior[:, None] * x)
    h.posterior = lambda own: (prior * own.mean, prior[:, None] * own.covariance * prior)
    base = multivariate_normal(np.zeros(40), np.eye(40) + prior[0] ** 2 * np.outer(x[0], x[0]))

    def log_evidence(std):
        def density(value):
            return 2 * norm(0, std).pdf(value) * np.exp(base.logpdf(y - value * x[1]) + 60)

        return np.log(quad(density, 0, 8 * std, epsabs=0, epsrel=1e-10, limit=200)[0])

    usual = np.linalg.norm(x[1])
    each = [log_evidence((prior[1] ** -2 + (usual / (s * size)) ** 2) ** -0.5) for s in SIZES]
    expected = logsumexp(each, b=OF_FORM) - log_evidence(prior[1])
    found = formal.log_odds(h, linear, {"stiction": size}, norms=np.linalg.norm(x, axis=1))
    assert found == pytest.approx(expected, abs=1e-6)


def test_an_effect_that_an_error_of_formulas_may_be_is_less_probable():
    """Odds by the prior that docs/inference.md states: it is no further thing."""
    both, log_odds = ("battery_sag", "heat_gain"), -1.5
    entries = [entry((), (), -50), entry(both, (), 0)]
    plain = table(entries)
    known = replace(plain, no_news={both: [NoNews((), ("heat_gain",), ("time",), log_odds, 0.0)]})
    alone, two = (
        sum(b.probability for b in beliefs(known) if set(b.effects) == names)
        for names in ({"battery_sag"}, set(both))
    )
    assert alone / two == pytest.approx(  # one of four that depend on time, as the other does
        np.exp(log_odds) / 4 / (PRIORS.effects / 10 * PRIORS.further)
    )
    assert not any(len(b.effects) == 1 for b in beliefs(plain))


def test_what_a_formula_misses_changes_its_course_and_not_its_size():
    """Half more at each speed is the effect's own number; half more at top speed alone is not."""
    m = motion()
    change = m.moved * (0.1, 0.1, 0)
    way = (np.abs(m.moved) / m.top[:3]).max(axis=1)
    for columns in forms_of(change, m):
        assert np.tensordot(columns, change, 2) == pytest.approx(0, abs=1e-12)
    fast = forms_of(change, m)[0].reshape(7, -1)
    wanted = (np.interp(way, [0, 1], [0, 1])[:, None] * change).ravel()
    wanted -= wanted @ change.ravel() / np.sum(change**2) * change.ravel()
    weights = np.linalg.lstsq(fast.T, wanted, rcond=None)[0]
    assert fast.T @ weights == pytest.approx(wanted, abs=1e-12)


def test_chances_of_a_formulas_errors_are_those_of_an_exponential_distribution():
    """Each size stands for what is nearer to it than to the others, as a factor."""
    between = np.sqrt(SIZES[1:] * SIZES[:-1])
    each = expon(scale=PRIORS.form)
    assert list(OF_FORM[1:3]) == pytest.approx(list(np.diff(each.cdf(between))))
    assert 0.8 < OF_FORM.sum() < each.sf(SIZES[0] / STEP)


def test_a_heading_that_is_off_leads_the_way_aside():
    """A rotation by a small angle, seen from the body: to second order of the angle."""
    m, angle = motion(), 1e-4
    c, s = np.cos(angle), np.sin(angle)
    turned = m.moved @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    (led,) = way_aside(m, np.full((1, len(m.t_s)), angle))
    assert m.moved + led == pytest.approx(turned, abs=1e-9)


def test_way_since_it_was_driven_the_other_way():
    moved = np.array([0.0, 1.0, 2.0, 0.0, 3.0, -1.0, -1.0, 0.0, -2.0, 4.0])
    assert _way_since_back(moved).tolist() == [0, 0, 1, 3, 3, 0, 1, 2, 2, 0]


@pytest.mark.parametrize("effects", [("transient_loss", "abrupt_loss"), ("transient_loss",) * 2])
def test_what_changes_at_several_moments_depends_on_time(effects):
    names = tuple(f"{n}#2" if n in effects[:k] else n for k, n in enumerate(effects))
    several = next(b for b in beliefs(table([entry((), (), -50), entry(names, (), 0)])) if b.words)
    assert several.outside and several.words == ("time",)
    once = beliefs(table([entry((), (), -50), entry(effects[:1], (), 0)]))
    assert max(once, key=lambda b: b.probability).effects == effects[:1]


def test_steps_of_one_thing_are_that_thing():
    names = ("transient_loss", "abrupt_loss", "transient_loss#2")
    entries = [entry((), (), -50), entry(names, (), 0)]
    likely = max(beliefs(table(entries, {names: "abrupt_loss"})), key=lambda b: b.probability)
    assert likely.effects == ("abrupt_loss",)
    assert not likely.words


@pytest.mark.parametrize(
    "course, once",
    [
        ([1, 2, 1, 0], True),
        ([1, 2], True),  # and stays
        ([1, 2, 1], True),
        ([-1, -2, 0], True),
        ([1, 0, 1, 0], False),  # comes twice
        ([2, 1, 2, 0], False),  # and in between not wholly goes
        ([1, -2, 1, 0], False),  # a loss, a gain and a loss
    ],
)
def test_what_grows_once_and_falls_once_is_told_from_what_comes_again(course, once):
    changes = np.diff(course, prepend=0)
    steps = [(5.0 * k, float(change)) for k, change in enumerate(changes)]
    assert swells_once(steps[::-1]) == once


def test_all_pairs_of_words_share_one_prior_of_something_outside():
    """Two dependences cost the prior of each; the order does not matter."""
    entries = [entry((), (), 0)] + [entry((), pair, 0) for pair in product(("time",), ("place",))]
    found = beliefs(table(entries))
    q = PRIORS.outside / 2
    assert found[1].probability / found[0].probability == pytest.approx(q**2 / (1 - PRIORS.outside))


def test_what_all_robots_lack_counts_once_and_so_does_what_their_base_always_lacked():
    """Two robots that are alike: slip is new with b, or always was there with a, and o before.

    Each alone has 1 : b q : a q o for nothing, new and always, q the prior odds of one effect.
    """
    words, candidates, a, b, o = frozenset({"time", "place"}), 10, 3.0, 4.0, 0.2
    none, slip = frozenset(), frozenset({"slip"})
    q = float(np.exp(log_prior_of_effects(1, candidates)))
    odds = np.array([1, b * q, a * q * o])
    log_own = np.log([1, 1, o])
    things, always = [none, slip, none], [none, none, slip]
    one = _Robot([], things, always, log_own, odds / odds.sum(), words, candidates)

    def together(lack, lacked):
        return _log_before([one, one], (lack, lacked)) + 2 * one.log_given((lack, lacked))

    nothing = together(none, none)
    # where none lacks it, each may still lack it alone
    assert together(slip, none) - nothing == pytest.approx(np.log(q * b**2 / (1 + b * q) ** 2))
    assert together(none, slip) - nothing == pytest.approx(np.log(q * o * a**2 / (1 + b * q) ** 2))
