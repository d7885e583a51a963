"""Detects peers that are alive but do not receive this agent: Zenoh reports no denied put to its sender.

The signs are the agent's own: a communicate without a receipt, a ping without a pong, a question that is asked again
and again, while the peer's liveliness token is there. A peer that hangs gives the same signs, and is reported as
well. Pure: time comes in as an argument; the shell looks once a second.
"""

from collections.abc import Iterator, Set

import msgspec

from agent_runtime.core.peers import Peers
from agent_runtime.core.state import CoreState
from agent_runtime.core.streams import live_subscription
from agent_runtime.core.wiring import Wiring

PATIENCE_S = {"said": 3.0, "pinged": 10.0, "asked": 30.0}
"""A receipt takes ms, and re-sending goes up to every 2 s; on a loaded machine a first pong is late; km may have to
wait with an answer for ex's first look around (estimates)."""


class Unheard(msgspec.Struct, frozen=True):
    """Messages to `peer` on `channel` have had no effect since `since` [unix s]. `what`: "said", "asked", "pinged"."""

    peer: str
    channel: str
    what: str
    since: float


_WORDS = {
    "said": "what {agent} says to {peer} on {channel} is not received since {s:.0f} s",
    "pinged": "{agent} and {peer} do not hear each other on {channel} since {s:.0f} s",
    "asked": "what {agent} asks {peer} on {channel} is not answered since {s:.0f} s",
}
WHY = "perhaps the rules of {peer} deny it, or {peer} hangs"


def words(agent: str, one: Unheard, now: float) -> str:
    """Return a sentence for people: sender, receiver, duration, possible cause."""
    said = _WORDS[one.what].format(agent=agent, peer=one.peer, channel=one.channel, s=max(0.0, now - one.since))
    return f"{said}: {WHY.format(peer=one.peer)}"


class Watch:
    """State of one agent. `now`: unheard messages; `look` returns the changes: (what, whether it is still so)."""

    def __init__(self, wiring: Wiring) -> None:
        self.now: tuple[Unheard, ...] = ()
        self._wiring = wiring
        self._waits: dict[tuple[str, str, str], tuple[object, float]] = {}
        self._receipts: dict[str, int] = {}

    def receipted(self, peer: str) -> None:
        """Note a receipt: the peer hears this agent. The peer may still wait with messages it does not take now."""
        self._receipts[peer] = self._receipts.get(peer, 0) + 1

    def look(
        self, state: CoreState, unanswered: Set[tuple[str, bytes]], peers: Peers, now: float
    ) -> list[tuple[Unheard, bool]]:
        """Compare waiting messages with those of the last look; what still waits is reported when old enough."""
        before = {(one.peer, one.channel, one.what): one for one in self.now}
        waits: dict[tuple[str, str, str], tuple[object, float]] = {}
        for peer, channel, what, mark in self._waiting(state, unanswered) if peers.up else ():
            if peer in peers.alive:
                sign = (peers.alive[peer], mark, self._receipts.get(peer) if what == "said" else None)
                last = self._waits.get((peer, channel, what))
                waits[peer, channel, what] = last if last is not None and last[0] == sign else (sign, now)
        self._waits = waits
        self.now = tuple(
            Unheard(*place, since) for place, (_, since) in waits.items() if now - since >= PATIENCE_S[place[2]]
        )
        still = {(one.peer, one.channel, one.what) for one in self.now}
        fresh = [(one, True) for one in self.now if (one.peer, one.channel, one.what) not in before]
        return fresh + [(one, False) for place, one in before.items() if place not in still]

    def _waiting(self, state: CoreState, unanswered: Set[tuple[str, bytes]]) -> Iterator[tuple[str, str, str, object]]:
        """Return peer, channel, what, and the oldest waiting message of its kind."""
        for peer, channel in unanswered:
            yield peer, channel.decode(), "pinged", None
        for peer, sent in state.outbox.items():
            yield peer, self._channel(peer, sent[0].communicate.protocol), "said", sent[0].number
        for peer, due in state.due.items():
            held = live_subscription(state, peer) if due else None
            if held is not None:
                oldest = min(one.version for one in due.values())
                yield peer, self._channel(peer, held.conversation.protocol), "said", oldest
        oldest_of: dict[str, tuple[float, str, str]] = {}
        for name, ask in state.soft.asks.items():
            one = (ask.communicate.sent or 0.0, name, ask.communicate.protocol)
            oldest_of[ask.communicate.receiver] = min(one, oldest_of.get(ask.communicate.receiver, one))
        for peer, (_, name, protocol) in oldest_of.items():
            yield peer, self._channel(peer, protocol), "asked", name

    def _channel(self, peer: str, protocol: str) -> str:
        link = self._wiring.link(peer, protocol)
        return link.channel if link is not None else "?"
