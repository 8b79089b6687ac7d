# SPDX-License-Identifier: Apache-2.0
"""The site as it is read from a folder, without a server and without the internet."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import expect, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
MKDOCS = ROOT / ".deps/docs"  # as `make docs` installs it
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.mark.skipif(not MKDOCS.is_dir(), reason="no MkDocs: make docs")
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt install chromium")
def test_a_page_opened_as_a_file_finds_words_of_another(tmp_path):
    """Two pages with the site's own settings; a browser starts no worker for pages of files."""
    (tmp_path / "docs").mkdir()
    shutil.copy(ROOT / "docs/iframe-worker.js", tmp_path / "docs")
    (tmp_path / "docs/index.md").write_text("# Home\n\nNothing to see.\n")
    (tmp_path / "docs/robot.md").write_text("# Robots\n\nTheir axolotl is weak.\n")
    settings = (ROOT / "mkdocs.yml").read_text().partition("nav:")[0]
    settings = settings.replace("hooks: [docs/site_hooks.py]\n", "")
    settings = settings.replace("extra_css: [equation.css]", "")
    (tmp_path / "mkdocs.yml").write_text(settings)
    command = [sys.executable, "-m", "mkdocs", "--quiet", "build"]
    environment = {**os.environ, "PYTHONPATH": str(MKDOCS)}
    subprocess.run(command, cwd=tmp_path, env=environment, check=True, capture_output=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        foreign = []
        page.on("request", lambda r: foreign.append(r.url) if r.url.startswith("http") else None)
        page.goto((tmp_path / "build/site/index.html").as_uri())
        asked = page.locator("[data-md-component=search-query]").first
        asked.click()
        asked.press_sequentially("axolotl")
        found = page.locator(".md-search-result__item")
        expect(found).to_contain_text("Their axolotl is weak.", timeout=20_000)
        assert not foreign
        browser.close()
