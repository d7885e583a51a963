"""A net as Promela, so that spin can give a second opinion (spinroot.com; SPIN 6.5 was tried).

One process, one loop, one `d_step` for each command: spin stores exactly the states that are
explored here. What is wrong is an assertion, a deadlock an invalid end state; in nets with faults
it is an assertion as well, since a fault that may still happen is not a way out. Whether rest can
be reached from everywhere is a branching property, which spin does not check. Verify with: spin -a
-o1 -o2 FILE; gcc -DSAFETY -DNOREDUCE -o pan pan.c; ./pan -m1000000 -c0 (-o1 -o2: else spin leaves
out variables that nobody asks, and stores fewer states).
"""

import re
from collections.abc import Iterator, Mapping

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
    Queue,
    Send,
    Set,
    Take,
    Variable,
    rooms,
)

Names = Mapping[str, str]


def promela(net: Net) -> str:
    """The model's text. Raises NetError for names the net does not have."""
    net.check()
    names = {
        thing.name: f"{_identifier(thing.name)}_{number}" for number, thing in enumerate(net.things)
    }
    return "\n".join([*_head(net, names), *_declared(net, names), *_process(net, names), ""])


def _identifier(name: str) -> str:
    word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").lower()
    return word if word and word[0].isalpha() else f"v_{word}"


def _head(net: Net, names: Names) -> Iterator[str]:
    """Comments that explain the numbers."""
    yield f"/* {_comment(net.name)}: {len(net.commands)} commands"
    for thing in net.things:
        words = thing.values if isinstance(thing, Variable) else thing.words
        meaning = ", ".join(f"{number} {word or 'none'}" for number, word in enumerate(words))
        yield f"   {names[thing.name]}: {_comment(thing.name)}: {_comment(meaning)}"
    yield "*/"


def _declared(net: Net, names: Names) -> Iterator[str]:
    for variable in net.variables:
        yield f"byte {names[variable.name]} = {variable.first};"
    for queue in net.queues:
        yield f"chan {names[queue.name]} = [{queue.capacity}] of {{ byte }};"
    yield f"#define REST ({_any(net, net.rest, names)})"
    yield f"#define WRONG ({_any(net, tuple(wrong.guards for wrong in net.wrong), names)})"


def _process(net: Net, names: Names) -> Iterator[str]:
    yield "active proctype net() {"
    yield "  do"
    for wrong in net.wrong:
        step = f"{{ {_all(net, wrong.guards, names)} -> assert(false) }}"
        yield f"  :: d_step {step} /* {_comment(wrong.text)} */"
    yield "  :: d_step { REST && !WRONG -> skip }"
    for command in net.commands:
        effects = "; ".join(_effect(net, effect, names) for effect in command.effects) or "skip"
        words = _comment(f"{command.who}: {command.what}")
        step = f"{{ !WRONG && {_condition(net, command, names)} -> {effects} }}"
        yield f"  :: d_step {step} /* {words} */"
    if any(command.fault for command in net.commands):
        able = [_condition(net, command, names) for command in net.commands if not command.fault]
        # spin ends a statement at a line that could be one
        yield "  :: d_step { !WRONG && !REST &&"
        yield from (f"       !({condition}) &&" for condition in dict.fromkeys(able))
        yield "       true -> assert(false) } /* deadlock */"
    yield "  od"
    yield "}"


def _condition(net: Net, command: Command, names: Names) -> str:
    """Guards of a command, and room for what it sends."""
    room = [f"len({names[name]}) <= {most}" for name, most in rooms(net, command)]
    return " && ".join([_all(net, command.guards, names), *room])


def _any(net: Net, alternatives: tuple[tuple[Guard, ...], ...], names: Names) -> str:
    return " || ".join(f"({_all(net, guards, names)})" for guards in alternatives) or "false"


def _all(net: Net, guards: tuple[Guard, ...], names: Names) -> str:
    known = net.by_name
    conditions = (_guard(known[guard[0]], guard, names[guard[0]]) for guard in guards)
    return " && ".join(conditions) or "true"


def _guard(thing: Variable | Queue, guard: Guard, name: str) -> str:
    match guard, thing:
        case Is(_, wanted), Variable(_, values):
            numbers = sorted(values.index(value) for value in wanted)
            text = " || ".join(f"{name} == {number}" for number in numbers)
        case Head(_, wanted), Queue(_, words):
            numbers = sorted(words.index(word) for word in wanted)
            text = " || ".join(f"{name}?[{number}]" for number in numbers)
        case Empty(), _:
            return f"len({name}) == 0"
        case Full(), Queue(_, _, capacity):
            return f"len({name}) == {capacity}"
        case _:
            raise AssertionError(guard)
    return f"({text})" if len(numbers) > 1 else text


def _effect(net: Net, effect: Effect, names: Names) -> str:
    name, thing = names[effect[0]], net.by_name[effect[0]]
    match effect, thing:
        case Set(_, value), Variable(_, values):
            return f"{name} = {values.index(value)}"
        case Copy(_, source), _:
            return f"{name} = {names[source]}"
        case Take(), _:
            return f"{name}?_"
        case Send(_, word), Queue(_, words):
            return f"{name}!{words.index(word)}"
        case Clear(), _:
            return f"do :: len({name}) > 0 -> {name}?_ :: else -> break od"
        case _:
            raise AssertionError(effect)


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *")
