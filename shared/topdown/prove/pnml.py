"""A net as PNML (ISO/IEC 15909-2, grammar of 2009): a place/transition net, for Petri net tools.

A place for each value of each variable, and for each content that a bounded queue may have; one of a thing's places
has a token at a time. A command becomes a transition for each valuation of what it asks or changes, so its markings
are the states that are explored here, one for one. That grows fast: `MOST` transitions at most, else NetError.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import product
from xml.etree import ElementTree

from topdown.prove.net import (
    Clear,
    Command,
    Copy,
    Effect,
    Empty,
    Full,
    Guard,
    Head,
    Is,
    Net,
    NetError,
    Queue,
    Send,
    Set,
    Take,
    Variable,
)

MOST = 100_000
"""Transitions of a net that tools still open (estimate)."""
GRAMMAR = "http://www.pnml.org/version-2009/grammar"

Value = str | tuple[str, ...]
"""A variable's value, or a queue's content."""


def pnml(net: Net) -> str:
    """The document's text. Raises NetError for a net that is too large, or names what it does not have."""
    net.check()
    values = {thing.name: _values(thing) for thing in net.things}
    valuations = sum(_size(net, command, values) for command in net.commands)
    if valuations > MOST:
        what = f"{net.name}: some {valuations} transitions, and {MOST} is the most"
        raise NetError(f"{what}; export the pair over ideal queues, or one with fewer words or less room")
    root = ElementTree.Element("pnml", xmlns=f"{GRAMMAR}/pnml")
    sheet = ElementTree.SubElement(root, "net", id="net", type=f"{GRAMMAR}/ptnet")
    _named(sheet, net.name)
    page = ElementTree.SubElement(sheet, "page", id="page")
    places = _places(net, values, page)
    _transitions(net, values, places, page)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _values(thing: Variable | Queue) -> tuple[Value, ...]:
    if isinstance(thing, Variable):
        return thing.values
    lengths = range(thing.capacity + 1)
    return tuple(content for length in lengths for content in product(thing.words, repeat=length))


def _named(parent: ElementTree.Element, text: str) -> None:
    ElementTree.SubElement(ElementTree.SubElement(parent, "name"), "text").text = text


def _places(
    net: Net, values: Mapping[str, tuple[Value, ...]], page: ElementTree.Element
) -> dict[tuple[str, Value], str]:
    places: dict[tuple[str, Value], str] = {}
    for thing in net.things:
        first: Value = thing.values[thing.first] if isinstance(thing, Variable) else ()
        for value in values[thing.name]:
            places[thing.name, value] = f"p{len(places)}"
            place = ElementTree.SubElement(page, "place", id=places[thing.name, value])
            _named(place, f"{thing.name}: {value if isinstance(value, str) else ' '.join(value) or 'empty'}")
            if value == first:
                marking = ElementTree.SubElement(place, "initialMarking")
                ElementTree.SubElement(marking, "text").text = "1"
    return places


def _transitions(
    net: Net,
    values: Mapping[str, tuple[Value, ...]],
    places: Mapping[tuple[str, Value], str],
    page: ElementTree.Element,
) -> None:
    transitions, arcs = 0, 0
    for command in net.commands:
        for before, after in _valuations(net, command, values):
            name = f"t{transitions}"
            transitions += 1
            _named(ElementTree.SubElement(page, "transition", id=name), f"{command.who}: {command.what}")
            for thing, old in before.items():
                ends = ((places[thing, old], name), (name, places[thing, after[thing]]))
                for source, target in ends:
                    ElementTree.SubElement(page, "arc", id=f"a{arcs}", source=source, target=target)
                    arcs += 1


def _touched(net: Net, command: Command) -> list[str]:
    """Return what a transition asks or changes, and what tells a wrong state, where nothing happens."""
    parts: tuple[Guard | Effect, ...] = (*command.guards, *command.effects)
    sources = [effect.source for effect in command.effects if isinstance(effect, Copy)]
    wrong = [guard[0] for one in net.wrong for guard in one.guards]
    return list(dict.fromkeys([*(part[0] for part in parts), *sources, *wrong]))


def _allowed(net: Net, command: Command, thing: str, values: tuple[Value, ...]) -> list[Value]:
    asked = [guard for guard in command.guards if guard[0] == thing]
    wrong = [one.guards[0] for one in net.wrong if len(one.guards) == 1 and one.guards[0][0] == thing]
    right = [value for value in values if not any(_holds(net, guard, value) for guard in wrong)]
    return [value for value in right if all(_holds(net, guard, value) for guard in asked)]


def _size(net: Net, command: Command, values: Mapping[str, tuple[Value, ...]]) -> int:
    return math.prod(len(_allowed(net, command, thing, values[thing])) for thing in _touched(net, command))


def _valuations(
    net: Net, command: Command, values: Mapping[str, tuple[Value, ...]]
) -> Iterator[tuple[dict[str, Value], dict[str, Value]]]:
    """Return values before and after for the touched variables, in every state that is not wrong and has room."""
    touched = _touched(net, command)
    for choice in product(*(_allowed(net, command, thing, values[thing]) for thing in touched)):
        before = dict(zip(touched, choice, strict=True))
        if any(all(_holds(net, guard, before[guard[0]]) for guard in wrong.guards) for wrong in net.wrong):
            continue
        after = _after(command, before)
        if all(after[thing] in values[thing] for thing in touched):
            yield before, after


def _holds(net: Net, guard: Guard, value: Value) -> bool:
    match guard:
        case Is(_, wanted):
            return value in wanted
        case Head(_, words):
            return bool(value) and value[0] in words
        case Empty():
            return not value
        case Full(name):
            thing = net.by_name[name]
            return isinstance(thing, Queue) and len(value) >= thing.capacity


def _after(command: Command, before: Mapping[str, Value]) -> dict[str, Value]:
    now = dict(before)
    for effect in command.effects:
        content = now[effect[0]]
        match effect:
            case Set(name, value):
                now[name] = value
            case Copy(name, source):
                now[name] = now[source]
            case Take(name):
                now[name] = content[1:]
            case Send(name, word) if isinstance(content, tuple):
                now[name] = (*content, word)
            case Clear(name):
                now[name] = ()
    return now
