# SPDX-License-Identifier: Apache-2.0
"""Every command that a page, a help text or a result prints can be typed as it stands."""

import ast
import html
import io
import json
import re
import shlex
import subprocess
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from typer.core import TyperGroup

from twinmill.experiment.played import Rows, csv_text
from twinmill.experiment.rich_script import write_rich_script
from twinmill.model.model_file import ModelFile
from twinmill.programs import find_program
from twinmill.workbench.next_run import then_commands
from twinmill_cli import main as cli
from twinmill_cli import next as next_command
from twinmill_cli import swarm_stop, twin_sweep
from twinmill_cli.options import ScriptForm
from twinmill_cli.spelling import typed
from twinmill_cli.word_order import in_order

ROOT = Path(__file__).resolve().parents[2]
COASTS = '[[effect]]\nname = "coasting"\ndeceleration_mps2 = 0.7\n'
PARTS = (
    "benchmarks",
    "calibration",
    "docs",
    "examples",
    "firmware",
    "lab",
    "scripts",
    "tests",
    "tools",
    "twin",
)
# All but the history, which names what once was.
PAGES = [
    *(path for path in sorted(ROOT.glob("*.md")) if path.name != "CHANGELOG.md"),
    *(path for part in PARTS for path in sorted((ROOT / part).rglob("*.md"))),
]
KINDS = {".py", ".j2", ".js", ".sh", ".in", ".c", ".cpp", ".h", ""}  # the last: scripts
SOURCES = [
    path
    for part in ("calibration/twinmill", "lab", "tools", "twin", "firmware", "scripts")
    for path in sorted((ROOT / part).rglob("*"))
    if path.is_file() and path.suffix in KINDS and "__pycache__" not in path.parts
]
COMMANDS = {name: cli.LazyCommand(name, m, "") for name, m, _ in cli.COMMANDS}
PROGRAM = r"(?:build/bin/|\.venv/bin/)?((?:twinmill|twin_run|twin_sweep|make) "
LINE = re.compile(rf"^(?:    |\$ ){PROGRAM}.*)", re.M)
FENCED = re.compile(r"^```\w*\n(.*?)^```", re.M | re.S)
ON_A_LINE = re.compile(rf"^  (?:cd \S+ && )?{PROGRAM}.*)", re.M)  # of what a command prints
IN_FENCE = re.compile(rf"^{PROGRAM}.*)", re.M)
EXAMPLE = re.compile(r"^ +Example: (twinmill .*)$", re.M)
QUOTED = re.compile(r"`((?:twinmill|twin_run|twin_sweep|make) [a-z-][^`]*)`")


def lines_of(page: Path) -> Iterator[str]:
    """Commands in blocks of a page, with lines that go on joined, without what a shell adds."""
    text = page.read_text().replace("\\\n", " ")
    yield from LINE.findall(text)
    for block in FENCED.findall(text):
        yield from IN_FENCE.findall(block)


def words_of(line: str) -> list[str]:
    """Words of a command line, without comments, pipes and redirections."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="|>;&")
    lexer.whitespace_split = True
    words = list(lexer)
    ends = [k for k, word in enumerate(words) if set(word) <= set("|>;&")]
    return words[: ends[0]] if ends else words


def command_of(words: list[str]) -> tuple[typer.core.TyperCommand, list[str]]:
    """The command that the words name, by place in the tree or flat name, and the rest."""
    first, *rest = in_order(words)
    if rest and rest[0] in (below := cli.BELOW.get(first, {})):
        return COMMANDS[below[rest[0]]].command(), rest[1:]
    command = COMMANDS[first].command()
    if isinstance(command, TyperGroup) and rest and not rest[0].startswith("-"):
        return command.commands[rest[0]], rest[1:]
    return command, rest


def check(line: str) -> None:
    """The command, its options and the kinds of their values exist, and nothing needed lacks."""
    program, *words = words_of(line)
    if program == "make":
        targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M))
        assert {word for word in words if "=" not in word} <= targets
    elif program == "twinmill":
        command, rest = command_of(words)
        context = command.make_context(words[0], rest)
        assert swarm_stop.MISREAD not in context.meta
    else:
        done = subprocess.run(
            [str(find_program(program)), "--help"], capture_output=True, text=True, check=True
        )
        known = set(re.findall(r"--[\w-]+", done.stdout)) | {"-h"}
        assert {w.partition("=")[0] for w in words if w.startswith("--")} <= known


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_on_a_page_can_be_typed(page):
    for line in lines_of(page):
        check(line)


def test_examples_in_help_can_be_typed():
    found = [line for path in SOURCES for line in EXAMPLE.findall(path.read_text())]
    assert len(found) > 30
    for line in found:
        check(line)


def check_named(line: str) -> None:
    """Commands between back quotes may leave files out, so options alone are looked at."""
    program, *words = line.split()
    given = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
    if program == "twinmill" and words[0] in ("--help", "--install-completion"):
        return
    if program == "twinmill" and len(words) == 1 and words[0] in cli.GROUPS:  # lists its commands
        return
    if program == "twinmill" and not words[0].startswith("<"):
        command, _ = command_of(words)
        known = {option for p in command.params for option in (*p.opts, *p.secondary_opts)}
        assert given <= known | {"--help"}, line
    elif program != "twinmill":
        check(line)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_named_on_a_page_exist_with_their_options(page):
    for line in QUOTED.findall(page.read_text()):
        check_named(line)


def test_pages_name_commands_by_their_place_in_the_tree():
    """Flat names work, but the list of commands does not show them."""
    named = [
        line.split()[1]
        for page in PAGES
        for line in (*lines_of(page), *QUOTED.findall(page.read_text()))
        if line.startswith("twinmill ")
    ]
    assert len(named) > 100
    assert {word for word in named if word[0].isalpha()} <= {*cli.TOP}


FLAT = {old for below in cli.BELOW.values() for old in below.values()} - {*cli.TOP}
TYPED_FLAT = re.compile(rf"\btwinmill (?:{'|'.join(FLAT)})\b(?!-)")
# Of two words with a dash: where it is not the string that registers it.
DASHED = "|".join(name for name in FLAT if "-" in name)
NAMED_FLAT = re.compile(rf"(?<![\w\"-])(?:{DASHED})(?![\w\"-])")


def test_nothing_printed_names_a_command_by_its_flat_name():
    texts = {path: path.read_text() for path in (*PAGES, *SOURCES)}
    assert not {path: found for path, text in texts.items() if (found := _flat(text))}
    assert _flat("`twinmill effects`, compare-runs") == ["twinmill effects", "compare-runs"]


def _flat(text: str) -> list[str]:
    return [*TYPED_FLAT.findall(text), *NAMED_FLAT.findall(text)]


def test_options_that_the_library_names_exist():
    """It names them as arguments; the commands write them with dashes."""
    named = {
        part.value
        for path in SOURCES
        if path.suffix == ".py"
        for call in ast.walk(ast.parse(path.read_text()))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("option", "options")
        for given in call.args[:1]
        for part in (given.keys if isinstance(given, ast.Dict) else [given])
        if isinstance(part, ast.Constant)
    }
    commands = [command.command() for command in COMMANDS.values()]
    commands += [
        c for group in commands if isinstance(group, TyperGroup) for c in group.commands.values()
    ]
    known = {
        word
        for command in [*commands, typer.main.get_command(twin_sweep.app)]
        for p in command.params
        for word in (*p.opts, *p.secondary_opts)
    }
    assert len(named) > 50
    assert {typed({name: None}, None) for name in named} <= known


def test_commands_named_in_messages_exist_with_their_options():
    """Programs in Python, C and C++, pages that they write, and scripts are looked at."""
    found = {line for path in SOURCES for line in QUOTED.findall(path.read_text())}
    assert len(found) > 30
    for line in found:
        if "{" not in line:  # filled in when it is printed
            check_named(line)


# -- results: what made them makes them again -----------------------------------------------------


@pytest.fixture(scope="module")
def swarm(tmp_path_factory) -> Path:
    """A folder with the log of a small swarm, and a sweep of three axes."""
    folder = tmp_path_factory.mktemp("printed")
    log = ["twin_run", "--plant", "planar", "--n", "4", "--duration-s", "15", "--log", "s.lcmlog"]
    grid = ["--x", "v_mps=0.2:0.3:2", "--y", "omega_degps=40:60:2", "--z", "n=4,6"]
    sweep = ["twin_sweep", *grid, "--seeds", "10", "--duration-s", "15", "--out", "sweep"]
    for program, *words in (log, sweep):
        subprocess.run(
            [str(find_program(program)), *words], cwd=folder, check=True, capture_output=True
        )
    return folder


@pytest.mark.parametrize("line", [
    "swarm metrics s.lcmlog --odd 2 --model paper.toml",
    "swarm compare s.lcmlog --seeds 39 --first-seed 3 --odd 2",
    "swarm phase sweep --goal milling --at n=6 --out {made}",
    "swarm plot s.lcmlog -o {made}.svg",
    "swarm ask how-many --behavior milling --n 5 --seeds 10 --duration-s 5 --at-least 0.8"
    " --start disc",
])  # fmt: skip
def test_the_command_that_a_result_names_makes_it_again(swarm, line, monkeypatch):
    monkeypatch.chdir(swarm)
    first = said(line.format(made="first"))
    again = said(first["command"].removeprefix("twinmill ") + (
        " --out second" if " --out " in line else " --force" if "plot" in line else ""
    ))  # fmt: skip
    assert without_place(first) == without_place(again)


@pytest.fixture(scope="module")
def drive(swarm) -> Path:
    """A folder with the log of one robot that drives in all ways for half a minute, and coasts."""
    write_rich_script(swarm / "rich.csv", 30.0, 1)
    usual = ModelFile.load("turbopi.toml").text
    (swarm / "coasts.toml").write_text(f"{usual}\n{COASTS}")
    words = ["--plant", "planar", "--model", "coasts.toml", "--n", "1", "--script", "rich.csv"]
    words += ["--log", "r.lcmlog"]
    subprocess.run(
        [str(find_program("twin_run")), *words], cwd=swarm, check=True, capture_output=True
    )
    return swarm


@pytest.mark.parametrize("line", [
    "explain r.lcmlog -o explained.toml",
    "lab discover --generations 2 --seeds 5 --duration-s 20 --confirm 5 --mujoco 0 --out found",
    "swarm matters --seeds 40 --duration-s 10 --draws 0 --only coasting",
    "guide --robot twin -o plan-twin",
    "guide --robot turbopi --poses camera -o plan-turbopi",
    "diagnose r.lcmlog",
])  # fmt: skip
def test_what_a_command_prints_to_be_typed_next_can_be_typed(drive, line, monkeypatch, capsys):
    """In a terminal of 80 columns; lines that are commands are whole, as they are copied."""
    monkeypatch.chdir(drive)
    monkeypatch.setenv("COLUMNS", "80")
    cli.run(shlex.split(line))
    told = capsys.readouterr().out
    for command in QUOTED.findall(told.replace("\n", " ")):
        check_named(command)
    typed = [*LINE.findall(told), *IN_FENCE.findall(told), *ON_A_LINE.findall(told)]
    for command in typed:
        check(command)
    assert typed or line.startswith(("swarm matters", "explain"))  # which may name none


@pytest.mark.parametrize("line", [
    "explain r.lcmlog -o explained.toml --force",
    "lab discover --generations 2 --seeds 5 --duration-s 20 --confirm 5 --mujoco 0 --out found",
    "swarm matters --seeds 40 --duration-s 10 --draws 0 --only coasting",
    "lab challenge --n 1 --duration-s 30 --workers 1 --out told",
    "fit r.lcmlog -o fitted.toml --hold base.yaw_gain",
    "twin add coasting r.lcmlog -o added.toml",
    "diagnose r.lcmlog",
    "next r.lcmlog --duration-s 15 -o next.csv",
    "export s.lcmlog --to csv -o tables",
    "twin export turbopi.toml --to json -o model.json",
    "lab claims --only pivot --seeds 20",
])  # fmt: skip
def test_the_command_that_a_result_names_can_be_typed(drive, line, monkeypatch):
    """Those that take long are not run again."""
    monkeypatch.chdir(drive)
    told = said(line)
    check(told["command"])
    assert told["command"].split()[1] == line.split()[0]
    if told.get("next_experiment"):
        check(told["next_experiment"]["command"])


def test_commands_of_a_plan_for_the_floor_can_be_typed(swarm, monkeypatch):
    monkeypatch.chdir(swarm)
    said("lab predict sweep --cells 4 --draws 4 --seeds 2 -o plan")
    page = Path("plan/plan.md")
    found = [*lines_of(page), *QUOTED.findall(page.read_text())]
    assert any("lab score" in line for line in found)
    for line in found:
        check_named(line)


@pytest.mark.parametrize("line", ["swarm metrics s.lcmlog", "compare s.lcmlog"])
def test_what_a_report_says_that_made_it_makes_it_again(swarm, line, monkeypatch):
    """Byte for byte, in another folder."""
    monkeypatch.chdir(swarm)
    said(f"{line} --out page-{line[:4]}")
    page = Path(f"page-{line[:4]}/index.html").read_text()
    (made_by,) = re.findall(r"Made by <code>(twinmill .*?)</code>", page)
    said(f"{html.unescape(made_by).removeprefix('twinmill ')} --out again-{line[:4]}")
    assert Path(f"again-{line[:4]}/index.html").read_text() == page


def test_the_command_that_the_twin_names_makes_the_log_again(swarm):
    run = {"cwd": swarm, "check": True, "capture_output": True, "text": True}
    twin, words = str(find_program("twin_run")), ["--plant", "planar", "--n", "3", "--seed", "7"]
    words += ["--duration-s", "2", "--spread-m", "1.5", "--json"]
    told = json.loads(subprocess.run([twin, *words, "--log", "a.lcmlog"], **run).stdout)
    again = shlex.split(told["command_line"])[1:]
    subprocess.run([twin, *again, "--log", "b.lcmlog"], **run)
    assert (swarm / "a.lcmlog").read_bytes() == (swarm / "b.lcmlog").read_bytes()


@pytest.mark.parametrize("robot_id", [0, 3])
def test_what_next_says_to_do_with_its_script_can_be_done(swarm, monkeypatch, robot_id):
    """Those of the command and of the workbench; the twin drives the script."""
    monkeypatch.chdir(swarm)
    script = Path("a script.csv")
    script.write_text("t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,40,40,40,40\n1,0,0,0,0\n")
    duty = np.array([[0.4, 0.4, 0.4, 0.4], [0.0, 0.0, 0.0, 0.0]])
    plan = SimpleNamespace(robot_id=robot_id, rows=Rows(np.array([0.0, 1.0]), duty, 1.0))
    logs = [Path("s.lcmlog")]
    (_, robot), (_, twin), (_, then) = next_command._how(
        plan, logs, "turbopi.toml", script
    ).commands
    told = {"robot_id": robot_id, "cap_pct": 40, "drive": "duty"}
    for line in (robot, then, *then_commands(logs, "turbopi.toml", told)):
        check(line)
    program, *words = shlex.split(twin)
    subprocess.run([str(find_program(program)), *words], check=True, capture_output=True)
    assert Path("next.lcmlog").stat().st_size > 0
    Path("next.lcmlog").unlink()


def test_what_next_says_to_do_with_a_script_of_velocities_can_be_done(tmp_path, monkeypatch):
    """It becomes a program that Python reads."""
    monkeypatch.chdir(tmp_path)
    rows = Rows(np.array([0.0, 1.0]), np.array([[0.2, 0, 0, 0], [0.0] * 4]), 2.0, "twist")
    Path("script.csv").write_text(csv_text(rows))
    plan, logs = SimpleNamespace(robot_id=2, rows=rows), [Path("s.lcmlog")]
    (_, write), (_, play), (_, then) = next_command._how(
        plan, logs, "cart.toml", Path("script.csv")
    ).commands
    write_too, then_too = then_commands(logs, "cart.toml", {"robot_id": 2, "drive": "twist"})
    assert (write, then) == (write_too, then_too)
    check(then)
    said(write.removeprefix("twinmill "))
    compile(Path(shlex.split(play)[1]).read_text(), "script.py", "exec")


@pytest.mark.parametrize(
    ("form", "played"),
    [("bag", "ros2 bag play 'a script_bag'"), ("publisher", "python3 'a script_publisher.py'")],
)
def test_what_was_written_for_ros_is_what_next_says_to_play(form, played):
    rows = Rows(np.array([0.0, 1.0]), np.array([[0.2, 0, 0, 0], [0.0] * 4]), 2.0, "twist")
    plan, script = SimpleNamespace(robot_id=2, rows=rows), Path("a script.csv")
    how = next_command._how(plan, [Path("s.lcmlog")], "cart.toml", script, form=ScriptForm(form))
    (_, play), (_, then) = how.commands
    assert play == played and shlex.split(play)[-1] in how.first
    check(then)


def said(line: str) -> dict:
    out = io.StringIO()
    with redirect_stdout(out):
        cli.run([*shlex.split(line), "--json"])
    return json.loads(out.getvalue())


def without_place(data: dict) -> dict:
    return {k: v for k, v in data.items() if k not in ("report", "out")}
