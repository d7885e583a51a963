"""Out of reach or dead: told apart by the incarnations that come back."""

from operate.recording.reach import Reach
from operate.recording.records import House, Record, Resumed, Token


def heard(t: float) -> House:
    """Some telemetry."""
    return House("telemetry", "ex", "", t, b"")


def came(agent: str, incarnation: int, t: float) -> Token:
    """A token appears."""
    return Token(agent, incarnation, True, t)


def went(agent: str, incarnation: int, t: float) -> Token:
    """A token vanishes."""
    return Token(agent, incarnation, False, t)


def holes(*records: Record) -> list[Resumed]:
    """Return the holes that these records bring."""
    reach = Reach()
    return [hole for hole in map(reach.hole, records) if hole is not None]


BOTH = (came("co", 3, 1.0), came("ta", 5, 1.0), heard(2.0))
GONE = (went("co", 3, 4.0), went("ta", 5, 4.1))


def test_all_are_gone_and_come_back_as_they_were() -> None:
    """That was no death: from the last word to the first token that is back nothing could be heard; told once."""
    assert holes(*BOTH, *GONE, came("ta", 5, 9.0), came("co", 3, 9.1), heard(9.2)) == [Resumed(2.0, 9.0)]


def test_all_died_and_came_back_as_others() -> None:
    """New incarnations: nobody was there who could have said anything."""
    assert holes(*BOTH, *GONE, came("ta", 6, 9.0), came("co", 4, 9.1)) == []


def test_one_was_gone_while_others_were_heard() -> None:
    """Its own way was broken, not the recorder's."""
    assert holes(*BOTH, went("co", 3, 4.0), heard(5.0), came("co", 3, 9.0)) == []


def test_what_is_heard_of_others_does_not_shorten_the_hole() -> None:
    """A word of somebody else of the system, who has no token, says nothing about the agents."""
    assert holes(*BOTH, *GONE, heard(8.0), came("co", 3, 9.0)) == [Resumed(2.0, 9.0)]


def test_a_time_that_was_told_is_not_told_again() -> None:
    """While the recorder itself had no router all tokens vanished, too; they come after its own word about that."""
    assert holes(*BOTH, *GONE, Resumed(2.0, 8.0), came("co", 3, 9.0), came("ta", 5, 9.0)) == []


def test_it_breaks_twice() -> None:
    """Each time is a hole."""
    again = (came("ta", 5, 9.0), came("co", 3, 9.1), heard(10.0))
    later = (went("co", 3, 14.0), went("ta", 5, 14.1), came("co", 3, 20.0))
    assert holes(*BOTH, *GONE, *again, *later) == [Resumed(2.0, 9.0), Resumed(10.0, 20.0)]


def test_whether_nobody_is_in_reach_is_known_meanwhile() -> None:
    """From the last token that vanished to the first that is there; not before anybody was there."""
    reach = Reach()
    lost = []
    for record in (heard(0.5), *BOTH, *GONE, came("co", 4, 9.0)):
        reach.hole(record)
        lost.append(reach.lost)
    assert lost == [False] * 5 + [True, False]


def test_that_a_sender_was_missed_says_nothing_of_the_way_to_all() -> None:
    """The recorder was slow meanwhile; the agents are back all the same."""
    assert holes(*BOTH, *GONE, Resumed(2.0, 8.0, "co"), came("co", 3, 9.0)) == [Resumed(2.0, 9.0)]
