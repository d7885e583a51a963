"""Interfaces in the paper's form, checked against the language of the channel."""

import msgspec
import pytest

from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.interfaces import ClassInterfaceInfo
from fipa_codec.languages import Language
from fipa_codec.performatives import Performative as P


class Network(msgspec.Struct, frozen=True, tag=True):
    """An argument."""

    tasks: tuple[str, ...] = ()


class Plan(msgspec.Struct, frozen=True, tag=True):
    """An answer."""


class NoPlan(msgspec.Struct, frozen=True, tag=True):
    """Another answer."""


class Note(msgspec.Struct, frozen=True, tag=True):
    """A class of another language."""


PLANS = Language("PLANS", Network | Plan | NoPlan)
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


def test_a_sentence_identifies_its_entry():
    """The single argument is the content, so its class identifies the query."""
    entry = INFO.entry_for(P.REQUEST, Network())
    assert entry.name == "generatePlan"
    INFO.check_answer(entry, Plan())


@pytest.mark.parametrize(
    ("performative", "content"), [(P.REQUEST, Plan()), (P.QUERY_REF, Network()), (P.REQUEST, None)]
)
def test_unsupported_queries_are_refused(performative, content):
    """The error says to answer with refuse."""
    with pytest.raises(ContentError) as caught:
        INFO.entry_for(performative, content)
    assert caught.value.performative is P.REFUSE
    assert caught.value.field == "content"


def test_answers_are_checked():
    """The error for an answer of another class has the entry."""
    entry = RICH.named("generatePlan")
    RICH.check_answer(entry, NoPlan())
    RICH.check_answer(RICH.named("forget"), None)
    for wrong in (Network(), None):
        with pytest.raises(ContentError, match="generatePlan") as caught:
            RICH.check_answer(entry, wrong)
        assert caught.value.performative is P.NOT_UNDERSTOOD


def test_arguments_are_checked_in_order():
    """Number and classes of several arguments, as in the general form of the paper."""
    assert RICH.check_arguments("compare", [Plan(), Network()]).name == "compare"
    for wrong, reason in (
        ([Plan()], "1 arguments"),
        ([Network(), Plan()], "argument 0"),
        ([Plan(), 3], "argument 1"),
    ):
        with pytest.raises(ContentError, match=reason) as caught:
            RICH.check_arguments("compare", wrong)
        assert caught.value.performative is P.REFUSE


def test_all_classes_must_be_in_the_language():
    """The error has the entry, the class and the language."""
    RICH.check_language(PLANS)
    with pytest.raises(
        LocalProtocolError, match=r"request generatePlan\(Network\) -> Plan: Plan is not in NOTES"
    ):
        INFO.check_language(PLANS, answers=Language("NOTES", Note))
    with pytest.raises(LocalProtocolError, match="Network is not in NOTES"):
        INFO.check_language(Language("NOTES", Note))


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
