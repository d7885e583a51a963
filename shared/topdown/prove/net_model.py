"""A net as a model for the engine: its commands are made into one Python function, since to read the table at every
state would be some ten times slower.

A state is a flat tuple: the index of each variable's value, then each queue as a tuple of indices of words. Commands
are put into a tree of conditions in the order of their guards, so guards that many share should stand first.
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from topdown.prove.engine import Move
from topdown.prove.net import Clear, Command, Copy, Effect, Empty, Full, Guard, Head, Is, Net, Queue, Send, Set, Take

Cells = dict[str, str]
"""Name of a variable or queue -> the Python expression of its present value."""


class NetModel:
    """The engine's model of a net. Raises NetError for names the net does not have."""

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
        """Index of each variable and queue in a state."""
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
    source += ["def at_rest(s):\n", unpack, f"    return {_any(net, net.rest, cells)}\n"]
    source += ["def wrong(s):\n", unpack]
    for wrong in net.wrong:
        source += [f"    if {_all(net, wrong.guards, cells)}:\n        return {wrong.text!r}\n"]
    source += ["    return ''\n"]
    functions: dict[str, Any] = {}
    exec(compile("".join(source), f"<net {net.name}>", "exec"), functions)
    return functions


class _Tree:
    """Commands by their conditions: what many of them ask is asked once."""

    def __init__(self) -> None:
        self.moves: list[str] = []
        self.branches: dict[str, _Tree] = {}

    def add(self, conditions: list[str], move: str) -> None:
        """Put a command's move under its conditions, in their order."""
        node = self
        for condition in conditions:
            node = node.branches.setdefault(condition, _Tree())
        node.moves.append(move)

    def lines(self, indent: str) -> list[str]:
        """Source; branches that compare one cell with different numbers exclude each other."""
        lines = [f"{indent}out.append({move})\n" for move in self.moves]
        by_cell = sorted(self.branches.items(), key=lambda branch: branch[0].split(" == ")[0])
        before = ""
        for condition, branch in by_cell:
            cell, _, number = condition.partition(" == ")
            word = "elif" if number.isdigit() and cell == before else "if"
            before = cell if number.isdigit() else ""
            lines += [f"{indent}{word} {condition}:\n", *branch.lines(indent + " ")]
        return lines


def _commands(net: Net, cells: Cells) -> list[str]:
    """The body of `moves`."""
    known, tree = net.by_name, _Tree()
    for command in net.commands:
        conditions = [_guard(guard, known, cells) for guard in command.guards] + _room(net, command, cells)
        there = _after(net, command.effects, cells)
        move = f"({command.who!r}, {command.what!r}, {there}, {command.fair}, {command.fault})"
        tree.add(conditions, move)
    return tree.lines("    ")


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


def _any(net: Net, alternatives: tuple[tuple[Guard, ...], ...], cells: Cells) -> str:
    return " or ".join(f"({_all(net, guards, cells)})" for guards in alternatives) or "False"


def _all(net: Net, guards: tuple[Guard, ...], cells: Cells) -> str:
    known = net.by_name
    return " and ".join(_guard(guard, known, cells) for guard in guards) or "True"


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
