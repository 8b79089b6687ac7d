# SPDX-License-Identifier: Apache-2.0
"""Sweeps in worlds with bodies: as in twin_run, by plane geometry, and with the same bytes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import lcm
import numpy as np
import pytest
import turbopi
import twinmill_native as native

from twinmill.swarm import request as request_module
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import make_request, sweep
from twinmill.swarm.workers import _run_remote

KERNELS = [("planar", False), ("planar", True), ("mujoco", True)]
PERIOD_S = 0.022
STILL, AHEAD = [0, 0, 0, 0], [40, 0, 40, 0]  # speed and turn whatever is seen
AHEAD_MPS = 0.1
GOAL = '[[body]]\nname = "goal"\nat_m = [1, 0]\nradius_m = 0.3\nsolid = false\ncolour = "red"\n'
EVADER = (
    '[[body]]\nname = "evader"\nat_m = [-2, 0]\nradius_m = 0.1\ncolour = "green"\n'
    "path_m = [[2, 0]]\nspeed_mps = 0.2\n"
)
POST = '[[body]]\nname = "post"\nat_m = [0, 0.4]\nradius_m = 0.15\n'


def alike_model(body_radius_m: float) -> native.Model:
    model = native.Model.load("paper.toml")
    model.set("robot.body_radius_m", body_radius_m)
    for name in ("idiosyncrasy.theta_a1_std", "idiosyncrasy.theta_a2_std"):
        model.set(name, 0)
    return model


def ended(cell: native.Cell, duration_s: float, kernel: tuple[str, bool]) -> dict[str, float]:
    """Measures of one run of the cell, by name."""
    plant, full = kernel
    one = np.zeros(1, np.int64), np.ones(1, np.uint64)
    (row,) = native.run_worlds([cell], *one, duration_s, full, plant)
    return dict(zip([*native.OUTCOMES, *native.DEFENCE], row, strict=False))


def request(world: Path, axes=("v_mps=0.1:0.3:3",), **changes) -> Request:
    given = {"seeds": 10, "duration_s": 12.0, "n": 4, **changes}
    return make_request("milling", "paper.toml", list(axes), world=world, **given)


@pytest.fixture
def world(tmp_path: Path) -> Path:
    path = tmp_path / "w.toml"
    path.write_text(GOAL + EVADER + POST)
    return path


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(
    ("y_m", "caught_s", "reached_s"),
    [
        # Radii of 0.1 m each, and 2 % for a touch: 60 mm before it is beside the robot. It passes
        # the hull that the robot has in MuJoCo, 0.08 m to each side.
        (0.195, (2 - np.sqrt(0.204**2 - 0.195**2)) / 0.2, np.nan),
        (1.0, np.nan, 2.7 / 0.2),
    ],
)
def test_an_evader_is_caught_where_it_touches_a_robot_or_else_reaches_the_goal(
    kernel, y_m, caught_s, reached_s
):
    bodies = native.Bodies(GOAL + EVADER, "w.toml")
    poses = [[0, y_m, 0], [0, 2, 0]]
    cell = native.Cell(alike_model(0.1), [STILL] * 2, 2, poses=poses, world=bodies)
    end = ended(cell, 20, kernel)
    assert end["caught_s"] == pytest.approx(caught_s, abs=PERIOD_S, nan_ok=True)
    assert end["reached_s"] == pytest.approx(reached_s, abs=PERIOD_S, nan_ok=True)
    assert end["inside"] == pytest.approx(0.6 / 0.2 / 20, abs=2 * PERIOD_S / 20)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_robot_of_another_colour_is_an_evader_and_one_of_another_table_is_not(kernel):
    bodies = native.Bodies(GOAL, "w.toml")
    for colours, reached_s in ((["green", "green", "red"], 1.7 / AHEAD_MPS), (["green"] * 3, None)):
        cell = native.Cell(
            alike_model(0.1),
            [STILL, STILL, AHEAD],
            2,
            poses=[[0, 2, 0], [0, -2, 0], [-1, 0, 0]],
            colours=colours,
            world=bodies,
        )
        end = ended(cell, 19.0, kernel)
        if reached_s is None:
            assert np.isnan(end["reached_s"]) and end["inside"] == 0
        else:
            assert end["reached_s"] == pytest.approx(reached_s, rel=0.01)
        assert np.isnan(end["caught_s"])


@pytest.mark.parametrize("kernel", KERNELS)
def test_no_robot_passes_a_wall(kernel):
    """A square pen of 2 m; in 30 s a robot drives 3 m."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    walls = "".join(
        f"[[body]]\nfrom_m = {list(a)}\nto_m = {list(b)}\n"
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    )
    poses = [[0.3 * np.cos(a), 0.3 * np.sin(a), a] for a in np.arange(4) * 1.4]
    for text, is_in in (("", False), (walls, True)):
        bodies = native.Bodies(text, "w.toml") if text else None
        cell = native.Cell(alike_model(0.1), [AHEAD] * 4, 4, poses=poses, world=bodies)
        assert (ended(cell, 30.0, kernel)["radius_m"] < np.hypot(0.88, 0.88)) == is_in
        trace = native.trace_world(cell, 1, 30.0, PERIOD_S, kernel[0])
        assert (np.abs(trace[..., :2]).max() < 0.95) == is_in


def truth_of(log: Path) -> tuple[np.ndarray, np.ndarray]:
    """(T, n, 2) places of robots, and (T, 2) of the evader, in twin_run's log."""
    robots, evader = {}, {}
    for event in lcm.EventLog(str(log), "r"):
        if event.channel.startswith("TWIN_TRUTH_"):
            m = turbopi.truth_t.decode(event.data)
            robots.setdefault(m.utime_us, []).append((m.x_m, m.y_m))
        elif event.channel == "TWIN_BODY":
            b = turbopi.body_t.decode(event.data)
            if b.name == "evader":
                evader[b.utime_us] = b.from_m
    times = sorted(robots)
    return np.array([robots[t] for t in times]), np.array([evader[t] for t in times])


@pytest.mark.skipif(not os.environ.get("TWIN_RUN"), reason="TWIN_RUN does not name the program")
@pytest.mark.parametrize("full", [False, True])
def test_a_cell_ends_as_twin_run_does_with_its_seed(tmp_path: Path, world: Path, full: bool):
    """Points, which nothing pushes: both plants' steps are exact then, however long.

    Robots act on green evaders and neighbours, and a post hides some.
    """
    duration_s, steps = 20.0, 909
    asked = request(world, ["spread_m=1.4"], seeds=3, duration_s=duration_s, full=full)
    sweep(asked, tmp_path / "s")
    table = read_sweep(tmp_path / "s")[1].to_pylist()
    plain = sweep(request_without(asked), tmp_path / "plain")
    differing = 0
    for row, other in zip(table, read_sweep(Path(plain["out"]))[1].to_pylist(), strict=True):
        log = tmp_path / f"{row['seed']}.lcmlog"
        words = ["--plant", "planar", "--model", "paper.toml", "--behavior", "milling", "--n", 4]
        words += ["--spread-m", 1.4, "--seed", row["seed"], "--duration-s", duration_s]
        words += ["--pose-rate-hz", 1 / PERIOD_S, "--world", world, "--log", log, "--json"]
        subprocess.run([os.environ["TWIN_RUN"], *map(str, words)], check=True, capture_output=True)
        robots, evader = truth_of(log)
        assert len(robots) == steps + 1
        last = robots[steps - 4 * 113 : steps + 1 : 4]  # every 0.088 s of the last 10 s
        from_middle_m = np.linalg.norm(last - last.mean(axis=1, keepdims=True), axis=2)
        assert row["radius_m"] == pytest.approx(from_middle_m.mean(), rel=1e-6)
        assert row["scatter_m2"] == pytest.approx((from_middle_m**2).mean(), rel=1e-6)
        after = slice(1, None)
        touched = np.linalg.norm(robots - evader[:, None], axis=2).min(axis=1)[after] < 1.02 * 0.1
        in_goal = np.linalg.norm(evader - [1, 0], axis=1)[after] < 0.3
        assert row["inside"] == pytest.approx(in_goal.mean(), abs=1.5 / steps)
        for name, when in (
            ("caught_s", touched),
            ("reached_s", in_goal & ~np.logical_or.accumulate(touched)),
        ):
            at_s = (1 + np.argmax(when)) * PERIOD_S if when.any() else np.nan
            assert row[name] == pytest.approx(at_s, abs=1.01 * PERIOD_S, nan_ok=True)
        differing += abs(row["radius_m"] - other["radius_m"]) > 1e-3
    assert differing  # what is seen of the bodies counts


def request_without(asked: Request) -> Request:
    data = json.loads(asked.to_json())
    del data["world_name"], data["world_text"]
    return Request.from_json(json.dumps(data))


def test_any_number_of_workers_gives_the_same_bytes(tmp_path: Path, world: Path, monkeypatch):
    monkeypatch.setattr(request_module, "PART_BATCHED", 7000)
    asked = request(world)
    assert len(asked.parts()) > 5
    sweep(asked, tmp_path / "one", workers=1)
    sweep(asked, tmp_path / "three", workers=3)
    one, three = ((tmp_path / name / "sweep.parquet").read_bytes() for name in ("one", "three"))
    assert one == three
    read, table = read_sweep(tmp_path / "one")
    assert read == asked and set(native.DEFENCE) <= set(table.column_names)
    assert set(table["kernel"].to_pylist()) == {"batched"}
    there = _run_remote(asked.to_json(), asked.parts()[0])
    assert there["inside"] == table["inside"].to_pylist()[: len(there["inside"])]


def test_bodies_are_drawn_where_they_are():
    name, colour, solid, radius_m, ends = native.Bodies(EVADER, "w.toml").trace([0.0, 5.0])[0]
    assert (name, colour, solid, radius_m) == ("evader", "green", True, 0.1)
    assert ends == pytest.approx(np.array([[-2, 0, -2, 0], [-1, 0, -1, 0]]))


def test_a_sweep_goes_on_only_in_the_same_world(tmp_path: Path, world: Path):
    sweep(request(world, seeds=1, duration_s=1.0), tmp_path / "s")
    world.write_text(GOAL + EVADER.replace("0.2", "0.3") + POST)
    with pytest.raises(ValueError, match="other parameters"):
        sweep(request(world, seeds=1, duration_s=1.0), tmp_path / "s")


def test_points_in_mujoco_are_not_judged_by_a_radius_that_they_do_not_have(world: Path):
    with pytest.raises(ValueError, match=r"robot\.body_radius_m = 0: robots have hulls"):
        request(world, plant="mujoco")
    assert request(world, ["robot.body_radius_m=0.1"], plant="mujoco").points


def test_a_request_without_a_world_is_what_it_was(world: Path):
    without = make_request("milling", "paper.toml", ["v_mps=0.1,0.2"])
    assert "world" not in without.to_json()
    assert without.outcomes == native.OUTCOMES


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[body]]\nat_m = [0, 0]\n", "w.toml, body 1: radius_m must be a number"),
        ("[[body]\n", "w.toml, line 1"),
        ("", "is empty"),
        (None, "cannot be read as a world"),
    ],
)
def test_a_wrong_world_is_one_sentence_and_no_folder(tmp_path: Path, text, says):
    world = tmp_path / "w.toml"
    if text is not None:
        world.write_text(text)
    words = ["--x", "v_mps=0.1,0.2", "--world", world, "--out", tmp_path / "s"]
    command = [sys.executable, "-m", "twinmill_cli.twin_sweep", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and says in done.stderr
    assert not (tmp_path / "s").exists()


def test_the_programs_tell_whether_the_evader_was_kept_out(tmp_path: Path, world: Path):
    out = tmp_path / "s"
    words = ["--x", "v_mps=0.1,0.2", "--seeds", 5, "--duration-s", 15, "--world", world]
    command = [sys.executable, "-m", "twinmill_cli.twin_sweep", *map(str, words), "--out", str(out)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    reached_s = np.array(read_sweep(out)[1]["reached_s"])
    assert f"Kept out of the goal: in {np.isnan(reached_s).sum()} of 10 worlds." in said
    command = [sys.executable, "-m", "twinmill_cli.main", "swarm", "phase", str(out), "--json"]
    told = json.loads(subprocess.check_output(command))
    assert told["goal"] == "kept-out"
    shares = [cell["probability"] for cell in told["cells"]]
    assert shares == np.isnan(reached_s).reshape(2, 5).mean(axis=1).tolist()
