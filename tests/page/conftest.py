"""A page before a hi, and browsers that look at it."""

import os
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(1, str(Path(__file__).parents[1] / "fleet"))

from page_house import WITHIN_S, House, PageProcess

CHROMIUM = shutil.which("chromium")


@pytest.fixture
def house(tmp_path):
    """hi."""
    made = House(tmp_path)
    yield made
    made.desk.close()


@pytest.fixture
def connect():
    """Address of the page's router: none."""
    return "tcp/127.0.0.1:1"


@pytest.fixture
def page(house, connect):
    """The page of that hi."""
    made = PageProcess(house.run, connect)
    yield made
    made.kill()


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium; its driver has a loop of asyncio in this thread, which no other module's
    tests may meet.
    """
    if CHROMIUM is None:
        pytest.skip("needs Chromium (Debian: apt install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(
            executable_path=CHROMIUM, chromium_sandbox=os.geteuid() != 0
        )
        yield launched
        launched.close()


@pytest.fixture
def opened(browser, page):
    """Open the page in a new browser profile, paired; errors of its scripts and its policy fail the
    test.
    """
    contexts, wrong = [], []

    def open_page(paired=True, at="", **settings):
        context = browser.new_context(**({"viewport": {"width": 1280, "height": 900}} | settings))
        context.set_default_timeout(WITHIN_S * 1000)
        contexts.append(context)
        one = context.new_page()
        one.on("pageerror", lambda error: wrong.append(str(error)))
        one.on(
            "console",
            lambda said: (
                wrong.append(said.text) if "Content Security Policy" in said.text else None
            ),
        )
        one.goto(f"{page.url}{at or '/pair'}{'#' + page.code() if paired else ''}")
        if paired:
            one.locator("#now", has_text="Velma").wait_for()
        return one

    yield open_page
    for context in contexts:
        context.close()
    assert not wrong
