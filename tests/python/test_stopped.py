# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C at any stage: what was found until then is told, in a moment, and fits what is written.

The robot rolls on after each stop, as its program has it, and the model lacks that.
"""

import json
from copy import copy
from dataclasses import replace

import pytest

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis import diagnose as whole
from twinmill.diagnosis import explain as explaining
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.fitting.fit import fit
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelFile


def interrupt(*_, **__):
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def opened(brief_coasting_robot):
    model = ModelFile.load(str(brief_coasting_robot.model))
    return load_measurements([brief_coasting_robot.log], model.model), model


@pytest.fixture(scope="module")
def diagnosis(opened):
    return diagnose(*opened)


@pytest.fixture
def diagnosed(diagnosis, monkeypatch):
    """Skips the beginning of explain, done before: only the rest is run."""
    done = replace(diagnosis, search=copy(diagnosis.search))
    monkeypatch.setattr(explaining, "diagnose", lambda *_, **__: done)


def stopping_at(words):
    """Progress that is interrupted once these words come."""

    def tell(said):
        if words in said:
            raise KeyboardInterrupt

    return tell


@pytest.mark.parametrize("stage", ["round 2: ", "looking for what no effect"])
def test_what_was_found_is_told_at_every_stage_of_a_diagnosis(opened, stage):
    found = diagnose(*opened, progress=stopping_at(stage), stoppable=True)
    assert "coasting" in found.found and found.to_json()["stopped"]
    assert found.sentence.startswith("Stopped before all was tried. So far: Missing: ")
    assert "coasting" in found.sentence
    (own,) = [f for f in found.findings if f.effect == "coasting"]
    assert own.certainty == "doubtful" and own.why  # nothing was weighed against it yet
    assert found.rest.certainty == "not looked at"


def test_no_fit_is_made_once_it_was_stopped(opened, monkeypatch):
    """A fit takes as long as a round of the search: the answer would not come in a moment."""

    def refuse(*_, **__):
        raise AssertionError("a fit was made after Ctrl-C")

    def stop(said):
        if "round 2: " in said:
            monkeypatch.setattr(ScoreFit, "fit", refuse)
            raise KeyboardInterrupt

    assert diagnose(*opened, progress=stop, stoppable=True).found


def test_a_diagnosis_of_the_motion_is_told_whole_when_cameras_are_stopped(opened, monkeypatch):
    monkeypatch.setattr(whole, "with_detections", interrupt)
    found = diagnose(*opened, stoppable=True)
    assert found.sentence.startswith("Stopped before the cameras were looked at. So far: ")
    assert found.finding("coasting").certainty == "sure" and found.to_json()["stopped"]


@pytest.mark.parametrize("stage", ["ScoreFit.fit", "comparison", "HeldOut.of", "of_few_commands"])
def test_a_fit_that_is_stopped_at_any_stage_writes_nothing(opened, tmp_path, monkeypatch, stage):
    """A file of which no JSON tells is what a script takes for one that is right."""
    monkeypatch.setattr(f"twinmill.fitting.fit.{stage}", interrupt)
    with pytest.raises(KeyboardInterrupt):
        fit(*opened, tmp_path / "fitted.toml", "test")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("stage", ["_best", "_with_effects", "comparison"])
@pytest.mark.usefixtures("diagnosed")
def test_explain_that_is_stopped_says_what_it_wrote(opened, tmp_path, monkeypatch, stage):
    """At each of its stages once: what comes after the first Ctrl-C goes on as it was."""
    once = [interrupt]
    real = getattr(explaining, stage)
    monkeypatch.setattr(explaining, stage, lambda *a, **k: once.pop()() if once else real(*a, **k))
    out = tmp_path / "x.toml"
    found = explain(*opened, out=out, command="test", stoppable=True)
    assert found.path == out and found.to_json()["stopped"]
    assert ModelFile.load(str(out)).model.effects == found.diagnosis.found == ["coasting"]
    assert found.after.score < found.diagnosis.before.score


def test_explain_that_is_stopped_with_nothing_found_writes_nothing(opened, tmp_path):
    out = tmp_path / "x.toml"
    tell = stopping_at("round 1: trying")
    found = explain(*opened, out=out, command="test", progress=tell, stoppable=True)
    assert found.path is None and found.to_json()["model"] is None
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("verb", [["diagnose"], ["explain", "-o", "x.toml"]], ids=lambda v: v[0])
def test_stopped_before_anything_was_tried_is_said(
    twinmill, brief_coasting_robot, monkeypatch, tmp_path, verb
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("twinmill.inference.infer.problem_of", interrupt)
    command = [*verb, brief_coasting_robot.log, "--model", brief_coasting_robot.model]
    code, out, err = twinmill(*command, "--json")
    said = json.loads(out)
    assert (code, err) == (130, "") and said["stopped"] and said["found"] == []
    code, out, err = twinmill(*command)
    assert (code, out.strip(), err) == (130, said["sentence"], "")
    assert "Stopped before there was an answer" in out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("as_json", [True, False])
def test_a_report_that_is_stopped_loses_nothing_of_the_diagnosis(
    twinmill, brief_coasting_robot, monkeypatch, tmp_path, as_json
):
    monkeypatch.setattr("twinmill_cli.infer.section", interrupt)
    out = tmp_path / "x.toml"
    command = ["explain", brief_coasting_robot.log, "--model", brief_coasting_robot.model]
    folder = tmp_path / "report"
    words = ["-o", out, "--out", folder, *(["--json"] if as_json else [])]
    code, said, err = twinmill(*command, *words)
    assert code == 130 and "no report was drawn" in err and out.exists() and not folder.exists()
    if as_json:
        told = json.loads(said)
        assert told["stopped"] and told["found"] == ["coasting"] and told["report"] is None
    else:
        assert "coasting" in said and str(out) in said.replace("\n", "")
