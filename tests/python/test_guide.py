# SPDX-License-Identifier: Apache-2.0
"""`twinmill guide`: what its plan prints runs as printed, to the answer on the wheels."""

import csv
import io
import itertools
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native

import twinmill as tm
from twinmill_cli.main import BELOW, COMMANDS, LazyCommand, run

sys.path.insert(0, str(Path(__file__).parent))
from ros_stand_in import StandIn

TWIN = ["--robot", "twin"]
MINUTES = ("compare", "diagnose", "explain", "next", "twin export")  # which other tests run


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plan(*words):
    run(["guide", *words])
    with open("plan/plan.md") as stream:
        text = stream.read()
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return text, [line for kind, block in blocks if not kind for line in block.splitlines()]


def told(robot, poses, drive, wheels, clocks):
    words = f"--robot {robot} --poses {poses} --drive {drive} --wheels {wheels} --clocks {clocks}"
    return words.split()


CASES = [
    *(
        ("other", poses, "duty", wheels, "two")
        for poses, wheels in itertools.product(
            ("camera", "optitrack", "vicon", "csv"), ("mecanum", "differential")
        )
    ),
    ("other", "ros", "duty", "mecanum", "one"),
    *(("other", "csv", "wheel_speed", wheels, "two") for wheels in ("mecanum", "omni3")),
    *(("ros", poses, "twist", "differential", "two") for poses in ("camera", "ros", "optitrack")),
    *(
        ("ros", "ros", "twist", wheels, "one")
        for wheels in ("mecanum", "omni3", "ackermann", "none")
    ),
    *(("turbopi", poses, "duty", "mecanum", "two") for poses in ("camera", "optitrack")),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join(case))
def test_each_plan_has_a_model_that_loads_and_commands_that_exist(case):
    text, commands = plan(*told(*case))
    model = native.Model.load("plan/mine.toml")
    assert (model.drive, model.wheel_kind) == (case[2], case[3])
    assert ("--same-clock" in text) == (case[4] == "one" and case[1] in ("ros", "csv"))
    ruler = re.search(r"Measure with a ruler .*?`mine.toml`: (.*?)\n\n", text, re.DOTALL)[1]
    asked, there = (
        set(re.findall(r"`(\w+_m)`", ruler)),
        tomllib.loads(Path("plan/mine.toml").read_text()),
    )
    assert asked == {key for key in there["robot"] if key.endswith("_m")}
    assert "none wheels" not in text
    modules = {name: module for name, module, _ in COMMANDS}
    for words in map(shlex.split, commands):
        if words[0] == "twinmill":
            name = BELOW.get(words[1], {}).get(words[2], words[1])
            command = LazyCommand(name, modules[name], "").command()
            known = {option for p in command.params for option in p.opts}
            assert [w for w in words[2:] if w.startswith("--") and w not in known] == []
    assert "{" not in text and "\n\n\n" not in text
    assert not re.search(r"[^\n]\n## ", text)  # an empty line before each heading


def test_with_the_twin_as_robot_all_runs_as_printed():
    _, commands = plan(*TWIN)
    quick = [c for c in commands if not any(f"twinmill {word} " in c for word in MINUTES)]
    said = ""
    for command in quick:
        done = subprocess.run(
            ["bash", "-c", command.replace("twin_run", '"$TWIN_RUN"')],
            cwd="plan",
            env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
            capture_output=True,
            text=True,
            check=True,
        )
        said += done.stdout
    assert "Each does what it should" in said


def integrated(sent):
    """Poses of a body that does exactly what was sent, by the midpoint rule."""
    t_s = np.arange(sent[0, 0] - 0.5, sent[-1, 0] + 0.5, 0.01)
    row = np.searchsorted(sent[:, 0], t_s, "right") - 1
    vx, vy, omega = np.where(row[:, None] >= 0, sent[row, 1:], 0.0).T
    theta = np.cumsum(omega) * 0.01
    place = np.cumsum(np.exp(1j * (theta - omega * 0.005)) * (vx + 1j * vy)) * 0.01
    return np.column_stack([t_s, place.real, place.imag, theta])


def test_a_robot_on_ros_comes_to_the_answer_on_its_axes(folder, monkeypatch, capsys):
    """Its publisher is run; its poses are a table; import and wheels run as printed."""
    _, commands = plan(*told("ros", "csv", "twist", "differential", "one"))
    monkeypatch.chdir(folder / "plan")
    StandIn(monkeypatch).run(folder / "plan/wheels.py", monkeypatch)
    with open("wheels_sent.csv") as stream:
        _, *rows = csv.reader(stream)
    poses = integrated(np.array(rows, float))
    head = "t_s,x_m,y_m,theta_rad"
    np.savetxt("wheels_poses.csv", poses, "%.6f", delimiter=",", header=head, comments="")
    capsys.readouterr()
    lines = [c for c in commands if "wheels_poses" in c or "twinmill robot wheels" in c]
    assert len(lines) == 2
    for line in lines:
        result = run(shlex.split(line)[1:])
    assert result == 0 and "Each does what it should" in capsys.readouterr().out


def test_diagnose_says_of_the_guessed_lag_what_the_model_file_says_of_it():
    """By algebra the robot follows what is told with a lag of 0.25 s; the guess is 0.05 s."""
    plan(*told("ros", "csv", "twist", "differential", "one"))
    (comment,) = re.findall(r"^motor_lag_s = .*# (.*)$", Path("plan/mine.toml").read_text(), re.M)
    assert "while it is wrong, diagnose calls the base's numbers stale" in comment
    step_s, held = 0.01, 100
    rng = np.random.default_rng(2)
    legs = rng.choice([-0.2, 0.1, 0.3], 40), rng.choice([-1.0, 0.0, 1.0], 40)
    legs_t_s, t_s = np.arange(40) * held * step_s, np.arange(40 * held) * step_s
    felt = np.zeros((len(t_s), 2))
    for k, to in enumerate(np.repeat(np.column_stack(legs), held, axis=0)[:-1]):
        felt[k + 1] = to + (felt[k] - to) * np.exp(-step_s / 0.25)
    v_mps, turn_rad = ((felt[1:] + felt[:-1]) / 2 * [1, step_s]).T
    theta = np.append(0, np.cumsum(turn_rad))
    steps = v_mps * step_s * np.exp(1j * (theta[:-1] + turn_rad / 2))
    place = np.append(0, np.cumsum(steps))
    pose = np.column_stack([place.real, place.imag, theta]) + rng.normal(0, 1e-3, (len(t_s), 3))
    log = tm.Log.from_arrays(
        *(t_s, pose, legs_t_s, np.column_stack(legs)), kind="twist", same_clock=True
    )
    said = tm.diagnose(log, "plan/mine.toml").sentence
    assert said.startswith("Nothing is missing") and "the base's numbers are stale" in said
    found = tm.fit(log, "plan/mine.toml").model
    assert found["base.motor_lag_s"] == pytest.approx(0.25, abs=0.01)
    assert "a guess until a fit finds it" in found.file.text  # true of what the fit found, too


def test_what_is_not_said_is_asked(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", Terminal("other\nbicycle\ncsv\ndifferential\nduty\ntwo\n"))
    text, _ = plan()
    assert "on plain wheels left and right, commanded by duties; poses from a table" in " ".join(
        text.split()
    )


def test_what_is_missing_or_does_not_go_together_is_one_sentence(folder):
    with pytest.raises(ValueError, match=r"--poses is not said.*camera, optitrack"):
        run(["guide", "--json", "--robot", "other"])
    with pytest.raises(ValueError, match=r"--drive duty: .*twist"):
        run(["guide", *told("ros", "ros", "duty", "mecanum", "one")])
    with pytest.raises(ValueError, match=r"--poses vicon: .*live"):
        run(["guide", *told("turbopi", "vicon", "duty", "mecanum", "two")])
    assert list(folder.iterdir()) == []
    (folder / "plan").mkdir()
    with pytest.raises(ValueError, match="plan: exists"):
        run(["guide", *TWIN])
    run(["guide", *TWIN, "-o", "a/b"])
    assert (folder / "a" / "b" / "plan.md").is_file()


def test_plain_wheels_are_on_one_axle_unless_measured_and_a_side_is_told_alike():
    plan(*told("other", "csv", "duty", "differential", "two"))
    wheels = native.Model.load("plan/mine.toml").wheels()
    assert [wheel["x_m"] for wheel in wheels] == [0, 0]
    for name in ("wheels", "drive"):
        _, left, right, rear_left, rear_right = np.loadtxt(
            f"plan/{name}.csv", delimiter=",", skiprows=1, unpack=True
        )
        assert np.any(left != right) and np.any(left)
        assert np.array_equal(left, rear_left) and np.array_equal(right, rear_right)


def test_who_says_one_clock_is_told_to_say_so_to_the_bags_import():
    for clocks, says in (("one", True), ("two", False)):
        run(["guide", *told("ros", "ros", "twist", "mecanum", clocks), "-o", clocks])
        text = " ".join(Path(clocks, "plan.md").read_text().split())
        assert ("add `--same-clock` to it" in text) == says


@pytest.mark.parametrize("wheels", ["differential", "ackermann"])
def test_the_first_drive_stands_only_to_rest(wheels):
    """Legs that a robot could not drive were stood through: 14 of the first 20 s."""
    shares = []
    for kind in (wheels, "none"):
        run(["guide", *told("other", "csv", "twist", kind, "one"), "-o", kind])
        rows = np.genfromtxt(f"{kind}/drive.csv", delimiter=",", skip_header=1)
        stands = ~rows[:-1, 1:].any(axis=1)
        shares.append(np.diff(rows[:, 0])[stands].sum() / rows[-1, 0])
        if kind == wheels:
            assert not rows[:, 2].any()  # sideways
            turns = rows[rows[:, 3] != 0]
            assert wheels == "differential" or turns[:, 1].all()  # not on the spot
    assert shares[0] == pytest.approx(shares[1], abs=1e-3)
