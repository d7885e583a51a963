"""Liveness of peers, told apart from "I lost the router": tokens and transport events in, PeerChanged and LinkChanged
out.

When the router dies, all tokens vanish within 5 ms, before or after the transport's own end is told; so a vanished
token is believed only after GRACE_S with the router still there. After a reconnect tokens come back by themselves; one
that does not within RETURN_S belongs to an agent that died meanwhile. Pure: time comes in as an argument.
"""

from agent_runtime.core.events import LinkChanged, PeerChanged

GRACE_S = 0.05
"""The transport's end was told 1-9 ms after a router was killed (measured); several times that."""
RETURN_S = 3.0
"""Reconnection is tried at least every 0.5 s, a cut-off peer is dropped after the lease of 2 s; a little more."""


class Peers:
    """Of one agent; `known` are those it talks to."""

    def __init__(self, known: tuple[str, ...]) -> None:
        self._known = frozenset(known)
        self.up = False
        self.alive: dict[str, int] = {}
        self._doubted: dict[str, float] = {}

    def token(self, agent: str, incarnation: int, alive: bool, now: float) -> list[PeerChanged]:
        """A token appeared or vanished."""
        if agent not in self._known:
            return []
        if alive and incarnation >= self.alive.get(agent, 0):
            self.alive[agent] = incarnation
            self._doubted.pop(agent, None)
            return [PeerChanged(agent, incarnation)]
        if not alive and self.alive.get(agent) == incarnation and self.up:
            self._doubted.setdefault(agent, now + GRACE_S)
        return []

    def router(self, up: bool, now: float) -> list[LinkChanged]:
        """The transport to the router opened or closed."""
        if up == self.up:
            return []
        self.up = up
        self._doubted = dict.fromkeys(self.alive, now + RETURN_S) if up else {}
        return [LinkChanged(up)]

    def gone(self, now: float) -> list[PeerChanged]:
        """Those whose token did not come back in time."""
        dead = [agent for agent, at in self._doubted.items() if at <= now]
        for agent in dead:
            del self._doubted[agent], self.alive[agent]
        return [PeerChanged(agent, None) for agent in dead]

    @property
    def look_at(self) -> float | None:
        """Return the time at which to ask `gone` next."""
        return min(self._doubted.values(), default=None)
