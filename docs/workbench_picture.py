# SPDX-License-Identifier: Apache-2.0
"""Takes the picture of the page Workbench: `python docs/workbench_picture.py`, after `make build`.

A twin plays a robot that rolls on after each stop; the model does not know it.
"""

import re
import subprocess
import sys
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "workbench.png"
AT_S = 17.4  # while the robot rolls on


def main() -> None:
    """Records, opens, waits for the predictions, takes the picture."""
    with TemporaryDirectory() as folder:
        recording = [sys.executable, ROOT / "examples" / "make_recording.py"]
        subprocess.run(recording, cwd=folder, check=True)
        twinmill = Path(sys.executable).with_name("twinmill")
        tables = ["--poses", "poses.csv", "--commands", "commands.csv"]
        subprocess.run([twinmill, "import", *tables, "-o", "run.lcmlog"], cwd=folder, check=True)
        command = [twinmill, "open", "run.lcmlog", "--no-browser", "--state", "state.json"]
        server = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
        try:
            take(re.search(r"http\S+", server.stdout.readline())[0])
        finally:
            server.terminate()
            server.wait()


def take(url: str) -> None:
    """The picture, once there is a diagnosis."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        page.set_default_timeout(600_000)
        page.goto(url)
        page.wait_for_function("document.body.dataset.predicted !== undefined")
        page.get_by_test_id("tab-missing").click()
        page.get_by_test_id("diagnose").click()
        page.get_by_test_id("finding-coasting").wait_for()
        page.get_by_test_id("show-coasting").click()
        page.wait_for_function("document.body.dataset.beside === 'with coasting'")
        page.evaluate(f"twinmill.seek({AT_S}); twinmill.look({AT_S} - 10, {AT_S} + 20)")
        page.mouse.move(5, 5)
        page.wait_for_timeout(500)
        page.screenshot(path=PICTURE)
        browser.close()


if __name__ == "__main__":
    main()
