# SPDX-License-Identifier: Apache-2.0
"""Documentation tells the truth: commands, notebook, pages and their links."""

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import twinmill_native as native

import twinmill as tm
from twinmill.inference.settings import PRIORS

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
from site_hooks import commands_of, on_post_page, run, with_outputs  # noqa: E402

PAGES = sorted((ROOT / "docs").glob("*.md"))
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]+)?\)")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("tutorial")


@pytest.fixture(scope="module")
def outputs(folder) -> dict[str, str]:
    """Output of each command of the tutorial; it fails if one does."""
    page = (ROOT / "docs/tutorial.md").read_text()
    return {command: run(command, folder) for command in commands_of(page)}


def test_fences_that_a_command_prints_do_not_end_its_block(tmp_path):
    """By CommonMark a block ends at a fence that is no shorter than its own."""
    page = "```console\n$ printf '```\\ntwinmill\\n```\\n'\n```"
    assert with_outputs(page, tmp_path).splitlines()[1:] == [
        "$ printf '```\\ntwinmill\\n```\\n'", "```", "twinmill", "```", "````"
    ]  # fmt: skip


def test_the_page_on_inference_lists_the_numbers_that_move_an_answer():
    """All of them and no other, with their values: a number that is changed is noticed."""
    page = (ROOT / "docs/inference.md").read_text()
    table = page.split("## The numbers that can move an answer")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `(\w+)` \| ([\d.]+) \|", table, re.M)
    assert {name: float(value) for name, value in listed} == vars(PRIORS)


def test_the_page_on_sweeps_tells_every_metric():
    page = (ROOT / "docs/sweep.md").read_text()
    told = set(re.findall(r"^\| `(\w+)` \|", page.split("## Columns")[1], re.MULTILINE))
    there = {*native.OUTCOMES, *native.DEFENCE, "cell", "seed", "class", "kernel", "log", "t_s"}
    assert there <= told


def test_the_tutorial_names_the_effect_that_the_recording_has(outputs, folder):
    (said,) = (text for command, text in outputs.items() if " diagnose " in f" {command} ")
    assert "Missing: coasting (" in said
    text = (folder / "better.toml").read_text()
    value, std = map(float, re.findall(r"deceleration_mps2 = ([\d.]+)", text))
    # As examples/make_recording.py hides it.
    assert value == pytest.approx(0.7, abs=2 * std)
    assert std < 0.2


def test_the_python_of_the_tutorial_runs_after_its_commands(outputs, folder, monkeypatch):
    monkeypatch.chdir(folder)
    page = (ROOT / "docs/tutorial.md").read_text()
    before = (folder / "better.toml").read_bytes()
    names: dict = {}
    for block in re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        exec(block, names)
    assert "coasting (" in names["d"].sentence
    assert "coasting" in tm.Model.load(folder / "coasting.toml").effects
    assert (folder / "better.toml").read_bytes() == before


def test_the_tutorial_with_ros_finds_what_its_bag_has(tmp_path):
    """As examples/make_ros_bag.py simulates it with NumPy: 1 m/s² at most, and a lag of 80 ms."""
    page = (ROOT / "docs/tutorial-ros.md").read_text()
    said = {command: run(command, tmp_path) for command in commands_of(page)}
    (verdict,) = (text for command, text in said.items() if "diagnose" in command)
    assert verdict.startswith("Missing: acceleration_limit (")
    found = tm.Model.load(tmp_path / "better.toml")
    assert found["acceleration_limit.pace_s2_per_m"] == pytest.approx(1.0, rel=0.02)
    assert found["base.motor_lag_s"] == pytest.approx(0.08, abs=0.002)
    linked = re.findall(r"\(runs/tutorial-ros/([^)]+)\)", page)
    assert [name for name in linked if not (tmp_path / name).is_file()] == []


def test_what_the_tutorial_links_to_was_written(outputs, folder):
    page = (ROOT / "docs/tutorial.md").read_text()
    linked = re.findall(r"\(runs/tutorial/([^)]+)\)", page)
    assert linked
    assert [name for name in linked if not (folder / name).is_file()] == []


def test_the_readme_runs_as_it_is_printed(tmp_path):
    """With the tutorial's recording, and the environment where the page has it."""
    (tmp_path / ".venv").symlink_to(sys.prefix)
    run(f"python {ROOT}/examples/make_recording.py", tmp_path)
    for command in commands_of((ROOT / "README.md").read_text()):
        run(command, tmp_path)
    assert {"better.toml", "best.toml", "script.csv", "swarm.lcmlog"} <= {
        p.name for p in tmp_path.iterdir()
    }


def test_the_notebook_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EXAMPLES", str(ROOT / "examples"))
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=":")
    cells = json.loads((ROOT / "examples/first_steps.ipynb").read_text())["cells"]
    names: dict = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert names["d"].best.effect == "coasting"
    assert names["better"].compare(names["log"]).score < names["comparison"].score


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda p: p.name)
def test_links_between_pages_hold(page):
    linked = [m[0] for m in LINK.findall(page.read_text())]
    local = [t for t in linked if "://" not in t and not t.startswith("runs/")]
    assert [target for target in local if not (page.parent / target).exists()] == []


@pytest.mark.parametrize(
    "part",
    [
        '<script src="https://a.org/x.js"></script>',
        '<link rel="stylesheet" href="https://a.org/x">',
    ],
)
def test_a_page_that_needs_the_internet_ends_the_build(part):
    page = SimpleNamespace(file=SimpleNamespace(src_path="x.md"))
    links = '<link rel="canonical" href="https://a.org"><a href="https://a.org">a paper</a>'
    assert on_post_page(links, page, None) == links
    with pytest.raises(ValueError, match="internet"):
        on_post_page(links + part, page, None)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_lists_within_lists_stand_as_far_in_as_the_site_asks_for(page):
    """Four columns, by Python-Markdown's documentation; with fewer it makes one list of both."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    assert re.findall(r"^ {1,3}(?:[-*]|\d+\.) .*$", text, flags=re.MULTILINE) == []
