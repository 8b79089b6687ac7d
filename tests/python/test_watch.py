# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm watch`: what the viewer is given, read back with its own reader."""

import json
import math
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi

from twinmill.data.lcm_log import split_events
from twinmill.data.log import read_log
from twinmill.data.measurement import load_measurements
from twinmill.data.multi_log import RecordedRobot, multi_log_of
from twinmill.data.stream import Window, from_log
from twinmill.extras import MissingExtra, missing
from twinmill.fitting.compare import compare
from twinmill.model.model_file import ModelFile
from twinmill.watch.live_score import WINDOW_S, LiveScorer
from twinmill_cli.main import run

needs_viewer = pytest.mark.skipif(find_spec("rerun") is None, reason=missing("rerun"))
SEEN_FROM = 70  # pose from which on the robot sees a neighbour


@pytest.fixture
def log(write_log, message):
    """Two seconds of a robot on a line along x, and of its twin on a line along y."""
    path = write_log()
    writer = lcm.EventLog(str(path), "w", overwrite=True)
    for k in range(200):
        utime_us = 1_700_000_000_000_000 + 10_000 * k
        for prefix, place_m in (("", [0.002 * k, 0.0, 0.1]), ("TWIN_", [0.0, 0.001 * k, 0.1])):
            pose = message("pose", utime_us=utime_us, robot_id=1, position_m=place_m)
            pose.orientation_wxyz = [math.cos(0.3), 0.0, 0.0, math.sin(0.3)]
            said = message("telemetry", utime_us=utime_us, robot_id=1)
            said.detected, said.wheel_duty_pct = int(k >= SEEN_FROM), [50, 50, 50, 50]
            said.frame_utime_us = utime_us
            writer.write_event(utime_us, f"{prefix}R01_POSE", pose.encode())
            writer.write_event(utime_us, f"{prefix}R01_TELEMETRY", said.encode())
    writer.close()
    return path


def read_back(path, entity, component):
    """(times in s, values) of one component of one entity."""
    from rerun.chunk import RrdReader

    rows = []
    for chunk in RrdReader(path).stream().collect().stream():
        batch = chunk.to_record_batch()
        names = [n for n in batch.schema.names if n.split("/")[-1].endswith(component)]
        if chunk.entity_path == entity and names and "time" in batch.schema.names:
            at_s = batch["time"].view("int64").to_numpy() / 1e9
            rows += zip(at_s.tolist(), batch[names[0]].to_pylist(), strict=True)
    rows.sort(key=lambda row: row[0])
    return np.array([at_s for at_s, _ in rows]), [value[0] for _, value in rows]


@needs_viewer
def test_poses_bits_and_headings_come_back_from_the_recording(log, tmp_path, capsys):
    out = tmp_path / "o.rrd"
    run(["watch", str(log), "--save", str(out), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert said["robots"] == ["R01", "TWIN_R01"] and said["messages"] == 800
    for entity, axis, step_m in (("/robots/R01", 0, 0.002), ("/twins/R01", 1, 0.001)):
        at_s, place_m = read_back(out, entity, "translation")
        np.testing.assert_allclose(at_s, 0.01 * np.arange(200), atol=1e-9)
        np.testing.assert_allclose(np.array(place_m)[:, axis], step_m * np.arange(200), atol=1e-6)
        _, turned = read_back(out, entity, "quaternion")
        np.testing.assert_allclose(turned[0], [0, 0, math.sin(0.3), math.cos(0.3)], atol=1e-6)
    at_s, states = read_back(out, "/bits/R01", "state")
    assert states == ["none", "sees"]
    np.testing.assert_allclose(at_s, [0, 0.01 * SEEN_FROM])


@needs_viewer
def test_no_view_is_drawn_of_a_robot_whose_camera_was_not_recorded(log, tmp_path):
    """Its commands were: as in logs of imported tables."""
    blind = tmp_path / "blind.lcmlog"
    writer = lcm.EventLog(str(blind), "w", overwrite=True)
    for event in lcm.EventLog(str(log), "r"):
        data = event.data
        if event.channel == "R01_TELEMETRY":
            said = turbopi.telemetry_t.decode(data)
            said.detected = said.frame_utime_us = 0
            data = said.encode()
        writer.write_event(event.timestamp, event.channel, data)
    writer.close()
    run(["watch", str(blind), "--save", str(tmp_path / "o.rrd")])
    for entity, count in (("/robots/R01/view", 0), ("/twins/R01/view", 2)):
        assert len(read_back(tmp_path / "o.rrd", entity, "colors")[0]) == count
    assert len(read_back(tmp_path / "o.rrd", "/bits/R01", "state")[0]) == 0


@needs_viewer
def test_the_viewers_own_program_finds_no_fault(log, tmp_path):
    run(["watch", str(log), "--save", str(tmp_path / "o.rrd")])
    checked = subprocess.run(
        [Path(sys.executable).with_name("rerun"), "rrd", "verify", tmp_path / "o.rrd"],
        capture_output=True,
        text=True,
    )
    assert checked.returncode == 0, checked.stderr


def scores(log, model):
    """By `LiveScorer`, every 4 s of a log."""
    scorer, window, found = LiveScorer(ModelFile.load(str(model))), Window(WINDOW_S), []
    batches = from_log(log, [])
    for number, (now_us, batch) in enumerate(batches, start=1):
        window.add(now_us, batch)
        if number % 40 == 0 and number * 0.1 >= WINDOW_S:
            (recorded,) = multi_log_of(window.events(), log).robots
            live = scorer.score(recorded)
            found.append(live.score)
            error_m = np.linalg.norm(live.predicted[-1, :2] - recorded.log.pose[-1, :2])
            assert error_m < 0.2
    return np.array(found)


def test_score_is_one_for_the_model_that_drove_and_more_without_its_effect(coasting_robot):
    true = scores(coasting_robot.log, coasting_robot.true_model)
    poor = scores(coasting_robot.log, coasting_robot.model)
    assert len(true) > 20
    assert 0.7 < np.median(true) < 1.3
    assert np.median(poor) > 2 * np.median(true)


def test_a_robot_that_stands_has_no_score(driven):
    robot = driven()
    robot.command[:] = 0
    assert LiveScorer(ModelFile.load("turbopi.toml")).score(RecordedRobot("", robot)) is None


def test_window_forgets_what_is_old(log):
    window = Window(0.5)
    for now_us, batch in from_log(log, []):
        window.add(now_us, batch)
    kept = sum(len(payloads) for payloads in window.events().by_channel.values())
    whole = sum(len(p) for p in split_events(log.read_bytes(), "").by_channel.values())
    assert whole == 800
    assert kept == pytest.approx(200, abs=8)


def test_without_the_viewer_one_sentence_says_how_to_get_it(log, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)  # as if it were not there
    with pytest.raises(MissingExtra, match=r"install it with: .*pip install 'twinmill\[watch\]'"):
        run(["watch", str(log), "--save", str(tmp_path / "o.rrd")])
    assert not (tmp_path / "o.rrd").exists()


@needs_viewer
def test_bad_input_is_one_sentence_and_nothing_is_written(log, tmp_path):
    before = set(tmp_path.iterdir())
    for arguments, sentence in (
        (["none.lcmlog", "--save", str(tmp_path / "o.rrd")], "cannot be read"),
        ([str(log), "--save", str(log)], "--force"),
        ([str(log), "--save", "o.rrd", "--spawn"], "one of them"),
        ([str(log), "--model", "none.toml", "--save", "o.rrd"], r"none\.toml"),
    ):
        with pytest.raises(ValueError, match=sentence):
            run(["watch", *arguments])
    assert set(tmp_path.iterdir()) == before


def test_the_score_is_that_of_compare(brief_coasting_robot):
    """One stretch; its first 1.5 s, which need commands of before, are not judged here."""
    model = ModelFile.load(str(brief_coasting_robot.model))
    said = compare(load_measurements([brief_coasting_robot.log], model.model), model).score
    robot = read_log(brief_coasting_robot.log).robots[3]
    assert LiveScorer(model).score(RecordedRobot("", robot)).score == pytest.approx(said, rel=0.03)
