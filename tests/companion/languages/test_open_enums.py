"""Enumerations to which tasks add: one table of all members, each value once."""

from enum import StrEnum

import pytest

from companion.languages.evidence import member, members

pytestmark = pytest.mark.timeout(60)


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
