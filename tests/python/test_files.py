# SPDX-License-Identifier: Apache-2.0
"""Outputs appear whole or not at all, and a place that cannot be written is told in a sentence.

What a command reads it never replaces: a recording cannot be made again.
"""

import errno
import importlib
import os

import lcm
import numpy as np
import pytest

from twinmill.data.recorder import Recorder
from twinmill.export.script import TwistScript, write_bag
from twinmill.files import alone_in, replacing, replacing_folder
from twinmill.report import Provenance, write_report
from twinmill.swarm.sweep import make_request, sweep
from twinmill_cli import main

POSES = "t_s,robot_id,x_m,y_m,theta_rad\n0.0,1,0.0,0.0,0.0\n0.1,1,0.0,0.0,0.0\n"
COMMANDS = "t_s,robot_id,vx_mps,vy_mps,omega_radps\n0.0,1,0.0,0.0,0.0\n"
USERS = "what somebody has written"
MODULES = {"fit": "calibrate", "add": "calibrate", "explain": "diagnose"}
TWIST_MODEL = '[base]\ndrive = "twist"\n'
FULL = OSError(errno.ENOSPC, "No space left on device")


def test_a_new_folder_comes_with_those_above_it(tmp_path):
    with replacing_folder(tmp_path / "a" / "b" / "c", force=False) as folder:
        folder.mkdir()
        (folder / "one").write_text("1")
    assert [p.name for p in sorted(tmp_path.rglob("*"))] == ["a", "b", "c", "one"]


@pytest.mark.parametrize("made", [replacing, replacing_folder])
def test_on_a_full_disk_a_sentence_is_all_that_is_left(made, tmp_path):
    out = tmp_path / "c" if made is replacing else tmp_path / "a" / "b" / "c"
    sentence = rf"{out}: cannot be written \(No space left on device\)"
    with pytest.raises(ValueError, match=sentence), made(out, force=False):
        raise FULL
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("force", [None, False])
@pytest.mark.parametrize("made", [replacing, replacing_folder])
def test_what_another_command_wrote_meanwhile_stays(made, tmp_path, force):
    """Two commands at once had both ended with 0, and one result was lost."""
    out = tmp_path / "out"
    with pytest.raises(ValueError, match=r"out: exists; choose another name") as told:  # noqa: SIM117
        with made(out, force) as mine:
            if made is replacing_folder:
                mine.mkdir()
            with made(out, force) as other:
                if made is replacing_folder:
                    other.mkdir()
                    other /= "one"
                other.write_text(USERS)
    assert ("force=True" in str(told.value)) == (force is False)
    (kept,) = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert kept.read_text() == USERS


@pytest.mark.parametrize("verb", ["fit", "add", "explain", "next"])
def test_a_model_that_another_command_wrote_meanwhile_stays(
    monkeypatch, twinmill, brief_coasting_robot, tmp_path, verb
):
    out, words = tmp_path / "new.toml", ["coasting"] if verb == "add" else []
    module = importlib.import_module(f"twinmill_cli.{MODULES.get(verb, verb)}")
    reads = "read" if verb == "explain" else "load"
    load = getattr(module, reads)

    def other_is_first(*given):
        out.write_text(USERS)
        return load(*given)

    monkeypatch.setattr(module, reads, other_is_first)
    robot = brief_coasting_robot
    code, _, err = twinmill(verb, *words, robot.log, "--model", robot.model, "-o", out)
    assert code == 1 and "new.toml: exists" in err
    assert [path.read_text() for path in tmp_path.iterdir()] == [USERS]


def test_two_recordings_under_one_name_are_two_whole_files(tmp_path):
    out = tmp_path / "run.lcmlog"
    with Recorder(out, force=True) as first, Recorder(out, force=True) as second:
        for recorder, count in ((first, 3), (second, 5)):
            for _ in range(count):
                recorder.add("R00_POSE", b"pose")
    events = [event.data for event in lcm.EventLog(str(out), "r")]
    assert events == [b"pose"] * 3  # of the one that ended last
    assert os.listdir(tmp_path) == ["run.lcmlog"]


def test_a_sweep_is_written_by_one_command_at_a_time(tmp_path):
    """Two that wrote one part: one had ended with the number of an error."""
    request = make_request("milling", "paper.toml", ["v_mps=0.1,0.2"], seeds=2, duration_s=1.0)
    with (
        alone_in(tmp_path),
        pytest.raises(ValueError, match=f"{tmp_path}: another command writes in it"),
    ):
        sweep(request, tmp_path)
    assert sweep(request, tmp_path)["worlds"] == 4


def test_a_sweep_that_could_not_begin_leaves_nothing_and_can_begin(monkeypatch, tmp_path):
    """An empty folder of parts was left, in which the next sweep was refused."""
    request = make_request("milling", "paper.toml", ["v_mps=0.1,0.2"], seeds=2, duration_s=1.0)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full_disk)
        with pytest.raises(ValueError, match=r"manifest\.json: .*No space left on device"):
            sweep(request, tmp_path / "a" / "s")
    assert not list(tmp_path.iterdir())
    assert sweep(request, tmp_path / "a" / "s")["worlds"] == 4


def full_disk(*_):
    raise FULL


def test_a_missing_folder_is_named(tmp_path):
    absent = tmp_path / "a"
    refused(rf"there is no folder {absent}; make the folder", replacing, absent / "b.toml")
    (tmp_path / "file").write_text("")
    for made in (replacing, replacing_folder):
        refused(rf"{tmp_path / 'file'} is a file", made, tmp_path / "file" / "b")


def refused(sentence, made, out) -> None:
    with pytest.raises(ValueError, match=sentence), made(out, force=False):
        pass


def test_no_command_ends_with_the_number_of_an_error(monkeypatch, capsys, tmp_path):
    def fail(_):
        (tmp_path / "absent").read_text()

    monkeypatch.setattr(main, "run", fail)
    with pytest.raises(SystemExit) as left:
        main.main()
    assert left.value.code == 1
    assert capsys.readouterr().err == f"twinmill: {tmp_path}/absent: No such file or directory.\n"


@pytest.fixture
def keeping(twinmill):
    """Runs a command that must refuse to write over this file; the file stays as it is."""

    def run(kept, *arguments):
        before = kept.read_bytes()
        code, out, err = twinmill(*arguments, "--force")
        assert (code, out) == (1, "") and len(err.splitlines()) == 1
        assert "is read by this command" in err and "choose another name" in err
        assert kept.read_bytes() == before

    return run


@pytest.mark.parametrize(
    "verb", [["fit"], ["add", "coasting"], ["explain"], ["next"]], ids=lambda verb: verb[0]
)
def test_no_command_writes_over_its_recording(keeping, coasting_robot, tmp_path, verb):
    log = tmp_path / "run.lcmlog"
    log.write_bytes(coasting_robot.log.read_bytes())
    keeping(log, *verb, log, "--model", coasting_robot.model, "-o", log)


def test_another_name_of_the_recording_is_the_recording(keeping, coasting_robot, tmp_path):
    log, link = tmp_path / "run.lcmlog", tmp_path / "link.toml"
    log.write_bytes(coasting_robot.log.read_bytes())
    os.symlink(log, link)
    keeping(log, "fit", log, "--model", coasting_robot.model, "-o", link)
    assert link.is_symlink()


@pytest.mark.parametrize("given", ["p.csv", "c.csv"])
def test_import_writes_over_no_table_that_it_reads(keeping, tmp_path, given):
    poses, commands = tmp_path / "p.csv", tmp_path / "c.csv"
    poses.write_text(POSES)
    commands.write_text(COMMANDS)
    out = tmp_path / given
    keeping(out, "import", "--poses", poses, "--commands", commands, "-o", out)


def test_import_writes_over_no_part_of_a_bag_that_it_reads(keeping, tmp_path):
    """The folder of a rosbag2 is what was given; its recording had been replaced."""
    bag = tmp_path / "bag"
    write_bag(TwistScript(np.array([0.0]), np.array([[0.1, 0.0, 0.0]]), 1.0), bag, force=False)
    words = ["import", "--bag", bag, "--pose", "/pose", "--command", "/cmd_vel"]
    for part in sorted(bag.iterdir()):
        keeping(part, *words, "-o", part)
    os.symlink(bag / "metadata.yaml", tmp_path / "other.yaml")
    keeping(bag / "metadata.yaml", *words, "-o", tmp_path / "other.yaml")


def test_export_and_plot_write_over_no_log(keeping, coasting_robot, tmp_path):
    log = tmp_path / "run.png"
    log.write_bytes(coasting_robot.log.read_bytes())
    keeping(log, "export", log, "--to", "mcap", "-o", log)
    keeping(log, "plot", log, "-o", log)


def test_a_folder_that_holds_an_input_is_not_replaced(tmp_path):
    log = tmp_path / "runs" / "deep" / "run.lcmlog"
    log.parent.mkdir(parents=True)
    log.write_text("a log")
    with (
        pytest.raises(ValueError, match="is read by this command"),
        replacing_folder(tmp_path / "runs", force=True, inputs=[log]),
    ):
        pass
    assert log.read_text() == "a log"


@pytest.mark.parametrize(
    "words",
    ["compare {0.log} --model {0.model}", "challenge --n 1", "challenge --intervals 1"],
)
def test_a_page_that_is_no_report_is_not_replaced_by_one(twinmill, coasting_robot, tmp_path, words):
    (tmp_path / "index.html").write_text(USERS)
    code, out, err = twinmill(*words.format(coasting_robot).split(), "--out", tmp_path)
    assert (code, out) == (1, "") and "index.html: exists and is no report" in err
    assert [path.read_text() for path in tmp_path.iterdir()] == [USERS]


def test_a_report_is_replaced_by_the_next_one(tmp_path):
    source = Provenance("twinmill", "twinmill 0", "")
    first = write_report(tmp_path, "first", source, [])
    assert write_report(tmp_path, "second", source, []) == first
    assert "second" in first.read_text()


def test_a_report_that_cannot_be_written_leaves_no_folder(monkeypatch, tmp_path):
    monkeypatch.setattr(os, "replace", full_disk)
    with pytest.raises(ValueError, match="No space left on device"):
        write_report(tmp_path / "a" / "b", "first", Provenance("twinmill", "twinmill 0", ""), [])
    assert not list(tmp_path.iterdir())


def test_a_challenge_leaves_a_folder_of_other_things_alone(twinmill, tmp_path):
    (tmp_path / "done").mkdir()
    for name in ("mine.txt", "done/week.csv"):
        (tmp_path / name).write_text(USERS)
    code, _, err = twinmill("challenge", "--n", "1", "--out", tmp_path)
    assert code == 1 and "holds mine.txt" in err
    assert (tmp_path / "done/week.csv").read_text() == USERS


def test_a_bag_replaces_a_bag_and_no_other_folder(tmp_path):
    script = TwistScript(np.array([0.0]), np.array([[0.1, 0.0, 0.0]]), 1.0)
    write_bag(script, tmp_path / "bag", force=False)
    write_bag(script, tmp_path / "bag", force=True)
    (tmp_path / "bag" / "notes.txt").write_text(USERS)
    with pytest.raises(ValueError, match=r"holds notes\.txt"):
        write_bag(script, tmp_path / "bag", force=True)
    assert (tmp_path / "bag" / "notes.txt").read_text() == USERS


@pytest.mark.parametrize(
    "words",
    [
        "wheels --model m.toml -o m.toml --force",
        "wheels --model m.toml --script-as publisher -o m.toml --force",
        "characterise --robot 3 --script s.csv --script-as publisher --out s.csv --force",
    ],
)
def test_a_script_is_not_written_over_what_it_is_made_of(monkeypatch, twinmill, tmp_path, words):
    monkeypatch.chdir(tmp_path)
    texts = {"m.toml": TWIST_MODEL, "s.csv": "t_s,vx_mps,vy_mps,omega_radps\n0,0.1,0,0\n1,0,0,0\n"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    code, _, err = twinmill(*words.split())
    assert code == 1 and "never replaced" in err
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == texts


def test_what_is_left_of_a_killed_recording_is_kept_and_hinders_none(tmp_path):
    """Its name is one that the user never gave: the next recording had been refused for it."""
    recorder = Recorder(tmp_path / "run.lcmlog", force=False)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith("run.lcmlog.") and left.name.endswith(".partial")
    with Recorder(tmp_path / "run.lcmlog", force=False) as again:
        again.add("R00_POSE", b"pose")
    assert {path.name for path in tmp_path.iterdir()} == {left.name, "run.lcmlog"}
    assert recorder.events == 0
