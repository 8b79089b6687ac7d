# SPDX-License-Identifier: Apache-2.0
"""The next run: its algebra, its promised chance, its script, and that it settles what was open."""

import json
import os
import subprocess
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.data.log import read_log
from twinmill.data.measurement import Measurement
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.infer import Inference
from twinmill.experiment.design import Limits, Plan, check, design, with_effect
from twinmill.experiment.hypotheses import State, candidate_effects
from twinmill.experiment.information import CLOCKS, FisherInformation
from twinmill.experiment.moves import AXES, duty_axes, family
from twinmill.experiment.played import Rows, csv_text, rows_of
from twinmill.experiment.power import ALPHA, named_apart
from twinmill.experiment.relevance import Relevance
from twinmill.fitting.fit import base_names, fit
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import Parameter, base_parameters
from twinmill_cli import main as cli
from twinmill_cli import next as next_run

BIAS_RAD = 0.02
HALVES = slice(0, None, 2), slice(1, None, 2)
COMMAND_S = 10 / 480  # of the robot in conftest.py


def information_of(widths: list[float], sizes: list[int]) -> FisherInformation:
    """Free quantities with priors of these widths, and effects with so many parameters."""
    free = [Parameter("x", "1", 0, -1, 1, 0, width, 0.1) for width in widths]
    candidate_effects = [
        SimpleNamespace(name=str(k), candidate=SimpleNamespace(strength=np.ones(size)))
        for k, size in enumerate(sizes)
    ]
    return FisherInformation(free, candidate_effects)


def test_a_margin_is_what_least_squares_leaves_of_the_trace():
    random = np.random.default_rng(1)
    fisher = information_of([0.5, 2.0], [1, 3, 2])
    columns = random.normal(size=(200, fisher.shared + CLOCKS))
    margins = fisher.margins(columns.T @ columns)
    others = columns[:, [*range(2), fisher.shared, fisher.shared + 1]]
    others = np.vstack([others, np.diag([2.0, 0.5, 0, 0])])  # 1 / width: a weak prior's rows
    for i, step in enumerate(fisher.steps):
        for j, place in enumerate(fisher.places):
            rival = np.vstack([columns[:, place], np.zeros((4, len(place)))])
            prior = np.hstack([np.zeros((len(place), 4)), 0.5 * np.eye(len(place))])
            all_rows = np.vstack([np.hstack([others, rival]), prior])
            target = np.append(columns[:, step], np.zeros(len(all_rows) - 200))
            left = target - all_rows @ np.linalg.lstsq(all_rows, target)[0]
            expected = np.inf if i == j else left @ left
            assert margins[i, 1 + j] == pytest.approx(expected, rel=1e-6)


def test_the_base_shifts_as_least_squares_fits_it_to_the_trace():
    random = np.random.default_rng(5)
    fisher = information_of([0.5, 2.0], [1, 3])
    columns = random.normal(size=(300, fisher.shared + CLOCKS))
    free = columns[:, [0, 1, fisher.shared, fisher.shared + 1]]
    free = np.vstack([free, np.diag([2.0, 0.5, 0, 0])])
    for step, shift in zip(fisher.steps, fisher.shifts(columns.T @ columns), strict=True):
        left = np.append(-columns[:, step], np.zeros(4))
        assert shift == pytest.approx(np.linalg.lstsq(free, left)[0][:2], rel=1e-5)


@pytest.mark.parametrize("added", [0.1, 0.2, 0.3, 0.5])
def test_promised_chance_to_matter_is_that_of_simulated_scores(added):
    """Errors are unit ones and an effect's: a diagnosis asks that it takes 2 % of the score."""
    random = np.random.default_rng(6)
    left = random.normal(size=(4000, 40))
    own = added * np.resize([1.0, -1.0], 40)
    ratio = np.sqrt(np.mean(left**2, axis=1) / np.mean((left + own) ** 2, axis=1))
    promised = Relevance(1.0, np.array([added**2]), 40.0).chance(1.0)[0]
    assert promised == pytest.approx(np.mean(ratio < 0.98), abs=0.08)


def test_two_runs_tell_more_than_either():
    random = np.random.default_rng(2)
    fisher = information_of([1.0], [2, 1])
    runs = random.normal(size=(2, 50, fisher.shared + CLOCKS))
    grams = np.einsum("rkc,rkd->rcd", runs, runs)
    alone, together = fisher.margins(grams), fisher.margins(grams.sum(axis=0))
    finite = np.isfinite(together)
    assert np.all(together[finite] >= alone.sum(axis=0)[finite] - 1e-9)


@pytest.mark.parametrize(("energy", "alike"), [(15, 0.5), (25, 0.5), (60, 0.95), (150, 0.95)])
def test_promised_chance_is_that_of_a_simulated_trial(energy, alike):
    """Two traces in white noise, fitted on one half of the samples and judged on the other."""
    random = np.random.default_rng(3)
    basis = np.linalg.qr(random.normal(size=(400, 2)))[0]
    true = basis[:, 0]
    rival = np.sqrt(alike) * true + np.sqrt(1 - alike) * basis[:, 1]
    named, trials = 0, 2000
    for data in np.sqrt(energy) * true + random.normal(size=(trials, 400)):
        left = {"true": 0.0, "rival": 0.0, "none": data @ data}
        for train, test in (HALVES, HALVES[::-1]):
            for name, trace in (("true", true), ("rival", rival)):
                size = data[train] @ trace[train] / (trace[train] @ trace[train])
                left[name] += np.sum((data[test] - size * trace[test]) ** 2)
        enough = left["none"] - left["true"] > 2 * np.log(28 / ALPHA)
        lead = 6.0 if alike > 0.9 or energy * (1 - alike) < 12 else 0.0
        named += enough and left["rival"] - left["true"] > lead
    margins = np.array([[energy, np.inf, energy * (1 - alike)]])
    assert named_apart(margins, np.array([1]), 28)[0] == pytest.approx(named / trials, abs=0.08)


def test_each_move_comes_to_rest_and_keeps_the_duty_cap():
    for move in family(duty_axes(0.6)):
        assert not move.command[-1].any() and move.hold_s[-1] >= 0.5
        assert np.abs(move.command).max() <= 0.6


def test_plain_wheels_of_a_side_are_told_alike_as_two_motors_are():
    for move in family(duty_axes(1.0, "differential")):
        np.testing.assert_array_equal(move.command[:, :2], move.command[:, 2:])


@dataclass(frozen=True)
class Designed:
    """A heading bias that milling alone cannot name: the first log's diagnosis and the plan."""

    model: ModelFile
    milling: Measurement
    before: Inference
    plan: Plan


def turned(pose, valid):
    """Motion capture's body is turned against the robot's."""
    return pose + np.array([0, 0, BIAS_RAD]), valid


def milling_pct(duration_s: float) -> np.ndarray:
    """(K, 4) full speed, switching sides at random times: the duties of the vendor's mixing."""
    random = np.random.default_rng(4)
    sides = np.repeat(random.permutation([0, 1] * 50), random.integers(15, 70, 100))
    return np.array([(37, 100, 37, 100), (100, 37, 100, 37)])[
        sides[: round(duration_s / COMMAND_S)]
    ]


@pytest.fixture(scope="module")
def designed(run_log, measure, model_file, tmp_path_factory) -> Designed:
    """Fits the base to a rich run, then diagnoses milling with a turned marker body."""
    fitted = tmp_path_factory.mktemp("next") / "fitted.toml"
    fit([measure(seed=1, duration_s=60)], model_file(), fitted, "test")
    model = ModelFile.load(str(fitted))
    milling = measure(seed=2, script_pct=milling_pct(60), spoil=turned)
    before = diagnose([milling], model)
    return Designed(
        model, milling, before, design(before, model, Limits(20, (2.0, 1.5), 0.8), print)
    )


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_what_is_in_question_of_wheels_is_so_of_the_robots_own(measure, model_file):
    """A robot of two wheels has no rear ones, whatever effects of wheels may have elsewhere."""
    legs = np.random.default_rng(7).choice((-100, -50, 0, 50, 100), (25, 2))
    sides_pct = np.tile(np.repeat(legs, round(0.8 / COMMAND_S), axis=0), 2)
    two = model_file(
        ('"mecanum"', '"differential"'), ("half_wheelbase_m = 0.059", "half_wheelbase_m = 0")
    )
    (own,) = open_measurements([measure(seed=7, script_pct=sides_pct)], two)
    log = own.modelled()
    free = base_parameters(own.model, base_names(own.model, [own], ()))
    asked = SimpleNamespace(fitted={})
    state = State([log], free, [own.floor.rms])
    found = {e.name: e for e in candidate_effects([log], log, state=state, asked=asked, usual=1.0)}
    assert {"wheel_gain", "wheel_eccentricity"} <= set(found)
    for effect in found.values():
        richer = with_effect(own.model, effect)
        own_names = {
            q["name"].split(".")[1]
            for q in richer.values()
            if q["name"].startswith(f"{effect.name}.")
        }
        assert own_names == set(effect.whole.names)
    assert set(found["wheel_gain"].whole.names) == {"fl", "fr"}


def at_steps(rows: Rows) -> np.ndarray:
    """(K, 4) duties in percent at the robot's control steps."""
    t_s = np.arange(0, rows.end_s, COMMAND_S)
    held = np.searchsorted(rows.t_s, t_s + 1e-9, side="right") - 1
    return np.rint(100 * rows.command[held]).astype(int)


def test_the_run_names_what_milling_alone_cannot(designed, measure):
    """Without strafing a heading bias and unequal wheels are one thing, by algebra.

    One more may be named: the robot's curve is bent between the duties of the model's table, so
    milling's inner wheels, whose duty is no node of it, truly do not do what the model says.
    """
    group = {"heading_bias", "wheel_gain"}
    assert group & {n for f in designed.before.answer.findings for n in f.group}
    asked = {c.effect for c in designed.plan.chances}
    assert {"heading_bias", "wheel_gain"} <= asked
    assert all(c.power_before < 0.5 for c in designed.plan.chances if c.effect == "heading_bias")
    assert "heading_bias" in designed.plan.separates
    run = measure(seed=3, script_pct=at_steps(designed.plan.rows), spoil=turned)
    after = diagnose([designed.milling, run], designed.model)
    first = after.answer.findings[0]
    assert (first.effect, first.certainty) == ("heading_bias", "sure")
    assert abs(first.numbers["bias_rad"][0]) == pytest.approx(BIAS_RAD, rel=0.15)


def test_the_script_keeps_to_time_floor_and_duty_and_strafes(designed):
    rows, plan = designed.plan.rows, designed.plan
    assert rows.end_s <= 20
    assert np.abs(rows.command).max() <= 0.8
    assert np.all(plan.extent_m <= plan.limits.floor_m)
    assert np.abs(rows.command @ AXES["strafe"]).max() > 1


def test_the_real_path_is_the_predicted_one(designed, tanh_robot):
    """The robot of the test shares no code with the planar plant."""
    pose = replace(tanh_robot(), drive_mps=0, drive_radps=0).poses(
        np.repeat(at_steps(designed.plan.rows), 10, axis=0) / 100, 1
    )
    t_s = np.arange(1, len(pose) + 1) / 480
    path = designed.plan.paths[0]
    seen = np.column_stack([np.interp(designed.plan.pose_t_s, t_s, pose[:, k]) for k in range(2)])
    assert np.abs(seen - path[:, :2]).max() < 0.05


@pytest.mark.skipif("TWIN_RUN" not in os.environ, reason="TWIN_RUN does not name the program")
def test_the_firmware_reads_the_script_as_it_was_meant(tmp_path):
    """The twin reads scripts with the firmware's parser; its telemetry must say the same duties."""
    rows = rows_of(family(duty_axes(1.0))[-3:])
    script, log = tmp_path / "script.csv", tmp_path / "run.lcmlog"
    script.write_text(csv_text(rows))
    subprocess.run(
        [os.environ["TWIN_RUN"], "--plant", "planar", "--model", "turbopi.toml", "--n", "1",
         "--script", script, "--log", log],
        check=True, capture_output=True,
    )  # fmt: skip
    (robot,) = read_log(log).robots.values()
    # A duty may come one control step late.
    settled = np.searchsorted(rows.t_s, robot.command_t_s - 0.03) == np.searchsorted(
        rows.t_s, robot.command_t_s + 0.001
    )
    held = np.searchsorted(rows.t_s, robot.command_t_s, side="right") - 1
    assert np.count_nonzero(settled) > 200
    assert np.allclose(robot.command[settled], rows.command[held][settled], atol=1e-6)


def test_the_command_writes_the_script_and_says_what_it_parts(
    designed, monkeypatch, capsys, tmp_path, coasting_robot
):
    """The design of a run is tested above; here it is the ready plan."""
    monkeypatch.setattr(next_run, "plan_run", lambda *_, own: designed.plan)
    script, report = tmp_path / "script.csv", tmp_path / "report"
    words = ["next", coasting_robot.log, "--model", coasting_robot.model, "-o", script]
    cli.run([str(w) for w in [*words, "--json", "--out", report]])
    told = json.loads(capsys.readouterr().out)
    assert told["script"] == str(script) and "heading_bias" in told["separates"]
    assert 0 <= told["predicted_power"] <= 1
    rows = np.loadtxt(script, delimiter=",", skiprows=1)
    assert np.array_equal(rows[:-1, 1:], np.rint(100 * designed.plan.rows.command))
    assert not rows[-1, 1:].any() and rows[-1, 0] == pytest.approx(told["duration_s"], abs=1e-3)
    assert (report / "index.html").read_text().count("<svg") == 3
    monkeypatch.setenv("COLUMNS", "60")  # a narrow terminal does not break what is to be copied
    cli.run([str(w) for w in [*words, "--force"]])
    lines = map(str.split, capsys.readouterr().out.splitlines())
    (command,) = (words for words in lines if words[:2] == ["twinmill", "diagnose"])
    log, model = str(coasting_robot.log), str(coasting_robot.model)
    assert command[2:] == [log, "next.lcmlog", "--model", model]


@pytest.mark.parametrize("floor", ["2", "2x", "-1x2", "axb"])
def test_a_floor_that_is_none_is_refused_in_one_sentence(floor, tmp_path):
    with pytest.raises(ValueError, match="is no floor"):
        cli.run(["next", "no.lcmlog", "--floor-m", floor, "-o", str(tmp_path / "s.csv")])


@pytest.mark.parametrize(
    ("limits", "words"), [((15, (0.3, 2.0), 1.0), "no move fits"), ((8, (2.0, 2.0), 1.0), "short")]
)
def test_where_no_move_fits_it_is_said_at_once(designed, limits, words):
    with pytest.raises(ValueError, match=words):
        check([designed.milling], designed.model, Limits(*limits))
