# SPDX-License-Identifier: Apache-2.0
"""`effects new`: an equation of a model as an effect's source and test, which a compiler takes."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from twinmill.export import effect_source
from twinmill.export.formula_cpp import in_cpp
from twinmill.model.model_file import ModelFile
from twinmill_cli.main import run

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
from site_hooks import EFFECTS, page_of_effects  # noqa: E402

# A formula in C++ and by muParser, with x = 3 and y = 7.
BOTH = """
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <muParser.h>
double x = 3, y = 7;
double Sign(double value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }
void show(double ours, const char *text)
{
  mu::Parser parser;
  parser.DefineVar("x", &x);
  parser.DefineVar("y", &y);
  parser.SetExpr(text);
  std::printf("%.17g %.17g\\n", ours, parser.Eval());
}
int main()
{
LINES
}
"""
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
    "both_or_turning": {"adds_to": "vx_mps", "formula": "p0*(vx > 0 && vy < 1 || omega > 0)"},
    "same_sides": {"adds_to": "vx_mps", "formula": "p0*(vx > 0 == omega > 0)"},
    "either": {"adds_to": "vx_mps", "formula": "p0*abs(vx > 0 ? vy > 0 : omega > 0)"},
    "compass": {"adds_to": "theta_rad", "formula": "p0*cos(1*theta) + p1*sin(1*theta)"},
}


@pytest.fixture
def copy(tmp_path) -> Path:
    """Part of the project's source that `effects new` looks at."""
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


@pytest.mark.parametrize(
    ("name", "is_first_order"), [("stored_turn", False), ("overshoot", False), ("tiles", True)]
)
def test_the_written_test_compiles(name, is_first_order, copy, model):
    """Holding the place over a step is right to first order, which the test says."""
    words = ["effects", "new", name, "--from", str(model(EQUATIONS[name]))]
    run([*words, "--into", str(copy)])
    test = copy / f"tests/effects/test_{name}.cpp"
    assert (f'FirstOrder().insert("{name}")' in test.read_text()) == is_first_order
    compiles(test, copy)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["coasting"], "has it already"),
        (["Play"], "is no name"),
        (["gains"], "mean something else"),
        (["refit"], "mean something else"),
        (["new"], "mean something else"),
        (["base"], "mean something else"),
        (["range_m"], "mean something else"),
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


@pytest.mark.parametrize("function", ["sum", "avg"])
def test_a_function_that_c_has_not_is_refused(function, copy, model):
    path = model({"adds_to": "vx_mps", "formula": f"p0*{function}(vx, vy)"})
    with pytest.raises(ValueError, match=f"{function} is not written in C"):
        run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])


FORMULAS = [
    "1 < 2 == 2 > 1",
    "x < 2 && y < 1 || x > 0",
    "(x > 0)/(y > 9)",
    "(x > 0)/2 + 1/2 + (x > 0 || y > 9)/4",
    "rint(x/6) + rint(0.5) + rint(-0.5) + rint(2.5)",
    "-x^2 + 2^3^2 - 2^-1 - -y + 2*-x - (y - x)/(y*x)",
    "abs(x > 0 ? y > 9 : x > 1) + min(x, y > 0) + max(1, x, 2)",
    "x > 4 ? 1 : y > 9 ? 2 : x && y ? 3 : 4",
    "(x ? 2 : 3)*(x > 2 && (y > 1 || x)) + (x > 1)*(y < 9 > 0)",
    "sign(x - y)*ln(x)*log(y)*log10(x)*log2(x) + atan2(x, y)*_pi - _e",
]


def test_cpp_gives_a_formula_the_value_that_the_model_gives_it(tmp_path):
    """In muParser itself a comparison is a number, and a division by one no crash."""
    lines = [f'  show({in_cpp(text, {"x", "y"})}, "{text}");' for text in FORMULAS]
    (tmp_path / "both.cpp").write_text(BOTH.replace("LINES", "\n".join(lines)))
    program = tmp_path / "both"
    words = ["c++", "-std=c++20", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-o", str(program)]
    subprocess.run([*words, str(tmp_path / "both.cpp"), "-lmuparser"], check=True)
    told = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    for text, line in zip(FORMULAS, told.splitlines(), strict=True):
        ours, theirs = map(float, line.split())
        assert ours == pytest.approx(theirs, rel=1e-14), text


def test_a_model_of_several_equations_asks_which(copy, model):
    path = model(EQUATIONS["tiles"])
    path.write_text(path.read_text() + '[[effect]]\nname = "equation"\nformula = "p2*vx"\np2 = 1\n')
    words = ["effects", "new", "play", "--from", str(path), "--into", str(copy)]
    with pytest.raises(ValueError, match="by --equation: equation, equation#2"):
        run(words)
    run([*words, "--equation", "equation#2"])
    source = (copy / "twin/effects/catalogue/play.cpp").read_text()
    assert '{"p2", "1", 0, 1,' in source
    assert '"p0"' not in source, "a number that the formula has not"


def test_what_nothing_could_switch_off_is_no_effect(copy, model):
    path = model({"adds_to": "vx_mps", "formula": "0.1*vx"})
    with pytest.raises(ValueError, match="has none of p0 to p3"):
        run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])


def test_a_file_name_with_marks_of_cpp_is_quoted(copy, model):
    path = model(EQUATIONS["tiles"])
    path = path.rename(path.parent / 'my "best" \\o.toml')
    run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])
    compiles(copy / "twin/effects/catalogue/play.cpp", copy)


@pytest.mark.parametrize("ends", [KeyboardInterrupt, OSError])
def test_what_is_broken_off_leaves_nothing(ends, copy, model, monkeypatch):
    before = {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()}

    def write(path: Path, text: str) -> None:
        if path.name == "CMakeLists.txt":
            raise ends
        path.write_text(text)

    monkeypatch.setattr(effect_source, "write_whole", write)
    words = ["play", ModelFile.load(str(model(EQUATIONS["tiles"]))), None, copy]
    with pytest.raises(ends):
        effect_source.write_effect(*words)
    assert {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()} == before


def test_a_push_of_two_values_is_not_written_as_an_effect(copy, model):
    path = model({"adds_to": "room_mps", "formula": "p0*vx, p1*vx"})
    with pytest.raises(ValueError, match="two values"):
        run(["effects", "new", "play", "--from", str(path), "--into", str(copy)])


def test_the_page_of_effects_has_a_card_for_each_as_the_twin_has_it():
    made = {path.stem for path in (ROOT / "twin/effects/catalogue").glob("*.cpp")}
    page = EFFECTS.read_text(encoding="utf-8")
    assert set(re.findall(r"^## (\w+)$", page, flags=re.MULTILINE)) == made
    assert page == page_of_effects(), "renew docs/effects.md: make format"
