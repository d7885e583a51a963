"""Interfaces in the paper's form, checked against the language that carries them."""

import msgspec
import pytest

from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.interfaces import ClassInterfaceInfo
from fipa_codec.languages import Language
from fipa_codec.performatives import Performative as P


class Network(msgspec.Struct, frozen=True, tag=True):
    """What is asked for."""

    tasks: tuple[str, ...] = ()


class Plan(msgspec.Struct, frozen=True, tag=True):
    """What is answered."""


class NoPlan(msgspec.Struct, frozen=True, tag=True):
    """What may be answered instead."""


class Note(msgspec.Struct, frozen=True, tag=True):
    """Of another language."""


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
    """The paper's line is the constructor's argument, and reads back as a signature."""
    (entry,) = INFO
    assert str(entry) == "request generatePlan(Network) -> Plan"
    assert [str(e) for e in RICH][2] == "request forget() -> nothing"
    assert len(RICH) == 3


def test_a_sentence_finds_its_entry():
    """In this system the one argument is the content, so its class tells the query."""
    entry = INFO.entry_for(P.REQUEST, Network())
    assert entry.name == "generatePlan"
    INFO.check_answer(entry, Plan())


@pytest.mark.parametrize(
    ("performative", "content"), [(P.REQUEST, Plan()), (P.QUERY_REF, Network()), (P.REQUEST, None)]
)
def test_what_is_not_offered_is_refused(performative, content):
    """An unsupported query is refused with what is offered."""
    with pytest.raises(ContentError) as caught:
        INFO.entry_for(performative, content)
    assert caught.value.performative is P.REFUSE
    assert caught.value.field == "content"


def test_answers_are_checked():
    """An answer of another class is named together with the entry it should answer."""
    entry = RICH.named("generatePlan")
    RICH.check_answer(entry, NoPlan())
    RICH.check_answer(RICH.named("forget"), None)
    for wrong in (Network(), None):
        with pytest.raises(ContentError, match="generatePlan") as caught:
            RICH.check_answer(entry, wrong)
        assert caught.value.performative is P.NOT_UNDERSTOOD


def test_arguments_are_checked_in_order():
    """Number and classes of several arguments, as in the paper's general form."""
    assert RICH.check_arguments("compare", [Plan(), Network()]).name == "compare"
    for wrong, reason in (([Plan()], "1 arguments"), ([Network(), Plan()], "argument 0"), ([Plan(), 3], "argument 1")):
        with pytest.raises(ContentError, match=reason) as caught:
            RICH.check_arguments("compare", wrong)
        assert caught.value.performative is P.REFUSE


def test_all_classes_must_be_of_the_language():
    """Argument and answer classes outside their languages are found when the design is loaded."""
    RICH.check_language(PLANS)
    with pytest.raises(LocalProtocolError, match=r"request generatePlan\(Network\) -> Plan: Plan is not of NOTES"):
        INFO.check_language(PLANS, answers=Language("NOTES", Note))
    with pytest.raises(LocalProtocolError, match="Network is not of NOTES"):
        INFO.check_language(Language("NOTES", Note))


@pytest.mark.parametrize(
    ("entries", "reason"),
    [
        ([("request", "a", [Plan], None), ("request", "a", [Network], None)], "named 'a'"),
        ([("request", "a", [Plan], None), ("request", "b", [Plan], None)], "told apart"),
        ([("demand", "a", [Plan], None)], "22 acts"),
    ],
)
def test_entries_must_be_told_apart(entries, reason):
    """Names and (performative, class) are unique; performatives are those of the standard."""
    with pytest.raises(LocalProtocolError, match=reason):
        ClassInterfaceInfo(entries)
    with pytest.raises(LocalProtocolError, match="generatePlan"):
        INFO.named("makePlan")
