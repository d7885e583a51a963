"""`roco design show`: what the method's paper has in tables and figures, of any design file, as
text, SVG and HTML; `roco protocol`: the tables of the protocols it can follow.
"""

import shutil
from pathlib import Path
from typing import Annotated

import msgspec

from console import completion
from console.design import files
from console.errors import NO, UsageError
from console.output import Form, Format, argument, option, tell, tell_json
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import FIPA, PAPER
from fipa_codec.tables import START, Protocol, Role, Row, Table, Way, known
from operate.system import NoSystemError, here
from topdown.draw import book, document
from topdown.draw.document import Figure, Grid, Section
from topdown.draw.protocols import ALWAYS, draw
from topdown.model.design import load


def show(
    file: files.File = None,
    what: Annotated[list[book.What] | None, option("What to show; may be repeated.")] = None,
    step: Annotated[
        int | None,
        option(
            "Of steps and tree: after which step; else all, and the last.",
            complete=completion.steps,
        ),
    ] = None,
    agent: Annotated[
        str | None,
        option("Of interfaces, rights and machines: whose; else all.", complete=completion.agents),
    ] = None,
    protocol: Annotated[
        str | None,
        option(
            "Of protocols: which use, or the table they follow.",
            complete=completion.protocols_and_uses,
        ),
    ] = None,
    html: Annotated[Path | None, option("Write one self-contained page of it here.")] = None,
    svg: Annotated[Path | None, option("Write its figures into this folder.")] = None,
    long: Annotated[
        bool, option("Also the rows behind diagrams, which a page folds.", "--long")
    ] = False,
    form: Form = Format.TEXT,
) -> None:
    """Show a design: requirements, steps, channels, protocols, the system, state machines.

    Examples:
      roco design show
      roco design show --agent AGENT
      roco design show --what system
    """
    with files.problems(form, NO):
        chosen = chosen_of(what or [], step, agent, protocol)
        width = shutil.get_terminal_size((document.WIDTH, 0)).columns
        design = load(files.meant(file))
        choice = book.Choice(chosen, step, agent, protocol, max(40, width))
        sections = book.sections(design, choice)
        made = write(book.page_of(design, sections), html) + write_all(book.figures(sections), svg)
        if form is Format.JSON:
            print(msgspec.json.encode([plain(section) for section in sections]).decode())
        elif made:
            print("\n".join(f"wrote {path}" for path in made))
        else:
            print(document.written(sections, max(40, width), long), end="")


def chosen_of(
    what: list[book.What], step: int | None, agent: str | None, protocol: str | None
) -> tuple[book.What, ...]:
    """The sections that are meant: those named; else those that a step, an agent or a protocol is
    of; else all.
    """
    if what:
        return tuple(what)
    meant = {
        book.What.STEPS: step is not None,
        book.What.INTERFACES: agent is not None,
        book.What.MACHINES: agent is not None,
        book.What.PROTOCOLS: protocol is not None,
    }
    return tuple(one for one, is_meant in meant.items() if is_meant) or (book.What.ALL,)


def plain(section: Section) -> dict[str, object]:
    """A section as plain data: tables by their heads, figures by what they show."""
    parts: list[dict[str, object]] = []
    for part in section.parts:
        if isinstance(part, Figure):
            told = {"figure": part.name, "caption": part.caption, "data": part.data}
        else:
            told = {"table": part.title, "head": part.head, "rows": part.rows}
        parts.append({**told, "notes": part.notes})
    return {"what": section.what, "title": section.title, "parts": parts}


def write(words: str, path: Path | None) -> list[Path]:
    """Write a file, if there is a path; the files written."""
    if path is None:
        return []
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(words, encoding="utf-8")
    return [path]


def write_all(texts: dict[str, str], folder: Path | None) -> list[Path]:
    """Write files into a folder, if there is one."""
    if folder is None:
        return []
    return [path for name, words in texts.items() for path in write(words, folder / name)]


# --- `roco protocol`: the protocols that a design can follow, as the tables that decide -----------


LEAST = 40
"""Columns below which no table is readable (estimate)."""
MEANING = {
    "ended": "over for this role; a row from there is for what comes late or twice",
    "urgent": "the role answers in the same step, and takes nothing before",
    "resting": "may last for ever; nobody has to say more",
}
"""Marks of a table's states, in words."""
KINDS = {
    Kind.PROGRESS: "a report while the act goes on",
    Kind.FINAL: "the last report",
    Kind.CANCEL: "the answer to the cancel",
}
"""Kinds of an act, in words."""


class Line(msgspec.Struct, frozen=True):
    """A row of a table: in `state` the role says or hears (`way`) an act, and is in `to` then."""

    state: str
    way: Way
    act: Performative
    kind: Kind
    to: str


class Side(msgspec.Struct, frozen=True):
    """The table of a role."""

    rows: tuple[Line, ...]
    ended: tuple[str, ...]
    urgent: tuple[str, ...]
    resting: tuple[str, ...]


class Listed(msgspec.Struct, frozen=True):
    """A protocol: its names, the acts that open it, whose rules it has, and what a design says of
    its own.
    """

    name: str
    aliases: tuple[str, ...]
    openings: tuple[str, ...]
    origin: str
    text: str = ""


class Shown(msgspec.Struct, frozen=True):
    """A protocol with its tables."""

    about: Listed
    confirmed: tuple[str, ...]
    rounds: tuple[str, ...]
    roles: dict[Role, Side]


class States(msgspec.Struct, frozen=True):
    """The states of a role's conversation, as guards name them."""

    protocol: str
    role: Role
    open: tuple[str, ...]
    over: tuple[str, ...]


def protocol(
    name: Annotated[
        str, argument("A protocol.", complete=completion.every_protocol, metavar="[NAME]")
    ] = "",
    states: Annotated[
        bool, option("List the states of both roles, as guards name them.", "--states")
    ] = False,
    svg: Annotated[Path | None, option("Draw the exchange, and write it here.", "--svg")] = None,
    form: Form = Format.TEXT,
) -> None:
    """List the protocols that a design can follow; show the tables of one: who may say what in
    which state.

    Listed are those of the specifications, of the paper, and those that the design here brings
    along.

    The tables alone decide what is in sequence: agents, the judge and the proof read them. An act
    that has no row in a state is an error there. The drawing shows the exchange as if nothing
    crossed on the way.

    Examples:
      roco protocol
      roco protocol request
      roco protocol --states
      roco protocol fipa-contract-net --svg contract_net.svg
    """
    with files.problems(form):
        if svg is not None and (states or not name):
            raise UsageError("--svg draws one protocol; name it: `roco protocol NAME --svg FILE`")
        if states:
            _tell_states([_meant(name)] if name else every(), form)
            return
        if not name:
            found = [about for about, _ in every()]
            rows = tuple(
                (one.name, _several(one.aliases), _several(one.openings), one.origin)
                for one in found
            )
            heads = ("protocol", "also called", "opened by", "rules of")
            tell(found, form, document.table(Grid("", heads, rows), _width()))
            return
        about, one = _meant(name)
        made = write(draw(one).svg(), svg)
        if form is Format.JSON:
            roles = {role: _side(table) for role, table in one.tables.items()}
            tell_json(Shown(about, tuple(sorted(one.confirmed)), tuple(sorted(one.rounds)), roles))
        elif made:
            print(f"wrote {svg}")
        else:
            print(_written(about, one, _width()))


def _tell_states(found: list[tuple[Listed, Protocol]], form: Form) -> None:
    listed = [
        States(
            protocol.name,
            role,
            tuple(sorted(map(str, table.states - table.ended - {START}))),
            tuple(sorted(map(str, table.ended))),
        )
        for _, protocol in found
        for role, table in protocol.tables.items()
    ]
    rows = tuple((o.protocol, o.role, _several(o.open), _several(o.over)) for o in listed)
    heads = ("protocol", "role", "while it is open", "when it is over")
    tell(listed, form, document.table(Grid("", heads, rows), _width()))


def _side(table: Table) -> Side:
    marks = (tuple(sorted(getattr(table, mark))) for mark in MEANING)
    return Side(tuple(Line(*row) for row in _by_state(table)), *marks)


def every() -> list[tuple[Listed, Protocol]]:
    """All protocols, those of the design here first. Raises DesignError where it cannot be read."""
    own = _own()
    others = sorted((one for one in known() if one.name not in own), key=lambda one: one.name)
    return [*own.values(), *((_listed(one, _origin(one)), one) for one in others)]


def _own() -> dict[str, tuple[Listed, Protocol]]:
    """The protocols that the design of the system here brings along; none if no system is found."""
    try:
        system = here()
    except NoSystemError:
        return {}
    origin, found = f"the design of {system.name}", {}
    for one in system.design.file.table:
        own = system.design.own_tables[one.name]
        found[one.name] = (_listed(own, origin, one.text), own)
    return found


def _meant(name: str) -> tuple[Listed, Protocol]:
    found = every()
    for about, protocol in found:
        if name in (about.name, *about.aliases):
            return about, protocol
    names = ", ".join(about.name for about, _ in found)
    raise UsageError(f"no protocol {name!r}; there are {names}: `roco protocol`")


def _listed(one: Protocol, origin: str, words: str = "") -> Listed:
    openings = tuple(sorted(one.openings))
    return Listed(one.name, one.aliases, openings, origin, " ".join(words.split()))


def _origin(one: Protocol) -> str:
    """The origin of a protocol's rules: one of the two profiles, or both."""
    differs = (one in FIPA) != (one in PAPER)
    return ("FIPA" if one in FIPA else "the paper") if differs else "FIPA and the paper"


def _by_state(table: Table) -> list[Row]:
    """The rows, those of a state together, in the order in which states first appear."""
    states = [row.state for row in table]
    return sorted(table, key=lambda row: states.index(row.state))


def _written(about: Listed, protocol: Protocol, width: int) -> str:
    names = f", also called {_several(about.aliases)}" if about.aliases else ""
    opened = f"opened by {_several(about.openings)}; rules of {about.origin}"
    facts = [f"{about.name}{names}: {opened}", about.text]
    facts += [f"Each {act} is answered by a confirm." for act in sorted(protocol.confirmed)]
    opens = "of the initiator opens a new round"
    facts += [f"Each further {act} {opens}." for act in sorted(protocol.rounds)]
    sides = [_side_written(role, table, width) for role, table in protocol.tables.items()]
    used = {row.kind for table in protocol.tables.values() for row in table}
    legend = [*(f"[{kind}]: {words}." for kind, words in KINDS.items() if kind in used), ALWAYS]
    return "\n\n".join([_filled(list(filter(None, facts)), width), *sides, _filled(legend, width)])


def _side_written(role: Role, table: Table, width: int) -> str:
    rows, last = [], ""
    for row in _by_state(table):
        says = "says" if row.way is Way.SEND else "hears"
        rows.append((row.state if row.state != last else "", says, row.word, row.to))
        last = row.state
    heads = ("state", "says or hears", "act", "next state")
    lines = [document.table(Grid(str(role), heads, tuple(rows)), width)]
    for mark, words in MEANING.items():
        if states := sorted(getattr(table, mark)):
            lines += document.hung(f"{mark:<9}", f"{', '.join(states)}: {words}", width, " " * 9)
    return "\n".join(lines)


def _filled(paragraphs: list[str], width: int) -> str:
    return "\n".join(line for one in paragraphs for line in document.cell(one, width))


def _several(words: tuple[str, ...]) -> str:
    return ", ".join(words) or "-"


def _width() -> int:
    return max(LEAST, shutil.get_terminal_size((document.WIDTH, 0)).columns)
