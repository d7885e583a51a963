"""Every kind of fault is found by its name: a sound design spoilt in one place has exactly that one
finding.
"""

from pathlib import Path

import msgspec
import pytest
from spoiling import Change, design, text_of

from topdown.check import agreement, check
from topdown.model.design import Design, load, rulings
from topdown.model.errors import NoSuchEntry
from topdown.model.findings import Kind


class Fault(msgspec.Struct, forbid_unknown_fields=True):
    """A way to spoil the design: the finding's kind, words it must have, and what is replaced by
    what.
    """

    name: str
    kind: Kind
    words: str
    change: tuple[Change, ...]


class Faults(msgspec.Struct, forbid_unknown_fields=True):
    """The file of them."""

    fault: tuple[Fault, ...]


FAULTS = msgspec.toml.decode(
    Path(__file__).with_name("faults.toml").read_bytes(), type=Faults
).fault
NOT_REALLOCATED = ('reallocate = [{ channel = "C1", to = "nav" }]\n', "")
WRONG_TYPE = ('content = ["Lost"]', 'content = ["Lost", "Lots"]')


def test_a_sound_design_has_no_findings() -> None:
    """Not a single one."""
    assert check(design()) == ()


def test_a_fault_is_found_by_its_name_and_nothing_else_is() -> None:
    """Exactly one finding, of the right kind, that says what is wrong, and what would be right."""
    missed = []
    for fault in FAULTS:
        found = check(design(*fault.change))
        told = [f"{one.where} {one.wrong} {one.right}" for one in found if one.right]
        if [one.kind for one in found] != [fault.kind] or not told or fault.words not in told[0]:
            missed.append((fault.name, [f"{one.kind}: {one}" for one in found]))
    assert missed == []


def test_a_half_takes_a_name_never_used() -> None:
    """A half called like a group that is there is found, among what follows from it."""
    spoilt = 'divide = { group = "atlas", into = ["desk", "store"] }\n'
    last = '[[step]]\nrequirements = ["R4"]\n'
    assert Kind.TWICE in {finding.kind for finding in check(design((last, last + spoilt)))}


def test_a_ruling_answers_for_a_macro_act() -> None:
    """The paper's habit of inform-ref may be kept, where the design says so."""
    said = 'sender = "atlas", performative = "inform"'
    ruled = 'sender = "atlas", ruling = "its habit", performative = "inform-ref"'
    acts = 'performatives = ["inform", "confirm"]'
    assert check(design((said, ruled), (acts, acts.replace("inform", "inform-ref")))) == ()


def test_a_finding_has_its_line() -> None:
    """A finding names the line of the entry, also inside a list, if the file is known."""
    (found,) = check(design(WRONG_TYPE))
    assert found.line is not None
    assert "Lots" in text_of(WRONG_TYPE).splitlines()[found.line - 1]


def test_findings_come_in_the_files_order() -> None:
    """So that a person can go through the file once."""
    found = check(
        design(WRONG_TYPE, ('agents = ["desk",', 'agents = ["desk", "cook",'), NOT_REALLOCATED)
    )
    lines = [finding.line or 0 for finding in found]
    assert len(found) == 3
    assert lines == sorted(lines)


ELSEWHERE = """TOO_LARGE TOO_LATE NO_CHANNEL NOT_DESIGNED NEVER_HEARD UNBALANCED CODE NOT_SUPPORTED
BAD_ROW NO_INCLUDE NEVER_HOLDS NO_REST NEVER_TOLD NO_DEADLINE"""


def test_every_kind_of_fault_of_a_file_is_spoilt_here() -> None:
    """A kind that no test makes appear would be a promise only; those of recordings and of code are
    elsewhere.
    """
    assert {fault.kind for fault in FAULTS} == set(Kind) - {Kind[one] for one in ELSEWHERE.split()}


# --- Rows of agents are compared with the messages, both ways, and with the arcs; a spoilt one is
# named


DESK = """row = [
  { in = ["idle"], on = "person order", say = ["order request"], to = "ordering" },
  { in = ["ordering"], on = "person regret", say = ["order cancel"] },
  { in = ["ordering"], on = "order agree" },
  { in = ["ordering"], on = "order inform", to = "idle" },
  { in = ["ordering"], on = "order inform[cancel]", to = "idle" },
  { in = ["ordering"], on = "order failure", to = "idle" },
]
"""
NAV = """row = [
  { in = ["idle"], on = "order request", say = ["order agree", "ask query-ref"], to = "asking" },
  { in = ["asking", "driving"], on = "order cancel", say = ["order inform[cancel]"], to = "idle" },
  { in = ["asking"], on = "ask inform", say = ["drive request"], to = "driving" },
  { in = ["asking"], on = "late ask", say = ["order failure"], to = "idle" },
  { in = ["driving"], on = "drive agree" },
  { in = ["driving"], on = "drive inform", then = "arrived" },
  { in = ["idle"], on = "tell_place confirm" },
]
choice = [
  { name = "arrived", ways = [{ say = ["order inform"], to = "idle" }, { say = ["tell_place inform", "order inform"], to = "idle" }] },
]
"""  # noqa: E501
ATLAS = """row = [
  { in = ["idle"], on = "ask query-ref", say = ["ask inform"] },
  { in = ["idle"], on = "tell_place inform", say = ["tell_place confirm"] },
]
"""
ROWS: list[Change] = [
    ("[agent.sends]\nperformatives = [\"request\"",
     DESK + "\n[agent.sends]\nperformatives = [\"request\""),
    ("[[agent.parameter]]\nname = \"tries\"", NAV + "\n[[agent.parameter]]\nname = \"tries\""),
    ("[agent.sends]\nperformatives = [\"inform\"",
     ATLAS + "\n[agent.sends]\nperformatives = [\"inform\""),
]  # fmt: skip


def test_rows_that_fit_have_no_findings() -> None:
    """Not a single one; words of a choice count."""
    assert check(design(*ROWS)) == ()


REGRET = '  { in = ["ordering"], on = "person regret", say = ["order cancel"] },\n'
AGREED = '  { in = ["driving"], on = "drive agree" },\n'
REFUSED = ', { in = ["idle"], on = "drive refuse" }'
SPOILT = (
    ('on = "order agree" }', 'on = "order agre" }', Kind.BAD_ROW, "'agre'"),
    ('to = "ordering" }', 'to = "odering" }', Kind.BAD_ROW, "no state 'odering'"),
    ('then = "arrived" }', 'then = "gone" }', Kind.BAD_ROW, "no choice 'gone'"),
    ('on = "late ask"', 'on = "late aks"', Kind.BAD_ROW, "'aks'"),
    (REGRET, "", Kind.RECEIVED_NOT_SENT, "says"),
    (AGREED, "", Kind.SENT_NOT_RECEIVED, "no row of nav takes `drive agree`"),
    ('inform"], to', 'inform", "order refuse"], to', Kind.BAD_ROW, "says order"),
    ('"drive agree" }', '"drive agree" }' + REFUSED, Kind.BAD_ROW, "takes drive refuse"),
)


def test_a_spoilt_row_is_found() -> None:
    """One finding of the right kind; it names the row or the message."""
    for old, new, kind, words in SPOILT:
        found = check(design(*ROWS, (old, new)))
        assert [one.kind for one in found] == [kind], (new, [str(one) for one in found])
        assert words in f"{found[0].where} {found[0].wrong}", new
        assert found[0].line is not None, new


def test_a_row_leads_where_arcs_lead() -> None:
    """nav's asking is left for driving by an arc; without it the row leads nowhere."""
    arc: Change = ('  { source = "asking", target = "driving", when = "way_found" },\n', "")
    found = check(design(*ROWS, arc))
    assert Kind.BAD_ROW in {one.kind for one in found}
    assert any(one.wrong == "no arcs lead from asking to driving" for one in found)


def test_a_ruling_answers_for_a_message_without_a_row() -> None:
    """It says why it is listed all the same."""
    cancel = 'performative = "cancel", language = "WAY", bytes = 100'
    ruled: Change = (cancel, f'{cancel}, ruling = "no hurry"')
    assert check(design(*ROWS, (REGRET, ""), ruled)) == ()


# --- Design and code are compared both ways: whatever one has and the other lacks is a finding


@pytest.fixture(scope="module")
def lamp() -> Design:
    """A design with one language, one query and two agents."""
    return load(Path(__file__).with_name("lamp.toml"))


def test_classes_are_compared_with_the_languages(lamp: Design) -> None:
    """A class that a language lacks is named, with those it has."""
    assert agreement.check_languages(lamp, {"L": ["On", "Lit"]}) == ()
    found = agreement.check_languages(lamp, {"L": ["On"]})
    assert found
    assert all("'Lit'" in finding.wrong and "On" in finding.right for finding in found)


def test_a_class_that_no_message_carries_is_found(lamp: Design) -> None:
    """The code has it, the design never says it."""
    (found,) = agreement.check_languages(lamp, {"L": ["On", "Lit", "Dim"]})
    assert (found.kind, "Dim" in found.wrong) == (Kind.UNUSED, True)


def test_languages_are_compared_both_ways(lamp: Design) -> None:
    """One without a module and a module without a language."""
    found = agreement.check_languages(lamp, {"M": []})
    assert {finding.where for finding in found} >= {"language L", "language M"}


def test_kinds_of_queries_are_compared_both_ways(lamp: Design) -> None:
    """A kind without entry and an entry without kind are both found."""
    assert agreement.check_queries(lamp, ["switching"], "L", ["On"]) == ()
    missing, foreign = agreement.check_queries(lamp, ["switching"], "L", ["Off"])
    assert (missing.kind, missing.where) == (Kind.NOT_ASKED, "L.Off")
    assert (foreign.kind, foreign.where) == (Kind.NOT_SUPPORTED, "L.On")


def test_what_is_declared_must_be_answered(lamp: Design) -> None:
    """A query that the agent's code does not answer, and an answer that nobody can ask for."""
    assert agreement.check_supported(lamp, "lamp", ["L.On"]) == ()
    unanswered, unasked = agreement.check_supported(lamp, "lamp", ["L.Dim"])
    assert (unanswered.kind, "L.On" in unanswered.where) == (Kind.NOT_SUPPORTED, True)
    assert (unasked.kind, unasked.where) == (Kind.NOT_ASKED, "L.Dim")


def test_a_look_up_that_fails_lists_what_there_is(lamp: Design) -> None:
    """The error names the kind, the name and the known ones."""
    with pytest.raises(NoSuchEntry) as caught:
        lamp.agent("foot")
    assert caught.value.known == ("hand", "lamp")


# --- Rulings of a design are found, each with its place -------------------------------------------


RULED: list[Change] = [
    ("latency_s = 1.0\n", 'latency_s = 1.0\nruling = "nobody said how long"\n'),
    (
        'performative = "cancel", language = "WAY"',
        'performative = "cancel", ruling = "not printed", language = "WAY"',
    ),
]


def test_a_design_without_rulings_has_none() -> None:
    """Nothing is made up."""
    assert rulings(design()) == ()


def test_every_ruling_is_found_with_its_line() -> None:
    """On an entry, and on an entry inside it."""
    spoilt = design(*RULED)
    found = rulings(spoilt)
    assert [(one.where, one.text) for one in found] == [
        ("protocol order", "nobody said how long"),
        ("protocol order, message desk cancel", "not printed"),
    ]
    lines = spoilt.text.splitlines()
    assert all(one.line is not None and one.text in lines[one.line - 1] for one in found)
