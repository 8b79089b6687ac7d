# SPDX-License-Identifier: Apache-2.0
"""twin/app: what a user of twin_run gets."""

import json
import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi

TWIN_RUN = os.environ.get("TWIN_RUN", "")
pytestmark = pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the program")


def run(*arguments, plant="planar", model="paper.toml"):
    command = [TWIN_RUN, "--plant", plant, "--model", model, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def read(path):
    """All messages of a log by channel, and the log's time stamps in us."""
    messages, stamps = {}, []
    for event in lcm.EventLog(str(path), "r"):
        kind = event.channel.rsplit("_", 1)[1].lower()
        kind = "truth" if "TRUTH" in event.channel else kind
        message = getattr(turbopi, kind + "_t").decode(event.data)
        messages.setdefault(event.channel, []).append(message)
        stamps.append(event.timestamp)
    return messages, stamps


@pytest.mark.parametrize("option", ["--duration-s", "--dt-s", "--tilt-rad", "--pose-rate-hz"])
def test_nan_is_refused_by_the_name_of_its_option(tmp_path, option):
    result = run("--n", 1, "--log", tmp_path / "a.lcmlog", option, "nan")
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert option in result.stderr and "nan is no number" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_file_that_hides_the_installed_robot_is_named_and_the_robot_too(tmp_path):
    """The sentence's advice is done, and it drives."""
    body = "<body><joint name='x'/><geom size='1'/></body>"
    (tmp_path / "turbopi.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    command = [TWIN_RUN, "--n", "1", "--duration-s", "0.1", "--log", "a.lcmlog"]
    hidden = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert hidden.returncode == 1 and hidden.stderr.count("\n") == 1
    assert "twinmill twin export" in hidden.stderr
    named = ["--mjcf", hidden.stderr.split("--mjcf ")[1].strip()]
    done = subprocess.run([*command, *named], capture_output=True, cwd=tmp_path, timeout=60)
    assert done.returncode == 0


@pytest.mark.parametrize("wheels", ["mecanum", "differential", "omni3", "ackermann", "none"])
def test_wheels_that_the_firmware_mixes_duties_for_go_straight_and_others_are_refused(
    tmp_path, wheels
):
    """Speed alone is straight ahead: whatever the layout, or it is refused by its name."""
    model, log = tmp_path / "m.toml", tmp_path / "a.lcmlog"
    duties = "duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n"
    model.write_text(f'[robot]\n[base]\ndrive = "duty"\nwheels = "{wheels}"\n{duties}')
    script = tmp_path / "s.csv"
    script.write_text("t_s,speed_input,turn_input\n0,50,0\n2,0,0\n")
    result = run("--n", 1, "--script", script, "--log", log, model=model)
    assert bool(result.returncode) == (wheels in ("omni3", "ackermann"))
    if result.returncode:
        assert f"'{wheels}'" in result.stderr or f'"{wheels}"' in result.stderr
        assert result.stderr.count("\n") == 1
        assert not log.exists()
        return
    poses = read(log)[0]["TWIN_TRUTH_R00"]
    first, last = poses[0], poses[-1]
    ahead = np.array([np.cos(first.theta_rad), np.sin(first.theta_rad)])
    moved = np.array([last.x_m - first.x_m, last.y_m - first.y_m])
    assert moved @ ahead == pytest.approx(0.36, abs=0.05)  # 2 s at half of 0.36 m/s
    assert moved @ [-ahead[1], ahead[0]] == pytest.approx(0, abs=1e-6)
    assert last.theta_rad == pytest.approx(first.theta_rad, abs=1e-6)


def test_log_holds_what_real_robots_would_say(tmp_path):
    log = tmp_path / "a.lcmlog"
    result = run("--n", 3, "--behavior", "milling", "--duration-s", 11, "--log", log)
    assert result.returncode == 0
    messages, stamps = read(log)
    assert set(messages) == {
        name
        for i in range(3)
        for name in (
            f"R{i:02d}_TELEMETRY",
            f"R{i:02d}_DRIVE",
            f"R{i:02d}_POSE",
            f"R{i:02d}_RUN",
            f"TWIN_TRUTH_R{i:02d}",
        )
    }
    assert stamps == sorted(stamps)
    telemetry = messages["R01_TELEMETRY"]
    assert len(telemetry) == 500  # 11 s at 22 ms
    assert {t.utime_us - telemetry[0].utime_us - 22000 * t.seq for t in telemetry} == {0}
    assert all(t.frame_utime_us == t.utime_us and t.mode == t.MODE_TABLE for t in telemetry)
    # Milling at full speed: the vendor's mixing gives 100 and 37.
    assert {tuple(sorted(t.wheel_duty_pct)) for t in telemetry} == {(37, 37, 100, 100)}
    # This model is told velocities: of the paper's milling, 0.25 m/s and 45 degrees/s.
    driven = messages["R01_DRIVE"]
    assert [d.utime_us for d in driven] == [t.utime_us for t in telemetry]
    assert {d.kind for d in driven} == {turbopi.drive_t.KIND_TWIST}
    told = {(d.value[0], abs(d.value[2]), d.value[1], d.value[3]) for d in driven}
    assert [pytest.approx(row) for row in told] == [(0.25, np.pi / 4, 0, 0)]
    assert 8.0 < telemetry[-1].battery_V < telemetry[0].battery_V <= 8.2
    assert len(messages["R01_RUN"]) == 3  # at 0, 5 and 10 s
    assert messages["R01_RUN"][0].source == "twin"
    assert "--seed 1" in messages["R01_RUN"][0].config_toml
    assert "[sensor]" in messages["R01_RUN"][0].config_toml
    assert len(messages["R01_POSE"]) == 11 * 120 + 1


def test_poses_follow_the_unicycle_between_decisions(tmp_path):
    log = tmp_path / "a.lcmlog"
    run("--n", 1, "--behavior", "milling", "--duration-s", 5, "--log", log)
    poses = read(log)[0]["R00_POSE"]
    xy = np.array([p.position_m[:2] for p in poses])
    theta = np.unwrap([2 * np.arctan2(p.orientation_wxyz[3], p.orientation_wxyz[0]) for p in poses])
    t = np.array([p.utime_us - poses[0].utime_us for p in poses]) * 1e-6
    rate = np.polyfit(t, theta, 1)[0]
    speed = np.hypot(*np.diff(xy, axis=0).T).sum() / t[-1]
    # Alone it turns right; N(1, 0.04) is the spread of speed and turn rate.
    assert rate == pytest.approx(-np.pi / 4, rel=0.16)
    assert speed == pytest.approx(0.25, rel=0.16)
    centre = xy + speed / rate * np.column_stack([-np.sin(theta), np.cos(theta)])
    assert np.ptp(centre, axis=0).max() < 1e-4


def test_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path):
    logs = [tmp_path / name for name in "abc"]
    for log, seed in zip(logs, (7, 7, 8), strict=True):
        result = run(
            "--n", 4, "--duration-s", 5, "--seed", seed, "--log", log, model="turbopi.toml"
        )
        assert result.returncode == 0, result.stderr
    assert logs[0].read_bytes() == logs[1].read_bytes()
    assert logs[0].read_bytes() != logs[2].read_bytes()


def test_clock_offset_and_prefix_reach_the_messages(tmp_path):
    model = tmp_path / "m.toml"
    model.write_text('[base]\ndrive = "twist"\n[clock]\noffset_s = 0.1\nrate_ppm = 50\n')
    log = tmp_path / "a.lcmlog"
    result = run(
        "--n", 1, "--duration-s", 2, "--log", log, "--channel-prefix", "TWIN_", model=model
    )
    assert result.returncode == 0, result.stderr
    messages = read(log)[0]
    poses, truths = messages["TWIN_R00_POSE"], messages["TWIN_TRUTH_R00"]
    ahead_us = [p.utime_us - t.utime_us for p, t in zip(poses, truths, strict=True)]
    assert ahead_us[0] == 100000
    assert ahead_us[-1] == pytest.approx(100000 + 2e6 * 50e-6, abs=1)


def test_script_is_played_instead_of_the_table(tmp_path):
    script = tmp_path / "s.csv"
    script.write_text("t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,50,50,50,50\n1,0,0,0,0\n1.1,0,0,0,0\n")
    log = tmp_path / "a.lcmlog"
    run("--n", 1, "--script", script, "--log", log, model="turbopi_nominal.toml")
    messages = read(log)[0]
    assert {t.mode for t in messages["R00_TELEMETRY"]} == {2}
    assert "R00_DRIVE" not in messages  # the duties are what it was told
    truths = messages["TWIN_TRUTH_R00"]
    # Half of 0.36 m/s for a second, up to one control period longer.
    moved = np.hypot(truths[-1].x_m - truths[0].x_m, truths[-1].y_m - truths[0].y_m)
    assert 0.18 <= moved <= 0.18 + 0.18 * 0.022


def test_json_is_one_object(tmp_path):
    result = run("--n", 2, "--duration-s", 1, "--log", tmp_path / "a.lcmlog", "--json")
    summary = json.loads(result.stdout)
    assert summary["n"] == 2 and summary["class"] and "circliness" in summary["metrics"]


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_finishes_the_log(tmp_path, stop):
    log = tmp_path / "a.lcmlog"
    command = f"{TWIN_RUN} --plant planar --model paper.toml --n 2 --log {log}".split()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        time.sleep(1)
        process.send_signal(stop)
        out, _ = process.communicate(timeout=10)
    assert process.returncode == 0 and "stopped after" in out
    assert 20 < len(read(log)[0]["R01_TELEMETRY"]) < 200  # in real time: 45 a second
    assert os.listdir(tmp_path) == ["a.lcmlog"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--viev"], 2, "--viev"),
        (["--sensor", "lidar"], 2, "lidar"),
        (["--n", 0], 2, "--n"),
        (["--n", 1001], 2, "--n"),
        (["--duration-s", -1], 2, "--duration-s"),
        (["--behavior", "miling"], 1, "miling"),
        (["--behavior", "milling:2,shell:1", "--n", 4], 1, "--n"),
        (["--n", 50, "--spread-m", 0.5], 1, "do not fit"),
        (["--model", "nowhere.toml"], 1, "nowhere.toml"),
    ],
)
def test_mistakes_end_in_one_sentence_and_no_file(tmp_path, arguments, code, words):
    log = tmp_path / "a.lcmlog"
    command = [TWIN_RUN, "--plant", "planar", "--model", "turbopi.toml", "--duration-s", "1"]
    command += ["--log", str(log), *map(str, arguments)]
    if "--duration-s" in arguments:
        command = [word for i, word in enumerate(command) if i not in (5, 6)]
    if "--model" in arguments:
        command = [word for i, word in enumerate(command) if i not in (3, 4)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.returncode == code
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("where", [("--log", "{}"), ("--lcm-url", "file://{}?mode=w")], ids=str)
def test_a_full_disk_ends_in_one_sentence_and_no_file(tmp_path, where):
    """A file that may not grow stands for the disk."""
    log, limit_bytes = tmp_path / "a.lcmlog", 30_000
    command = [TWIN_RUN, "--plant", "planar", "--n", "9", "--duration-s", "5"]
    done = subprocess.run(
        [*command, *(word.format(log) for word in where)],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes)),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1 and "writing failed" in done.stderr
    assert done.stderr.count("\n") == 1 and os.listdir(tmp_path) == []


def test_a_bus_may_be_a_log(tmp_path):
    log, other = tmp_path / "a.lcmlog", tmp_path / "b.lcmlog"
    run("--n", 2, "--duration-s", 1, "--log", log, "--lcm-url", f"file://{other}?mode=w")
    assert other.read_bytes() == log.read_bytes() != b""


def test_a_device_is_not_replaced_by_a_log(tmp_path):
    device = tmp_path / "device"
    os.mkfifo(device)
    done = subprocess.run(
        [TWIN_RUN, "--plant", "planar", "--duration-s", "1", "--log", str(device)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1 and "no ordinary file" in done.stderr
    assert device.is_fifo()


EQUATION = '[[effect]]\nname = "equation"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[base]\nforward_gian = 1\n", "the nearest known is 'forward_gain'"),
        ("[base]\nfoo = 1\n", "unknown key 'foo' in [base]; known are "),
        (EQUATION + "formula = 3\n", "equation.formula must be a text"),
        (EQUATION + f'formula = "p0*(1{"+vx" * 8000})"\n', "vx...': "),
    ],
    ids=["near", "far", "kind", "long"],
)
def test_a_model_that_is_wrong_is_told_in_one_sentence_that_can_be_read(tmp_path, text, said):
    model = tmp_path / "m.toml"
    model.write_text(text)
    refused = run(*RUN_S, "--log", tmp_path / "a.lcmlog", model=model)
    assert refused.returncode == 1 and said in refused.stderr
    assert refused.stderr.count("m.toml") == 1 and refused.stderr.count("\n") == 1
    assert len(refused.stderr) < 600
    assert ("nearest" in refused.stderr) == ("gian" in text)


@pytest.mark.parametrize("plant", ["planar", "mujoco"])
def test_a_model_that_grows_without_bound_ends_in_one_sentence_and_no_file(tmp_path, plant):
    """ds/dt = 5 s + 1: after 20 s s is e^100 / 5, by calculus; in MuJoCo wheels only slipped."""
    rates = 'adds_to = "vx_mps"\nformula = "p0*s"\nstate_rate = "p1*s + 1"\np0 = 1\np1 = 5\n'
    told = _refused(tmp_path, rates, plant)
    assert "grows without bound" in told


@pytest.mark.parametrize("plant", ["planar", "mujoco"])
@pytest.mark.parametrize(
    ("formula", "is_run"),
    [("p0/(0*vx)", False), ("sqrt(-1 - vx*vx)", False), ("p0*vx/abs(vx)", True)],
)
def test_a_formula_that_never_has_a_value_is_no_part_of_a_run(tmp_path, plant, formula, is_run):
    """It had been left out without a word; one that has none at rest alone is run."""
    equation = f'adds_to = "vx_mps"\nformula = "{formula}"\np0 = 0.01\n'
    if is_run:
        model = _with_equation(tmp_path, equation, plant)
        words = ("--n", 2, "--duration-s", 3, "--log", tmp_path / "a.lcmlog")
        assert run(*words, model=model, plant=plant).returncode == 0
        return
    assert "no finite value" in _refused(tmp_path, equation, plant)


def _with_equation(tmp_path, equation, plant):
    """A model file: the paper's robot, for MuJoCo the installed one."""
    models = Path(__file__).parents[2] / "twin/models"
    known = models / ("paper.toml" if plant == "planar" else "turbopi/turbopi.toml")
    model = tmp_path / "m.toml"
    model.write_text(known.read_text() + "\n" + EQUATION + equation)
    return model


def _refused(tmp_path, equation, plant):
    """Last words of a run of that model."""
    log = tmp_path / "a.lcmlog"
    model = _with_equation(tmp_path, equation, plant)
    refused = run("--n", 2, "--duration-s", 20, "--log", log, model=model, plant=plant)
    assert refused.returncode == 1 and not log.exists()
    *header, told = refused.stderr.splitlines()
    assert all("does nothing here" in line for line in header)
    return told


RUN_S = ("--n", 2, "--duration-s", 1)


@pytest.mark.parametrize(
    "where",
    [("--log", "{}"), ("--lcm-url", "file://{}?mode=w"), ("--picture", "{}"), ("--video", "{}")],
    ids=lambda where: where[0],
)
def test_what_is_there_is_replaced_with_force_alone(tmp_path, where):
    kept, other = tmp_path / "kept", tmp_path / "other.lcmlog"
    kept.write_text("work of a week")
    words = (where[0], where[1].format(kept))
    words += () if where[0] == "--log" else ("--log", other)
    refused = run(*RUN_S, *words)
    assert refused.returncode == 1 and refused.stderr.count("\n") == 1
    assert "exists" in refused.stderr and "--force" in refused.stderr
    assert kept.read_text() == "work of a week" and os.listdir(tmp_path) == ["kept"]
    if where[0] in ("--log", "--lcm-url"):
        assert run(*RUN_S, *words, "--force").returncode == 0
        assert len(read(kept)[0]["R01_POSE"]) > 100


@pytest.mark.parametrize("link", [False, True])
@pytest.mark.parametrize("option", ["--model", "--script", "--behaviors"])
def test_what_is_read_is_never_replaced(tmp_path, option, link):
    texts = {
        "--model": Path(__file__).parents[2].joinpath("twin/models/paper.toml").read_text(),
        "--script": "t_s,speed_input,turn_input\n0,50,0\n1,0,0\n",
        "--behaviors": 'mine = "0,0,0,0"\n',
    }
    model, log = tmp_path / "m.toml", tmp_path / "log"
    read_file = model if option == "--model" else tmp_path / "read"
    model.write_text(texts["--model"])
    read_file.write_text(texts[option])
    if link:
        log.symlink_to(read_file)
    words = () if option == "--model" else (option, read_file)
    refused = run(*RUN_S, *words, "--log", log if link else read_file, "--force", model=model)
    assert refused.returncode == 1 and "is read by this command" in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert read_file.read_text() == texts[option]


def test_two_outputs_are_not_one_file(tmp_path):
    log = tmp_path / "a"
    refused = run(*RUN_S, "--log", log, "--picture", tmp_path / "." / "a")
    assert refused.returncode == 1 and "what --log writes" in refused.stderr
    assert not log.exists()


def started(*arguments):
    """A run of the same seconds in real time, so that others meet it."""
    words = ("--duration-s", 2, "--realtime-factor", 1, *arguments)
    command = [TWIN_RUN, "--plant", "planar", "--model", "paper.toml", *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for(true):
    end_s = time.monotonic() + 30
    while not true():
        assert time.monotonic() < end_s
        time.sleep(0.01)


@pytest.mark.parametrize("force", [[], ["--force"]])
def test_two_runs_that_write_one_log_leave_that_of_one(tmp_path, force):
    """They had written into one file, of which no message was whole, and both ended with 0."""
    log = tmp_path / "a.lcmlog"
    first = started("--n", 3, "--log", log, *force)
    wait_for(lambda: os.listdir(tmp_path))
    second = started("--n", 6, "--log", log, *force)
    codes = [first.wait(60), second.wait(60)]
    assert codes == ([0, 0] if force else [0, 1])
    if not force:
        told = second.stderr.read()
        assert f"--log {log}: exists" in told and told.count("\n") == 1
    kept = 6 if force else 3
    assert {f"R{i:02d}_POSE" for i in range(kept)} == {c for c in read(log)[0] if "POSE" in c}
    assert os.listdir(tmp_path) == ["a.lcmlog"]


def test_what_a_killed_run_left_can_be_read_and_hinders_none(tmp_path):
    log = tmp_path / "a.lcmlog"
    killed = started("--n", 6, "--log", log)
    wait_for(lambda: any(path.stat().st_size > 100_000 for path in tmp_path.iterdir()))
    killed.kill()
    killed.wait(60)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith("a.lcmlog.") and left.name.endswith(".partial")
    assert run(*RUN_S, "--log", log).returncode == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.lcmlog", left.name}
    assert read(left)[0]["R00_POSE"]


@pytest.mark.parametrize(
    ("words", "code"),
    [(["--n", "0"], 2), (["--bogus"], 2), (["--log", "/nonexistent/a"], 1)],
)
def test_a_run_that_fails_says_why_in_json(words, code):
    failed = run("--json", "--duration-s", 1, *words)
    assert failed.returncode == code and failed.stderr.count("\n") == 1
    told = json.loads(failed.stdout)
    assert told["verdict"] == "bad_input" and told["input"] == []
    assert failed.stderr == f"twin_run: {told['sentence']}\n"
    assert words[0] in told["sentence"]


@pytest.mark.parametrize("words", [["--json"], [], ["--help"]])
def test_a_result_that_cannot_be_printed_is_a_failure(tmp_path, words):
    with open("/dev/full", "w") as full:
        command = [TWIN_RUN, "--plant", "planar", "--n", "1", "--duration-s", "1", *words]
        command += ["--log", str(tmp_path / "a.lcmlog")]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 1
    assert "the output cannot be written: No space left on device" in done.stderr


def test_camera_draws_frames_and_decides_by_them(tmp_path):
    logs = []
    for seed in (1, 1, 2):
        log = tmp_path / f"{len(logs)}.lcmlog"
        where = ("--start", "square", "--n", 3, "--seed", seed)
        done = run("--sensor", "camera", *where, "--duration-s", 1, "--log", log)
        assert done.returncode == 0, done.stderr
        logs.append(log.read_bytes())
    assert logs[0] == logs[1] != logs[2]
    messages, _ = read(log)
    telemetry = [t for i in range(3) for t in messages[f"R{i:02d}_TELEMETRY"]]
    assert {t.detected_raw for t in telemetry} == {0, 1}
    # The authors' limit on the blob's size.
    assert all((t.blob_px > 300) == t.detected_raw for t in telemetry)


# What each effect does to the share of frames in which robots that stand see another one.
EFFECTS_OF_SIGHT = {
    "missed_detection": ("rate = 0.5", lambda shares: shares / 2),
    "false_detection": ("rate = 0.5", lambda shares: np.maximum(shares, 0.5)),
    "view_range": ("factor = 0.05", lambda shares: 0 * shares),
    "view_angle": ("factor = 0.05", lambda shares: 0 * shares),
    "sensor_delay": ("delay_s = 0.2", lambda shares: 0.8 * shares),  # of one second
}


@pytest.mark.parametrize("plant", ["planar", "mujoco"])
def test_effects_of_the_model_act_in_drawn_frames(tmp_path, plant):
    nobody_moves = tmp_path / "own.toml"
    nobody_moves.write_text('stand = "0,0,0,0"\n')
    installed = Path(__file__).parents[2] / "twin/models/turbopi/turbopi.toml"

    def shares(effect=""):
        model, log = tmp_path / "m.toml", tmp_path / "a.lcmlog"
        model.write_text(installed.read_text() + effect)
        words = "--sensor camera --n 10 --spread-m 1.5 --seed 2 --duration-s 1 --behavior stand"
        done = run(
            *(*words.split(), "--behaviors", nobody_moves, "--log", log, "--force"),
            plant=plant,
            model=model,
        )
        assert done.returncode == 0, done.stderr
        said = [read(log)[0][f"R{i:02d}_TELEMETRY"] for i in range(10)]
        return np.array([np.mean([t.detected_raw for t in robot]) for robot in said])

    plain = shares()
    assert set(plain) == {0, 1}
    for name, (values, expected) in EFFECTS_OF_SIGHT.items():
        found = shares(f'[[effect]]\nname = "{name}"\n{values}\n')
        # Three standard deviations of a share of 45 frames at 1/2.
        np.testing.assert_allclose(found, expected(plain), atol=0.23, err_msg=name)
        certain = (expected(plain) == 0) | (expected(plain) == 1)
        # The edge of the range is soft: a frame or two of 45 may see beyond it.
        np.testing.assert_allclose(
            found[certain], expected(plain)[certain], atol=0.05, err_msg=name
        )
    # A body that wide hides whatever is not the nearest.
    hidden = shares('[[effect]]\nname = "occlusion"\nradius_m = 0.5\n')
    assert (hidden <= plain).all() and hidden.sum() < plain.sum()


WORLD = """
[[body]]
name = "gate"
from_m = [0.5, -3]
to_m = [0.5, 3]
[[body]]
name = "evader"
at_m = [-2, 2]
radius_m = 0.1
colour = "red"
path_m = [[2, 2]]
speed_mps = 0.5
"""


@pytest.mark.parametrize("plant", ["planar", "mujoco"])
def test_bodies_are_logged_where_their_file_puts_them_and_robots_stay_on_their_side(
    tmp_path, plant
):
    world, log, script = (tmp_path / name for name in ("w.toml", "a.lcmlog", "s.csv"))
    world.write_text(WORLD)
    script.write_text("t_s,speed_input,turn_input\n0,100,0\n3,0,0\n")
    words = ("--n", 1, "--seed", 4, "--spread-m", 0.1, "--world", world, "--script", script)
    result = run(*words, "--log", log, plant=plant, model="turbopi_nominal.toml")
    assert result.returncode == 0, result.stderr
    messages, _ = read(log)
    evader = [m for m in messages["TWIN_BODY"] if m.name == "evader"]
    at_s = np.array([m.utime_us - evader[0].utime_us for m in evader]) / 1e6
    np.testing.assert_allclose([m.from_m[0] for m in evader], -2 + 0.5 * at_s, atol=1e-6)
    assert {m.from_m[1] for m in evader} == {2.0} and evader[0].colour == "red"
    # Ahead is a metre long; the wall's near side is at 0.48 m, and a robot at least 0.1 m long.
    ahead = messages["TWIN_TRUTH_R00"]
    assert abs(np.cos(ahead[0].theta_rad)) > 0.7
    assert max(m.x_m for m in ahead) < 0.4


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[body]]\nat_m = [0, 0]\n", "radius_m must be a number from 0.001 to 1000"),
        ("[[body]]\nat_m = [0]\nradius_m = 1\n", "at_m must be two numbers"),
        ("[[body]]\nradius_m = 1\n", "give at_m of a disc, or from_m and to_m of a wall"),
        ('[[body]]\nat_m = [0, 0]\nradius_m = 1\ncolour = "pink"\n', "no colour 'pink'"),
        ("[[body]]\nat_m = [5, 0]\nradius_m = 1\nsize_m = 1\n", "there is no key 'size_m'"),
        ("[[body]]\nat_m = [5, 0]\nradius_m = 1\nspeed_mps = 1\n", "give path_m and speed_mps"),
        ("[[body]]\nat_m = [0, 0]\nradius_m = 5\n", "the world's bodies left out"),
        ("body = 3\n", "must be a list of [[body]]"),
        ("[[body]\n", "w.toml, line 1"),
    ],
)
def test_a_wrong_world_is_one_sentence_and_no_log(tmp_path, text, says):
    (tmp_path / "w.toml").write_text(text)
    log = tmp_path / "a.lcmlog"
    result = run("--n", 2, "--world", tmp_path / "w.toml", "--duration-s", 1, "--log", log)
    assert result.returncode == 1 and result.stderr.count("\n") == 1
    assert says in result.stderr and not log.exists()
