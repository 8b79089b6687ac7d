# SPDX-License-Identifier: Apache-2.0
"""Models compared by held-out densities, against SciPy's tests and closed forms."""

import numpy as np
import pytest
from scipy import optimize, stats

import twinmill as tm
from twinmill.fitting.model_comparison import Predicted, chance_of_lead, stacked, standings

RNG = np.random.default_rng(3)
ELPD = RNG.normal(-10, 1, (40, 1)) + RNG.normal([0.0, -0.4, -0.1], 0.8, (40, 3))


def of(elpd: np.ndarray) -> list:
    return standings([Predicted(1.0, column) for column in elpd.T])


def test_of_two_models_the_lead_is_judged_by_the_paired_t_test():
    (a, b), lead = of(ELPD[:, :2]), ELPD[:, 0] - ELPD[:, 1]
    told = stats.ttest_1samp(lead, 0, alternative="greater")
    assert b.p_chance == pytest.approx(told.pvalue) and a.p_chance == 1
    assert b.elpd_diff / b.dse == pytest.approx(told.statistic)
    assert b.elpd_diff == pytest.approx(lead.sum()) and a.elpd_diff == 0 == a.dse


def test_the_best_of_many_equal_models_is_rarely_called_better():
    """One in twenty at 0.05, where the largest of uncorrected tests says so of far more."""
    rng, called, plain = np.random.default_rng(8), 0, 0
    for _ in range(100):
        equal = rng.normal(size=(30, 6))
        lead = equal[:, 1:] - equal[:, [0]]
        called += chance_of_lead(equal, 0) < 0.05
        plain += stats.t.sf((lead.mean(0) / stats.sem(lead)).max(), 29) < 0.05
    assert stats.binomtest(called, 100, 0.05).pvalue > 0.01
    assert plain > 2 * called


def test_weights_are_those_of_the_best_mixture():
    pair = ELPD[:, :2]
    best = optimize.minimize_scalar(
        lambda w: -np.sum(np.logaddexp(np.log(w) + pair[:, 0], np.log1p(-w) + pair[:, 1])),
        bounds=(1e-9, 1 - 1e-9),
        options={"xatol": 1e-9},
    )
    assert stacked(pair)[0] == pytest.approx(best.x, abs=1e-4)
    worse = np.column_stack([pair[:, 0], pair[:, 0] - 1])  # at each block: no use in a mixture
    np.testing.assert_allclose(stacked(worse), [1, 0], atol=1e-6)
    np.testing.assert_allclose(stacked(ELPD).sum(), 1)


def test_twins_cannot_be_told_apart():
    twins = of(np.column_stack([ELPD[:, 0], ELPD[:, 0]]))
    assert [(m.elpd_diff, m.dse, m.p_chance) for m in twins] == [(0, 0, 1)] * 2


def test_the_model_that_made_the_path_wins(tmp_path):
    """Arcs by algebra at gains of 0.9 and 1.1, and models that have, lack or fit these."""
    step_s, held = 0.02, 50
    told = np.column_stack([RNG.uniform(-0.3, 0.3, 40), RNG.uniform(-1, 1, 40)])
    v, w = np.repeat(told * [0.9, 1.1], held, axis=0).T * step_s
    heading = np.concatenate([[0], np.cumsum(w)])
    middle, chord = heading[:-1] + w / 2, v * np.sinc(w / 2 / np.pi)
    path = np.cumsum(np.column_stack([chord * np.cos(middle), chord * np.sin(middle)]), axis=0)
    pose = np.column_stack([np.vstack([[0, 0], path]), heading])
    pose += RNG.normal(0, [1e-3, 1e-3, 2e-3], pose.shape)
    t_s, at_s = np.arange(len(pose)) * step_s, np.arange(40) * held * step_s
    log = tm.Log.from_arrays(t_s, pose, at_s, told, kind="twist", same_clock=True)
    text = 'name = "t"\n[base]\ndrive = "twist"\nwheels = "none"\ncontrol_period_s = 0.02\n'
    (tmp_path / "plain.toml").write_text(text)
    plain = tm.Model.load(tmp_path / "plain.toml")
    right = plain.set({"base.forward_gain": 0.9, "base.yaw_gain": 1.1})
    table = tm.compare_models({"plain": plain, "right": right}, [log], refit=False)
    assert list(table.index) == ["right", "plain"] and table.loc["plain", "p_chance"] < 0.01
    assert table.loc["right", "weight"] > 0.99
    assert table["score_heldout"].is_monotonic_increasing and "Dunnett" in table.attrs["correction"]
    assert table.loc["plain", "score_heldout"] == pytest.approx(
        tm.compare(log, plain).score, rel=0.01
    )
    with pytest.raises(ValueError, match="two have one name"):
        tm.compare_models([plain, plain], log)
    with pytest.raises(ValueError, match="1 cannot be compared"):
        tm.compare_models([plain], log)
