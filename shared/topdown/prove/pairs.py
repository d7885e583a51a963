"""Layer 2 of a design: every use of a protocol explored with copies and receipts explicit, as its
delivery has it.

A use is explored with the words that its agents say: those in their rows, or, where an agent has no
rows, the acts that the use lists. Nothing here knows a particular system.
"""

from collections.abc import Iterator
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import SEND, START, Protocol, Role
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.machines import Machine
from topdown.prove.durable import durable_pair
from topdown.prove.engine import Exploration, explore
from topdown.prove.net import Command, Empty, Head, Net, NetModel, Queue, Send, Take, is_
from topdown.prove.roles import WRONG, Pair, Players, reachable, restricted, to
from topdown.prove.volatile import volatile_pair

# --- Both roles of a protocol over two ideal queues: what a durable stream is to its users, once
# layer 1 has proven it
# Small enough for Petri net tools; `durable` has the copies and receipts that are left out here.


CAPACITY = 3
"""Words on their way to one role, as in fipa_codec.exploration."""


def ideal_pair(
    protocol: Protocol, players: Players | None = None, *, capacity: int = CAPACITY
) -> Net:
    """The net of a protocol over two queues; no faults, since the streams hide them."""
    pair = Pair(protocol, players or Players())
    texts: list[str] = []
    commands = tuple(command for role in Role for command in _commands(pair, role, texts))
    queues = tuple(Queue(_queue(pair, role), pair.words(role), capacity) for role in Role)
    empty = tuple(Empty(queue.name) for queue in queues)
    return pair.net(commands, texts, empty, queues=queues)


def _queue(pair: Pair, sender: Role) -> str:
    return f"{pair.players.named(sender)}>{pair.players.named(sender.other)}"


def _commands(pair: Pair, role: Role, texts: list[str]) -> Iterator[Command]:
    me, peer = pair.players.named(role), pair.players.named(role.other)
    out, into = _queue(pair, role), _queue(pair, role.other)
    for row in pair.sends(role):
        opens = row.state == START
        here = is_(me, *pair.sources(role, row) if opens else (str(row.state),))
        effects = to(me, row.to), Send(out, row.word)
        yield Command(me, f"{row.word} -> {peer}", (here,), effects, fair=not (row.free or opens))
    for row, states in pair.takes(role):
        heard = is_(me, *states), Head(into, frozenset({row.word}))
        yield Command(me, f"{row.word} <- {peer}", heard, (to(me, row.to), Take(into)))
    for state, word, forgotten in pair.untaken(role):
        if word in pair.words(role.other):
            texts.append(pair.wrong_words(role, state, word, forgotten))
            heard = is_(me, state), Head(into, frozenset({word}))
            yield Command(me, f"{word} <- {peer}", heard, (to(WRONG, texts[-1]),))


# --- Layer 2 of a design --------------------------------------------------------------------------


class PairResult(NamedTuple):
    """`unreached`: states of a role's table that no walk came through, "AGENT STATE"."""

    use: str
    channel: str
    delivery: str
    faults: int | None
    exploration: Exploration
    unreached: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Nothing was found, nothing is open, every state was reached."""
        return self.exploration.holds and not self.unreached


def explore_use(
    design: Design,
    use: str,
    faults: int | None = 1,
    *,
    seconds: float | None = None,
    most_states: int | None = None,
) -> PairResult:
    """One use. Raises NoSuchEntry."""
    entry, protocol = design.protocol(use), spoken(design, use)
    model = NetModel(net_of(design, use, faults))
    found = explore(model, seconds=seconds, most_states=most_states, first=False, places=(0, 1))
    unreached = _unreached(model, protocol, Players(entry.initiator, entry.participant), found)
    return PairResult(use, entry.channel, delivery(entry), faults, found, unreached)


def net_of(design: Design, use: str, faults: int | None = 1, *, ideal: bool = False) -> Net:
    """The net of one use. `ideal`: a durable one over ideal queues, which need no faults. Raises
    NoSuchEntry.
    """
    entry = design.protocol(use)
    players = Players(entry.initiator, entry.participant)
    protocol = spoken(design, use)
    if entry.durable and ideal:
        net = ideal_pair(protocol, players)
    elif entry.durable:
        net = durable_pair(protocol, players, faults=faults)
    else:
        net = volatile_pair(protocol, players, faults=faults, latest=entry.latest)
    return net._replace(name=use)


def delivery(use: elements.Protocol) -> str:
    """In one word."""
    return "durable" if use.durable else "latest" if use.latest else "volatile"


def spoken(design: Design, use: str) -> Protocol:
    """The protocol of a use, with the words that its agents say. Raises NoSuchEntry,
    DesignError.
    """
    entry = design.protocol(use)
    protocol = design.tables[entry.follows]
    says = {role: _acts_of(design, entry, role, protocol) for role in Role}
    return restricted(protocol, says)


def _acts_of(
    design: Design, use: elements.Protocol, role: Role, protocol: Protocol
) -> frozenset[str]:
    agent = use.initiator if role is Role.INITIATOR else use.participant
    rows = Machine(design, agent).rows if agent in design.agents else ()
    words = {word for row in rows for word in (*row.say, *row.may) if word.use == use.name}
    said = {(word.act, word.kind) for word in words}
    if any(use.name in row.owes for row in rows):
        said |= {(Performative.INFORM, kind) for kind in Kind}
    if not said:  # no rows: the acts that the use lists
        listed = {message.performative for message in use.message if message.sender == agent}
        said = {(act, kind) for act in listed for kind in Kind}
    sends = (row for row in protocol.tables[role] if row.way is SEND)
    return frozenset(row.word for row in sends if (row.performative, row.kind) in said)


def _unreached(
    model: NetModel, protocol: Protocol, players: Players, found: Exploration
) -> tuple[str, ...]:
    return tuple(
        f"{players.named(role)} {value}"
        for place, role in enumerate(Role if found.holds else ())
        for number, value in enumerate(model.net.variables[place].values)
        if number not in found.met[place] and value in _of_rows(protocol, role)
    )


def _of_rows(protocol: Protocol, role: Role) -> frozenset[str]:
    """States that rows alone lead to: what an opening asked again leads to is the delivery's
    business.
    """
    old = protocol.tables[role]
    again = [row for row in old if row.performative in protocol.openings and row.state != START]
    return reachable(old.only(row for row in old if row not in again)).states


def changed_channels(design: Design, step: int) -> tuple[str, ...]:
    """Channels of the finished design that a step (from 1) created or changed: new ones,
    reallocated, split or complemented ones, and what became of them when they were split later.
    Raises IndexError for a step there is not.
    """
    steps = design.file.step
    if not 1 <= step <= len(steps):
        raise IndexError(f"step {step}: the design has steps 1 to {len(steps)}")
    one = steps[step - 1]
    touched = [channel.id for channel in one.channels]
    touched += [move.channel for move in one.reallocate] + [more.channel for more in one.complement]
    touched += [name for split in one.split for name in split.into]
    for later in steps[step:]:
        for split in later.split:
            if split.channel in touched:
                touched += split.into
    return tuple(name for name in design.channels if name in touched)
