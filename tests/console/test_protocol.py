"""`roco protocol`: the tables of every protocol, as they are registered or as the design has
them.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from calling import printed, roco

from companion.design import DESIGN
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.protocols import FIPA, PAPER
from fipa_codec.tables import Protocol, Role, Row, Table, Way, known


def names() -> list[str]:
    """Of all protocols, those that another test's system has registered too."""
    return sorted({one.name for one in known()} | set(DESIGN.own_tables))


protocol = partial(roco, "protocol", columns=200)


def of(name: str) -> Protocol:
    """The protocol itself."""
    return DESIGN.own_tables.get(name) or next(one for one in known() if one.name == name)


def table(side: dict[str, Any]) -> Table:
    """A table again, of what was printed of it."""
    rows = [
        Row(row["state"], Way(row["way"]), Performative(row["act"]), Kind(row["kind"]), row["to"])
        for row in side["rows"]
    ]
    return Table(rows, ended=side["ended"], urgent=side["urgent"], resting=side["resting"])


def test_json_is_the_whole_protocol() -> None:
    """Made again of what is printed, it is the same."""
    for name in names():
        shown = printed("protocol", name)
        again = Protocol(
            shown["about"]["name"],
            initiator=table(shown["roles"][Role.INITIATOR]),
            participant=table(shown["roles"][Role.PARTICIPANT]),
            aliases=tuple(shown["about"]["aliases"]),
            confirmed=map(Performative, shown["confirmed"]),
            rounds=map(Performative, shown["rounds"]),
        )
        assert again.same_as(of(name)), name


def halves() -> Iterator[tuple[list[str], str, Role]]:
    """The lines of each role of each protocol."""
    for name in names():
        said = protocol(name).stdout.replace("\nparticipant\n", "\ninitiator\n")
        _, *both = (half.splitlines() for half in said.split("\ninitiator\n"))
        for lines, role in zip(both, Role, strict=True):
            yield lines, name, role


def test_text_has_every_row_and_every_mark() -> None:
    """Under the table of its role; a state stands in the first of its rows only."""
    for lines, name, role in halves():
        found, state = set(), ""
        for words in map(str.split, lines[2:]):  # below the head
            state = words[0] if len(words) == 4 else state
            if {"says", "hears"} & set(words[:2]):
                found.add((state, *words[-3:]))
        expected = of(name).tables[role]
        verbs = {Way.SEND: "says", Way.RECEIVE: "hears"}
        assert found == {(row.state, verbs[row.way], row.word, row.to) for row in expected}
        for mark in ("ended", "urgent", "resting"):
            states = ", ".join(sorted(getattr(expected, mark)))
            assert [line for line in lines if line.startswith(f"{mark:<9}{states}: ")] or not states


def test_the_list_names_each_once_with_whose_rules_it_has() -> None:
    """A protocol common to FIPA and the paper is listed once; the design's own protocols are listed
    as the design's.
    """
    listed = printed("protocol")
    assert sorted(one["name"] for one in listed) == names()

    def of_origin(words: str) -> set[str]:
        return {one["name"] for one in listed if one["origin"].startswith(words)}

    assert of_origin("FIPA") - of_origin("FIPA and") == {p.name for p in set(FIPA) - set(PAPER)}
    assert of_origin("the paper") == {p.name for p in set(PAPER) - set(FIPA)}
    assert of_origin("the design") == set(DESIGN.own_tables)


def test_an_alias_means_the_same() -> None:
    """FIPA's token, where both profiles have one protocol."""
    assert protocol("fipa-contract-net").stdout == protocol("cfp").stdout


def test_the_drawing_is_an_svg_with_every_opening(tmp_path: Path) -> None:
    """Its name above, the roles, and the acts that open it."""
    file = tmp_path / "made" / "exchange.svg"
    for name in names():
        protocol(name, "--svg", str(file), code=0)
        texts = " ".join(ElementTree.fromstring(file.read_text()).itertext()).split()
        assert {name, "initiator", "participant", *of(name).openings} <= set(texts)


def test_an_unknown_name_is_told_the_known_ones(tmp_path: Path) -> None:
    """Exit code 2, as for any name that is not there; the same for a file that cannot be
    written.
    """
    said = protocol("auction")
    assert (said.exit_code, said.stdout) == (2, "")
    assert all(name in said.stderr for name in names())
    (tmp_path / "folder").mkdir()
    protocol("cfp", "--svg", str(tmp_path / "folder"), code=2)
