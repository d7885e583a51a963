"""Commands of a person in a real browser reach the coordinator and the robot, and their outcome is
seen.
"""

import datetime
import re
import time

import pytest
from page_house import place, wait_for
from playwright.sync_api import expect

from companion.commands import Offer, wishes
from companion.languages.cmd import TaskState
from companion.languages.facts import Kind, fact
from companion.languages.values import Side
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tasks.take.command import Take

pytestmark = pytest.mark.process
TOO_OFTEN = 429


def say(one, text):
    """Write a sentence, and send it by the Enter key."""
    one.locator("#text").fill(text)
    one.locator("#text").press("Enter")


def seen(house, *names):
    """Velma has looked around and seen these."""
    house.report(house.asked[-1][0], TaskState.DONE, fact(Kind.SEEN, *names))


def test_a_sentence_becomes_a_task_and_its_plan_is_followed(house, opened):
    """The page shows the running act, the number of the step out of how many, and the next one, in
    words.
    """
    one = opened()
    say(one, "pour the jar into the bowl")
    expect(one.locator("#queue li")).to_have_text(
        "Pour the content of the jar into the bowlwaitingI do it next.Cancel"
    )
    assert house.asked[0][1] == PourInto("jar", "bowl")
    house.running(number=2, act="MoveJoint")
    expect(one.locator("#now")).to_have_text("Pour the content of the jar into the bowl.")
    expect(one.locator("#step")).to_have_text("Step 2 of 3: carry the jar")
    expect(one.locator("#next")).to_have_text("Then: take the bowl")
    house.report("hi-1-1", TaskState.DONE, fact(Kind.TOOK, 75.0))
    ended = r"^Pour the content of the jar into the bowldone\d\d:\d\dDo it again$"
    expect(one.locator("#ended li")).to_have_text(re.compile(ended))
    expect(one.locator("#now")).to_have_text("Velma has nothing to do.")


def test_things_that_were_seen_are_buttons(house, opened):
    """None before; afterwards a click on one of them is the sentence on it."""
    one = opened()
    expect(one.locator(".thing")).to_have_count(0)
    one.get_by_role("button", name="Look around").click()
    wait_for(lambda: house.asked, "it is asked for")
    seen(house, "bowl_1", "cabinet_1", "jar_1", "jar_2", "table_1")
    expect(one.locator(".thing h3")).to_have_text(["Bowl", "Jar 1", "Jar 2"])
    one.get_by_role("button", name="Take the jar 2").click()
    wait_for(lambda: house.asked[-1][1] == Take("jar_2"), "the second jar is asked for")


def _pressed(one, says):
    """Press a button; the status of the page's answer."""
    with one.expect_response("**/say") as answer:
        one.get_by_role("button", name=says, exact=True).first.click()
    return answer.value.status


def test_every_button_is_understood_as_it_is_written(house, opened):
    """Sentences of buttons, in both languages, become a task each, of what is written on them."""
    one = opened()
    one.get_by_role("button", name="Look around").click()
    wait_for(lambda: house.asked, "it is asked for")
    seen(house, "bowl_1", "jar_1")
    for url in ("/?language=pl", "/?language=en"):
        one.goto(one.url.split("/?")[0].rstrip("/") + url)
        one.locator(".thing button").nth(9).wait_for()
        for says in one.locator("#alone button, .thing button").all_text_contents():
            before = len(house.asked)
            wait_for(lambda says=says: _pressed(one, says) != TOO_OFTEN, says)
            wait_for(lambda before=before: len(house.asked) > before, says)
            # so that nothing is given away
            house.report(house.asked[-1][0], TaskState.FAILED, fact(Kind.HANDS_FULL))
            expect(one.locator("#queue li")).to_have_count(0)
    names = [type(content).__name__ for _, content in house.asked[1:]]
    about_a_thing, alone = (
        [row.content.__name__ for row, wish in wishes() if wish.offer is offer and not wish.held]
        for offer in (Offer.THINGS, Offer.ALONE)
    )
    assert names == [*alone, *about_a_thing * 2] * 2


def test_times_of_day_are_those_of_the_browser(house, opened):
    """Noon is noon where the person is, and so is what is shown of a deadline; the house has a
    clock of its own.
    """
    one = opened(timezone_id="Asia/Tokyo")
    said, ahead = time.time(), 9 * 3600
    say(one, "look around at noon")
    wait_for(lambda: house.asked, "it is asked for")
    start = house.asked[0][1].start
    assert (said + start - house.now + ahead) % 86400 == pytest.approx(43200, abs=30)
    expect(one.locator("#answer")).to_contain_text(f"({shown(start + ahead)})")
    say(one, "take the jar within ten minutes")
    wait_for(lambda: len(house.asked) > 1, "it is asked for")
    until = shown(house.asked[1][1].deadline + ahead)
    expect(one.locator("#queue .hint").filter(has_text="by ")).to_have_text(
        f"waiting, by {until:0>5}"
    )


def shown(then):
    """A time of day."""
    return f"{int(then) // 3600 % 24}:{int(then) // 60 % 60:02}"


def test_the_next_sentence_is_written_while_one_is_on_its_way(house, opened):
    """The answer to a sentence empties the field of that sentence, and of no other one."""
    one, on_the_way = opened(), []
    one.route("**/say", lambda route: on_the_way.append(route))
    say(one, "look around")
    wait_for(lambda: one.evaluate("1") and on_the_way, "it is on its way")
    one.locator("#text").fill("take the jar")
    on_the_way.pop().continue_()
    expect(one.locator("#answer")).not_to_be_empty()
    expect(one.locator("#text")).to_have_value("take the jar")
    one.unroute_all()
    one.locator("#text").press("Enter")
    expect(one.locator("#text")).to_have_value("")
    assert [content for _, content in house.asked] == [LookAround(), Take("jar")]


def test_a_question_back_is_answered_by_a_button(house, opened):
    """The question has a button for each name, and No; nothing moves before."""
    one = opened()
    say(one, "take the container")
    expect(one.locator("#replies button")).to_have_text(["Jar", "Bowl", "No"])
    assert not house.asked
    one.get_by_role("button", name="Bowl", exact=True).click()
    wait_for(lambda: house.asked, "the answer is a task")
    assert house.asked[0][1] == Take("bowl")


def test_no_is_an_answer_to_a_question_and_else_a_stop(house, opened):
    """The page's own button in Polish, which is a stop word; another browser answers nothing."""
    one, other = opened(locale="pl-PL"), opened()
    say(one, "weź czerwony słoik")
    expect(one.locator("#replies button")).to_have_text(["Tak", "Nie"])
    say(other, "yes")
    expect(other.locator("#answer")).to_contain_text("I asked nothing")
    one.get_by_role("button", name="Nie", exact=True).click()
    expect(one.locator("#answer")).to_have_text("Dobrze, więc nie.")
    assert not house.held
    say(one, "weź czerwony słoik")
    one.get_by_role("button", name="Tak", exact=True).click()
    wait_for(lambda: house.asked, "who was asked says yes")
    assert house.asked == [("hi-1-1", Take("jar"))]
    say(one, "nie")
    wait_for(lambda: house.held, "nothing was asked: it is a stop")


def test_six_clicks_are_one_task_and_two_on_no_are_no_stop(house, opened):
    """It is said that it was asked for already."""
    one = opened(locale="pl-PL")
    one.locator("#alone button").first.click(click_count=6)
    expect(one.locator("#answer")).to_have_text("Już o to poproszono. Przyjęte: rozejrzyj się.")
    expect(one.locator("#queue li")).to_have_count(1)
    assert house.asked == [("hi-1-1", LookAround())]
    say(one, "weź czerwony słoik")
    one.get_by_role("button", name="Nie", exact=True).dblclick()
    expect(one.locator("#answer")).to_have_text("Dobrze, więc nie.")
    say(one, "co robisz?")
    expect(one.locator("#answer")).to_have_text("rozejrzyj się: czeka.")
    assert not house.held


def test_a_question_that_nobody_answered_loses_its_buttons(house, opened):
    """Its No would stop the robot."""
    one = opened()
    one.clock.install()
    say(one, "take the container")
    expect(one.locator("#replies button")).to_have_count(3)
    one.clock.fast_forward(31_000)
    expect(one.locator("#replies button")).to_have_count(0)


def test_only_what_the_hands_allow_is_offered(house, opened):
    """What is held is not taken, what is not held is not put down; what each hand holds is said."""
    one = opened()
    one.get_by_role("button", name="Look around").click()
    wait_for(lambda: house.asked, "it is asked for")
    seen(house, "bowl_1", "jar_1")
    take, put = (
        [f"{does} the {name}" for name in ("jar", "bowl")] for does in ("Take", "Put down")
    )
    buttons = one.locator("#things button")
    holds = {Side.LEFT: "jar_1"}
    for text, hands, offered in (
        ("take the jar", {}, take),
        ("take the bowl", holds, [put[0], take[1]]),
    ):
        say(one, text)
        wait_for(lambda: len(house.asked) > 1, "it is asked for")
        house.report(house.asked.pop()[0], TaskState.FAILED, fact(Kind.HANDS_FULL), hands=hands)
        for name in (*take, *put):
            count = 1 if name in offered else 0
            expect(buttons.filter(has_text=re.compile(f"^{name}$"))).to_have_count(count)
        expect(one.locator("#hands")).to_have_text(
            "My left hand holds the jar." if hands else "I hold nothing."
        )


def test_what_cannot_be_undone_is_asked_first_where_that_is_wanted(house, opened):
    """The setting outlives the page; what can be undone is done at once, and who has not set it is
    not asked.
    """
    one, other = opened(), opened()
    one.locator("#careful").check()
    one.reload()
    say(one, "take the jar and pour it into the bowl")
    expect(one.locator("#answer")).to_contain_text("I cannot undo this")
    one.get_by_role("button", name="No", exact=True).click()
    expect(one.locator("#answer")).to_have_text("All right, then not.")
    assert not house.asked
    say(one, "take the bowl")
    wait_for(lambda: [content for _, content in house.asked] == [Take("bowl")], "it is asked for")
    say(one, "pour the jar into the bowl")
    one.get_by_role("button", name="Yes", exact=True).click()
    wait_for(lambda: house.asked[-1][1] == PourInto("jar", "bowl"), "who is sure has it")
    say(other, "pour the jar into the bowl")
    wait_for(lambda: len(house.asked) == 3, "the other browser has it at once")
    assert not house.held


def test_the_history_has_a_button_to_do_it_again(house, opened):
    """The newest come first, the others are behind "Earlier today"; what was so already is not
    called done.
    """
    one = opened()
    for number in range(7):
        house.post(f"take the jar {number + 1}")
        why = fact(Kind.SO_ALREADY) if number == 6 else fact(Kind.TOOK, 9.0)
        house.report(house.asked[-1][0], TaskState.DONE, why)
    expect(one.locator("#ended .says")).to_have_text([f"Take the jar {n}" for n in range(7, 2, -1)])
    expect(one.locator("#ended .word").first).to_have_text("was so already")
    expect(one.locator("#ended .word").nth(1)).to_have_text("done")
    expect(one.locator("#earlier-list li").first).to_be_hidden()
    one.locator("#earlier summary").click()
    one.get_by_role("button", name="Do it again: take the jar 2").click()
    wait_for(lambda: len(house.asked) == 8, "it is asked for")
    assert house.asked[-1][1] == Take("jar_2")


def test_an_answer_does_not_outlive_its_time(house, opened):
    """What was true when it was said may not be true later."""
    one = opened()
    one.clock.install()
    say(one, "what do you see")
    expect(one.locator("#answer")).to_contain_text("not looked around")
    one.clock.fast_forward(61_000)
    expect(one.locator("#answer")).to_be_empty()


def test_the_time_left_is_said(house, opened):
    """Beside the step and beside STOP, by the planned rest; for what waits, when it begins."""
    one = opened()
    for text in ("take the jar", "take the bowl"):
        say(one, text)
        expect(one.locator("#text")).to_have_value("")
    one.clock.install(time=datetime.datetime.fromtimestamp(house.now, datetime.UTC))
    house.running("hi-1-1", rest=300.0)
    for name in ("#left", "#bar"):
        expect(one.locator(name)).to_contain_text("About 5 minutes left, until about ")
    expect(one.locator("#bar")).to_contain_text("Take the jar · Step 1 of 3")
    expect(one.locator("#queue [data-begins]")).to_contain_text("Begins in 5 minutes (")


def test_the_end_of_a_task_is_notified_where_that_is_wanted(house, opened):
    """Once, with two notes; nothing before the button was pressed."""
    one = opened()
    one.evaluate("() => { window.chimes = 0; chime = () => (chimes += 1); }")
    for text, count in (("take the jar", 0), ("take the bowl", 2)):
        if count:
            one.get_by_role("button", name="Tell me when it is done").click()
        say(one, text)
        wait_for(lambda: house.asked, "it is asked for")
        house.running(house.asked[-1][0])
        expect(one.locator("#step")).not_to_be_empty()
        house.report(house.asked.pop()[0], TaskState.DONE)
        expect(one.locator("#answer")).to_have_text(f"Done: {text}.")
        assert one.evaluate("chimes") == count


def test_cancel_and_order(house, opened):
    """A waiting task is cancelled, another one goes before all others, once, and what it was before
    is gone.
    """
    one = opened()
    for text in ("take the jar", "take the bowl", "look around"):
        say(one, text)
        expect(one.locator("#text")).to_have_value("")
    house.running("hi-1-1")
    expect(one.locator("#queue .says")).to_have_text(["Take the bowl", "Look around"])
    one.get_by_role("button", name="Do this first: look around").click()
    expect(one.locator("#queue .says")).to_have_text(["Look around", "Take the bowl"])
    assert house.cancelled == ["hi-1-3"]
    assert house.asked[-1][1] == LookAround(urgency=1)
    one.get_by_role("button", name="Cancel: take the bowl").click()
    expect(one.locator("#queue .says")).to_have_text(["Look around"])
    assert house.cancelled == ["hi-1-3", "hi-1-2"]
    assert len(house.asked) == 4


def test_a_cancel_is_answered_in_the_language_of_the_page(house, opened):
    """In words, not by the step of the plan; the task's end may follow before anybody has read the
    answer.
    """
    one = opened(locale="pl-PL")
    say(one, "look around")
    wait_for(lambda: house.asked, "it is asked for")
    house.running(number=1, act="MoveJoint")
    one.get_by_role("button", name="Anuluj: rozejrzyj się").click()
    expect(one.locator("#answer")).to_have_text(re.compile(r"^Anul(uję|owane): rozejrzyj się\.$"))


def test_a_hi_that_is_away_is_said_in_the_language_of_the_page(house, opened):
    """Without the names of files and numbers of errors: where it has no address, half of one, or
    nobody is there.
    """
    one = opened(locale="pl-PL")
    house.desk.close()
    for address in ("", '{"port": 1, "token": "t"}', "{"):
        if address:
            (house.run / "hi.json").write_text(address)
        with one.expect_response("**/say") as answer:
            say(one, "weź słoik")
        assert answer.value.status == 503
        said = "Nie udało się: To nie dotarło do Velmy. Proszę spróbować ponownie."
        expect(one.locator("#answer")).to_have_text(said)
    house.open()


def test_do_this_first_takes_those_behind_it_along(house, opened):
    """A task that waits for another one of the same sentence waits for what took its place, and is
    not cancelled.
    """
    one = opened()
    say(one, "look around")
    say(one, "take the jar and pour it into the bowl")
    expect(one.locator("#queue li")).to_have_count(3)
    house.running("hi-1-1")
    one.get_by_role("button", name="Do this first: take the jar").click()
    wait_for(lambda: house.cancelled == ["hi-1-2"], "what it replaces is cancelled")
    expect(one.locator("#queue .says")).to_have_text(
        ["Take the jar", "Pour the content of the jar into the bowl"]
    )
    house.report(house.asked[-1][0], TaskState.FAILED, fact(Kind.HANDS_FULL))
    expect(one.locator("#queue li")).to_have_count(0)
    assert house.cancelled == ["hi-1-2", "hi-1-3"]


def test_a_late_reply_does_not_replace_that_of_a_newer_request(house, opened):
    """The reply to a stop may take longer than that to the sentence behind it."""
    one, held = opened(), []
    one.route("**/stop", lambda route: held.append(route))
    with one.expect_request("**/stop"):
        one.locator("#stop").click()
    say(one, "what can you do?")
    expect(one.locator("#answer")).not_to_be_empty()
    answer = one.locator("#answer").inner_text()
    with one.expect_response("**/stop"):
        held[0].continue_()
    expect(one.locator("#now")).to_contain_text("Velma is stopped.")
    expect(one.locator("#answer")).to_have_text(answer)


def test_stop_and_release(house, opened):
    """The robot's flag is set by the button, the Escape key and a stop word, and by the button
    without scripts.
    """
    one = opened()
    ways = {
        "click": lambda: one.locator("#stop").click(),
        "key": lambda: one.keyboard.press("Escape"),
        "words": lambda: say(one, "hang on a second"),
    }
    for how, stop in ways.items():
        stop()
        wait_for(lambda: house.held, f"the robot is stopped by {how}")
        expect(one.locator("#now")).to_contain_text("Velma is stopped.")
        say(one, "take the jar")
        expect(one.locator("#answer")).to_contain_text("stopped")
        assert not house.asked
        one.get_by_role("button", name="Let Velma move again").click()
        wait_for(lambda: not house.held, "it is released")
        expect(one.locator("#release")).to_be_hidden()
        expect(one.locator("#now")).to_have_text("Velma has nothing to do.")
    state = one.context.storage_state()
    bare = opened(paired=False, at="/", java_script_enabled=False, storage_state=state)
    bare.locator("#stop").click()
    wait_for(lambda: house.held, "the robot is stopped without scripts")


def test_a_call_for_help_stops_and_is_told_what_can_be_said(house, opened):
    """Where hi answers; the flag is set in any case. A question of what can be said stops
    nothing.
    """
    one = opened(locale="pl-PL")
    say(one, "co umiesz?")
    expect(one.locator("#answer")).to_contain_text("weź X")
    assert not house.held
    say(one, "Pomocy!")
    wait_for(lambda: house.held, "the robot is stopped")
    expect(one.locator("#answer")).to_contain_text("Jestem zatrzymana; zwalnia mnie przycisk")
    expect(one.locator("#answer")).to_contain_text("weź X")
    one.locator("#release").click()
    wait_for(lambda: not house.held, "it is released")
    house.desk.close()
    say(one, "help")
    wait_for(lambda: house.held, "the robot is stopped")
    expect(one.locator("#answer")).to_be_empty()
    house.open()


def test_stop_works_with_a_dead_hi(house, opened):
    """The flag is the robot's own: no agent is needed."""
    one = opened()
    house.desk.close()
    expect(one.locator("#now")).to_contain_text("does not answer")
    one.locator("#stop").click()
    wait_for(lambda: house.held, "the robot is stopped")
    expect(one.locator("#now")).to_contain_text("Velma is stopped.")
    house.open()


def test_a_stop_from_elsewhere_is_seen(house, opened):
    """`roco stop` writes the same byte."""
    one = opened()
    with (house.run / "stop").open("r+b") as flag:
        flag.write(b"\1")
    expect(one.locator("#release")).to_be_visible()


def test_two_browsers_see_the_same(house, opened):
    """Each sees the other's words, and may cancel them."""
    one, other = opened(), opened()
    say(one, "take the jar")
    other.get_by_role("button", name="Cancel: take the jar").click()
    for each in (one, other):
        expect(each.locator("#ended .word")).to_have_text("cancelled")


def test_it_comes_back_by_itself_when_hi_and_the_page_have_died(house, page, opened):
    """The page at its old address, the browser still paired, the queue as it was; hi at another
    port.
    """
    one = opened()
    say(one, "take the jar")
    expect(one.locator("#queue li")).to_have_count(1)
    house.desk.close()
    expect(one.locator("#now")).to_contain_text("does not answer")
    house.open()
    expect(one.locator("#now")).to_have_text("Velma has nothing to do.")
    page.kill()
    expect(one.locator("#lost")).to_contain_text("connection is lost")
    page.start()
    expect(one.locator("#lost")).to_be_empty()
    say(one, "take the bowl")
    expect(one.locator("#queue .says")).to_have_text(["Take the jar", "Take the bowl"])


def test_polish(house, opened):
    """The page, its buttons and the steps of a plan in Polish; the choice is remembered."""
    one = opened(locale="pl-PL")
    expect(one.locator("html")).to_have_attribute("lang", "pl")
    say(one, "wlej zawartość słoika do miski")
    wait_for(lambda: house.asked, "it is asked for")
    assert house.asked[0][1] == PourInto("jar", "bowl")
    house.running(number=2, act="MoveJoint")
    expect(one.locator("#now")).to_have_text("Wlej zawartość słoika do miski.")
    expect(one.locator("#step")).to_have_text("Krok 2 z 3: niosę słoik")
    say(one, "weź miskę")
    wait_for(lambda: len(house.asked) == 2, "the second task is asked for")
    house.report("hi-1-2", TaskState.FAILED, fact(Kind.NO_GRASP, "left", "bowl_1"))
    why = "Moja lewa ręka nie może wziąć miski z tego miejsca. Proszę o pomoc."
    expect(one.locator("#ended .why")).to_have_text(why)
    one.get_by_role("link", name="English").click()
    expect(one.locator("#now")).to_have_text("Pour the content of the jar into the bowl.")
    expect(one.locator("#ended .why")).to_have_text(
        "My left hand cannot take the bowl where it is. Please help me."
    )
    one.goto(one.url.partition("?")[0])
    expect(one.locator("html")).to_have_attribute("lang", "en")


def test_what_happens_is_said_aloud_once_it_is_wanted(house, opened):
    """A sentence for each state of a task, none for a step of a plan, nothing before the button was
    pressed.
    """
    one = opened()
    one.evaluate(
        """() => {
            window.said = [];
            words.voice = true;
            audio.play = () => { said.push(audio.src); return Promise.resolve(); };
            voices();
        }"""
    )
    say(one, "take the jar")
    expect(one.locator("#queue li")).to_have_count(1)
    assert one.evaluate("said") == []
    one.get_by_role("button", name="Speak the answers").click()
    house.running(number=1, act="Grasp")
    house.report("hi-1-1", TaskState.RUNNING, at=place(1, "MoveCartesian"), number=1)
    house.report("hi-1-1", TaskState.DONE)
    expect(one.locator("#ended li")).to_have_count(1)
    wait_for(lambda: "Done%3A+take+the+jar" in " ".join(one.evaluate("said")), "its end is said")
    told = one.evaluate("said")
    assert "Velma+has+nothing+to+do" in told[0]
    assert sum("I+begin" in text for text in told) <= 1
    assert len(told) <= 3


def test_what_is_heard_is_shown_before_it_is_sent(house, opened):
    """A browser that can hear only writes the sentence; one that cannot loses the button."""
    ear = "class Ear { start() { window.ear = this; } }; window.SpeechRecognition = Ear;"
    one = opened()
    one.context.add_init_script(ear)
    one.reload()
    one.get_by_role("button", name="Speak", exact=True).click()
    one.evaluate("ear.onresult({results: [[{transcript: 'take the jar'}]]})")
    expect(one.locator("#text")).to_have_value("take the jar")
    expect(one.locator("#send")).to_be_focused()
    assert not house.asked
    one.keyboard.press("Enter")
    wait_for(lambda: house.asked, "it is sent by hand")
    one.get_by_role("button", name="Speak", exact=True).click()
    one.evaluate("ear.onerror({error: 'not-allowed'})")
    expect(one.locator("#microphone")).to_be_hidden()
