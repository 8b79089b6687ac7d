# SPDX-License-Identifier: Apache-2.0
"""The workbench: its first view, a turned knob, the first answer of Add, in processor time.

In a browser the first view and the cursor are timed by the clock: there a busy machine counts.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from ratio import Ratio, single, skipped

from twinmill.data.measurement import load_measurements
from twinmill.experiment.rich_script import write_rich_script
from twinmill.fitting.add import add
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.workbench.session import Session

DURATION_S, ROBOTS, MANY = 150.0, 4, 20
EFFECT = "coasting"
HIDDEN = f'\n[[effect]]\nname = "{EFFECT}"\ndeceleration_mps2 = 0.7\n'
FIRST_VIEW_S, FIRST_ANSWER_S, KNOB_S, FRAMES = 2.0, 0.5, 0.05, 30.0
PREDICTION_S = 20.0  # from the address to the first prediction of twenty robots of 150 s
TURNS = 10  # of a knob
KNOB = "base.motor_lag_s"
BETWEEN_MS = 400  # turns in the browser
DRAWN = """() => {
    window.latency = [];
    let moved = null;
    window.addEventListener("mousemove", () => { moved ??= performance.now(); }, true);
    const draw = twinmill._predicted.bind(twinmill);
    twinmill._predicted = (found) => {
        draw(found);
        requestAnimationFrame(() => {
            if (moved !== null) latency.push(performance.now() - moved);
            moved = null;
        });
    };
}"""  # ms from a move of the mouse to the end of the frame that has its prediction
PLAYED_S = 4.0
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PREDICTED = "document.body?.dataset?.predicted !== undefined"
JUDGED = "/^[0-9]/.test(document.querySelector('[data-testid=score]').textContent)"  # no more ≈


def measure(build: Path) -> Iterator[Ratio]:
    """Four robots that roll on after each stop, and a model that does not know it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given = ModelFile.load("turbopi.toml")
        (folder / "true.toml").write_text(given.text + HIDDEN)
        log = _drive(build, folder, ROBOTS)
        yield from _session(log, given, folder)
        yield from _browser(_drive(build, folder, MANY), folder)
        yield from _hand(_drive(build, folder, 1), folder)


def _drive(build: Path, folder: Path, robots: int) -> Path:
    """Lets robots of the twin drive the script."""
    script, log = folder / "script.csv", folder / f"{robots}.lcmlog"
    if not script.exists():
        write_rich_script(script, DURATION_S, 1)
    command = [build / "bin/twin_run", "--plant", "planar", "--model", folder / "true.toml"]
    command += ["--n", robots, "--script", script, "--spread-m", 12, "--log", log]
    subprocess.run([str(word) for word in command], check=True, capture_output=True)
    return log


def _session(log: Path, given: ModelFile, folder: Path) -> Iterator[Ratio]:
    session = Session([log], "turbopi.toml")
    session.read()
    session.measure()
    first_s, _ = _timed(lambda: session.judge(0))
    measurements = load_measurements([log], given.model)
    all_s, _ = _timed(lambda: open_measurements(measurements, given))
    yield single("first robot : all four", first_s, all_s, "s", at_most=0.5)
    for index in session.unjudged:
        session.judge(index)
    session.exclude_wrong([])
    session.conclude()
    answer_s, previewed = _timed(lambda: session.preview(EFFECT, 0))
    out = folder / "added.toml"
    added_s, added = _timed(lambda: add(EFFECT, measurements, given, out=out, command=""))
    session.show(previewed)
    says = f"score {session.passing_score(0):.3g}, in full {added.after.score:.3g}, "
    says += f"before {added.before.score:.3g}"
    yield single("first answer : add", answer_s, added_s, "s", says=says)
    yield single("first answer : half a second", answer_s, FIRST_ANSWER_S, "s", at_most=1)

    def turn() -> None:
        for value in np.linspace(0.05, 0.15, TURNS):
            session.drag(KNOB, float(value))
            session.robots[0].predicted(session.shown(0).model)

    turned_s, _ = _timed(turn)
    yield single("turn of a knob : 50 ms", turned_s / TURNS, KNOB_S, "s", at_most=1)


def _timed(work: Callable) -> tuple[float, Any]:
    """Seconds of processor time of all threads, and the result."""
    started_s = time.process_time()
    result = work()
    return time.process_time() - started_s, result


@contextmanager
def _opened(log: Path, folder: Path) -> Iterator[tuple[Any, str]]:
    """A page of Chromium and the address of the workbench."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "twinmill_cli.main", "open", log, "--no-browser"]
    command += ["--state", folder / f"{log.stem}.json"]
    server = subprocess.Popen([str(w) for w in command], stdout=subprocess.PIPE, text=True)
    try:
        url = re.search(r"http\S+", server.stdout.readline())[0]
        with sync_playwright() as playwright:
            # As root there is no sandbox to be had.
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1366, "height": 768})
            page.set_default_timeout(600_000)
            yield page, url
            browser.close()
    finally:
        server.terminate()
        server.wait()


def _browser(log: Path, folder: Path) -> Iterator[Ratio]:
    """By the clock, in Chromium: the paths of twenty robots, and the cursor while it plays."""
    names = ("first view, 20 robots : 2 s", "first prediction : 20 s", "frames : 30 a second")
    if CHROMIUM is None:
        yield from (skipped(name, "no Chromium") for name in names)
        return
    with _opened(log, folder) as (page, url):
        started_s = time.monotonic()
        page.goto(url, wait_until="commit")
        page.wait_for_function("document.body?.dataset?.paths > 0", polling=20)
        seen_s = time.monotonic() - started_s
        page.wait_for_function(PREDICTED)
        predicted_s = time.monotonic() - started_s
        page.evaluate("twinmill.play(true)")
        before = page.evaluate("[twinmill.frames, performance.now()]")
        page.wait_for_timeout(1000 * PLAYED_S)
        after = page.evaluate("[twinmill.frames, performance.now()]")
    rate = 1000 * (after[0] - before[0]) / (after[1] - before[1])
    yield single(names[0], seen_s, FIRST_VIEW_S, "s", at_most=1)
    yield single(names[1], predicted_s, PREDICTION_S, "s", at_most=1)
    yield single(names[2], rate, FRAMES, "1/s", at_least=1)


def _hand(log: Path, folder: Path) -> Iterator[Ratio]:
    """By the clock, in Chromium: from a move of the hand on a knob to its prediction drawn."""
    name = "knob to drawing : 50 ms"
    if CHROMIUM is None:
        yield skipped(name, "no Chromium")
        return
    with _opened(log, folder) as (page, url):
        page.goto(url, wait_until="commit")
        page.wait_for_function(PREDICTED)
        track = page.get_by_test_id(f"knob-{KNOB}").locator(".q-slider__track-container")
        page.wait_for_function(JUDGED)
        box = track.bounding_box()
        page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + box["height"] / 2)
        page.mouse.down()
        page.wait_for_timeout(BETWEEN_MS)
        page.evaluate(DRAWN)
        for k in range(TURNS):
            at = 0.3 + 0.3 * (k + 1) / TURNS
            page.mouse.move(box["x"] + at * box["width"], box["y"] + box["height"] / 2)
            page.wait_for_function(f"latency.length > {k}", polling=BETWEEN_MS)
        found = page.evaluate("latency")
    yield single(name, float(np.median(found)) / 1000, KNOB_S, "s")
