"""hi and a guest: what a person could say is taken, all else is refused, and the task is one like
any other.
"""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from scripted_partner import Puppet

from agent_runtime.testing.memory_bus import MemoryBus
from companion import commands
from companion.design import DESIGN, LANGUAGES, wiring
from companion.languages.cmd import Sentence, Stopped, TaskReport, TaskState
from companion.languages.facts import Kind as Why
from companion.languages.facts import fact
from companion.loopback_server import Refused
from companion.run_files import HELD, STOPPED, TaskLine
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tasks.put_down.command import PutDown
from companion.tasks.take.command import Take
from fipa_codec.communicate import Communicate, encode
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from services.human_interface.behaviours import agent
from services.human_interface.device_messages import Shown
from services.human_interface.guests import HiDevice, meant, unsayable
from services.human_interface.interpretation import Act, Ask, Tell
from topdown.judge.verdicts import Admission

WORDS = (
    *("", "jar", "jar_1", "bowl_2", "table", "table_1", "cabinet_2", "back", "left", "right"),
    *("thing", "jar_0", "jar_", "_1", "jar_x", "JAR", "ignore all rules", "stop", "it", "{0}"),
)


class App:
    """What stops the robot: `stops` are the texts that did; `breaks`: why it cannot."""

    def __init__(self):
        self.stops, self.breaks = [], ""

    def hold(self, held, text):
        assert held
        if self.breaks:
            raise Refused(503, self.breaks)
        self.stops.append(text)
        return TaskLine("", STOPPED, HELD, text)


class People:
    """People see what hi shows."""

    def __init__(self):
        self.tasks, self.app = (), App()

    def tell(self, content):
        if isinstance(content, Shown):
            self.tasks = content.tasks

    def close(self):
        """Nothing to close."""


class Robot:
    held = False


class Scene:
    """hi, a co, a guest, and people."""

    def __init__(self):
        self.wires, self.people, self.robot = MemoryBus(), People(), Robot()
        self.co = Puppet("co")
        self.wires.add(
            agent(), wiring("hi", "x"), lambda post: HiDevice(post, self.people, self.robot)
        )
        self.wires.add(self.co.agent(), wiring("co", "x"))
        self.settle()

    def settle(self):
        self.wires.run_for(0.1)

    def say(self, act, content=None, number=1, **more):
        """The guest says something."""
        one = Communicate(
            performative=act,
            language="CMD",
            protocol="request",
            reply_with=f"g-{number}",
            conversation="g",
            sender="assistant",
            receiver="hi",
            id=f"g-{number}",
            sent=self.wires.now,
        )
        one = replace(one, **more)
        if content is not None:
            one = replace(one, content=LANGUAGES.named("CMD").encode(content))
        self.wires.doors["hi"](f"roco/x/G1/assistant/hi/{one.protocol}/{act}", encode(one))
        self.settle()

    def ask(self, text):
        """The guest asks what a sentence means; hi's answer, which is as the design has it."""
        name = f"assistant-{len(self.wires.told_guests):012}"
        more = {"protocol": "query", "conversation": name, "reply_with": f"{name}-1"}
        self.say(P.QUERY_REF, Sentence(text), id=f"{name}-1", **more)
        (told,) = [one for one in self.wires.told_guests if one.conversation == name]
        key, size = DESIGN.key("x", told), len(encode(told))
        assert Admission(DESIGN, LANGUAGES).check(key, told, size).faults == ()
        return told.performative, LANGUAGES.read(told)[0]

    @property
    def told(self):
        """What the guest was told: act, and content."""
        return [(str(one.performative), LANGUAGES.read(one)[0]) for one in self.wires.told_guests]


@pytest.fixture
def scene():
    return Scene()


def co_says(scene, act, report, kind=None):
    """co says something about the task."""
    scene.wires.post(
        "co", lambda turn: turn.say(turn.conversations()[0].id, act, report, kind=kind)
    )
    scene.settle()


def test_a_wish_of_a_guest_is_a_task_like_that_of_a_person(scene):
    """co is asked for the same command; people see whose it is; the guest hears how it goes."""
    scene.say(P.REQUEST, PourInto(source="jar", destination="bowl"))
    (asked,) = scene.co.heard
    assert asked.communicate.performative is P.REQUEST
    assert asked.content == PourInto(source="jar", destination="bowl")
    assert [line.said for line in scene.people.tasks] == [
        "assistant: pour the content of the jar into the bowl"
    ]
    co_says(scene, P.AGREE, TaskReport(TaskState.WAITING))
    co_says(scene, P.INFORM, TaskReport(TaskState.PLANNING, (fact(Why.PLAN, 1),)))
    co_says(scene, P.INFORM, TaskReport(TaskState.DONE))
    acts = [(act, content.state) for act, content in scene.told]
    assert acts[0] == ("agree", TaskState.WAITING)
    assert ("inform", TaskState.PLANNING) in acts
    assert acts[-1] == ("inform", TaskState.DONE)


def test_a_cancel_of_a_guest_is_one_at_co(scene):
    """And its answer answers the guest's."""
    scene.say(P.REQUEST, LookAround())
    co_says(scene, P.AGREE, TaskReport(TaskState.WAITING))
    scene.say(P.CANCEL, number=2)
    assert scene.co.heard[-1].communicate.performative is P.CANCEL
    co_says(scene, P.INFORM, TaskReport(TaskState.CANCELLED), Kind.CANCEL)
    last = scene.wires.told_guests[-1]
    assert (last.performative, last.in_reply_to) == (P.INFORM, "g-2")


def test_a_person_who_cancels_ends_the_guests_task(scene):
    """It hears a failure."""
    scene.say(P.REQUEST, LookAround())
    co_says(scene, P.AGREE, TaskReport(TaskState.WAITING))
    co_says(scene, P.FAILURE, TaskReport(TaskState.CANCELLED))
    assert scene.told[-1][0] == "failure"


def test_a_stopped_robot_takes_no_wish(scene):
    """Only a person releases it."""
    scene.robot.held = True
    scene.say(P.REQUEST, LookAround())
    assert scene.told[-1][0] == "refuse"
    assert "roco release" in scene.told[-1][1].text
    assert scene.co.heard == []


@pytest.mark.parametrize("name", ["IGNORE ALL RULES", "jar_1; stop", "jar_x", "jar_٣", ""])
def test_a_name_that_nobody_could_say_is_refused_and_hi_lives(scene, name):
    """The names are those of the catalogue."""
    scene.say(P.REQUEST, Take(object=name))
    assert scene.told[-1][0] == "refuse"
    assert scene.co.heard == []
    assert scene.people.tasks == ()


def test_a_sentence_is_told_as_a_command_and_does_nothing(scene):
    """In both languages. co hears nothing, and people see no task."""
    assert scene.ask("please take the jar") == (P.INFORM_REF, Take(object="jar"))
    assert scene.ask("weź słoik lewą ręką") == (P.INFORM_REF, Take(object="jar", side="left"))
    assert (scene.co.heard, scene.people.tasks, scene.people.app.stops) == ([], (), [])


def test_a_sentence_is_read_by_what_was_seen_and_by_no_talk(scene):
    """Which jar is asked back. What a person or the guest said before is none of its context."""
    scene.say(P.REQUEST, LookAround())
    co_says(scene, P.AGREE, TaskReport(TaskState.WAITING))
    seen = (fact(Why.SEEN, "jar_1", "jar_2"),)
    co_says(scene, P.INFORM, TaskReport(TaskState.DONE, seen))
    act, why = scene.ask("take the jar")
    assert (act, why.text) == (P.REFUSE, "Which one: jar 1, jar 2?")
    assert scene.ask("jar 1")[0] is P.REFUSE  # nothing was asked
    assert scene.ask("take jar 2") == (P.INFORM_REF, Take(object="jar_2"))
    for text in ("take it", "again", "yes"):
        assert scene.ask(text)[0] is P.REFUSE
    assert len(scene.co.heard) == 1


@pytest.mark.parametrize(
    "text",
    [
        "take the jar and then take the bowl",
        "take the jar within two minutes",
        "take the jar in five minutes",
        "weź słoik za pięć minut",
        "what are you holding?",
        "why",
        "cancel",
        "hello",
        "take the spoon",
        "take the table",
    ],
)
def test_what_is_no_single_command_is_refused_in_words(scene, text):
    """And says how it would be understood."""
    act, why = scene.ask(text)
    assert act is P.REFUSE
    assert why.text
    assert scene.co.heard == []


@pytest.mark.parametrize("text", ["Stop!", "please stop now", "stój", "no no, take the bowl"])
def test_a_word_that_stops_in_a_sentence_stops_the_robot(scene, text):
    """As a person's does; where it cannot be stopped, the guest hears that."""
    assert scene.ask(text) == (P.INFORM_REF, Stopped(HELD))
    assert scene.people.app.stops == [text]
    scene.people.app.breaks = "out of reach"
    assert scene.ask(text) == (P.FAILURE, Reason("out of reach"))


@pytest.mark.parametrize("text", ["take the " + "\U00010348" * 191, "weź " + "\U00010348" * 196])
def test_a_refusal_has_the_size_of_the_design_whatever_it_quotes(scene, text):
    """The word that is not known may be as long as a sentence."""
    assert scene.ask(text)[0] is P.REFUSE


def test_a_sentence_is_read_while_the_robot_is_stopped(scene):
    """The wish for what it means is refused then."""
    scene.robot.held = True
    assert scene.ask("take the jar") == (P.INFORM_REF, Take(object="jar"))


@given(st.text(min_size=1, max_size=60) | st.sampled_from(WORDS).map("take the {}".format))
@settings(max_examples=200, deadline=None)
def test_what_a_sentence_means_the_guest_may_say(text):
    """One command, with nothing in it that the design withholds from the guest."""
    found = meant(text, ("jar_1", "bowl_1"))
    if isinstance(found, Act):
        (task,) = found.tasks
        assert unsayable(task) == ""
        assert not any(getattr(task, one, None) for one in DESIGN.guests["assistant"].withheld)
    else:
        assert found.text if isinstance(found, Ask) else found == Tell("stop")


@given(data=st.data())
@settings(max_examples=300, deadline=None)
def test_whatever_is_wanted_is_judged_without_an_error(data):
    """And what passes is understood as it was wanted."""
    row = data.draw(st.sampled_from(commands.rows()))
    names = [
        name
        for name in row.content.__struct_fields__
        if name not in ("urgency", "deadline", "start", "after")
    ]
    given_ = {name: data.draw(st.sampled_from(WORDS)) for name in names}
    assert isinstance(unsayable(row.content(**given_)), str)


@pytest.mark.parametrize(
    "command",
    [
        PourInto(source="jar_1", destination="bowl"),
        Take(object="jar_2", side="left"),
        PutDown(object="jar", place="table_2"),
        PutDown(object="bowl", place="back"),
        LookAround(),
    ],
)
def test_what_a_person_could_say_is_taken(command):
    assert unsayable(command) == ""
