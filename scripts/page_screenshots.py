"""Pictures of the person's page in headless Chromium: a fleet that pours, with other tasks waiting
behind it.
"""

import subprocess
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
DESKTOP, PHONE = {"width": 1280, "height": 1330}, {"width": 360, "height": 720}
LONG_MS = 180_000.0
"""Until a task has ended, on busy cores."""
LARGEST_PX, USUAL_PX = 24, 16  # Chromium's largest letters, and its usual ones
POUR = "pour the jar into the bowl"


def pictures(run: Path, out: Path, roco: Path) -> list[Path]:
    """Return the pictures, made of the fleet of this run."""
    door = subprocess.run(
        [roco, "page", "--run-dir", run], capture_output=True, text=True, check=True
    ).stdout.strip()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, chromium_sandbox=False)
        try:
            return _taken(browser, door, out)
        finally:
            browser.close()


def _taken(browser: Browser, door: str, out: Path) -> list[Path]:
    context = browser.new_context(viewport=DESKTOP)
    context.set_default_timeout(LONG_MS)
    page = context.new_page()
    page.goto(door)
    page.get_by_role("button", name="Look around").click()
    page.locator("#ended .done").wait_for()
    for text in (POUR, "look around", "put down the jar"):
        _say(page, text)
    page.get_by_text("carry the jar", exact=False).first.wait_for()
    page.locator("#left:not([hidden])").wait_for()
    page.locator("#answer").evaluate("answer => answer.textContent = ''")
    files = [out / name for name in ("page.png", "page_large_letters.png", "page_phone.png")]
    page.evaluate("scrollTo(0, 0)")
    page.screenshot(path=files[0])
    devtools = context.new_cdp_session(page)
    for px, file in ((LARGEST_PX, files[1]), (USUAL_PX, None)):
        fonts = {"fontSizes": {"standard": px, "fixed": px}}
        devtools.send("Page.setFontSizes", fonts)
        if file is not None:
            page.screenshot(path=file)
    known = context.storage_state()
    phone = browser.new_context(
        viewport=PHONE,
        device_scale_factor=2,
        color_scheme="dark",
        locale="pl-PL",
        storage_state=known,
    ).new_page()
    phone.goto(page.url)
    phone.locator("#stop").click()
    phone.locator("#release").wait_for()
    phone.locator("#picture:not([hidden])").wait_for()
    phone.screenshot(path=files[2])
    return files


def _say(page: Page, text: str) -> None:
    page.locator("#text").fill(text)
    page.locator("#send").click()
    page.locator("#queue li, #step:not(:empty)").first.wait_for()
