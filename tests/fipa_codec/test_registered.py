"""Protocols by name: the same one may be read twice in a process, another one of its name is an error."""

from collections.abc import Iterator

import pytest

from fipa_codec import tables
from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import RECEIVE, SEND, START, Protocol, Row, Table, named, register


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """Forget registrations after the test: other tests of the process list the names."""
    yield
    for name in ("knock", "tap"):
        tables._registered.pop(name, None)


def knock(*, answered: bool = True) -> Protocol:
    """A protocol of one question; each call makes another object."""
    ask = Row(START, SEND, Performative.QUERY_IF, Kind.PLAIN, "asked")
    answer = Row("asked", RECEIVE, Performative.INFORM if answered else Performative.REFUSE, Kind.PLAIN, "done")
    rows = (ask, answer)
    mirrored = tuple(row._replace(way=RECEIVE if row.way is SEND else SEND) for row in rows)
    return Protocol(
        "knock", initiator=Table(rows, ended=("done",)), participant=Table(mirrored, ended=("done",)), aliases=("tap",)
    )


def test_the_same_protocol_may_be_registered_twice() -> None:
    """A module that is read under two names is one system; the first one stays."""
    first = register(knock())
    register(knock())
    assert named("knock") is named("tap") is first


def test_another_protocol_of_a_name_is_an_error() -> None:
    """One row differs: conversations of a journal would go on by the wrong table."""
    register(knock())
    with pytest.raises(LocalProtocolError, match="'knock' is already another protocol"):
        register(knock(answered=False))
