"""Interfaces in the paper's form, checked against the language of the channel."""

import pytest

from fipa_codec.errors import LocalProtocolError
from fipa_codec.interfaces import ClassInterfaceInfo


class Network:
    """An argument."""


class Plan:
    """An answer."""


class NoPlan:
    """Another answer."""


INFO = ClassInterfaceInfo([("request", "generatePlan", [Network], Plan)])
RICH = ClassInterfaceInfo(
    [
        ("request", "generatePlan", [Network], Plan | NoPlan),
        ("query-ref", "compare", [Plan, Network], NoPlan),
        ("request", "forget", [], None),
    ]
)


def test_the_papers_example():
    """The paper's line is the argument of the constructor; `str` gives a signature."""
    (entry,) = INFO
    assert str(entry) == "request generatePlan(Network) -> Plan"
    assert [str(e) for e in RICH][2] == "request forget() -> nothing"
    assert len(RICH) == 3


@pytest.mark.parametrize(
    ("entries", "reason"),
    [
        ([("request", "a", [Plan], None), ("request", "a", [Network], None)], "named 'a'"),
        (
            [("request", "a", [Plan], None), ("request", "b", [Plan], None)],
            "have the same argument",
        ),
        ([("demand", "a", [Plan], None)], "22 acts"),
    ],
)
def test_entries_must_be_distinguishable(entries, reason):
    """Names and pairs of performative and class are unique; performatives are those of the
    standard.
    """
    with pytest.raises(LocalProtocolError, match=reason):
        ClassInterfaceInfo(entries)
    with pytest.raises(LocalProtocolError, match="generatePlan"):
        INFO.named("makePlan")
