"""Variables, bounded queues and guarded commands: the one form from which a model and its exports
are made.

A net is data, so one and the same table is explored here (`NetModel`) and given to spin
(`promela`). To fill it:

  * `Variable("co", ("idle", "busy"), owner="co")`: a small finite domain of words; it starts with
    the first one, or with `start`. `owner`: the lifeline under which drawings show its value ("" =
    not shown).
  * `Queue("co>ta", ("request", "cancel"), capacity=3)`: first in, first out, empty at the start.
  * `Command(who, what, guards, effects)`: may happen where all `guards` hold, and all its effects
    happen at once. Alternatives are separate commands. `fair` and `fault` mean what they mean in
    `engine.Move`. Guards: `Is(variable, {values})`, `Head(queue, {words})`, `Empty(queue)`.
    Effects, carried out in their order: `Set(variable, value)`, `Copy(variable, source)` (another
    variable with the same domain), `Take(queue)` (its first word goes), `Send(queue, word)`. A
    command with `Send` does not happen while there is no room (a full queue holds the sender back).
    `Take` wants a `Head` guard.
  * `rest`: alternatives, each of them guards; where all guards of one hold, everybody may stay as
    he is. `wrong`: what must never be, each with its words. Beyond a wrong state nothing is
    explored.

A bag of messages in any order is a variable per word (how many copies); an unbounded number of
faults is fault commands without a counter, a bounded one a variable that they count down
(`Net.counted`). Names are free text; exports make identifiers of them. Must not know: protocols,
agents, files.
"""

import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from functools import cached_property, partial
from typing import Any, NamedTuple

from topdown.prove.engine import Move
from topdown.prove.flat import KEYS, Case, Do, Has, If, Numbered, Row, Site, Step, Tables
from topdown.prove.flat import Move as FlatMove


class Variable(NamedTuple):
    """One of `values` at a time. `owner`: the lifeline that shows it in drawings."""

    name: str
    values: tuple[str, ...]
    owner: str = ""
    start: str = ""

    @property
    def first(self) -> int:
        """Index of the value at the start."""
        return self.values.index(self.start) if self.start else 0


class Queue(NamedTuple):
    """First in, first out, at most `capacity` words. `owner`: the lifeline that shows what waits in
    it.
    """

    name: str
    words: tuple[str, ...]
    capacity: int = 3
    owner: str = ""


class Is(NamedTuple):
    """The variable has one of these values."""

    variable: str
    values: frozenset[str]


class Head(NamedTuple):
    """The queue's first word is one of these."""

    queue: str
    words: frozenset[str]


class Empty(NamedTuple):
    """Nothing is in the queue."""

    queue: str


class Set(NamedTuple):
    """Give the variable a value."""

    variable: str
    value: str


class Copy(NamedTuple):
    """Give the variable the value that another one of the same domain has by now."""

    variable: str
    source: str


class Take(NamedTuple):
    """The first word goes."""

    queue: str


class Send(NamedTuple):
    """A word is added behind."""

    queue: str
    word: str


Guard = Is | Head | Empty
Effect = Set | Copy | Take | Send


class Command(NamedTuple):
    """`who` does `what` where all guards hold; see `engine.Move` for `fair`, `fault` and the words
    of `what`.
    """

    who: str
    what: str
    guards: tuple[Guard, ...]
    effects: tuple[Effect, ...]
    fair: bool = True
    fault: bool = False


class Wrong(NamedTuple):
    """Error condition of a net: `text` is wrong in a state in which all guards hold."""

    text: str
    guards: tuple[Guard, ...]


class NetError(ValueError):
    """A net names something it does not have: which command, what, and what there is."""


class Net(NamedTuple):
    """The whole. `lifelines`: in the order in which drawings show them."""

    name: str
    variables: tuple[Variable, ...]
    queues: tuple[Queue, ...]
    commands: tuple[Command, ...]
    rest: tuple[tuple[Guard, ...], ...]
    wrong: tuple[Wrong, ...] = ()
    lifelines: tuple[str, ...] = ()

    @property
    def things(self) -> tuple[Variable | Queue, ...]:
        """Variables, then queues."""
        things: list[Variable | Queue] = [*self.variables, *self.queues]
        return tuple(things)

    @property
    def by_name(self) -> Mapping[str, Variable | Queue]:
        """Variables and queues by name."""
        return {thing.name: thing for thing in self.things}

    def counted(self, faults: int | None, name: str = "faults left") -> "Net":
        """The same net in which at most `faults` fault commands happen (None: any number, as it
        is).
        """
        if faults is None:
            return self
        values = tuple(str(number) for number in range(faults + 1))
        counter = Variable(name, values, start=str(faults))
        commands: list[Command] = []
        for command in self.commands:
            if not command.fault:
                commands.append(command)
                continue
            for left in range(1, faults + 1):
                guards = (*command.guards, Is(name, frozenset({str(left)})))
                effects = (*command.effects, Set(name, str(left - 1)))
                commands.append(command._replace(guards=guards, effects=effects))
        return self._replace(variables=(*self.variables, counter), commands=tuple(commands))

    def check(self) -> "Net":
        """The net itself. Raises NetError for names, values and words it does not have."""
        known = self.by_name
        if len(known) < len(self.things):
            raise NetError(f"{self.name}: two variables or queues have one name; give each its own")
        places: Iterable[tuple[str, Iterable[Guard | Effect]]] = (
            *((f"{c.who}: {c.what}", (*c.guards, *c.effects)) for c in self.commands),
            *(("rest", guards) for guards in self.rest),
            *((wrong.text, wrong.guards) for wrong in self.wrong),
        )
        for place, parts in places:
            for part in parts:
                _check(f"{self.name}, {place}", part, known)
        return self


def is_(variable: str, *values: str) -> Is:
    """The guard, shorter to write."""
    return Is(variable, frozenset(values))


def _check(place: str, part: Guard | Effect, known: Mapping[str, Variable | Queue]) -> None:
    thing, words = known.get(part[0]), _values(part)
    wanted = Variable if isinstance(part, Is | Set | Copy) else Queue
    if not isinstance(thing, wanted):
        names = ", ".join(name for name, one in known.items() if isinstance(one, wanted))
        raise NetError(f"{place}: {part[0]!r} is no {wanted.__name__.lower()}; there are {names}")
    domain = thing.values if isinstance(thing, Variable) else thing.words
    if isinstance(part, Copy):
        source = known.get(part.source)
        if not isinstance(source, Variable) or source.values != domain:
            raise NetError(
                f"{place}: {part.source!r} is no variable with the domain of {part.variable!r}"
            )
    elif not words <= set(domain):
        strange = ", ".join(sorted(words - set(domain)))
        raise NetError(f"{place}: {strange} is not in {thing.name!r}: {domain}")


def _values(part: Guard | Effect) -> frozenset[str]:
    match part:
        case Is(_, words) | Head(_, words):
            return words
        case Set(_, word) | Send(_, word):
            return frozenset({word})
        case _:
            return frozenset()


# --- A net as a model that the engine explores ----------------------------------------------------


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
        self.contents = Numbered(())

    @cached_property
    def places(self) -> dict[str, int]:
        """Index of each variable and queue in a state."""
        return {thing.name: place for place, thing in enumerate(self.net.things)}

    # --- for the explorer in C --------------------------------------------------------------------

    def tables(self) -> Tables:
        """The same model as tables, in which a queue is the number of its content."""
        return _NetTables(self.net, self.contents)

    def state_of(self, numbers: tuple[int, ...]) -> Any:
        """The state that these numbers stand for."""
        many = len(self.net.variables)
        return (*numbers[:many], *(self.contents.values[number] for number in numbers[many:]))

    def wrong_state(self, text: str) -> Any:
        """There is none: nothing that a net does is wrong by itself."""
        raise AssertionError(text)

    def note_taken(self, numbers: Iterable[int]) -> None:
        """Nobody asks which commands were carried out."""

    def describe(self, state: Any) -> dict[str, str]:
        """Lifeline -> the values of what it owns; empty queues are left out."""
        words: dict[str, list[str]] = {name: [] for name in self.net.lifelines}
        for variable in self.net.variables:
            if variable.owner:
                words.setdefault(variable.owner, []).append(
                    variable.values[state[self.places[variable.name]]]
                )
        for queue in self.net.queues:
            content = ", ".join(queue.words[word] for word in state[self.places[queue.name]])
            if queue.owner and content:
                words.setdefault(queue.owner, []).append(f"[{content}]")
        return {owner: " ".join(word for word in found if word) for owner, found in words.items()}


def _compiled(net: Net) -> dict[str, Any]:
    """The three functions, from source made of the net's own table."""
    cells = {thing.name: f"v{place}" for place, thing in enumerate(net.things)}
    unpack = f"    {', '.join(cells.values())}, = s\n"
    source = ["def moves(s):\n", unpack, "    out = []\n", *_commands(net, cells)]
    source += ["    return out\n"]
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

    def by_cell(self) -> "list[tuple[str, _Tree]]":
        """The branches, those that ask for the same cell together."""
        return sorted(self.branches.items(), key=lambda branch: branch[0].split(" == ")[0])

    def in_order(self) -> Iterator[str]:
        """The moves in the order in which `lines` has them."""
        yield from self.moves
        for _, branch in self.by_cell():
            yield from branch.in_order()

    def lines(self, indent: str) -> list[str]:
        """Source; branches that compare one cell with different numbers exclude each other."""
        lines = [f"{indent}out.append({move})\n" for move in self.moves]
        before = ""
        for condition, branch in self.by_cell():
            cell, _, number = condition.partition(" == ")
            word = "elif" if number.isdigit() and cell == before else "if"
            before = cell if number.isdigit() else ""
            lines += [f"{indent}{word} {condition}:\n", *branch.lines(indent + " ")]
        return lines


def _commands(net: Net, cells: Cells) -> list[str]:
    """The body of `moves`."""
    moves = []
    for command in net.commands:
        there = _after(net, command.effects, cells)
        moves.append(
            f"({command.who!r}, {command.what!r}, {there}, {command.fair}, {command.fault})"
        )
    return _tree(net, cells, moves).lines("    ")


def _tree(net: Net, cells: Cells, moves: list[str]) -> _Tree:
    """The moves of all commands under their conditions."""
    known, tree = net.by_name, _Tree()
    for command, move in zip(net.commands, moves, strict=True):
        conditions = [_guard(guard, known, cells) for guard in command.guards]
        conditions += [f"len({cells[name]}) <= {most}" for name, most in rooms(net, command)]
        tree.add(conditions, move)
    return tree


def rooms(net: Net, command: Command) -> Iterator[tuple[str, int]]:
    """Yield the queues that must have room for what a command sends, and how many words may be in
    each.
    """
    for queue in net.queues:
        mine = [type(effect) for effect in command.effects if effect[0] == queue.name]
        more = mine.count(Send) - mine.count(Take)
        if more > 0:
            yield queue.name, queue.capacity - more


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
            numbers = [known[name].words.index(word) for word in words]
            return f"{cell} and {_one_of(f'{cell}[0]', numbers)}"
        case Empty():
            return f"not {cell}"


def _one_of(cell: str, numbers: list[int]) -> str:
    if len(numbers) == 1:
        return f"{cell} == {numbers[0]}"
    return f"{cell} in {tuple(sorted(numbers))!r}"


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
                place = thing.words.index(word) if isinstance(thing, Queue) else ""
                now[name] = f"({now[name]} + ({place},))"
    return f"({', '.join(now[name] for name in cells)},)"


# --- A net as tables for the explorer in C: one site, whose key is what most commands ask ---------


class _NetTables(Tables):
    """`contents`: numbers of what is in queues, each a tuple of words by number."""

    def __init__(self, net: Net, contents: Numbered) -> None:
        super().__init__((*(one.first for one in net.variables), *(0 for _ in net.queues)))
        self.net, self.contents, self.known = net, contents, net.by_name
        self.place = {thing.name: place for place, thing in enumerate(net.things)}
        asked = Counter(
            guard.variable
            for command in net.commands
            for guard in command.guards
            if isinstance(guard, Is)
        )
        self.keys = [name for name, _ in asked.most_common(KEYS)]
        cells = {thing.name: f"v{place}" for place, thing in enumerate(net.things)}
        numbers = [str(number) for number in range(len(net.commands))]
        self.moves = [
            (command, self._move(command))
            for number in _tree(net, cells, numbers).in_order()
            for command in (net.commands[int(number)],)
        ]
        self.sites.append(Site(tuple(self.place[name] for name in self.keys), self._row))
        self.rest += [Case(self._all(guards)) for guards in net.rest]
        self.wrong += [Case(self._all(one.guards), self.text(one.text)) for one in net.wrong]

    def _row(self, *values: int) -> Row:
        words = {
            name: self.net.variables[self.place[name]].values[value]
            for name, value in zip(self.keys, values, strict=True)
        }
        return Row(
            tuple(
                move
                for command, move in self.moves
                if all(
                    words[guard.variable] in guard.values
                    for guard in command.guards
                    if isinstance(guard, Is) and guard.variable in words
                )
            )
        )

    def _move(self, command: Command) -> FlatMove:
        has = (Has.FAIR if command.fair else Has(0)) | (Has.FAULT if command.fault else Has(0))
        asked = [one for one in command.guards if one[0] not in self.keys]
        conditions = [*self._all(tuple(asked)), *self._room(command)]
        only = [Step(Do.ONLY_IF, one.slot, one.function) for one in conditions]
        return FlatMove(has, (*only, *map(self._step, command.effects)))

    def _room(self, command: Command) -> Iterator[If]:
        for name, most in rooms(self.net, command):
            yield self._of_queue(name, ("room", most), partial(_has_room, most))

    def _all(self, guards: tuple[Guard, ...]) -> tuple[If, ...]:
        return tuple(map(self._condition, guards))

    def _condition(self, guard: Guard) -> If:
        match guard:
            case Is(name, values):
                numbers = self._numbers(name, values)
                return self.condition(self.place[name], ("is", numbers), numbers.__contains__)
            case Head(name, values):
                heads = self._numbers(name, values)
                return self._of_queue(
                    name, ("head", heads), lambda words: bool(words) and words[0] in heads
                )
            case Empty(name):
                return self._of_queue(name, "empty", lambda words: not words)

    def _of_queue(self, queue: str, name: Hashable, holds: Callable[[Any], bool]) -> If:
        values = self.contents.values
        return self.condition(self.place[queue], name, lambda number: holds(values[number]))

    def _numbers(self, name: str, values: frozenset[str]) -> frozenset[int]:
        thing = self.known[name]
        domain = thing.values if isinstance(thing, Variable) else thing.words
        return frozenset(map(domain.index, values))

    def _step(self, effect: Effect) -> Step:
        place, contents = self.place[effect[0]], self.contents
        match effect:
            case Set(name, value):
                (number,) = self._numbers(name, frozenset({value}))
                return Step(Do.SET, place, number)
            case Copy(_, source):
                return Step(Do.COPY, place, self.place[source])
            case Take():
                taken = self.function("take", lambda words: contents(contents.values[words][1:]))
                return Step(Do.MAP, place, taken)
            case Send(name, word):
                (added,) = self._numbers(name, frozenset({word}))
                sent = self.function(
                    ("send", added), lambda words: contents((*contents.values[words], added))
                )
                return Step(Do.MAP, place, sent)


def _has_room(most: int, words: tuple[int, ...]) -> bool:
    return len(words) <= most


# --- A net as Promela, so that spin can give a second opinion (spinroot.com; SPIN 6.5 was tried)
# One process, one loop, one `d_step` for each command: spin stores exactly the states that are
# explored here. What is wrong is an assertion, a deadlock an invalid end state; in nets with
# faults it is an assertion as well, since a fault that may still happen is not a way out. Whether
# rest can be reached from everywhere is a branching property, which spin does not check. Verify
# with: spin -a -o1 -o2 FILE; gcc -DSAFETY -DNOREDUCE -o pan pan.c; ./pan -m1000000 -c0 (-o1 -o2:
# else spin leaves out variables that nobody asks, and stores fewer states).


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
    yield f"#define REST ({_any_promela(net, net.rest, names)})"
    yield f"#define WRONG ({_any_promela(net, tuple(wrong.guards for wrong in net.wrong), names)})"


def _process(net: Net, names: Names) -> Iterator[str]:
    yield "active proctype net() {"
    yield "  do"
    for wrong in net.wrong:
        step = f"{{ {_all_promela(net, wrong.guards, names)} -> assert(false) }}"
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
    return " && ".join([_all_promela(net, command.guards, names), *room])


def _any_promela(net: Net, alternatives: tuple[tuple[Guard, ...], ...], names: Names) -> str:
    return (
        " || ".join(f"({_all_promela(net, guards, names)})" for guards in alternatives) or "false"
    )


def _all_promela(net: Net, guards: tuple[Guard, ...], names: Names) -> str:
    known = net.by_name
    conditions = (_promela_guard(known[guard[0]], guard, names[guard[0]]) for guard in guards)
    return " && ".join(conditions) or "true"


def _promela_guard(thing: Variable | Queue, guard: Guard, name: str) -> str:
    match guard, thing:
        case Is(_, wanted), Variable(_, values):
            numbers = sorted(values.index(value) for value in wanted)
            text = " || ".join(f"{name} == {number}" for number in numbers)
        case Head(_, wanted), Queue(_, words):
            numbers = sorted(words.index(word) for word in wanted)
            text = " || ".join(f"{name}?[{number}]" for number in numbers)
        case Empty(), _:
            return f"len({name}) == 0"
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
        case _:
            raise AssertionError(effect)


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *")
