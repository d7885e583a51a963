"""The gateway before real doors: names and labels there and here, who is told what, and what
survives a kill.
"""

import asyncio
import itertools
import secrets

import msgspec
import pytest
from gateway_house import BUYER, HI, KM, House, run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from companion.design import DESIGN
from companion.languages import wm
from companion.languages.cmd import Sentence, TaskReport, TaskState
from companion.tasks.take.command import Take
from fipa_codec.acl_string import AclMessage, Aid, render
from fipa_codec.envelope import Envelope, pack
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from operate.guests.fipa_directory import _entries
from operate.guests.fipa_gateway import ANSWER_S, GIVE_UP_S, POSTS_OF_AN_OPENING, lost_receiver

pytestmark = pytest.mark.timeout(60)
JAR = '{"type":"Take","object":"jar"}'
LIST = '{"type":"ListObjects"}'
DONE, WAITING = TaskReport(TaskState.DONE), TaskReport(TaskState.WAITING)
CANCELLED = TaskReport(TaskState.CANCELLED)


@pytest.fixture
def house(tmp_path):
    return House(tmp_path)


def agrees(agent, *then):
    """An agent that agrees to all, and then says these acts with a report."""

    def answer(asked):
        if asked.content is not None:
            agent.door.say(asked.conversation, P.AGREE, WAITING)
            for act, report, kind in then:
                agent.door.say(asked.conversation, act, report, kind)

    agent.answer = answer


def opened(agent):
    """What an agent was asked for, without cancels."""
    return [one.content for one in agent.asked if one.content is not None]


# --- the ways of a conversation -------------------------------------------------------------------


def test_a_request_is_agreed_to_and_done(house):
    """Each answer names the peer's label, and the progress stays here: for JADE the first inform is
    the result.
    """
    progress = TaskReport(TaskState.RUNNING), Kind.PROGRESS
    agrees(house.hi, (P.INFORM, *progress), (P.INFORM, *progress), (P.INFORM, DONE, Kind.PLAIN))

    async def test():
        house.start()
        assert await house.ask(JAR) == (200, "")
        assert house.acts() == [("agree", "c1-r"), ("inform", "c1-r")]
        last = house.left[-1]
        assert (last.sender, last.receiver, last.protocol) == (HI, (BUYER,), "fipa-request")
        assert (last.language, last.encoding, last.content) == (
            "CMD", "json", '{"type":"TaskReport","state":"done"}',
        )  # fmt: skip
        assert house.gateway.open == 0

    run(test())
    assert opened(house.hi) == [Take(object="jar")]
    assert house.hi.asked[0].guest == "platform"


def test_a_question_is_answered_by_an_inform(house):
    """inform-ref is a macro act, which no platform sends; nothing needs a person's consent."""
    house.agreed = False
    known = wm.Objects((wm.Object("jar_1", "jar", "jar"),))
    house.km.answer = lambda asked: house.km.door.say(asked.conversation, P.INFORM_REF, known)

    async def test():
        house.start()
        await house.query(LIST)
        assert house.acts("q1") == [("inform", "q1-r")]
        assert msgspec.json.decode(house.left[0].content, type=wm.Objects) == known

    run(test())


def test_an_agent_may_have_two_uses_of_different_protocols(tmp_path):
    """Each is opened by its own protocol, and both are services of the agent in a directory."""
    (mine,) = (one for one in DESIGN.guests["assistant"].use if one.name == "sentence")
    ends = {"assistant": "platform"}
    said = tuple(replace(one, sender=ends.get(one.sender, one.sender)) for one in mine.message)
    house = House(tmp_path, more=(replace(mine, channel="G3", message=said),))

    def answer(asked):
        told = Take(object="jar") if isinstance(asked.content, Sentence) else WAITING
        house.hi.door.say(asked.conversation, P.AGREE if told is WAITING else P.INFORM_REF, told)

    house.hi.answer = answer

    async def test():
        house.start()
        await house.ask(JAR)
        text = '{"type":"Sentence","text":"take the jar"}'
        await house.say(P.QUERY_REF, HI, "q1", content=text, language="CMD", protocol="fipa-query")
        assert house.acts() == [("agree", "c1-r")]
        assert house.acts("q1") == [("inform", "q1-r")]

    run(test())
    assert opened(house.hi) == [Take(object="jar"), Sentence("take the jar")]
    entries = dict(_entries(house.design, house.gateway.guest, house.gateway.names))
    assert ":type execute_command" in entries["hi"]
    assert ":name sentence :type sentence" in entries["hi"]
    assert ":protocols (set fipa-request fipa-query) :languages (set CMD))" in entries["hi"]
    assert list(entries) == ["hi", "km"]


@pytest.mark.parametrize(
    ("act", "content"), [(P.REFUSE, Reason("no")), (P.FAILURE, TaskReport(TaskState.FAILED))]
)
def test_what_an_agent_refuses_or_fails_in_is_told(house, act, content):
    """With its content."""
    house.hi.answer = lambda asked: house.hi.door.say(asked.conversation, act, content)

    async def test():
        house.start()
        await house.ask(JAR)
        assert house.acts() == [(str(act), "c1-r")]
        assert msgspec.json.decode(house.left[0].content, type=type(content)) == content

    run(test())


@pytest.mark.parametrize(
    "more",
    [
        {"content": '{"type":"Take","object":"jar","urgency":9}'},
        {"content": "take the jar"},
        {"content": '{"type":"Home"}'},
        {"content": JAR, "language": "fipa-sl0"},
        {"content": JAR, "language": None},
        {"content": JAR, "encoding": "msgpack-base64"},
        {"content": JAR, "protocol": "fipa-query"},
        {"content": JAR, "protocol": None},
        {"content": None},
        {"content": LIST, "language": "WM"},
    ],
)
def test_bad_content_is_not_understood_and_reaches_nobody(house, more):
    """By the gateway, or by the door; what a guest may not set is refused."""

    async def test():
        house.start()
        assert (await house.ask(**more)).status == 200
        (answer,) = house.left
        urgent = "urgency" in str(more["content"])
        assert answer.performative is (P.REFUSE if urgent else P.NOT_UNDERSTOOD)
        assert (answer.in_reply_to, answer.conversation_id) == ("c1-r", "c1")
        assert house.gateway.open == 0

    run(test())
    assert house.hi.asked == []


@pytest.mark.parametrize("act", [P.SUBSCRIBE, P.CFP, P.PROPOSE, P.QUERY_IF, P.REQUEST_WHEN])
def test_acts_that_no_row_has_are_not_understood(house, act):
    """Subscription and contract net are those."""

    async def test():
        house.start()
        await house.say(act, HI, content=JAR, language="CMD")
        await house.say(act, KM, "c2", content=LIST, language="WM", protocol="fipa-query")
        assert {one.performative for one in house.left} == {P.NOT_UNDERSTOOD}

    run(test())


def test_nothing_is_answered_to_what_opens_nothing(house):
    """Two agents could answer each other's not-understood for ever."""

    async def test():
        house.start()
        nobody = Aid("zz@x", HI.addresses)
        for act, to in itertools.product((P.INFORM, P.FAILURE, P.NOT_UNDERSTOOD), (HI, nobody)):
            assert (await house.say(act, to, content="x")).status == 200
        assert house.left == []

    run(test())


def test_a_message_without_conversation_id_is_not_understood(house):
    """Nothing could be told from it later."""

    async def test():
        house.start()
        await house.ask(JAR, conversation="")
        (answer,) = house.left
        assert answer.performative is P.NOT_UNDERSTOOD
        assert "conversation-id" in answer.content

    run(test())


def test_an_unknown_agent_is_told_by_our_ams(house):
    """As JADE's does: with the label and conversation kept, and the lost receiver's name."""

    async def test():
        house.start()
        await house.ask(JAR, Aid("zz@x", HI.addresses))
        (answer,) = house.left
        assert (answer.performative, answer.sender.name) == (P.FAILURE, "ams@x")
        assert (answer.conversation_id, answer.in_reply_to) == ("c1", "c1-r")
        assert lost_receiver(answer) == "zz@x"

    run(test())


# --- consent and stop -----------------------------------------------------------------------------


def test_what_needs_consent_is_refused_unless_who_started_it_agreed(house):
    """FIPA has nobody to ask."""
    house.agreed = False

    async def test():
        house.start()
        await house.ask(JAR)
        assert house.acts() == [("refuse", "c1-r")]

    run(test())
    assert house.hi.asked == []


def test_a_row_may_do_without_consent(tmp_path):
    """Then nobody has to agree."""
    house = House(tmp_path, agreed=False, consent=False)
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)

    run(test())
    assert opened(house.hi) == [Take(object="jar")]


@pytest.mark.parametrize("word", ["stop", "(stop)", '"Stop!"', " STOP "])
def test_stop_needs_no_consent_no_row_and_no_place_among_others(house, word):
    """Also where too many messages were taken within the minute, and where nobody can be told."""
    house.agreed = False

    async def test():
        house.start()
        while (await house.ask("x")).status == 200:
            pass
        assert (await house.ask(word, KM, language="fipa-sl", protocol=None)).status == 200
        assert house.left[-1].performative is P.INFORM
        far = Aid("a@b", ("http://192.0.2.1/acc",))
        assert (await house.ask(word, sender=far)).status == 200

    run(test())
    assert house.stops == 2
    assert house.hi.asked == []


def test_who_cannot_stop_says_so(house):
    """A failure with the reason."""

    def broken():
        raise RuntimeError("not from here")

    async def test():
        house.stop = broken
        house.start()
        await house.ask("stop")
        (answer,) = house.left
        assert answer.performative is P.FAILURE
        assert "not from here" in answer.content

    run(test())


def test_answers_go_to_reply_to_or_to_the_addresses_of_the_envelope(house):
    """Where the message names no address of its sender."""
    agrees(house.hi)
    clerk = Aid("clerk@lab:1099/JADE", ("http://127.0.0.1:7779/acc",))

    async def test():
        house.start()
        await house.ask(JAR, reply_to=(clerk,))
        bare = AclMessage(
            performative=P.REQUEST,
            sender=Aid(BUYER.name),
            content=JAR,
            language="CMD",
            protocol="fipa-request",
            conversation_id="c2",
        )
        envelope = Envelope(to=(HI,), sender=BUYER)
        assert (await house.gateway.receive(*pack(envelope, render(bare)))).status == 200
        await house.settled()
        assert [one.receiver for one in house.left] == [(clerk,), (BUYER,)]

    run(test())


def test_names_and_labels_may_be_longer_than_ours(house):
    """They are kept as they are."""
    agrees(house.hi)
    sender = Aid("buyer@" + "a-very-long-name." * 10 + "org:1099/JADE", BUYER.addresses)
    long = "C" * 300

    async def test():
        house.start()
        await house.ask(JAR, conversation=long, sender=sender, reply_with=long)
        assert house.acts(long) == [("agree", long)]
        assert house.left[0].receiver == (sender,)

    run(test())


# --- bounds ---------------------------------------------------------------------------------------


def test_messages_are_counted_by_the_minute(house):
    """Good ones and bad ones."""

    async def test():
        house.start()
        most = house.gateway.guest.each_minute * POSTS_OF_AN_OPENING
        for number in range(most // 2):
            assert (await house.say(P.INFORM, HI, f"c{number}")).status == 200
            assert (await house.gateway.receive("", b"")).status == 400
        assert (await house.say(P.INFORM, HI)).status == 429
        assert (await house.gateway.receive("", b"")).status == 429
        house.now += 61.0
        assert (await house.say(P.INFORM, HI)).status == 200

    run(test())


def test_who_cannot_be_answered_is_not_heard(house):
    """No address, or one elsewhere."""

    async def test():
        house.start()
        for addresses in ((), ("http://192.0.2.1/acc",)):
            assert (await house.ask(JAR, sender=Aid("a@b", addresses))).status == 403
        assert (await house.say(P.INFORM, HI, sender=Aid("a@b"))).status == 200

    run(test())
    assert house.hi.asked == []


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    what=st.just("multipart/mixed; boundary=b") | st.text(max_size=9), body=st.binary(max_size=99)
)
def test_any_bytes_are_answered(tmp_path, what, body):
    """With 400; the fields of a message that is none are nobody's."""

    async def test():
        house.start()
        assert (await house.gateway.receive(what, body)).status == 400
        house.kill()

    house = House(tmp_path / secrets.token_hex(4))
    run(test())


WORDS = st.text(st.characters(blacklist_categories=("Cs",)), max_size=12)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    act=st.sampled_from(P),
    fields=st.fixed_dictionaries(
        {},
        optional=dict.fromkeys(
            ("content", "language", "encoding", "ontology", "protocol", "reply_with",
             "in_reply_to", "conversation_id"),
            st.just(JAR) | st.just("CMD") | st.just("fipa-request") | WORDS,
        ),
    ),
    to=st.sampled_from([HI, KM, Aid("ams@x"), Aid("zz@y")]),
    name=st.just(BUYER.name) | WORDS.filter(bool),
)  # fmt: skip
def test_any_message_is_answered(tmp_path, act, fields, to, name):
    """With 200, and in the conversation that it names where it asks for something."""

    async def test():
        house.start()
        sender = Aid(name, BUYER.addresses)
        message = AclMessage(performative=act, sender=sender, receiver=(to,), **fields)
        envelope = Envelope(to=(to,), sender=BUYER)
        assert (await house.gateway.receive(*pack(envelope, render(message)))).status == 200
        await house.settled()
        for answer in house.left:
            assert answer.conversation_id == message.conversation_id
            assert answer.in_reply_to == message.reply_with
        assert house.gateway._table.letters == []
        house.kill()

    house = House(tmp_path / secrets.token_hex(4))
    run(test())


# --- cancel ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("label", ["c1-r", "c1-k", None], ids=["the opening's", "its own", "none"])
def test_a_cancel_is_answered_by_its_label(house, label):
    """JADE's SubscriptionInitiator takes that of the opening, and names neither language nor
    encoding.
    """
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        await house.say(P.CANCEL, HI, reply_with=label)
        (_, cancel) = house.hi.asked
        house.hi.door.say(cancel.conversation, P.INFORM, CANCELLED, Kind.CANCEL)
        await house.settled()
        assert house.acts() == [("agree", "c1-r"), ("inform", label)]
        assert house.gateway.open == 0

    run(test())


def test_a_cancel_and_a_result_that_cross_are_both_told(house):
    """The result by the label of the opening, the failed cancel by its own."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        (asked,) = house.hi.asked

        def finishes(_):
            house.hi.door.say(asked.conversation, P.INFORM, DONE)
            house.hi.door.say(asked.conversation, P.FAILURE, DONE, Kind.CANCEL)

        house.hi.answer = finishes
        await house.say(P.CANCEL, HI, reply_with="c1-k")
        assert house.acts()[1:] == [("inform", "c1-r"), ("failure", "c1-k")]
        assert house.gateway.open == 0

    run(test())


def test_a_cancel_too_late_or_of_nothing_or_of_a_question_fails(house):
    """Its label is kept."""

    async def test():
        house.start()
        await house.say(P.CANCEL, HI, reply_with="k")
        await house.query(LIST)
        await house.say(P.CANCEL, KM, "q1", reply_with="k", protocol="fipa-query")
        assert [*house.acts(), *house.acts("q1")] == [("failure", "k")] * 2
        assert house.gateway.open == 1

    run(test())


def test_a_cancel_of_another_agent_is_none(house):
    """Conversations are told apart by who opened them."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        thief = Aid("thief@lab:1099/JADE", BUYER.addresses)
        await house.say(P.CANCEL, HI, reply_with="k", sender=thief)
        assert house.acts()[1:] == [("failure", "k")]

    run(test())
    assert [one.content for one in house.hi.asked] == [Take(object="jar")]


# --- peers that are lost --------------------------------------------------------------------------


def mts_error(name, sender="ams@lab:1099/JADE"):
    """What JADE's AMS says of a receiver that it does not find."""
    return {
        "sender": Aid(sender, BUYER.addresses),
        "reply_with": None,
        "language": "fipa-sl",
        "content": f"( (action ( agent-identifier :name hi@x ) (ACLMessage) ) (MTS-error"
        f' ( agent-identifier :name {name} ) (internal-error "Agent not found")))',
    }


def test_an_mts_error_is_of_the_receiver_that_it_names(house):
    """Its conversation is cancelled, and nothing more is sent there."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        await house.say(P.FAILURE, HI, **mts_error(BUYER.name))
        (_, cancel) = house.hi.asked
        assert cancel.content is None
        house.hi.door.say(cancel.conversation, P.INFORM, CANCELLED, Kind.CANCEL)
        await house.settled()
        assert house.acts() == [("agree", "c1-r")]
        assert house.gateway.open == 0

    run(test())


@pytest.mark.parametrize(
    "error",
    [
        mts_error("seller@lab:1099/JADE"),
        mts_error(BUYER.name, "ams@elsewhere"),
        mts_error(BUYER.name, "someone@lab:1099/JADE"),
        mts_error(BUYER.name) | {"content": "(MTS-error"},
    ],
    ids=["of another agent", "by another platform", "by no AMS", "without a name"],
)
def test_an_mts_error_of_somebody_else_ends_nothing(house, error):
    """The conversation goes on."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        await house.say(P.FAILURE, HI, **error)
        assert house.gateway.open == 1

    run(test())
    assert len(house.hi.asked) == 1


def test_a_peer_that_does_not_understand_ends_its_conversation(house):
    """FIPA has it so at any time."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        await house.say(P.NOT_UNDERSTOOD, HI, reply_with=None)

    run(test())
    assert house.hi.asked[-1].content is None


def test_an_answer_is_tried_again_then_the_conversation_is_cancelled(house, monkeypatch):
    """Within a bound."""
    monkeypatch.setattr("operate.guests.fipa_gateway.FIRST_TRY_S", 0.001)
    agrees(house.hi)

    async def test():
        house.start()
        house.fails = 2
        await house.ask(JAR)
        while not house.left:
            await house.settled()
        assert house.acts() == [("agree", "c1-r")]
        house.fails = 1_000
        await house.ask(JAR, conversation="c2")
        house.now += GIVE_UP_S + 1
        while len(house.hi.asked) < 3:
            await asyncio.sleep(0.001)
        assert house.events[-1][0] in ("peer lost", "undelivered")
        cancelled = {one.conversation for one in house.hi.asked if one.content is None}
        assert house.hi.asked[1].conversation in cancelled

    run(test())


# --- agents that are lost -------------------------------------------------------------------------


def test_an_agent_that_began_anew_is_told_as_a_failure(house):
    """Within the next look; a cancel is answered, too."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        await house.say(P.CANCEL, HI, reply_with="c1-k")
        house.router.forget([one for one in house.router._ears if "hi" in one[0]])
        house.hi = house.agent("hi")
        house.gateway.look()
        await house.settled()
        assert house.acts()[1:] == [("failure", "c1-r"), ("failure", "c1-k")]
        assert "began anew" in house.left[-1].content
        assert house.gateway.open == 0

    run(test())


def test_an_agent_that_never_answers_is_told_as_a_failure(house):
    """After the same time as other guests wait."""

    async def test():
        house.start()
        await house.ask(JAR)
        house.gateway.look()
        assert house.left == []
        house.now += ANSWER_S + 1
        house.gateway.look()
        await house.settled()
        assert house.acts() == [("failure", "c1-r")]

    run(test())
    assert house.hi.asked[-1].content is None, "and cancelled"


def test_words_that_are_lost_on_the_way_are_heard_later(house):
    """Of both sides: a cancel, and answers."""
    house.router.cut = "/hi/platform/request/"
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        house.router.cut = "/cancel"
        await house.say(P.CANCEL, HI, reply_with="c1-k")
        assert (house.left, len(house.hi.asked)) == ([], 1)
        house.router.cut = ""
        house.gateway.look()
        await house.settled()
        assert house.acts() == [("agree", "c1-r")]
        assert house.hi.asked[1].content is None
        house.gateway.look()
        assert len(house.hi.asked) == 2

    run(test())


# --- kill -9 --------------------------------------------------------------------------------------


def test_a_conversation_survives_the_gateway(house):
    """What the agent said meanwhile is told, each word once, under the names of before."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        house.kill()
        (asked,) = house.hi.asked
        progress = TaskReport(TaskState.RUNNING)
        house.hi.door.say(asked.conversation, P.INFORM, progress, Kind.PROGRESS)
        house.hi.door.say(asked.conversation, P.INFORM, DONE)
        house.start()
        await house.settled()
        assert house.acts() == [("agree", "c1-r"), ("inform", "c1-r")]
        assert house.gateway.open == 0

    run(test())
    assert len(house.hi.asked) == 1


def test_a_conversation_can_be_cancelled_after_a_kill(house):
    """And a cancel from before it is answered."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        house.kill()
        house.start()
        await house.say(P.CANCEL, HI, reply_with="c1-k")
        house.kill()
        house.hi.door.say(house.hi.asked[0].conversation, P.INFORM, CANCELLED, Kind.CANCEL)
        house.start()
        await house.settled()
        assert house.acts() == [("agree", "c1-r"), ("inform", "c1-k")]

    run(test())
    assert [one.content for one in house.hi.asked] == [Take(object="jar"), None]


def test_an_answer_that_was_not_delivered_survives(house):
    """It is in the journal until it is."""
    agrees(house.hi)

    async def test():
        house.start()
        house.fails = 1_000
        await house.ask(JAR)
        house.kill()
        house.fails = 0
        house.start()
        await house.settled()
        assert house.acts() == [("agree", "c1-r")]

    run(test())


@pytest.mark.parametrize("lost", [False, True], ids=["asked", "not asked"])
def test_an_opening_is_never_said_twice(house, lost):
    """Neither by the peer that posts it again, while it goes on and when it is over, nor by the
    gateway that cannot know whether it was said: that is a failure.
    """
    house.router.cut = "platform/hi/request/request" if lost else ""
    agrees(house.hi, *(() if lost else ((P.INFORM, DONE, Kind.PLAIN),)))

    async def test():
        house.start()
        await house.ask(JAR)
        await house.ask(JAR)
        house.kill()
        house.router.cut = ""
        house.start()
        await house.settled()
        await house.ask(JAR)
        told = [act for act, _ in house.acts()]
        assert told == (["failure"] if lost else ["agree", "inform"])

    run(test())
    assert len(house.hi.asked) == (0 if lost else 1)
    assert sum("platform/hi/request/request" in key for key in house.router.said) == 1


def test_another_message_under_the_name_of_a_conversation_is_not_understood(house):
    """While that goes on; afterwards it is a new one."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR)
        await house.ask(JAR, reply_with="other")
        assert house.acts()[-1] == ("not-understood", "other")
        house.hi.door.say(house.hi.asked[0].conversation, P.INFORM, DONE)
        await house.settled()
        await house.ask(JAR, reply_with="other")
        assert house.acts()[-1] == ("agree", "other")

    run(test())


def test_what_the_disk_does_not_take_is_not_done_but_a_cancel_is(house, monkeypatch):
    """The peer's platform hears that it was not received."""
    agrees(house.hi)

    async def test():
        house.start()
        await house.ask(JAR, conversation="c0")

        def full(_):
            raise OSError(28, "no space")

        monkeypatch.setattr(house.gateway._journal, "append", full)
        assert (await house.ask(JAR)).status == 503
        assert house.gateway.open == 1
        assert (await house.say(P.CANCEL, HI, "c0")).status == 200

    run(test())
    assert [one.content for one in house.hi.asked] == [Take(object="jar"), None]
