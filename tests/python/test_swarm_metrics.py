# SPDX-License-Identifier: Apache-2.0
"""Metrics of swarms in logs, against geometry and against what the twin says of its own run."""

import json
import math
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.log import LogError, read_log
from twinmill.report.swarm_metrics import section
from twinmill.swarm.metrics import swarm_metrics
from twinmill_cli import main as cli

PROGRAMS = Path(os.environ.get("TWINMILL_BIN", Path(__file__).parents[2] / "build" / "bin"))


def ring(message, n: int, radius_m: float, omega_radps: float, behaviors=None, seconds=15.0):
    """Poses at 50 Hz of robots that go around the point (1, 2)."""
    events = []
    for t in np.arange(0, seconds, 0.02):
        for i in range(n):
            at = omega_radps * t + 2 * math.pi * i / n
            heading = at + math.copysign(math.pi / 2, omega_radps)
            pose = message(
                "pose",
                utime_us=1_700_000_000_000_000 + round(t * 1e6),
                robot_id=i,
                position_m=[1 + radius_m * math.cos(at), 2 + radius_m * math.sin(at), 0.0],
                orientation_wxyz=[math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)],
            )
            events.append((f"R{i:02d}_POSE", pose))
    for i, behavior in enumerate(behaviors or []):
        events.append((f"R{i:02d}_RUN", message("run", robot_id=i, behavior=behavior)))
    return events


def metrics_of(series) -> dict[str, float]:
    return dict(zip(native.METRICS, series.mean.tolist(), strict=True))


@pytest.mark.parametrize("heading", ["recorded", "not recorded"])
@pytest.mark.parametrize("omega_radps", [0.5, -0.8])
def test_robots_on_a_circle_are_a_mill_about_its_middle(write_log, message, omega_radps, heading):
    events = ring(message, 6, 0.6, omega_radps)
    if heading == "not recorded":  # robots that drive ahead look along their paths
        for _, pose in events:
            pose.orientation_wxyz = [math.nan] * 4
    series = swarm_metrics(read_log(write_log(*events)), 1.1, 0.1)
    found = metrics_of(series)
    assert series.final == "milling"
    assert found["circliness"] == pytest.approx(0, abs=2e-3)
    assert found["radius_m"] == pytest.approx(0.6, rel=1e-3)
    assert found["rotation"] == pytest.approx(math.copysign(1, omega_radps), abs=1e-3)
    # All turn about the same point, so that the centres' least distance is 0: a wrong sign in
    # z + (v / omega) (-sin, cos) would put them 1.2 m apart.
    assert found["diffusion"] == pytest.approx(0, abs=0.02)


def test_bits_are_counted_each_by_itself_over_the_last_10_s(write_log, message):
    """Frames at 10 Hz that run 0, 1, 2, 3; before the last 10 s all are 3."""
    events = ring(message, 2, 0.6, 0.5)
    for k in range(150):
        utime_us, number = 1_700_000_000_000_000 + 100_000 * k, k % 4 if k >= 50 else 3
        said = message("telemetry", utime_us=utime_us, frame_utime_us=utime_us, robot_id=1)
        said.detected_raw = said.detected = number
        events.append(("R01_TELEMETRY", said))
    series = swarm_metrics(read_log(write_log(*events)), 1.1, 0.1)
    assert list(series.bits) == [1]
    assert series.bits[1] == pytest.approx([0.5, 0.5], abs=0.02)
    assert dict(section(series).facts)["seen, last 10 s"].startswith("bit 1 in 50 %, bit 2 in ")


def test_standing_robots_are_as_far_apart_as_they_are(write_log, message):
    events = ring(message, 3, 2.0, 1e-9)
    found = metrics_of(swarm_metrics(read_log(write_log(*events)), 1.0, 0.1))
    assert found["diffusion"] == pytest.approx(2 * math.sqrt(3), rel=1e-3)
    assert found["groups"] == 3


def test_positions_that_rest_and_go_on_are_judged_without_headings(write_log, message):
    """Both stand in the middle third, where noise of 0.3 mm tells no way."""
    random, events = np.random.default_rng(2), []
    for t in np.arange(0, 15, 0.02):
        gone_m = 0.02 * (min(t, 5) + max(t - 10, 0))
        for i in range(2):
            x_m, y_m = random.normal((gone_m, 0.5 * i), 3e-4)
            pose = message(
                "pose",
                utime_us=1_700_000_000_000_000 + round(t * 1e6),
                robot_id=i,
                position_m=[x_m, y_m, 0.0],
                orientation_wxyz=[math.nan] * 4,
            )
            events.append((f"R{i:02d}_POSE", pose))
    series = swarm_metrics(read_log(write_log(*events)), 1.1, 0.1)
    assert np.abs(series.pose[..., 2]).max() < 0.3  # they always go along x
    assert metrics_of(series)["scatter_m2"] == pytest.approx(0.25**2, rel=0.01)


def test_the_robot_with_another_behaviour_is_odd(write_log, message):
    behaviors = ["milling", "milling", "self_centering", "milling", "milling"]
    series = swarm_metrics(
        read_log(write_log(*ring(message, 5, 0.6, 0.5, behaviors, 3.0))), 1.1, 0.1
    )
    assert series.odd == [2] and series.robots == [0, 1, 3, 4, 2]
    assert series.values.shape[1] == len(native.METRICS)


def test_of_two_equal_halves_the_first_robots_make_the_ring(write_log, message):
    """As in `twin_run --behavior self_centering:2,milling:2`, whatever their names."""
    for behaviors in (["milling"] * 2 + ["b"] * 2, ["b"] * 2 + ["milling"] * 2):
        series = swarm_metrics(
            read_log(write_log(*ring(message, 4, 0.6, 0.5, behaviors, 3.0))), 1.1, 0.1
        )
        assert series.odd == [2, 3]


def test_one_robot_is_no_swarm(write_log, message):
    with pytest.raises(LogError, match="a swarm needs two"):
        swarm_metrics(read_log(write_log(*ring(message, 1, 0.6, 0.5, seconds=1.0))), 1.1, 0.1)


@pytest.mark.filterwarnings("error")
def test_robots_with_nothing_to_show_on_a_logarithmic_axis_are_drawn(write_log, message):
    """Side by side and still: no circle, so no circliness above zero."""
    for radius_m in (2.0, 1e-9):
        events = ring(message, 3, radius_m, 1e-12)
        series = swarm_metrics(read_log(write_log(*events)), 1.0, 0.1)
        none = replace(series, values=np.where(np.isfinite(series.values), 0.0, series.values))
        for shown in (series, none):
            assert all(figure.svg for figure in section(shown).figures)


@pytest.mark.parametrize(("words", "model"), [
    ("--plant planar --behavior milling --n 6 --duration-s 40", "paper.toml"),
    ("--plant planar --behavior diffusing --n 9 --duration-s 12 --seed 5", "turbopi.toml"),
    ("--plant planar --behavior milling:2,self_centering:2 --n 4 --duration-s 4", "turbopi.toml"),
    ("--plant planar --behavior self_centering:1,milling:4 --n 5 --duration-s 4", "turbopi.toml"),
    ("--plant mujoco --n 10 --start disc --spread-m 1.2 --duration-s 3", "turbopi.toml"),
    ("--plant planar --n 4 --duration-s 15 --pose-rate-hz 27", "turbopi.toml"),
])  # fmt: skip
def test_the_log_tells_what_the_twin_told(tmp_path: Path, capsys, words, model):
    """Two programs, in C++ and in Python with SciPy's filter, on the same poses."""
    program = PROGRAMS / "twin_run"
    if not program.exists():
        pytest.skip(f"no {program}: set TWINMILL_BIN")
    log = tmp_path / "run.lcmlog"
    told = json.loads(
        subprocess.check_output(
            [program, *words.split(), "--model", model, "--log", log, "--json"], text=True
        )
    )
    cli.run(["metrics", str(log), "--model", model, "--json", "--out", str(tmp_path / "r")])
    found = json.loads(capsys.readouterr().out)
    assert found["class"] == told["class"]
    assert set(found["metrics"]) == set(told["metrics"])
    for name, value in told["metrics"].items():
        assert found["metrics"][name] == pytest.approx(value, abs=1e-6), name
    assert (tmp_path / "r" / "index.html").exists()
