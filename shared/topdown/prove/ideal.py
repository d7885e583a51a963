"""Both roles of a protocol over two ideal queues: what a durable stream is to its users, once layer 1 has proven it.

Small enough for Petri net tools; `durable` has the copies and receipts that are left out here.
"""

from collections.abc import Iterator

from fipa_codec.tables import START, Protocol, Role
from topdown.prove.net import Command, Empty, Head, Net, Queue, Send, Take, Variable, Wrong, is_
from topdown.prove.roles import WRONG, Pair, Players, to

CAPACITY = 3
"""Words on their way to one role, as in fipa_codec.exploration."""


def ideal_pair(protocol: Protocol, players: Players | None = None, *, capacity: int = CAPACITY) -> Net:
    """The net of a protocol over two queues; no faults, since the streams hide them."""
    pair = Pair(protocol, players or Players())
    texts: list[str] = []
    commands = tuple(command for role in Role for command in _commands(pair, role, texts))
    queues = tuple(Queue(_queue(pair, role), pair.words(role), capacity) for role in Role)
    wrong = Variable(WRONG, ("", *dict.fromkeys(texts)))
    empty = tuple(Empty(queue.name) for queue in queues)
    rest = tuple((*states, *empty) for states in pair.at_rest())
    wrongs = tuple(Wrong(text, (is_(WRONG, text),)) for text in wrong.values[1:])
    states = tuple(pair.state(role) for role in Role)
    name = f"{protocol.name} {pair.players.initiator} {pair.players.participant}"
    return Net(name, (*states, wrong), queues, commands, rest, wrongs, tuple(pair.players))


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
