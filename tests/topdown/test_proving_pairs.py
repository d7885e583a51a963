"""Layer 2: pairs hold under faults; naive variants of their tables and of the delivery fail by a
shortest way.
"""

from pathlib import Path

import msgspec
import pytest

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import RemoteProtocolError
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, ICFP, PROTOCOLS, QUERY, REQUEST, SUBSCRIBE, State
from fipa_codec.tables import RECEIVE, SEND, Protocol, Role, Row
from topdown.model.design import Design, load
from topdown.model.elements import Division, Split, Step
from topdown.prove.durable import durable_pair
from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG, explore
from topdown.prove.net import NetModel
from topdown.prove.pairs import changed_channels, explore_use, ideal_pair, spoken
from topdown.prove.roles import Players, restricted
from topdown.prove.volatile import NOT_HELD, Rules, volatile_pair

ASKER, SERVER = Role.INITIATOR, Role.PARTICIPANT
PLAIN, CANCEL = Kind.PLAIN, Kind.CANCEL
LAMP = load(Path(__file__).parent / "lamp.toml")


def explored(net):
    """All findings of a net, shortest first."""
    return explore(NetModel(net), first=False)


def story(finding):
    """The acts of a finding as short words."""
    return [f"{step.who} {step.what}" for step in finding.trace]


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
def test_durable_pairs_hold(protocol):
    """No deadlock, no reception without a row, every conversation ends or rests; so over ideal
    queues, with fewer states.
    """
    found = explored(durable_pair(protocol, faults=1))
    assert found.holds, str(found.findings[0])
    ideal = explored(ideal_pair(protocol))
    assert ideal.holds, str(ideal.findings[0])
    assert ideal.states < found.states


@pytest.mark.long
@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
def test_durable_pairs_hold_with_two_faults(protocol):
    """Some hundred thousand states."""
    assert explored(durable_pair(protocol, faults=2)).holds


def test_questions_hold_whatever_is_lost():
    """Asked again until answered; a server that dies is asked again too. Any number of faults
    includes fewer.
    """
    for faults in (2, None):
        assert explored(volatile_pair(QUERY, faults=faults)).holds


def subscription(*more):
    """subscribe between agents that say these words only."""
    return restricted(SUBSCRIBE, {ASKER: {"subscribe"}, SERVER: {"agree", "inform", *more}})


def test_subscriptions_hold_and_no_observation_is_lost():
    """Renewed after every death; the newest observation comes in the end."""
    for faults in (1, None):
        assert explored(volatile_pair(subscription(), faults=faults, latest=True)).holds


def test_another_round_is_no_repetition():
    """icfp calls again within its conversation; a participant without a row for that is found."""
    rounds = explored(durable_pair(ICFP, faults=0))
    assert rounds.holds
    assert rounds.states > explored(durable_pair(CFP, faults=0)).states
    deaf = ICFP.with_tables(participant=ICFP.tables[SERVER].without(State.OFFERED, RECEIVE, P.CFP))
    finding = explored(durable_pair(deaf, faults=0)).findings[0]
    assert finding.kind == UNREACHED
    assert [step.split()[1] for step in story(finding)].count("cfp") >= 2


# --- naive variants of tables ---------------------------------------------------------------------


def request_without_late_failures():
    """The participant takes a cancel that came too late, and says nothing."""
    server = REQUEST.tables[SERVER]
    for state, after in (
        ("start", State.REFUSED),
        *((s, s) for s in (State.DONE, State.FAILED, State.REFUSED)),
    ):
        server = server.with_rows(Row(state, RECEIVE, P.CANCEL, PLAIN, after))
    return REQUEST.with_tables(participant=server)


def test_no_failure_in_reply_to_a_late_cancel_leaves_the_initiator_waiting():
    """Without any fault: request, cancel, refuse, and the cancel is absorbed."""
    finding = explored(
        durable_pair(request_without_late_failures(), Players("hi", "co"), faults=0)
    ).findings[0]
    assert finding.kind == UNREACHED
    assert finding.trace[-1].after["hi"] in (State.OVERTAKEN, State.CANCELLING_ASKED)
    assert {step.split()[1] for step in story(finding)} >= {"request", "cancel"}
    assert len(finding.trace) <= 6


def test_a_cancel_that_crosses_the_end_must_be_taken():
    """The participant has ended; its row for the cancel is missing."""
    for state in (State.DONE, State.REFUSED, State.FAILED):
        server = REQUEST.tables[SERVER].without(state, RECEIVE, P.CANCEL)
        net = durable_pair(REQUEST.with_tables(participant=server), Players("hi", "co"), faults=0)
        finding = explored(net).findings[0]
        assert (finding.kind, finding.text) == (WRONG, f"co in state {state} has no row for cancel")
        assert len(finding.trace) == 5


def test_a_cancel_of_a_forgotten_conversation_must_be_taken():
    """The runtime forgets what has ended: the row of an unknown conversation is needed as well."""
    server = REQUEST.tables[SERVER].without(State.START, RECEIVE, P.CANCEL)
    finding = explored(durable_pair(REQUEST.with_tables(participant=server), faults=0)).findings[0]
    assert finding.kind == WRONG
    assert "its conversation forgotten, has no row for cancel" in finding.text


def test_an_answer_that_never_comes_is_found():
    """The participant agrees and may say nothing more; that the initiator may cancel is no way
    out.
    """
    server = REQUEST.tables[SERVER]
    for answer in (P.INFORM, P.FAILURE):
        server = server.without(State.AGREED, SEND, answer)
    finding = explored(
        durable_pair(REQUEST.with_tables(participant=server), Players("a", "b"), faults=0)
    ).findings[0]
    assert finding.kind == UNREACHED
    assert story(finding)[-1] == "b agree -> a"


def test_agents_that_fill_their_outboxes_with_news_can_block_each_other():
    """Both are full and take nothing: why news leaves room for the answers that are owed."""
    rows = REQUEST.tables[SERVER].with_rows(
        Row(State.AGREED, SEND, P.INFORM, Kind.PROGRESS, State.AGREED)
    )
    chatty = REQUEST.with_tables(
        initiator=REQUEST.tables[ASKER].with_rows(
            Row(State.AGREED, RECEIVE, P.INFORM, Kind.PROGRESS, "owing"),
            Row("owing", SEND, P.CONFIRM, PLAIN, State.AGREED),
        ),
        participant=rows.with_rows(Row(State.AGREED, RECEIVE, P.CONFIRM, PLAIN, State.AGREED)),
    )
    assert DEADLOCK in {
        finding.kind for finding in explored(durable_pair(chatty, faults=0, eager=True)).findings
    }


# --- naive variants of the delivery ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("rules", "kind", "last"),
    [
        (Rules(renews=False), UNREACHED, "ta dies and is restored"),
        (Rules(keeps_due=False), WRONG, "ta dies and is restored"),
    ],
    ids=["not renewed", "due in RAM"],
)
def test_subscriptions_fail_without_their_rules(rules, kind, last):
    """One death of the publisher is enough."""
    net = volatile_pair(subscription(), Players("km", "ta"), faults=1, latest=True, rules=rules)
    finding = explored(net).findings[0]
    assert finding.kind == kind
    assert story(finding)[-1] == last
    assert (kind == WRONG) == (finding.text == NOT_HELD)


def test_a_question_that_is_not_asked_again_waits_for_ever():
    """One death of the server."""
    rules = Rules(asks_again=False)
    finding = explored(volatile_pair(QUERY, Players("pl", "km"), faults=1, rules=rules)).findings[0]
    assert (
        story(finding) == ["pl query-if -> km", "km dies and is restored"]
        or finding.kind == DEADLOCK
    )
    assert len(finding.trace) == 2


def test_a_cancel_that_is_not_asked_till_the_end_may_be_lost():
    """A word that crosses it is not an answer to it."""
    rules = Rules(cancels_till_over=False)
    finding = explored(
        volatile_pair(SUBSCRIBE, Players("km", "ta"), faults=1, rules=rules)
    ).findings[0]
    assert story(finding)[-1] == "wire loses cancel of km"


def test_a_publisher_that_refuses_may_take_a_late_copy():
    """Asked again on the way, it has forgotten its refuse and agrees: a subscription that nobody
    holds.
    """
    finding = explored(
        volatile_pair(subscription("refuse"), Players("km", "ta"), faults=0, latest=True)
    ).findings[0]
    assert finding.kind == UNREACHED
    assert (finding.trace[-1].after["km"], finding.trace[-1].after["ta"]) == (
        State.REFUSED,
        State.LIVE,
    )


def test_what_needs_a_durable_stream_is_told_where_it_is_volatile():
    """A result, or the failure that ends a subscription, is said once: only reply-by ends the wait
    if it is lost.
    """
    small = restricted(REQUEST, {ASKER: {"request"}, SERVER: {"agree", "inform", "refuse"}})
    for protocol in (small, SUBSCRIBE):
        found = explored(volatile_pair(protocol, faults=1))
        assert UNREACHED in {finding.kind for finding in found.findings}, protocol.name


# --- of a design ----------------------------------------------------------------------------------


def test_a_design_is_verified_by_channel():
    """The lamp: one durable request, with the acts that its use lists."""
    result = explore_use(LAMP, "switch", 1)
    assert result.holds
    assert (result.use, result.channel, result.delivery) == ("switch", "C1", "durable")
    assert {row.word for row in spoken(LAMP, "switch").tables[SERVER] if row.way is SEND} == {
        "inform"
    }


def test_a_limit_says_what_is_open():
    """No verdict where the search stopped."""
    result = explore_use(LAMP, "switch", 2, most_states=100)
    assert not result.holds
    assert "not looked at" in result.exploration.unproven


def test_states_that_nobody_comes_to_are_named(monkeypatch):
    """A cancel that the use lists, and that the initiator's table has no place for."""
    request = LAMP.file.protocol[0].message[0]
    cancel = msgspec.structs.replace(request, performative=P.CANCEL, content=())
    use = msgspec.structs.replace(
        LAMP.file.protocol[0], message=(*LAMP.file.protocol[0].message, cancel)
    )
    design = Design(msgspec.structs.replace(LAMP.file, protocol=(use,)))
    assert not explore_use(design, "switch", 0).unreached
    asker = REQUEST.tables[ASKER].without(State.ASKED, SEND, P.CANCEL)
    monkeypatch.setattr(REQUEST, "tables", {**REQUEST.tables, ASKER: asker})
    assert "lamp stopping-asked" in explore_use(design, "switch", 0).unreached


def test_channels_of_a_step():
    """The lamp's one step makes its one channel."""
    assert changed_channels(LAMP, 1) == ("C1",)
    with pytest.raises(IndexError, match="steps 1 to 1"):
        changed_channels(LAMP, 2)


def test_a_channel_that_is_split_later_is_verified_by_its_parts():
    """Step 1 made it, step 2 split it: both steps touch both parts."""
    step = Step(
        requirements=("R1",),
        divide=Division("lamp", ("bulb", "base")),
        split=(Split("C1", ("C2", "C3")),),
        tasks=(),
    )
    design = Design(msgspec.structs.replace(LAMP.file, step=(*LAMP.file.step, step)))
    assert set(changed_channels(design, 1)) == set(changed_channels(design, 2)) == {"C2", "C3"}


# --- the same table, not twins --------------------------------------------------------------------


def conversation_takes_cancel_when_done():
    """Whether a running conversation of `request`, participant, takes a cancel after its inform."""

    def say(performative, number):
        return Communicate(
            performative=performative,
            protocol="request",
            conversation="c",
            sender="hi",
            receiver="co",
            id=str(number),
            reply_with=str(number),
            sent=0.0,
        )

    talk = Conversation.answering(say(P.REQUEST, 1), "co").receive(say(P.REQUEST, 1))
    talk, _ = talk.send(P.INFORM, id="1", now=0.0)
    try:
        talk.receive(say(P.CANCEL, 2))
    except RemoteProtocolError:
        return False
    return True


def test_a_mutated_row_changes_the_verdict_and_the_running_conversation(monkeypatch):
    """One row less in the one table that both read."""
    assert conversation_takes_cancel_when_done()
    assert explored(durable_pair(REQUEST, faults=0)).holds
    mutated = REQUEST.tables[SERVER].without(State.DONE, RECEIVE, P.CANCEL)
    monkeypatch.setattr(REQUEST, "tables", {**REQUEST.tables, SERVER: mutated})
    assert not conversation_takes_cancel_when_done()
    assert (
        explored(durable_pair(REQUEST, faults=0))
        .findings[0]
        .text.endswith("in state done has no row for cancel")
    )


def test_a_mutated_row_of_a_design_changes_its_verdict(monkeypatch):
    """The explored rows are those of the design's own file."""
    assert isinstance(LAMP.tables["request"], Protocol)
    server = REQUEST.tables[SERVER].without(State.ASKED, SEND, P.INFORM)
    monkeypatch.setattr(REQUEST, "tables", {**REQUEST.tables, SERVER: server})
    result = explore_use(LAMP, "switch", 0)
    assert not result.holds


# --- ideal queues ---------------------------------------------------------------------------------


def test_ideal_queues_and_explicit_streams_agree_about_spoilt_tables():
    """The same text for a missing row, the same kind for a silent one."""
    small = restricted(
        REQUEST, {ASKER: {"request", "cancel"}, SERVER: {"refuse", "agree", "inform", "failure"}}
    )
    missing = small.with_tables(
        participant=small.tables[SERVER].without(State.DONE, RECEIVE, P.CANCEL)
    )
    silent = small.tables[SERVER]
    for state in (State.START, State.DONE, State.REFUSED):
        silent = silent.with_rows(Row(state, RECEIVE, P.CANCEL, PLAIN, State.DONE))
    for protocol, kind in ((missing, WRONG), (small.with_tables(participant=silent), UNREACHED)):
        ideal, explicit = (
            explored(net).findings[0]
            for net in (ideal_pair(protocol), durable_pair(protocol, faults=0))
        )
        assert (ideal.kind, ideal.text) == (explicit.kind, explicit.text)
        assert ideal.kind == kind
