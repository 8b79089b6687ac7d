# SPDX-License-Identifier: Apache-2.0
"""twin_run --resume: an interrupted run ends with the bytes of one that was not."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

TWIN_RUN = os.environ.get("TWIN_RUN", "")
pytestmark = pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the program")

# Noise and effects that remember: filters, queues, a heat, draws of the sensor.
EFFECTS = """
[[effect]]
name = "input_delay"
delay_s = 0.05
[[effect]]
name = "heat_gain"
[[effect]]
name = "motor_lag"
[[effect]]
name = "missed_detection"
[[effect]]
name = "sensor_delay"
"""
PLANAR = {"--plant": "planar", "--n": 3, "--duration-s": 4}
MUJOCO = {"--plant": "mujoco", "--n": 2, "--duration-s": 2, "--spread-m": 0.8}
CAMERA = MUJOCO | {"--sensor": "camera", "--duration-s": 0.5}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    installed = Path(__file__).parents[2] / "twin/models/turbopi/turbopi.toml"
    path = tmp_path_factory.mktemp("model") / "model.toml"
    path.write_text(installed.read_text() + EFFECTS)
    return path


def command(model, log, options, *flags):
    words = [word for option in options.items() for word in option]
    return [*map(str, (TWIN_RUN, "--model", model, "--log", log, *words, *flags))]


def run(*arguments):
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, timeout=120, check=False
    )


def partial(log):
    return log.with_name(log.name + ".partial")


def part(whole, log, size):
    """Leaves the first bytes of a log, as a kill in the midst of writing does."""
    shutil.copy(whole, partial(log))
    os.truncate(partial(log), size)


@pytest.mark.parametrize("options", [PLANAR, MUJOCO, CAMERA], ids=["planar", "mujoco", "camera"])
def test_log_cut_anywhere_is_ended_with_the_same_bytes(model, tmp_path, options):
    whole = tmp_path / "whole"
    assert run(model, whole, options).returncode == 0
    size = whole.stat().st_size
    log = tmp_path / "cut"
    # Within the first header, within a channel's name, somewhere, all but a byte.
    for left in (3, 30, size // 2 + 1, size - 1):
        part(whole, log, left)
        done = run(model, log, options, "--resume")
        assert done.returncode == 0, done.stderr
        assert log.read_bytes() == whole.read_bytes(), f"{left} bytes left of {size}"
        assert not partial(log).exists()
        log.unlink()


def kill(process, log, enough):
    end_s = time.monotonic() + 30
    while not (partial(log).exists() and partial(log).stat().st_size > enough):
        assert process.poll() is None and time.monotonic() < end_s
        time.sleep(0.001)
    process.kill()
    process.communicate()


def test_killed_run_is_ended_with_the_same_bytes_though_its_repetition_is_killed_too(
    model, tmp_path
):
    long = PLANAR | {"--duration-s": 120}
    whole, log = tmp_path / "whole", tmp_path / "killed"
    assert run(model, whole, long).returncode == 0
    for enough in (whole.stat().st_size // 8, whole.stat().st_size // 3):
        flags = ["--resume"] if partial(log).exists() else []
        words = command(model, log, long, *flags)
        kill(subprocess.Popen(words, stdout=subprocess.DEVNULL), log, enough)
        assert enough < partial(log).stat().st_size < whole.stat().st_size
    assert run(model, log, long, "--resume").returncode == 0
    assert log.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_stopped_run_goes_on_where_it_was(model, tmp_path, stop):
    whole, log = tmp_path / "whole", tmp_path / "stopped"
    slow = PLANAR | {"--realtime-factor": 2}
    assert run(model, whole, PLANAR).returncode == 0
    with subprocess.Popen(command(model, log, slow), stdout=subprocess.DEVNULL) as process:
        time.sleep(0.7)
        process.send_signal(stop)
    left = log.read_bytes()
    assert 0 < len(left) < whole.stat().st_size
    assert whole.read_bytes().startswith(left)
    assert run(model, log, slow, "--resume").returncode == 0
    assert log.read_bytes() == whole.read_bytes()


def test_a_log_that_is_whole_stays_as_it_is(model, tmp_path):
    log = tmp_path / "a"
    assert run(model, log, PLANAR, "--resume").returncode == 0  # nothing to go on with: anew
    before = log.read_bytes()
    assert run(model, log, PLANAR, "--resume").returncode == 0
    assert log.read_bytes() == before


@pytest.mark.parametrize("change", [{"--seed": 2}, {"--n": 2}, {"--duration-s": 5}])
def test_another_request_is_refused_in_one_sentence_and_nothing_is_lost(model, tmp_path, change):
    log = tmp_path / "a"
    first = PLANAR | {"--seed": 1}
    assert run(model, log, first).returncode == 0
    before = log.read_bytes()
    done = run(model, log, first | change, "--resume")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    for option, value in change.items():
        assert f"'{option} {first[option]}'" in done.stderr
        assert f"'{option} {value}'" in done.stderr
    assert log.read_bytes() == before and os.listdir(tmp_path) == ["a"]


def test_changed_numbers_of_the_model_are_named(model, tmp_path):
    own, log = tmp_path / "own.toml", tmp_path / "a"
    own.write_text(model.read_text())
    assert run(own, log, PLANAR).returncode == 0
    before = log.read_bytes()
    own.write_text(model.read_text().replace("range_m = 1.1 ", "range_m = 1.2 "))
    done = run(own, log, PLANAR, "--resume")
    assert (
        done.returncode == 1 and "range_m = 1.1" in done.stderr and "range_m = 1.2" in done.stderr
    )
    assert log.read_bytes() == before


def test_other_messages_and_the_bus_are_refused(model, tmp_path):
    log = tmp_path / "a"
    assert run(model, log, PLANAR).returncode == 0
    damaged = bytearray(log.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    log.write_bytes(damaged)
    done = run(model, log, PLANAR, "--resume")
    assert done.returncode == 1 and "damaged" in done.stderr and done.stderr.count("\n") == 1
    assert log.read_bytes() == damaged
    assert run(model, log, PLANAR, "--resume", "--lcm-url", "memq://").returncode == 2
