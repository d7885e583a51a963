"""Violations planted into a recording: communicates edited, added or removed, each as somebody
wrong would say it.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from synthetic import language_of

from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from companion.languages import wm
from companion.tasks.look_around.command import LookAround
from companion.tasks.pour.command import PourInto
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate, decode, encode
from fipa_codec.performatives import Performative as P
from operate.judging.judged import Judging
from operate.recording import mcap_file
from operate.recording.records import Record, Spoken, understood
from operate.verdict_lines import Judged
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
        return self.all(sender, receiver, act)[nth]

    def all(self, sender: str, receiver: str, act: str = "") -> list[int]:
        """Return the indices of what one says to the other."""
        return [
            n
            for n, item in enumerate(self.items)
            if isinstance(item, Sample)
            and item.key.split("/")[3:5] == [sender, receiver]
            and item.key.endswith(f"/{act}" if act else "")
        ]

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

    def lines(self) -> list[Judged]:
        """Return all that the judge says."""
        judging = Judging(SYSTEM)
        lines = [line for item in self.items for line in judging.lines(_record(item))]
        return [*lines, *judging.finish()]

    def found(self) -> list[Expected]:
        """Return the judge's findings against the design."""
        return [
            (V(one.verdict), name(one) if one.sender else one.key)
            for one in self.lines()
            if one.violation
        ]

    def verdicts(self) -> list[str]:
        """All verdicts."""
        return [one.verdict for one in self.lines()]


def name(one: Communicate | Judged) -> str:
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


class Plant(NamedTuple):
    """One communicate of the pour that is changed where it stands, or said again a little later
    with these fields; the judge's verdict about it. `key`: another one than the design wants.
    """

    why: str
    verdict: V
    place: tuple[str, str, str, int]
    fields: Callable[[Traffic], dict[str, Any]]
    again: bool = False
    key: str = ""
    later_s: float = 0.001

    def __call__(self, t: Traffic) -> Expected:
        n, fields = t.said(*self.place), self.fields(t)
        if self.again:
            return self.verdict, name(t.add(n, self.key, self.later_s, **fields))
        return self.verdict, name(t.edit(n, self.key, **fields))


def fixed(**fields: Any) -> Callable[[Traffic], dict[str, Any]]:
    """The same fields in any traffic."""
    return lambda _: fields


def of_act(t: Traffic) -> dict[str, Any]:
    """Content and language of a robot command."""
    act = t.at(t.said("ta", "ex", "request"))
    return {"content": act.content, "language": act.language}


COMMAND = ("hi", "co", "request", 0)
NONSENSE = msgspec.Raw(msgspec.msgpack.encode({"type": "Nonsense"}))
OF_AGENTS = (
    # out of sequence
    Plant("ex tells the outcome of an act once more, under a new number", V.OUT_OF_SEQUENCE,
          ("ex", "ta", "inform", -1), fixed(id="29"), again=True),
    Plant("co confirms the final report again", V.OUT_OF_SEQUENCE,
          ("co", "ta", "confirm", -1), fixed(id="20"), again=True),
    Plant("km answers in a conversation that nobody opened", V.OUT_OF_SEQUENCE,
          ("km", "pl", "inform-ref", 5),
          fixed(id="km-1-900", conversation="pl-1-900", in_reply_to=""), again=True),
    Plant("km answers a query again that was not asked again", V.OUT_OF_SEQUENCE,
          ("km", "pl", "inform-ref", 9), fixed(id="km-1-901"), again=True),
    Plant("hi says another command under the number of the first", V.OUT_OF_SEQUENCE, COMMAND,
          lambda _: {"conversation": "hi-1-2", **content(LookAround())}, again=True),
    Plant("km's answer names another question", V.OUT_OF_SEQUENCE,
          ("km", "pl", "inform-ref", 12), fixed(in_reply_to="pl-1-777")),
    Plant("a query belongs to no conversation", V.OUT_OF_SEQUENCE,
          ("pl", "km", "query-ref", 6), fixed(id="pl-1-902", conversation=""), again=True),
    Plant("the id of a durable request is no number: nobody can put it in order",
          V.OUT_OF_SEQUENCE, COMMAND,
          fixed(id="first", conversation="hi-1-3", reply_with="first"), again=True),
    Plant("pl repeats a query that waits, with a new m_w", V.OUT_OF_SEQUENCE,
          ("pl", "km", "query-ref", 20), fixed(id="pl-1-903", reply_with="pl-1-903"),
          again=True, later_s=1e-5),
    # wrong channel
    Plant("a query of the planner is on the channel of the task agent", V.WRONG_CHANNEL,
          ("pl", "km", "query-ref", 3), fixed(), key="roco/roco/C6/pl/km/query/query-ref"),
    Plant("somebody who may write as ta says he is co", V.WRONG_CHANNEL,
          ("co", "ta", "confirm", 4), fixed(), key="roco/roco/C1/ta/co/coordinate/inform"),
    Plant("a cancel travels on the key of a confirm", V.WRONG_CHANNEL,
          ("co", "ta", "confirm", -1),
          fixed(id="20", performative=P.CANCEL, reply_with="20", in_reply_to=""),
          again=True, key="roco/roco/C1/co/ta/coordinate/confirm"),
    # wrong language, ontology, content
    Plant("a command of the person is in the language of robot commands", V.WRONG_LANGUAGE,
          COMMAND, of_act),
    Plant("a query is about another world", V.WRONG_LANGUAGE,
          ("pl", "km", "query-ref", 30), fixed(ontology="Kitchen")),
    Plant("the content of a question is an answer", V.WRONG_LANGUAGE,
          ("pl", "km", "query-ref", 31), lambda _: content(wm.Made("h-1"))),
    Plant("an outcome is of no class of its language", V.WRONG_LANGUAGE,
          ("ex", "ta", "inform", 4), fixed(content=NONSENSE)),
    Plant("an act says not what", V.WRONG_LANGUAGE,
          ("ta", "ex", "request", 5), fixed(content=msgspec.UNSET)),
    # over budget
    Plant("a query has twice the size that its class may have", V.OVER_BUDGET,
          ("pl", "km", "query-ref", 33), lambda _: content(wm.ObjectPose("jar_" + 500 * "1"))),
    Plant("a person's command is a speech", V.OVER_BUDGET, COMMAND,
          lambda _: content(PourInto("jar" + 300 * "r", "bowl"))),
    # not entitled
    Plant("an agent that the design does not know commands the coordinator", V.NOT_ENTITLED,
          COMMAND, fixed(sender="spy", id="1", conversation="spy-1-1"), again=True,
          key="roco/roco/C2/spy/co/request/request"),
    Plant("the planner commands the robot", V.NOT_ENTITLED, ("ta", "ex", "request", 2),
          fixed(sender="pl", conversation="pl-1-99"), again=True,
          key="roco/roco/C5/pl/ex/request/request"),
    Plant("the robot requests acts of the task agent", V.NOT_ENTITLED, ("ta", "ex", "request", 2),
          fixed(sender="ex", receiver="ta", conversation="ex-1-99"), again=True,
          key="roco/roco/C5/ex/ta/request/request"),
    Plant("co queries ta", V.NOT_ENTITLED, ("co", "ta", "confirm", 3),
          fixed(performative=P.QUERY_REF, protocol="query", conversation="co-1-99", id="q",
                in_reply_to=""),
          again=True, key="roco/roco/C1/co/ta/query/query-ref"),
)  # fmt: skip


def confirm_forgotten(t: Traffic) -> Expected:
    """co never confirms a report, and numbers on as if nothing were missing: its next confirm is
    out of place.
    """
    t.remove(t.said("co", "ta", "confirm", 2))
    for n in (n for n in t.all("co", "ta") if int(t.at(n).id) > 4):
        one = t.at(n)
        label = str(int(one.reply_with) - 1) if one.reply_with else ""
        t.edit(n, id=str(int(one.id) - 1), reply_with=label)
    return V.OUT_OF_SEQUENCE, name(t.at(t.said("co", "ta", "confirm", 2)))


def cancelled_twice(t: Traffic) -> Expected:
    """hi cancels a task, which may cross its end, and cancels it again without waiting for the
    answer.
    """
    n, opening = t.said("co", "hi", "inform", -1), t.at(t.said("hi", "co", "request"))
    fields: dict[str, Any] = {
        "content": msgspec.UNSET, "performative": P.CANCEL, "sender": "hi", "receiver": "co",
        "in_reply_to": "", "conversation": opening.conversation,
    }  # fmt: skip
    t.add(n, id="2", reply_with="2", **fields)
    return V.OUT_OF_SEQUENCE, name(t.add(n + 1, id="3", reply_with="3", **fields))


def agreed_after_the_result(t: Traffic) -> Expected:
    """ex tells the outcome of an act, then agrees to it."""
    first, second = t.said("ex", "ta", "agree", 3), t.said("ex", "ta", "inform", 3)
    agree, result = t.at(first), t.at(second)
    key = DESIGN.key("roco", agree), DESIGN.key("roco", result)
    t.edit(first, key[1], performative=P.INFORM, content=result.content)
    wrong = t.edit(second, key[0], performative=P.AGREE, content=agree.content)
    return V.OUT_OF_SEQUENCE, name(wrong)


def spoke_after_not_understood(t: Traffic) -> Expected:
    """km says not-understood, which ends the conversation, and then answers all the same."""
    n = t.said("km", "pl", "inform-ref", 15)
    answer, before = t.at(n), isinstance(t.items[n - 1], Sample)
    no = msgspec.Raw(msgspec.msgpack.encode({"type": "Reason", "text": "no"}))
    t.add(
        n - 1 if before else t.said("pl", "km", "query-ref", 19), later_s=1e-6,
        performative=P.NOT_UNDERSTOOD, sender="km", receiver="pl", id="km-1-904",
        conversation=answer.conversation, in_reply_to=answer.in_reply_to, reply_with="",
        reply_by=None, ontology="", language="reason", content=no,
    )  # fmt: skip
    return V.OUT_OF_SEQUENCE, name(answer)


def answered_too_late(t: Traffic) -> Expected:
    """km answers after reply-by."""
    n = t.said("pl", "km", "query-ref", 40)
    asked = t.edit(n, reply_by=t.at(n).sent + 1e-5)
    answers = [i for i in t.all("km", "pl") if t.at(i).conversation == asked.conversation]
    return V.LATE, name(t.at(answers[0]))


def never_answered(t: Traffic) -> Expected:
    """km does not answer a query; its reply-by passes."""
    answer = t.remove(t.said("km", "pl", "inform-ref", 25))
    asked = [i for i in t.all("pl", "km") if t.at(i).conversation == answer.conversation]
    return V.UNANSWERED, name(t.at(asked[0]))


def no_communicate(t: Traffic) -> Expected:
    """Bytes."""
    n = t.said("co", "ta", "confirm", 3)
    item = t.items[n]
    assert isinstance(item, Sample)
    t.items.insert(n + 1, Sample(item.key, b"\xc1 hello", item.at))
    return V.MALFORMED, item.key


PLANTS: dict[str, Callable[[Traffic], Expected]] = {
    **{one.why: one for one in OF_AGENTS},
    **{
        one.__name__: one
        for one in (
            confirm_forgotten, cancelled_twice, agreed_after_the_result,
            spoke_after_not_understood, answered_too_late, never_answered, no_communicate,
        )
    },
}  # fmt: skip
