"""The steps of a decomposition are walked as the paper says: reallocate, split, complement, numbers
never change.
"""

from topdown.model.decomposition import Decomposition, decompose
from topdown.model.elements import Complement, Division, NewChannel, Reallocation, Split, Step


def divide(group: str, one: str, other: str) -> Division:
    """group := <one, other>"""
    return Division(group, (one, other))


FIRST = Step(
    requirements=("R1",),
    divide=divide("all", "a", "b"),
    channels=(NewChannel("C1", ("a", "b"), "words"),),
)


def dividing(**more: object) -> Decomposition:
    """After FIRST, a := <c, d>."""
    step = Step(requirements=("R2",), divide=divide("a", "c", "d"), **more)  # type: ignore[arg-type]
    return decompose("all", (FIRST, step))


def test_a_reallocated_channel_keeps_its_number_and_its_other_end() -> None:
    """C1 a-b becomes C1 c-b when a := <c, d> and C1 goes to c."""
    result = dividing(reallocate=(Reallocation("C1", "c"),))
    assert not result.slips
    assert [(channel.id, channel.ends) for channel in result.last.channels] == [("C1", ("c", "b"))]
    assert set(result.last.groups) == {"b", "c", "d"}


def test_a_split_channel_is_retired_and_two_new_ones_take_its_place() -> None:
    """Both halves get a channel of their own to the other end."""
    result = dividing(split=(Split("C1", ("C2", "C3")),))
    assert not result.slips
    ends = {channel.id: channel.ends for channel in result.last.channels}
    assert ends == {"C2": ("c", "b"), "C3": ("d", "b")}


def test_a_complemented_channel_transmits_more() -> None:
    """Added entries stand behind the earlier ones."""
    more = Step(requirements=("R2",), complement=(Complement("C1", "pictures"),))
    result = decompose("all", (FIRST, more))
    assert result.last.channels[0].transmits == ("words", "pictures")


def test_a_channel_of_the_divided_group_goes_to_a_half_of_it() -> None:
    """Neither reallocated nor split, it ends at a group that is no more."""
    assert ["C1" in slip.wrong for slip in dividing().slips] == [True]
    moved = dividing(reallocate=(Reallocation("C1", "b"),))
    assert any("cannot go to 'b'" in slip.wrong for slip in moved.slips)


def test_what_is_not_there_is_a_slip_and_not_an_exception() -> None:
    """Unknown groups and channels, and numbers used twice, are reported with what would be
    right.
    """
    odd = Step(
        requirements=("R2",),
        divide=divide("z", "c", "d"),
        reallocate=(Reallocation("C9", "c"),),
        complement=(Complement("C8", "x"),),
        channels=(NewChannel("C1", ("c", "d"), "again"),),
    )
    wrong = " | ".join(slip.wrong for slip in decompose("all", (FIRST, odd)).slips)
    assert all(word in wrong for word in ("'z'", "'C9'", "'C8'", "C1 exists"))
