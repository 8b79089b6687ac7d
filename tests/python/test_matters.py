# SPDX-License-Identifier: Apache-2.0
"""Weights for a swarm: a planted case whose truth an independent program knows."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native

from twinmill.model.model_file import ModelFile
from twinmill.swarm.matters.changes import Change, Factor, factors
from twinmill.swarm.matters.differences import median_difference, share_difference
from twinmill.swarm.matters.sensitivity import MATTERS, NOTHING, Sensitivity, rank_factors
from twinmill.swarm.matters.sentences import sentence
from twinmill.swarm.sweep import make_request
from twinmill_cli.main import run
from twinmill_lab.claims.published import Points

# The published robot, its camera's cone 75 degrees wide on paper and 49 as it is; and five more.
PLANTED = """
name = "planted"
[robot]
body_radius_m = 0
[base]
drive = "twist"
wheels = "none"
speed_per_input_mps = 0.0025
turn_per_input_radps = 1.5707963267949
control_period_s = 0.022
[sensor]
range_m = 1.2
cone_rad = 1.3089969389957
target_radius_m = 0.1
"""
EFFECTS = {
    "view_angle": {"factor": 49 / 75},
    "view_range": {"factor": 0.97, "softness_m": 0},
    "missed_detection": {"rate": 0.02},
    "false_detection": {"rate": 0.01},
    "sensor_delay": {"delay_s": 0.033},
    "coulomb_friction": {"loss_mps": 0.002},
}
SECONDS, SEEDS = 45.0, 160


def planted_text(effects=EFFECTS) -> str:
    tables = [
        "\n".join([f'[[effect]]\nname = "{name}"', *(f"{k} = {v}" for k, v in values.items())])
        for name, values in effects.items()
    ]
    return PLANTED + "\n".join(tables) + "\n"


def independent(without: str | None) -> np.ndarray:
    """True for each of 60 swarms of points that mills without one of EFFECTS, by formulas."""

    def has(name: str) -> bool:
        return name != without

    points = Points(
        exact=True,
        target_radius_m=0.1,
        range_m=1.2 * (0.97 if has("view_range") else 1),
        cone_rad=np.radians(49 if has("view_angle") else 75),
        miss_rate=0.02 * has("missed_detection"),
        false_rate=0.01 * has("false_detection"),
        delay_steps=2 * has("sensor_delay"),
        v_mps=0.25 - 0.002 * has("coulomb_friction"),
    )
    return points.run(60, seed=5, duration_s=SECONDS).classes == "milling"


@pytest.fixture(scope="module")
def planted(tmp_path_factory) -> Sensitivity:
    folder = tmp_path_factory.mktemp("planted")
    (folder / "planted.toml").write_text(planted_text())
    name = str(folder / "planted.toml")
    request = make_request("milling", name, [], seeds=SEEDS, duration_s=SECONDS, full=True)
    asked, left = factors(ModelFile.load(name), [], drawn=0, seed=1)
    only = [s for s in asked if s.kind == "effect"]
    return rank_factors(request, only, left, goal="milling", margin=0.1, folder=folder)


def test_of_six_effects_the_one_that_decides_comes_first_and_five_do_not_matter(
    planted: Sensitivity,
):
    truth = {name: independent(name) for name in (None, *EFFECTS)}
    moved = {name: abs(truth[name].mean() - truth[None].mean()) for name in EFFECTS}
    assert moved.pop("view_angle") > 0.8 and max(moved.values()) < 0.06  # the case is as planted
    names = [result.factor.name for result in planted.ranked]
    assert names[0] == "view_angle" and set(names) == set(EFFECTS)
    verdicts = [result.verdict for result in planted.ranked]
    assert verdicts == [MATTERS] + [NOTHING] * 5


def test_shares_are_those_of_the_independent_program(planted: Sensitivity):
    """Within 3.5 standard deviations of two binomial samples, held off 0 and 1 by one success."""
    first = planted.ranked[0]
    for ours, n, without in (
        (planted.before[0], SEEDS, None),
        (first.worst.share.after, first.worst.seeds, "view_angle"),
    ):
        theirs = independent(without)
        pooled = (ours * n + theirs.sum() + 1) / (n + theirs.size + 2)
        sigma = np.sqrt(pooled * (1 - pooled) * (1 / n + 1 / theirs.size))
        assert abs(ours - theirs.mean()) < 3.5 * sigma
    assert sentence(first).startswith("view_angle matters: ")


def test_an_effect_that_does_nothing_changes_no_run(tmp_path: Path):
    """Common random numbers: the same seed is the same start, robots and errors of the camera."""
    bare = planted_text({}).replace("1.3089969389957", "0.855")
    (tmp_path / "m.toml").write_text(bare)
    request = make_request(
        "milling", str(tmp_path / "m.toml"), [], seeds=40, duration_s=20.0, full=True
    )
    request = replace(request, n=3)
    neutral = bare + '[[effect]]\nname = "speed_slip"\nloss_s_per_m = 0.0\n'
    asked = [Factor("speed_slip", "effect", "", [Change("nothing", neutral, {})])]
    found = rank_factors(request, asked, [], goal="milling", margin=0.1, folder=tmp_path / "out")
    outcome = found.ranked[0].worst
    assert outcome.share.change == 0
    circliness = outcome.metrics["circliness"]
    assert circliness.change == circliness.low == circliness.high == 0


def test_intervals_of_paired_shares_hold_what_they_promise():
    """Newcombe's own worked example, and how often intervals hold the true difference."""
    counts = ((1, 1, 20), (1, 0, 12), (0, 1, 2), (0, 0, 16))
    before, after = (
        np.repeat([c[k] for c in counts], [c[2] for c in counts]).astype(bool) for k in (0, 1)
    )
    found = share_difference(before, after)
    assert (found.change, found.low, found.high) == pytest.approx(
        (-0.2, -0.3290, -0.0562), abs=2e-3
    )
    random, held = np.random.default_rng(1), 0
    for _ in range(200):
        u = random.random(60)
        noise = random.random(60) < 0.3
        before, after = u < 0.8, np.where(noise, random.random(60), u) < 0.65
        found = share_difference(before, after)
        held += found.low <= -0.15 <= found.high
    assert held / 200 > 0.95 - 3.5 * np.sqrt(0.05 * 0.95 / 200)


def test_medians_go_with_their_pairs_and_runs_without_a_value_are_left_out():
    random = np.random.default_rng(2)
    before = random.normal(10, 5, 200)
    after = before + 1
    after[:20], before[20:30] = np.nan, np.nan
    found = median_difference(before, after, seed=1)
    assert found.change == pytest.approx(1) and found.low == pytest.approx(found.high)


def test_the_command_tells_the_same_twice_and_goes_on_where_it_was(
    tmp_path: Path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    text = planted_text({"view_angle": EFFECTS["view_angle"]}).replace("[sensor]", FITTED)
    Path("m.toml").write_text(text)
    words = "matters --model m.toml --seeds 40 --duration-s 10 --n 2 --draws 2 --json"
    words += " --only view_angle --only base.forward_gain --only vote --only together"
    words += " --map-seeds 2 --x n=2:3:2 --y range_m=0.8,1.2"
    told = []
    for out in ("a", "a", "b"):
        run([*words.split(), "--out", out])
        told.append(capsys.readouterr().out)
    data = json.loads(told[0])
    assert told[0] == told[1] and told[0] == told[2].replace('"b/', '"a/')
    assert Path("a/index.html").read_bytes() == Path("b/index.html").read_bytes()
    kinds = {result["kind"] for result in data["ranking"]}
    assert kinds == {"effect", "parameter", "hidden", "one_robot"}
    own = next(j for j in data["ranking"] if j["kind"] == "parameter")
    # 95 % of a normal: 1.96 standard deviations to both sides.
    ends = [change["values"]["base.forward_gain"] for change in own["changes"]]
    assert ends == pytest.approx([1 - 1.96 * 0.02, 1 + 1.96 * 0.02])
    assert len(data["together"]["changes"]) == 2
    assert all(result["sentence"].endswith(").") for result in data["ranking"])


FITTED = "forward_gain = 1.0\n[base.std]\nforward_gain = 0.02\n[sensor]"


def test_what_goes_together_moves_along(tmp_path: Path):
    """Regression: with correlation -0.8, one at +1.96 std moves the other by -0.8 * 1.96 std."""
    text = planted_text({}) + (
        '[fit]\nlogs = []\n[fit.covariance]\nnames = ["base.forward_gain", "base.yaw_gain"]\n'
        "values = [[0.0004, -0.00016], [-0.00016, 0.0001]]\n"
    )
    (tmp_path / "m.toml").write_text(text)
    asked, _ = factors(ModelFile.load(str(tmp_path / "m.toml")), [], drawn=0, seed=1)
    forward = next(s for s in asked if s.name == "base.forward_gain")
    high = native.Model.from_toml(forward.changes[1].text, "high")
    assert high.get("base.forward_gain") == pytest.approx(1 + 1.96 * 0.02)
    assert high.get("base.yaw_gain") == pytest.approx(1 - 0.8 * 1.96 * 0.01)
