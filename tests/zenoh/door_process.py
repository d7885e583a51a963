"""An agent's door in a process of its own, with the agent's keys.

`door_process.py ENDPOINT KEYS LIFE` agrees to what guests ask, and ends each conversation as a line
of its input says: `inform`, `failure`, `inform cancel`. What it hears it prints.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh

from agent_runtime.core.wiring import communicate_key
from agent_runtime.io.guests import Asked, Door
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import open_client, put
from companion.design import DESIGN, LANGUAGES
from companion.languages.cmd import TaskReport, TaskState
from fipa_codec.communicate import Communicate, encode
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P

SYSTEM, AGENT = "roco", "hi"
STATES = {
    "inform": TaskState.DONE,
    "failure": TaskState.FAILED,
    "inform cancel": TaskState.CANCELLED,
}


class Post:
    """The outlet of the agent, as far as a door needs it."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session, self._declared = session, list[Any]()

    def hear_guests(self, on_data: Callable[[str, bytes], None]) -> None:
        """Of the bidder."""
        for use in DESIGN.uses_of("bidder"):
            if use.participant == AGENT:
                key = f"roco/{SYSTEM}/{use.channel}/bidder/{AGENT}/*/*"
                heard = self._session.declare_subscriber(
                    key, lambda one: on_data(str(one.key_expr), one.payload.to_bytes())
                )
                self._declared.append(heard)

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        """Nothing beside communicates: the bidder asks for nothing again."""

    def say_to_guest(self, one: Communicate) -> None:
        """At the router."""
        channel = DESIGN.guest_use(one.receiver, one.sender, one.protocol).channel
        key = communicate_key(
            SYSTEM, channel, one.sender, one.receiver, one.protocol, one.performative
        )
        put(self._session, key, encode(one))


def main(endpoint: str, keys: str, life: str) -> None:
    """Until its input ends."""
    session = open_client(endpoint, lambda: False, tls=client_tls(Path(keys), AGENT))
    assert session is not None
    open_ = list[str]()

    def asked(one: Asked) -> None:
        print("cancel" if one.content is None else type(one.content).__name__, flush=True)
        if one.content is not None:
            open_.append(one.conversation)
            door.say(one.conversation, P.AGREE, TaskReport(TaskState.WAITING))
            door.say(one.conversation, P.INFORM, TaskReport(TaskState.RUNNING), Kind.PROGRESS)

    door = Door(DESIGN, LANGUAGES, AGENT, Post(session), asked)  # type: ignore[arg-type]
    alive = DESIGN.signal_key("alive", system=SYSTEM, owner=AGENT, incarnation=life)
    token = session.liveliness().declare_token(alive)
    print("ready", flush=True)
    for line in sys.stdin:
        act, _, kind = line.strip().partition(" ")
        report = TaskReport(STATES[line.strip()])
        door.say(open_.pop(), P(act), report, Kind.CANCEL if kind else Kind.PLAIN)
    del token


if __name__ == "__main__":
    main(*sys.argv[1:])
