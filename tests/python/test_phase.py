# SPDX-License-Identifier: Apache-2.0
"""Phase diagrams, experiments on them, and the four questions."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import twinmill_native as native

from twinmill.defaults import Question
from twinmill.swarm.axes import Axis
from twinmill.swarm.experiments import (
    agreement,
    divergence_bits,
    entropy_bits,
    nearest_cell,
    next_cells,
    read_experiments,
)
from twinmill.swarm.phase import CLASSES, Phase, phase_of
from twinmill.swarm.questions import Curve, axes_for, curve_of
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import make_request, sweep
from twinmill_cli import main as cli
from twinmill_cli.phase import _place

SEEDS = 4


def made_phase(ended: dict[tuple[float, float], list[str]]) -> Phase:
    """A diagram over v_mps 0.1, 0.2, 0.3 and omega_degps 30, 60, made of these outcomes."""
    request = Request(
        behavior="milling",
        model_name="paper.toml",
        model_text=Path(native.find_model_file("paper.toml")).read_text(),
        version="0",
        axes=[Axis("v_mps", (0.1, 0.2, 0.3)), Axis("omega_degps", (30.0, 60.0))],
        seeds=SEEDS,
    )
    names = [name for point in request.points for name in ended.get(point, ["milling"] * SEEDS)]
    zeros = np.zeros(len(names))
    columns = {name: zeros for name in ("circliness", "radius_m", "odd_ratio", "least_diffusion")}
    return phase_of(request, pa.table({**columns, "class": names}), "milling")


HALF = ["milling", "milling", "separated", "separated"]
MOST = ["milling", "milling", "milling", "separated"]


def test_a_cell_is_the_class_of_most_of_its_runs():
    phase = made_phase({(0.2, 60.0): ["cluster", "cluster", "cluster", "milling"]})
    cell = phase.request.points.index((0.2, 60.0))
    assert CLASSES[phase.mode[cell]] == "cluster"
    assert phase.to_json()[cell]["counts"] == {"milling": 1, "cluster": 3}
    assert phase.to_json()[cell]["probability"] == 0.25


def test_intervals_are_wilsons():
    # Newcombe 1998, Statistics in Medicine 17, table I, method 3: 81 of 263.
    from twinmill.swarm.classes import interval

    assert interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)


def test_five_of_nine_is_the_published_agreement_and_says_little():
    # Clopper and Pearson's bounds for 5 of 9, as tabulated: 0.212 to 0.863.
    phase = made_phase({})
    path = [(0.1, 30.0, "milling")] * 5 + [(0.2, 30.0, "separated")] * 4
    rows = "\n".join(f"{v},{w},{seen}" for v, w, seen in path)
    file = Path("floor.csv")
    runs = _read(f"v_mps,omega_degps,class\n{rows}\n", phase, file)
    match = agreement(runs)
    assert (match["agree"], match["of"]) == (5, 9)
    assert (match["low"], match["high"]) == pytest.approx((0.2120, 0.8630), abs=5e-4)


def _read(text: str, phase: Phase, name: Path):
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_text(text)
        return read_experiments(file, phase)


def test_experiments_belong_to_the_cell_around_them_or_to_none():
    phase = made_phase({})
    at = phase.request.points.index
    assert nearest_cell((0.14, 40), phase) == at((0.1, 30.0))
    assert nearest_cell((0.16, 50), phase) == at((0.2, 60.0))
    assert nearest_cell((0.36, 30), phase) is None
    assert nearest_cell((0.34, 30), phase) == at((0.3, 30.0))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v_mps,class\n0.1,milling\n", "no column 'omega_degps'"),
        ("v_mps,omega_degps,class\n0.1,30,miling\n", "nearest is 'milling'"),
        ("v_mps,omega_degps,class\n0.1,fast,milling\n", "line 2"),
        ("v_mps,omega_degps,class\nnan,30,milling\n", "v_mps is .nan.: it must be a number"),
        ("v_mps,omega_degps,class\n", "no experiment"),
        ("# by hand\nv_mps,omega_degps,class\n# day 2\n0.1,30,miling\n", "line 4"),
    ],
)
def test_a_wrong_sheet_is_told_in_one_sentence(text: str, says: str):
    with pytest.raises(ValueError, match=says):
        _read(text, made_phase({}), Path("floor.csv"))


def test_a_sheet_in_another_encoding_is_told_by_name(tmp_path: Path):
    (tmp_path / "floor.csv").write_bytes(b"\xff\xfev_mps")
    with pytest.raises(ValueError, match=r"floor\.csv: is no CSV file in UTF-8"):
        read_experiments(tmp_path / "floor.csv", made_phase({}))


def test_a_damaged_sweep_is_told_by_name(tmp_path: Path):
    (tmp_path / "sweep.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(ValueError, match=r"sweep\.parquet: is damaged; remove it"):
        read_sweep(tmp_path)


def test_a_table_that_no_sweep_wrote_is_told_by_name(tmp_path: Path):
    pq.write_table(pa.table({"class": ["milling"]}), tmp_path / "sweep.parquet")
    with pytest.raises(ValueError, match=r"sweep\.parquet: is damaged; remove it"):
        read_sweep(tmp_path)


def test_the_next_run_is_where_the_model_is_least_sure():
    phase = made_phase({(0.2, 60.0): HALF, (0.3, 30.0): MOST})
    first, second = next_cells(phase, None, set())
    assert (first["v_mps"], first["omega_degps"], first["worth_bit"]) == (0.2, 60.0, 1.0)
    assert (second["v_mps"], second["omega_degps"]) == (0.3, 30.0)
    assert [item["cell"] for item in next_cells(phase, None, {first["cell"]})] == [second["cell"]]


def test_or_where_two_models_disagree_most():
    sure = {(0.1, 60.0): ["separated"] * SEEDS}
    here, there = made_phase({(0.2, 60.0): HALF}), made_phase({(0.2, 60.0): HALF, **sure})
    (only,) = next_cells(here, there, set())
    assert (only["v_mps"], only["omega_degps"], only["worth_bit"]) == (0.1, 60.0, 1.0)


def test_bits_are_shannons():
    assert entropy_bits(np.array([[1, 0, 0], [0.5, 0.5, 0], [0.25, 0.25, 0.5]])) == pytest.approx(
        [0, 1, 1.5]
    )
    a, b = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    assert divergence_bits(a, b) == pytest.approx([1.0])
    assert divergence_bits(a, a) == pytest.approx([0.0])


def test_the_command_draws_a_page_that_needs_no_other(tmp_path: Path, capsys):
    asked = make_request(
        "milling",
        "paper.toml",
        ["v_mps=0.1:0.3:3", "omega_degps=30,60", "n=5,6"],
        seeds=6,
        duration_s=20.0,
        target_radius_m=0.1,
    )
    sweep(asked, tmp_path / "s")
    (tmp_path / "floor.csv").write_text("v_mps,omega_degps,n,class\n0.1,60,6,milling\n")
    cli.run(["phase", str(tmp_path / "s"), "--experiments", str(tmp_path / "floor.csv"), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert len(data["cells"]) == 12
    assert data["agreement"]["of"] == 1
    page = Path(data["report"]).read_text()
    assert 'type: "range"' in page and page.count("<svg") >= 3
    assert "http" not in page.replace("http://www.w3.org/", "")


def test_a_place_on_an_axis_of_the_pictures_is_refused():
    with pytest.raises(ValueError, match="no axis beyond the two of the pictures"):
        _place(["v_mps=0.1"], made_phase({}))


def test_sentences_say_which_values_serve():
    curve = Curve(
        Axis("n", (3.0, 4.0, 5.0, 6.0)),
        [0.2, 0.95, 1.0, 0.4],
        [0.1, 0.9, 0.96, 0.3],
        [0.3, 1.0, 1.0, 0.5],
        100,
    )
    told = curve.sentence("milling", 0.9)
    assert "4 to 5 gives" in told and "best at 5 (100 %" in told and "at 6 it is 40 %" in told


def test_each_question_varies_what_it_asks_for():
    assert [axes_for(q, "twist")[0].split("=")[0] for q in Question] == [
        "n",
        "v_mps",
        "range_m",
        "theta_a",
    ]


def test_unlike_robots_do_not_mill():
    # Published reading of the spread as a variance (std 0.2): nothing mills; alike: nearly all do.
    asked = make_request("milling", "paper.toml", ["theta_a=0,0.2"], seeds=60, target_radius_m=0.1)
    curve = curve_of(asked, "milling")
    assert curve.low[0] > 0.85 and curve.high[1] < 0.15
