"""hi on pretend wires, with a co that does as the test says and a device that notes what people
would see.
"""

from functools import cache

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from scripted_partner import Puppet

from agent_runtime.io.devices import Called
from agent_runtime.testing.memory_bus import MemoryBus, Point
from companion.design import DESIGN, wiring
from companion.languages import cmd
from companion.languages.cmd import BACK, TaskReport, TaskState
from companion.languages.facts import Kind as Why
from companion.languages.facts import fact
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side
from companion.sentences import operator
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tasks.put_down.command import PutDown
from companion.tasks.take.command import Take
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from services.human_interface import device_messages as device
from services.human_interface.behaviours import ANSWER_WITHIN_S, agent
from services.human_interface.grammar import understand
from services.human_interface.memory import AGAIN_S, ASKED_S, CONDITIONS, KEPT_TASKS

read = cache(understand)
BUSY, NEXT = fact(Why.TASKS_OPEN, 4), fact(Why.IS_NEXT)
WAITING, PLANNING, RUNNING = TaskState.WAITING, TaskState.PLANNING, TaskState.RUNNING
DONE, FAILED, CANCELLED = TaskState.DONE, TaskState.FAILED, TaskState.CANCELLED
GRASP = Place(("take jar_1", "grasp"), Step("take", ("jar_1",)), "Grasp", Side.LEFT)


class Scene:
    """hi, a co, and what people see."""

    def __init__(self, *, co=True):
        self.wires = MemoryBus()
        self.shown, self.puppet = [], Puppet("co")
        self.heard = self.puppet.heard
        self.hi = self.wires.add(
            agent(),
            wiring("hi", "test"),
            lambda post: Called(post, lambda word: self.shown.append(word) or ()),
        )
        if co:
            self.wires.add(self.puppet.agent(), wiring("co", "test"))
        self.settle()

    def settle(self, seconds=0.05):
        """Let messages arrive."""
        self.wires.run_for(seconds)

    def post(self, agent_name, content):
        self.wires.post(agent_name, content)
        self.settle()

    def say(self, text, asker="me", after_s=0.0, **more):
        """A person says it; the line of the answer."""
        return self.answer(self.sentence(text, asker, after_s, **more)).line

    def sentence(self, text, asker="me", after_s=0.0, **more):
        at = self.wires.now + after_s
        return device.Sentence(f"t{len(self.shown)}", text, read(text), asker=asker, at=at, **more)

    def cancel(self, task="", language="en"):
        """A person cancels; the answer."""
        return self.answer(device.CancelWanted(f"t{len(self.shown)}", task, language))

    def answer(self, wanted):
        """The one answer to what a person wants."""
        self.post("hi", wanted)
        answers = [one for one in self.shown if isinstance(one, device.Answer)]
        (answer,) = [one for one in answers if one.ticket == wanted.ticket]
        return answer

    def co(self, task, performative, content, **more):
        """Co says it in the conversation."""
        self.post("co", lambda turn: turn.say(task, performative, content, **more))

    def report(self, task, performative, state, *why, at=None, **more):
        self.co(task, performative, TaskReport(state, why, at=at), **more)

    def agree(self, task, *why):
        self.report(task, P.AGREE, WAITING, *why)

    def end(self, task, state, *why):
        """Co agrees and tells the end."""
        self.agree(task)
        self.report(task, P.INFORM, state, *why)

    def end_cancelled(self, task):
        """A person cancels a task that co has agreed to, and co does it."""
        self.agree(task)
        self.cancel(task)
        self.report(task, P.INFORM, CANCELLED, kind=Kind.CANCEL)

    def end_after_cancel(self, task, last):
        """The task is done while its cancel is on its way, whose answer is `last`."""
        self.agree(task)
        self.cancel(task)

        def end(turn):
            turn.say(task, P.INFORM, TaskReport(DONE))
            turn.say(task, P.FAILURE, last, kind=Kind.CANCEL)

        self.post("co", end)

    @property
    def people_see(self):
        """All tasks, questions and wishes as they are shown now."""
        return next(one for one in reversed(self.shown) if isinstance(one, device.Shown))

    def line(self, task):
        return next(line for line in self.people_see.tasks if line.task == task)

    @property
    def tasks(self):
        """State of each task that is shown."""
        return {line.task: line.state for line in self.people_see.tasks}

    @property
    def events(self):
        return [one.event for one in self.shown if isinstance(one, device.NewEvent)]

    @property
    def sent(self):
        """Commands that co got."""
        return [one.content for one in self.heard if isinstance(one.content, cmd.Command)]

    @property
    def cancelled(self):
        """Conversations in which co got a cancel."""
        heard = ((one.conversation, one.communicate.performative) for one in self.heard)
        return [conversation for conversation, performative in heard if performative is P.CANCEL]


@pytest.fixture
def scene():
    """hi and co."""
    return Scene()


@pytest.fixture
def task(scene):
    """The task of somebody who wants the jar taken."""
    return scene.say("take the jar").task


def test_hi_binds_exactly_the_names_of_the_design():
    """Conditions and states."""
    assert set(CONDITIONS) == DESIGN.conditions("hi")
    assert set(agent().behaviours) == {state.name for state in DESIGN.agent("hi").state}


def test_a_sentence_becomes_a_request_and_its_answer_names_the_task(scene):
    """The task's name is the conversation's. Tasks are shown before the answer is: who has that
    finds them.
    """
    line = scene.say("Please pour the content of the jar into the bowl.")
    (request,) = scene.heard
    assert (request.conversation, request.content) == (line.task, PourInto("jar", "bowl"))
    assert (line.state, line.text) == ("waiting", f"I will {line.said[7:]}")
    assert scene.tasks == {line.task: "waiting"}
    (answered,) = [n for n, one in enumerate(scene.shown) if isinstance(one, device.Answer)]
    before = [one for one in scene.shown[:answered] if isinstance(one, device.Shown)][-1]
    assert [shown.task for shown in before.tasks] == [line.task]


def test_a_sentence_that_is_not_understood_reaches_nobody(scene):
    """It is refused politely, and told as an event."""
    line = scene.say("dance")
    assert (line.task, line.state, scene.heard) == ("", "refused", [])
    assert scene.events[-1].name == "refused"


def test_states_of_a_task_are_those_that_co_tells(scene, task):
    """Each is an event, numbered without gaps."""
    scene.agree(task, NEXT)
    scene.report(task, P.INFORM, PLANNING)
    assert scene.tasks[task] == "planning"
    scene.report(task, P.INFORM, RUNNING, at=GRASP)
    line = scene.line(task)
    assert (line.state, line.at, line.why, line.text) == ("running", GRASP, (), "take jar (grasp)")
    scene.report(task, P.INFORM, DONE)
    assert scene.tasks[task] == "done"
    assert [event.n for event in scene.events] == list(range(1, len(scene.events) + 1))
    told = [("co", "waiting"), ("pl", "planning"), ("ta", "running"), ("co", "done")]
    assert [(event.agent, event.name) for event in scene.events][1:] == told


def test_whatever_ends_a_task_badly_shows_as_failed_with_its_reason():
    """Refused, failed (the performative counts, not the state), not understood, unreadable; a text
    of the protocol is for the log alone.
    """
    unknown, lost = fact(Why.NO_REASON, "co"), fact(Why.LOST, "left", "jar_1")
    for performative, content, why in (
        (P.REFUSE, TaskReport(FAILED, (BUSY,)), BUSY),
        (P.FAILURE, TaskReport(FAILED, (BUSY,)), BUSY),
        (P.FAILURE, TaskReport(RUNNING, (lost,)), lost),
        (P.FAILURE, TaskReport(FAILED), unknown),
        (P.FAILURE, Reason("busy"), unknown),
        (P.NOT_UNDERSTOOD, Reason("busy"), fact(Why.NOT_UNDERSTOOD, "co")),
        (None, None, fact(Why.BROKE_OFF, "co")),
    ):
        scene = Scene()
        task = scene.say("take the jar").task
        if performative is None:  # an inform in the place of an agree
            (asked,) = [one for one in scene.wires.traffic if one.performative is P.REQUEST]
            fields = {"sender": "co", "receiver": "hi", "id": "1", "reply_with": ""}
            wrong = replace(asked, performative=P.INFORM, **fields)
            scene.wires.deliver(wrong)
            scene.settle()
        else:
            scene.co(task, performative, content)
        line = scene.line(task)
        assert (line.state, line.why) == ("failed", (why,)), (performative, content)
        assert line.text == scene.events[-1].text == operator((why,))


def test_cancel_by_words_cancels_the_oldest_or_the_named_task():
    """co answers in reply to the cancel."""
    for words in ("cancel", "cancel hi-1-1", "never mind", "anuluj"):
        scene = Scene()
        task = scene.say("take the jar").task
        scene.agree(task)
        assert (scene.say(words).task, scene.cancelled) == (task, [task]), words
        why = fact(Why.NOT_BEGUN_YET)
        scene.report(task, P.INFORM, CANCELLED, why, kind=Kind.CANCEL)
        assert scene.tasks[task] == "cancelled"


def test_a_cancel_is_answered_in_words_not_by_the_step_of_the_plan(scene):
    """In the language of who cancels; the task itself goes on telling its step. All of them can be
    cancelled at once.
    """
    task, other = (scene.say(text).task for text in ("look around", "take the jar"))
    look = Place(("look around", "look"), Step("look-around"), "Look")
    scene.report(task, P.AGREE, RUNNING, at=look)
    assert scene.cancel(task).line.text == "I am cancelling: look around."
    assert scene.cancel(task, "pl").line.text == "Anuluję: rozejrzyj się."
    assert scene.say("anuluj").text == "Anuluję: rozejrzyj się."
    assert scene.say("cancel everything").text == "I am cancelling: look around, take the jar."
    assert scene.people_see.tasks[0].text == "look around (look)"
    assert scene.cancelled == [task, other]


def test_a_second_cancel_is_not_sent_again(scene, task):
    """The protocol has one; the person gets the task both times."""
    assert scene.cancel(task).line.task == scene.cancel().line.task == task
    assert scene.cancelled == [task]


@pytest.mark.parametrize("last", [Reason("it was done already"), TaskReport(FAILED)])
def test_a_cancel_that_came_too_late_leaves_the_task_as_it_ended(scene, task, last):
    """done, then failure in reply to the cancel: an event, no other state; hi has the words where
    co has none.
    """
    scene.end_after_cancel(task, last)
    assert scene.tasks[task] == "done"
    event = scene.events[-1]
    assert (event.name, event.text) == ("cancel-too-late", "it was done already")
    assert scene.hi.state.conversations == {}


def test_a_cancel_of_what_there_is_not_names_what_there_is(scene):
    """404 for programs, a refusal for sentences; a task that has ended is shown as it is."""
    nothing, unknown = scene.cancel(), scene.cancel("hi-9-9")
    assert (nothing.status, nothing.problem) == (404, "there is nothing to cancel")
    missing = "there is no task 'hi-9-9'; open are: "
    assert (unknown.status, unknown.problem) == (404, f"{missing}none")
    assert scene.say("cancel").state == "refused"
    task = scene.say("take the jar").task
    assert scene.cancel("hi-9-9").problem == scene.say("cancel hi-9-9").text == f"{missing}{task}"
    scene.report(task, P.REFUSE, FAILED, BUSY)
    line = scene.cancel(task).line
    assert (line.state, line.text) == ("failed", "That is over already: take the jar.")


def test_what_a_person_reads_names_the_task_and_says_since_when(scene):
    """All tasks by their wishes, the line of the oldest; the text stays till there is another, the
    time till there is another state.
    """
    assert scene.say("status").text == "I have nothing to do."
    first = scene.say("take the jar")
    scene.say("look around")
    assert scene.say("status").text == "take the jar: waiting. look around: waiting."
    scene.settle(1.0)
    scene.agree(first.task, NEXT)
    status = scene.say("status")
    assert (status.task, status.state, status.since) == (first.task, "waiting", first.since)
    scene.report(first.task, P.INFORM, PLANNING)
    status = scene.say("status")
    assert status.text.startswith("take the jar: thinking how.")
    line = scene.line(first.task)
    assert (line.why, line.text) == ((NEXT,), operator((NEXT,)))
    assert status.since > first.since + 1.0
    scene.report(first.task, P.INFORM, DONE)
    line = scene.line(first.task)
    assert (line.text, line.why) == ("", ())


def test_without_a_coordinator_nothing_is_promised():
    """503, in words; no task is made of it."""
    scene = Scene(co=False)
    answer = scene.answer(scene.sentence("take the jar"))
    assert (answer.status, answer.line, "coordinator" in answer.problem) == (503, None, True)
    assert scene.hi.state.memory.tasks == ()


def test_a_coordinator_that_goes_and_comes_is_told_to_who_waits(scene, task):
    """robot-unreachable, then robot-reachable."""
    scene.wires.crash("co", Point.AFTER, restart_s=1.0)
    scene.wires.post("co", lambda turn: None)
    scene.settle(3.0)
    assert [event.name for event in scene.events][-2:] == ["robot-unreachable", "robot-reachable"]


def test_a_coordinator_that_does_not_answer_is_told_once_and_again_when_it_does(scene, task):
    """It is there and hangs: the person hears of it, and of its first word."""
    scene.settle(ANSWER_WITHIN_S - 0.5)
    assert [event.name for event in scene.events] == ["asked"]
    scene.settle(60.0)
    told = [("asked", task), ("robot-unreachable", task)]
    assert [(event.name, event.task) for event in scene.events] == told
    assert scene.tasks == {task: "waiting"}
    scene.agree(task)
    scene.settle(1.0)
    scene.report(task, P.INFORM, PLANNING)
    assert [event.name for event in scene.events][2:] == ["robot-reachable", "waiting", "planning"]


def test_a_coordinator_that_answers_in_time_is_not_complained_of(scene, task):
    """However long the task takes; also where it only agreed that the task waits."""
    scene.agree(task)
    scene.settle(600.0)
    assert "robot-unreachable" not in [event.name for event in scene.events]


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("step", [1, 2, 3])
def test_a_killed_hi_remembers_its_tasks_and_goes_on_counting(scene, task, point, step):
    """Before, in and after a step; the task's end is told after the restart."""
    scene.wires.crash("hi", point, in_steps=step, restart_s=0.5)
    scene.end(task, DONE)
    scene.settle(5.0)
    assert scene.tasks == {task: "done"}
    numbers = [event.n for event in scene.events]
    assert numbers == sorted(numbers)
    assert scene.say("look around").task not in ("", task)


def test_only_so_many_ended_tasks_are_remembered(scene, task):
    """Open ones are never forgotten."""
    for _ in range(KEPT_TASKS + 5):
        scene.report(scene.say("look around", "").task, P.REFUSE, FAILED, BUSY)
    assert (len(scene.tasks), scene.tasks[task]) == (KEPT_TASKS, "waiting")


def test_urgency_and_deadline_of_a_sentence_go_to_the_coordinator(scene):
    """Each wish of the sentence has them; without them nothing more is said than before."""
    scene.say("take the jar and look around", urgency=1, within_s=60.0)
    assert [one.urgency for one in scene.sent] == [1, 1]
    assert {round(one.deadline - scene.wires.now, 1) for one in scene.sent} == {59.9}
    scene.say("look around")
    assert scene.sent[-1] == LookAround()
    assert msgspec.json.encode(scene.sent[-1]) == b'{"type":"LookAround"}'


def test_when_a_task_is_wanted_is_shown_as_it_was_told_the_coordinator(scene):
    """Its urgency, its deadline and the time to begin."""
    task = scene.say("look around", urgency=1, within_s=600.0, later_s=60.0).task
    (sent,), line = scene.sent, scene.line(task)
    assert 0.0 < sent.start < sent.deadline
    assert (line.urgency, line.deadline, line.start) == (1, sent.deadline, sent.start)


def test_what_was_urgent_is_urgent_when_a_question_was_answered(scene):
    """The options of the question keep it, and the answer of hi says it."""
    assert scene.say("take the container", urgency=1, within_s=600.0).state == "question"
    text = scene.say("the jar").text
    assert text == "I will take the jar, before anything else, within 10 min."
    (sent,) = scene.sent
    assert (sent.urgency, round(sent.deadline - scene.wires.now)) == (1, 600)


def test_the_answer_names_the_time_of_day_by_the_clock_of_who_asks():
    """In Nepal, 5:45 ahead of UTC; hours from two of them on."""
    for when, span in (
        ({"later_s": 90.0}, "in 90 s"),
        ({"later_s": 600.0}, "in 10 min"),
        ({"within_s": 5400.0}, "within 90 min"),
        ({"later_s": 82800.0}, "in 23 h 0 min"),
    ):
        scene = Scene()
        text = scene.say("look around", **when, east_min=345).text
        hour, minute = divmod(int(scene.wires.now + sum(when.values())) // 60 + 345, 60)
        assert text == f"I will look around, {span} ({hour % 24}:{minute:02})."


# --- stopped --------------------------------------------------------------------------------------


def test_a_stop_that_reached_the_robot_is_told_and_cancels_nothing(scene, task):
    """The task ends as the executor says."""
    for held, name in ((True, "stopped"), (False, "released")):
        scene.post("hi", device.Halted(held, True, "words"))
        assert (scene.events[-1].name, scene.events[-1].text) == (name, "words")
    assert scene.cancelled == []


def test_a_stop_out_of_reach_cancels_every_task(scene):
    """The next best that hi can do."""
    tasks = [scene.say(text).task for text in ("take the jar", "look around")]
    scene.post("hi", device.Halted(True, False, "elsewhere"))
    assert scene.cancelled == tasks
    assert ("refused", "elsewhere") in [(event.name, event.text) for event in scene.events]


def test_a_stopped_robot_takes_no_task(scene):
    """It says how it is let go, which no word does."""
    for line in (scene.say("take the jar", held=True), scene.say("go on")):
        assert (line.state, "roco release" in line.text, scene.heard) == ("refused", True, [])


# --- what is said of things, and of several at once -----------------------------------------------


def test_two_wishes_become_two_tasks_in_their_order(scene):
    """The answer names both; co gets them one after the other."""
    line = scene.say("take the jar and pour it into the bowl")
    assert scene.sent == [Take("jar"), PourInto("jar", "bowl", after=line.task)]
    assert [one.conversation for one in scene.heard] == [line.task, *line.then]
    assert line.text == "I will take the jar, then pour the content of the jar into the bowl."


def test_each_wish_of_a_sentence_needs_the_one_before_it(scene):
    """The first may be done long ago when the last is cancelled for the one between them."""
    line = scene.say("take the jar, pour it into the bowl, put it down")
    second, third = line.then
    assert [one.after for one in scene.sent] == ["", line.task, second]
    scene.end(line.task, DONE)
    assert scene.cancelled == []
    scene.report(second, P.REFUSE, FAILED, BUSY)
    assert scene.cancelled == [third]


def test_what_is_noted_of_a_task_is_forgotten_at_its_end(scene):
    """No record of the journal grows by tasks that were done."""
    for text in ("look around", "hand me the jar"):
        scene.end(scene.say(text).task, DONE)
    memory = scene.hi.state.memory
    assert (memory.looks, memory.gives, memory.follows) == ((), (), ())


@pytest.mark.parametrize("state", [FAILED, CANCELLED, DONE])
def test_what_follows_in_a_sentence_is_cancelled_where_the_first_was_not_done(scene, state):
    """And nothing else is."""
    line = scene.say("take the jar and pour it into the bowl")
    scene.say("look around")
    if state is CANCELLED:
        scene.end_cancelled(line.task)
    elif state is FAILED:
        scene.report(line.task, P.REFUSE, FAILED, BUSY)
    else:
        scene.end(line.task, state)
    later = [] if state is DONE else [*line.then]
    assert scene.cancelled == ([line.task, *later] if state is CANCELLED else later)


def test_it_and_the_other_one_are_what_was_talked_of(scene):
    """Until something else is."""
    talk = {
        "take the jar": "jar", "put it down": "jar", "take the bowl": "bowl",
        "put the other one down": "jar", "take the other one": "bowl",
    }  # fmt: skip
    for text in talk:
        assert scene.say(text).state == "waiting", text
    assert [one.object for one in scene.sent] == [*talk.values()]


QUESTIONS = [("take the red jar", "yes", "jar"), ("take the spoon", "the bowl", "bowl")]


def test_a_question_back_is_answered_by_yes_or_by_a_name(scene):
    """Nothing moves before; after any other sentence the question is forgotten."""
    for text, answer, wanted in QUESTIONS:
        assert scene.say(text).state == "question"
        assert scene.say("what can you do?").state == "answered"
        assert scene.say(answer).state != "waiting"
        scene.say(text)
        assert scene.say(answer).state == "waiting"
        assert scene.sent[-1] == Take(wanted)


def test_who_wants_care_is_asked_before_what_nothing_undoes(scene):
    """And before nothing else. The answer needs no other question."""
    assert scene.say("take the jar", careful=True).state == "waiting"
    assert scene.say("pour the jar into the bowl", careful=True).state == "question"
    assert scene.sent == [Take("jar")]
    assert scene.say("yes", careful=True).state == "waiting"
    assert scene.sent[-1] == PourInto("jar", "bowl")


def test_a_correction_cancels_what_was_asked_for_once_it_is_confirmed(scene):
    """The task before goes on until then; one that has ended is not cancelled."""
    first = scene.say("take the jar").task
    line = scene.say("no, the bowl")
    assert (line.state, scene.cancelled) == ("question", [])
    second = scene.say("yes").task
    assert (scene.sent[-1], scene.cancelled) == (Take("bowl"), [first])
    scene.end(second, DONE)
    scene.settle(AGAIN_S)
    scene.say("the lid instead")
    scene.say("yes")
    assert (scene.sent[-1], scene.cancelled) == (Take("lid"), [first])


UNDONE = {"take the jar": PutDown("jar", BACK), "put down the bowl": Take("bowl")}


def test_what_was_done_can_be_done_again_or_undone(scene):
    """After a question; while it is under way, to undo it is to cancel it. A pour is not undone."""
    assert scene.say("again").state == "refused"
    for text, undo in UNDONE.items():
        task = scene.say(text).task
        wanted = scene.sent[-1]
        assert "cancel" in scene.say("undo that").replies
        scene.end(task, DONE)
        scene.settle(AGAIN_S)
        assert scene.say("do it again").state == "question"
        again = scene.say("yes").task
        assert scene.sent[-1] == wanted
        scene.end(again, DONE)
        scene.settle(AGAIN_S)
        assert scene.say("undo that").state == "question"
        scene.end(scene.say("yes").task, DONE)
        assert scene.sent[-1] == undo
        scene.settle(AGAIN_S)
    scene.end(scene.say("pour the jar into the bowl").task, DONE)
    line = scene.say("undo that")
    assert (line.state, line.replies) == ("refused", ())


def test_what_may_mean_two_things_is_asked_with_a_sentence_for_each(scene):
    """Each of them is understood without the question."""
    scene.say("take the jar")
    replies = scene.say("drop it").replies
    assert replies == ("put down the jar", "cancel", "no")
    scene.say(replies[0])
    assert scene.sent[-1] == PutDown("jar")


def test_what_the_hands_hold_and_how_far_a_task_is_are_answered(scene):
    """By what reports told of the hands, and the steps of the plan that runs."""
    assert "empty" in scene.say("what are you holding?").text
    assert scene.say("how long?").text == "I have nothing to do."
    task = scene.say("take the jar").task
    scene.agree(task)
    steps = (Step("take", ("jar_1",), Side.LEFT), Step("carry", ("jar_1",), Side.LEFT))
    told = {"at": GRASP, "number": 1}
    scene.co(task, P.INFORM, TaskReport(RUNNING, steps=steps, **told))
    assert "step 1 of 2" in scene.say("how long will it take?").text
    scene.co(task, P.INFORM, TaskReport(RUNNING, at=GRASP, hands={Side.LEFT: "jar_1"}))
    assert scene.say("what are you holding?").text == "My left hand holds the jar."
    scene.report(task, P.INFORM, DONE)  # which tells nothing of the hands
    assert scene.people_see.hands == {Side.LEFT: "jar_1"}
    task = scene.say("put the jar down").task
    scene.agree(task)
    scene.co(task, P.INFORM, TaskReport(DONE, hands={}))
    assert "puste" in scene.say("co trzymasz?").text


def test_the_steps_of_earlier_plans_count(scene, task):
    """A plan that ends at its last step has done it; one that is left in a step, or before its
    first one, has not.
    """
    steps = tuple(Step("take", (f"jar_{n}",), Side.LEFT) for n in range(3))
    scene.agree(task)
    scene.co(task, P.INFORM, TaskReport(RUNNING, steps=steps))
    scene.report(task, P.INFORM, PLANNING)
    before = 0
    for last in (3, 2, 3):
        for number in range(1, last + 1):
            more = {"steps": steps} if number == 1 else {}
            scene.co(task, P.INFORM, TaskReport(RUNNING, at=GRASP, number=number, **more))
            line = scene.line(task)
            assert (line.before, line.number, len(line.steps)) == (before, number, 3)
        scene.report(task, P.INFORM, PLANNING)
        before += 3 if last == 3 else 1


@settings(max_examples=20)
@given(
    st.lists(st.floats(5.0, 60.0), min_size=2, max_size=8),
    st.lists(st.floats(5.0, 60.0), min_size=2, max_size=8),
    st.floats(0.5, 3.0),
)
def test_the_expected_end_learns_from_what_was_done(learnt, steps, slow):
    """After two minutes of plans, on a machine that is slow or fast by a factor, the end of the
    next task is foretold to a quarter.
    """
    scene = Scene()
    told = Told(scene, slow)
    while sum(told.planned) < 120.0:
        told.task(learnt)
    told.planned.clear()
    first, end = told.task(steps)
    assert first - told.began == pytest.approx(end - told.began, rel=0.25)


class Told:
    """Plans of tasks that co tells, whose steps take `slow` times as long as planned."""

    def __init__(self, scene, slow):
        self.scene, self.slow, self.planned, self.began = scene, slow, [], 0.0

    def task(self, steps):
        """A task with steps of these planned times [s] from start to end; when hi expected its end
        at its begin, and its end.
        """
        scene = self.scene
        name = scene.say("take the jar", asker="").task
        scene.agree(name)
        self.began, firsts = scene.wires.now, []
        for number in range(1, len(steps) + 1):
            of = Step("take", ("jar_1",), Side.LEFT)
            more = {"steps": (of,) * len(steps)} if number == 1 else {}
            report = TaskReport(RUNNING, number=number, rest=sum(steps[number - 1 :]), **more)
            for _ in range(2):  # two acts of a step tell the same rest
                scene.co(name, P.INFORM, report)
                firsts.append(scene.line(name).until)
                scene.settle(self.slow * steps[number - 1] / 2.0)
            assert firsts[-1] == firsts[-2]
        scene.report(name, P.INFORM, DONE)
        assert scene.line(name).until == 0.0
        self.planned += steps
        return firsts[0], scene.wires.now


def test_what_waits_for_a_person_has_no_expected_end(scene, task):
    """And tells nothing of the pace of the robot."""
    scene.agree(task)
    steps = (Step("take", ("jar_1",), Side.LEFT),) * 2
    scene.co(task, P.INFORM, TaskReport(RUNNING, steps=steps, number=1, rest=40.0))
    assert scene.line(task).until > scene.wires.now + 30.0
    scene.co(task, P.INFORM, TaskReport(RUNNING, at=GRASP, number=1, asks=True))
    assert scene.line(task).until == 0.0
    scene.settle(900.0)
    scene.co(task, P.INFORM, TaskReport(RUNNING, number=2, rest=20.0))
    left = scene.line(task).until - scene.wires.now
    assert left == pytest.approx(20.0, abs=1.0)


@pytest.mark.parametrize(("question", "answer", "wanted"), QUESTIONS)
def test_a_question_is_answered_by_who_was_asked(scene, question, answer, wanted):
    """What another one says neither answers it nor ends it; each may be asked something."""
    assert scene.say(question, "kitchen").state == "question"
    assert scene.say(answer, "hall").state != "waiting"
    assert scene.say("take the red box", "hall").state == "question"
    assert scene.heard == []
    assert scene.say(answer, "kitchen").state == scene.say("tak", "hall").state == "waiting"
    assert scene.sent == [Take(wanted), Take("box")]


def test_a_question_is_open_for_so_long(scene):
    """Later a yes may be meant for something else."""
    scene.say("take the red jar")
    scene.settle(ASKED_S - 1.0)
    assert scene.say("yes").state == "waiting"
    scene.say("take the red bowl")
    scene.settle(ASKED_S)
    assert scene.say("yes").state == "refused"
    assert len(scene.heard) == 1


def test_open_questions_are_shown_to_who_must_tell_an_answer_from_a_stop(scene):
    """Before the answer is there, in both languages, also after hi was killed; none once it was
    answered.
    """
    ticket = f"t{len(scene.shown)}"
    assert scene.say("weź czerwony słoik").replies == ("tak", "nie")
    before = scene.shown[: [getattr(one, "ticket", "") for one in scene.shown].index(ticket)]
    (question,) = next(one for one in reversed(before) if isinstance(one, device.Shown)).questions
    assert (question.asker, set(question.replies)) == ("me", {"yes", "no", "tak", "nie"})
    assert question.until == pytest.approx(scene.wires.now + ASKED_S, abs=1.0)
    scene.wires.crash("hi", Point.AFTER, restart_s=0.5)
    scene.say("take the container", "another")
    scene.settle(2.0)
    mine, other = scene.people_see.questions
    assert mine == question
    assert set(other.replies) == {"jar", "bowl", "no", "słoik", "miska", "nie"}
    assert scene.say("nie").state == "refused"
    left = {one.asker: round(one.until - scene.wires.now) for one in scene.people_see.questions}
    assert left == {"another": 28, "me": 2}


@pytest.mark.parametrize("text", ["take the jar", "take the jar and put it down"])
def test_six_clicks_are_one_task(scene, text):
    """Each within two seconds of the one before; it is said so. Later, or of somebody else, it is
    another task.
    """
    first = scene.say(text)
    again = (first.task, first.then, f"Already asked: {first.text}")
    for _ in range(5):
        scene.settle(AGAIN_S - 0.2)
        line = scene.say(f" {text} ")
        assert (line.task, line.then, line.text) == again
    asked = len(scene.heard)
    assert scene.say(text, "another").task != first.task
    assert scene.say("take the bowl").task != first.task
    scene.settle(AGAIN_S + 0.1)
    assert scene.say(text).task != first.task
    assert len(scene.heard) == 1 + 3 * asked


def test_what_was_cancelled_is_new_if_it_is_said_again_at_once(scene, task):
    """Whoever cancels it, and by a button, too; another task of the same person stays the same
    one.
    """
    other = scene.say("look around", "another").task
    scene.end_cancelled(task)
    assert scene.say("take the jar").task not in (task, other)
    assert scene.say("look around", "another").task == other


def test_what_is_the_same_request_is_asked_once(scene):
    """Each click has a thread of its own: a later one may be first. What is wanted more urgently is
    no repetition, nor is the same by one who gives no name.
    """
    for after_s in (1.0, 0.0, 1.2, 0.4):
        scene.say("look around", after_s=after_s)
    assert len(scene.heard) == 1
    for urgency, asker in ((1, "me"), (0, ""), (0, "")):
        scene.say("look around", asker, urgency=urgency)
    assert len(scene.heard) == 4


def test_a_double_click_on_an_answer_is_one_answer(scene):
    """A second yes does nothing, a second no does not stop the robot; the replies are known as such
    for a moment.
    """
    scene.say("take the red jar")
    task = scene.say("yes").task
    assert scene.say("yes").task == task
    assert len(scene.heard) == 1
    scene.say("take the red bowl")
    for _ in range(4):
        assert scene.say("nie").text == "Dobrze, więc nie."
        scene.settle(AGAIN_S - 0.2)
        (question,) = scene.people_see.questions
        assert ("nie" in question.replies, question.until > scene.wires.now) == (True, True)
    scene.settle(0.3)
    no = scene.sentence("nie")
    scene.post("hi", no)
    assert device.StopRobot(no.ticket, "nie") in scene.shown


def test_a_cancel_said_twice_at_once_cancels_one_task(scene, task):
    """Though the first one has been cancelled by then."""
    other = scene.say("look around").task
    scene.agree(task)
    scene.say("cancel")
    scene.report(task, P.INFORM, CANCELLED, kind=Kind.CANCEL)
    assert scene.say("cancel").task == task
    assert scene.tasks == {task: "cancelled", other: "waiting"}
    assert scene.cancelled == [task]


def test_no_to_a_question_moves_nothing_and_a_no_out_of_nothing_stops(scene):
    """The device sets the flag, and answers."""
    scene.say("take the red jar")
    assert scene.say("no").state == "refused"
    scene.settle(AGAIN_S + 0.1)
    no = scene.sentence("no")
    scene.post("hi", no)
    assert device.StopRobot(no.ticket, "no") in scene.shown
    assert scene.heard == []


def test_who_asks_how_to_stop_is_told(scene):
    """It is no stop (companion.stop_words), and a question like any other."""
    for text, told in (("how do I stop you?", "`roco stop`"), ("jak cię zatrzymać?", "Escape")):
        line = scene.say(text)
        assert (line.state, told in line.text) == ("answered", True), text


def test_what_is_seen_is_what_the_last_look_told(scene):
    """Before, it says how to look. Each is told in the language of who asks. A look that saw
    nothing is no missing look; what another task tells of what is seen is none.
    """
    assert "look around" in scene.say("what do you see?").text
    scene.end(scene.say("look around").task, DONE, fact(Why.SEEN, "jar_1", "jar_2"))
    line = scene.say("co widzisz?")
    assert (line.state, "słoik i słoik 2" in line.text) == ("answered", True)
    assert "the jar and jar 2" in scene.say("what do you see?").text
    assert scene.say("take the jar").state == "question", "there are two"
    assert scene.say("jar 2").state == "waiting"
    assert scene.sent[-1] == Take("jar_2")
    scene.settle(AGAIN_S)
    scene.end(scene.say("look around").task, DONE, fact(Why.SEEN_NOTHING))
    scene.end(scene.say("take the jar").task, DONE, fact(Why.SEEN, "jar_1"))
    assert scene.say("what do you see?").text.startswith("I see nothing that I know.")


def test_what_was_given_to_a_person_is_not_offered_any_more():
    """As soon as it was done, and not before; a later look that sees it offers it again."""
    for seen, thing in (
        (("bowl_1", "jar_1"), "the jar"),
        (("bowl_1", "jar_1", "jar_2"), "jar 2"),
        (("bowl_1", "jar_1"), "jar 1"),
    ):
        scene = Scene()

        def looked(scene=scene, seen=seen):
            scene.end(scene.say("look around").task, DONE, fact(Why.SEEN, *seen))

        def offered(scene=scene):
            return {name for wish in scene.people_see.wishes if (name := wish.thing.en)}

        looked()
        scene.say("take the jar")
        before = offered()
        scene.report(scene.say(f"hand me {thing}").task, P.REFUSE, FAILED, BUSY)
        assert offered() == before
        scene.settle(2 * AGAIN_S)
        task = scene.say(f"hand me {thing}").task
        assert scene.sent[-1].gives
        scene.agree(task)
        scene.report(task, P.INFORM, RUNNING)
        assert offered() == before
        scene.report(task, P.INFORM, DONE)
        assert len(offered()) == len(seen) - 1 == len(before) - 1
        scene.settle(2 * AGAIN_S)
        looked()
        assert offered() == before


def test_why_names_the_reason(scene):
    """Of the task that is open, else of the last one that was not done; in the language of who
    asks.
    """
    assert scene.say("why?").text == "Nothing that you asked for has failed so far."
    task = scene.say("take the jar").task
    assert scene.say("why?").text == "You said 'take the jar'. Now: waiting."
    scene.agree(task, NEXT)
    assert scene.say("why?").text == "You said 'take the jar'. Now: waiting. I do it next."
    scene.report(task, P.FAILURE, FAILED, fact(Why.NOT_SEEN, "jar"))
    assert scene.say("why?").text == "take the jar: I have not seen the jar. Please help me."
    assert scene.say("dlaczego?").text == "take the jar: Nie widzę słoika. Proszę o pomoc."
    scene.report(scene.say("look around").task, P.FAILURE, FAILED, fact(Why.ENDED, "ex"))
    assert scene.say("why?").text.startswith("look around: ")


def test_an_act_that_waits_for_an_operator_is_told_until_it_begins(scene, task):
    """By its place for programs, in words for people; a person who says "go on" hears who can let
    it begin.
    """
    scene.agree(task)
    scene.co(task, P.INFORM, TaskReport(RUNNING, at=GRASP, number=1, asks=True))
    line = scene.line(task)
    assert (line.asks, line.at, line.number) == ("take jar_1/grasp", GRASP, 1)
    step = "next is 'take jar (grasp) with the left hand' - `roco step` to go on"
    assert line.text == f"waits for you: {step}"
    assert all("roco step" in scene.say(text).text for text in ("go on", "why?"))
    scene.report(task, P.INFORM, RUNNING, at=GRASP)
    line = scene.line(task)
    assert (line.asks, line.at, line.text) == ("", GRASP, "take jar (grasp)")
    assert scene.say("go on").text == scene.say("status").text
