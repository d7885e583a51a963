"""A router, or an agent's links, with keys and rights in this process, and sessions of every
identity; what the design allows there, cell by cell.

The rights of a guard do not hold for a session of its own process: so that session tries each side
of a cell alone. It hears all that is let in (put, token), answers every question that is let in
(query), asks whatever is declared (queryable) and says all that may be heard (subscribe, watch).
"""

from pathlib import Path
from typing import Any

import zenoh

from agent_runtime.io import issuing
from agent_runtime.io.secured import client_tls, links_tls, router_tls
from agent_runtime.io.sessions import client_config, free_endpoint, open_links, open_router
from companion.design import DESIGN
from fipa_codec.performatives import Performative
from topdown.model.design import Design
from topdown.model.elements import Signal
from topdown.model.rights import access_control, identities, links_control

SYSTEM = "guarded"
FENCE = "fence"
"""Keys that everybody may use, beside the design's: what came before a word on them has been
decided.
"""
_ALL = ("put", "declare_subscriber", "query", "reply", "declare_queryable", "liveliness_token",
        "liveliness_query",
        "declare_liveliness_subscriber")  # fmt: skip


def guarded_rights(agent: str = "") -> dict[str, Any]:
    """The rules of an agent, or of the router, and the fence."""
    names = {name: name for name in identities(DESIGN)}
    rules = links_control(DESIGN, SYSTEM, agent, names) if agent else access_control(DESIGN, SYSTEM)
    subjects = [{"id": name, "cert_common_names": [name]} for name in names]
    fence = {"id": FENCE, "permission": "allow", "flows": ["ingress", "egress"],
             "messages": list(_ALL),
             "key_exprs": [f"{FENCE}/**"]}  # fmt: skip
    policies = [*rules["policies"], {"subjects": list(names), "rules": [FENCE]}]
    return rules | {"rules": [*rules["rules"], fence], "subjects": subjects, "policies": policies}


class Guarded:
    """The guard, which is the router or an agent's links, and whoever connects; `close` ends all of
    it.
    """

    def __init__(self, folder: Path, agent: str = "", access: dict[str, Any] | None = None) -> None:
        self.folder, self.endpoint = folder, free_endpoint().replace("tcp/", "tls/")
        issuing.issue(folder, DESIGN, (SYSTEM,))
        rules = access or guarded_rights(agent)
        if agent:
            self.guard = open_links(self.endpoint, (), links_tls(folder, agent), rules)
        else:
            self.guard = open_router(self.endpoint, router_tls(folder), rules)
        self._sessions = [self.guard]

    def session(self, identity: str, tls: dict[str, Any] | None = None) -> zenoh.Session:
        """A session of this identity. Raises zenoh.ZError where the guard refuses it."""
        opened = zenoh.open(client_config(self.endpoint, tls or client_tls(self.folder, identity)))
        self._sessions.insert(0, opened)
        return opened

    def close(self) -> None:
        """End it: callbacks of an open session would keep this process from ending."""
        for session in self._sessions:
            session.close()  # type: ignore[no-untyped-call]


def keys_of(design: Design) -> tuple[str, ...]:
    """Every key to try: each act there is, wherever the design has a protocol; each signal with
    whoever might own it and whoever might hear it.
    """
    ways = {
        (rule.channel, rule.sender, rule.receiver, rule.protocol) for rule in design.rules.values()
    }
    said = [
        "/".join(("roco", SYSTEM, *way, act.value)) for way in sorted(ways) for act in Performative
    ]
    names = identities(design)
    served = [
        signal.key.format(system=SYSTEM, owner=owner, peer=peer, incarnation=1)
        for signal in design.signals.values()
        for owner in names
        for peer in (names if "{peer}" in signal.key else [""])
        if owner != peer
    ]
    return (*said, *served)


def allowed_at(agent: str, design: Design, identity: str, action: str, key: str) -> bool:
    """Return whether the design allows a cell at an agent, told from the chunks of the key
    alone.
    """
    _, _, what, *rest = key.split("/")
    if identity not in design.peers(agent):
        return False
    if what == "_" and rest[0] == "alive":
        return rest[1] == {"token": identity, "watch": agent}.get(action)
    if what != "_":
        sender, receiver, protocol, act = rest
        known = any(
            (s, r, p, a) == (sender, receiver, protocol, act) for s, r, p, a in design.rules
        )
    else:
        (kind, sender, *others), receiver = rest, rest[-1]
        known = kind in ("receipt", "ping", "pong") and bool(others)
    ways = {"put": (identity, agent), "subscribe": (agent, identity)}
    return known and (sender, receiver) == ways.get(action)


def allowed(design: Design, identity: str, action: str, key: str) -> bool:
    """Return whether the design allows a cell at the router, told from the chunks of the key
    alone.
    """
    _, _, what, *rest = key.split("/")
    if what != "_":
        sender, receiver, protocol, act = rest
        if not {sender, receiver} & design.guests.keys():
            return False  # agents say it to each other
        said = any((s, r, p, a) == (sender, receiver, protocol, act) for s, r, p, a in design.rules)
        hears = identity in (receiver, *design.file.system.recorders)
        return said and (
            (action == "put" and identity == sender) or (action == "subscribe" and hears)
        )
    kind, owner, *peer = rest
    signal: Signal = design.signals[kind]
    addressed = peer if "{peer}" in signal.key else []
    if owner in design.agents and addressed and addressed[0] in design.agents:
        return False  # also by their own links
    named = [other for writer, other in signal.reach if writer == owner]
    reached = named or (design.peers(owner) if owner in design.agents else tuple(design.agents))
    if owner not in signal.writers or (addressed and addressed[0] not in reached):
        return False
    write, read = ("token", "watch") if kind == "alive" else ("put", "subscribe")
    mine = identity in signal.readers and (
        not addressed or identity == addressed[0] or identity not in design.agents
    )
    return (action == write and identity == owner) or (action == read and mine)
