# SPDX-License-Identifier: Apache-2.0
"""The workbench's secret and its page in a real browser: who is led there, and who is kept out."""

import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import parse_qs, urlsplit

import pytest

FOREIGN = '<img src=x onerror="window.owned=1"><script>window.owned=1</script>'
NAME = "<img src=x onerror=window.owned=1>.lcmlog"
VIOLATIONS = """
    window.violations = [];
    addEventListener("securitypolicyviolation", (e) => violations.push(e.violatedDirective));
"""


@contextmanager
def opened(log: Path, state: Path, browser: Path) -> Iterator[str]:
    """The command as a user starts it, who has that browser; its address."""
    command = [sys.executable, "-m", "twinmill_cli.main", "open", str(log), "--state", str(state)]
    # NiceGUI behaves otherwise where it finds itself in a test.
    alone = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    alone["BROWSER"] = f"{browser} %s"
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=alone)
    try:
        yield re.search(r"http\S+", server.stdout.readline())[0]
    finally:
        server.send_signal(signal.SIGINT)
        server.stdout.close()
        assert server.wait(60) == 0


@pytest.fixture(scope="module")
def workbench(tmp_path_factory, brief_coasting_robot):
    """Its folder, its address and the command line of the browser that it started."""
    folder = tmp_path_factory.mktemp("opened")
    browser = folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$@" > {folder}/part && mv {folder}/part {folder}/words\n')
    browser.chmod(0o755)
    log = shutil.copy(brief_coasting_robot.log, folder / NAME)
    with opened(log, folder / "state.json", browser) as url:
        end_s = time.monotonic() + 30
        while not (folder / "words").exists() and time.monotonic() < end_s:
            time.sleep(0.05)
        yield folder, url, (folder / "words").read_text().strip()


def token_of(url: str) -> str:
    return parse_qs(urlsplit(url).query)["token"][0]


@pytest.fixture
def stranger():
    """A server of somebody else: its address, pages that it serves, and headers of its visitors."""
    pages, visits = {"/": "<p>a stranger's page"}, []

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self):
            visits.append(dict(self.headers))
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(pages.get(self.path, "").encode())

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", pages, visits
    server.shutdown()
    server.server_close()


def test_the_browser_is_led_there_by_a_file_of_its_owner(workbench, page):
    """All users of a machine can read the command line."""
    _, url, words = workbench
    assert token_of(url) not in words and words.startswith("file://")
    path = Path(words.removeprefix("file://"))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    page.goto(words)
    page.wait_for_url(url)
    page.get_by_test_id("score").wait_for()


def test_each_start_has_a_secret_of_its_own(workbench, page):
    folder, url, _ = workbench
    kept = folder / "again.json"
    shutil.copy(folder / "state.json", kept)
    assert token_of(url) not in kept.read_text()
    with opened(folder / NAME, kept, folder / "browser") as again:
        assert token_of(again) != token_of(url)
        old = again.replace(token_of(again), token_of(url))
        assert page.request.get(old).status == 403 and page.request.get(again).status == 200
    assert not list(folder.glob("again.open.html"))


def test_the_page_keeps_its_own_policies(workbench, page):
    """Nothing of its own is refused, and a text that got in as HTML would not run."""
    _, url, _ = workbench
    page.add_init_script(VIOLATIONS)
    page.goto(url)
    page.get_by_test_id("score").wait_for()
    page.wait_for_function("window.twinmill?.robot !== undefined")
    assert page.evaluate("violations") == [] and page.evaluate("window.owned") is None
    page.evaluate("(html) => document.body.insertAdjacentHTML('beforeend', html)", FOREIGN)
    page.wait_for_function("violations.length > 0")
    assert set(page.evaluate("violations")) == {"script-src-attr"}
    assert page.evaluate("window.owned") is None


def test_the_page_says_nothing_to_other_servers(workbench, page, stranger):
    _, url, _ = workbench
    elsewhere, _, visits = stranger
    page.goto(url)
    asked = "(url) => fetch(url, { mode: 'no-cors' }).then(() => 'said', () => 'refused')"
    assert page.evaluate(asked, elsewhere) == "refused"
    assert visits == []
    page.evaluate("(url) => { location.href = url; }", elsewhere)
    page.get_by_text("a stranger's page").wait_for()
    own = urlsplit(url).netloc
    assert visits and all(own not in headers.get("Referer", "") for headers in visits)


def test_no_other_page_has_it_in_a_frame(workbench, page, stranger):
    _, url, _ = workbench
    elsewhere, pages, _ = stranger
    pages["/frame"] = f'<iframe src="{url}"></iframe>'
    refused = []
    page.on("console", lambda message: refused.append(message.text))
    page.goto(f"{elsewhere}/frame")
    page.wait_for_timeout(500)
    assert any("frame" in text.lower() for text in refused)
    assert page.frames[1].url.startswith("chrome-error:")
