"""The heartbeat of an agent: a file and a message, each second and after each change, that say what
it is at.

Where there is no room for a new file it is written over the old one, since who stands still is
killed.
"""

from collections import deque
from contextlib import suppress
from pathlib import Path

import msgspec

from agent_runtime.core.control import Answer, Value
from agent_runtime.core.events import Act, Arrived, Deed
from agent_runtime.core.peers import Unheard
from agent_runtime.core.state import CoreState
from agent_runtime.io.journal import overwrite
from agent_runtime.io.run_files import heartbeat_file, ready_file, write_whole

# --- Inside of an agent, for people who look into it: its inbox, open conversations, and last steps


SHOWN = 16
"""Most that is shown of each; estimate: a screen."""
STEPS = 8
"""Last steps that are kept; estimate."""


class Waits(msgspec.Struct, frozen=True):
    """An entry of the inbox. `what`: the act, or the event's class where it is not a
    communicate.
    """

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
    """A step in the words of the design: what was taken, what was said, the states. `at`: unix time
    [s].
    """

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
    """What an agent has at hand."""
    held = (*state.conversations.values(), *state.soft.conversations.values())
    waits, talks = [], []
    for waiting in state.soft.inbox[:SHOWN]:
        if isinstance(waiting.event, Arrived):
            said = waiting.event.communicate
            waits.append(Waits(said.performative.value, said.sender, said.protocol))
        else:
            waits.append(Waits(type(waiting.event).__name__, waiting.peer))
    for one in held[:SHOWN]:
        talk = one.conversation
        talks.append(
            Talk(talk.id, talk.peer, talk.protocol, talk.role.value, str(talk.state), one.reply_by)
        )
    did = []
    for at, deed in steps:
        event = deed.event if deed.took is None else _act(deed.took)
        did.append(Did(at, deed.before, event, tuple(map(_act, deed.said)), deed.after))
    return Inside(len(state.soft.inbox), len(held), tuple(waits), tuple(talks), tuple(did))


def _act(act: Act) -> str:
    use, performative, kind = act
    return f"{use} {performative}[{kind}]" if kind else f"{use} {performative}"


# --- The heartbeat --------------------------------------------------------------------------------


class Heartbeat(msgspec.Struct, frozen=True):
    """<agent>.heartbeat.json and the key `_/state/<agent>`: state and work of the agent. `at`: unix
    seconds.

    `up`: whether it reaches the router, which is for tools. `inside`: what it has at hand; in the
    file only. `trouble`: why it waits, in words.
    """

    agent: str
    pid: int
    incarnation: int
    step: int
    state: str
    ready: bool
    up: bool
    peers: dict[str, int]
    unreceipted: dict[str, int]
    due: dict[str, int]
    counts: dict[str, int]
    at: float
    unheard: tuple[Unheard, ...] = ()
    paused: bool = False
    level: str = ""
    parameters: dict[str, Value] = {}
    answer: Answer = Answer()
    inside: Inside | None = None
    trouble: str = ""


def write(run: Path, whole: Heartbeat, short: Heartbeat) -> None:
    """Write the heartbeat, and once it is ready the file that says so; `short`: where there is
    little room.
    """
    file, ready = heartbeat_file(run, whole.agent), ready_file(run, whole.agent)
    try:
        write_whole(file, msgspec.json.encode(whole))
        if whole.ready and not ready.exists():
            write_whole(ready, str(whole.incarnation).encode())
    except OSError:
        with suppress(OSError):
            data = msgspec.json.encode(msgspec.structs.replace(short, counts={}, parameters={}))
            overwrite(file, data)
