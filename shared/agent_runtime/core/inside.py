"""Inside of an agent, for people who look into it: its inbox, open conversations, and last steps. Pure."""

from collections import deque

import msgspec

from agent_runtime.core.effects import Act, Deed
from agent_runtime.core.events import Arrived
from agent_runtime.core.state import CoreState, Held, Waiting

SHOWN = 16
"""Most that is shown of each; estimate: a screen."""
STEPS = 8
"""Last steps that are kept; estimate."""


class Waits(msgspec.Struct, frozen=True):
    """An entry of the inbox. `what`: the act, or the event's class where it is not a communicate."""

    what: str
    peer: str = ""
    protocol: str = ""


class Talk(msgspec.Struct, frozen=True):
    """An open conversation, as this agent sees it. `reply_by`: unix time [s], None: never."""

    id: str
    peer: str
    protocol: str
    role: str
    state: str
    reply_by: float | None = None


class Did(msgspec.Struct, frozen=True):
    """A step in the words of the design: what was taken, what was said, the states. `at`: unix time [s]."""

    at: float
    before: str
    event: str
    said: tuple[str, ...]
    after: str


class Inside(msgspec.Struct, frozen=True):
    """`inbox`, `talks`: the first of `waiting` and `open`; `steps`: the last, oldest first."""

    waiting: int
    open: int
    inbox: tuple[Waits, ...]
    talks: tuple[Talk, ...]
    steps: tuple[Did, ...]


def looked_into(state: CoreState, steps: "deque[tuple[float, Deed]]") -> Inside:
    """Return what an agent has at hand."""
    held = (*state.conversations.values(), *state.soft.conversations.values())
    inbox = state.soft.inbox
    return Inside(
        len(inbox),
        len(held),
        tuple(map(_waits, inbox[:SHOWN])),
        tuple(map(_talk, held[:SHOWN])),
        tuple(_did(at, deed) for at, deed in steps),
    )


def _waits(one: Waiting) -> Waits:
    if isinstance(one.event, Arrived):
        said = one.event.communicate
        return Waits(said.performative.value, said.sender, said.protocol)
    return Waits(type(one.event).__name__, one.peer)


def _talk(held: Held) -> Talk:
    talk = held.conversation
    return Talk(talk.id, talk.peer, talk.protocol, talk.role.value, str(talk.state), held.reply_by)


def _did(at: float, deed: Deed) -> Did:
    event = deed.event if deed.took is None else _act(deed.took)
    return Did(at, deed.before, event, tuple(map(_act, deed.said)), deed.after)


def _act(act: Act) -> str:
    use, performative, kind = act
    return f"{use} {performative}[{kind}]" if kind else f"{use} {performative}"
