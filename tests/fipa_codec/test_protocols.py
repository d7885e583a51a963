"""Every protocol of FIPA follows its diagram, with repeated, late, crossing and not understood
messages.
"""

import itertools
from contextlib import suppress

import pytest
from dialogue import Dialogue, parsed
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from rows import each_row
from stories import OPEN, Story, stories_of

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError, RemoteProtocolError
from fipa_codec.exploration import explore, with_not_understood
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import FIPA, PAPER, PROPAGATE, PROTOCOLS, named
from fipa_codec.tables import NOT_UNDERSTOOD, RECEIVE, SEND, START, Protocol, Role, Row

INITIATOR, PARTICIPANT = Role.INITIATOR, Role.PARTICIPANT
NAMES = tuple(protocol.name for protocol in PROTOCOLS)
STORIES = [(name, story) for name in NAMES for story in stories_of(name)]
ROWS = [
    (protocol, role, row)
    for protocol in PROTOCOLS
    for role, table in protocol.tables.items()
    for row in table
]
ASKED_AGAIN = {"query": {P.QUERY_IF, P.QUERY_REF}, "subscribe": {P.SUBSCRIBE}}
"""Openings that may be repeated until answered; each copy is answered."""


# --- the tables -----------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", [*PROTOCOLS, PROPAGATE], ids=lambda p: p.name)
def test_sound(protocol):
    """No reception without a row, no stuck configuration, all states reachable, for each capacity;
    nothing superfluous.

    A row that is used nowhere is: but for that of a forgotten conversation. Not-understood at any
    point leaves nobody waiting: its sender ignores later messages, its receiver ends.
    """
    for capacity, table in (
        (1, protocol),
        (2, protocol),
        (2, with_not_understood(protocol)),
        (3, protocol),
    ):
        found = explore(table, capacity)
        assert not found.unspecified, str(found.unspecified[0])
        assert not found.stuck, str(found.stuck[0])
        assert capacity == 1 or table is not protocol or found.sound, found.unreachable
    assert {(role, row.state, row.word) for role, row in found.unused} <= {
        (PARTICIPANT, START, "cancel")
    }


def plays(protocol: Protocol, story: Story) -> bool:
    """Whether the tables alone allow a story to its end, so that changed tables can be tried."""
    states = dict.fromkeys(Role, START)
    wires: dict[Role, list[tuple[P, Kind]]] = {role: [] for role in Role}

    def go(role: Role, way: str, act: P, kind: Kind) -> bool:
        row = protocol.tables[role].find(states[role], way, act, kind)
        states[role] = row.to if row else ""
        return row is not None

    for word in story.words:
        role, how, act, kind = parsed(word)
        if how == "!":
            states[role] = START
        elif how == "<":
            if not go(role, RECEIVE, *wires[role].pop(0)):
                return False
        else:
            wires[role.other].append((act, kind))
            if not go(role, SEND, act, kind) or (
                how == ":" and not go(role.other, RECEIVE, *wires[role.other].pop(0))
            ):
                return False
    return all(end in (OPEN, states[role]) for role, end in zip(Role, story.ends, strict=True))


def test_every_row_is_needed():
    """Without it some story of the standard is not possible."""

    def needed(protocol: Protocol, role: Role, row: Row) -> None:
        spoilt = protocol.with_tables(**{role: protocol.tables[role].without(*row[:4])})
        assert not all(plays(spoilt, story) for story in stories_of(protocol.name))

    each_row(ROWS, needed)


def test_only_the_initiator_cancels():
    """In every protocol but the paper's query, which is answered at once and has no cancel."""
    for protocol in PROTOCOLS:
        cancels = [row.way for row in protocol.tables[PARTICIPANT] if row.performative is P.CANCEL]
        assert SEND not in cancels
        assert bool(cancels) is (protocol.name != "query")


TOKENS = {"cfp": "fipa-contract-net", "icfp": "fipa-iterated-contract-net"}


def test_tokens_of_fipa_are_the_protocols_of_the_book_and_the_paper_has_its_own_names():
    """The tokens are those of the specifications; both profiles have the same protocols
    otherwise.
    """
    for papers, books in zip(PAPER, FIPA, strict=True):
        short = books.name.removeprefix("fipa-")
        assert named(TOKENS.get(short, f"fipa-{short}")) is named(books.name) is books
        assert named(papers.name) is papers
        assert (papers is books) is (papers.name not in ("request", "query", "subscribe"))
        assert books.name in (papers.name, f"fipa-{papers.name}")


def test_progress_is_told_in_the_papers_request_only():
    """A standard peer takes the first inform as the result (JADE's AchieveREInitiator)."""
    assert {protocol.name for protocol, _, row in ROWS if row.kind is Kind.PROGRESS} == {"request"}


# --- conversations --------------------------------------------------------------------------------


def test_every_story_reaches_its_final_states():
    """On both sides, with encoded messages and journals.

    A copy of any message, received at any later point, is an error or does not change the state. A
    final state is kept; a cancel that was in transit must be answered with failure.
    """

    def played(name: str, story: Story) -> None:
        dialogue = Dialogue(name)
        for word in story.words:
            dialogue.word(word)
            for role, message, kind in dialogue.heard:
                copies_change_nothing(dialogue, role, message, kind)
        assert all(
            end in (OPEN, state) for end, state in zip(story.ends, dialogue.states, strict=True)
        )
        assert not any(dialogue.wires.values())
        for side in dialogue.sides.values():
            if side.ended:
                only_a_late_cancel_is_legal(side)

    each_row(STORIES, played)


def copies_change_nothing(dialogue: Dialogue, role: Role, message: Communicate, kind: Kind) -> None:
    """Receive a copy at this point."""
    side = dialogue.sides.get(role)
    if side is None or side.owes or message.performative in ASKED_AGAIN.get(dialogue.protocol, ()):
        return
    forgotten = side.state == START or not side.asked
    with suppress(RemoteProtocolError):
        assert side.receive(message, kind).state == side.state or forgotten


def only_a_late_cancel_is_legal(side: Conversation) -> None:
    """Try every act on a side that has ended."""
    for act in set(P) - {P.NOT_UNDERSTOOD}:
        assert not says(side, act)
        if side.role is INITIATOR or act not in ASKED_AGAIN.get(side.protocol, ()):
            after = hears(side, act)
            assert after in (None, side.state, "too-late")
            assert after != "too-late" or act is P.CANCEL


def says(side: Conversation, act: P) -> bool:
    """Whether a side may send an act of any kind."""
    for kind in (Kind.PLAIN, Kind.PROGRESS, Kind.FINAL):
        try:
            side.send(act, id="x-1", now=0.0, kind=kind)
        except LocalProtocolError:
            continue
        return True
    return False


def hears(side: Conversation, act: P) -> str | None:
    """Return the state after an act of the peer, None if it is an error."""
    peer = Conversation.open(side.protocol, side.role.other, id=side.id, me=side.peer, peer=side.me)
    message = peer.send(P.NOT_UNDERSTOOD, id="x-2", now=0.0)[1]
    try:
        return side.receive(replace(message, performative=act, reply_with="x-2")).state
    except RemoteProtocolError:
        return None


def test_not_understood_ends_it_at_any_point():
    """Both sides end and ignore messages in transit; a side that had ended says nothing more, and
    keeps its state.
    """
    begun = {
        (name, story.words[:cut])
        for name, story in STORIES
        for cut in range(1, len(story.words) + 1)
    }
    rows = ((*one, who) for one in begun for who in Role if not any("!" in word for word in one[1]))
    each_row(rows, complains)


def complains(name: str, words: tuple[str, ...], who: Role) -> None:
    """After these words one side says not-understood."""
    dialogue = Dialogue(name).play(Story(words, ("", "")))
    if who not in dialogue.sides or dialogue.sides[who].owes:
        return
    if dialogue.sides[who].ended:
        with pytest.raises(LocalProtocolError, match="has ended"):
            dialogue.say(who, P.NOT_UNDERSTOOD)
        return
    waiting = len(dialogue.wires[who])
    complaint = dialogue.say(who, P.NOT_UNDERSTOOD)
    assert dialogue.sides[who].ended
    for _ in range(waiting):
        dialogue.take(who)
    assert dialogue.sides[who].state == NOT_UNDERSTOOD
    peer = dialogue.sides.get(who.other)
    if peer is not None and not peer.owes:
        assert peer.receive(complaint).state == (peer.state if peer.ended else NOT_UNDERSTOOD)


def test_reply_by_bounds_the_first_answer():
    """Equal is in time; an answer, even a late one, clears it on both sides."""
    for name, late in itertools.product(NAMES, (False, True)):
        story = stories_of(name)[0]
        dialogue = Dialogue(name, reply_by=10.0)
        dialogue.word(story.words[0])
        for side in dialogue.sides.values():
            assert (side.deadline, side.late(10.0), side.late(10.001)) == (10.0, False, True)
        dialogue.reply_by, dialogue.count = None, 11 if late else 1
        dialogue.word(story.words[1])
        assert [side.deadline for side in dialogue.sides.values()] == [None, None]


@given(st.sampled_from(NAMES), st.data())
def test_every_allowed_message_is_accepted(name, data):
    """In any run of both sides over FIFO channels every message has a row in the state of its
    receiver.
    """
    dialogue = Dialogue(name)
    for _ in range(30):
        owing = [role for role, side in dialogue.sides.items() if side.owes]
        choices = [
            ("take", role, None) for role in Role if dialogue.wires[role] and role not in owing
        ]
        choices += [
            ("say", role, row)
            for role, side in dialogue.sides.items()
            for row in side.table.allowed(side.state, SEND)
        ]
        if not choices:
            break
        action, role, row = data.draw(st.sampled_from(choices))
        if action == "take":
            dialogue.take(role)
        else:
            dialogue.say(role, row.performative, row.kind)


# --- particular protocols -------------------------------------------------------------------------


def test_messages_of_earlier_rounds_are_copies():
    """A new round has a new m_w, so that cfp and proposal of an earlier round are recognised."""
    dialogue = Dialogue("icfp")
    for word in ("i:cfp", "p:propose", "i:cfp"):
        dialogue.word(word)
    first, proposal, second = (message for _, message, _ in dialogue.heard)
    assert len({first.reply_with, second.reply_with}) == 2
    assert proposal.in_reply_to == first.reply_with
    with pytest.raises(RemoteProtocolError, match="not a message that waits"):
        dialogue.sides[INITIATOR].receive(proposal)
    dialogue.word("p:propose")
    for copy in (first, second):
        with pytest.raises(RemoteProtocolError, match="this is a copy"):
            dialogue.sides[PARTICIPANT].receive(copy)


@pytest.mark.parametrize("protocol", ["cfp", "icfp"])
def test_a_call_without_a_label_is_answered(protocol):
    """SC00061G requires a reply-with of no act; a copy of it is not a new round."""
    message = Dialogue(protocol).say(INITIATOR, P.CFP)
    bare = replace(message, reply_with="")
    called = Conversation.answering(bare, "ta").receive(bare)
    offered, proposal = called.send(P.PROPOSE, id="1", now=2.0)
    assert (offered.state, proposal.in_reply_to) == ("offered", "")
    with pytest.raises(RemoteProtocolError, match="accepts"):
        called.receive(bare)


def test_cancel_that_failed_may_be_tried_again():
    """The conversation continues in its state, with the deadline of its call and not that of the
    cancel, and the first cancel is a copy from then on.
    """
    dialogue = Dialogue("cfp", reply_by=10.0)
    dialogue.word("i:cfp")
    dialogue.reply_by = 5.0
    dialogue.word("i:cancel")
    assert [side.deadline for side in dialogue.sides.values()] == [5.0, 5.0]
    dialogue.reply_by = None
    dialogue.word("p:failure[cancel]")
    assert dialogue.states == ("called", "called")
    assert [side.deadline for side in dialogue.sides.values()] == [10.0, 10.0]
    first = dialogue.heard[1][1]
    with pytest.raises(RemoteProtocolError, match="this is a copy"):
        dialogue.sides[PARTICIPANT].receive(first)
    for word in ("p:propose", "i:cancel", "p:inform[cancel]"):
        dialogue.word(word)
    assert dialogue.states == ("cancelled", "cancelled")


def test_not_understood_as_answer_to_a_cancel_is_a_failed_cancel():
    """It has the same effect as a failure in reply to the cancel."""
    for name in NAMES:
        if name in ("query", "subscribe"):
            continue
        story = next(s for s in stories_of(name) if s.words[1:] == ("i:cancel", "p:inform[cancel]"))
        failed = Dialogue(name).play(Story((*story.words[:2], "p:failure[cancel]"), story.ends))
        unheard = Dialogue(name).play(Story(story.words[:2], story.ends))
        label = unheard.heard[-1][1].reply_with
        side, message = unheard.sides[PARTICIPANT].send(
            P.NOT_UNDERSTOOD, id="p-9", now=0.0, in_reply_to=label
        )
        assert side == failed.sides[PARTICIPANT]
        assert unheard.sides[INITIATOR].receive(message) == failed.sides[INITIATOR]
