"""Liveness of peers, told apart from links that this agent closed itself: tokens in, PeerChanged and LinkChanged out.

A token that vanishes is believed at once: each neighbour's comes by a link of its own. Where the agent opens all its
links again, with renewed keys, tokens come back by themselves; one that does not within RETURN_S belongs to an agent
that died meanwhile.

Believed is the highest incarnation whose token is there. Whoever has a peer's key may declare a higher one than the
peer itself: when that token is gone, the peer's own counts again. A journal's name stays believed while a token with it
is there or may come back; then the name that appeared last is believed. Pure: time comes in as an argument.
"""

from agent_runtime.core.events import LinkChanged, PeerChanged

RETURN_S = 3.0
"""Reconnection is tried at least every 0.5 s, a cut-off peer is dropped after the lease of 2 s; a little more."""
HASTE_S = 0.2
"""From one news of a peer to the next; a process takes 0.8 s to come back (measured), so only floods wait."""
TOKENS = 1024
"""Tokens of a peer that are remembered; estimate: one or two are there, of others a memory is needed."""


class Peers:
    """Of one agent; `known` are those it talks to. `alive`: the incarnation that is believed of each."""

    def __init__(self, known: tuple[str, ...]) -> None:
        self._known = frozenset(known)
        self.up = False
        self.alive: dict[str, int] = {}
        self._journal: dict[str, str] = {}
        self._tokens: dict[str, dict[str, set[int]]] = {}
        self._doubted: dict[str, float] = {}
        self._told: dict[str, float] = {}
        self._later: dict[str, float] = {}

    def token(self, agent: str, incarnation: int, alive: bool, now: float, journal: str = "") -> list[PeerChanged]:
        """A token appeared or vanished. `journal`: the name in it."""
        if agent not in self._known:
            return []
        lives = self._tokens.setdefault(agent, {})
        there = lives.get(journal, set())
        if alive and (incarnation in there or sum(map(len, lives.values())) < TOKENS):
            newest = incarnation >= max(there, default=0)
            if newest:  # this name is the one that appeared last
                lives.pop(journal, None)
            lives[journal] = there | {incarnation}
            return self._news(agent, now) if newest and journal == self._name(agent) else []
        if not alive and incarnation in there:
            there.discard(incarnation)
            if not there:
                del lives[journal]
            if (self._journal.get(agent), self.alive.get(agent)) == (journal, incarnation) and self.up:
                self._doubted.setdefault(agent, now)
        return []

    def links(self, up: bool, now: float) -> list[LinkChanged]:
        """The agent opened its links, or closed them."""
        if up == self.up:
            return []
        self.up = up
        self._doubted = dict.fromkeys(self.alive, now + RETURN_S) if up else {}
        if not up:  # all tokens come again
            self._tokens.clear()
            self._later.clear()
        return [LinkChanged(up)]

    def gone(self, now: float) -> list[PeerChanged]:
        """News that had to wait: whose token did not come back in time, and who had too much news."""
        news = [one for agent in _due(self._later, now) for one in self._news(agent, now)]
        for agent in _due(self._doubted, now):
            del self._doubted[agent]
            lives = self._tokens.get(agent, {})
            if self.alive[agent] in lives.get(self._journal[agent], ()):
                continue
            if lives:
                news += self._news(agent, now)
            else:
                del self.alive[agent], self._journal[agent]
                news.append(PeerChanged(agent, None))
        return news

    def _news(self, agent: str, now: float) -> list[PeerChanged]:
        """Believe the highest life of the journal's name that counts, unless there was news just now: then later."""
        self._later.pop(agent, None)
        lives = self._tokens.get(agent, {})
        name = self._name(agent)
        if name is None:
            return []
        at = self._told.get(agent, now - HASTE_S) + HASTE_S
        if at > now:
            self._later[agent] = at
            return []
        self._told[agent] = now
        self._doubted.pop(agent, None)
        self._journal[agent], self.alive[agent] = name, max(lives[name])
        return [PeerChanged(agent, self.alive[agent], name)]

    def _name(self, agent: str) -> str | None:
        """Return the journal's name that counts: the believed one, else the last; None where neither is known yet."""
        lives, believed = self._tokens.get(agent, {}), self._journal.get(agent)
        if believed in lives:
            return believed
        awaited = agent in self._doubted or not self.up
        return None if believed is not None and awaited else next(reversed(lives), None)

    @property
    def look_at(self) -> float | None:
        """Return the time at which to ask `gone` next."""
        return min((*self._doubted.values(), *self._later.values()), default=None)


def _due(times: dict[str, float], now: float) -> list[str]:
    return [agent for agent, at in times.items() if at <= now]
