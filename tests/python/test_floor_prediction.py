# SPDX-License-Identifier: Apache-2.0
"""Sealed predictions: calibrated where the truth is another plant, and proof against tampering."""

import gzip
import hashlib
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, norm

from twinmill.programs import find_program
from twinmill.swarm.forecast.choose import choose
from twinmill.swarm.forecast.draws import OUTCOMES, Forecast, out_of_bounds
from twinmill.swarm.forecast.plan import read_plan
from twinmill.swarm.forecast.score import score
from twinmill.swarm.sweep import make_request, sweep
from twinmill_cli.main import run
from twinmill_lab.claims.prediction import AXES, LABS, MODEL, SECONDS, STD, reliability, trial


@pytest.fixture(scope="module")
def swept(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("floor")
    (folder / "m.toml").write_text(MODEL)
    request = make_request("milling", str(folder / "m.toml"), AXES, seeds=40, duration_s=SECONDS)
    sweep(request, folder / "sweep")
    return folder


def test_draws_that_bounds_refuse_are_counted(swept):
    """As many as a normal has beyond the bounds of its two gains."""
    wide = MODEL.replace(f"forward_gain = {STD}", "forward_gain = 1.0")
    (swept / "wide.toml").write_text(wide)
    request = make_request("milling", str(swept / "wide.toml"), AXES, seeds=1)
    bounds = {v["name"]: (v["min"], v["max"]) for v in request.model.values()}
    sizes = {"base.forward_gain": 1.0, "base.yaw_gain": STD}
    ends = [(np.array(bounds[name]) - 1) / std for name, std in sizes.items()]
    within = np.prod([norm.cdf(high) - norm.cdf(low) for low, high in ends])
    anew, names = out_of_bounds(request, 2000, 1)
    assert 2000 / (2000 + anew) == pytest.approx(within, abs=0.04)
    assert names == ["base.forward_gain"]


def test_calibrated_on_a_hundred_laboratories_of_another_plant(swept: Path):
    """Each class comes as often as was said, and scores are no worse than was said either."""
    found = trial(swept)  # whose sweep is there
    said, saw = found.said, found.saw
    # How often each class came, in each cell, against what was said: chance of 100 laboratories,
    # and of 100 models drawn.
    share, seen = said.share, np.stack([(saw == k).mean(axis=0) for k in range(len(OUTCOMES))], 1)
    told = (share > 0.05) & (share < 0.95)
    variance = share * (1 - share) / LABS + said.draws.var(axis=0) / len(said.draws)
    off = ((seen - share) ** 2 / variance)[told]
    assert told.sum() > 10 and off.sum() < chi2.ppf(0.999, told.sum())
    claim = reliability(found)
    assert claim.agrees and claim.count == (len(claim.rows) - 1,) * 2 and len(claim.rows) > 4
    assert claim.rows[-1].low > 0  # more is known than how often each class comes
    cell = np.arange(len(said.points))
    p = np.array(
        [score(said, cell, ended, axes=["cone_deg", "range_m"], seed=1).p_value for ended in saw]
    )
    assert np.mean(p < 0.05) < 0.05 + 3.5 * np.sqrt(0.05 * 0.95 / LABS)


def test_scores_are_those_of_their_definitions():
    """Two cells, by hand: log of what was said, and Brier's sum over the classes."""
    said = np.array([[[0.7, 0.1, 0.1, 0.05, 0.05], [0.2, 0.2, 0.2, 0.2, 0.2]]])
    expected = Forecast(np.array([[1.0], [2.0]]), said[0], said)
    found = score(expected, np.array([0, 1]), np.array([0, 3]), axes=["x"], seed=1)
    assert found.log_score.value == pytest.approx((np.log(0.7) + np.log(0.2)) / 2)
    first = 0.3**2 + 2 * 0.1**2 + 2 * 0.05**2
    assert found.brier.value == pytest.approx((first + 0.8**2 + 4 * 0.2**2) / 2)
    even = next(rival for rival in found.rivals if rival.name == "all classes alike")
    assert even.log_score.value == pytest.approx(np.log(0.2))
    assert even.gain.value == pytest.approx((np.log(0.7) - np.log(0.2)) / 2)
    assert found.hits == 1


@pytest.mark.parametrize("sure", [0.9, 0.99])
def test_intervals_of_scores_stay_in_their_range(sure):
    """One miss in a cell of six, all said for sure: a symmetric interval goes below Brier's 0."""
    said = np.full((1, 6, 5), (1 - sure) / 4)
    said[..., 0] = sure
    expected = Forecast(np.arange(6.0)[:, None], said[0], said)
    cell = np.repeat(np.arange(6), 2)
    seen = np.where(np.arange(12) == 0, 1, 0)
    found = score(expected, cell, seen, axes=["x"], seed=1)
    assert 0 <= found.brier.low < found.brier.value < found.brier.high <= 2
    assert found.log_score.low < found.log_score.value < found.log_score.high <= 0
    few = score(expected, cell[:8], seen[:8], axes=["x"], seed=1)
    assert np.isnan([few.brier.low, few.brier.high, few.log_score.low]).all()


def test_a_wrong_model_scores_worse_than_it_expects_and_its_misses_are_told():
    """It says milling for sure where x is high; there they part, always."""
    sure = np.full((1, 6, 5), 0.0125)
    sure[..., 0] = 0.95
    expected = Forecast(np.arange(6.0)[:, None], sure[0], sure)
    cell = np.repeat(np.arange(6), 4)
    seen = np.where(cell >= 3, OUTCOMES.index("separated"), OUTCOMES.index("milling"))
    found = score(expected, cell, seen, axes=["v_mps"], seed=1)
    assert found.p_value < 0.001 and found.hits == 12
    assert found.misses[0].startswith("12 of 12 misses ended 'separated' where 'milling'")
    assert "high v_mps" in found.misses[1]
    right = score(expected, cell, np.zeros(24, int), axes=["v_mps"], seed=1)
    assert right.p_value > 0.05 and right.misses == ["Every run ended in its most probable class."]


def test_cells_that_tell_nothing_come_last():
    """One of three cells parts the models, one the models from the base rate, one nothing."""
    parts, sure, even = ([0.96, 0.01], [0.01, 0.96]), ([0.01, 0.96],) * 2, ([0.485, 0.485],) * 2
    draws = np.array([[[*of[d], 0.01, 0.01, 0.01] for of in (even, sure, parts)] for d in (0, 1)])
    expected = Forecast(np.arange(3.0)[:, None], draws.mean(axis=0), draws)
    found = choose(expected, 3, 3, seed=1)
    assert found[-1][0] == 0
    assert 0 < found[0][1] <= found[1][1] <= 1.5  # the entropy of 1/2, 1/4, 1/4


@pytest.fixture(scope="module")
def planned(swept: Path) -> Path:
    words = f"predict-floor {swept}/sweep --cells 3 --repeats 2 --draws 3 --seeds 4 -o {swept}/plan"
    run(words.split())
    return swept


def fill(form: Path, out: Path, values: dict[str, list[str]]) -> Path:
    head, *rows = form.read_text().splitlines()
    names = head.split(",")
    lines = [head]
    for k, row in enumerate(rows):
        cells = row.split(",")
        for name, column in values.items():
            cells[names.index(name)] = column[k]
        lines.append(",".join(cells))
    out.write_text("\n".join(lines) + "\n")
    return out


def test_a_plan_is_whole_and_what_it_says_runs_as_printed(planned: Path, monkeypatch, capsys):
    monkeypatch.chdir(planned)
    text = Path("plan/plan.md").read_text()
    assert "0.9" not in text.replace("rotation beyond 0.9", "")  # no probability stands in it
    starts = np.loadtxt("plan/starts.csv", delimiter=",", skiprows=1)
    assert starts.shape == (6 * 6, 5) and np.abs(starts[:, 2:4]).max() <= 0.6
    fill(Path("plan/outcomes.csv"), Path("plan/outcomes.csv"), {"class": ["milling"] * 6})
    command = next(line for line in text.splitlines() if line.startswith("    twinmill lab score"))
    command = command.replace(f"{planned}/", "")
    run([*command.split()[1:], "--json", "--out", "score"])
    data = json.loads(capsys.readouterr().out)
    assert data["runs"] == 6 and data["sha256"] in text and len(data["baselines"]) == 3
    assert Path("score/index.html").exists()


def test_probabilities_that_were_changed_after_sealing_are_not_scored(planned: Path, tmp_path):
    for name in ("plan.md", "outcomes.csv", "probabilities.sealed"):
        (tmp_path / name).write_bytes((planned / "plan" / name).read_bytes())
    _, digest = read_plan(tmp_path, None)
    sealed = json.loads(gzip.decompress((tmp_path / "probabilities.sealed").read_bytes()))
    sealed["draws"][0][0] = [0.96, 0.01, 0.01, 0.01, 0.01]
    forged = gzip.compress(json.dumps(sealed, sort_keys=True).encode(), mtime=0)
    (tmp_path / "probabilities.sealed").write_bytes(forged)
    for given in (None, digest):
        with pytest.raises(ValueError, match="changed after they were sealed"):
            read_plan(tmp_path, given)


def test_a_run_may_come_as_a_log(planned: Path, tmp_path: Path, capsys):
    """The class of a recorded run is that of twinmill swarm metrics."""
    log = tmp_path / "run.lcmlog"
    twin = [find_program("twin_run"), "--plant", "planar", "--model", planned / "m.toml"]
    twin += ["--n", "6", "--seed", "4", "--duration-s", f"{SECONDS:g}", "--log", log]
    subprocess.run([*map(str, twin)], check=True, capture_output=True)
    run(["metrics", str(log), "--model", str(planned / "m.toml"), "--json"])
    ended = json.loads(capsys.readouterr().out)["class"]
    form = planned / "plan" / "outcomes.csv"
    by_log = fill(form, tmp_path / "log.csv", {"class": [""] * 6, "log": ["run.lcmlog", *[""] * 5]})
    by_class = fill(form, tmp_path / "class.csv", {"class": [ended, *[""] * 5]})
    told = []
    for path in (by_log, by_class):
        run(["score-floor", str(planned / "plan"), str(path), "--json"])
        told.append(json.loads(capsys.readouterr().out))
    assert told[0]["log_score"] == told[1]["log_score"]
    assert told[0]["missing"] == [2, 3, 4, 5, 6]
    other = "jammed" if ended != "jammed" else "milling"
    both = {"class": [other, *[""] * 5], "log": ["run.lcmlog", *[""] * 5]}
    with pytest.raises(ValueError, match=f"'{other}', but the log 'run.lcmlog' ended '{ended}'"):
        run(["score-floor", str(planned / "plan"), str(fill(form, tmp_path / "both.csv", both))])


@pytest.mark.parametrize(
    ("robots", "seconds", "says"),
    [
        (5, SECONDS, "has 5 robots, but the plan's run has 6"),
        (6, 20, r"for (19|20)\.\d s, but the plan's runs last 45 s"),
    ],
)
def test_a_log_that_cannot_be_the_run_is_refused(planned, tmp_path, robots, seconds, says):
    log = tmp_path / "run.lcmlog"
    twin = [find_program("twin_run"), "--plant", "planar", "--model", planned / "m.toml"]
    twin += ["--n", robots, "--duration-s", seconds, "--log", log]
    subprocess.run([*map(str, twin)], check=True, capture_output=True)
    (tmp_path / "o.csv").write_text("run,log\n1,run.lcmlog\n")
    with pytest.raises(ValueError, match=says):
        run(["score-floor", str(planned / "plan"), str(tmp_path / "o.csv")])


def test_one_log_is_not_two_runs(planned, tmp_path):
    log = tmp_path / "run.lcmlog"
    twin = [find_program("twin_run"), "--plant", "planar", "--model", planned / "m.toml"]
    subprocess.run(
        [*map(str, twin), "--n", "6", "--duration-s", f"{SECONDS:g}", "--log", str(log)],
        check=True,
        capture_output=True,
    )
    (tmp_path / "o.csv").write_text("run,log\n1,run.lcmlog\n3,./run.lcmlog\n")
    with pytest.raises(ValueError, match="is that of run 1 already"):
        run(["score-floor", str(planned / "plan"), str(tmp_path / "o.csv")])


def test_a_hash_that_is_empty_is_no_hash(planned):
    """As of a shell's variable that was never set."""
    with pytest.raises(ValueError, match="not '': the probabilities were changed"):
        read_plan(planned / "plan", "")


@pytest.mark.parametrize("key", ["cells", "order", "draws", "request", "bits", "repeats", "seed"])
def test_a_sealed_file_that_lacks_a_part_is_named(planned, tmp_path, key):
    sealed = json.loads(gzip.decompress((planned / "plan/probabilities.sealed").read_bytes()))
    del sealed[key]
    data = gzip.compress(json.dumps(sealed).encode())
    (tmp_path / "probabilities.sealed").write_bytes(data)
    with pytest.raises(ValueError, match="or not a whole one"):
        read_plan(tmp_path, hashlib.sha256(data).hexdigest())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("run,class\n²,milling\n", "line 2: run '²' is not one of the plan's"),
        ("run,class,class\n1,milling,cluster\n", "more than one column 'class'"),
        ("run,class\n1,miling\n", "'miling' is no class"),
        ("run,class\n99,milling\n", "run '99' is not one of the plan's"),
        ("run,class\n1,milling\n1,milling\n", "run 1 is there twice"),
        ("class\nmilling\n", "no column 'run'"),
        ("run,class,range_m\n1,milling,7\n", r"line 2: range_m is '7', but the plan's run 1 has"),
        ("run,class,cone_deg\n1,milling,x\n", "line 2: cone_deg is 'x', but the plan's run 1 has"),
        ("run,class,log\n1,milling,no.lcmlog\n", r"line 2: log 'no.lcmlog' is not there: /.*no"),
        ("run,class\n1,\n", "no run has a class or a log"),
    ],
)
def test_outcomes_that_make_no_sense_are_one_sentence(planned: Path, tmp_path, text, says):
    (tmp_path / "o.csv").write_text(text)
    with pytest.raises(ValueError, match=says):
        run(["score-floor", str(planned / "plan"), str(tmp_path / "o.csv")])
