"""The paper's `coordinate`: walked in both roles; what its text leaves out is found when its row is
taken away.
"""

from enum import StrEnum

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from companion.design import COORDINATE, LANGUAGES, SW
from companion.languages.sw import FINAL as FINAL_STATES
from companion.languages.sw import Report, WorkerState
from fipa_codec.communicate import decode, encode
from fipa_codec.conversation import Conversation
from fipa_codec.errors import LocalProtocolError, RemoteProtocolError
from fipa_codec.exploration import explore, with_not_understood
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.tables import RECEIVE, SEND, Role, Row, Table


class S(StrEnum):
    """States of both roles, as design.toml writes them."""

    START = "start"
    ASKED = "asked"
    RUNNING = "running"
    REPORTED = "reported"
    CANCELLING = "cancelling"
    CANCELLING_REPORTED = "cancelling-reported"
    CONCLUDED = "concluded"
    STOPPING = "stopping"
    FINISHED = "finished"
    DONE = "done"
    REFUSED = "refused"


CO, TA = Role.INITIATOR, Role.PARTICIPANT
PLAIN, PROGRESS, FINAL = Kind.PLAIN, Kind.PROGRESS, Kind.FINAL


class Fleet:
    """co and ta with a wire of bytes each way; content is really said in SW, and its kind read from
    it.
    """

    def __init__(self):
        co = Conversation.open("coordinate", CO, id="co-3-12", me="co", peer="ta")
        self.sides, self.wires, self.count = {CO: co}, {CO: [], TA: []}, 0

    def send(self, role, performative, state=None, **options):
        """Said by `role`, with a report of that state, and on its way then."""
        self.count += 1
        name = "co" if role is CO else "ta"
        if state:
            report = Report(state)
            options |= {"content": SW.encode(report), "kind": SW.kind(report)}
        options = {"id": f"{name}-3-{self.count}", "now": 1.76e9, "language": "SW"} | options
        self.sides[role], message = self.sides[role].send(performative, **options)
        self.wires[role.other].append(encode(message))
        return message

    def take(self, role):
        """`role` takes what is first on its way to it."""
        message = decode(self.wires[role].pop(0))
        if role not in self.sides:
            self.sides[role] = Conversation.answering(message, "ta")
        kind = LANGUAGES.read(message)[1]
        side = self.sides[role].receive(message, kind)
        self.sides[role] = msgspec.msgpack.decode(msgspec.msgpack.encode(side), type=Conversation)
        return message

    def say(self, role, performative, state=None, **options):
        """Sent and taken at once."""
        self.send(role, performative, state, **options)
        return self.take(role.other)

    @property
    def states(self):
        """States of co and ta."""
        return self.sides[CO].state, self.sides[TA].state


@pytest.fixture
def running():
    """A plan that ta has taken and reported Running; the confirm has come."""
    fleet = Fleet()
    fleet.say(CO, P.REQUEST, reply_by=1.76e9 + 5)
    fleet.say(TA, P.INFORM, WorkerState.RUNNING)
    fleet.say(CO, P.CONFIRM)
    return fleet


@pytest.mark.parametrize("capacity", [2, 3, 5])
def test_sound(capacity):
    """No reception without a row, no stuck configuration, all states reachable."""
    found = explore(COORDINATE, capacity)
    assert not found.unspecified, str(found.unspecified[0])
    assert not found.stuck, str(found.stuck[0])
    assert found.sound, found.unreachable


def test_not_understood_at_any_point_leaves_nobody_waiting():
    """The rule outside the tables is closed too."""
    found = explore(with_not_understood(COORDINATE), capacity=3)
    assert not found.unspecified, str(found.unspecified[0])
    assert not found.stuck, str(found.stuck[0])


def spoilt(table, role):
    """Return the result of the exploration with another table for one role."""
    return explore(COORDINATE.with_tables(**{role.value: table}))


@pytest.mark.parametrize(
    ("state", "performative", "kind"),
    [
        (S.REFUSED, P.CANCEL, PLAIN),
        (S.FINISHED, P.CANCEL, PLAIN),
        (S.FINISHED, P.CONFIRM, PROGRESS),
        (S.STOPPING, P.CONFIRM, PROGRESS),
        (S.RUNNING, P.CONFIRM, PROGRESS),
    ],
    ids=[
        "cancel meets refuse",
        "cancel crosses the final report",
        "late confirm",
        "confirm while stopping",
        "confirm",
    ],
)
def test_rows_that_the_papers_text_leaves_out_are_needed_at_ta(state, performative, kind):
    """Without the row the message stands at the head of the queue for ever, without any fault."""
    found = spoilt(COORDINATE.tables[TA].without(state, RECEIVE, performative, kind), TA)
    text = f"participant in state {state} has no row for {performative}"
    assert any(text in one.text for one in found.unspecified)
    assert found.stuck


@pytest.mark.parametrize("state", [S.RUNNING, S.CANCELLING])
@pytest.mark.parametrize(
    ("performative", "kind"), [(P.INFORM, PROGRESS), (P.INFORM, FINAL), (P.REFUSE, PLAIN)]
)
def test_every_word_of_ta_is_taken_by_co_also_after_its_cancel(state, performative, kind):
    """Reports and the refuse may cross the cancel."""
    found = spoilt(COORDINATE.tables[CO].without(state, RECEIVE, performative, kind), CO)
    text = f"initiator in state {state} has no row for {performative}"
    assert any(text in one.text for one in found.unspecified)


def test_a_report_with_the_label_of_the_cancel_is_confirmed(running):
    """Each side numbers its own messages, so ta's final report may have co's cancel's label; both
    ends are reached.
    """
    running.send(CO, P.CANCEL, id="7")
    running.send(TA, P.INFORM, WorkerState.SUCCEEDED, id="7")
    running.take(CO)
    running.take(TA)
    assert running.say(CO, P.CONFIRM).in_reply_to == "7"
    assert running.states == (S.DONE, S.DONE)


def waiting_ta():
    """ta in the naive reading: after a report it takes nothing but the confirm."""
    return COORDINATE.tables[TA].with_rows(
        Row(S.ASKED, SEND, P.INFORM, PROGRESS, "unconfirmed"),
        Row("unconfirmed", RECEIVE, P.CONFIRM, PROGRESS, S.RUNNING),
    )


def test_ta_must_not_wait_for_a_confirm():
    """The cancel may come before the confirm, and stands at the head of the queue."""
    found = spoilt(waiting_ta(), TA)
    texts = {f.text for f in found.unspecified}
    assert texts == {"participant in state unconfirmed has no row for cancel"}
    sent = [step.row.word for step in found.unspecified[0].steps if step.row.way is SEND]
    assert sent[:2] == ["request", "cancel"]


def test_ta_that_waits_and_co_that_stops_confirming_block_each_other():
    """co confirms no more once it has cancelled, ta waits for the confirm: a deadlock without any
    fault.
    """
    silent = Row(S.CANCELLING, RECEIVE, P.INFORM, PROGRESS, S.CANCELLING)
    co = COORDINATE.tables[CO].with_rows(silent)
    found = explore(COORDINATE.with_tables(initiator=co, participant=waiting_ta()))
    stuck = {(c.initiator, c.participant) for c, _, _ in found.stuck}
    assert (S.CANCELLING, "unconfirmed") in stuck


def test_final_report_must_be_confirmed():
    """co that ends with the final report and confirms nothing leaves ta in `finished` for ever."""
    ends = (Row(state, RECEIVE, P.INFORM, FINAL, S.DONE) for state in (S.RUNNING, S.CANCELLING))
    old = COORDINATE.tables[CO].with_rows(*ends)
    rows, urgent = (
        [row for row in old if row.state != S.CONCLUDED],
        (S.REPORTED, S.CANCELLING_REPORTED),
    )
    co = Table(rows, ended=old.ended, urgent=urgent)
    found = spoilt(co, CO)
    assert (S.DONE, S.FINISHED) in {(c.initiator, c.participant) for c, _, _ in found.stuck}


def test_plan_with_a_report_in_between(running):
    """request, Running, confirm, Error, confirm, Succeeded, confirm: the paper's figure 8."""
    running.say(TA, P.INFORM, WorkerState.ERROR)
    running.say(CO, P.CONFIRM)
    report = running.say(TA, P.INFORM, WorkerState.SUCCEEDED)
    assert running.states == ("concluded", "finished")
    assert running.say(CO, P.CONFIRM).in_reply_to == report.reply_with
    assert running.states == ("done", "done")
    assert all(side.ended for side in running.sides.values())


def test_fields_are_those_of_the_paper(running):
    """request, inform and cancel have m_w and m_c and no m_t; confirm has the inform's m_w as
    m_t.
    """
    inform = running.say(TA, P.INFORM, WorkerState.RUNNING)
    confirm = running.say(CO, P.CONFIRM)
    cancel = running.say(CO, P.CANCEL)
    assert inform.reply_with
    assert cancel.reply_with
    assert (inform.in_reply_to, cancel.in_reply_to) == ("", "")
    assert (confirm.in_reply_to, confirm.reply_with) == (inform.reply_with, "")
    assert {m.conversation for m in (inform, confirm, cancel)} == {"co-3-12"}
    assert confirm.content is cancel.content is msgspec.UNSET


def test_messages_in_sw_are_small(running):
    """At most 120 bytes of envelope; paper: 100-200 B in all."""
    running.count = 44
    inform = running.say(TA, P.INFORM, WorkerState.RUNNING)
    assert inform.id == "ta-3-45"
    confirm = running.say(CO, P.CONFIRM)
    bare = [msgspec.structs.replace(one, content=msgspec.UNSET) for one in (inform, confirm)]
    assert max(len(encode(one)) for one in bare) <= 120
    assert len(encode(inform)) <= 200


@pytest.mark.parametrize("state", sorted(FINAL_STATES))
def test_cancel_is_answered_by_the_final_report(running, state):
    """The final report answers it, of any kind, whether it crossed the cancel or follows it."""
    running.send(TA, P.INFORM, WorkerState.RUNNING)
    running.send(CO, P.CANCEL)
    running.take(CO)
    running.send(CO, P.CONFIRM)
    running.send(TA, P.INFORM, state)
    running.take(TA)
    assert running.states == ("cancelling", "finished")
    running.take(TA)
    running.take(CO)
    running.say(CO, P.CONFIRM)
    assert running.states == ("done", "done")


def test_refuse_answers_a_cancel_that_meets_it():
    """Also when ta has forgotten the conversation that it refused."""
    fleet = Fleet()
    fleet.say(CO, P.REQUEST)
    fleet.send(TA, P.REFUSE)
    fleet.send(CO, P.CANCEL)
    fleet.take(CO)
    del fleet.sides[TA]
    fleet.take(TA)
    assert fleet.states == ("refused", "refused")
    assert not fleet.sides[TA].owes


def test_co_confirms_before_it_takes_anything_else(running):
    """Every inform is confirmed in the step that took it."""
    running.send(TA, P.INFORM, WorkerState.ERROR)
    running.send(TA, P.INFORM, WorkerState.FAILED)
    running.take(CO)
    with pytest.raises(LocalProtocolError, match=r"must send confirm\[progress\]"):
        running.take(CO)


def test_reports_overtake_their_confirms(running):
    """ta waits for no confirm but the final one; each confirm names its report, in any order."""
    for _ in range(3):
        running.send(TA, P.INFORM, WorkerState.RUNNING)
    running.send(TA, P.INFORM, WorkerState.REPLAN)
    for _ in range(4):
        running.take(CO)
        running.send(CO, P.CONFIRM)
    assert [kind for _, kind in running.sides[TA].unconfirmed] == [PROGRESS] * 3 + [FINAL]
    for _ in range(4):
        running.take(TA)
    assert running.states == ("done", "done")
    assert running.sides[TA].unconfirmed == ()


def test_confirm_of_nothing_is_an_error(running):
    """m_t must name a report that waits for its confirm."""
    running.say(TA, P.INFORM, WorkerState.RUNNING)
    confirm = running.send(CO, P.CONFIRM)
    with pytest.raises(RemoteProtocolError) as caught:
        running.sides[TA].receive(replace(confirm, in_reply_to="ta-3-99"))
    assert caught.value.field == "in_reply_to"
    with pytest.raises(LocalProtocolError):
        running.send(CO, P.CONFIRM)


def test_report_without_kind_or_label_is_an_error(running):
    """An inform of coordinate is progress or final, and has an m_w to be confirmed by."""
    inform = running.send(TA, P.INFORM, WorkerState.RUNNING)
    with pytest.raises(RemoteProtocolError) as caught:
        running.sides[CO].receive(inform, Kind.PLAIN)
    assert caught.value.field == "performative"
    with pytest.raises(RemoteProtocolError) as caught:
        running.sides[CO].receive(replace(inform, reply_with=""), PROGRESS)
    assert caught.value.field == "reply_with"


def test_reply_by_of_the_request_is_met_by_the_first_report():
    """Then co sets its own watch, or a new reply-by with a cancel, which stands until the final
    report.
    """
    fleet = Fleet()
    fleet.say(CO, P.REQUEST, reply_by=1.76e9 + 5)
    assert fleet.sides[CO].late(1.76e9 + 6)
    fleet.say(TA, P.INFORM, WorkerState.RUNNING)
    assert fleet.sides[CO].deadline is None
    fleet.say(CO, P.CONFIRM)
    fleet.send(TA, P.INFORM, WorkerState.RUNNING)
    fleet.say(CO, P.CANCEL, reply_by=1.76e9 + 20)
    fleet.take(CO)
    fleet.say(CO, P.CONFIRM)
    assert fleet.sides[CO].deadline == 1.76e9 + 20
    fleet.say(TA, P.INFORM, WorkerState.PREEMPTED)
    fleet.say(CO, P.CONFIRM)
    assert fleet.sides[CO].deadline is None


REPORTS = {PROGRESS: [s for s in WorkerState if s not in FINAL_STATES], FINAL: sorted(FINAL_STATES)}


@given(st.data())
def test_whatever_is_sent_in_sequence_is_taken(data):
    """Any walk of the real conversations: no message meets a state without a row, confirms find
    their reports.
    """
    fleet = Fleet()
    for _ in range(30):
        owing = {r for r, side in fleet.sides.items() if side.owes}
        choices = [("take", r) for r in Role if fleet.wires[r] and r not in owing]
        for r, side in fleet.sides.items():
            choices += [("send", r, row) for row in side.table.allowed(side.state, SEND)]
        if not choices:
            break
        action, role, *rows = data.draw(st.sampled_from(choices))
        if action == "take":
            fleet.take(role)
        else:
            row = rows[0]
            reports = REPORTS[row.kind] if row.performative is P.INFORM else [None]
            fleet.send(role, row.performative, data.draw(st.sampled_from(reports)))
    for side in fleet.sides.values():
        assert side.state != S.DONE or side.unconfirmed == ()
