# SPDX-License-Identifier: Apache-2.0
"""The workbench in a real browser, by clicks alone: its numbers and files are the commands'."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
from playwright.sync_api import expect, sync_playwright

from twinmill_cli import main as cli

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENT_MS = 300_000  # for a machine that is busy with other tests
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt install chromium")


@pytest.fixture
def folder(brief_coasting_robot, tmp_path, monkeypatch):
    """A log and a model that lacks coasting, in the working directory."""
    shutil.copy(brief_coasting_robot.log, tmp_path / "run.lcmlog")
    shutil.copy(brief_coasting_robot.model, tmp_path / "model.toml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def page():
    with sync_playwright() as playwright:
        # As root there is no sandbox to be had.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        page.set_default_timeout(PATIENT_MS)
        yield page
        browser.close()


@contextmanager
def workbench(*arguments):
    """The command as a user starts it; its address."""
    command = [sys.executable, "-m", "twinmill_cli.main", "open", "run.lcmlog", "--no-browser"]
    command += ["--model", "model.toml", "--state", "state.json", *arguments]
    # NiceGUI behaves otherwise where it finds itself in a test.
    alone = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=alone)
    try:
        words = server.stdout.readline()
        yield re.search(r"http\S+", words)[0]
    finally:
        server.send_signal(signal.SIGINT)
        server.stdout.close()
        assert server.wait(60) == 0


def exact(page, number: int) -> str:
    """The score of a model once the worker has it, without the sign of an estimate."""
    row = page.get_by_test_id(f"model-{number}")
    expect(row).not_to_contain_text("≈", timeout=PATIENT_MS)
    return row.locator("div").nth(1).text_content()


def test_the_whole_conversation(folder, page):
    foreign, broken = [], []
    page.on("request", lambda r: foreign.append(r.url) if "//127.0.0.1:" not in r.url else None)
    page.on("pageerror", lambda error: broken.append(str(error)))
    with workbench() as url:
        page.goto(url)
        page.wait_for_function("document.body.dataset.predicted !== undefined")
        shown = page.get_by_test_id("score")
        expect(shown).to_have_text(re.compile(r"\d"), timeout=PATIENT_MS)
        given = shown.text_content()

        # A knob is turned, and the error rises; undone, and it is as before.
        slider = page.get_by_test_id("knob-base.forward_gain").locator(".q-slider__track-container")
        box = slider.bounding_box()
        slider.click(position={"x": 0.9 * box["width"], "y": box["height"] / 2})
        expect(shown).not_to_have_text(given, timeout=PATIENT_MS)
        page.get_by_test_id("undo").and_(page.locator(":enabled")).wait_for()
        assert float(shown.text_content().strip("≈ ")) > float(given)
        page.keyboard.press("z")
        expect(shown).to_have_text(given, timeout=PATIENT_MS)

        # Regimes: a click marks their moments and moves the cursor.
        page.get_by_test_id("tab-fails").click()
        chart = page.get_by_test_id("regimes").locator("canvas").first
        chart.wait_for()
        chart.click(position={"x": 132, "y": 6 + 0.5 * 21}, force=True)
        page.wait_for_function("twinmill.marks.length > 0 && twinmill.t > 0")

        # What is missing is named, and added.
        page.get_by_test_id("tab-missing").click()
        page.get_by_test_id("diagnose").click()
        page.get_by_test_id("finding-coasting").wait_for()
        page.get_by_test_id("add-coasting").click()
        page.get_by_test_id("tab-models").click()
        page.get_by_test_id("model-2").wait_for()
        added = exact(page, 2)

        # The file that is saved is the commands'.
        page.get_by_test_id("save-as").fill("mine.toml")
        page.get_by_test_id("save").click()
        page.get_by_text("Written: mine.toml").wait_for()
        commands = page.get_by_test_id("commands").text_content().strip().splitlines()
        mine = (folder / "mine.toml").read_bytes()
        os.remove("mine.toml")
        results = [cli.run(shlex.split(command)[1:]) for command in commands]
        assert (folder / "mine.toml").read_bytes() == mine
        assert added == f"{results[-1].after.score:.3g}"
        assert given == f"{results[0].before.score:.3g}"

        # A reload loses nothing, nor does a server that was stopped.
        page.reload()
        expect(page.get_by_test_id("model-2")).to_have_class(re.compile("now"), timeout=PATIENT_MS)
    with workbench() as url:
        page.goto(url)
        page.get_by_test_id("tab-models").click()
        expect(page.get_by_test_id("model-2")).to_have_class(re.compile("now"), timeout=PATIENT_MS)
        assert exact(page, 2) == added
    assert not foreign
    assert not broken


def test_without_its_token_the_page_is_refused(folder, page):
    with workbench() as url:
        answer = page.goto(url.split("?")[0])
        assert answer.status == 403
        assert page.request.get(f"{url.split('?')[0]}data/log?log=0&token=wrong").status == 403
