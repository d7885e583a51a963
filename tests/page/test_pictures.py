"""The pictures of the robot in a browser: ex is asked for them while somebody looks; they can be
enlarged, and say how old they are; STOP stays in reach.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path
from queue import Empty, Queue

import cv2
import msgspec
import numpy as np
import pytest
from page_house import WITHIN_S, wait_for
from playwright.sync_api import expect
from test_reach import serious

from agent_runtime.io.options import Options
from agent_runtime.io.sessions import free_endpoint, open_router
from agent_runtime.io.tap import open_ear
from companion.design import DESIGN
from companion.telemetry import WATCHED_S, Camera, Frame, Watch

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]
ROOM, HEAD = Camera.ROOM, Camera.HEAD
SMALL = {"width": 360, "height": 640}


@pytest.fixture
def connect():
    """A router, without keys."""
    endpoint = free_endpoint()
    with open_router(endpoint):
        yield endpoint


class Ex:
    """ex, as the page knows it: it is asked for frames, and tells them."""

    def __init__(self, connect: str, run: Path) -> None:
        self.asked: Queue[Watch] = Queue()
        key = DESIGN.signal_key("watch", system="roco", owner="page", peer="ex")
        ear = open_ear(Options(connect=connect, run_dir=run), key, self._heard, bool, "ex")
        assert ear is not None
        self._ear, self._count = ear, 0

    def _heard(self, data: bytes) -> None:
        self.asked.put(msgspec.msgpack.decode(data, type=Watch))

    def next(self) -> Watch:
        """What it is asked next; what it was asked before is forgotten."""
        while not self.asked.empty():
            self.asked.get()
        return self.asked.get(timeout=WITHIN_S)

    def tell(self, camera: Camera, age_s: float = 0.0) -> None:
        """A picture, other than the one before."""
        self._count += 1
        grey = np.full((600, 800, 3), 16 * (self._count % 16), np.uint8)
        self.put(Frame(camera, self._count, age_s, cv2.imencode(".jpg", grey)[1].tobytes()))

    def still(self, camera: Camera) -> None:
        """The last picture is still true."""
        self.put(Frame(camera, self._count, 0.0))

    def put(self, frame: Frame) -> None:
        """Tell it to the page."""
        key = DESIGN.signal_key("frame", system="roco", owner="ex", peer="page")
        self._ear.put(key, msgspec.msgpack.encode(frame))

    def close(self) -> None:
        """Hear no more."""
        self._ear.close()


@pytest.fixture
def ex(connect, tmp_path) -> Iterator[Ex]:
    one = Ex(connect, tmp_path)
    yield one
    one.close()


def showing(ex, opened, **settings):
    """A page with both pictures."""
    one = opened(**settings)
    ex.next()
    for camera in Camera:
        ex.tell(camera)
        expect(one.locator(f"#{camera}")).to_be_visible()
    return one


def button(one, name):
    """The button of a picture."""
    return one.locator(f"figure[data-of={name}] button")


def test_ex_is_asked_while_somebody_looks_and_for_what_is_large(ex, opened):
    """Of a page that nobody has open nothing is asked; of one, its large picture, which a click
    changes; after the last browser has gone, no more.
    """
    first = opened()
    assert ex.next().large == (ROOM,)
    ex.tell(ROOM)
    ex.tell(HEAD)
    expect(first.locator("#picture")).to_be_visible()
    assert ex.next().had.keys() == {ROOM, HEAD}
    button(first, "picture").click()
    wait_for(lambda: ex.next().large == (HEAD,), "the other one is large")
    second = opened()
    wait_for(lambda: set(ex.next().large) == {ROOM, HEAD}, "each browser has its own")
    for one in (first, second):
        one.close()
    wait_for(lambda: no_more(ex), "nobody looks")


def no_more(ex):
    """Whether nothing is asked for as long as a word holds."""
    try:
        ex.asked.get(timeout=WATCHED_S)
    except Empty:
        return True
    return False


def test_without_a_browser_nothing_is_asked(ex, page):
    """The page alone looks at nothing."""
    assert no_more(ex)


@pytest.mark.parametrize(("locale", "says"), [("en-GB", "{} s ago"), ("pl-PL", "{} s temu")])
def test_an_old_picture_says_how_old_it_is(ex, opened, locale, says):
    """One that is new, or still true, does not; on the page and enlarged."""
    one = showing(ex, opened, locale=locale)
    age = one.locator("figure.large .age")
    ex.tell(ROOM, age_s=40.0)
    expect(age).to_have_text(says.format(41))  # it grows
    ex.still(ROOM)
    expect(age).to_be_hidden()
    expect(age).to_have_text(says.format(2))
    button(one, "room").click()
    expect(one.locator("#enlarged .age")).to_have_text(says.format(4))
    ex.tell(ROOM)
    expect(one.locator("#enlarged .age")).to_be_hidden()
    ex.tell(ROOM, age_s=600.0)
    expect(one.locator("#enlarged .age")).to_contain_text("10 min")


@pytest.mark.parametrize("size", [{"width": 1280, "height": 900}, SMALL])
def test_the_large_picture_is_large_and_can_be_as_large_as_the_window(ex, opened, size):
    """On the page more than half of its width; enlarged, all that STOP leaves of the window in one
    direction. Nothing is wider than the screen.
    """
    one = showing(ex, opened, viewport=size)
    box = one.locator("#room").bounding_box()
    assert box["width"] > 0.52 * size["width"]
    assert box["width"] > 1.5 * one.locator("#picture").bounding_box()["width"]
    button(one, "room").click()
    box, bar = (one.locator(name).bounding_box() for name in ("#enlarged-picture", "#stopbar"))
    assert (box["x"], box["y"], box["width"]) == (0, 0, size["width"])
    assert box["height"] == pytest.approx(bar["y"], abs=1)
    assert one.evaluate("document.documentElement.scrollWidth") <= size["width"]
    fits = "getComputedStyle(byId('enlarged-picture')).objectFit"
    assert one.evaluate(fits) == "contain"


@pytest.mark.parametrize("by", ["mouse", "Enter"])
def test_it_is_enlarged_and_closed_by_mouse_and_by_keyboard(ex, opened, by):
    """It goes on with new pictures, and who was on the picture is there again."""
    one = showing(ex, opened)

    def press(place):
        if by == "mouse":
            place.click()
        else:
            place.focus()
            one.keyboard.press(by)

    press(button(one, "room"))
    expect(one.locator("#enlarged")).to_be_visible()
    expect(one.locator("#reduce")).to_be_focused()
    before = one.locator("#enlarged-picture").get_attribute("src")
    ex.tell(ROOM)
    expect(one.locator("#enlarged-picture")).not_to_have_attribute("src", before)
    press(one.locator("#reduce"))
    expect(one.locator("#enlarged")).to_be_hidden()
    expect(button(one, "room")).to_be_focused()
    button(one, "room").click()
    one.locator("#enlarged-picture").click(position={"x": 300, "y": 300})
    expect(one.locator("#enlarged")).to_be_hidden()


def test_stop_is_in_reach_of_an_enlarged_picture(ex, house, opened):
    """In sight, by Tab, by a click and by Escape, which does not close the picture; nothing behind
    it is reached.
    """
    one = showing(ex, opened)
    button(one, "room").click()
    expect(one.locator("#stop")).to_be_in_viewport(ratio=1.0)
    one.keyboard.press("Escape")
    wait_for(lambda: house.held, "Escape stops")
    expect(one.locator("#release")).to_be_visible()
    expect(one.locator("#enlarged")).to_be_visible()
    reached = []
    for _ in range(6):
        one.keyboard.press("Tab")
        reached.append(one.evaluate("document.activeElement.id"))
    assert {"stop", "release", "reduce"} <= set(reached) <= {"stop", "release", "reduce", ""}
    one.locator("#release").click()
    wait_for(lambda: not house.held, "it may move again")
    one.locator("#stop").click()
    wait_for(lambda: house.held, "a click stops")
    one.evaluate("lost(true)")
    expect(one.locator("#lost")).to_be_in_viewport(ratio=1.0)
    box, close = (one.locator(name).bounding_box() for name in ("#lost", "#reduce"))
    assert box["y"] >= close["y"] + close["height"]


def test_no_serious_finding_of_axe_where_a_picture_is_enlarged(ex, opened):
    """In all colours, and on a small screen; with its age."""
    one, found = showing(ex, opened), {}
    button(one, "room").click()
    for scheme, contrast in itertools.product(("light", "dark"), ("no-preference", "more")):
        one.emulate_media(color_scheme=scheme, contrast=contrast)
        found[scheme, contrast] = serious(one)
    one.set_viewport_size(SMALL)
    ex.tell(ROOM, age_s=30.0)
    expect(one.locator("#enlarged .age")).to_be_visible()
    found["small"] = serious(one)
    one.locator("#reduce").click()
    found["page"] = serious(one)
    assert not any(found.values()), found
