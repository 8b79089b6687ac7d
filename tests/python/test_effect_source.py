# SPDX-License-Identifier: Apache-2.0
"""`effects new`: an equation of a model as an effect's source and test, which a compiler takes."""

import shutil
import subprocess
from pathlib import Path

import pytest

from twinmill_cli.main import run

ROOT = Path(__file__).resolve().parents[2]
EQUATIONS = {
    "stored_turn": {
        "adds_to": "omega_radps",
        "formula": "p0*(omega - abs(omega)*s/0.08)",
        "state_rate": "(0.08*sign(omega) - s)*(abs(omega)/0.08)",
    },
    "warm_wheels": {
        "adds_to": "rim_mps",
        "formula": "p0*s*target",
        "state_rate": "(u*u - s)/60",
    },
    "overshoot": {
        "adds_to": "rim_mps",
        "formula": "p0*(s - target) + p1*r",
        "state_rate": "r",
        "second_rate": "9.98*9.98*(target - s) - 2*0.101*9.98*r",
    },
    "springy_turn": {
        "adds_to": "omega_radps",
        "formula": "p0*(s - omega)",
        "state_rate": "r",
        "second_rate": "13.9*13.9*(omega - s) - 2*0.183*13.9*r",
    },
    "tiles": {"adds_to": "travel", "formula": "p0*cos(9.9*x) + p1*sin(9.9*x)"},
    "grooves": {"adds_to": "aside", "formula": "p0*cos(2*course) + p1*sin(2*course)"},
    "slack_duty": {"adds_to": "duty", "formula": "left > 0 && u > 0 ? p0*u*abs(u) : 0"},
    "least_of_three": {
        "adds_to": "vx_mps",
        "formula": "p0*max(vx, vy, 0) + p1*min(abs(vx), _e)*abs(vx > 0.1)",
    },
    "compass": {"adds_to": "theta_rad", "formula": "p0*cos(1*theta) + p1*sin(1*theta)"},
}


@pytest.fixture
def copy(tmp_path) -> Path:
    """What `effects new` looks at of the project's source."""
    for part in ("twin/effects", "tests/effects"):
        shutil.copytree(ROOT / part, tmp_path / "source" / part)
    return tmp_path / "source"


@pytest.fixture
def model(tmp_path, model_text):
    """Writes a model file with an equation."""

    def write(texts: dict[str, str]) -> Path:
        lines = [f'{key} = "{text}"' for key, text in texts.items()]
        path = tmp_path / "with_it.toml"
        path.write_text("\n".join([model_text("m"), "[[effect]]", 'name = "equation"', *lines, ""]))
        with path.open("a") as file:
            file.write("p0 = -0.2\n" + ("p1 = 0.1\n" if "p1" in texts["formula"] else ""))
        return path

    return write


def compiles(path: Path, copy: Path) -> None:
    """The compiler takes the file with all warnings that the project has as errors."""
    folders = ["twin/effects/include", "tests/effects"]
    beside = [f"-I{ROOT}/{part}/include" for part in ("twin/plant", "twin/model_file")]
    subprocess.run(
        [
            *("c++", "-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Wshadow", "-Wconversion"),
            *("-Werror", "-isystem", "/usr/include/eigen3"),
            *(*(f"-I{copy / part}" for part in folders), *beside, str(path)),
        ],
        check=True,
    )


@pytest.mark.parametrize("name", EQUATIONS)
def test_what_is_written_compiles_and_is_listed(name, copy, model):
    words = ["effects", "new", name, "--from", str(model(EQUATIONS[name])), "--into", str(copy)]
    run(words)
    compiles(copy / f"twin/effects/catalogue/{name}.cpp", copy)
    assert f"    test_{name}.cpp\n" in (copy / "tests/effects/CMakeLists.txt").read_text()
    title = "".join(part.capitalize() for part in name.split("_"))
    assert f"TEST({title}, " in (copy / f"tests/effects/test_{name}.cpp").read_text()


@pytest.mark.parametrize("name", ["stored_turn", "overshoot"])
def test_the_written_test_compiles(name, copy, model):
    words = ["effects", "new", name, "--from", str(model(EQUATIONS[name]))]
    run([*words, "--into", str(copy)])
    compiles(copy / f"tests/effects/test_{name}.cpp", copy)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["coasting"], "has it already"),
        (["Play"], "is no name"),
        (["gains"], "mean something else"),
        (["refit"], "mean something else"),
        (["new"], "mean something else"),
        (["play", "--equation", "equation#2"], "its equations are equation"),
        (["play", "--into", "nowhere"], "holds no twin/effects/catalogue"),
    ],
)
def test_what_cannot_be_written_is_said_and_nothing_is(words, says, copy, model):
    before = sorted(copy.rglob("*"))
    into = [] if "--into" in words else ["--into", str(copy)]
    with pytest.raises(ValueError, match=says):
        run(["effects", "new", *words, "--from", str(model(EQUATIONS["tiles"])), *into])
    assert sorted(copy.rglob("*")) == before


def test_a_part_of_the_source_is_told_what_it_lacks(tmp_path, model):
    (tmp_path / "twin/effects/catalogue").mkdir(parents=True)
    words = ["effects", "new", "play", "--from", str(model(EQUATIONS["tiles"]))]
    with pytest.raises(ValueError, match=r"holds no tests/effects/CMakeLists\.txt"):
        run([*words, "--into", str(tmp_path)])


def test_a_power_that_c_has_not_is_refused(copy, model):
    path = model({"adds_to": "vx_mps", "formula": "p0*vx^2"})
    with pytest.raises(ValueError, match="has no power"):
        run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])


@pytest.mark.parametrize("function", ["sum", "avg"])
def test_a_function_that_c_has_not_is_refused(function, copy, model):
    path = model({"adds_to": "vx_mps", "formula": f"p0*{function}(vx, vy)"})
    with pytest.raises(ValueError, match=f"{function} is not written in C"):
        run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])


def test_a_push_of_two_values_is_not_written_as_an_effect(copy, model):
    path = model({"adds_to": "room_mps", "formula": "p0*vx, p1*vx"})
    with pytest.raises(ValueError, match="two values"):
        run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])
