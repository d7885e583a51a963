"""Violations planted into a recording: communicates edited, added or removed, each as somebody
wrong would say it.
"""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.io.tap import Sample
from companion.design import DESIGN, language_of
from companion.languages import wm
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate, decode, encode
from fipa_codec.performatives import Performative as P
from operate.judging.judged import Judging
from operate.recording import mcap_file
from operate.recording.records import Record, Spoken, understood
from topdown.judge.verdicts import Verdict as V

POUR = Path(__file__).parents[1] / "histories" / "pour_seed_7" / "traffic.mcap"
Item = Sample | Record
Expected = tuple[V, str]
"""Verdict, and sender>receiver performative id of the communicate; for bytes that are none, the
key.
"""


class Traffic:
    """The recording as it came by; edits change it in place."""

    def __init__(self) -> None:
        self.items: list[Item] = list(_pour())

    def said(self, sender: str, receiver: str, act: str = "", nth: int = 0) -> int:
        """Return the index of the `nth` communicate of this kind (-1: the last)."""
        found = [
            n
            for n, item in enumerate(self.items)
            if isinstance(item, Sample)
            and item.key.split("/")[3:5] == [sender, receiver]
            and item.key.endswith("/" + act if act else "")
        ]
        return found[nth]

    def at(self, n: int) -> Communicate:
        """The communicate there."""
        item = self.items[n]
        assert isinstance(item, Sample)
        return decode(item.data)

    def edit(self, n: int, key: str = "", **fields: Any) -> Communicate:
        """Change it where it stands; without a `key` it is on the one that the design wants for
        what it was.
        """
        item = self.items[n]
        assert isinstance(item, Sample)
        one = msgspec.structs.replace(decode(item.data), **fields)
        self.items[n] = Sample(key or item.key, encode(one), item.at)
        return one

    def add(self, after: int, key: str = "", later_s: float = 0.001, **fields: Any) -> Communicate:
        """Say something like the one there, a little later."""
        item = self.items[after]
        assert isinstance(item, Sample)
        one = msgspec.structs.replace(decode(item.data), sent=item.at + later_s, **fields)
        place = key or DESIGN.key("roco", one)
        self.items.insert(after + 1, Sample(place, encode(one), item.at + later_s))
        return one

    def remove(self, n: int) -> Communicate:
        """Unsay it."""
        one = self.at(n)
        del self.items[n]
        return one

    def found(self) -> list[Expected]:
        """Return the judge's findings against the design."""
        judging = Judging(SYSTEM)
        lines = [line for item in self.items for line in judging.lines(_record(item))]
        lines += judging.finish()
        return [
            (
                V(one.verdict),
                f"{one.sender}>{one.receiver} {one.performative} {one.id}"
                if one.sender
                else one.key,
            )
            for one in lines
            if one.violation
        ]

    def verdicts(self) -> list[str]:
        """All verdicts."""
        judging = Judging(SYSTEM)
        lines = [line for item in self.items for line in judging.lines(_record(item))]
        return [one.verdict for one in (*lines, *judging.finish())]


def name(one: Communicate) -> str:
    """As findings name it."""
    return f"{one.sender}>{one.receiver} {one.performative} {one.id}"


def content(what: Any) -> dict[str, Any]:
    """The fields of a communicate that says this."""
    language = language_of(what)
    return {"content": language.encode(what), "language": language.name}


@cache
def _pour() -> tuple[Item, ...]:
    return tuple(_sample(record) for record in mcap_file.read(POUR).records)


def _sample(record: Record) -> Item:
    if not isinstance(record, Spoken):
        return record
    return Sample(DESIGN.key("roco", record.communicate), record.wire, record.received)


def _record(item: Item) -> Record:
    return understood(item, SYSTEM) if isinstance(item, Sample) else item


# --- out of sequence ------------------------------------------------------------------------------


def result_told_twice(t: Traffic) -> Expected:
    """ex tells the outcome of an act once more, under a new number."""
    return V.OUT_OF_SEQUENCE, name(t.add(t.said("ex", "ta", "inform", -1), id="29"))


def confirmed_twice(t: Traffic) -> Expected:
    """co confirms the final report again."""
    return V.OUT_OF_SEQUENCE, name(t.add(t.said("co", "ta", "confirm", -1), id="20"))


def confirm_forgotten(t: Traffic) -> Expected:
    """co never confirms a report, and numbers on as if nothing were missing: its next confirm is
    out of place.
    """
    t.remove(t.said("co", "ta", "confirm", 2))
    later = [n for n, _ in enumerate(t.items) if n in _all(t, "co", "ta") and int(t.at(n).id) > 4]
    for n in later:
        one = t.at(n)
        label = str(int(one.reply_with) - 1) if one.reply_with else ""
        t.edit(n, id=str(int(one.id) - 1), reply_with=label)
    return V.OUT_OF_SEQUENCE, name(t.at(t.said("co", "ta", "confirm", 2)))


def answer_to_nothing(t: Traffic) -> Expected:
    """km answers in a conversation that nobody opened."""
    n = t.said("km", "pl", "inform-ref", 5)
    return V.OUT_OF_SEQUENCE, name(t.add(n, id="km-1-900", conversation="pl-1-900", in_reply_to=""))


def answered_twice(t: Traffic) -> Expected:
    """km answers a query again that was not asked again."""
    return V.OUT_OF_SEQUENCE, name(t.add(t.said("km", "pl", "inform-ref", 9), id="km-1-901"))


def cancelled_twice(t: Traffic) -> Expected:
    """hi cancels a task, which may cross its end, and cancels it again without waiting for the
    answer.
    """
    n, opening = t.said("co", "hi", "inform", -1), t.at(t.said("hi", "co", "request"))
    fields: dict[str, Any] = {
        "content": msgspec.UNSET,
        "performative": P.CANCEL,
        "sender": "hi",
        "receiver": "co",
        "in_reply_to": "",
        "conversation": opening.conversation,
    }
    t.add(n, id="2", reply_with="2", **fields)
    return V.OUT_OF_SEQUENCE, name(t.add(n + 1, id="3", reply_with="3", **fields))


def id_used_for_other_words(t: Traffic) -> Expected:
    """hi says another command under the number of the first."""
    n = t.said("hi", "co", "request")
    return V.OUT_OF_SEQUENCE, name(t.add(n, conversation="hi-1-2", **content(LookAround())))


def answers_what_was_not_asked(t: Traffic) -> Expected:
    """km's answer names another question."""
    return V.OUT_OF_SEQUENCE, name(
        t.edit(t.said("km", "pl", "inform-ref", 12), in_reply_to="pl-1-777")
    )


def no_conversation(t: Traffic) -> Expected:
    """A query that belongs to no conversation."""
    return V.OUT_OF_SEQUENCE, name(
        t.add(t.said("pl", "km", "query-ref", 6), id="pl-1-902", conversation="")
    )


def no_number(t: Traffic) -> Expected:
    """A durable request whose id is not a number: its receiver cannot put it in order."""
    n = t.said("hi", "co", "request")
    return V.OUT_OF_SEQUENCE, name(t.add(n, id="first", conversation="hi-1-3", reply_with="first"))


def asked_again_by_another_label(t: Traffic) -> Expected:
    """pl repeats a query that waits, with a new m_w."""
    n = t.said("pl", "km", "query-ref", 20)
    return V.OUT_OF_SEQUENCE, name(t.add(n, later_s=1e-5, id="pl-1-903", reply_with="pl-1-903"))


def agreed_after_the_result(t: Traffic) -> Expected:
    """ex tells the outcome of an act, then agrees to it."""
    first, second = t.said("ex", "ta", "agree", 3), t.said("ex", "ta", "inform", 3)
    agree, result = t.at(first), t.at(second)
    key = DESIGN.key("roco", agree), DESIGN.key("roco", result)
    t.edit(first, key[1], performative=P.INFORM, content=result.content)
    return V.OUT_OF_SEQUENCE, name(
        t.edit(second, key[0], performative=P.AGREE, content=agree.content)
    )


def spoke_after_not_understood(t: Traffic) -> Expected:
    """km says not-understood, which ends the conversation, and then answers all the same."""
    n = t.said("km", "pl", "inform-ref", 15)
    answer = t.at(n)
    t.add(
        n - 1 if isinstance(t.items[n - 1], Sample) else t.said("pl", "km", "query-ref", 19),
        later_s=1e-6,
        performative=P.NOT_UNDERSTOOD,
        sender="km",
        receiver="pl",
        conversation=answer.conversation,
        in_reply_to=answer.in_reply_to,
        reply_with="",
        reply_by=None,
        ontology="",
        id="km-1-904",
        language="reason",
        content=msgspec.Raw(msgspec.msgpack.encode({"type": "Reason", "text": "no"})),
    )
    return V.OUT_OF_SEQUENCE, name(answer)


# --- wrong channel --------------------------------------------------------------------------------


def on_another_channel(t: Traffic) -> Expected:
    """A query of the planner on the channel of the task agent."""
    n = t.said("pl", "km", "query-ref", 3)
    return V.WRONG_CHANNEL, name(t.edit(n, "roco/roco/C6/pl/km/query/query-ref"))


def in_the_name_of_another(t: Traffic) -> Expected:
    """Somebody who may write as ta says he is co."""
    n = t.said("co", "ta", "confirm", 4)
    return V.WRONG_CHANNEL, name(t.edit(n, "roco/roco/C1/ta/co/coordinate/inform"))


def another_act_than_its_key(t: Traffic) -> Expected:
    """A cancel that travels on the key of a confirm."""
    n = t.said("co", "ta", "confirm", -1)
    one = t.add(n, t.items[n].key, id="20", performative=P.CANCEL, reply_with="20", in_reply_to="")  # type: ignore[union-attr]
    return V.WRONG_CHANNEL, name(one)


# --- wrong language, ontology, content ------------------------------------------------------------


def in_another_language(t: Traffic) -> Expected:
    """A command of the person in the language of robot commands."""
    act = t.at(t.said("ta", "ex", "request"))
    one = t.edit(t.said("hi", "co", "request"), content=act.content, language=act.language)
    return V.WRONG_LANGUAGE, name(one)


def of_another_ontology(t: Traffic) -> Expected:
    """A query about another world."""
    return V.WRONG_LANGUAGE, name(t.edit(t.said("pl", "km", "query-ref", 30), ontology="Kitchen"))


def content_of_another_act(t: Traffic) -> Expected:
    """A question whose content is an answer."""
    return V.WRONG_LANGUAGE, name(
        t.edit(t.said("pl", "km", "query-ref", 31), **content(wm.Made("h-1")))
    )


def content_that_cannot_be_read(t: Traffic) -> Expected:
    """An outcome of no class of its language."""
    raw = msgspec.Raw(msgspec.msgpack.encode({"type": "Nonsense"}))
    return V.WRONG_LANGUAGE, name(t.edit(t.said("ex", "ta", "inform", 4), content=raw))


def request_without_content(t: Traffic) -> Expected:
    """An act that says not what."""
    return V.WRONG_LANGUAGE, name(t.edit(t.said("ta", "ex", "request", 5), content=msgspec.UNSET))


# --- over budget ----------------------------------------------------------------------------------


def query_too_large(t: Traffic) -> Expected:
    """A query of twice the size that its class may have."""
    one = t.edit(t.said("pl", "km", "query-ref", 33), **content(wm.ObjectPose("jar_" + 500 * "1")))
    return V.OVER_BUDGET, name(one)


def command_too_large(t: Traffic) -> Expected:
    """A person's command that is a speech."""
    one = t.edit(t.said("hi", "co", "request"), **content(PourInto("jar" + 300 * "r", "bowl")))
    return V.OVER_BUDGET, name(one)


# --- in time --------------------------------------------------------------------------------------


def answered_too_late(t: Traffic) -> Expected:
    """km answers after reply-by."""
    n = t.said("pl", "km", "query-ref", 40)
    asked = t.edit(n, reply_by=t.at(n).sent + 1e-5)
    answers = [i for i in _all(t, "km", "pl") if t.at(i).conversation == asked.conversation]
    return V.LATE, name(t.at(answers[0]))


def never_answered(t: Traffic) -> Expected:
    """km does not answer a query; its reply-by passes."""
    answer = t.remove(t.said("km", "pl", "inform-ref", 25))
    asked = [i for i in _all(t, "pl", "km") if t.at(i).conversation == answer.conversation]
    return V.UNANSWERED, name(t.at(asked[0]))


# --- not entitled ---------------------------------------------------------------------------------


def stranger(t: Traffic) -> Expected:
    """An agent that the design does not know commands the coordinator."""
    n = t.said("hi", "co", "request")
    one = t.add(
        n, "roco/roco/C2/spy/co/request/request", sender="spy", id="1", conversation="spy-1-1"
    )
    return V.NOT_ENTITLED, name(one)


def no_channel_between_them(t: Traffic) -> Expected:
    """The planner commands the robot."""
    n = t.said("ta", "ex", "request", 2)
    return V.NOT_ENTITLED, name(
        t.add(n, "roco/roco/C5/pl/ex/request/request", sender="pl", conversation="pl-1-99")
    )


def act_of_the_other_side(t: Traffic) -> Expected:
    """The robot requests acts of the task agent."""
    n = t.said("ta", "ex", "request", 2)
    one = t.add(
        n, "roco/roco/C5/ex/ta/request/request", sender="ex", receiver="ta", conversation="ex-1-99"
    )
    return V.NOT_ENTITLED, name(one)


def protocol_they_do_not_have(t: Traffic) -> Expected:
    """co queries ta."""
    n = t.said("co", "ta", "confirm", 3)
    key = "roco/roco/C1/co/ta/query/query-ref"
    one = t.add(
        n,
        key,
        performative=P.QUERY_REF,
        protocol="query",
        conversation="co-1-99",
        id="q",
        in_reply_to="",
    )
    return V.NOT_ENTITLED, name(one)


# --- malformed ------------------------------------------------------------------------------------


def no_communicate(t: Traffic) -> Expected:
    """Bytes."""
    n = t.said("co", "ta", "confirm", 3)
    item = t.items[n]
    assert isinstance(item, Sample)
    t.items.insert(n + 1, Sample(item.key, b"\xc1 hello", item.at))
    return V.MALFORMED, item.key


def _all(t: Traffic, sender: str, receiver: str) -> list[int]:
    chunks = [sender, receiver]
    return [
        n
        for n, item in enumerate(t.items)
        if isinstance(item, Sample) and item.key.split("/")[3:5] == chunks
    ]


def plants() -> Iterator[Callable[[Traffic], Expected]]:
    """All of them."""
    for function in globals().values():
        if (
            callable(function)
            and getattr(function, "__annotations__", {}).get("return") == Expected
        ):
            yield function
