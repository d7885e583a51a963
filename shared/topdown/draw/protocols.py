"""Protocols in use: a sequence diagram of each (the paper's Figures 8 and 9), its messages, and the
rows behind it.
"""

from collections.abc import Mapping

from fipa_codec.performatives import Performative
from fipa_codec.tables import Protocol, Role, Way
from topdown.draw import exchange as exchanges
from topdown.draw import sequence
from topdown.draw.canvas import Canvas
from topdown.draw.document import Figure, Grid, Section, listed, rulings
from topdown.draw.exchange import Exchange, Part, Sayable, Sending, exchange, spoken
from topdown.draw.system import seconds, size
from topdown.model.design import Design
from topdown.model.elements import Message
from topdown.model.elements import Protocol as Use
from topdown.model.errors import NoSuchEntry
from topdown.model.own_tables import fipa_table

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
            elif isinstance(part, exchanges.Frame):
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
        role = Role.INITIATOR if message.sender == use.initiator else Role.PARTICIPANT
        key = (role, message.performative)
        carried[key] = (*carried.get(key, ()), (message.language, _contents(message)))
    return carried


def _contents(message: Message) -> tuple[str, ...]:
    return tuple(f"one of {name[1:]}" if name.startswith("*") else name for name in message.content)


def _messages(use: Use) -> Grid:
    """The communicates <V, Z, L, O, I> in detail."""
    rows = []
    for m in use.message:
        to = use.participant if m.sender == use.initiator else use.initiator
        words = (m.performative.value, m.language, listed(_contents(m), "none"))
        rows.append((f"{m.sender} → {to}", *words, use.ontology or "-", size(m.bytes)))
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
