# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C at any stage: that nothing can be said is said, and nothing is half-written.

The robot rolls on after each stop, as its program has it, and the model lacks that.
"""

import json

import pytest

from twinmill.data.measurement import load_measurements
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile


def interrupt(*_, **__):
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def opened(brief_coasting_robot):
    model = ModelFile.load(str(brief_coasting_robot.model))
    return load_measurements([brief_coasting_robot.log], model.model), model


@pytest.mark.parametrize("stage", ["ScoreFit.fit", "comparison", "HeldOut.of", "of_few_commands"])
def test_a_fit_that_is_stopped_at_any_stage_writes_nothing(opened, tmp_path, monkeypatch, stage):
    """A file of which no JSON tells is what a script takes for one that is right."""
    monkeypatch.setattr(f"twinmill.fitting.fit.{stage}", interrupt)
    with pytest.raises(KeyboardInterrupt):
        fit(*opened, tmp_path / "fitted.toml", "test")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("verb", [["diagnose"], ["explain", "-o", "x.toml"]], ids=lambda v: v[0])
def test_stopped_before_anything_was_tried_is_said(
    twinmill, brief_coasting_robot, monkeypatch, tmp_path, verb
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("twinmill.diagnosis.infer.problem_of", interrupt)
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
    monkeypatch.setattr("twinmill.report.judged.section", interrupt)
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
