"""`roco protocol`: the interaction protocols that a design can follow, as the tables that decide
what is allowed.
"""

import shutil
from pathlib import Path
from typing import Annotated

import msgspec

from console import completion
from console.design import files
from console.design.show import write
from console.errors import UsageError
from console.output import Form, Format, argument, option, tell, tell_json
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import FIPA, PAPER
from fipa_codec.tables import Protocol, Role, Row, Table, Way, known
from operate.system import NoSystemError, here
from topdown.draw import document
from topdown.draw.document import Grid
from topdown.draw.protocols import ALWAYS, draw

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


def protocol(
    name: Annotated[
        str, argument("A protocol.", complete=completion.every_protocol, metavar="[NAME]")
    ] = "",
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
      roco protocol fipa-contract-net --svg contract_net.svg
    """
    with files.problems(form):
        if not name:
            if svg is not None:
                raise UsageError(
                    "--svg draws one protocol; name it: `roco protocol NAME --svg FILE`"
                )
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
