"""What a person wants from the page, by the keyboard alone and by touch at 360 px: docs/page.md
says how many steps each takes.
"""

import re
from pathlib import Path

import pytest
from page_house import place, wait_for
from playwright.sync_api import expect

from companion.languages.cmd import TaskState
from companion.languages.facts import Kind, fact
from companion.languages.values import Side

pytestmark = pytest.mark.process
DOCS = Path(__file__).parents[2] / "docs/page.md"
TOUCH_PX = 44  # the least size of a target (WCAG 2.2, 2.5.5)
SMALL = {"viewport": {"width": 360, "height": 640}}
NAME = """(({ activeElement: on }) => on.getAttribute("aria-label") || on.textContent)(document)"""
MOST = 60  # steps of a walk that has lost its way


class Keyboard:
    """Tab, Enter, Escape and Page Down: each is a step."""

    settings = SMALL

    def __init__(self, one):
        self.one, self.steps = one, 0

    def key(self, name):
        self.one.keyboard.press(name)
        self.steps += 1
        assert self.steps < MOST

    def press(self, name):
        """Go to a button with the Tab key, and press it."""
        while self.one.evaluate(NAME).strip() != name:
            self.key("Tab")
        self.key("Enter")

    def stop(self):
        self.key("Escape")

    def see(self, selector):
        """Scroll until a text is in sight above the bar."""
        while not self.one.locator(selector).first.evaluate(IN_SIGHT):
            self.key("PageDown")


class Touch(Keyboard):
    """Taps, and swipes of most of the screen."""

    settings = SMALL | {"has_touch": True, "is_mobile": True}

    def press(self, name):
        target = self.one.get_by_role("button", name=name, exact=True).first
        while not target.evaluate(IN_SIGHT):
            self.swipe()
        box = target.bounding_box()
        assert min(box["width"], box["height"]) >= TOUCH_PX, (name, box)
        target.tap()
        self.steps += 1

    def stop(self):
        self.press("STOP")

    def see(self, selector):
        while not self.one.locator(selector).first.evaluate(IN_SIGHT):
            self.swipe()

    def swipe(self):
        self.one.evaluate("scrollBy({ top: 0.7 * innerHeight, behavior: 'instant' })")
        self.steps += 1
        assert self.steps < MOST


IN_SIGHT = """on => {
    const box = on.getBoundingClientRect(), bar = stopbar.getBoundingClientRect();
    return box.top >= 0 && (stopbar.contains(on) || box.bottom <= bar.top);
}"""


def begin(house):
    """A look around is over, two tasks wait behind one that runs with a jar in its hand."""
    house.post("look around")
    house.report("hi-1-1", TaskState.DONE, fact(Kind.SEEN, "bowl_1", "jar_1"))
    for text in ("take the jar", "take the bowl", "put down the jar"):
        house.post(text)
    house.running("hi-1-2")
    told = {"at": place(1, "Grasp"), "number": 1, "hands": {Side.LEFT: "jar_1"}}
    house.report("hi-1-2", TaskState.RUNNING, **told)


def is_it_done(house, one, by):
    house.report("hi-1-3", TaskState.CANCELLED)
    house.report("hi-1-4", TaskState.CANCELLED)
    house.report("hi-1-2", TaskState.DONE, fact(Kind.TOOK, 20.0))
    expect(one.locator("#bar")).to_contain_text("Done: take the jar")
    by.see("#bar")


def one_thing_earlier(house, one, by):
    by.press("Do this first: put down the jar")
    wait_for(lambda: house.cancelled == ["hi-1-4"], "the later one is asked for first")


def stop_and_go_on(house, one, by):
    by.stop()
    expect(one.locator("#release")).to_be_visible()
    assert house.held
    by.press("Let Velma move again")
    wait_for(lambda: not house.held, "the robot may move")


def understand_a_failure(house, one, by):
    house.report("hi-1-2", TaskState.FAILED, fact(Kind.NO_GRASP, Side.LEFT, "jar_1"))
    expect(one.locator("#last")).to_contain_text("cannot take the jar where it is")
    by.see("#last")


def what_is_in_its_hand(house, one, by):
    expect(one.locator("#hands")).to_have_text("My left hand holds the jar.")
    by.see("#hands")


def call_for_help(house, one, by):
    expect(one.locator(".call")).to_contain_text("Call Anna, 0123 456.")
    by.see(".call")


WALKS = {
    "find out whether it is done": is_it_done,
    "make it do one thing earlier": one_thing_earlier,
    "stop it, and let it go on": stop_and_go_on,
    "understand a failure": understand_a_failure,
    "know what is in its hand": what_is_in_its_hand,
    "call for help": call_for_help,
}


@pytest.mark.parametrize("by", [Keyboard, Touch])
@pytest.mark.parametrize("wish", WALKS)
def test_each_wish_takes_the_steps_that_the_docs_say(house, page, opened, wish, by):
    """From the top of the page, with a task under way and two that wait."""
    page.settings["ROCO_CONTACT"] = "Anna, 0123 456"
    page.kill()
    page.start()
    begin(house)
    one = opened(paired=False, **by.settings)
    one.goto(f"{page.url}/pair#{page.code()}")
    expect(one.locator("#step")).to_contain_text("Step 1 of 3")
    walker = by(one)
    WALKS[wish](house, one, walker)
    row = re.search(rf"^- {wish}: (\d+) and (\d+)$", DOCS.read_text(), re.MULTILINE)
    assert row, wish
    assert walker.steps == int(row[1 if by is Keyboard else 2])
