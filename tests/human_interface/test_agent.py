"""hi on pretend wires, with a co that does as the test says and a device that notes what people
would see.
"""

from functools import cache

import msgspec
import pytest

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.events import Local, Received
from agent_runtime.io.devices import Called
from agent_runtime.testing.memory_bus import MemoryBus, Point
from companion.binding import wiring
from companion.design import DESIGN
from companion.languages import cmd
from companion.languages.cmd import TaskReport, TaskState
from companion.languages.facts import Kind as Why
from companion.languages.facts import fact
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side
from companion.sentences import operator
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tasks.take.command import Take
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from services.human_interface.behaviours import ANSWER_WITHIN_S, agent
from services.human_interface.grammar import understand
from services.human_interface.local import (
    Answer,
    CancelWanted,
    Halted,
    NewEvent,
    Sentence,
    Shown,
    StopRobot,
)
from services.human_interface.memory import AGAIN_S, ASKED_S, CONDITIONS, KEPT_TASKS

read = cache(understand)
BUSY, NEXT = fact(Why.TASKS_OPEN, 4), fact(Why.IS_NEXT)


GRASP = Place(("take jar_1", "grasp"), Step("take", ("jar_1",)), "Grasp", Side.LEFT)


class Nothing(msgspec.Struct, frozen=True):
    """Memory of the pretended co."""


class Scene:
    """hi, a co, and what people see."""

    def __init__(self, *, co=True):
        self.wires = MemoryBus()
        self.shown, self.heard = [], []
        self.hi = self.wires.add(
            agent(),
            wiring("hi", "test"),
            lambda post: Called(post, lambda word: self.shown.append(word) or ()),
        )
        if co:
            self.wires.add(
                Agent("co", "on", Nothing(), {"on": Behaviour(self.act)}), wiring("co", "test")
            )
        self.settle()

    def act(self, memory, turn):
        """The pretended co hears, or does what the test says."""
        if isinstance(turn.event, Received):
            self.heard.append(turn.event)
        elif isinstance(turn.event, Local):
            turn.event.content(turn)
        return memory

    def settle(self, seconds=0.05):
        """Let messages arrive."""
        self.wires.run_for(seconds)

    def say(self, text, asker="me"):
        """A person says it; the answer."""
        return self.ask(
            Sentence(f"t{len(self.shown)}", text, read(text), asker=asker, at=self.wires.now)
        )

    def cancel(self, task="", language="en"):
        """A person cancels; the answer."""
        return self.ask(CancelWanted(f"t{len(self.shown)}", task, language))

    def ask(self, word):
        """The one answer to a word."""
        self.wires.post("hi", word)
        self.settle()
        (answer,) = [
            one for one in self.shown if isinstance(one, Answer) and one.ticket == word.ticket
        ]
        return answer

    def co(self, task, performative, content, **more):
        """Co says it in the conversation."""
        self.wires.post("co", lambda turn: turn.say(task, performative, content, **more))
        self.settle()

    def report(self, task, performative, state, *why, at=None, **more):
        """Co reports."""
        self.co(task, performative, TaskReport(state, why, at=at), **more)

    def line(self, task):
        """A task as /tasks shows it."""
        shown = [one for one in self.shown if isinstance(one, Shown)][-1]
        return next(line for line in shown.tasks if line.task == task)

    @property
    def tasks(self):
        """Tasks as /tasks shows them: state by name."""
        shown = [one for one in self.shown if isinstance(one, Shown)][-1]
        return {line.task: line.state for line in shown.tasks}

    @property
    def events(self):
        """Events as /events showed them."""
        return [one.event for one in self.shown if isinstance(one, NewEvent)]


@pytest.fixture
def scene():
    """hi and co."""
    return Scene()


def test_a_sentence_becomes_a_request_and_its_answer_names_the_task(scene):
    """The task's name is the conversation's."""
    line = scene.say("Please pour the content of the jar into the bowl.").line
    (request,) = scene.heard
    assert (request.conversation, request.content) == (line.task, PourInto("jar", "bowl"))
    assert (line.state, line.text) == (
        "waiting",
        "I will pour the content of the jar into the bowl.",
    )
    assert scene.tasks == {line.task: "waiting"}


def test_a_sentence_that_is_not_understood_reaches_nobody(scene):
    """It is refused politely, and told as an event."""
    line = scene.say("dance").line
    assert (line.task, line.state) == ("", "refused")
    assert scene.heard == []
    assert scene.events[-1].name == "refused"


def test_states_of_a_task_are_those_that_co_tells(scene):
    """waiting, planning, running, done; each an event, numbered without gaps."""
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING, NEXT)
    scene.report(task, P.INFORM, TaskState.PLANNING)
    assert scene.tasks[task] == "planning"
    scene.report(task, P.INFORM, TaskState.RUNNING, at=GRASP)
    line = scene.line(task)
    assert (line.state, line.at, line.why, line.text) == ("running", GRASP, (), "take jar (grasp)")
    scene.report(task, P.INFORM, TaskState.DONE)
    assert scene.tasks[task] == "done"
    assert [event.n for event in scene.events] == list(range(1, len(scene.events) + 1))
    assert [(e.agent, e.name) for e in scene.events][1:] == [
        ("co", "waiting"),
        ("pl", "planning"),
        ("ta", "running"),
        ("co", "done"),
    ]


@pytest.mark.parametrize(
    ("performative", "content", "why"),
    [
        (P.REFUSE, TaskReport(TaskState.FAILED, (BUSY,)), BUSY),
        (P.FAILURE, TaskReport(TaskState.FAILED, (BUSY,)), BUSY),
        (P.FAILURE, TaskReport(TaskState.FAILED), fact(Why.NO_REASON, "co")),
        (P.FAILURE, Reason("busy"), fact(Why.NO_REASON, "co")),
        (P.NOT_UNDERSTOOD, Reason("busy"), fact(Why.NOT_UNDERSTOOD, "co")),
    ],
)
def test_whatever_ends_a_task_badly_shows_as_failed_with_its_reason(
    scene, performative, content, why
):
    """Refused, failed, not understood; a text of the protocol is for the log alone."""
    task = scene.say("take the jar").line.task
    scene.co(task, performative, content)
    line = scene.line(task)
    assert (line.state, line.why) == ("failed", (why,))
    assert line.text == scene.events[-1].text == operator((why,))


@pytest.mark.parametrize("words", ["cancel", "cancel hi-1-1", "never mind", "anuluj"])
def test_cancel_by_words_cancels_the_oldest_or_the_named_task(scene, words):
    """co answers in reply to the cancel."""
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    answer = scene.say(words).line
    assert (answer.task, scene.heard[-1].communicate.performative) == (task, P.CANCEL)
    scene.report(task, P.INFORM, TaskState.CANCELLED, fact(Why.NOT_BEGUN_YET), kind=Kind.CANCEL)
    assert scene.tasks[task] == "cancelled"


def test_a_cancel_is_answered_in_words_not_by_the_step_of_the_plan(scene):
    """In the language of who cancels; the task itself goes on telling its step."""
    task = scene.say("look around").line.task
    scene.say("take the jar")
    scene.report(
        task,
        P.AGREE,
        TaskState.RUNNING,
        at=Place(("look around", "look"), Step("look-around"), "Look"),
    )
    assert scene.cancel(task).line.text == "I am cancelling: look around."
    assert scene.cancel(task, "pl").line.text == "Anuluję: rozejrzyj się."
    assert scene.say("anuluj").line.text == "Anuluję: rozejrzyj się."
    assert scene.say("cancel everything").line.text == "I am cancelling: look around, take the jar."
    assert scene.shown[-1].tasks[0].text == "look around (look)"


def test_a_second_cancel_is_not_sent_again(scene):
    """The protocol has one; the person gets the task both times."""
    task = scene.say("take the jar").line.task
    assert scene.cancel(task).line.task == scene.cancel().line.task == task
    assert [one.communicate.performative for one in scene.heard] == [P.REQUEST, P.CANCEL]


def test_a_cancel_that_came_too_late_leaves_the_task_as_it_ended(scene):
    """done, then failure in reply to the cancel: an event, no other state."""
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.cancel(task)

    def end(turn):
        turn.say(task, P.INFORM, TaskReport(TaskState.DONE))
        turn.say(task, P.FAILURE, Reason("it was done already"), kind=Kind.CANCEL)

    scene.wires.post("co", end)
    scene.settle()
    assert scene.tasks[task] == "done"
    assert scene.events[-1].name == "cancel-too-late"
    assert scene.hi.state.conversations == {}


def test_cancel_of_nothing_and_of_unknown_tasks_is_told(scene):
    """404 for programs, a refusal for sentences; a task that has ended is shown as it is."""
    assert (scene.cancel().status, scene.cancel("hi-9-9").status) == (404, 404)
    assert scene.say("cancel").line.state == "refused"
    task = scene.say("take the jar").line.task
    scene.report(task, P.REFUSE, TaskState.FAILED, BUSY)
    line = scene.cancel(task).line
    assert (line.state, line.text) == ("failed", "That is over already: take the jar.")


def test_status_names_the_open_tasks(scene):
    """Or says that there is nothing to do."""
    assert scene.say("status").line.text == "I have nothing to do."
    task = scene.say("take the jar").line.task
    line = scene.say("status").line
    assert line.task == task
    assert f"{task} is waiting" in line.text


def test_without_a_coordinator_nothing_is_promised():
    """503, in words; no task is made of it."""
    scene = Scene(co=False)
    answer = scene.say("take the jar")
    assert (answer.status, answer.line) == (503, None)
    assert "coordinator" in answer.problem
    assert scene.hi.state.memory.tasks == ()


def test_a_coordinator_that_goes_and_comes_is_told_to_who_waits(scene):
    """robot-unreachable, then robot-reachable."""
    scene.say("take the jar")
    scene.wires.crash("co", Point.AFTER, restart_s=1.0)
    scene.wires.post("co", lambda turn: None)
    scene.settle(3.0)
    assert [event.name for event in scene.events][-2:] == ["robot-unreachable", "robot-reachable"]


def test_a_coordinator_that_does_not_answer_is_told_once_and_again_when_it_does(scene):
    """It is there and hangs: the person hears of it, and of its first word."""
    task = scene.say("take the jar").line.task
    scene.settle(ANSWER_WITHIN_S - 0.5)
    assert [event.name for event in scene.events] == ["asked"]
    scene.settle(60.0)
    assert [(event.name, event.task) for event in scene.events] == [
        ("asked", task),
        ("robot-unreachable", task),
    ]
    assert scene.tasks == {task: "waiting"}
    scene.report(task, P.AGREE, TaskState.PLANNING)
    scene.settle(1.0)
    assert [event.name for event in scene.events][2:] == ["robot-reachable", "planning"]


def test_a_coordinator_that_answers_in_time_is_not_complained_of(scene):
    """However long the task takes; also where it only agreed that the task waits."""
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.settle(600.0)
    assert "robot-unreachable" not in [event.name for event in scene.events]


@pytest.mark.parametrize("point", list(Point))
@pytest.mark.parametrize("step", [1, 2, 3])
def test_a_killed_hi_remembers_its_tasks_and_goes_on_counting(scene, point, step):
    """Before, in and after a step; the task's end is told after the restart."""
    task = scene.say("take the jar").line.task
    scene.wires.crash("hi", point, in_steps=step, restart_s=0.5)
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.report(task, P.INFORM, TaskState.DONE)
    scene.settle(5.0)
    assert scene.tasks == {task: "done"}
    numbers = [event.n for event in scene.events]
    assert numbers == sorted(numbers)
    assert scene.say("look around").line.task not in ("", task)


def test_only_so_many_ended_tasks_are_remembered(scene):
    """Open ones are never forgotten."""
    first = scene.say("take the jar").line.task
    for _ in range(KEPT_TASKS + 5):
        task = scene.say("look around", "").line.task
        scene.report(task, P.REFUSE, TaskState.FAILED, BUSY)
    assert len(scene.tasks) == KEPT_TASKS
    assert scene.tasks[first] == "waiting"


def test_hi_binds_exactly_the_names_of_the_design():
    """Conditions and states."""
    assert set(CONDITIONS) == DESIGN.conditions("hi")
    assert set(agent().behaviours) == {state.name for state in DESIGN.agent("hi").state}


def test_what_a_person_reads_names_the_task_and_says_since_when(scene):
    """Of several the oldest; the text stays till there is another, the time till there is another
    state.
    """
    first, second = (scene.say(words).line for words in ("take the jar", "look around"))
    assert scene.say("status").line.text == "; ".join(
        f"{one.task} is waiting: {one.text}" for one in (first, second)
    )
    scene.settle(1.0)
    scene.report(first.task, P.AGREE, TaskState.WAITING, NEXT)
    status = scene.say("status").line
    assert (status.task, status.state, status.since) == (first.task, "waiting", first.since)
    scene.report(first.task, P.INFORM, TaskState.PLANNING)
    status = scene.say("status").line
    assert f"{first.task} is planning: {operator((NEXT,))}" in status.text
    assert scene.line(first.task).why == (NEXT,)
    assert status.since > first.since + 1.0
    scene.report(first.task, P.INFORM, TaskState.DONE)
    line = scene.line(first.task)
    assert (line.text, line.why) == ("", ())


def test_a_cancel_of_what_there_is_not_names_what_there_is(scene):
    """For programs in the problem, for people in the line."""
    assert scene.cancel().problem == "there is nothing to cancel"
    assert scene.cancel("hi-9-9").problem == "there is no task 'hi-9-9'; open are: none"
    task = scene.say("take the jar").line.task
    assert scene.cancel("hi-9-9").problem == f"there is no task 'hi-9-9'; open are: {task}"
    assert scene.say("cancel hi-9-9").line.text == f"there is no task 'hi-9-9'; open are: {task}"


def test_who_has_the_answer_finds_the_task(scene):
    """Tasks are shown before the answer is."""
    task = scene.say("take the jar").line.task
    answered = next(
        n for n, one in enumerate(scene.shown) if isinstance(one, Answer) and one.line.task == task
    )
    before = [one for one in scene.shown[:answered] if isinstance(one, Shown)][-1]
    assert [line.task for line in before.tasks] == [task]


def test_what_fails_is_failed_whatever_state_it_names(scene):
    """The performative counts."""
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.report(task, P.FAILURE, TaskState.RUNNING, fact(Why.LOST, "left", "jar_1"))
    assert scene.tasks[task] == "failed"


def test_a_cancel_that_came_too_late_gets_words_where_co_has_none(scene):
    """The state in which the task has ended."""
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.cancel(task)

    def end(turn):
        turn.say(task, P.INFORM, TaskReport(TaskState.DONE))
        turn.say(task, P.FAILURE, TaskReport(TaskState.FAILED), kind=Kind.CANCEL)

    scene.wires.post("co", end)
    scene.settle()
    assert scene.events[-1].text == "it was done already"


def test_what_cannot_be_understood_of_co_fails_the_task(scene):
    """In words, and the conversation is over."""
    task = scene.say("take the jar").line.task
    (asked,) = [one for one in scene.wires.traffic if one.performative is P.REQUEST]
    wrong = msgspec.structs.replace(
        asked, sender="co", receiver="hi", id="1", performative=P.INFORM, reply_with=""
    )
    scene.wires.deliver(wrong)
    scene.settle()
    line = scene.line(task)
    assert (line.state, line.why) == ("failed", (fact(Why.BROKE_OFF, "co"),))


def test_urgency_and_deadline_of_a_sentence_go_to_the_coordinator(scene):
    """Each wish of the sentence has them; without them nothing more is said than before."""
    scene.ask(
        Sentence(
            "t",
            "take the jar and look around",
            read("take the jar and look around"),
            False,
            1,
            60.0,
        )
    )
    sent = [one.content for one in scene.heard if isinstance(one.content, cmd.Command)]
    assert [one.urgency for one in sent] == [1, 1]
    assert {round(one.deadline - scene.wires.now, 1) for one in sent} == {59.9}
    scene.say("look around")
    last = [one.content for one in scene.heard if isinstance(one.content, cmd.Command)][-1]
    assert last == LookAround()
    assert msgspec.json.encode(last) == b'{"type":"LookAround"}'


def test_what_was_urgent_is_urgent_when_a_question_was_answered(scene):
    """The options of the question keep it, and the answer of hi says it."""
    words = "take the container"
    asked = scene.ask(
        Sentence("t", words, read(words), False, 1, 600.0, asker="me", at=scene.wires.now)
    )
    assert asked.line.state == "question"
    line = scene.say("the jar").line
    assert line.text == "I will take the jar, before anything else, within 10 min."
    (sent,) = [one.content for one in scene.heard if isinstance(one.content, cmd.Command)]
    assert (sent.urgency, round(sent.deadline - scene.wires.now)) == (1, 600)


@pytest.mark.parametrize(
    ("when", "answer"),
    [
        ({"later_s": 90.0}, "I will look around, in 90 s ({}:{:02})."),
        ({"later_s": 600.0}, "I will look around, in 10 min ({}:{:02})."),
        ({"within_s": 5400.0}, "I will look around, within 90 min ({}:{:02})."),
        ({"later_s": 82800.0}, "I will look around, in 23 h 0 min ({}:{:02})."),
    ],
)
def test_the_answer_names_the_time_of_day_by_the_clock_of_who_asks(scene, when, answer):
    """In Nepal, 5:45 ahead of UTC; hours from two of them on."""
    line = scene.ask(Sentence("t", "look around", read("look around"), **when, east_min=345)).line
    then = int(scene.wires.now + sum(when.values())) // 60 + 345
    assert line.text == answer.format(then // 60 % 24, then % 60)


# --- stopped --------------------------------------------------------------------------------------


def test_a_stop_that_reached_the_robot_is_told_and_cancels_nothing(scene):
    """The task ends as the executor says."""
    scene.say("take the jar")
    for held, name in ((True, "stopped"), (False, "released")):
        scene.wires.post("hi", Halted(held, True, "words"))
        scene.settle()
        assert (scene.events[-1].name, scene.events[-1].text) == (name, "words")
    assert [one.communicate.performative for one in scene.heard] == [P.REQUEST]


def test_a_stop_out_of_reach_cancels_every_task(scene):
    """The next best that hi can do."""
    tasks = [scene.say(text).line.task for text in ("take the jar", "look around")]
    scene.wires.post("hi", Halted(True, False, "elsewhere"))
    scene.settle()
    cancelled = [
        one.conversation for one in scene.heard if one.communicate.performative is P.CANCEL
    ]
    assert cancelled == tasks
    assert ("refused", "elsewhere") in [(event.name, event.text) for event in scene.events]


def test_a_stopped_robot_takes_no_task(scene):
    """It says how it is let go."""
    line = scene.ask(Sentence("t", "take the jar", understand("take the jar"), held=True)).line
    assert (line.state, "roco release" in line.text, scene.heard) == ("refused", True, [])


# --- what is said of things, and of several at once -----------------------------------------------


def test_two_wishes_become_two_tasks_in_their_order(scene):
    """The answer names both; co gets them one after the other."""
    line = scene.say("take the jar and pour it into the bowl").line
    assert [one.content for one in scene.heard] == [
        Take("jar"),
        PourInto("jar", "bowl", after=line.task),
    ]
    assert [one.conversation for one in scene.heard] == [line.task, *line.then]
    assert line.text == "I will take the jar, then pour the content of the jar into the bowl."


@pytest.mark.parametrize("state", [TaskState.FAILED, TaskState.CANCELLED])
def test_what_follows_in_a_sentence_is_cancelled_where_the_first_was_not_done(scene, state):
    """And nothing else is."""
    line = scene.say("take the jar and pour it into the bowl").line
    other = scene.say("look around").line.task
    if state == TaskState.CANCELLED:
        scene.report(line.task, P.AGREE, TaskState.WAITING)
        scene.cancel(line.task)
        scene.report(line.task, P.INFORM, TaskState.CANCELLED, kind=Kind.CANCEL)
    else:
        scene.report(line.task, P.REFUSE, TaskState.FAILED, BUSY)
    cancelled = {
        one.conversation for one in scene.heard if one.communicate.performative is P.CANCEL
    }
    assert cancelled - {line.task} == set(line.then)
    assert other not in cancelled


def test_what_follows_a_done_task_goes_on(scene):
    """It is what was said."""
    line = scene.say("take the jar and pour it into the bowl").line
    scene.report(line.task, P.AGREE, TaskState.WAITING)
    scene.report(line.task, P.INFORM, TaskState.DONE)
    assert P.CANCEL not in [one.communicate.performative for one in scene.heard]


def test_it_and_the_other_one_are_what_was_talked_of(scene):
    """Until something else is."""
    for text in (
        "take the jar",
        "put it down",
        "take the bowl",
        "put the other one down",
        "take the other one",
    ):
        assert scene.say(text).line.state == "waiting", text
    things = [one.content.object for one in scene.heard]
    assert things == ["jar", "jar", "bowl", "jar", "bowl"]


def test_a_question_back_is_answered_by_yes_or_by_a_name(scene):
    """Nothing moves before; after any other sentence the question is forgotten."""
    for text, answer, wanted in (
        ("take the red jar", "yes", "jar"),
        ("take the spoon", "the bowl", "bowl"),
    ):
        assert scene.say(text).line.state == "question"
        assert scene.say("what can you do?").line.state == "answered"
        assert scene.say(answer).line.state != "waiting"
        scene.say(text)
        assert scene.say(answer).line.state == "waiting"
        assert scene.heard[-1].content == Take(wanted)


@pytest.mark.parametrize(
    ("question", "answer"), [("take the red jar", "yes"), ("take the spoon", "the jar")]
)
def test_a_question_is_answered_by_who_was_asked(scene, question, answer):
    """What another one says neither answers it nor ends it; each may be asked something."""
    assert scene.say(question, "kitchen").line.state == "question"
    assert scene.say(answer, "hall").line.state != "waiting"
    assert scene.say("take the red bowl", "hall").line.state == "question"
    assert scene.heard == []
    assert scene.say(answer, "kitchen").line.state == "waiting"
    assert scene.say("tak", "hall").line.state == "waiting"
    assert [one.content for one in scene.heard] == [Take("jar"), Take("bowl")]


def test_a_question_is_open_for_so_long(scene):
    """Later a yes may be meant for something else."""
    scene.say("take the red jar")
    scene.settle(ASKED_S - 1.0)
    assert scene.say("yes").line.state == "waiting"
    scene.say("take the red bowl")
    scene.settle(ASKED_S)
    assert scene.say("yes").line.state == "refused"
    assert len(scene.heard) == 1


def test_open_questions_are_shown_to_who_must_tell_an_answer_from_a_stop(scene):
    """Before the answer is there, in both languages, also after hi was killed; none once it was
    answered.
    """

    def questions():
        return [one for one in scene.shown if isinstance(one, Shown)][-1].questions

    ticket = f"t{len(scene.shown)}"
    scene.say("weź czerwony słoik")
    at = next(
        n for n, one in enumerate(scene.shown) if isinstance(one, Answer) and one.ticket == ticket
    )
    asked = [one for one in scene.shown[:at] if isinstance(one, Shown)][-1].questions
    (question,) = asked
    assert (question.asker, set(question.replies)) == ("me", {"yes", "no", "tak", "nie"})
    assert question.until == pytest.approx(scene.wires.now + ASKED_S, abs=1.0)
    scene.wires.crash("hi", Point.AFTER, restart_s=0.5)
    scene.say("take the container", "another")
    scene.settle(2.0)
    assert questions()[0] == question
    assert set(questions()[1].replies) == {"jar", "bowl", "no", "słoik", "miska", "nie"}
    assert scene.say("nie").line.state == "refused"
    assert {one.asker: round(one.until - scene.wires.now) for one in questions()} == {
        "another": 28,
        "me": 2,
    }


@pytest.mark.parametrize("text", ["take the jar", "take the jar and put it down"])
def test_six_clicks_are_one_task(scene, text):
    """Each within two seconds of the one before; it is said so. Later, or of somebody else, it is
    another task.
    """
    first = scene.say(text).line
    for _ in range(5):
        scene.settle(AGAIN_S - 0.2)
        line = scene.say(f" {text} ").line
        assert (line.task, line.then, line.text) == (
            first.task,
            first.then,
            f"Already asked: {first.text}",
        )
    asked = len(scene.heard)
    assert scene.say(text, "another").line.task != first.task
    assert scene.say("take the bowl").line.task != first.task
    scene.settle(AGAIN_S + 0.1)
    assert scene.say(text).line.task != first.task
    assert len(scene.heard) == 1 + 3 * asked


def test_what_was_cancelled_is_new_if_it_is_said_again_at_once(scene):
    """Whoever cancels it, and by a button, too; another task of the same person stays the same
    one.
    """
    first, other = (
        scene.say("take the jar").line.task,
        scene.say("look around", "another").line.task,
    )
    scene.report(first, P.AGREE, TaskState.WAITING)
    scene.wires.post("hi", CancelWanted("c", first))
    scene.settle()
    scene.report(first, P.INFORM, TaskState.CANCELLED, kind=Kind.CANCEL)
    assert scene.say("take the jar").line.task not in (first, other)
    assert scene.say("look around", "another").line.task == other


def test_clicks_in_another_order_are_one_task(scene):
    """Each request has a thread of its own: a later click may be first."""
    for at in (1.0, 0.0, 1.2, 0.4):
        scene.ask(
            Sentence(
                f"t{len(scene.shown)}",
                "look around",
                read("look around"),
                asker="me",
                at=scene.wires.now + at,
            )
        )
    assert len(scene.heard) == 1


def test_what_is_wanted_more_urgently_is_asked_again(scene):
    """It is no repetition, nor is the same by one who gives no name."""
    words = "look around"
    for urgency, asker in ((0, "me"), (1, "me"), (0, ""), (0, "")):
        scene.ask(
            Sentence(
                f"t{len(scene.shown)}",
                words,
                read(words),
                False,
                urgency,
                asker=asker,
                at=scene.wires.now,
            )
        )
    assert len(scene.heard) == 4


def test_a_double_click_on_an_answer_is_one_answer(scene):
    """A second yes does nothing, a second no does not stop the robot; the replies are known as such
    for a moment.
    """
    scene.say("take the red jar")
    task = scene.say("yes").line.task
    assert scene.say("yes").line.task == task
    assert len(scene.heard) == 1
    scene.say("take the red bowl")
    for _ in range(4):
        assert scene.say("nie").line.text == "Dobrze, więc nie."
        scene.settle(AGAIN_S - 0.2)
        (question,) = [one for one in scene.shown if isinstance(one, Shown)][-1].questions
        assert ("nie" in question.replies, question.until > scene.wires.now) == (True, True)
    scene.settle(0.3)
    scene.wires.post("hi", Sentence("n", "nie", read("nie"), asker="me", at=scene.wires.now))
    scene.settle()
    assert StopRobot("n", "nie") in scene.shown


def test_a_cancel_said_twice_at_once_cancels_one_task(scene):
    """Though the first one has been cancelled by then."""
    tasks = [scene.say(text).line.task for text in ("take the jar", "look around")]
    scene.report(tasks[0], P.AGREE, TaskState.WAITING)
    scene.say("cancel")
    scene.report(tasks[0], P.INFORM, TaskState.CANCELLED, kind=Kind.CANCEL)
    assert scene.say("cancel").line.task == tasks[0]
    assert scene.tasks == {tasks[0]: "cancelled", tasks[1]: "waiting"}
    assert [
        one.conversation for one in scene.heard if one.communicate.performative is P.CANCEL
    ] == tasks[:1]


def test_no_to_a_question_moves_nothing_and_a_no_out_of_nothing_stops(scene):
    """The device sets the flag, and answers."""
    scene.say("take the red jar")
    assert scene.say("no").line.state == "refused"
    scene.settle(AGAIN_S + 0.1)
    scene.wires.post("hi", Sentence("n", "no", read("no"), asker="me", at=scene.wires.now))
    scene.settle()
    assert StopRobot("n", "no") in scene.shown
    assert scene.heard == []


@pytest.mark.parametrize(
    ("text", "told"), [("how do I stop you?", "`roco stop`"), ("jak cię zatrzymać?", "Escape")]
)
def test_who_asks_how_to_stop_is_told(scene, text, told):
    """It is no stop (companion.stop_words), and a question like any other."""
    line = scene.say(text).line
    assert (line.state, told in line.text) == ("answered", True)


def test_what_is_seen_is_what_the_last_look_told(scene):
    """Before, it says how to look. Each is told in the language of who asks."""
    assert "look around" in scene.say("what do you see?").line.text
    task = scene.say("look around").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.report(task, P.INFORM, TaskState.DONE, fact(Why.SEEN, "jar_1", "jar_2"))
    line = scene.say("co widzisz?").line
    assert (line.state, "słoik i słoik 2" in line.text) == ("answered", True)
    assert "the jar and jar 2" in scene.say("what do you see?").line.text
    assert scene.say("take the jar").line.state == "question", "there are two"
    assert scene.say("jar 2").line.state == "waiting"
    assert scene.heard[-1].content == Take("jar_2")


def test_a_look_that_saw_nothing_is_told_as_such(scene):
    """It is no missing look; what another task tells of what is seen is none."""
    task, other = scene.say("look around").line.task, scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.report(task, P.INFORM, TaskState.DONE, fact(Why.SEEN_NOTHING))
    scene.report(other, P.AGREE, TaskState.WAITING)
    scene.report(other, P.INFORM, TaskState.DONE, fact(Why.SEEN, "jar_1"))
    assert scene.say("what do you see?").line.text.startswith("I see nothing that I know.")


@pytest.mark.parametrize(
    ("seen", "given", "left"),
    [
        (("bowl_1", "jar_1"), "the jar", {"bowl_1"}),
        (("bowl_1", "jar_1", "jar_2"), "jar 2", {"bowl_1", "jar_1"}),
        (("bowl_1", "jar_1"), "jar 1", {"bowl_1"}),
    ],
)
def test_what_was_given_to_a_person_is_not_offered_any_more(scene, seen, given, left):
    """As soon as it was done, and not before; a later look that sees it offers it again."""

    def looked():
        task = scene.say("look around").line.task
        scene.report(task, P.AGREE, TaskState.WAITING)
        scene.report(task, P.INFORM, TaskState.DONE, fact(Why.SEEN, *seen))

    def offered():
        return {
            wish.thing.en
            for wish in [one for one in scene.shown if isinstance(one, Shown)][-1].wishes
        }

    looked()
    scene.say("take the jar")
    before = offered()
    task = scene.say(f"hand me {given}").line.task
    assert scene.heard[-1].content.gives
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.report(task, P.INFORM, TaskState.RUNNING)
    assert offered() == before
    scene.report(task, P.INFORM, TaskState.DONE)
    assert len(offered()) == len(left) == len(before) - 1
    scene.settle(2 * AGAIN_S)
    looked()
    assert offered() == before


def test_why_names_the_reason(scene):
    """Of the task that is open, else of the last one that was not done; in the language of who
    asks.
    """
    assert scene.say("why?").line.text == "Nothing that you asked for has failed so far."
    task = scene.say("take the jar").line.task
    assert scene.say("why?").line.text == "You said 'take the jar'. Now: waiting."
    scene.report(task, P.AGREE, TaskState.WAITING, NEXT)
    assert scene.say("why?").line.text == "You said 'take the jar'. Now: waiting. I do it next."
    scene.report(task, P.FAILURE, TaskState.FAILED, fact(Why.NOT_SEEN, "jar"))
    assert scene.say("why?").line.text == "take the jar: I have not seen the jar. Please help me."
    assert scene.say("dlaczego?").line.text == "take the jar: Nie widzę słoika. Proszę o pomoc."


def test_everything_can_be_cancelled_at_once(scene):
    """Each task."""
    tasks = {scene.say(text).line.task for text in ("take the jar", "look around")}
    scene.say("cancel everything")
    assert {
        one.conversation for one in scene.heard if one.communicate.performative is P.CANCEL
    } == tasks


def test_no_word_releases_a_stopped_robot(scene):
    """It says what does."""
    line = scene.say("go on").line
    assert (line.state, "roco release" in line.text) == ("refused", True)


def test_an_act_that_waits_for_an_operator_is_told_until_it_begins(scene):
    """By its place for programs, in words for people; a person who says "go on" hears who can let
    it begin.
    """
    task = scene.say("take the jar").line.task
    scene.report(task, P.AGREE, TaskState.WAITING)
    scene.co(task, P.INFORM, TaskReport(TaskState.RUNNING, at=GRASP, number=1, asks=True))
    line = scene.line(task)
    assert (line.asks, line.at, line.number) == ("take jar_1/grasp", GRASP, 1)
    assert (
        line.text
        == "waits for you: next is 'take jar (grasp) with the left hand' - `roco step` to go on"
    )
    assert "roco step" in scene.say("go on").line.text
    assert "roco step" in scene.say("why?").line.text
    scene.report(task, P.INFORM, TaskState.RUNNING, at=GRASP)
    line = scene.line(task)
    assert (line.asks, line.at, line.text) == ("", GRASP, "take jar (grasp)")
    assert "roco release" in scene.say("go on").line.text
