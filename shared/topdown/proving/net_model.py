"""A net as a model for the engine: its commands are made into one Python function, since a table read anew at every
state would be some ten times slower.

A state is a flat tuple: the index of each variable's value, then each queue as a tuple of indices of words. Commands
are sorted under the variable they ask first, so that a state is compared only with those that may apply.
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from topdown.proving.engine import Move
from topdown.proving.net import Clear, Command, Copy, Effect, Empty, Full, Guard, Head, Is, Net, Queue, Send, Set, Take

Cells = dict[str, str]
"""Name of a variable or queue -> the Python expression of its present value."""


class NetModel:
    """What `engine.explore` wants, of a net. Raises NetError for names the net does not have."""

    def __init__(self, net: Net) -> None:
        self.net = net.check()
        variables, queues = net.variables, net.queues
        self.start = (*(variable.first for variable in variables), *(() for _ in queues))
        functions = _compiled(net)
        self.moves: Callable[[Any], list[Move]] = functions["moves"]
        self.at_rest: Callable[[Any], bool] = functions["at_rest"]
        self.wrong: Callable[[Any], str] = functions["wrong"]

    @cached_property
    def places(self) -> dict[str, int]:
        """Where in a state each variable and queue is."""
        return {thing.name: place for place, thing in enumerate(self.net.things)}

    def value(self, state: Any, variable: str) -> str:
        """The value of a variable in a state."""
        values = next(one.values for one in self.net.variables if one.name == variable)
        index: int = state[self.places[variable]]
        return values[index]

    def describe(self, state: Any) -> dict[str, str]:
        """Lifeline -> the values of what it owns; empty queues are left out."""
        words: dict[str, list[str]] = {name: [] for name in self.net.lifelines}
        for variable in self.net.variables:
            if variable.owner:
                words.setdefault(variable.owner, []).append(variable.values[state[self.places[variable.name]]])
        for queue in self.net.queues:
            content = ", ".join(queue.words[word] for word in state[self.places[queue.name]])
            if queue.owner and content:
                words.setdefault(queue.owner, []).append(f"[{content}]")
        return {owner: " ".join(word for word in found if word) for owner, found in words.items()}


def _compiled(net: Net) -> dict[str, Any]:
    """The three functions, from source made of the net's own table."""
    cells = {thing.name: f"v{place}" for place, thing in enumerate(net.things)}
    unpack = f"    {', '.join(cells.values())}, = s\n"
    source = ["def moves(s):\n", unpack, "    out = []\n", *_commands(net, cells), "    return out\n"]
    source += ["def at_rest(s):\n", unpack, f"    return {_all(net, net.rest, cells)}\n"]
    source += ["def wrong(s):\n", unpack]
    for wrong in net.wrong:
        source += [f"    if {_all(net, wrong.guards, cells)}:\n        return {wrong.text!r}\n"]
    source += ["    return ''\n"]
    functions: dict[str, Any] = {}
    exec(compile("".join(source), f"<net {net.name}>", "exec"), functions)
    return functions


def _commands(net: Net, cells: Cells) -> list[str]:
    """Lines of `moves`: for each variable asked first, a branch for each of its values."""
    branches: dict[str, dict[str, list[Command]]] = {}
    always: list[Command] = []
    for command in net.commands:
        asked = next((guard for guard in command.guards if isinstance(guard, Is)), None)
        if asked is None:
            always.append(command)
            continue
        for value in asked.values:
            branches.setdefault(asked.variable, {}).setdefault(value, []).append(command)
    lines = [line for command in always for line in _command(net, command, cells, "    ", "")]
    for name, values in branches.items():
        domain = next(variable.values for variable in net.variables if variable.name == name)
        for number, value in enumerate(v for v in domain if v in values):
            lines.append(f"    {'el' if number else ''}if {cells[name]} == {domain.index(value)}:\n")
            for command in values[value]:
                lines += _command(net, command, cells, "        ", name)
    return lines


def _command(net: Net, command: Command, cells: Cells, indent: str, asked: str) -> list[str]:
    guards: list[Guard] = [g for g in command.guards if not (isinstance(g, Is) and g.variable == asked)]
    asked_again = [g for g in command.guards if isinstance(g, Is) and g.variable == asked][1:]
    condition = _all(net, (*guards, *asked_again), cells, _room(net, command, cells))
    there = _after(net, command.effects, cells)
    move = f"({command.who!r}, {command.what!r}, {there}, {command.fair}, {command.fault})"
    return [f"{indent}if {condition}:\n", f"{indent}    out.append({move})\n"]


def _room(net: Net, command: Command, cells: Cells) -> list[str]:
    """Conditions that every queue has room for what is sent into it."""
    conditions = []
    for queue in net.queues:
        more = sum(isinstance(effect, Send) and effect.queue == queue.name for effect in command.effects)
        less = sum(isinstance(effect, Take) and effect.queue == queue.name for effect in command.effects)
        cleared = any(isinstance(effect, Clear) and effect.queue == queue.name for effect in command.effects)
        if more > less and not cleared:
            conditions.append(f"len({cells[queue.name]}) <= {queue.capacity - more + less}")
    return conditions


def _all(net: Net, guards: tuple[Guard, ...], cells: Cells, more: list[str] | None = None) -> str:
    known = net.by_name
    return " and ".join([*(_guard(guard, known, cells) for guard in guards), *(more or ())]) or "True"


def _guard(guard: Guard, known: Mapping[str, Any], cells: Cells) -> str:
    cell = cells[guard[0]]
    match guard:
        case Is(name, values):
            return _one_of(cell, [known[name].values.index(value) for value in values])
        case Head(name, words):
            return f"{cell} and " + _one_of(f"{cell}[0]", [known[name].words.index(word) for word in words])
        case Empty():
            return f"not {cell}"
        case Full(name):
            return f"len({cell}) >= {known[name].capacity}"


def _one_of(cell: str, numbers: list[int]) -> str:
    return f"{cell} == {numbers[0]}" if len(numbers) == 1 else f"{cell} in {tuple(sorted(numbers))!r}"


def _after(net: Net, effects: tuple[Effect, ...], cells: Cells) -> str:
    """The expression of the state after the effects, one after the other."""
    known, now = net.by_name, dict(cells)
    for effect in effects:
        thing = known[effect[0]]
        match effect:
            case Set(name, value):
                now[name] = "" if isinstance(thing, Queue) else str(thing.values.index(value))
            case Copy(name, source):
                now[name] = now[source]
            case Take(name):
                now[name] = f"{now[name]}[1:]"
            case Send(name, word):
                now[name] = f"({now[name]} + ({'' if not isinstance(thing, Queue) else thing.words.index(word)},))"
            case Clear(name):
                now[name] = "()"
    return f"({', '.join(now[name] for name in cells)},)"
