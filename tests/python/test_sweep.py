# SPDX-License-Identifier: Apache-2.0
"""Sweeps: the same bytes for all workers, nothing lost by a kill, axes that do what they say."""

import math
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import twinmill_native as native

from twinmill.swarm import request as request_module
from twinmill.swarm.axes import parse_axis
from twinmill.swarm.request import Request
from twinmill.swarm.store import Store, read_sweep
from twinmill.swarm.sweep import make_request, sweep
from twinmill.swarm.workers import _run_remote

AXES = ["v_mps=0.1:0.3:3", "omega_degps=30:90:2"]


def request(axes: list[str] = AXES, **changes) -> Request:
    given = {"seeds": 10, "duration_s": 5.0, **changes}
    return make_request(
        given.pop("behavior", "milling"), given.pop("model", "paper.toml"), axes, **given
    )


@pytest.fixture
def small_parts(monkeypatch):
    """Twelve parts or so, where the real size would make one."""
    monkeypatch.setattr(request_module, "PART_BATCHED", 7000)


def test_any_number_of_workers_gives_the_same_bytes(tmp_path: Path, small_parts):
    sweep(request(), tmp_path / "one", workers=1)
    sweep(request(), tmp_path / "three", workers=3)
    assert len(request().parts()) > 5
    files = [(tmp_path / name / "sweep.parquet").read_bytes() for name in ("one", "three")]
    assert files[0] == files[1]


def test_every_cell_and_seed_is_a_row(tmp_path: Path):
    data = sweep(request(), tmp_path / "s")
    read, table = read_sweep(tmp_path / "s")
    assert data["worlds"] == table.num_rows == 3 * 2 * 10
    found = list(zip(*(table[c].to_pylist() for c in ("v_mps", "omega_degps")), strict=True))
    assert found == [(v, w) for w in (30.0, 90.0) for v in (0.1, 0.2, 0.3) for _ in range(10)]
    assert table["seed"].to_pylist() == list(range(1, 61))
    assert set(native.METRICS) | {"class", "least_diffusion", "n"} <= set(table.column_names)
    assert read == request()


def test_no_two_cells_share_seeds_unless_they_are_asked_to(tmp_path: Path):
    """A start that is unlucky is so in one cell alone; a seed of the table runs the same again."""
    cells = ["theta_a=0,1e-9"]
    sweep(request(cells), tmp_path / "apart")
    sweep(request(cells, same_seeds=True), tmp_path / "same")
    apart, same = (read_sweep(tmp_path / name)[1] for name in ("apart", "same"))
    assert same["seed"].to_pylist() == 2 * list(range(1, 11))
    radius_m = np.array(same["radius_m"]).reshape(2, 10)
    assert radius_m[0] == pytest.approx(radius_m[1], rel=1e-5)
    both = np.array(apart["radius_m"])
    assert len(np.unique(both.round(6))) == 20
    seed = apart["seed"].to_pylist()[13]
    sweep(request(["theta_a=1e-9"], first_seed=seed, seeds=1), tmp_path / "again")
    assert read_sweep(tmp_path / "again")[1]["radius_m"].to_pylist() == [both[13]]


def test_a_swarm_has_settled_since_its_groups_parted():
    """Two robots drive apart from one that stands, out of its view of 1.1 m at a known time."""
    model = native.Model.load("paper.toml")
    model.set("idiosyncrasy.theta_a1_std", 0)
    model.set("idiosyncrasy.theta_a2_std", 0)
    still, ahead = [0, 0, 0, 0], [100, 0, 100, 0]
    poses = [[0.01, 0, 0], [0, 0, 0], [0, 0, math.pi]]
    cell = native.Cell(model, [still, ahead, ahead], 3, poses=poses)
    rows = native.run_worlds([cell], np.zeros(1, np.int64), np.ones(1, np.uint64), 30.0, True)
    assert native.classify(rows) == ["separated"]
    parted_s = 1.1 / 0.25
    # Means over 5 s of groups that go from 1 to 3 pass 1.5 a quarter of that later; once a second.
    assert parted_s + 1.25 - 5 - 0.1 <= rows[0, -1] <= parted_s + 1.25 - 5 + 1.1


@pytest.mark.parametrize("plant", ["planar", "mujoco"])
@pytest.mark.parametrize(
    ("texts", "says"),
    [
        ('formula = "p0*s"\nstate_rate = "5*s + 1"', "grows without bound"),
        ('formula = "p0*s"\nstate_rate = "s*s + 1"', "grows without bound"),
        ('formula = "p0/(0*vx)"', "no finite value"),
    ],
)
def test_a_swarm_whose_model_runs_away_has_no_class(tmp_path: Path, plant, texts, says):
    """The states are (e^5t - 1) / 5 and tan t, by calculus; x / 0 is no number."""
    known = Path(__file__).parents[2] / "twin/models"
    text = (known / ("paper.toml" if plant == "planar" else "turbopi/turbopi.toml")).read_text()
    effect = f'\n[[effect]]\nname = "equation"\nadds_to = "vx_mps"\np0 = 1\n{texts}\n'
    (tmp_path / "m.toml").write_text(text + effect)
    asked = request(["n=3"], model=str(tmp_path / "m.toml"), seeds=1, duration_s=20, plant=plant)
    with pytest.raises(ValueError, match=says):
        sweep(asked, tmp_path / "s")
    assert not (tmp_path / "s").exists()


AHEAD = [40, 0, 40, 0]  # inputs of a robot that drives straight whatever it sees


def test_in_mujoco_robots_that_meet_head_on_stop_each_other():
    """Momenta of equal bodies add up to nothing; without bodies they drive through each other."""
    model = native.Model.load("turbopi.toml")
    for name in ("robot.body_radius_m", "idiosyncrasy.theta_a1_std", "idiosyncrasy.theta_a2_std"):
        model.set(name, 0)
    cell = native.Cell(model, [AHEAD] * 2, 2, poses=[[-0.2, 0, 0], [0.2, 0, math.pi]])
    world = [cell], np.zeros(1, np.int64), np.ones(1, np.uint64)
    radius_m = {
        plant: native.run_worlds(*world, 11.0, True, plant)[0, 1] for plant in ("planar", "mujoco")
    }
    assert radius_m["mujoco"] < 0.2 < 0.5 < radius_m["planar"]  # half a robot's length, metres


def test_mujoco_sweeps_have_the_same_bytes_on_any_number_of_workers(tmp_path: Path):
    asked = request(["n=2,3"], model="turbopi.toml", plant="mujoco", seeds=1, duration_s=0.3)
    sweep(asked, tmp_path / "one", workers=1)
    sweep(asked, tmp_path / "two", workers=2)
    one, two = ((tmp_path / name / "sweep.parquet").read_bytes() for name in ("one", "two"))
    assert one == two
    table = read_sweep(tmp_path / "one")[1]
    assert set(table["kernel"].to_pylist()) == {"mujoco"} and table["n"].to_pylist() == [2, 3]
    with pytest.raises(ValueError, match="other parameters"):
        sweep(request(["n=2,3"], model="turbopi.toml", seeds=1, duration_s=0.3), tmp_path / "one")
    with pytest.raises(ValueError, match="plant='moon'"):
        request(plant="moon")


def test_a_sweep_of_other_physics_is_neither_continued_nor_shared(tmp_path: Path, monkeypatch):
    asked = request(["n=2,3"], model="turbopi.toml", plant="mujoco", seeds=1, duration_s=0.3)
    planar = request()
    sweep(asked, tmp_path / "s")
    here, planar_here = asked.to_json(), planar.sha256
    monkeypatch.setattr(native, "MUJOCO_PHYSICS", "steps of at most 5 ms, pyramids")
    with pytest.raises(ValueError, match="version or physics"):
        sweep(asked, tmp_path / "s")
    with pytest.raises(ValueError, match=r"a worker simulates with .* pyramids"):
        _run_remote(here, range(1))
    assert read_sweep(tmp_path / "s")[0] == asked  # what is finished can be read
    assert planar.sha256 == planar_here


KILLED = """
import sys
from pathlib import Path
from twinmill.swarm import request as r
r.PART_BATCHED, r.PART_MUJOCO = 200_000, 10
from twinmill.swarm.sweep import make_request, sweep
plant = sys.argv[2]
how = {"planar": {"seeds": 20, "duration_s": 60.0}, "mujoco": {"seeds": 1, "duration_s": 1.0}}
asked = make_request("milling", "paper.toml", ["v_mps=0.1:0.3:40"], plant=plant, **how[plant])
print(sweep(asked, Path(sys.argv[1]), workers=1)["parts_kept_before"])
"""


@pytest.mark.parametrize("plant", request_module.PLANTS)
def test_a_killed_sweep_goes_on_and_ends_the_same(tmp_path: Path, plant: str):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    run = subprocess.Popen([sys.executable, "-c", KILLED, killed, plant])
    while len(list(killed.glob("parts/*.parquet"))) < 3:
        time.sleep(0.005)
    run.send_signal(signal.SIGKILL)
    run.wait()
    kept = {path: path.stat().st_mtime_ns for path in killed.glob("parts/*.parquet")}
    assert not (killed / "sweep.parquet").exists()
    told = subprocess.check_output([sys.executable, "-c", KILLED, killed, plant], text=True)
    assert int(told) == len(kept) >= 3
    subprocess.check_call([sys.executable, "-c", KILLED, whole, plant], stdout=subprocess.DEVNULL)
    assert (killed / "sweep.parquet").read_bytes() == (whole / "sweep.parquet").read_bytes()


def test_other_parameters_do_not_mix_into_a_folder(tmp_path: Path):
    sweep(request(), tmp_path / "s")
    with pytest.raises(ValueError, match="holds a sweep with other parameters"):
        sweep(request(seeds=11), tmp_path / "s")


def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(tmp_path: Path, monkeypatch):
    from dask.distributed import Client, LocalCluster

    monkeypatch.setattr(request_module, "PART_BATCHED", 400_000)
    asked = request(["v_mps=0.1:0.3:20"], seeds=20, duration_s=60.0)
    in_mujoco = request(["n=2,3"], plant="mujoco", seeds=1, duration_s=0.3)
    sweep(asked, tmp_path / "here")
    sweep(in_mujoco, tmp_path / "mujoco here")
    with (
        LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        assert len(set(pids)) == 4
        keep, kept = Store.keep, []

        def keep_and_kill(store: Store, number: int, columns: dict) -> None:
            keep(store, number, columns)
            kept.append(number)
            if len(kept) == 3:
                os.kill(pids[0], signal.SIGKILL)

        monkeypatch.setattr(Store, "keep", keep_and_kill)
        sweep(asked, tmp_path / "there", dask=cluster.scheduler_address)
        assert len(kept) == len(asked.parts()) > 6
        sweep(in_mujoco, tmp_path / "mujoco there", dask=cluster.scheduler_address)
    for kind in ("", "mujoco "):
        places = (tmp_path / f"{kind}{place}" / "sweep.parquet" for place in ("here", "there"))
        assert len({place.read_bytes() for place in places}) == 1


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "host-without-port"])
def test_nobody_at_the_cluster_is_one_sentence(tmp_path: Path, monkeypatch, address: str):
    monkeypatch.setattr("twinmill.swarm.workers.CONNECT_S", 0.5)
    with pytest.raises(ValueError, match=f"dask='{address}': no scheduler answers"):
        sweep(request(), tmp_path / "s", dask=address)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v_mp=0.1:0.3:3", "nearest is 'v_mps'"),
        ("v_mps", "name=from:to:count"),
        ("v_mps=0.1:0.3", "from:to:count"),
        ("n=4:7:3", "whole numbers"),
        ("n=6,6", "differ"),
        ("v_mps=0.1:0.3:1", "count of 2 to 9999"),
    ],
)
def test_a_wrong_axis_is_told_in_one_sentence(text: str, says: str):
    with pytest.raises(ValueError, match=says):
        parse_axis(text, native.Model.load("paper.toml"))


def test_an_axis_that_cannot_act_is_refused():
    mass = ["robot.mass_kg=1,1.5"]
    with pytest.raises(ValueError, match=r"robot\.mass_kg: changes nothing here: the planar"):
        make_request("milling", "turbopi.toml", mass)
    assert make_request("milling", "turbopi.toml", mass, plant="mujoco").axes


def test_a_number_that_a_formula_does_not_name_is_no_axis(tmp_path: Path):
    texts = '[[effect]]\nname = "equation"\nformula = "p0*vx"\np0 = 0.1\n'
    path = tmp_path / "m.toml"
    path.write_text(Path(native.find_model_file("paper.toml")).read_text() + texts)
    with pytest.raises(
        ValueError, match=r"equation\.p1: changes nothing here: its formula does not"
    ):
        make_request("milling", str(path), ["equation.p1=0,1"])
    assert make_request("milling", str(path), ["equation.p0=0,1"]).axes


def test_speeds_need_a_drive_where_they_can_be_chosen():
    with pytest.raises(ValueError, match="'twist'"):
        request(model="turbopi_nominal.toml")


@pytest.mark.parametrize(("v_mps", "omega_degps"), [(0.1, 90), (0.3, 20)])
def test_a_lone_robot_circles_at_the_speed_asked_for(v_mps: float, omega_degps: float):
    asked = request([f"v_mps={v_mps}", f"omega_degps={omega_degps}", "theta_a=0", "n=1"], seeds=1)
    pose = native.trace_world(asked.cell(asked.points[0]), 1, 2.0, 0.022)[:, 0]
    dt_s = 0.022
    turned = np.diff(pose[:, 2])
    assert turned == pytest.approx(-math.radians(omega_degps) * dt_s)
    # A chord of the circle of radius v / w.
    chord = 2 * v_mps / math.radians(omega_degps) * math.sin(math.radians(omega_degps) * dt_s / 2)
    assert np.hypot(*np.diff(pose[:, :2], axis=0).T) == pytest.approx(chord)


@pytest.mark.parametrize(
    ("axis", "sentence"),
    [
        ("n=0,1,2", r"^0 robots: from 1 to 1000 can run 'milling'"),
        ("n=-1,3", "^-1 robots: from 1"),
        ("n=1e30,2", "robots: from 1"),
        ("spread_m=-1,1", "spread_m = -1 m: must be 0.01 m or more"),
    ],
)
def test_a_value_that_no_swarm_can_have_is_told(axis: str, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        request([axis])


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"tables": ["odd=nan,0,1,1"]}, "speed -100 to 100"),
        ({"tables": ["odd=inf,0,1,1"]}, "speed -100 to 100"),
        ({"tables": ["odd=0,1e300,1,1"]}, "turn -2 to 2"),
        ({"tables": ["odd=0,1,1,1", "odd=0,1,2,1"]}, "odd'?: is given twice"),
        ({"seeds": 10**11}, "6 cells of 100000000000 seeds are 600000000000 worlds"),
        ({"first_seed": 2**63 - 1}, "take a smaller one"),
        ({"first_seed": 10**23}, "take a smaller one"),
        ({"axes": ["v_mps=0.1:0.3:9999", "omega_degps=1:90:9999"]}, "fewer values"),
    ],
)
def test_what_is_too_much_or_no_table_is_told_at_once(given: dict, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        request(**given)


def test_one_value_is_an_axis_too():
    paper = native.Model.load("paper.toml")
    assert parse_axis("v_mps=0.2:0.2:1", paper) == parse_axis("v_mps=0.2", paper)


def test_a_sweep_that_fails_at_once_leaves_no_folder(tmp_path: Path, monkeypatch):
    def fail(*_):
        raise OverflowError

    monkeypatch.setattr("twinmill.swarm.workers.run_part", fail)
    with pytest.raises(OverflowError):
        sweep(request(), tmp_path / "s")
    assert not (tmp_path / "s").exists()


def test_a_cell_has_a_model_of_its_own():
    """All are copies of one that was read once."""
    asked = request()
    first, last = asked.cell_model(asked.points[0]), asked.cell_model(asked.points[-1])
    assert first.get("base.speed_per_input_mps") != last.get("base.speed_per_input_mps")
    assert asked.model.get("base.speed_per_input_mps") == 0.0025


def test_the_first_species_takes_up_the_rest():
    mixed = request(["n=4:8:3"], behavior="milling:5,self_centering:1")
    for point in mixed.points:
        tables, ring = mixed.species(int(point[0]))
        assert len(tables) == point[0] and ring == point[0] - 1


def test_the_ring_is_of_the_most_frequent_species_as_twin_run_and_metrics_have_it():
    tables, ring = request(behavior="self_centering:1,milling:4").species(None)
    assert ring == 4
    assert tables == request(behavior="milling:4,self_centering:1").species(None)[0]


def test_effects_take_the_full_path_and_say_so(tmp_path: Path):
    asked = request(
        ["spread_m=1,2"], model="turbopi.toml", seeds=1, duration_s=0.5, start="facing-out"
    )
    data = sweep(asked, tmp_path / "s")
    assert data["kernels"] == {"full": 2}
    assert data["why_full"]
    assert pq.read_table(tmp_path / "s" / "sweep.parquet")["kernel"].to_pylist() == ["full"] * 2


def test_the_program_tells_what_is_wrong_in_one_line(tmp_path: Path):
    command = [sys.executable, "-m", "twinmill_cli.twin_sweep", "--x", "speed=1:2:3"]
    done = subprocess.run([*command, "--out", tmp_path / "s"], capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.startswith("twin_sweep: there is no axis 'speed'")
    assert done.stderr.count("\n") == 1 and not (tmp_path / "s").exists()


def test_a_disk_that_is_full_is_told_with_the_file(tmp_path: Path):
    """The system refuses: no file may grow beyond a byte."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    store = Store(tmp_path)
    (tmp_path / "parts").mkdir()
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, hard))
    try:
        with pytest.raises(ValueError, match=r"000000\.parquet: .*\(File too large"):
            store.keep(0, {"x": list(range(1000))})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not any((tmp_path / "parts").iterdir())
