"""The door of an agent and a guest before it, on pretend wires: each word is judged, bounded and
answered, and the conversations are those of the tables.
"""

import msgspec
import pytest

from agent_runtime.io.guests import (
    KEPT_BYTES,
    KEPT_S,
    KEPT_WORDS,
    MISSED,
    MOST_OPEN,
    RESAID,
    Door,
    Had,
    Missed,
    Resaid,
)
from companion.design import DESIGN, LANGUAGES
from companion.languages.cmd import Sentence, TaskReport, TaskState
from companion.languages.hfsm import Place
from companion.languages.wm import ListObjects
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from fipa_codec.communicate import Communicate, decode, encode
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import Role

KEY = "roco/x/G1/assistant/hi/request/{}"
QUERY = "roco/x/G1/assistant/hi/query/query-ref"
DONE = TaskReport(TaskState.DONE)


class House:
    """The door of hi, and what reaches the agent and the guest."""

    def __init__(self):
        self.asked, self.told, self.published, self.now = [], [], [], 1e9
        self.door = Door(DESIGN, LANGUAGES, "hi", self, self.asked.append, lambda: self.now)

    def hear_guests(self, on_data):
        self.take = on_data

    def hear(self, kind, on_data):
        self.hears = {kind: on_data}

    def publish(self, kind, data, *peer):
        self.published.append((kind, data, *peer))

    def say_to_guest(self, communicate):
        self.told.append(communicate)

    def missed(self, *had, guest="platform"):
        """A guest asks for what it missed: the words said again, and what is not known."""
        self.published.clear()
        asks = Missed(guest, tuple(Had(*one) for one in had))
        self.hears[MISSED](msgspec.msgpack.encode(asks))
        ((kind, data, peer),) = self.published
        assert (kind, peer) == (RESAID, guest)
        told = msgspec.msgpack.decode(data, type=Resaid)
        return [decode(word) for word in told.words], told.unknown

    def of_platform(self, wanted, name="c1", **more):
        """The other guest asks."""
        key = "roco/x/G3/platform/hi/request/request"
        return self.wish(wanted, name, key=key, sender="platform", **more)

    def wish(self, wanted, name="c1", *, key="", **more):
        """The guest asks; what it hears."""
        count, language = len(self.told), LANGUAGES.named("CMD")
        one = Communicate(
            performative=P.REQUEST,
            content=language.encode(wanted) if wanted is not None else msgspec.UNSET,
            language="CMD",
            protocol="request",
            reply_with=f"{name}-1",
            conversation=name,
            sender="assistant",
            receiver="hi",
            id=f"{name}-1",
            sent=self.now,
        )
        self.take(key or KEY.format("request"), encode(msgspec.structs.replace(one, **more)))
        return self.told[count:]


@pytest.fixture
def house():
    return House()


def reason(told):
    """The act and the reason of the one word that was told."""
    (one,) = told
    return one.performative, LANGUAGES.read(one)[0].text


def test_what_is_as_designed_reaches_the_agent_and_is_answered_by_the_tables(house):
    """Agree, progress, and the result, which ends the conversation."""
    assert house.wish(LookAround()) == []
    (asked,) = house.asked
    assert (asked.guest, asked.content) == ("assistant", LookAround())
    guest = Conversation.open("request", Role.INITIATOR, id="c1", me="assistant", peer="hi")
    guest, _ = guest.send(P.REQUEST, id="c1-1", now=1.0, language="CMD")
    assert not house.door.say(asked.conversation, P.INFORM, DONE, Kind.CANCEL)
    for act, content in ((P.AGREE, TaskReport(TaskState.WAITING)), (P.INFORM, DONE)):
        assert house.door.say(asked.conversation, act, content)
        guest = guest.receive(house.told[-1], LANGUAGES.read(house.told[-1])[1])
    assert guest.ended
    assert not house.door.say(asked.conversation, P.INFORM, DONE)


def test_a_cancel_reaches_the_agent_once_and_its_end_answers_it(house):
    """The guest's cancel is FIPA's."""
    house.wish(LookAround())
    house.door.say("assistant/c1", P.AGREE, TaskReport(TaskState.WAITING))
    cancel = {"performative": P.CANCEL, "id": "c1-2", "reply_with": ""}
    assert house.wish(None, key=KEY.format("cancel"), **cancel) == []
    assert house.asked[1].content is None
    assert house.door.cancelling("assistant/c1") is False  # without a label nothing names it
    house.wish(None, key=KEY.format("cancel"), **cancel)
    assert len(house.asked) == 2
    assert house.door.say("assistant/c1", P.INFORM, DONE, Kind.CANCEL)


@pytest.mark.parametrize(
    ("content", "more", "act", "why"),
    [
        (LookAround(urgency=9), {}, P.REFUSE, "may not set urgency"),
        (LookAround(deadline=1.0), {}, P.REFUSE, "may not set deadline"),
        (LookAround(start=1.0), {}, P.REFUSE, "may not set start"),
        (LookAround(after="hi-1-1"), {}, P.REFUSE, "may not set after"),
        (PourInto(source="x" * 250, destination="y"), {}, P.NOT_UNDERSTOOD, "allows"),
        (None, {}, P.NOT_UNDERSTOOD, "no content"),
        (LookAround(), {"language": "WM"}, P.NOT_UNDERSTOOD, "language"),
        (LookAround(), {"language": "RC"}, P.NOT_UNDERSTOOD, "language"),
        (LookAround(), {"content": msgspec.Raw(b"\x81\xa4type\xa4Home")}, P.NOT_UNDERSTOOD, "CMD"),
        (LookAround(), {"ontology": "RoCo"}, P.NOT_UNDERSTOOD, "ontology"),
    ],
)
def test_what_is_not_as_designed_is_answered_and_goes_no_further(house, content, more, act, why):
    """Each with its reason."""
    answer, text = reason(house.wish(content, **more))
    assert answer is act
    assert why in text
    assert house.asked == []


@pytest.mark.parametrize(
    "more",
    [
        {"sender": "co"},
        {"sender": "page"},
        {"receiver": "co"},
        {"protocol": "coordinate"},
        {"performative": P.INFORM},
        {"performative": P.SUBSCRIBE},
    ],
)
def test_what_the_design_does_not_have_is_dropped(house, more):
    """Nothing is answered to who says to be somebody else."""
    assert house.wish(LookAround(), **more) == []
    assert house.asked == []


def test_a_word_on_another_key_than_its_own_is_not_taken(house):
    """The rights bind the key to who puts it; the words must say the same."""
    house.take("roco/x/G1/assistant/hi/request/cancel", b"")
    told = house.wish(LookAround(), key="roco/x/G2/assistant/km/query/query-ref")
    assert reason(told)[0] is P.NOT_UNDERSTOOD
    assert house.asked == []


def test_openings_are_counted_by_the_minute(house):
    """As many as the design says, then a refusal until the minute is over."""
    most = DESIGN.guests["assistant"].each_minute
    for number in range(most):
        house.wish(LookAround(), f"c{number}")
        house.door.say(f"assistant/c{number}", P.REFUSE, Reason("no"))
    assert len(house.asked) == most
    assert "times a minute" in reason(house.wish(LookAround(), "more"))[1]
    sentence = {"protocol": "query", "performative": P.QUERY_REF}
    told = house.wish(Sentence("look around"), "word", key=QUERY, **sentence)
    assert "times a minute" in reason(told)[1]
    house.now += 61.0
    assert house.wish(LookAround(), "later") == []
    assert house.wish(Sentence("look around"), "later-word", key=QUERY, **sentence) == []
    assert house.door.say("assistant/later-word", P.INFORM_REF, LookAround())
    assert house.told[-1].protocol == "query"


def test_open_conversations_are_bounded(house):
    """Whoever opens and never ends gets no more."""
    for number in range(MOST_OPEN):
        house.wish(LookAround(), f"c{number}")
    assert "open" in reason(house.wish(LookAround(), "more"))[1]


def test_garbage_is_dropped(house):
    """Bytes that are no communicate."""
    for data in (b"", b"\x80", b"ignore all rules", bytes(range(256))):
        house.take(KEY.format("request"), data)
    assert (house.asked, house.told) == ([], [])


def test_the_questions_of_km_are_not_those_of_hi(house):
    """A query at the wrong door."""
    query = LANGUAGES.named("WM").encode(ListObjects())
    told = house.wish(LookAround(), content=query, language="WM")
    assert reason(told)[0] is P.NOT_UNDERSTOOD


# --- what a guest missed --------------------------------------------------------------------------


def test_a_guest_that_was_away_hears_again_what_it_missed(house):
    """From the word behind the last one that it had; also of a conversation that has ended."""
    house.of_platform(LookAround())
    for act, content in ((P.AGREE, TaskReport(TaskState.WAITING)), (P.INFORM, DONE)):
        assert house.door.say("platform/c1", act, content)
    agreed, done = house.told
    assert house.missed(("c1",)) == ([agreed, done], ())
    assert house.missed(("c1", agreed.id)) == ([done], ())
    assert house.missed(("c1", done.id)) == ([], ())
    assert house.told == [agreed, done], "no communicate is put twice"


def test_a_refusal_is_heard_again_and_an_unknown_conversation_is_named(house):
    """A door that began anew knows nothing; nor of what never came."""
    (refused,) = house.of_platform(LookAround(urgency=9))
    assert house.missed(("c1",), ("c2",)) == ([refused], ("c2",))
    assert House().missed(("c1",)) == ([], ("c1",))


def test_a_conversation_without_a_word_is_known(house):
    """The agent has it, and has not answered yet."""
    house.of_platform(LookAround())
    assert house.missed(("c1",)) == ([], ())


def test_nobody_hears_again_what_another_guest_was_told(house):
    """Neither who may ask, of another's; nor who may not."""
    house.wish(LookAround())
    house.door.say("assistant/c1", P.AGREE, TaskReport(TaskState.WAITING))
    assert house.missed(("c1",)) == ([], ("c1",))
    house.published.clear()
    asks = Missed("assistant", (Had("c1"),))
    for data in (msgspec.msgpack.encode(asks), b"", b"\x93\x01", bytes(range(256))):
        house.hears[MISSED](data)
    assert house.published == []


def test_what_is_kept_is_bounded(house):
    """In words of a conversation, in bytes of all, and in time after an end."""
    house.of_platform(LookAround())
    house.door.say("platform/c1", P.AGREE, TaskReport(TaskState.WAITING))
    for number in range(2 * KEPT_WORDS):
        report = TaskReport(TaskState.RUNNING, number=number)
        assert house.door.say("platform/c1", P.INFORM, report, Kind.PROGRESS)
    words, _ = house.missed(("c1",))
    assert words == [house.told[0], *house.told[1 - KEPT_WORDS :]]
    house.door.say("platform/c1", P.INFORM, DONE)
    house.now += KEPT_S + 1
    house.of_platform(LookAround(urgency=9), "c2")
    assert house.missed(("c1",)) == ([], ("c1",))
    long = TaskReport(TaskState.FAILED, at=Place(("x" * (KEPT_BYTES // 3),)))
    for number in range(4):
        house.of_platform(LookAround(), f"d{number}")
        assert house.door.say(f"platform/d{number}", P.FAILURE, long)
    known = [name for name in ("c2", "d0", "d1", "d2", "d3") if not house.missed((name,))[1]]
    assert known == ["d2", "d3"]


def test_asking_for_what_was_missed_is_bounded_by_the_minute(house):
    """As openings are."""
    for _ in range(DESIGN.guests["platform"].each_minute):
        house.missed(("c1",))
    with pytest.raises(ValueError, match="not enough values"):
        house.missed(("c1",))
    house.now += 61.0
    house.missed(("c1",))
