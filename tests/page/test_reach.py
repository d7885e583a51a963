"""Everybody reaches everything: by keyboard, on a small screen, enlarged, in the dark, with a
screen reader's rules.
"""

import itertools

import pytest
from axe_playwright_python.sync_playwright import Axe
from page_house import place as in_plan
from page_house import wait_for
from playwright.sync_api import expect

from companion.languages.cmd import TaskState
from companion.languages.facts import Kind, fact

pytestmark = pytest.mark.process
SMALL = {"width": 360, "height": 640}
ENLARGED = {"width": 640, "height": 400}  # 1280 x 800 at 200 %


def busy(house, one):
    """A page with all its parts: a task under way, one that waits, one that failed, things, a
    question.
    """
    for text in ("look around", "take the jar", "take the bowl", "put down the jar"):
        one.locator("#text").fill(text)
        one.locator("#send").click()
        expect(one.locator("#text")).to_have_value("")
    house.report("hi-1-1", TaskState.DONE, fact(Kind.SEEN, "bowl_1", "jar_1", "jar_2"))
    house.report("hi-1-2", TaskState.FAILED, fact(Kind.NO_GRASP, "left", "jar_1"))
    house.running("hi-1-3")
    one.locator("#text").fill("take the container")
    one.locator("#send").click()
    expect(one.locator("#replies button")).to_have_count(2)
    expect(one.locator("#step")).not_to_be_empty()
    expect(one.locator("#queue li")).to_have_count(1)
    expect(one.locator("#ended li")).to_have_count(2)


@pytest.mark.parametrize("locale", ["en-GB", "pl-PL"])
def test_small_and_enlarged(house, opened, locale):
    """Nothing is wider than the screen, at the door or inside; STOP is in sight wherever one
    scrolls to, and large.
    """
    one, door = opened(locale=locale), opened(paired=False, locale=locale)
    busy(house, one)
    one.keyboard.press("Escape")
    expect(one.locator("#release")).to_be_visible()
    for size in (SMALL, ENLARGED):
        one.set_viewport_size(size)
        door.set_viewport_size(size)
        for place in (0, 10_000, 400):
            one.evaluate(f"scrollTo(0, {place})")
            for name in ("#stop", "#release"):
                expect(one.locator(name)).to_be_in_viewport(ratio=1.0)
                box = one.locator(name).bounding_box()
                assert box["width"] >= 100
                assert box["height"] >= 44
        for each in (one, door):
            assert each.evaluate("document.documentElement.scrollWidth") <= size["width"]
        assert one.evaluate("document.querySelector('#stopbar').offsetHeight / innerHeight") < 0.3


@pytest.mark.parametrize("px", [9, 24, 32])
@pytest.mark.parametrize("width", [360, 1280])
def test_at_every_size_of_letters(browser, house, opened, width, px):
    """Chromium's smallest and largest (24), and a third more: no text stands in a narrow column,
    and nothing is wider than the screen.
    """
    one = opened(viewport={"width": width, "height": 900})
    busy(house, one)
    # a page has no power over the browser's setting; the page's sizes are all relative to it
    one.context.new_cdp_session(one).send(
        "Page.setFontSizes", {"fontSizes": {"standard": px, "fixed": px}}
    )
    assert one.evaluate("document.documentElement.scrollWidth") <= width
    narrow = one.evaluate("""() => {
            const all = document.querySelectorAll("main p:not(:empty), main li .says");
            const shown = [...all].filter((each) => each.offsetParent);
            return shown.map((each) => [each.id || each.className, each.parentNode.clientWidth]);
        }""")
    assert not [place for place in narrow if place[1] < min(0.6 * width, 18 * px)], narrow
    expect(one.locator("#stop")).to_be_in_viewport(ratio=1.0)


def test_on_a_telephone_what_happens_comes_before_the_buttons(house, opened):
    """The current task, the sentence, what waits; then the things."""
    one = opened(viewport=SMALL)
    busy(house, one)
    tops = [
        one.locator(f"section.{name}").bounding_box()["y"] for name in ("now", "queue", "things")
    ]
    assert tops == sorted(tops)
    assert one.locator(".things button").count() > 5


def test_who_can_be_called_is_said_with_stop(page, opened):
    """Where the operator told the page; the red button always."""
    one = opened()
    expect(one.locator("#stopbar")).to_contain_text("the red button on the robot")
    page.settings["ROCO_CONTACT"] = "Anna, 0123 456 <b>"
    page.kill()
    page.start()
    one.reload()
    expect(one.locator("#stopbar")).to_contain_text("Call Anna, 0123 456 <b>.")


def test_all_of_it_by_keyboard(house, opened):
    """STOP comes first; each button is reached by Tab, shows it, is not behind the bar, and works
    by Enter.
    """
    one = opened()
    busy(house, one)
    one.reload()
    expect(one.locator("#queue li")).to_have_count(1)
    wanted = one.locator("button:visible, a:visible, input:visible").count()
    reached = []
    for _ in range(wanted + 2):
        one.keyboard.press("Tab")
        told = one.evaluate("""() => {
                const on = document.activeElement, box = on.getBoundingClientRect();
                const bar = stopbar.getBoundingClientRect();
                const covered = !stopbar.contains(on) && box.bottom > bar.top + 1;
                const name = on === document.body ? "" : on.id || on.textContent;
                return [name, getComputedStyle(on).outlineStyle, covered];
            }""")
        reached.append(told)
        if len(reached) > 1 and told[0] == "stop":
            break
    assert reached[0][0] == "stop"
    inside = [told for told in reached if told[0]]
    assert {style for _, style, _ in inside} == {"solid"}
    assert not [name for name, _, covered in inside if covered]
    assert len(inside) >= wanted
    one.get_by_role("button", name="Cancel: put down the jar").focus()
    one.keyboard.press("Enter")
    wait_for(lambda: house.cancelled == ["hi-1-4"], "the key does it")


def test_who_is_on_a_button_stays_on_it(house, opened):
    """News that fill a list again do not throw the keyboard out of it."""
    one = opened()
    busy(house, one)
    one.get_by_role("button", name="Cancel: put down the jar").focus()
    one.evaluate("send('/say', {text: 'look around'})")
    expect(one.locator("#queue li")).to_have_count(2)
    expect(one.get_by_role("button", name="Cancel: put down the jar")).to_be_focused()


def test_no_serious_finding_of_axe(house, opened):
    """Names, roles, order, contrast: with all parts shown, stopped, lost, and at the door, in all
    colours.
    """
    one, door, found = opened(), opened(paired=False), {}

    def look(place, on):
        for scheme, contrast in itertools.product(("light", "dark"), ("no-preference", "more")):
            on.emulate_media(color_scheme=scheme, contrast=contrast)
            found[place, scheme, contrast] = serious(on)

    busy(house, one)
    look("busy", one)
    one.keyboard.press("Escape")
    expect(one.locator("#release")).to_be_visible()
    look("stopped", one)
    one.evaluate("lost(true)")
    look("lost", one)
    look("door", door)
    assert not any(found.values()), found


def serious(one):
    """The serious findings of axe-core, with the places."""
    said = Axe().run(one).response["violations"]
    bad = [rule for rule in said if rule["impact"] in ("serious", "critical")]
    return [(rule["id"], [node["html"] for node in rule["nodes"]]) for rule in bad]


def test_stop_is_seen_where_the_system_has_the_colours(house, opened):
    """With forced colours STOP keeps its red, and every button a border."""
    one = opened(forced_colors="active")
    assert (
        one.locator("#stop").evaluate("on => getComputedStyle(on).backgroundColor")
        == "rgb(204, 0, 0)"
    )
    assert one.locator("#send").evaluate("on => getComputedStyle(on).borderTopWidth") == "2px"


def test_a_status_is_said_once(house, opened):
    """A view that says the same again changes no text that a screen reader would say again."""
    one = opened()
    busy(house, one)
    one.evaluate("""() => {
            window.changes = 0;
            const all = { childList: true, subtree: true };
            for (const id of ["now", "answer", "lost"])
                new MutationObserver(() => (changes += 1)).observe(byId(id), all);
        }""")
    house.report("hi-1-3", TaskState.RUNNING, at=in_plan(2, "MoveJoint"), number=2)
    expect(one.locator("#step")).to_contain_text("carry the jar")
    assert one.evaluate("changes") == 0
