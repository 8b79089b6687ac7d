# SPDX-License-Identifier: Apache-2.0
"""Formulas for what is left: proven where a robot that is not the twin has them, else not offered.

The robots hide what no effect of the catalogue says, written here in NumPy over whole motions.
"""

import io
import json
import re
import shlex
import subprocess
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import linregress

from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.formula_search import _by_f, _by_signs
from twinmill.diagnosis.known_physics import resembles
from twinmill.fitting.compare import compare
from twinmill.fitting.floor import body_velocity_at
from twinmill.fitting.opening import open_measurements
from twinmill.formulas.forms import PAST, Form, Motion, State, joined, own_forms, sized
from twinmill.formulas.term import CHANGE
from twinmill.formulas.units import units_of
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_names
from twinmill.programs import find_program
from twinmill_cli.main import run

STEP_S = 1 / 480  # of the robot
REACH_RAD = 0.08


def stored(turn_radps: np.ndarray) -> np.ndarray:
    """(K,) turning of which each reversal first stores 0.08 rad, as Dahl's friction (1968) does."""
    kept, s = np.empty(len(turn_radps)), 0.0
    for k, w in enumerate(turn_radps):
        change = w - abs(w) * s / REACH_RAD
        s += STEP_S * change
        kept[k] = w - change
    return kept


@pytest.fixture(scope="module")
def playing(tanh_robot, run_log) -> Path:
    """A log of a robot that turns so."""

    class Playing(tanh_robot):
        def hindered(self, motion):
            return np.column_stack([motion[:, :2], stored(motion[:, 2])])

    return run_log(Playing(), 101, 80.0)


@pytest.fixture(scope="module")
def found(playing, one_clock_base, tmp_path_factory) -> dict:
    """JSON of `diagnose` for that log, and the page of its report."""
    out = tmp_path_factory.mktemp("report")
    return diagnosed([str(playing), "--model", str(one_clock_base.path), "--out", str(out)]) | {
        "page": out
    }


def diagnosed(words: list[str]) -> dict:
    """The JSON of a diagnosis by the command."""
    said = io.StringIO()
    with redirect_stdout(said):
        run(["diagnose", *words, "--json"])
    return json.loads(said.getvalue())


def test_way_that_reversals_store_is_found_with_its_reach(found):
    """The formula stores its number times its reach at each reversal."""
    proven = found["rest"]["proven"]
    assert found["verdict"] == "outside_catalogue" and found["rest"]["depends_on"] == ["past"]
    assert proven["equation"]["adds_to"] == "omega_radps" and proven["probability"] > 0.9
    (reach_rad,) = {float(n) for n in re.findall(r"0\.\d+", proven["equation"]["state_rate"])}
    (share,) = proven["numbers"]
    stored_rad = [-share[end] * reach_rad for end in ("high", "low")]
    assert stored_rad[0] / 1.05 < REACH_RAD < 1.05 * stored_rad[1]  # the lag rounds the corners


def test_the_printed_command_adds_it_as_it_stands(
    found, playing, one_clock_base, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    said = io.StringIO()
    with redirect_stdout(said):
        run(["diagnose", str(playing), "--model", str(one_clock_base.path)])
    lines = [x for x in said.getvalue().splitlines() if x.strip().startswith("twinmill explain")]
    run(shlex.split(lines[0])[1:])
    (written,) = tmp_path.glob("*.toml")
    assert effect_names(ModelFile.load(str(written)).model) == ["equation"]
    then = diagnosed([str(playing), "--model", str(written)])
    assert then["rest"]["formula"] is None and then["score"] < 1.3 < found["score"]


@pytest.fixture(scope="module")
def explained(playing, one_clock_base, tmp_path_factory) -> dict:
    """JSON of `explain` for that log; the model that it writes is under `model`."""
    out = tmp_path_factory.mktemp("explained") / "explained.toml"
    said = io.StringIO()
    with redirect_stdout(said):
        run(
            ["explain", str(playing), "--model", str(one_clock_base.path), "-o", str(out), "--json"]
        )
    return json.loads(said.getvalue())


def test_explain_takes_the_formula_into_a_model_that_predicts_another_drive(
    explained, one_clock_base, run_log, tanh_robot
):
    assert explained["steps"][-1]["effect"] == "equation"
    assert explained["score_after"] < explained["score"]

    class Playing(tanh_robot):
        def hindered(self, motion):
            return np.column_stack([motion[:, :2], stored(motion[:, 2])])

    other = [load_measurements([run_log(Playing(), 77, 60.0)])[0]]
    with_it = compare(other, ModelFile.load(explained["model"])).score
    assert with_it < 1.3 < compare(other, one_clock_base).score


def test_the_model_that_explain_wrote_moves_on_both_plants(explained, tmp_path):
    program, model = str(find_program("twin_run")), explained["model"]
    words = [program, "--model", model, "--n", "1", "--duration-s", "1", "--json"]
    for plant in ("planar", "mujoco"):
        log = tmp_path / f"{plant}.lcmlog"
        subprocess.run([*words, "--plant", plant, "--log", str(log)], check=True)
        assert log.stat().st_size > 0


def test_explain_leaves_the_formula_out_if_asked(playing, one_clock_base, tmp_path):
    out = tmp_path / "catalogue.toml"
    said = io.StringIO()
    with redirect_stdout(said):
        words = ["explain", str(playing), "--model", str(one_clock_base.path), "-o", str(out)]
        run([*words, "--no-formula"])
    assert "equation" not in effect_names(ModelFile.load(str(out)).model)


def test_the_report_draws_it_over_the_data(found):
    page = (found["page"] / "index.html").read_text()
    assert "What depends on past follows a formula" in page


@pytest.mark.parametrize("seed", [301, 302])
def test_no_formula_is_offered_where_only_noise_is_left(tanh_robot, measure, one_clock_base, seed):
    found = diagnose([measure(tanh_robot(), seed, 60.0)], one_clock_base)
    assert found.rest.proven is None and found.to_json()["rest"]["formula"] is None


@pytest.fixture(scope="module")
def motion(tanh_robot, measure, one_clock_base) -> tuple:
    """A log as the base moves in it, at all horizons."""
    (own,) = open_measurements([measure(tanh_robot(), 2, 40.0)], one_clock_base)
    velocity = body_velocity_at(own.data, own.model, own.floor.response.points)
    return own, Motion.of([own], [velocity], range(5))


LAG = State("omega", "(1/{c})")
HEAT = State("(vx*vx + vy*vy)", "(1/{c})")
REST = State("moves", "(1/{c})")
WHEELS = State("target", "(1/{c})")
SPRING, TURNS, SWAY = State("target", ""), State("omega", ""), State("vx", "", "vy")
AROUND = "vx*max(0, 1 - abs(abs(vx)/{c} - 1)/0.4)"


@pytest.mark.parametrize(
    "form",
    [
        Form("travel", ("cos({c}*x)", "sin({c}*x)"), "place", constant=4.0, unit="1/m"),
        Form("motion", ("(t > 17)",), "time"),
        Form("motion", ("s",), PAST, HEAT, 15.0, unit="s"),
        Form("omega_radps", ("cos(theta)*omega", "sin(theta)*omega"), "heading"),
        Form("omega_radps", ("(omega - s)",), PAST, LAG, 0.6, unit="s"),
        Form("theta_rad", ("cos(theta)", "sin(theta)"), "heading"),
        Form("room_mps", ("sqrt(vx*vx + vy*vy)",) * 2, "heading"),
        Form("omega_radps", ("s*omega",), PAST, State("abs(omega)", "(1/{c})"), 15.0, unit="s"),
        Form("motion", ("(moves - s)",), "starts", REST, 0.8, unit="s"),
        Form("motion", ("s",), "way driven", State("", "sqrt(vx*vx + vy*vy)")),
        Form(
            "vx_mps", ("vx*max(0, 1 - abs(abs(vx)/{c} - 1)/0.4)",), "speed", None, 0.2, unit="m/s"
        ),
        Form("rim_mps", ("(target - s)",), PAST, WHEELS, 0.5, unit="s"),
        Form("rim_mps", ("(s - target)", "r"), CHANGE, SPRING, 9.0, unit="1/s", damping=0.2),
        Form("omega_radps", ("(s - omega)",), CHANGE, TURNS, 14.0, unit="1/s", damping=0.1),
        Form("room_mps", ("(s - vx)", "(s - vy)"), CHANGE, SWAY, 6.0, unit="1/s", damping=0.1),
    ],
    ids=lambda f: f"{f.adds_to} {f.shapes[0]}",
)
def test_a_form_changes_the_errors_as_the_plant_does_that_has_it(motion, form):
    """The plant with the effect `equation`: another program, which integrates."""
    own, moves = motion
    (form,) = sized([form], moves)
    columns = moves.columns([form], [np.ones(own.data.measured.shape, bool)])
    model = own.model.copy()
    model.add_effect("equation", joined([form]))
    names = ["equation.p0", "equation.p1"]
    rows = own.data.rows(model, names, np.array([[0.0, 0.0]]))[0]
    for k, strength in enumerate(form.strengths):
        values = np.array([[0.0, 0.0]])
        values[0, k] = 0.2 * strength
        change = (rows - own.data.rows(model, names, values)[0]) / 0.2
        # Linear in the number, features at every third pose, speeds as they were: a few percent.
        assert np.linalg.norm(change - columns[:, k]) < 0.15 * np.linalg.norm(change)


def test_units_agree_in_every_form_and_are_told_of_its_numbers(motion):
    """By dimensions: a number in front of v |v| that gives a speed is in s/m."""
    for form in own_forms(motion[1].names, 5.0, True, True):
        assert units_of(form)
    assert units_of(Form("vx_mps", ("vx*abs(vx)",), "speed")) == ["s/m"]
    assert units_of(Form("travel", ("(vx*vx + vy*vy)",), "speed")) == ["s^2/m^2"]
    of_wheel = Form("rim_mps", ("(left > 0 ? u*abs(u) : 0)",), "", command_unit="rad/s")
    assert units_of(of_wheel) == ["m s"]  # m/s over (rad/s)^2; an angle has no unit
    assert units_of(replace(of_wheel, command_unit="")) == ["m/s"]  # of a duty, a plain figure
    with pytest.raises(ValueError, match="is added"):
        units_of(Form("vx_mps", ("(vx + x)",), "speed"))


def test_signs_that_all_agree_are_as_rare_as_they_are():
    assert _by_signs(np.array([1.0, 2.0, 0.5, 3.0, 1.0])) == pytest.approx(2**-5)
    assert _by_signs(np.array([1.0, -1.0])) == pytest.approx(3 / 4)  # ++ +- -+ reach zero


def test_the_f_test_of_one_column_is_the_t_test_of_a_slope():
    random = np.random.default_rng(3)
    x, y = random.normal(size=(2, 50))
    x, y = x - x.mean(), y - y.mean()
    y = y * np.sqrt(49 / (y @ y))  # as many independent errors as squares; the mean is one more
    assert _by_f(x[:, None], y, 49.0) == pytest.approx(linregress(x, y).pvalue)


def test_known_physics_is_named_by_shape_and_sign():
    drag = Form("vx_mps", ("vx*abs(vx)",), "speed")
    assert "opposing motion: like air drag or oil" in resembles([drag], [-0.1])
    assert "drag" not in resembles([drag], [0.1])
    friction = Form("vx_mps", ("sign(vx)",), "speed")
    assert "dry friction" in resembles([friction], [-0.01])
    assert resembles([friction], [0.01]) == ""
    spring = Form("rim_mps", ("(s - target)",), CHANGE, SPRING, 2 * np.pi, damping=0.1)
    assert "a spring (all wheels): 1 Hz, damping 0.1" in resembles([spring], [0.5])
    heat = Form("motion", ("s",), PAST, HEAT, 15.0)
    assert "falls" in resembles([heat], [-1.0]) and "heat of the motors" in resembles([heat], [-1])


def test_only_what_was_seen_often_enough_comes_again():
    """Seams every 0.4 m over 2 m are five; of a wave as long as the floor there is but one."""
    pair = ("cos({c}*y)", "sin({c}*y)")
    seams, slope = (Form("travel", pair, "place", constant=2 * np.pi / m) for m in (0.4, 2.0))
    assert "every 0.40 m along y" in resembles([seams], [0.1, 0.0], {"y": (-1.0, 1.0)})
    assert resembles([slope], [0.1, 0.0], {"y": (-1.0, 1.0)}).startswith("changes along y")
