"""The checks find what is inconsistent, and find nothing where all is well."""

from pathlib import Path

import pytest

from fipa_codec import protocols
from topdown import agreement, loading
from topdown.checks import check
from topdown.design import Design
from topdown.errors import NoSuchEntry
from topdown.findings import Kind

SMALL = Path(__file__).with_name("lamp.toml").read_text()


def design(*changes: tuple[str, str]) -> Design:
    """The small design with some words replaced."""
    text = SMALL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return Design(loading.read(text))


def test_a_consistent_design_has_no_findings() -> None:
    """Not a single one."""
    assert check(design()) == ()


@pytest.mark.parametrize(
    ("old", "new", "kind", "wrong"),
    [
        ('channel = "C1"', 'channel = "C7"', Kind.PROTOCOL, "C7"),
        ('initiator = "hand"', 'initiator = "foot"', Kind.PROTOCOL, "not the ends"),
        ('content = ["On"]', "content = []", Kind.INTERFACE, "carries L.On"),
        ('content = ["Lit"]', 'content = ["*nothing"]', Kind.INTERFACE, "*nothing"),
        ('language = "L"\ncontent = ["On"]', 'language = "M"\ncontent = ["On"]', Kind.LANGUAGE, "'M'"),
        (
            'arc = [{ source = "idle", target = "idle" }]',
            'arc = [{ source = "idle", target = "off" }]',
            Kind.STATE,
            "off",
        ),
        ('initial = "idle"', 'initial = "awake"', Kind.STATE, "awake"),
        ('target = "idle" }]', 'target = "idle", when = "x" }]', Kind.STATE, "no way out"),
        ('talks = ["switch"]', "talks = []", Kind.STATE, "no state talks in switch"),
        ('requirements = ["R1"]', "requirements = []", Kind.REQUIREMENT, "no step handles"),
        ('text = "switch a lamp"', 'text = "x"\nparent = "R1"', Kind.REQUIREMENT, "own ancestor"),
        ('name = "lamp"\ninitial', 'name = "tree"\ninitial', Kind.DECOMPOSITION, "no agent"),
        ('into = ["hand", "lamp"]', 'into = ["hand", "bulb"]', Kind.DECOMPOSITION, "ends at 'lamp'"),
        ('id = "R1"\n', 'id = "R1"\ntext = "x"\n[[requirement]]\nid = "R1"\n', Kind.TWICE, "2 times"),
    ],
)
def test_what_is_inconsistent_is_found(old: str, new: str, kind: Kind, wrong: str) -> None:
    """Each spoilt design has a finding of the right kind that names what is wrong."""
    found = check(design((old, new)))
    assert any(finding.kind is kind and wrong in finding.wrong for finding in found), [str(f) for f in found]


def test_an_unreachable_state_is_found() -> None:
    """A state no arc leads to is named."""
    spoilt = design(
        ('state = [{ name = "idle"', 'state = [{ name = "lost", behaviour = "b", terminal = "t" }, { name = "idle"')
    )
    assert any("cannot be reached" in finding.wrong for finding in check(spoilt))


def test_classes_are_compared_with_the_languages() -> None:
    """A class that a language lacks is named, with those it has."""
    assert agreement.check_languages(design(), {"L": ["On", "Lit"]}) == ()
    found = agreement.check_languages(design(), {"L": ["On"]})
    assert found
    assert all("'Lit'" in finding.wrong and "On" in finding.right for finding in found)


def test_kinds_of_queries_are_compared_both_ways() -> None:
    """A kind without entry and an entry without kind are both found."""
    assert agreement.check_queries(design(), ["switching"], "L", ["On"]) == ()
    missing, foreign = agreement.check_queries(design(), ["switching"], "L", ["Off"])
    assert missing.where == "L.Off"
    assert foreign.where == "L.On"


def test_messages_are_compared_with_the_rows_they_follow() -> None:
    """An act that the protocol's table has no row for is found, and a table that is not there."""
    tables = {"request": protocols.REQUEST}
    assert agreement.check_protocols(design(), tables) == ()
    spoilt = design(('performative = "inform"', 'performative = "propose"'))
    assert "propose" in agreement.check_protocols(spoilt, tables)[0].wrong
    assert "no table" in agreement.check_protocols(design(), {})[0].wrong


def test_a_look_up_that_fails_lists_what_there_is() -> None:
    """The error names the kind, the name and the known ones."""
    with pytest.raises(NoSuchEntry) as caught:
        design().agent("foot")
    assert caught.value.known == ("hand", "lamp")
