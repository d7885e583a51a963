"""Protocols in use: a sequence diagram of each (the paper's Figures 8 and 9), its messages, and the
rows behind it.
"""

from collections.abc import Container, Iterable, Iterator, Mapping
from typing import NamedTuple

import msgspec

from fipa_codec.exploration import reached
from fipa_codec.performatives import Performative
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Role, Row, Way
from topdown.draw import sequence
from topdown.draw.canvas import Canvas
from topdown.draw.document import Figure, Grid, Section, listed, rulings
from topdown.draw.system import seconds, size
from topdown.model.design import Design, fipa_table
from topdown.model.elements import Message
from topdown.model.elements import Protocol as Use
from topdown.model.errors import NoSuchEntry

# --- Two roles of a protocol walked together as if every message arrived at once: where they can
# be, what is said there Nothing crosses on the way, so what is found is what people draw;
# `fipa_codec.exploration` looks at all that may cross.


Place = tuple[str, str]
"""States of initiator and participant."""
Sayable = Mapping[Role, Container[Performative]]
"""The acts each role uses of those that its table has."""


class Edge(NamedTuple):
    """Messages that may be said in a place, the rows that say them, and the place after each."""

    sender: Role
    sent: Row
    taken: Row
    to: Place

    @property
    def interrupts(self) -> bool:
        """Said at will, and the main line is left."""
        return self.sent.free and self.sent.to != self.sent.state

    @property
    def said(self) -> tuple[Role, str]:
        """The sender and its words."""
        return self.sender, self.sent.word


Meeting = dict[Place, tuple[Edge, ...]]


def spoken(role: Role, row: Row, sayable: Sayable | None) -> bool:
    """Whether the act of a row is among those its speaker uses."""
    speaker = role if row.way is SEND else role.other
    return sayable is None or row.performative in sayable[speaker]


def meet(protocol: Protocol, sayable: Sayable | None = None) -> Meeting:
    """Every place both roles can reach if messages arrive at once, with what may be said there."""
    found: Meeting = {}
    waiting: list[Place] = [(START, START)]
    for place in waiting:
        found[place] = tuple(_edges(protocol, place, sayable))
        waiting += dict.fromkeys(e.to for e in found[place] if e.to not in waiting)
    return found


def _edges(protocol: Protocol, place: Place, sayable: Sayable | None) -> Iterator[Edge]:
    states = dict(zip((Role.INITIATOR, Role.PARTICIPANT), place, strict=True))
    for role, table in protocol.tables.items():
        peer = protocol.tables[role.other]
        if states[role.other] in peer.urgent:
            continue
        for sent in table.allowed(states[role], SEND):
            taken = peer.find(states[role.other], RECEIVE, sent.performative, sent.kind)
            if taken and spoken(role, sent, sayable):
                to = {role: str(sent.to), role.other: str(taken.to)}
                yield Edge(role, sent, taken, (to[Role.INITIATOR], to[Role.PARTICIPANT]))


def name_of(place: Place) -> str:
    """The states of both roles in words."""
    one, other = place
    return one if one == other else f"{one} / {other}"


# --- From a protocol's two tables to what can be drawn: alternatives, loops and options -----------
# Rows that only crossing messages or copies need are told apart. What one may say at any time but
# nobody can wait for (`Row.free`: a cancel) is taken out of the main line and gets an option of its
# own. Nothing here knows a particular protocol.


DECLINING = frozenset({P.REFUSE, P.FAILURE, P.REJECT_PROPOSAL, P.DISCONFIRM, P.NOT_UNDERSTOOD})
"""Acts that say no (SC00037J): their branches stand behind the others."""


class Sending(msgspec.Struct, frozen=True, tag="Said"):  # documents have this word
    """One side says one of these; `words`: performatives with their guard words."""

    sender: Role
    words: tuple[str, ...]
    acts: tuple[Performative, ...]


class Remark(msgspec.Struct, frozen=True, tag=True):
    """State of the conversation here: ended, where it goes on, a name that is referred to."""

    text: str


class Frame(msgspec.Struct, frozen=True, tag=True):
    """alt: one of the branches; loop: the branch any number of times; opt: the branch or
    nothing.
    """

    kind: str
    title: str
    branches: tuple[tuple["Part", ...], ...]


Part = Sending | Remark | Frame


class Exchange(msgspec.Struct, frozen=True):
    """The parts in order, and the rows no part shows (role, row): crossing messages, copies,
    repetitions.
    """

    parts: tuple[Part, ...]
    crossing: tuple[tuple[Role, Row], ...]


def exchange(protocol: Protocol, sayable: Sayable | None = None) -> Exchange:
    """The exchange two tables make; `sayable`: the acts each role uses of those that its table has
    (None: all).
    """
    meeting = meet(protocol, sayable)
    used = {(e.sender, e.sent) for edges in meeting.values() for e in edges}
    used |= {(e.sender.other, e.taken) for edges in meeting.values() for e in edges}
    rows = ((role, row) for role, table in protocol.tables.items() for row in table)
    unused = (found for found in rows if found not in used and spoken(*found, sayable))
    return Exchange(_Writer(protocol, meeting).parts(), tuple(unused))


class _Writer:
    """Writes each place once; a place met again becomes a reference, unless it is short."""

    def __init__(self, protocol: Protocol, meeting: Meeting) -> None:
        self.protocol, self.meeting = protocol, meeting
        places = meeting.items()
        self.main = {place: tuple(e for e in here if not e.interrupts) for place, here in places}
        self.written: set[Place] = set()
        self.referred: set[Place] = set()
        self.marks: dict[Remark, Place] = {}

    def parts(self) -> tuple[Part, ...]:
        parts = [*self._line((START, START), ()), *self._interruptions()]
        return tuple(self._marked(parts))

    def _interruptions(self) -> Iterator[Part]:
        found: dict[tuple[tuple[Role, str], Place], list[tuple[Place, Edge]]] = {}
        for place, edges in self.meeting.items():
            for edge in edges:
                if edge.interrupts:
                    found.setdefault((edge.said, edge.to), []).append((place, edge))
        self.referred |= {place for sources in found.values() for place, _ in sources}
        whiles: dict[tuple[Part, ...], list[Place]] = {}
        for (_, place), sources in found.items():
            after = (*_sendings([sources[0][1]]), *self._line(place, ()))
            whiles.setdefault(after, []).extend(source for source, _ in sources)
        for after, places in whiles.items():
            yield Frame("opt", f"while {' or '.join(name_of(place) for place in places)}", (after,))

    def _line(self, place: Place, heads: tuple[Place, ...]) -> list[Part]:
        """The parts that follow a place, up to the end or the innermost head of a loop."""
        if place in heads:
            return [] if place == heads[-1] else [self._reference(place)]
        if place in self.written:
            return self._short_line(place) if self._short(place) else [self._reference(place)]
        first, place = self._before_the_choice(place, heads)
        self.written.add(place)
        parts: list[Part] = [*first, self._mark(place)]
        back = [e for e in self.main[place] if self._returns(e.to, place, heads)]
        if back:
            parts.append(Frame("loop", "", (tuple(self._either(_grouped(back), (*heads, place))),)))
        out = [e for e in self.main[place] if e not in back]
        if not out:
            return [*parts, self._end(place)]
        onward = self._either(_grouped(out), heads)
        if self._rests(place):
            onward = _or_else(onward, Remark(f"may stay: {name_of(place)}"))
        return [*parts, *onward]

    def _short_line(self, place: Place) -> list[Part]:
        """One or two messages and the end, written once more."""
        parts: list[Part] = []
        while self.main[place]:
            parts += _sendings(list(self.main[place]))
            place = self.main[place][0].to
        return [*parts, self._end(place)]

    def _before_the_choice(
        self, place: Place, heads: tuple[Place, ...]
    ) -> tuple[list[Part], Place]:
        """Messages without a choice before a loop, and the place where the loop is entered or
        left.
        """
        first: list[Part] = []
        here, passed = place, {place}
        while len(self.main[here]) == 1 and not self._rests(here):
            first += _sendings(list(self.main[here]))
            here = self.main[here][0].to
            if here in passed or here in heads:
                return [], place
            passed.add(here)
        return (first, here) if first and self._returns(here, place, heads) else ([], place)

    def _either(self, groups: list[list[Edge]], heads: tuple[Place, ...]) -> list[Part]:
        """One of several things is said, each with what follows."""
        line: list[list[Part]] = []
        shortcut = self._shortcut(groups, heads)
        if shortcut is not None:
            detour, groups = shortcut
            place = detour[0].to
            self.written.add(place)
            step: list[Part] = [*_sendings(detour), self._mark(place)]
            if loops := [e for e in self.main[place] if e.to == place]:
                inside = self._either(_grouped(loops), (*heads, place))
                step.append(Frame("loop", "", (tuple(inside),)))
            rest = self._either(_grouped([e for e in self.main[place] if e.to != place]), heads)
            line = [[Frame("opt", "", (tuple(step),)), *rest]]
        branches = ([*_sendings(group), *self._line(group[0].to, heads)] for group in groups)
        return _alternatives([*line, *branches])

    def _shortcut(
        self, groups: list[list[Edge]], heads: tuple[Place, ...]
    ) -> tuple[list[Edge], list[list[Edge]]] | None:
        """A step that can be omitted without hiding a message from the diagram (an agree), else
        None.

        That is: after it only messages are possible that were possible before it. Also return the
        groups of messages that it does not lead to.
        """
        offered = {(e.said, e.to) for group in groups for e in group}
        for group in groups:
            place = group[0].to
            onward = {(e.said, e.to) for e in self.main[place] if e.to != place}
            known = place in self.written or place in heads or self._rests(place)
            if not known and onward and onward <= offered - {(e.said, e.to) for e in group}:
                others = [g for g in groups if g is not group]
                return group, [g for g in others if not {(e.said, e.to) for e in g} <= onward]
        return None

    def _returns(self, place: Place, head: Place, heads: tuple[Place, ...]) -> bool:
        """Whether the main line leads from a place to a head without passing the heads around
        it.
        """
        return head in reached(
            [place], lambda here: () if here in heads else (e.to for e in self.main[here])
        )

    def _rests(self, place: Place) -> bool:
        tables = (self.protocol.tables[role] for role in (Role.INITIATOR, Role.PARTICIPANT))
        ends = (table.ended | table.resting for table in tables)
        return all(state in still for state, still in zip(place, ends, strict=True))

    def _short(self, place: Place) -> bool:
        """Whether what follows is one or two messages without a choice."""
        for _ in range(3):
            edges = self.main[place]
            if not edges:
                return True
            if len(edges) > 1 or edges[0].to == place or self._rests(place):
                return False
            place = edges[0].to
        return False

    def _end(self, place: Place) -> Remark:
        return Remark(f"{'ends' if self._rests(place) else 'stands still'}: {name_of(place)}")

    def _reference(self, place: Place) -> Remark:
        self.referred.add(place)
        return Remark(f"goes on as at ({name_of(place)})")

    def _mark(self, place: Place) -> Remark:
        mark = Remark(f"({name_of(place)})")
        self.marks[mark] = place
        return mark

    def _marked(self, parts: Iterable[Part]) -> Iterator[Part]:
        """The parts with the marks that something refers to, and without the others."""
        for part in parts:
            if isinstance(part, Frame):
                branches = (tuple(self._marked(branch)) for branch in part.branches)
                yield Frame(part.kind, part.title, tuple(branches))
            elif isinstance(part, Sending) or self.marks.get(part) in {None, *self.referred}:
                yield part


def _grouped(edges: list[Edge]) -> list[list[Edge]]:
    """Edges of one speaker to one place together."""
    groups: dict[tuple[Role, Place], list[Edge]] = {}
    for edge in edges:
        groups.setdefault((edge.sender, edge.to), []).append(edge)
    return sorted(
        groups.values(), key=lambda group: all(e.sent.performative in DECLINING for e in group)
    )


def _sendings(edges: list[Edge]) -> tuple[Sending, ...]:
    words = tuple(edge.sent.word for edge in edges)
    acts = tuple(dict.fromkeys(edge.sent.performative for edge in edges))
    return (Sending(edges[0].sender, words, acts),) if edges else ()


def _alternatives(branches: list[list[Part]]) -> list[Part]:
    alternatives: list[Part] = [Frame("alt", "", tuple(map(tuple, branches)))]
    return branches[0] if len(branches) == 1 else alternatives


def _or_else(parts: list[Part], other: Part) -> list[Part]:
    """One more alternative."""
    match parts:
        case [Frame("alt", title, branches)]:
            return [Frame("alt", title, (*branches, (other,)))]
    return _alternatives([parts, [other]])


# --- Protocols in use -----------------------------------------------------------------------------


ALWAYS = "not-understood: either side may say it at any point; it ends the conversation."
NAMED = 3  # classes of a content that are named in a diagram

Carried = Mapping[tuple[Role, Performative], tuple[tuple[str, tuple[str, ...]], ...]]
"""Contents of each act: a language, and what may be said in it (nothing: no content)."""


def section(design: Design, wanted: str | None, width: int) -> Section:
    """Every use of a protocol, or those named so; a table that the design does not use is drawn
    with its roles.
    """
    uses = [use for use in design.file.protocol if wanted in (None, use.name, use.follows)]
    parts: list[Grid | Figure] = []
    for use in uses:
        texts = (entry.text for entry in design.file.table if entry.name == use.follows)
        about = tuple(" ".join(text.split()) for text in texts if text)
        parts += _use(use, design.tables.get(use.follows), about, width)
    if not uses:
        table = design.own_tables.get(wanted or "") or fipa_table(wanted or "")
        if table is None:
            raise NoSuchEntry("protocol", str(wanted), sorted({*design.protocols, *design.tables}))
        found = exchange(table)
        shown = diagram(found, f"{table.name}, by its table")
        figure = _figure(f"protocol-{table.name}", shown, found, width, (ALWAYS,))
        parts = [figure, _rows(f"The rows of {table.name}", table, found, None)]
    lead = (
        "Who may say what, in which order. alt: one of these; loop: any number of times; opt: once"
        " or not at all."
    )
    return Section("protocols", "Protocols", lead, tuple(parts))


def _use(
    use: Use, protocol: Protocol | None, about: tuple[str, ...], width: int
) -> list[Grid | Figure]:
    parts: list[Grid | Figure] = []
    if protocol is not None:
        cast = (use.initiator, use.participant)
        said = (frozenset(m.performative for m in use.message if m.sender == n) for n in cast)
        sayable = dict(zip((Role.INITIATOR, Role.PARTICIPANT), said, strict=True))
        found = exchange(protocol, sayable)
        caption = f"{use.name}: {use.follows} on {use.channel}, {cast[0]} asks {cast[1]}"
        notes = (*about, ALWAYS, *rulings((use.name, use.ruling)))
        shown = diagram(found, caption, cast, _carried(use))
        parts.append(_figure(f"protocol-{use.name}", shown, found, width, notes))
    parts.append(_messages(use))
    if protocol is not None:
        parts.append(_rows(f"{use.name}: the rows of {use.follows}", protocol, found, sayable))
    return parts


def draw(protocol: Protocol) -> Canvas:
    """The drawing of a protocol between no particular agents, with its name above."""
    canvas = sequence.draw(diagram(exchange(protocol), f"The protocol {protocol.name}"))
    canvas.words((canvas.boxes[0].x, -14), protocol.name, "strong large")
    return canvas


def _figure(
    name: str, shown: sequence.Diagram, found: Exchange, width: int, notes: tuple[str, ...]
) -> Figure:
    text = sequence.plain(shown, width)
    return Figure(name, shown.title, sequence.draw(shown), text, found.parts, notes)


def diagram(
    found: Exchange,
    title: str,
    cast: tuple[str, str] = ("initiator", "participant"),
    carried: Carried | None = None,
) -> sequence.Diagram:
    """An exchange between initiator and participant as a diagram; `carried`: what stands below the
    arrows.
    """

    def rows(parts: tuple[Part, ...]) -> tuple[sequence.Row, ...]:
        found: list[sequence.Row] = []
        for part in parts:
            if isinstance(part, Sending):
                ends = cast if part.sender is Role.INITIATOR else cast[::-1]
                *first, last = part.words
                label = f"{', '.join(first)} or {last}" if first else last
                found.append(sequence.Arrow(*ends, label, _detail(part, carried or {})))
            elif isinstance(part, Frame):
                found.append(sequence.Frame(part.kind, part.title, tuple(map(rows, part.branches))))
            else:
                found.append(sequence.Note(part.text))
        return tuple(found)

    return sequence.Diagram(title, cast, rows(found.parts))


def _detail(said: Sending, carried: Carried) -> str:
    """The content of these acts in words: languages, and classes of each."""
    languages: dict[str, dict[str, None]] = {}
    for act in said.acts:
        for language, names in carried.get((said.sender, act), ()):
            languages.setdefault(language, {}).update(dict.fromkeys(names or ("no content",)))

    def few(names: list[str]) -> str:
        more = [f"{len(names) - NAMED} more"] if len(names) > NAMED + 1 else names[NAMED:]
        return ", ".join([*names[:NAMED], *more])

    return "; ".join(f"{language}: {few(list(names))}" for language, names in languages.items())


def _carried(use: Use) -> Carried:
    carried: dict[tuple[Role, Performative], tuple[tuple[str, tuple[str, ...]], ...]] = {}
    for message in use.message:
        key = (use.role(message.sender), message.performative)
        carried[key] = (*carried.get(key, ()), (message.language, _contents(message)))
    return carried


def _contents(message: Message) -> tuple[str, ...]:
    return tuple(f"one of {name[1:]}" if name.startswith("*") else name for name in message.content)


def _messages(use: Use) -> Grid:
    """The communicates <V, Z, L, O, I> in detail."""
    rows = []
    for m in use.message:
        words = (m.performative.value, m.language, listed(_contents(m), "none"))
        rows.append(
            (f"{m.sender} → {use.peer(m.sender)}", *words, use.ontology or "-", size(m.bytes))
        )
    within = f" (answer within {seconds(use.latency_s)})" if use.latency_s else ""
    notes = rulings(*((f"{m.sender} {m.performative}", m.ruling) for m in use.message))
    head = ("from → to", "performative", "language", "content", "ontology", "at most")
    return Grid(f"{use.name}: messages{within}", head, tuple(rows), notes)


def _rows(title: str, protocol: Protocol, found: Exchange, sayable: Sayable | None) -> Grid:
    """The table itself; rows the diagram does not show are marked."""
    rows = []
    for role, row in ((role, row) for role, table in protocol.tables.items() for row in table):
        seen = "if messages cross or come twice" if (role, row) in found.crossing else "yes"
        seen = seen if spoken(role, row, sayable) else "not said in this use"
        act = f"{'says' if row.way is Way.SEND else 'takes'} {row.word}"
        rows.append((role.value, row.state, act, row.to, seen))
    head = ("role", "state", "act", "next state", "in the diagram")
    return Grid(title, head, tuple(rows), detail=True)
