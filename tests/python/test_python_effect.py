# SPDX-License-Identifier: Apache-2.0
"""Effects written in Python, found in paths that are algebra and were made without the library."""

import json
import math
import pickle
import re

import numpy as np
import pytest

import twinmill as tm

BASE = 'drive = "twist"\nwheels = "none"\ncontrol_period_s = 0.02\nspeed_per_input_mps = 0.0036\n'
TWIST = f'name = "t"\n[base]\n{BASE}'
STEP_S, HELD_S, PARTS = 0.02, 1.0, 30
GRAIN, ALONG_RAD = 0.15, 0.6  # of a carpet: so much faster along this direction of the room


@tm.python_effect(
    "vx_mps", {"along_x": tm.Number(low=-1, high=1), "along_y": tm.Number(low=-1, high=1)}
)
def grain(vx, theta, along_x, along_y):
    """Faster along one direction of the room than against it."""
    return vx * (along_x * np.cos(theta) + along_y * np.sin(theta))


UNKNOWN = {
    "quantity": (("vx_mp", lambda vx, p: p * vx, {}), "adds_to = 'vx_mp' is unknown; .* 'vx_mps'"),
    "signal": (("vx_mps", lambda speed, p: p * speed, {}), "unknown name 'speed'"),
    "signal of wheels": (("vx_mps", lambda rim, p: p * rim, {}), "unknown name 'rim'"),
    "signal of a rate": (
        ("vx_mps", lambda s, p: p * s, {"state_rate": lambda vz, s, p: vz - s}),
        "state_rate = .*unknown name 'vz'",
    ),
}


@pytest.mark.parametrize(("effect", "said"), UNKNOWN.values(), ids=UNKNOWN)
def test_what_no_formula_knows_is_refused_where_it_is_written(effect, said):
    adds_to, function, rates = effect
    with pytest.raises(ValueError, match=said) as refused:
        tm.python_effect(adds_to, {"p": tm.Number()}, **rates)(function)
    assert "\n" not in str(refused.value)


def test_the_card_names_all_quantities_that_can_be_added_to():
    """Those that the twin takes: each is tried."""
    card = str(tm.effect("equation"))
    for name in ("duty", "rim_mps", "vx_mps", "vy_mps", "omega_radps", "travel", "motion", "aside"):
        tm.python_effect(name, {"p": tm.Number()})(lambda t, p: p * t)
        assert name in card
    assert {"room_mps", "theta_rad", "adds_to"} <= set(card.replace(",", " ").split())


def test_an_effect_pickles_as_the_function_in_whose_place_it_stands():
    assert pickle.loads(pickle.dumps(grain)) is grain


@pytest.fixture(scope="module")
def carpet(tmp_path_factory) -> tuple[tm.Log, tm.Model]:
    """A robot that drives (1 + GRAIN cos(theta - ALONG_RAD)) times as fast as it is told."""
    rng = np.random.default_rng(4)
    told = np.column_stack([rng.uniform(0.1, 0.3, PARTS), rng.uniform(-1, 1, PARTS)])
    v, w = np.repeat(told, int(HELD_S / STEP_S), axis=0).T
    heading = np.concatenate([[0], np.cumsum(w * STEP_S)])
    middle = heading[:-1] + w * STEP_S / 2
    way = v * STEP_S * (1 + GRAIN * np.cos(middle - ALONG_RAD))
    path = np.cumsum(np.column_stack([way * np.cos(middle), way * np.sin(middle)]), axis=0)
    pose = np.column_stack([np.vstack([[0, 0], path]), heading])
    pose += rng.normal(0, [5e-4, 5e-4, 1e-3], pose.shape)
    log = tm.Log.from_arrays(
        *(np.arange(len(pose)) * STEP_S, pose, np.arange(PARTS) * HELD_S, told),
        kind="twist",
        same_clock=True,
    )
    file = tmp_path_factory.mktemp("carpet") / "twist.toml"
    file.write_text(TWIST)
    return log, tm.Model.load(file)


@pytest.fixture(scope="module")
def added(carpet):
    log, model = carpet
    return model.add(grain, log)


def test_a_gain_that_depends_on_the_heading_is_found(added):
    """cos(theta - a) = cos(a) cos(theta) + sin(a) sin(theta)."""
    found = added.model.numbers(grain)
    assert found["along_x"] == pytest.approx(GRAIN * math.cos(ALONG_RAD), abs=0.004)
    assert found["along_y"] == pytest.approx(GRAIN * math.sin(ALONG_RAD), abs=0.004)
    assert added.heldout_after < 1.2 < 2 < added.heldout_before


def test_a_model_with_it_is_fitted_and_held_by_its_names(carpet, added):
    names = grain.names(added.model)
    assert names == grain.names(added.model.file.model)
    fitted = tm.fit(
        carpet[0], added.model, hold=[names["along_x"]], priors={names["along_y"]: (0, 1e-3)}
    )
    assert fitted.params[names["along_x"]] == added.model[names["along_x"]]
    assert abs(fitted.params[names["along_y"]]) < 0.02


def test_nothing_is_missing_beside_it(carpet, added):
    log, model = carpet
    assert tm.diagnose(log, model).verdict != "model_adequate"
    found = tm.diagnose(log, added.model)
    effects = found.to_json()["probability"]["effects"]
    assert not found.found and found.nothing > max(effects.values())


def test_the_plant_drives_by_it(added, tmp_path):
    """Straight on, 1 + GRAIN cos(theta - ALONG_RAD) times as fast as it is told."""
    (tmp_path / "script.csv").write_text("t_s,speed_input,turn_input\n0,50,0\n9,0,0\n")
    run = tm.simulate(added.model, n=1, duration_s=6, script=tmp_path / "script.csv").table()
    (t_s, x_m, y_m, theta_rad), end = (
        run.query(when)[["t_s", "x_m", "y_m", "theta_rad"]].mean()
        for when in ("2 < t_s - t_s.min() < 2.5", "5 < t_s - t_s.min() < 5.5")
    )
    speed_mps = math.hypot(end["x_m"] - x_m, end["y_m"] - y_m) / (end["t_s"] - t_s)
    share = 1 + GRAIN * math.cos(theta_rad - ALONG_RAD)
    assert speed_mps == pytest.approx(50 * 0.0036 * share, rel=0.01)


NAMED = "equation#grain.along_x"


def test_tables_files_and_exports_have_its_own_names_and_units(carpet, tmp_path):
    """Function, number and unit are called here as by the author of the effect."""
    log, model = carpet

    @tm.python_effect("vx_mps", {"drag": tm.Number("s/m")})
    def air(vx, drag):
        """Drag that grows with the square of the speed."""
        return -drag * vx * np.abs(vx)

    fit = tm.fit(log, model.add(air, log).model, hold=["base.yaw_gain"])
    named = "equation#air.drag"
    assert re.search(rf"^{re.escape(named)} .* s/m$", fit.summary(), re.M)
    assert fit.table().set_index("name").loc[named, "unit"] == "s/m"
    assert named in fit.params and fit.model.numbers(air) == {
        "drag": pytest.approx(fit.params[named], rel=1e-5)
    }
    known = {row["name"]: row["unit"] for row in fit.to_json()["parameters"]}
    assert known[named] == "s/m" and not [n for n in known if n.endswith(".p0")]
    assert fit.model.table().set_index("name").loc[named, "unit"] == "s/m"
    fit.report(tmp_path / "report")
    page = re.sub("<[^>]+>", " ", (tmp_path / "report/index.html").read_text())
    assert re.search(rf"{re.escape(named)}[^a-z]* s/m", page)
    for to, file in [("json", "a.json"), ("urdf", "a.urdf"), ("mjcf", "a.xml"), ("sdf", "a.sdf")]:
        fit.model.export(tmp_path / file, to=to)
        told = (tmp_path / file).read_text()
        assert "equation#air" in told and "(-drag)*vx" in told and "p0" not in told
    numbers = json.loads((tmp_path / "a.json").read_text())["numbers"]
    assert numbers[named]["unit"] == "s/m"


def test_a_saved_model_is_read_with_its_names(carpet, added, tmp_path):
    added.model.save(tmp_path / "grain.toml")
    read = tm.Model.load(tmp_path / "grain.toml")
    assert read.numbers(grain).keys() == {"along_x", "along_y"}
    assert read.set({NAMED: 0.05})[NAMED] == 0.05
    fitted = tm.fit(carpet[0], read, priors={NAMED: (0.05, 1e-5)})
    assert fitted.params[NAMED] == pytest.approx(0.05, abs=1e-4)


def test_a_model_keeps_the_limits_and_units_of_the_numbers(carpet, added, tmp_path):
    """They are those that the author of the effect gave, also in a file and after a fit."""
    added.model.save(tmp_path / "grain.toml")
    read = tm.Model.load(tmp_path / "grain.toml")
    for model in (added.model, read, tm.fit(carpet[0], read).model):
        row = model.table().set_index("name").loc[NAMED]
        assert (row["min"], row["max"], row["unit"]) == (-1, 1, "1")
        with pytest.raises(tm.ModelError, match=r"= 1\.5: must be within -1 to 1"):
            model.set({NAMED: 1.5})


def test_a_number_stays_within_limits_that_the_log_contradicts(carpet):
    """The robot is faster along x, which the effect's author rules out; 0 is what is nearest."""
    log, model = carpet

    @tm.python_effect(
        "vx_mps",
        {"slow": tm.Number("1", low=0), "rate": tm.Number("1/s", low=0.1, high=20, prior=(1, 1))},
        state_rate=lambda theta, s, rate: rate * (np.cos(theta) - s),
    )
    def reluctant(vx, s, slow, rate):
        return -slow * vx * s

    added = model.add(reluctant, log)
    table = added.model.table().set_index("name")
    assert table.loc["equation#reluctant.rate", "unit"] == "1/s"
    assert added.model.numbers(reluctant)["slow"] == 0
    found = added.table().set_index("name")["at_bound"]
    assert found["equation#reluctant.slow"] and not found["equation#reluctant.rate"]


def test_a_prior_decides_where_data_do_not(carpet):
    """Data know the product of two numbers: 0.8 and 0.5 are a gain of 0.4, or others."""
    log, model = carpet

    @tm.python_effect("omega_radps", {"a": tm.Number(prior=(0.5, 1e-4)), "b": tm.Number()})
    def twice(omega, a, b):
        return a * b * omega

    numbers = model.add(twice, log).model.numbers(twice)
    assert numbers["a"] == pytest.approx(0.5, abs=1e-3)


# A function of numpy's, and what its formula is worth by Python's own arithmetic.
@pytest.mark.parametrize(
    "function",
    [
        lambda vx, k: k * vx**2 - -vx / (3 + vx) * k,
        lambda vx, k: -k * np.abs(vx) ** 0.5 * np.sign(vx),
        lambda vx, k: k * np.hypot(vx, 2) * np.clip(vx, -0.1, 0.1),
        lambda vx, k: k * np.minimum(vx, 0.2) + np.maximum(-k, -1) * np.log(1 + vx**2),
        lambda vx, k: 2 * k * (vx - np.arctan2(vx, k)) - k * np.square(vx),
    ],
)
def test_the_formula_computes_what_the_function_does(function):
    effect = tm.python_effect("vx_mps", {"k": tm.Number()})(function)
    assert effect.card["parameters"][0]["name"] == "k"
    words = {"sign": np.sign, "abs": abs, "sqrt": math.sqrt, "ln": math.log, "atan2": math.atan2}
    for vx, k in np.random.default_rng(2).uniform(-1, 1, (20, 2)):
        text = effect.texts["formula"].replace("^", "**")
        worth = eval(text, {**words, "min": min, "max": max}, {"vx": vx, "k": k})
        assert worth == pytest.approx(function(vx, k), rel=1e-12)


@pytest.mark.parametrize(
    ("function", "error", "says"),
    [
        (lambda vx, k: k if vx > 0 else 0 * k, TypeError, "use np.where in place of if"),
        (lambda vx, k: k * math.sin(vx), TypeError, "np.sin and the like"),
        (lambda vx, k: k * np.sinc(vx), TypeError, "no formula has it"),
        (lambda vx, k: k + vx, ValueError, "adds something where its numbers are 0"),
    ],
)
def test_what_no_formula_can_do_is_said(function, error, says):
    with pytest.raises(error, match=says):
        tm.python_effect("vx_mps", {"k": tm.Number()})(function)


def test_a_number_with_the_name_of_a_signal_is_refused():
    with pytest.raises(ValueError, match="'x' means something else in a formula; take another"):
        tm.python_effect("vx_mps", {"x": tm.Number()})(lambda vx, x: vx * x)
    with pytest.raises(ValueError, match="'größe' must be called by letters of English"):
        tm.python_effect("vx_mps", {"größe": tm.Number()})(lambda vx, größe: vx * größe)
    with pytest.raises(ValueError, match="has a comma"):
        tm.python_effect("vx_mps", {"k": tm.Number("m, s")})(lambda vx, k: vx * k)
