"""Every kind of fault is found by its name: a sound design spoilt in one place has exactly that one
finding.
"""

from pathlib import Path

import msgspec
from spoiling import Change, design, text_of

from topdown.check import check
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
BAD_ROW"""


def test_every_kind_of_fault_of_a_file_is_spoilt_here() -> None:
    """A kind that no test makes appear would be a promise only; those of recordings and of code are
    elsewhere.
    """
    assert {fault.kind for fault in FAULTS} == set(Kind) - {Kind[one] for one in ELSEWHERE.split()}
