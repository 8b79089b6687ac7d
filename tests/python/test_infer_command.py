# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab infer`, and `diagnose` and `explain` with a model's own log, which it answers."""

import json
import tomllib
from pathlib import Path

import pytest

from twinmill.inference.answer import Answer
from twinmill_cli.infer import _mending


def answer(verdict, *added):
    return Answer(verdict, [], 0.0, 0.1, 0.0, {}, {}, 0.0, added, None)


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
    typed = [c for _, c in _mending(said, "lab infer", [Path("run.lcmlog")], "base.toml")]
    assert typed == ([f"twinmill lab infer run.lcmlog --model base.toml -o {new}"] if new else [])


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
    (then,) = found["commands"]
    assert then.startswith("twinmill explain --own ")
    better = tmp_path / "better.toml"
    code, out, _ = twinmill("explain", log, *model, *own, "-o", better, "--json")
    assert code == 0
    told = json.loads(out)
    assert told["score_after"] < told["score"]
    (effect,) = tomllib.loads(better.read_text())["effect"]
    assert effect["name"] == "coasting"
    assert effect["deceleration_mps2"] == pytest.approx(0.7, rel=0.1)


@pytest.mark.parametrize("asked", ["--no-formula", "--formula"])
@pytest.mark.parametrize("model", ["turbopi.toml", "arm.xml"])
def test_where_no_formula_is_proposed_its_options_are_refused(twinmill, tmp_path, asked, model):
    """As the log is not there, too: nothing is read before."""
    own = ["--own", tmp_path / "own.lcmlog"] if model == "turbopi.toml" else []
    new = ["-o", tmp_path / f"new.{model.rpartition('.')[2]}"]
    code, _, err = twinmill("explain", tmp_path / "r.lcmlog", "--model", model, *own, *new, asked)
    assert code == 1 and len(err.splitlines()) == 1
    assert f"leave {asked} away" in err and ("--own" if own else "jointed") in err
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("verb", ["diagnose", "explain"])
def test_probabilities_have_no_report(
    twinmill, brief_coasting_robot, brief_log_without_coasting, tmp_path, verb
):
    """Refused before anything is judged."""
    new = ["-o", tmp_path / "new.toml"] if verb == "explain" else []
    own = ["--own", brief_log_without_coasting, "--out", tmp_path / "report"]
    model = ["--model", brief_coasting_robot.model]
    code, _, err = twinmill(verb, brief_coasting_robot.log, *model, *own, *new)
    assert code == 1
    assert "leave --out away" in err
    assert not [*tmp_path.iterdir()]
