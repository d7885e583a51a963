"""Interaction protocols that a design brings along, beside FIPA's: entries of the file made into
tables of rows.

Also the word by which files and people name a use of a performative: `inform`, `inform[final]`.
"""

import re

from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import Protocol, Row, Table
from topdown.model import elements
from topdown.model.errors import DesignError

_WORD = re.compile(r"(?P<act>[a-z-]+)(?:\[(?P<kind>[a-z]+)\])?")


def act_word(word: str) -> tuple[Performative, Kind]:
    """Performative and guard word of `inform[final]`. Raises ValueError, which says what there
    is.
    """
    match = _WORD.fullmatch(word)
    if match is None:
        raise ValueError(f"{word!r} is not an act; write `inform` or `inform[final]`")
    try:
        return Performative(match["act"]), Kind(match["kind"] or "")
    except ValueError:
        kinds = ", ".join(kind for kind in Kind if kind)
        raise ValueError(
            f"{word!r}: acts are {', '.join(Performative)}; guard words {kinds}"
        ) from None


def fipa_table(name: str) -> Protocol | None:
    """FIPA's protocol of that name or alias; None where there is none."""
    try:
        return named(name)
    except LocalProtocolError:
        return None


def own_table(entry: elements.Table, file: str = "design.toml") -> Protocol:
    """The protocol of an entry. Raises DesignError."""
    try:
        return Protocol(
            entry.name,
            initiator=_role(entry.initiator),
            participant=_role(entry.participant),
            confirmed=entry.confirmed,
            rounds=entry.rounds,
        )
    except (ValueError, LocalProtocolError) as error:
        right = "rows are [state, send or receive, act, next state], one for each state and act"
        raise DesignError(file, None, f"table {entry.name}", str(error), right) from error


def _role(role: elements.RoleTable) -> Table:
    rows = [Row(state, way, *act_word(act), to) for state, way, act, to in role.rows]
    return Table(rows, ended=role.ended, urgent=role.urgent, resting=role.resting)
