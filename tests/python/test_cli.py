# SPDX-License-Identifier: Apache-2.0
import errno
import hashlib
import io
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tomllib
from importlib.metadata import version

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from twinmill.extras import missing
from twinmill.files import plain
from twinmill.report.tables import number
from twinmill.terminal import PlainConsole
from twinmill_cli import done
from twinmill_cli import main as cli
from twinmill_cli.ending import _told
from twinmill_cli.lazy import LazyCommand


def strict(text):
    """One JSON object without the NaN and Infinity that only Python reads."""

    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.fixture
def compared(twinmill, coasting_robot):
    """JSON of a comparison with one of the two models."""

    def run(model):
        code, out, err = twinmill("compare", coasting_robot.log, "--model", model, "--json")
        assert (code, err) == (0, "")
        return strict(out)

    return run


def test_compare_tells_what_the_interface_promises(compared, coasting_robot):
    found = compared(coasting_robot.model)
    assert {"score", "floor_kind", "noise", "errors", "where", "time_offset_s", "robots"} <= set(
        found
    )
    assert {"sensor_m", "sensor_rad", "drive_mps", "drive_radps", "drive_s"} <= set(found["noise"])
    assert found["floor_kind"] == "noise"
    cells = {(row["channel"], row["unit"], row["horizon_s"]) for row in found["errors"]}
    units = {"forward": "m", "left": "m", "heading": "rad"}
    assert cells == {(c, u, h) for c, u in units.items() for h in (0.1, 0.2, 0.5, 1.0, 2.0)}
    assert all({"regime", "share", "ratio"} <= set(row) for row in found["where"])
    digest = hashlib.sha256(coasting_robot.model.read_bytes()).hexdigest()
    assert (found["model_sha256"], found["version"]) == (digest, f"twinmill {version('twinmill')}")


def test_score_is_the_rms_of_errors_over_their_floors(compared, coasting_robot):
    found = compared(coasting_robot.model)
    squares = [(row["rms"] / row["floor"]) ** 2 for row in found["errors"]]
    assert found["score"] == pytest.approx((sum(squares) / len(squares)) ** 0.5, rel=1e-9)


def test_score_tells_the_true_model_from_one_that_lacks_an_effect(compared, coasting_robot):
    # The interface: 1.0 is as good as the log can tell, above 1.3 something is missing. Over
    # replicas the true model's score scatters by 0.1: three of these.
    assert 0.7 < compared(coasting_robot.true_model)["score"] < 1.3
    poor = compared(coasting_robot.model)
    assert poor["score"] > 1.3
    phases = {row["regime"]: row["ratio"] for row in poor["where"] if row["group"] == "phase"}
    assert max(phases, key=phases.get) == "stopping"


def test_fit_writes_a_child_and_leaves_the_parent(twinmill, coasting_robot, tmp_path):
    before = coasting_robot.model.read_bytes()
    code, out, _ = twinmill(
        "fit",
        coasting_robot.log,
        "--model",
        coasting_robot.model,
        "-o",
        tmp_path / "fitted.toml",
        "--json",
    )
    found = strict(out)
    assert code == 0
    assert found["score_after"] < found["score_before"]
    assert found["parameters"]
    assert all({"name", "value", "std", "unit", "at_bound"} <= set(p) for p in found["parameters"])
    assert coasting_robot.model.read_bytes() == before
    assert hashlib.sha256(before).hexdigest() in (tmp_path / "fitted.toml").read_text()


def test_add_finds_the_effect_that_the_robot_has(twinmill, coasting_robot, tmp_path):
    code, out, _ = twinmill(
        "add",
        "coasting",
        coasting_robot.log,
        "--model",
        coasting_robot.model,
        "-o",
        tmp_path / "better.toml",
        "--json",
        "--out",
        tmp_path / "report",
    )
    found = strict(out)
    assert code == 0
    assert {"score_before", "score_after", "heldout_before", "heldout_after"} <= set(found)
    assert found["heldout_after"] < 0.8 * found["heldout_before"]
    (fitted,) = (p for p in found["parameters"] if p["name"] == "coasting.deceleration_mps2")
    assert fitted["value"] == pytest.approx(coasting_robot.deceleration_mps2, abs=4 * fitted["std"])
    assert fitted["std"] < 0.1
    assert (tmp_path / "report" / "index.html").exists()


def test_effects_lists_the_catalogue_in_json(twinmill):
    code, out, _ = twinmill("effects", "--json")
    entries = {entry["name"]: entry for entry in strict(out)["effects"]}
    assert code == 0
    assert {"dead_zone", "speed_curve", "motor_lag", "coasting", "floor_tilt"} <= set(entries)
    for entry in entries.values():
        assert entry["equation"] and entry["measure"] and entry["reference"] and entry["stage"]
        for p in entry["parameters"]:
            assert p["unit"] and p["min"] <= p["default"] <= p["max"]
    assert strict(twinmill("effects", "coasting", "--json")[1]) == entries["coasting"]


def test_text_names_the_quantities_that_json_has(twinmill, coasting_robot, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = twinmill("compare", coasting_robot.log, "--model", coasting_robot.model)
    assert (code, err) == (0, "")
    assert all(word in out for word in ("score", "forward", "heading", "stopping", "Next:"))
    assert max(map(len, out.splitlines())) <= 80


def test_only_who_has_not_fitted_is_told_to(twinmill, coasting_robot, tmp_path):
    """A robot that coasts, predicted by a model that does not: no fit of its base mends that."""
    given = ("--model", coasting_robot.model)
    told = [
        twinmill("compare", coasting_robot.log, *given)[1],
        twinmill("fit", coasting_robot.log, *given, "-o", tmp_path / "fitted.toml")[1],
    ]
    assert ["fit if you have not" in " ".join(text.split()) for text in told] == [True, False]
    assert "Next:" in told[1] and "twinmill diagnose" in " ".join(told[1].split())


BAD = {
    "missing log": ("compare", "nowhere.lcmlog", "--model", "{model}"),
    "not a log": ("compare", "{model}", "--model", "{model}"),
    "missing model": ("compare", "{log}", "--model", "nowhere.toml"),
    "unknown key": ("compare", "{log}", "--model", "odd.toml"),
    "no effect of that name": ("add", "coastin", "{log}", "--model", "{model}", "-o", "new.toml"),
    "no card of that name": ("effects", "coastin"),
    "folder is not there": ("fit", "{log}", "--model", "{model}", "-o", "nowhere/new.toml"),
    "output is a folder": ("fit", "{log}", "--model", "{model}", "-o", "."),
    "output exists": ("fit", "{log}", "--model", "{model}", "-o", "odd.toml"),
    "output is the model": ("fit", "{log}", "--model", "odd.toml", "-o", "odd.toml", "--force"),
    "report is under a file": ("compare", "{log}", "--model", "{model}", "--out", "odd.toml/r"),
}


@pytest.mark.parametrize("arguments", BAD.values(), ids=BAD)
def test_bad_input_gets_one_sentence_and_leaves_nothing(
    twinmill, coasting_robot, tmp_path, monkeypatch, arguments
):
    monkeypatch.chdir(tmp_path)
    odd = coasting_robot.model.read_text().replace("motor_lag_s", "motor_lug_s")
    (tmp_path / "odd.toml").write_text(odd)
    places = {"log": coasting_robot.log, "model": coasting_robot.model}
    code, out, err = twinmill(*(word.format(**places) for word in arguments))
    assert (code, out) == (1, "")
    assert err.startswith("twinmill: ") and err.endswith("\n") and err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["odd.toml"]
    assert (tmp_path / "odd.toml").read_text() == odd


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("effects coasting more", "takes no 'more'"),
        ("effects coasting --from m.toml", "takes no --from m.toml"),
        ("set base.motor_lag_s=0.1 base.motor_lag_s=0.2 -o x.toml", "motor_lag_s: is given twice"),
        ("set base.motorlag_s=0.1 -o x.toml", "nearest known is 'base.motor_lag_s'"),
    ],
)
def test_what_is_too_much_is_refused(twinmill, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = twinmill(*words.split())
    assert (code, out) == (1, "") and said in err
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_like_no_other_gets_no_suggestion(twinmill, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, err = twinmill("set", "zzzzzz=1", "-o", "x.toml")
    assert code == 1 and "zzzzzz: is no quantity" in err and "nearest" not in err


def test_a_sentence_quotes_the_beginning_of_what_is_long(twinmill, coasting_robot, tmp_path):
    formula = "p0*(" + "vx+" * 9000 + "nothing)"
    words = ("add", "equation", coasting_robot.log, "--model", coasting_robot.model)
    out = ("--adds-to", "vx_mps", "--formula", formula, "-o", tmp_path / "x.toml")
    code, _, err = twinmill(*words, *out)
    assert code == 1 and "p0*(vx+vx+" in err and "too long" in err and len(err) < 200


JUDGING = {
    "compare": "compare {log} --model {model}",
    "diagnose": "diagnose {log} --model {model}",
    "explain": "explain {log} --model {model} -o x.toml",
    "fit": "fit {log} --model {model} -o x.toml",
    "add": "add coasting {log} --model {model} -o x.toml",
    "next": "next {log} --model {model} -o x.csv",
    "metrics": "metrics {log} --model {model}",
    "compare-runs": "compare-runs {log} {log} --model {model}",
    "compare-swarm": "compare-swarm {log} --model {model}",
    "wheels": "wheels {log} --model {model}",
    "plot": "plot {log} -o x.png",
    "export": "export {log} --to mcap -o x.mcap",
}


@pytest.fixture(scope="session")
def brief_log(tmp_path_factory):
    """Three seconds, which are too little to judge a model by; whole in all other ways."""
    folder = tmp_path_factory.mktemp("brief")
    t_s = [k / 20 for k in range(60)]
    poses = "".join(f"{t},1,{t / 10},0,0\n" for t in t_s)
    commands = "".join(f"{t},1,0.1,0,0\n" for t in t_s)
    (folder / "p.csv").write_text("t_s,robot_id,x_m,y_m,theta_rad\n" + poses)
    (folder / "c.csv").write_text("t_s,robot_id,vx_mps,vy_mps,omega_radps\n" + commands)
    tables = ["--poses", str(folder / "p.csv"), "--commands", str(folder / "c.csv")]
    cli.run(["import", *tables, "-o", str(folder / "brief.lcmlog")])
    return folder / "brief.lcmlog"


@pytest.mark.parametrize("verb", JUDGING)
@pytest.mark.parametrize("kind", ["brief", "empty", "junk", "absent"])
def test_a_log_that_cannot_be_judged_is_told_as_an_object(
    twinmill, coasting_robot, brief_log, tmp_path, monkeypatch, verb, kind
):
    """As docs/files.md promises to those who read JSON."""
    if kind == "brief" and verb in ("plot", "export", "wheels"):
        pytest.skip("needs no length")
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "x.lcmlog"
    known = {"brief": brief_log.read_bytes(), "empty": b"", "junk": b"\x17junk" * 900}
    if kind in known:
        log.write_bytes(known[kind])
    words = JUDGING[verb].format(log=log, model=coasting_robot.model).split()
    code, out, err = twinmill(*words, "--json")
    told = json.loads(out)
    assert code == 1 and told["verdict"] == "bad_input" and err.count("\n") == 1
    (found,) = told["input"]
    assert found["fatal"] and " ".join(found["evidence"].split()) in err
    assert [path.name for path in tmp_path.iterdir()] == [log.name] * (kind in known)


FAILING = {
    "compare {log} --model nomodel.toml": 1,
    "phase nofolder": 1,
    "ask bogus": 2,
    "set base.motor_lag_s -o q.toml": 1,
    "set base.motor_lag_s=0.06 -o nofolder/q.toml": 1,
    "export {log} --to csv -o .": 1,
    "guide --robot twin -o .": 1,
    "import --poses absent.csv --commands absent.csv -o q.lcmlog": 1,
    "effects bogus": 1,
    "compare": 2,
    "bogus": 2,
    "compare {log} --bogus": 2,
    "swarm bogus": 2,
}


@pytest.mark.parametrize("words", FAILING)
def test_every_failure_is_told_as_an_object(twinmill, coasting_robot, tmp_path, monkeypatch, words):
    """Who asked for JSON had got an empty stdout, of most failures."""
    monkeypatch.chdir(tmp_path)
    code, out, err = twinmill(*words.format(log=coasting_robot.log).split(), "--json")
    told = json.loads(out)
    assert code == FAILING[words] and told["verdict"] == "bad_input" and told["input"] == []
    assert err == f"twinmill: {told['sentence']}\n"
    assert not list(tmp_path.iterdir())


def test_of_what_failed_after_its_object_there_is_no_other(
    twinmill, coasting_robot, tmp_path, monkeypatch
):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("twinmill.report.html.write_report", full)
    code, out, err = twinmill(
        *("compare", coasting_robot.log, "--model", coasting_robot.model),
        *("--out", tmp_path / "report", "--json"),
    )
    assert code == 1 and "there is no report" in err
    assert json.loads(out)["score"] > 0


@pytest.mark.parametrize(
    ("arguments", "nearest"),
    [
        (("add", "coastin", "x.lcmlog", "-o", "y.toml"), "coasting"),
        (("effects", "motorlag"), "motor_lag"),
    ],
)
def test_unknown_effect_is_told_the_nearest(twinmill, arguments, nearest):
    assert f"did you mean {nearest}?" in twinmill(*arguments)[2]


@pytest.mark.parametrize(
    "arguments", [("fit", "a.lcmlog"), ("compare", "a", "--frob"), ("hop",), ("compare",)]
)
def test_wrong_command_line_is_exit_code_two(twinmill, arguments):
    code, out, err = twinmill(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(
    "arguments",
    [
        ("import", "a", "--heading-offset-deg"),
        ("import", "a", "--pose-shift-s"),
        ("optitrack", "--heading-offset-deg"),
        ("claims", "--odd-turn"),
        ("next", "a", "--duration-s"),  # of a range, below which a NaN is not
    ],
)
def test_an_option_that_is_no_finite_number_is_refused_by_name(twinmill, arguments, value):
    code, out, err = twinmill(*arguments, value)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert arguments[-1] in err and f"{value} is no finite number" in err


@pytest.mark.parametrize(
    ("option", "value", "shown"),
    [
        ("--in-s", "abc", "abc"),
        ("--in-s", "", "an empty text"),
        ("--in-s", "-1", "-1"),
        ("--in-s", "1e400", "1e400"),
        ("--in-s", "700", "700"),
        ("--link-timeout-s", "0.1", "0.1"),
    ],
)
def test_a_number_that_is_refused_is_named_with_its_option(twinmill, option, value, shown):
    code, out, err = twinmill("swarm", "start", option, value, "--json")
    told = json.loads(out)
    assert code == 2 and told["ok"] is False and err == f"twinmill: {told['sentence']}\n"
    assert f"'{option}': {shown}" in err


@pytest.mark.parametrize(
    ("cause", "why"),
    [
        (errno.ENOSPC, "no space is left"),
        (errno.EFBIG, "ulimit -f"),
        (errno.EDQUOT, "quota"),
    ],
)
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_stream_that_takes_no_more_is_named(cause, why, stream):
    class Full(io.StringIO):
        def write(self, _):
            raise OSError(cause, os.strerror(cause))

    console = PlainConsole(file=Full(), stderr=stream == "stderr")
    with pytest.raises(OSError) as failed:
        console.print("All stand.")
    code, sentence = _told(failed.value)
    name = {"stdout": "standard output", "stderr": "standard error"}[stream]
    assert code == 1 and sentence.startswith(f"{name}: ") and why in sentence


@pytest.mark.parametrize("is_done", [False, True])
def test_what_robots_have_done_is_not_to_be_done_again(is_done):
    """Whoever read it behind "All stand." said a stop again, and looked for what was wrong."""
    done.begin()
    if is_done:
        done.decide(0)
    _, sentence = _told(OSError(errno.ENOSPC, "No space left on device", "standard output"))
    done.begin()
    assert "make room" in sentence and ("do it again" in sentence) != is_done


def test_a_file_that_takes_no_more_is_named_behind_its_stream(tmp_path):
    """A full quota's message says which disk is meant."""
    file, limit = tmp_path / "said.txt", resource.RLIMIT_FSIZE
    with file.open("w") as out:
        ended = subprocess.run(
            [sys.executable, "-m", "twinmill_cli.main", "effects", "--json"],
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: resource.setrlimit(limit, (0, 0)),
        )
    assert ended.returncode == 1 and f"standard output ({file}): no file may" in ended.stderr


def test_an_option_for_one_value_is_not_given_twice(twinmill, tmp_path):
    """The first of two files was dropped without a word."""
    files = [tmp_path / "a.csv", tmp_path / "b.csv"]
    given = [word for path in files for word in ("--motive", path)]
    code, out, err = twinmill("import", *given, "--commands", "c.csv", "-o", "o.lcmlog")
    assert code == 2 and not out and "--motive" in err and "given twice" in err


def test_truncated_log_is_read_with_a_warning(twinmill, coasting_robot, tmp_path):
    cut = tmp_path / "cut.lcmlog"
    cut.write_bytes(coasting_robot.log.read_bytes()[:-7])
    code, out, _ = twinmill("compare", cut, "--model", coasting_robot.model, "--json")
    assert code == 0
    assert any("breaks off" in text for text in strict(out)["warnings"])


def test_version_and_help(twinmill):
    assert twinmill("--version")[:2] == (0, f"twinmill {version('twinmill')}\n")
    for verb in ("compare", "fit", "add", "effects", "import"):
        code, out, _ = twinmill(verb, "--help")
        assert code == 0 and "Example: twinmill" in out


@pytest.mark.parametrize(("name", "module", "summary"), cli.COMMANDS)
def test_help_says_what_one_value_is_and_keeps_its_lines(name, module, summary):
    """In 80 columns: lines of a paragraph are kept as they are, so that longer ones would break."""
    command = LazyCommand(name, module, summary).command()
    context = typer.Context(command)
    for parameter in command.params:
        assert not re.search(r"list|range|bool", parameter.display_type_rich(ctx=context) or "")
    usage = command.get_usage(context)
    assert not [p.name for p in command.params if p.hidden and f"[{p.name}]" in usage]
    (_, *paragraphs) = (command.help or "").split("\n\n")
    told = [line for p in paragraphs if not p.startswith("Example") for line in p.splitlines()]
    assert all(len(line) <= 78 for line in told)


def test_json_holds_no_nan_and_no_numpy():
    import numpy as np

    value = {
        "a": np.float64("nan"),
        "b": np.array([1.5, np.inf]),
        "c": (np.int64(3), np.bool_(True)),
    }
    assert plain(value) == {"a": None, "b": [1.5, None], "c": [3, True]}
    assert json.dumps(plain(value)) == '{"a": null, "b": [1.5, null], "c": [3, true]}'


@given(st.floats(-1e9, 1e9))
def test_numbers_are_shown_to_three_digits(value):
    assert float(number(value)) == pytest.approx(value, rel=5.1e-3, abs=1e-12)


@pytest.mark.parametrize(("name", "module", "summary"), cli.COMMANDS)
def test_the_list_of_commands_says_what_each_says_of_itself(name, module, summary):
    command = LazyCommand(name, module, summary).command()
    assert " ".join((command.short_help or command.help).split("\n\n")[0].split()) == summary


def test_a_newcomer_sees_about_twelve_commands_and_reaches_all_from_them():
    commands = cli.Commands().commands
    shown = [name for name, command in commands.items() if not command.hidden]
    assert shown == [*cli.TOP] and len(shown) <= 15
    below = [old for names in cli.BELOW.values() for old in names.values()]
    assert sorted([*below, *cli.TOP]) == sorted(
        {name for name, _, _ in cli.COMMANDS} | {*cli.GROUPS}
    )


@pytest.mark.parametrize(
    ("flat", "words"),
    [("effects", "twin effects"), ("optitrack", "track optitrack"), ("metrics", "swarm metrics")],
)
def test_a_command_has_two_names(twinmill, flat, words):
    """Both names have equal help, but for the name."""
    (code, out, _), (also, told, _) = twinmill(flat, "--help"), twinmill(*words.split(), "--help")
    assert (code, also) == (0, 0)
    assert f"twinmill {words}" in told and f"twinmill {flat} " in out
    assert told.partition("Options")[2] == out.partition("Options")[2]


def test_a_terminal_alone_is_told_the_new_name_of_a_command(twinmill, monkeypatch):
    code, out, err = twinmill("effects", "coasting", "--json")
    assert (code, err) == (0, "") and json.loads(out)
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True)
    said = "twinmill effects is now twinmill twin effects\n"
    assert twinmill("effects", "coasting", "--json") == (0, out, said)
    assert twinmill("twin", "effects", "coasting", "--json") == (0, out, "")


HEAVY = {"mujoco", "numpy", "pandas", "PIL", "matplotlib", "pyarrow", "pydantic", "ribs", "scipy"}
HELPS = [[], *([name] for name, _, _ in cli.COMMANDS), ["swarm", "stop"], ["swarm", "status"]]


def test_no_help_imports_what_only_work_needs():
    code = (
        "import json, sys\n"
        "sys.argv = ['twinmill', '--help']\n"
        "from twinmill_cli.main import run\n"
        "def loaded(words):\n"
        "    before = set(sys.modules)\n"
        "    assert run([*words, '--help']) == 0\n"
        "    return [*set(sys.modules) - before]\n"
        f"found = {{' '.join(words): loaded(words) for words in {HELPS}}}\n"
        "print(json.dumps([found, [*sys.modules]]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "--force" in done.stdout and "<bool>" not in done.stdout  # flags take no value
    by_help, loaded = json.loads(done.stdout.splitlines()[-1])
    assert "typer" in loaded
    for words, modules in by_help.items():
        assert not set(modules) & {*HEAVY, "twinmill_native", "twinmill.model"}, words


def test_a_diagnosis_begins_without_the_statistics_that_its_end_needs():
    """They take as long to import as a log takes to read."""
    code = "import sys, twinmill_cli.diagnose; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(done.stdout.split()) & {"scipy.stats", "scipy.optimize"}


def test_words_that_need_no_check_are_taken_without_pydantic():
    """It takes as long to import as the library itself."""
    code = (
        "import sys\n"
        "from twinmill_cli.main import run\n"
        "try:\n"
        "    run(['diagnose', 'no such log', '--model', 'turbopi.toml', '--json'])\n"
        "except ValueError as error:\n"
        "    print(str(error).split(':')[0], 'pydantic' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "no such log False\n"


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("twinmill diag", "diagnose"),
        ("twinmill diagnose --mod", "--model"),
        ("twinmill twin add coas", "coasting"),
        ("twinmill twin effects coas", "coasting"),
    ],
)
def test_the_tabulator_completes_commands_options_and_effects(typed, completed):
    """As the shell asks for it: its line, and which of its words."""
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1)}
    asked = {**os.environ, "_TWINMILL_COMPLETE": "complete_bash", **words}
    program = [sys.executable, "-c", "from twinmill_cli.main import main; main()"]
    done = subprocess.run(program, env=asked, capture_output=True, text=True, check=False)
    assert done.stdout.split() == [completed]


def test_a_command_works_after_its_help_was_shown(twinmill):
    assert twinmill("effects", "--help")[0] == 0
    code, out, _ = twinmill("effects", "coasting", "--json")
    assert code == 0 and strict(out)["name"] == "coasting"


@pytest.mark.parametrize(("line", "code", "says"), [
    ("effects --json -- --help", 1, "effect '--help': not in the catalogue"),
    ("add coasting run.lcmlog -o --help", 2, "--help is the value of an option here"),
])  # fmt: skip
def test_help_may_be_a_value_and_is_said_to_be_one(line, code, says):
    program = [sys.executable, "-c", "from twinmill_cli.main import main; main()"]
    done = subprocess.run([*program, *line.split()], capture_output=True, text=True, check=False)
    assert done.returncode == code and says in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_package_that_is_not_installed_is_one_sentence(monkeypatch, capsys):
    def lacking(_):
        raise ModuleNotFoundError("No module named 'cv2'", name="cv2")

    monkeypatch.setattr(cli, "run", lacking)
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 1
    assert capsys.readouterr().err.strip() == (f"twinmill: {missing('cv2')}")


@pytest.mark.parametrize(
    ("formula", "says"), [("p0/0", "has no finite value"), ("omega", "names none of p0 to p3")]
)
def test_a_formula_that_cannot_be_fitted_is_refused(
    twinmill, brief_coasting_robot, tmp_path, formula, says
):
    robot, out = brief_coasting_robot, tmp_path / "m.toml"
    words = ["add", "equation", robot.log, "--model", robot.model, "-o", out]
    code, said, err = twinmill(*words, "--adds-to", "omega_radps", "--formula", formula)
    assert (code, said) == (1, "") and not out.exists()
    assert len(err.splitlines()) == 1 and f"formula '{formula}'" in err and says in err


def test_the_formula_that_is_fitted_where_none_is_given_is_said(
    twinmill, brief_coasting_robot, tmp_path
):
    robot, out = brief_coasting_robot, tmp_path / "m.toml"
    _, _, err = twinmill("add", "equation", robot.log, "--model", robot.model, "-o", out)
    kept = tomllib.loads(out.read_text())["effect"][-1]
    assert f"{kept['adds_to']} += {kept['formula']} is fitted" in err


@pytest.mark.parametrize("verb", ["explain", "compare"])
def test_a_report_that_cannot_be_written_keeps_what_was_found(
    twinmill, brief_coasting_robot, tmp_path, monkeypatch, verb
):
    """The disk is full once the model is written."""

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path / "r/index.html"))

    monkeypatch.setattr("twinmill.report.html.write_report", full)
    robot, out = brief_coasting_robot, tmp_path / "m.toml"
    more = ["-o", out] if verb == "explain" else []
    words = [verb, robot.log, "--model", robot.model, *more, "--out", tmp_path / "r"]
    code, said, err = twinmill(*words, "--json")
    told = strict(said)
    assert code == 1 and told["report"] is None and "score" in told
    assert "there is no report" in err and "No space left" in err and "index.html" in err
    assert out.exists() == (verb == "explain") and len(err.splitlines()) == 1


@pytest.mark.parametrize("encoding", ["latin-1", "ascii"])
def test_a_terminal_without_our_signs_is_told_all_the_same(compared_in, encoding):
    code, out, err = compared_in(encoding)
    assert (code, err) == (0, "")
    assert "score" in out and "?" in out


@pytest.fixture
def compared_in(brief_coasting_robot):
    """Runs a comparison whose output is in another encoding; what that lacks is a question mark."""

    def run(encoding):
        robot = brief_coasting_robot
        words = ["compare", str(robot.log), "--model", str(robot.model)]
        ended = subprocess.run(
            [sys.executable, "-m", "twinmill_cli.main", *words],
            env={**os.environ, "PYTHONIOENCODING": encoding},
            capture_output=True,
        )
        return ended.returncode, ended.stdout.decode(encoding), ended.stderr.decode()

    return run


@pytest.mark.parametrize(("words", "code"), [(["--version"], 0), (["nonsense"], 2)])
def test_an_interpreter_that_would_go_on_keeps_the_exit_code(words, code):
    """With PYTHONINSPECT, Python takes SystemExit for an error that it prints."""
    ended = subprocess.run(
        [sys.executable, "-c", "from twinmill_cli.main import main; main()", *words],
        env={**os.environ, "PYTHONINSPECT": "1"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert ended.returncode == code and "cannot be imported" not in ended.stderr


@pytest.mark.parametrize("module", ["typer", "twinmill_cli.output", "twinmill.robots.tell"])
def test_ctrl_c_while_it_starts_is_one_sentence(module):
    """From the first line of ours on: the interpreter's own start is not ours."""
    seen = f"lambda event, args: event == 'import' and args[0] == '{module}' and stop()"
    seen = f"import sys; sys.addaudithook({seen})"
    stop = "import os, signal; stop = lambda: os.kill(os.getpid(), signal.SIGINT)"
    run = "sys.argv[0] = 'twinmill'; from twinmill_cli.main import main; main()"
    ended = subprocess.run(
        [sys.executable, "-c", f"{stop}; {seen}; {run}", "swarm", "start"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    sentence = "twinmill: Stopped before it began: nothing was done, and nothing was sent.\n"
    assert (ended.returncode, ended.stdout, ended.stderr) == (-signal.SIGINT, "", sentence)


def signalled(number, where, verb):
    """A command to robots with --json, with a signal as a module is imported, or all are."""
    code = (
        "import gc, os, sys; sys.argv[0] = 'twinmill'\n"
        "def hook(event, args):\n"
        f"    if {where}: os.kill(os.getpid(), {int(number)})\n"
        "sys.addaudithook(hook)\n"
        "gc.freeze = lambda: hook('freeze', [])\n"
        "from twinmill_cli.main import main; main()\n"
    )
    return subprocess.run(
        [sys.executable, "-c", code, "swarm", verb, "--json", "--lcm-url", "memq://"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_IGN),
    )


# The last is where a command's own module is there, and it has not taken signals over yet.
WHERE = [
    "event == 'import' and args[0] == 'typer'",
    "event == 'import' and args[0] == 'twinmill.robots.tell'",
    "event == 'freeze' and 'twinmill_cli.swarm' in sys.modules",
]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("where", WHERE)
@pytest.mark.parametrize("verb", ["start", "stop"])
def test_no_command_to_robots_begins_that_was_asked_to_end(where, number, verb):
    """A script's background job has SIGINT ignored, and nohup's SIGHUP: to a start they count."""
    ended = signalled(number, where, verb)
    told = strict(ended.stdout)
    assert (told["verb"], told["ok"], told["robots"]) == (verb, False, [])
    assert told["sentence"] in ended.stderr or verb == "stop"
    if (verb, number) == ("stop", signal.SIGHUP):  # a terminal that is lost ends no stop
        assert ended.returncode == 1 and "No robot was heard" in told["sentence"]
        return
    assert ended.returncode == -signal.SIGINT
    words = "NOTHING WAS STOPPED" if verb == "stop" else "nothing was sent"
    assert told["sentence"].startswith("Stopped before it began") and words in told["sentence"]


@pytest.mark.parametrize("words", [["--json", "strat"], ["strat", "--json"], ["--json"]])
def test_every_object_of_robots_has_the_same_fields(twinmill, words):
    code, out, _ = twinmill("swarm", *words)
    told = strict(out)
    assert (code, told["ok"], told["robots"]) == (2, False, [])
    assert told["verb"] == "".join(word for word in words if word != "--json")
