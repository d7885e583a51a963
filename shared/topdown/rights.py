"""Who may do what on which key: derived from a design, and written as the access rules of a Zenoh router.

Default deny. An agent may put exactly the communicates that the design lets it say (sender, receiver, protocol,
performative) and hear exactly what is said to it; of what is no communicate it may write its own keys where the design
has it among the writers, and read where it is among the readers. What names a peer in its key goes to that peer, and
to readers that are no agents. Nobody queries and nobody answers queries: requests are communicates.

An identity is the common name (CN) of a certificate. The router compares it with the sender in the key, and the
receiving agent compares the key with the sender in the communicate: so a sender is who holds the private key of that
name. Nothing here knows a certificate or a router.
"""

from collections.abc import Iterator
from enum import StrEnum
from typing import Any

import msgspec

from topdown.design import Design
from topdown.elements import House

ROUTER = "router"
"""The identity of the router: it listens, and has no right as a client."""
_INCARNATION = "{incarnation}"
_PEER = "{peer}"


class Action(StrEnum):
    """What an identity may want to do on a key. `TOKEN`: declare a liveliness token; `WATCH`: see tokens."""

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
    """Keys that are one thing to the design: a communicate's act on a channel, or one owner's key of a house kind.

    `key`: with * for the number of an incarnation only. `what`: the channel, or the kind; `peer` "" where none.
    """

    key: str
    what: str
    owner: str
    peer: str
    act: str = ""
    token: bool = False


def identities(design: Design) -> tuple[str, ...]:
    """Agents, then whoever else reads or writes, then the router: each has a certificate of its own."""
    others = [name for house in design.file.house for name in (*house.writers, *house.readers)]
    return tuple(dict.fromkeys([*design.agents, *design.file.system.recorders, *others, ROUTER]))


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
    return (*said, *(family for house in design.file.house for family in _of_house(design, system, house)))


def rights(design: Design, system: str) -> tuple[Right, ...]:
    """Every allowed cell; what is not here is denied."""
    found: list[Right] = []
    for family in families(design, system):
        write, read = (Action.TOKEN, Action.WATCH) if family.token else (Action.PUT, Action.SUBSCRIBE)
        found.append(Right(family.owner, write, family.key))
        found += [Right(name, read, family.key) for name in _hearers(design, family)]
    return tuple(sorted(set(found)))


def access_control(design: Design, system: str) -> dict[str, Any]:
    """The part `access_control` of a Zenoh router's configuration (1.10): subjects are common names of certificates.

    Directions are the router's: ingress is what a client sends. A subscription may have wildcards (`_ears`); what then
    reaches the subscriber are only the keys that it has a right to. Subscriptions of others are told to nobody, so a
    publisher cannot learn who listens.
    """
    rules = [rule for name in identities(design) for rule in _rules(design, system, name)]
    named = {name: [rule["id"] for rule in rules if rule["id"].startswith(f"{name} ")] for name in identities(design)}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in named],
        "policies": [{"subjects": [name], "rules": ids} for name, ids in named.items() if ids],
    }


def _rules(design: Design, system: str, identity: str) -> Iterator[dict[str, Any]]:
    mine = [right for right in rights(design, system) if right.identity == identity]
    keys = {action: [right.key for right in mine if right.action == action] for action in Action}
    ears = _ears(design, system, identity)
    yield from _rule(f"{identity} puts", "ingress", ["put"], keys[Action.PUT])
    yield from _rule(f"{identity} hears", "egress", ["put"], keys[Action.SUBSCRIBE])
    yield from _rule(f"{identity} listens", "ingress", ["declare_subscriber"], ears[Action.SUBSCRIBE])
    yield from _rule(f"{identity} lives", "ingress", ["liveliness_token"], keys[Action.TOKEN])
    yield from _rule(f"{identity} sees", "egress", ["liveliness_token"], keys[Action.WATCH])
    watching = ["liveliness_query", "declare_liveliness_subscriber"]
    yield from _rule(f"{identity} looks", "ingress", watching, ears[Action.WATCH])


def _rule(name: str, flow: str, messages: list[str], keys: list[str]) -> Iterator[dict[str, Any]]:
    """A rule, none where there are no keys: Zenoh refuses an empty one."""
    if keys:
        yield {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}


def _ears(design: Design, system: str, identity: str) -> dict[Action, list[str]]:
    """The widest key expressions an identity may declare: a declaration must lie within one of them."""
    ears: dict[Action, list[str]] = {Action.SUBSCRIBE: [], Action.WATCH: []}
    if identity in design.agents:
        ears[Action.SUBSCRIBE].append(design.keys_to(system, identity))
    if identity in design.file.system.recorders:
        ears[Action.SUBSCRIBE].append(design.file.system.key.split("{channel}")[0].format(system=system) + "**")
    for house in design.file.house:
        if identity in house.readers:
            peer = identity if identity in design.agents else "*"
            key = design.house_key(house.kind, system=system, owner="*", peer=peer)
            ears[Action.WATCH if _is_token(house) else Action.SUBSCRIBE].append(key)
    return ears


def _of_house(design: Design, system: str, house: House) -> Iterator[Family]:
    for owner in house.writers:
        peers = design.peers(owner) if owner in design.agents else design.agents
        for peer in sorted(peers) if _PEER in house.key else [""]:
            key = design.house_key(house.kind, system=system, owner=owner, peer=peer)
            yield Family(key=key, what=house.kind, owner=owner, peer=peer, token=_is_token(house))


def _is_token(house: House) -> bool:
    """What names an incarnation in its key is no message but a liveliness token."""
    return _INCARNATION in house.key


def _hearers(design: Design, family: Family) -> tuple[str, ...]:
    """Who may hear it: of a communicate its receiver and the recorders, else the readers."""
    if family.act:
        return (family.peer, *design.file.system.recorders)
    readers = design.houses[family.what].readers
    return tuple(name for name in readers if not family.peer or name == family.peer or name not in design.agents)
