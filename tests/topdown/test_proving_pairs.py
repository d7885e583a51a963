"""Layer 2: pairs hold under faults; naive variants of their tables and of the delivery fail by a
shortest way.
"""

from pathlib import Path

import msgspec
import pytest

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import CFP, ICFP, PROTOCOLS, QUERY, REQUEST, SUBSCRIBE, State
from fipa_codec.tables import RECEIVE, SEND, Role, Row
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


def first(initiator=None, participant=None, protocol=REQUEST, roles=None, **how):
    """The first finding of a durable pair with other tables."""
    spoilt = protocol.with_tables(initiator=initiator, participant=participant)
    return explored(durable_pair(spoilt, roles or Players("hi", "co"), faults=0, **how)).findings[0]


def volatile(protocol, asker="km", server="ta", faults=1, **how):
    """The first finding of a volatile pair."""
    return explored(volatile_pair(protocol, Players(asker, server), faults=faults, **how)).findings[
        0
    ]


@pytest.mark.parametrize("faults", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
def test_durable_pairs_hold(protocol, faults):
    """No deadlock, no reception without a row, every conversation ends or rests; so over ideal
    queues, with fewer states. With two faults there are some hundred thousand.
    """
    found = explored(durable_pair(protocol, faults=faults))
    assert found.holds, str(found.findings[0])
    ideal = explored(ideal_pair(protocol))
    assert ideal.holds, str(ideal.findings[0])
    assert ideal.states < found.states


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
    deaf = ICFP.tables[SERVER].without(State.OFFERED, RECEIVE, P.CFP)
    finding = first(participant=deaf, protocol=ICFP)
    assert finding.kind == UNREACHED
    assert [step.split()[1] for step in story(finding)].count("cfp") >= 2


# --- naive variants of tables ---------------------------------------------------------------------


def silent(server, ends):
    """A participant that takes a cancel which came too late, and says nothing; `ends`: (state,
    after it).
    """
    for state, after in ends:
        server = server.with_rows(Row(state, RECEIVE, P.CANCEL, PLAIN, after))
    return server


def test_no_failure_in_reply_to_a_late_cancel_leaves_the_initiator_waiting():
    """Without any fault: request, cancel, refuse, and the cancel is absorbed."""
    ends = [("start", State.REFUSED), *((s, s) for s in (State.DONE, State.FAILED, State.REFUSED))]
    finding = first(participant=silent(REQUEST.tables[SERVER], ends))
    assert finding.kind == UNREACHED
    assert finding.trace[-1].after["hi"] in (State.OVERTAKEN, State.CANCELLING_ASKED)
    assert {step.split()[1] for step in story(finding)} >= {"request", "cancel"}
    assert len(finding.trace) <= 6


def test_a_cancel_that_crosses_the_end_must_be_taken():
    """The participant has ended; its row for the cancel is missing. The runtime forgets what has
    ended: the row of an unknown conversation is needed as well.
    """
    for state in (State.DONE, State.REFUSED, State.FAILED):
        finding = first(participant=REQUEST.tables[SERVER].without(state, RECEIVE, P.CANCEL))
        assert (finding.kind, finding.text) == (WRONG, f"co in state {state} has no row for cancel")
        assert len(finding.trace) == 5
    finding = first(participant=REQUEST.tables[SERVER].without(State.START, RECEIVE, P.CANCEL))
    assert finding.kind == WRONG
    assert "its conversation forgotten, has no row for cancel" in finding.text


def test_an_answer_that_never_comes_is_found():
    """The participant agrees and may say nothing more; that the initiator may cancel is no way
    out.
    """
    server = REQUEST.tables[SERVER]
    for answer in (P.INFORM, P.FAILURE):
        server = server.without(State.AGREED, SEND, answer)
    finding = first(participant=server)
    assert finding.kind == UNREACHED
    assert story(finding)[-1] == "co agree -> hi"


def test_agents_that_fill_their_outboxes_with_news_can_block_each_other():
    """Both are full and take nothing: why news leaves room for the answers that are owed."""
    chatty = REQUEST.with_tables(
        initiator=REQUEST.tables[ASKER].with_rows(
            Row(State.AGREED, RECEIVE, P.INFORM, Kind.PROGRESS, "owing"),
            Row("owing", SEND, P.CONFIRM, PLAIN, State.AGREED),
        ),
        participant=REQUEST.tables[SERVER].with_rows(
            Row(State.AGREED, SEND, P.INFORM, Kind.PROGRESS, State.AGREED),
            Row(State.AGREED, RECEIVE, P.CONFIRM, PLAIN, State.AGREED),
        ),
    )
    found = explored(durable_pair(chatty, faults=0, eager=True)).findings
    assert DEADLOCK in {finding.kind for finding in found}


# --- naive variants of the delivery ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("rules", "kind"),
    [(Rules(renews=False), UNREACHED), (Rules(keeps_due=False), WRONG)],
    ids=["not renewed", "due in RAM"],
)
def test_subscriptions_fail_without_their_rules(rules, kind):
    """One death of the publisher is enough."""
    finding = volatile(subscription(), latest=True, rules=rules)
    assert finding.kind == kind
    assert story(finding)[-1] == "ta dies and is restored"
    assert (kind == WRONG) == (finding.text == NOT_HELD)


def test_a_question_that_is_not_asked_again_waits_for_ever():
    """One death of the server."""
    finding = volatile(QUERY, "pl", "km", rules=Rules(asks_again=False))
    deaths = ["pl query-if -> km", "km dies and is restored"]
    assert story(finding) == deaths or finding.kind == DEADLOCK
    assert len(finding.trace) == 2


def test_a_cancel_that_is_not_asked_till_the_end_may_be_lost():
    """A word that crosses it is not an answer to it."""
    finding = volatile(SUBSCRIBE, rules=Rules(cancels_till_over=False))
    assert story(finding)[-1] == "wire loses cancel of km"


def test_a_publisher_that_refuses_may_take_a_late_copy():
    """Asked again on the way, it has forgotten its refuse and agrees: a subscription that nobody
    holds.
    """
    finding = volatile(subscription("refuse"), faults=0, latest=True)
    assert finding.kind == UNREACHED
    last = finding.trace[-1].after
    assert (last["km"], last["ta"]) == (State.REFUSED, State.LIVE)


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
    """The lamp: one durable request, with the acts that its use lists. No verdict where the search
    stopped.
    """
    result = explore_use(LAMP, "switch", 1)
    assert result.holds
    assert (result.use, result.channel, result.delivery) == ("switch", "C1", "durable")
    sends = [row.word for row in spoken(LAMP, "switch").tables[SERVER] if row.way is SEND]
    assert set(sends) == {"inform"}
    stopped = explore_use(LAMP, "switch", 2, most_states=100)
    assert not stopped.holds
    assert "not looked at" in stopped.exploration.unproven


def test_states_that_nobody_comes_to_are_named(monkeypatch):
    """A cancel that the use lists, and that the initiator's table has no place for."""
    request = LAMP.file.protocol[0].message[0]
    cancel = msgspec.structs.replace(request, performative=P.CANCEL, content=())
    (use,) = LAMP.file.protocol
    use = msgspec.structs.replace(use, message=(*use.message, cancel))
    design = Design(msgspec.structs.replace(LAMP.file, protocol=(use,)))
    assert not explore_use(design, "switch", 0).unreached
    asker = REQUEST.tables[ASKER].without(State.ASKED, SEND, P.CANCEL)
    monkeypatch.setattr(REQUEST, "tables", {**REQUEST.tables, ASKER: asker})
    assert "lamp stopping-asked" in explore_use(design, "switch", 0).unreached


def test_channels_of_a_step():
    """The lamp's one step makes its one channel. One that is split later is verified by its parts:
    step 1 made it, step 2 split it, and both steps touch both parts.
    """
    assert changed_channels(LAMP, 1) == ("C1",)
    with pytest.raises(IndexError, match="steps 1 to 1"):
        changed_channels(LAMP, 2)
    halves = Division("lamp", ("bulb", "base"))
    step = Step(requirements=("R1",), divide=halves, split=(Split("C1", ("C2", "C3")),), tasks=())
    design = Design(msgspec.structs.replace(LAMP.file, step=(*LAMP.file.step, step)))
    assert set(changed_channels(design, 1)) == set(changed_channels(design, 2)) == {"C2", "C3"}


# --- the same table, not twins --------------------------------------------------------------------


def conversation_takes_cancel_when_done():
    """Whether a running conversation of `request`, participant, takes a cancel after its inform."""
    fields = {"protocol": "request", "conversation": "c", "sender": "hi", "receiver": "co"}
    ask, cancel = (
        Communicate(performative=act, reply_with=str(act), **fields)
        for act in (P.REQUEST, P.CANCEL)
    )
    talk = Conversation.answering(ask, "co").receive(ask)
    return talk.send(P.INFORM, id="1", now=0.0)[0].takes(cancel)


def test_a_mutated_row_changes_the_verdict_and_the_running_conversation(monkeypatch):
    """One row less in the one table that both read."""
    assert conversation_takes_cancel_when_done()
    assert explored(durable_pair(REQUEST, faults=0)).holds
    mutated = REQUEST.tables[SERVER].without(State.DONE, RECEIVE, P.CANCEL)
    monkeypatch.setattr(REQUEST, "tables", {**REQUEST.tables, SERVER: mutated})
    assert not conversation_takes_cancel_when_done()
    (finding, *_) = explored(durable_pair(REQUEST, faults=0)).findings
    assert finding.text.endswith("in state done has no row for cancel")


# --- ideal queues ---------------------------------------------------------------------------------


def test_ideal_queues_and_explicit_streams_agree_about_spoilt_tables():
    """The same text for a missing row, the same kind for a silent one."""
    small = restricted(
        REQUEST, {ASKER: {"request", "cancel"}, SERVER: {"refuse", "agree", "inform", "failure"}}
    )
    server = small.tables[SERVER]
    ends = [(state, State.DONE) for state in (State.START, State.DONE, State.REFUSED)]
    missing = server.without(State.DONE, RECEIVE, P.CANCEL)
    for table, kind in ((missing, WRONG), (silent(server, ends), UNREACHED)):
        protocol = small.with_tables(participant=table)
        nets = ideal_pair(protocol), durable_pair(protocol, faults=0)
        ideal, explicit = (explored(net).findings[0] for net in nets)
        assert (ideal.kind, ideal.text) == (explicit.kind, explicit.text)
        assert ideal.kind == kind
