# SPDX-License-Identifier: Apache-2.0
"""`twinmill diagnose` and `explain` on one robot, and with a model's own log."""

import json
import os
import re
import subprocess
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.diagnosis.infer import Inference
from twinmill.inference.answer import Answer
from twinmill_cli.frame import Given
from twinmill_cli.inferred import _mending

pytestmark = pytest.mark.usefixtures("asked_once")


def answer(verdict, *added):
    return Answer(verdict, [], 0.0, 0.1, 0.0, {}, {}, 0.0, added)


@pytest.mark.parametrize(
    ("said", "new"),
    [
        (answer("effect_missing", "dead_zone", "motor_lag"), "base_dead_zone_motor_lag.toml"),
        (answer("effect_missing", "abrupt_loss", "dead_zone"), "base_dead_zone.toml"),
        (answer("effect_missing", "abrupt_loss"), None),  # of this run alone
        (answer("refit_enough"), "base_fitted.toml"),
        (answer("model_adequate"), None),
    ],
)
def test_a_model_is_offered_that_has_what_lasts(said, new):
    given = Given([Path("run.lcmlog")], "base.toml", None, None)
    scores = {"refitted": SimpleNamespace(score=2.0), "after": SimpleNamespace(score=1.0)}
    found = SimpleNamespace(answer=said, formula=None, **scores)
    found.holds = Inference.holds.fget(found)
    found.lasting = Inference.lasting.fget(found)
    found.added = Inference.added.fget(found)
    typed = [c for _, c in _mending(found, "explain", given)]
    assert typed == ([f"twinmill explain run.lcmlog --model base.toml -o {new}"] if new else [])


def test_diagnose_and_explain_with_the_models_own_log_find_what_came_since(
    twinmill, brief_coasting_robot, brief_log_without_coasting, tmp_path
):
    """The robot rolls on at 0.7 m/s2, as the plant that drew the logs was told."""
    log, own = brief_coasting_robot.log, ["--own", brief_log_without_coasting]
    model = ["--model", brief_coasting_robot.model]
    code, out, _ = twinmill("diagnose", log, *model, *own, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["findings"][0]["effect"] == "coasting"
    assert found["command"].startswith("twinmill diagnose --own ")
    then, *_ = found["commands"]
    assert then.startswith("twinmill explain --own ")
    better = tmp_path / "better.toml"
    code, out, _ = twinmill("explain", log, *model, *own, "-o", better, "--json")
    assert code == 0
    told = json.loads(out)
    assert told["score_after"] < told["score"]
    (effect,) = tomllib.loads(better.read_text())["effect"]
    assert effect["name"] == "coasting"
    assert effect["deceleration_mps2"] == pytest.approx(0.7, rel=0.1)
    code, out, _ = twinmill("diagnose", log, "--model", better, "--json")
    assert code == 0 and not json.loads(out)["findings"]


@pytest.mark.parametrize("asked", ["--no-formula", "--formula"])
def test_where_no_formula_is_proposed_its_options_are_refused(twinmill, tmp_path, asked):
    """As the log is not there, too: nothing is read before."""
    log, new = tmp_path / "r.lcmlog", tmp_path / "new.xml"
    code, _, err = twinmill("explain", log, "--model", "arm.xml", "-o", new, asked)
    assert code == 1 and len(err.splitlines()) == 1
    assert f"leave {asked} away" in err and "jointed" in err
    assert not [*tmp_path.iterdir()]


def test_the_page_of_a_diagnosis_shows_its_probabilities(
    twinmill, brief_coasting_robot, brief_log_without_coasting, tmp_path
):
    """Text and figures of the page, and numbers of the JSON, are of one result."""
    own = ["--own", brief_log_without_coasting, "--out", tmp_path / "report", "--json"]
    model = ["--model", brief_coasting_robot.model]
    code, out, _ = twinmill("diagnose", brief_coasting_robot.log, *model, *own)
    found = json.loads(out)
    assert code == 0 and found["report"] == str(tmp_path / "report" / "index.html")
    page = (tmp_path / "report" / "index.html").read_text()
    for shown in (found["sentence"], "What is missing, with its probability", "Prior knowledge"):
        assert shown in page
    assert found["score_after"] < min(found["score_refit"], found["score"])
    assert found["ranking"][0]["effect"] == found["found"][0] == "coasting"
    told = (Path(__file__).parents[2] / "docs/inference.md").read_text()
    rows = told.partition("| field | what |\n|---|---|\n")[2].partition("\n\n")[0].splitlines()
    fields = [name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])]
    assert [name for name in found if name != "report"] == fields
    assert found["findings"][0]["parameters"][0]["unit"] == "m/s^2"
    assert "m/s²" in page
    assert ("so they do not add up to 100 %" in page) == bool(found["rest"]["probability"])


@pytest.mark.skipif("TWIN_RUN" not in os.environ, reason="TWIN_RUN does not name the program")
def test_what_one_model_misses_is_not_kept_of_several_robots(twinmill, tmp_path):
    """Refused in one sentence: each robot's own log has errors of its own."""
    log, known = tmp_path / "both.lcmlog", tmp_path / "known.toml"
    drive = ["--plant", "planar", "--model", "turbopi.toml", "--n", "2", "--duration-s", "12"]
    subprocess.run([os.environ["TWIN_RUN"], *drive, "--log", log], check=True, capture_output=True)
    own = ["--model", "turbopi.toml", "--own", log, "--keep", known]
    code, _, err = twinmill("diagnose", log, *own)
    assert code == 1 and "these are 2 robots; give logs of one robot" in " ".join(err.split())
    assert not known.exists()


def test_a_run_is_designed_for_what_probabilities_leave_open(
    twinmill, brief_coasting_robot, brief_log_without_coasting, tmp_path
):
    """The robot rolls on, so that is in question; the script keeps within duty and time."""
    given = [brief_coasting_robot.log, "--model", brief_coasting_robot.model]
    script = tmp_path / "next.csv"
    options = ["--duration-s", "15", "--max-duty-pct", "60", "-o", script, "--json"]
    code, out, _ = twinmill("next", *given, "--own", brief_log_without_coasting, *options)
    assert code == 0
    assert "coasting" in {row["effect"] for row in json.loads(out)["effects"]}
    rows = np.loadtxt(script, delimiter=",", skiprows=1)
    assert np.abs(rows[:, 1:]).max() <= 60
    assert rows[-1, 0] <= 15


def test_a_run_for_a_swarm_takes_no_own_log(twinmill, brief_coasting_robot, tmp_path):
    """Refused in one sentence, with nothing written."""
    given = [brief_coasting_robot.log, "--model", brief_coasting_robot.model]
    own = ["--own", brief_coasting_robot.log, "--for", "milling", "-o", tmp_path / "next.csv"]
    code, _, err = twinmill("next", *given, *own)
    assert code == 1 and "leave --own away" in err
    assert not [*tmp_path.iterdir()]


def test_effects_that_a_log_cannot_show_are_said_with_why(
    twinmill, brief_coasting_robot, brief_log_without_coasting
):
    """Two logs of one robot: what begins at a moment of one is looked for in neither."""
    logs = [brief_coasting_robot.log, brief_log_without_coasting]
    code, out, _ = twinmill("diagnose", *logs, "--model", brief_coasting_robot.model, "--json")
    found = json.loads(out)
    assert code == 0
    why = {row["effect"]: row["why"] for row in found["not_identifiable"]}
    assert "moment of one run" in why["abrupt_loss"]
    assert not {*why} & {*found["probability"]["effects"]}
