# SPDX-License-Identifier: Apache-2.0
"""A stop begins though files of the user's have names of the standard library's modules."""

import json
import os
import subprocess
import sys

import pytest

MODULE = [sys.executable, "-m", "twinmill_cli.main"]
# As installers write console scripts: `re` is imported before anything of ours.
SCRIPT = """
import re
import sys
from twinmill_cli.main import main
sys.argv[0] = re.sub("-script$", "", sys.argv[0])
sys.exit(main())
"""
# The bus is none that can be read: nothing is sent.
STOP = ["swarm", "stop", "--json", "--lcm-url", "nowhere"]


def run(program, folder, code, words=STOP):
    """Runs it in a folder with such files, which PYTHONPATH names, too."""
    for name in ("random", "queue", "secrets", "re", "typer", "numpy"):
        (folder / f"{name}.py").write_text(code)
    done = subprocess.run(
        [*program, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f":{folder}"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    return done.returncode, json.loads(done.stdout), done.stderr


@pytest.fixture
def script(tmp_path):
    (tmp_path / "bin").mkdir()
    file = tmp_path / "bin" / "twinmill"
    file.write_text(SCRIPT)
    return [sys.executable, str(file)]


@pytest.mark.parametrize("code", ["", "raise RuntimeError"])
def test_a_stop_does_not_import_what_lies_about(tmp_path, script, code):
    programs = [MODULE] if code else [MODULE, script]  # the script itself would raise
    for program in programs:
        ended, told, _ = run(program, tmp_path, code)
        assert ended == 2 and "lcm-url" in told["sentence"]
        assert "NOTHING WAS STOPPED" in told["sentence"]


def test_what_is_the_users_alone_is_found_behind_all_else(tmp_path):
    code = (
        "import sys; sys.argv[0] = 'twinmill'; import twinmill_cli, random, of_the_user\n"
        "print(random.SystemRandom and of_the_user.FOUND)"
    )
    (tmp_path / "of_the_user.py").write_text("FOUND = 7")
    (tmp_path / "random.py").write_text("")
    program = [sys.executable, "-c", code]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "7\n"


@pytest.mark.parametrize("program", [MODULE, None], ids=["module", "script"])
def test_in_the_root_folder_the_interpreters_own_modules_stay(program, script):
    """They have no file, so they do not lie there."""
    line = [*(program or script), "--version"]
    environment = {**os.environ, "PYTHONPATH": "/"}
    done = subprocess.run(line, cwd="/", env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.startswith("twinmill ")


@pytest.mark.parametrize("module", ["typer", "twinmill.robots.tell"])
def test_a_part_that_cannot_be_imported_is_one_sentence_and_an_object(module):
    """One that every command needs, and one of this command alone."""
    code = (
        "import sys; sys.argv[0] = 'twinmill'\n"
        f"def hook(event, args):\n    if event == 'import' and args[0] == '{module}': 1 / 0\n"
        "sys.addaudithook(hook)\n"
        "from twinmill_cli.main import main; main()\n"
    )
    program = [sys.executable, "-c", code, "swarm", "stop", "--json"]
    done = subprocess.run(program, capture_output=True, text=True)
    told = json.loads(done.stdout)
    assert done.returncode == 1 and told["ok"] is False and told["verb"] == "stop"
    assert "ZeroDivisionError" in done.stderr and "NOTHING WAS STOPPED" in told["sentence"]
    assert len(done.stderr.splitlines()) == 1
