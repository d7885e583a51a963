"""Reasons for a task's end: the chain of communicates that led to it, and the agents that were away
meanwhile.

Every sentence repeats what was recorded: who said what, with the reason given; a step's event where
no communicate led to it. Pure.
"""

from collections.abc import Iterator

import msgspec

from operate.tracing.trace import BAD, SETTLED, Identity, Known, Message, Span, Trace

MOST = 12
"""Facts of a chain, newest ones; estimate: what people read."""
CANCEL = "cancel"
EVENTS = {
    "Local": (
        "{agent} was told from outside the agents: by a person, a device or a process of its own"
    ),
    "Late": "{agent} had waited for an answer until its time was over ({about})",
    "Broken": "{agent} saw the conversation break ({about})",
    "Woken": "a time had come that {agent} had set itself",
    "Started": "{agent} was started again",
    "PeerChanged": "{agent} saw that an agent came or went ({about})",
    "Settled": "all that {agent} had observed had been received",
}
"""Events of a step that took no communicate, in words."""


class Fact(msgspec.Struct, frozen=True, omit_defaults=True):
    """A sentence about something that was recorded. `at`: unix time [s]; `record`: where it
    stands.
    """

    at: float
    text: str
    record: str = ""


class Passage(msgspec.Struct, frozen=True):
    """Facts under a title, in the order in which they are to be read."""

    title: str
    facts: tuple[Fact, ...]


class Why(msgspec.Struct, frozen=True):
    """The answer to "why?". `about`: a task or a thing; `text`: what it is, and what became of it;
    `begin`: of the run [unix s]. `sentence`: the answer for a person who knows no robots, "" of a
    system that has none.
    """

    about: str
    text: str
    begin: float
    passages: tuple[Passage, ...]
    sentence: str = ""


def record(one: Message) -> str:
    """Return where a communicate stands in the recording."""
    return f"{one.channel} {one.sender} > {one.receiver} {one.performative}, id {one.id}"


def message_fact(one: Message) -> Fact:
    """Return that something was said, with its reason or its content in a few words."""
    said = f": {content_text(one)}" if content_text(one) else ""
    return Fact(
        one.sent, f"{one.sender} said {one.performative} to {one.receiver}{said}", record(one)
    )


def content_text(one: Message) -> str:
    """Return the content of a communicate in a few words, with the whole reason where it gives
    one.
    """
    return ": ".join(filter(None, (one.text, one.reason)))


def ending(trace: Trace, span: Span) -> Passage:
    """Return what led to the end of a conversation, or to its newest message: the end first, then
    its causes.
    """
    chain = list(_chain(trace.messages, span.last, span.messages[0].identity))
    shown = [one for n, one in enumerate(chain) if n < 2 or notable(one) or n == len(chain) - 1]
    facts = [_because(message_fact(one), one, chain, n) for n, one in enumerate(shown[:MOST])]
    first = chain[-1]
    event, _, about = first.event.partition(" ")
    if first.cause is None and event in EVENTS:
        words = EVENTS[event].format(agent=first.sender, about=about.replace("_", " "))
        facts.append(
            Fact(first.sent, f"before that {words}", f"step of {first.sender}: {first.event}")
        )
    return Passage("how it ended" if span.ended else "how it is now", tuple(facts))


def notable(one: Message) -> bool:
    """Whether a communicate is worth telling in a chain of many: a no, a cancel, or one that gives
    a reason.
    """
    return one.performative in BAD or one.performative == CANCEL or bool(one.reason)


def _because(fact: Fact, one: Message, chain: list[Message], n: int) -> Fact:
    if not n:
        return fact
    effect = chain[chain.index(one) - 1]
    link = "before that" if effect.known == Known.TIME else "because"
    return msgspec.structs.replace(fact, text=f"{link} {fact.text}")


def _chain(said: dict[Identity, Message], last: Message, opening: Identity) -> Iterator[Message]:
    """Yield a message, its cause, the cause of that, ..., to the opening of the task or to where
    only time tells more.

    A link by time is the last one, but for what an agent said when its observations had been
    received.
    """
    seen: set[Identity] = set()
    at: Message | None = last
    while at is not None and at.identity not in seen:
        yield at
        seen.add(at.identity)
        before = said.get(at.cause) if at.cause is not None and at.identity != opening else None
        if before is not None and at.known == Known.TIME and not at.event.startswith(SETTLED):
            yield before
            return
        at = before


def absent(trace: Trace, span: Span) -> Passage | None:
    """Return who was away while a task was open; None where nobody was."""
    end = max(one.end for _, one in trace.below(span)) if span.ended else float("inf")
    gone = [
        one for one in trace.away if one.start <= end and (one.end is None or one.end >= span.start)
    ]
    facts = []
    for one in gone:
        if span.ended and one.end is None and one.start > span.end:
            continue
        how = ", and did not come back"
        if one.end is not None:
            how = f" for {one.end - one.start:.1f} s"
        text = f"{one.agent} was gone{how}" + (f": {one.fault} on purpose" if one.fault else "")
        facts.append(Fact(one.start, text, f"liveliness token of {one.agent}"))
    return Passage("who was away", tuple(facts)) if facts else None
