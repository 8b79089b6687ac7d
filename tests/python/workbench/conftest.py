# SPDX-License-Identifier: Apache-2.0
"""A real browser, and pages that nothing may break and that fetch nothing from elsewhere."""

import shutil

import pytest
from playwright.sync_api import expect, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENT_MS = 300_000  # for a machine that is busy with other tests: four robots take 16 s of a core
# All that a page told in passing: on a busy machine a notice is gone before the test looks for it.
NOTICES = """
    window.notices = [];
    new MutationObserver(() => {
        for (const { textContent } of document.querySelectorAll(".q-notification")) {
            if (notices.at(-1) !== textContent) notices.push(textContent);
        }
    }).observe(document, { childList: true, subtree: true, characterData: true });
"""
HERE = ("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "file:", "blob:")


@pytest.fixture(scope="session")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium: apt install chromium")
    with sync_playwright() as playwright:
        # As root there is no sandbox to be had.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def page(browser):
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.set_default_timeout(PATIENT_MS)
    expect.set_options(timeout=PATIENT_MS)
    page.foreign, page.broken = [], []
    page.add_init_script(NOTICES)
    page.noticed = lambda words: page.wait_for_function(
        "(words) => notices.some((n) => n.includes(words))", arg=words
    )
    page.on("request", lambda r: None if r.url.startswith(HERE) else page.foreign.append(r.url))
    page.on("pageerror", lambda error: page.broken.append(str(error)))
    yield page
    page.close()
    assert not page.foreign
    assert not page.broken
