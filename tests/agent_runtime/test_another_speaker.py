"""Somebody else speaks with an agent's key: no word is lost in silence, none is taken twice, order
is kept.
"""

from itertools import pairwise
from typing import Any

import msgspec
import pytest
from driven import Driven, agree, recording, request
from toy_agents import Want, asker, wirings

from agent_runtime.core import streams
from agent_runtime.core.events import Arrived, Broken, Effects, Local, PeerChanged, Receipted
from agent_runtime.core.state import restored
from agent_runtime.core.streams import JUMP, KEPT, digest_of, next_id, preceding
from fipa_codec.communicate import decode, encode
from fipa_codec.performatives import Performative as P

TOLD = "another speaker"


def told(effects: Effects) -> list[str]:
    """Return the reason of each line that says that two speak with one key."""
    lines = [line for line in effects.logs if (line.event, line.level) == (TOLD, "error")]
    return [line.fields["why"] for line in lines]


# --- the receiver ---------------------------------------------------------------------------------


def serving(**how: Any) -> Driven:
    """The server, which has taken the asker's first word."""
    one = Driven(recording(**how), wirings()[1])
    one.state = one.core.boot(one.core.first("own"))
    one.step(PeerChanged("asker", 1, "its"))
    one.step(of(request(1)))
    return one


def of(arrived: Arrived, after: bytes = b"") -> Arrived:
    """The message as it comes from the asker's journal."""
    return msgspec.structs.replace(arrived, journal="its", believed="own", after=after)


def test_another_word_under_a_number_that_was_taken_is_refused_and_told() -> None:
    """Not taken, not receipted as taken; the sender learns which word was refused, and how far the
    stream is.
    """
    one = serving(said=agree)
    effects = one.step(of(other := request(1, conversation="b")))
    assert effects.handled is None
    (receipt,) = effects.receipts
    assert (receipt.taken, receipt.digest) == (1, digest_of(request(1).communicate))
    assert (receipt.refused, receipt.unknown) == (digest_of(other.communicate), False)
    (why,) = told(effects)
    assert "roco keys revoke asker" in why
    assert one.state.counts[TOLD] == 1


def test_a_receiver_remembers_after_its_death() -> None:
    """Taken words are in its journal: a copy is still a copy, another word is still refused."""
    one = serving(said=agree)
    one.state = one.core.boot(one.core.record(one.state))
    assert not told(one.step(of(request(1))))
    assert told(one.step(of(request(1, conversation="b"))))


def test_another_word_under_a_number_that_waits_is_told() -> None:
    """The first one that came is taken in its turn, and its receipt tells whose it was."""
    one = serving(said=agree, takes=lambda memory, event: False)
    assert not told(one.step(of(request(1))))
    assert told(one.step(of(request(1, conversation="b"))))


def test_no_more_is_remembered_than_an_outbox_holds_and_what_is_older_is_not_known() -> None:
    """Of an older number the receiver does not say that another word was taken: it does not
    know.
    """
    one = serving(said=agree)
    for number in range(2, KEPT + 3):
        one.step(of(request(number, conversation=f"c-{number}")))
    assert len(one.state.recent["asker"]) == KEPT
    effects = one.step(of(request(1)))
    assert effects.receipts[0].unknown
    assert not told(effects)
    assert told(one.step(of(request(3, conversation="b"))))


def test_a_word_is_not_taken_before_the_one_it_follows() -> None:
    """This holds for any number: the word before was refused, or has not come yet."""
    one = serving(said=agree)
    second, third = request(2, conversation="b"), request(3, conversation="c")
    again, fifth = request(4, conversation="b"), request(5, conversation="c")
    one.step(of(request(2, conversation="thief")))
    for event, before, taken in (
        (third, second, None),
        (third, again, None),
        (again, None, "b"),
        (fifth, again, "c"),
    ):
        handled = one.step(of(event, digest_of(before.communicate) if before else b"")).handled
        assert getattr(handled, "conversation", None) == taken


def test_a_word_may_follow_one_that_waits() -> None:
    """The next number alone is not enough: a thief may have said what is before it."""
    one = serving(said=agree, takes=lambda memory, event: False)
    waiting = [request(1)]
    one.step(of(waiting[0]))
    for number, before, waits in ((2, b"a thief's", False), (2, b"", True), (3, b"", True)):
        event = request(number, conversation=f"c-{number}")
        one.step(of(event, before or digest_of(waiting[-1].communicate)))
        waiting += [event] if waits else []
        assert [held.number for held in one.state.soft.inbox] == list(range(1, len(waiting) + 1))


@pytest.mark.parametrize(("farther", "taken"), [(1, True), (JUMP, True), (JUMP + 1, False)])
def test_numbers_may_be_left_out_but_not_many(farther: int, taken: bool) -> None:
    """A number too far on is refused, with the number that the stream is at; test programs' words
    are not.
    """
    one = serving(said=agree)
    far = request(1 + farther, conversation="b")
    effects = one.step(of(far))
    assert (effects.handled is not None) == taken
    refused = [(receipt.refused, receipt.unknown) for receipt in effects.receipts]
    assert refused == [(b"" if taken else digest_of(far.communicate), False)]
    stranger = serving(said=agree)
    assert (stranger.step(far).handled is not None) == (farther == 1)


# --- the sender -----------------------------------------------------------------------------------


def asking(*wanted: int) -> Driven:
    """The asker; with what is wanted, a request to the server is in its outbox."""
    one = Driven(asker(*wanted), wirings()[0])
    one.state = one.core.boot(one.core.first("own"))
    one.step(PeerChanged("server", 1, "its"))
    assert outbox(one) == list(range(1, 1 + len(wanted)))
    return one


def word(one: Driven) -> bytes:
    """The digest of the first message that is not receipted."""
    return digest_of(one.state.outbox["server"][0].communicate)


def receipted(taken: int, word: bytes = b"another", **more: Any) -> Receipted:
    """A receipt of the server."""
    return Receipted("server", taken, digest=word, journal="its", believed="own", **more)


def outbox(one: Driven) -> list[int]:
    """Numbers that are not receipted."""
    return [outgoing.number for outgoing in one.state.outbox.get("server", ())]


def test_a_word_under_whose_number_another_was_taken_is_said_again() -> None:
    """On the disk first, under the next number; the agent says so."""
    one = asking(5)
    effects = one.step(receipted(1))
    assert outbox(one) == [2]
    assert effects.record is not None
    assert [communicate.id for communicate in effects.sends] == ["2"]
    (why,) = told(effects)
    assert "roco keys revoke asker" in why
    assert one.state.counts[TOLD] == 1
    one.step(receipted(2, word(one)))
    assert outbox(one) == []


def test_the_same_words_after_a_death() -> None:
    """Words repeated by the next life have the same digest: an honest agent is never taken for a
    thief.
    """
    one = asking(5)
    said = one.state.outbox["server"][0].communicate
    again = restored(one.core.agent, one.core.record(one.state)).outbox["server"][0].communicate
    assert digest_of(again) == digest_of(said) == digest_of(decode(encode(said)))


def test_a_refusal_of_a_thiefs_word_changes_nothing() -> None:
    """The word that was refused is not this agent's, which waits for its receipt."""
    one = asking(5)
    assert not told(one.step(receipted(0, b"", refused=b"a thief's")))
    assert outbox(one) == [1]


def test_words_taken_in_its_name_are_told_while_it_says_nothing() -> None:
    """And its next word gets the number after them."""
    one = asking()
    assert told(one.step(receipted(7)))
    one.step(Local(Want(5)))
    assert outbox(one) == [8]


def test_tries_lie_farther_and_farther_ahead_and_are_not_made_at_once_for_ever() -> None:
    """A thief who always says the next number is passed; one who cannot be passed does not set the
    pace.
    """
    one, gaps, at_once = asking(5), [], 0
    for _ in range(8):
        taken = outbox(one)[0]
        at_once += len(one.step(receipted(taken)).sends)
        gaps.append(outbox(one)[0] - taken)
    assert gaps[:4] == [1, 16, 256, 4096]
    assert max(gaps) <= JUMP
    assert at_once == streams.AT_ONCE
    effects = one.later(one.now + 10.0)
    assert [communicate.id for communicate in effects.sends] == [str(outbox(one)[0])]


@pytest.mark.parametrize("taken", [-5, 10**18 - 1, 10**18, 2**70])
def test_a_number_that_none_could_follow_is_not_believed(taken: int) -> None:
    """A thief with the receiver's key cannot use the numbers up."""
    one = asking(5)
    one.step(receipted(taken, refused=word(one)))
    assert outbox(one) == [1]


def test_a_number_too_far_on_is_taken_back() -> None:
    """A thief with the receiver's key had it chosen; the receiver says at which number the stream
    is.
    """
    one = asking(5)
    one.step(receipted(10**9, refused=word(one)))
    one.step(receipted(0, b"", refused=word(one)))
    assert outbox(one)[0] <= JUMP


def test_where_it_is_not_known_the_conversation_is_lost_and_the_behaviour_told() -> None:
    """It is not said again: perhaps it was taken."""
    one = asking(5)
    effects = one.step(receipted(40, refused=word(one), unknown=True))
    seen = [effects.handled for effects in one.out]
    assert any(isinstance(event, Broken) and "does not know" in event.reason for event in seen)
    assert told(effects)
    assert all(number > 40 for number in outbox(one)), "the asker asks anew"


def test_what_is_said_after_a_word_that_was_given_up_lies_farther_on_each_time() -> None:
    """By a factor: a thief who goes on meanwhile is passed after a few. Once one is taken, the
    numbers follow each other again.
    """
    one, ahead = asking(5), []
    for taken in (100, 1000, 10_000):
        one.step(receipted(taken, refused=word(one), unknown=True))
        ahead.append(outbox(one)[0] - taken)
    assert all(after >= 10 * before > 1 for before, after in pairwise(ahead)), ahead
    assert ahead[-1] <= JUMP
    one.step(receipted(outbox(one)[-1], word(one)))
    assert next_id(one.state, "server", durable=True) == str(one.state.issued["server"] + 1)


def test_each_word_says_which_one_it_follows() -> None:
    """By its digest while that one is not receipted, else by its number."""
    one, change = asking(5), msgspec.structs.replace
    (first,) = one.state.outbox["server"]
    second = change(first, number=2, communicate=change(first.communicate, id="2"))
    one.state.outbox["server"] = (first, second)
    assert preceding(one.state, first.communicate) == (b"", 0)
    assert preceding(one.state, second.communicate) == (word(one), 0)
    one.step(receipted(1, word(one)))
    assert preceding(one.state, second.communicate) == (b"", 1)


def test_the_digest_of_a_word_is_of_all_it_says() -> None:
    """Each field counts, its number too."""
    said = request(1).communicate
    other = {"id": "2", "conversation": "b", "sent": 5.0, "performative": P.AGREE, "reply_by": 3.0}
    for field, value in other.items():
        assert digest_of(msgspec.structs.replace(said, **{field: value})) != digest_of(said)
    assert len(digest_of(said)) == streams.DIGEST_BYTES
