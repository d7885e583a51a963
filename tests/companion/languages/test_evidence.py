"""What must be true after each act: the table is complete, and what is known after acts follows
from what they told.
"""

from enum import StrEnum

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.acts import ACTS
from companion.languages.evidence import (
    AnyClaim,
    Claim,
    Evidence,
    Sense,
    fitting,
    member,
    members,
    newest,
    unchecked,
)

pytestmark = pytest.mark.timeout(60)
CLAIMS = members(AnyClaim)
THINGS = st.sampled_from(["jar_1", "bowl_1", ""])
SENSES = st.lists(st.sampled_from(Sense), unique=True, max_size=3).map(tuple)
SAID = st.builds(
    Evidence, st.sampled_from(list(CLAIMS.values())), THINGS, SENSES, st.floats(0.0, 1e6)
)
TOLD = st.lists(SAID, max_size=8)


def test_each_act_says_what_must_be_true_after_it():
    """Each check names senses, a field of the command and a claim; each claim is one of a check."""
    for act, row in ACTS.items():
        assert row.checks, act
        assert all(check.by for check in row.checks)
        assert {check.of for check in row.checks if check.of} <= set(act.__struct_fields__)
    assert {check.claim for row in ACTS.values() for check in row.checks} == set(CLAIMS.values())


def test_a_claim_survives_the_wire():
    """As the same member, with what it says of itself; an unknown one is refused."""
    for claim in CLAIMS.values():
        data = msgspec.msgpack.encode(Evidence(claim, "jar_1"))
        assert msgspec.msgpack.decode(data)[0] == claim.value
        assert msgspec.msgpack.decode(data, type=Evidence).claim is claim
    with pytest.raises(msgspec.ValidationError, match="unknown AnyClaim 'flies'"):
        msgspec.msgpack.decode(msgspec.msgpack.encode(("flies", "jar_1")), type=Evidence)


@given(TOLD, TOLD, st.sets(THINGS))
def test_the_last_word_counts(known, told, held):
    """Of each claim about a thing one word is kept, the newest; what a hand holds stands nowhere,
    and the reverse.
    """
    found = newest(known, told, held)
    assert len({(one.claim, one.of) for one in found}) == len(found)
    for one in found:
        assert one.claim.kept
        of_it = (
            word
            for word in reversed([*known, *told])
            if (word.claim, word.of) == (one.claim, one.of)
        )
        assert one == next(of_it)
        assert one.claim is not Claim.STANDS or one.of not in held
        assert one.claim is not Claim.HELD or one.of in held
    assert newest(found, (), held) == found


@given(TOLD, st.integers(0, 400))
def test_what_fits_begins_with_what_was_not_checked(known, room):
    """No more bytes than there is room for, and nothing that was checked before all is told that
    was not.
    """
    told = fitting(known, room)
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(told), type=tuple[Evidence, ...]) == told
    assert sum(len(msgspec.msgpack.encode(one)) for one in told) <= room
    if any(one.by for one in told):
        assert {one for one in told if not one.by} == {*unchecked(known)}


# --- Enumerations to which tasks add: one table of all members, each value once


def test_members_of_all_tables_are_found_by_value():
    """Each as a member of its own table."""

    class Base(StrEnum):
        pass

    class General(Base):
        ONE = "one"

    class OfATask(Base):
        TWO = "two"

    assert members(Base) == {"one": General.ONE, "two": OfATask.TWO}
    assert member(Base, "two") is OfATask.TWO
    with pytest.raises(ValueError, match="unknown Base 'three'"):
        member(Base, "three")


def test_two_members_with_one_value_are_refused():
    """In two tables, or as two names in one, which Python would take for the same member."""

    class Base(StrEnum):
        pass

    class General(Base):
        ONE = "one"

    class OfATask(Base):
        ALSO = "one"

    with pytest.raises(ValueError, match="both General and OfATask have 'one'"):
        members(Base)

    class Other(StrEnum):
        pass

    class Twice(Other):
        ONE = "one"
        AGAIN = "one"

    with pytest.raises(ValueError, match="both Twice and Twice have 'one'"):
        members(Other)
