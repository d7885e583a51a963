"""Rights of each identity on each key: derived from a design, and written as the access rules of
Zenoh sessions.

Default deny. An agent may put exactly the communicates that the design lets it say (sender,
receiver, protocol, performative) and hear exactly what is said to it; of samples that are not
communicates it may write its own keys where the design has it among the writers, and read where it
is among the readers. What names a peer in its key goes to that peer, and to readers that are not
agents. Nobody queries and nobody answers queries: requests are communicates.

What agents say to each other goes by their own link: there the receiving agent's rules decide. All
else, also what is said to a group of a design, goes by the router, whose rules decide.

An identity is the common name (CN) of a certificate. Who decides compares it with the sender in the
key, and the receiving agent compares the key with the sender in the communicate: so a sender is who
holds the private key of that name. Nothing here knows a certificate or a router.
"""

from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import Any

import msgspec

from topdown.model.design import Design
from topdown.model.elements import Signal

ROUTER = "router"
"""The identity of the router: it listens, and has no right as a client."""
_INCARNATION = "{incarnation}"
_PEER = "{peer}"


class Action(StrEnum):
    """Actions of an identity on a key. `TOKEN`: declare a liveliness token; `WATCH`: see tokens."""

    PUT = "put"
    SUBSCRIBE = "subscribe"
    QUERY = "query"
    QUERYABLE = "queryable"
    TOKEN = "token"
    WATCH = "watch"


class Right(msgspec.Struct, frozen=True, order=True):
    """One allowed cell: `identity` may do `action` on `key`."""

    identity: str
    action: str
    key: str


class Family(msgspec.Struct, frozen=True, order=True):
    """Keys that are one thing to the design: a communicate's act on a channel, or one owner's key
    of a kind of signal.

    `key`: with * for the number of an incarnation only. `what`: the channel, or the kind; `peer` ""
    where none.
    """

    key: str
    what: str
    owner: str
    peer: str
    act: str = ""
    token: bool = False


def identities(design: Design) -> tuple[str, ...]:
    """Agents and groups that speak, other readers and writers, and the router: each has its own
    certificate.
    """
    others = [
        name for signal in design.signals.values() for name in (*signal.writers, *signal.readers)
    ]
    return tuple(
        dict.fromkeys([*_speakers(design), *design.file.system.recorders, *others, ROUTER])
    )


def families(design: Design, system: str) -> tuple[Family, ...]:
    """Every key of the design that somebody may write."""
    said = [
        Family(
            key=design.key_of(system, rule),
            what=rule.channel,
            owner=rule.sender,
            peer=rule.receiver,
            act=f"{rule.protocol}/{rule.performative.value}",
        )
        for rule in design.rules.values()
    ]
    return (
        *said,
        *(
            family
            for signal in design.signals.values()
            for family in _of_signal(design, system, signal)
        ),
    )


def _speakers(design: Design) -> tuple[str, ...]:
    """The agents, and the groups that say or hear a communicate."""
    ends = sorted(name for rule in design.rules.values() for name in (rule.sender, rule.receiver))
    return tuple(dict.fromkeys((*design.agents, *ends)))


def routed(design: Design, family: Family) -> bool:
    """Whether keys of a family go by the router: they are not of two agents, which are linked with
    each other.
    """
    return not {family.owner, family.peer} <= set(design.agents)


def rights(design: Design, system: str) -> tuple[Right, ...]:
    """Every allowed cell; what is not here is denied."""
    return _allowed(design, families(design, system))


def _allowed(design: Design, found: Sequence[Family]) -> tuple[Right, ...]:
    cells: list[Right] = []
    for family in found:
        write, read = (
            (Action.TOKEN, Action.WATCH) if family.token else (Action.PUT, Action.SUBSCRIBE)
        )
        cells.append(Right(family.owner, write, family.key))
        cells += [Right(name, read, family.key) for name in _hearers(design, family)]
    return tuple(sorted(set(cells)))


def common_names(design: Design, systems: Sequence[str]) -> dict[str, tuple[tuple[str, str], ...]]:
    """The common name (CN) of each certificate, and as whom it counts: (identity, system) pairs.

    One system: the CN is the identity. Several behind one router: the CN of an agent or a group is
    `<system>.<identity>`, so that the two of a name are told apart; another identity (router,
    recorders, readers) is one for all systems.
    """
    several = set(_speakers(design)) if len(systems) > 1 else set()
    found: dict[str, list[tuple[str, str]]] = {}
    for system in systems:
        for identity in identities(design):
            name = f"{system}.{identity}" if identity in several else identity
            found.setdefault(name, []).append((identity, system))
    return {name: tuple(pairs) for name, pairs in found.items()}


def access_control(design: Design, *systems: str) -> dict[str, Any]:
    """The part `access_control` of a Zenoh router's configuration (1.10): subjects are common names
    of certificates.

    Directions are the router's: ingress is what a client sends. A subscription may have wildcards
    (`_ears`); what then reaches the subscriber are only the keys that it has a right to.
    Subscriptions of others are told to no agent, so a publisher cannot learn who listens.
    """
    cells = {
        system: _allowed(design, [one for one in families(design, system) if routed(design, one)])
        for system in systems
    }
    holders = common_names(design, systems)
    return _control(
        {name: list(_rules(design, cells, name, pairs)) for name, pairs in holders.items()}
    )


def links_control(design: Design, system: str, agent: str, names: dict[str, str]) -> dict[str, Any]:
    """The part `access_control` of the configuration of an agent's links with its neighbours (Zenoh
    1.10).

    A neighbour may put what the design lets it say to this agent, hear what this agent says to it,
    and see this agent's token; everything else is denied, also to clients that a neighbour forwards
    for. `names`: identity -> common name.
    """
    every, near = families(design, system), sorted(set(design.peers(agent)) & set(design.agents))
    ways = ((one, _linked(design, system, every, agent, one, names[one])) for one in near)
    rules = {names[one]: list(found) for one, found in ways}
    return _control(rules)


def _control(rules: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    """The configuration of these rules, by the common name that they are for."""
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for found in rules.values() for rule in found],
        "subjects": [{"id": name, "cert_common_names": [name]} for name in rules],
        "policies": [
            {"subjects": [name], "rules": [rule["id"] for rule in found]}
            for name, found in rules.items()
            if found
        ],
    }


def _linked(
    design: Design, system: str, every: Sequence[Family], agent: str, neighbour: str, name: str
) -> Iterator[dict[str, Any]]:
    """Rules of an agent for one neighbour: ingress is what that one sends."""
    both = {agent, neighbour}
    ways = ((neighbour, "ingress", "brings", "asks"), (agent, "egress", "takes", "is asked"))
    for owner, flow, brings, asks in ways:
        own = [one for one in every if one.owner == owner]
        said = [one.key for one in own if {one.owner, one.peer} == both]
        yield from _rule(f"{name} {brings} words", flow, ["put"], said)
        yield from _rule(
            f"{name} {brings} life",
            flow,
            ["liveliness_token"],
            [one.key for one in own if one.token],
        )
        ears, watching = (
            _ears(design, system, owner),
            ["liveliness_query", "declare_liveliness_subscriber"],
        )
        yield from _rule(
            f"{name} {asks} for words", flow, ["declare_subscriber"], ears[Action.SUBSCRIBE]
        )
        yield from _rule(f"{name} {asks} for life", flow, watching, ears[Action.WATCH])


def _rules(
    design: Design,
    cells: dict[str, tuple[Right, ...]],
    name: str,
    pairs: tuple[tuple[str, str], ...],
) -> Iterator[dict[str, Any]]:
    keys: dict[Action, list[str]] = {action: [] for action in Action}
    ears: dict[Action, list[str]] = {Action.SUBSCRIBE: [], Action.WATCH: []}
    for identity, system in pairs:
        for right in cells[system]:
            if right.identity == identity:
                keys[Action(right.action)].append(right.key)
        for action, wide in _ears(design, system, identity).items():
            ears[action] += wide
    yield from _rule(f"{name} puts", "ingress", ["put"], keys[Action.PUT])
    yield from _rule(f"{name} hears", "egress", ["put"], keys[Action.SUBSCRIBE])
    yield from _rule(f"{name} listens", "ingress", ["declare_subscriber"], ears[Action.SUBSCRIBE])
    yield from _rule(f"{name} lives", "ingress", ["liveliness_token"], keys[Action.TOKEN])
    yield from _rule(f"{name} sees", "egress", ["liveliness_token"], keys[Action.WATCH])
    watching = ["liveliness_query", "declare_liveliness_subscriber"]
    yield from _rule(f"{name} looks", "ingress", watching, ears[Action.WATCH])


def _rule(name: str, flow: str, messages: list[str], keys: list[str]) -> Iterator[dict[str, Any]]:
    """Yield a rule; none without keys, since Zenoh refuses an empty one."""
    if keys:
        yield {
            "id": name,
            "permission": "allow",
            "flows": [flow],
            "messages": messages,
            "key_exprs": keys,
        }


def _ears(design: Design, system: str, identity: str) -> dict[Action, list[str]]:
    """The widest key expressions an identity may declare: a declaration must lie within one of
    them.
    """
    ears: dict[Action, list[str]] = {Action.SUBSCRIBE: [], Action.WATCH: []}
    if identity in _speakers(design):
        ears[Action.SUBSCRIBE].append(design.keys_to(system, identity))
    if identity in design.file.system.recorders:
        whole = design.file.system.key.split("{channel}")[0].format(system=system)
        ears[Action.SUBSCRIBE].append(f"{whole}**")
    for signal in design.signals.values():
        if identity in signal.readers:
            peer = identity if identity in design.agents else "*"
            key = design.signal_key(signal.kind, system=system, owner="*", peer=peer)
            ears[Action.WATCH if _is_token(signal) else Action.SUBSCRIBE].append(key)
    return ears


def _of_signal(design: Design, system: str, signal: Signal) -> Iterator[Family]:
    for owner in signal.writers:
        named = [peer for writer, peer in signal.reach if writer == owner]
        peers = named or (design.peers(owner) if owner in design.agents else design.agents)
        for peer in sorted(peers) if _PEER in signal.key else [""]:
            key = design.signal_key(signal.kind, system=system, owner=owner, peer=peer)
            yield Family(key=key, what=signal.kind, owner=owner, peer=peer, token=_is_token(signal))


def _is_token(signal: Signal) -> bool:
    """Whether a key names an incarnation: then it carries a liveliness token, not a message."""
    return _INCARNATION in signal.key


def _hearers(design: Design, family: Family) -> tuple[str, ...]:
    """The identities that may hear it: what goes by a link its receiver; of a communicate that goes
    by the router the receiver and the recorders, else the readers.
    """
    if not routed(design, family):
        return (family.peer,)
    if family.act:
        return (family.peer, *design.file.system.recorders)
    readers = design.signals[family.what].readers
    return tuple(
        name
        for name in readers
        if not family.peer or name == family.peer or name not in design.agents
    )
