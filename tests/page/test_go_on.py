"""An act that waits for a person is let begin from the page: that one, and no other."""

import json

import msgspec
import pytest
from page_house import place, wait_for
from playwright.sync_api import expect

from agent_runtime.core.control import KIND, Command, SetParameter
from agent_runtime.io.options import Options
from agent_runtime.io.sessions import free_endpoint, open_router
from agent_runtime.io.tap import open_ear
from companion.autonomy import STEP, Permission, Verb
from companion.design import DESIGN
from companion.languages.cmd import TaskState

pytestmark = pytest.mark.process
GRASP = "take jar_1/Grasp"


@pytest.fixture
def connect():
    """A router, without keys."""
    endpoint = free_endpoint()
    with open_router(endpoint):
        yield endpoint


@pytest.fixture
def orders(connect, tmp_path):
    """Orders put on the key on which ta hears the page."""
    heard = []
    options = Options(connect=connect, run_dir=tmp_path)
    key = DESIGN.signal_key(KIND, system="roco", owner="page", peer="ta")

    def hear(data):
        heard.append(msgspec.msgpack.decode(data, type=Command))

    ear = open_ear(options, key, hear, bool, "ta")
    yield heard
    ear.close()


def waits(house, number=1, act="Grasp"):
    """The plan of a task waits before this act."""
    house.report("hi-1-1", TaskState.RUNNING, at=place(number, act), number=number, asks=True)


def begun(house, page, cookie):
    """A task is under way."""
    page.form("/say", {"text": "take the jar"}, cookie)
    wait_for(lambda: house.asked, "the task is asked for")
    house.running(number=1, act="MoveJoint")


def test_the_button_is_there_while_an_act_waits_and_lets_that_one_begin(
    house, page, opened, orders
):
    """In words what comes next; the button goes with the wait."""
    one = opened()
    begun(house, page, page.paired())
    go = one.locator("#now-acts button.main")
    expect(one.locator("#now")).to_have_text("Take the jar.")
    expect(go).to_have_count(0)
    waits(house)
    expect(one.locator("#now")).to_have_text(
        "Velma waits for you. Next: take the jar (close the hand)."
    )
    expect(one.locator("#step")).to_have_text("Step 1 of 3: take the jar")
    expect(one.locator("#why")).to_have_text("")
    go.click()
    wait_for(lambda: orders, "ta is told")
    assert [one.order for one in orders] == [SetParameter(STEP, str(Permission(Verb.GO, GRASP)))]
    house.report("hi-1-1", TaskState.RUNNING, at=place(1, "Grasp"), number=1)
    expect(go).to_have_count(0)


def test_what_no_longer_waits_is_not_let_begin(house, page, orders):
    """A browser that was slow, or somebody who makes up an act: 409, and nothing is said to ta."""
    cookie = page.paired()
    begun(house, page, cookie)
    waits(house)
    wait_for(lambda: page.form("/step", {"at": GRASP}, cookie)[0] == 200, "it is let begin")
    wait_for(lambda: orders, "ta is told")
    count = len(orders)
    waits(house, act="MoveCartesian")
    wait_for(lambda: page.form("/step", {"at": GRASP}, cookie)[0] == 409, "the next one waits")
    for at in ("", "pour jar_1 bowl_1/pour"):
        assert page.form("/step", {"at": at}, cookie)[0] == 409
    assert len(orders) <= count + 1  # a last one before the page heard of the next wait


def test_without_a_cookie_nothing_is_let_begin(house, page, orders):
    """As for all that a browser may do."""
    begun(house, page, page.paired())
    waits(house)
    assert page.form("/step", {"at": GRASP})[0] == 401
    assert not orders


@pytest.mark.parametrize("connect", ["tcp/127.0.0.1:1"])
def test_without_a_router_the_page_says_so(house, page):
    """Nothing is promised."""
    cookie = page.paired()
    begun(house, page, cookie)
    waits(house)
    wait_for(lambda: page.form("/step", {"at": GRASP}, cookie)[0] == 503, "it is told")
    assert "did not reach" in json.loads(page.form("/step", {"at": GRASP}, cookie)[1])["error"]
