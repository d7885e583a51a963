"""A deleted journal: nothing is taken for what it is not, what was open ends on both sides, numbers
begin at 1.
"""

from typing import Any

import msgspec
import pytest
import toy_observers
from driven import Driven, ask, message, quiet, recording, request
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_agents import Want, faulty, toys, wirings

from agent_runtime.core import peers
from agent_runtime.core.events import (
    Arrived,
    Broken,
    Effects,
    Local,
    PeerChanged,
    Receipted,
    Received,
)
from agent_runtime.core.turn import Turn
from agent_runtime.testing.memory_bus import Faults, MemoryBus
from fipa_codec.performatives import Performative as P


class Named(Driven):
    """A core whose journal is called `own`; its peer's is called `old`."""

    def __init__(self, agent: Any, wiring: Any, peer: str) -> None:
        super().__init__(agent, wiring)
        self.state = self.core.boot(self.core.first("own"))
        self.step(PeerChanged(peer, 5, "old"))

    def restart(self) -> None:
        """Die, and come back from the journal."""
        self.state = self.core.boot(self.core.record(self.state))


def of(journal: str, one: Arrived, believed: str = "own") -> Arrived:
    """The same message, from this journal."""
    return msgspec.structs.replace(one, journal=journal, believed=believed)


def serving(**how: Any) -> Named:
    """The server, that took a request of the asker's old journal."""
    one = Named(recording(**how), wirings()[1], "asker")
    assert one.step(of("old", request(1))).receipts[0].taken == 1
    return one


def agree_first(turn: Turn) -> None:
    """Agree to a request; when its conversation breaks, speak in it all the same."""
    if isinstance(turn.event, Received) and turn.event.communicate.performative is P.REQUEST:
        turn.say(turn.event.conversation, P.AGREE)
    if isinstance(turn.event, Broken):
        turn.say(turn.event.conversation, P.FAILURE)


def test_a_new_journals_first_message_is_not_taken_for_an_old_one() -> None:
    """Its number was taken before, of another journal: taken in its turn, and receipted as number
    1.
    """
    one = serving(said=agree_first)
    one.step(PeerChanged("asker", 1, "new"))
    effects = one.step(of("new", request(1, conversation="asker-1-7")))
    assert [(receipt.taken) for receipt in effects.receipts] == [1]
    assert effects.handled.conversation == "asker-1-7"
    assert "taken before" not in one.state.counts


def test_what_means_another_journal_is_neither_taken_nor_receipted() -> None:
    """From a journal that is not the peer's present one, or to one that is not ours: the same,
    before and after.
    """
    one = serving(said=agree_first)
    strays = (("new", 2, "own"), ("old", 2, "gone"), ("old", 1, "gone"), ("new", 1, ""))
    for journal, number, believed in strays:
        effects = one.step(of(journal, request(number), believed))
        assert (effects.receipts, effects.handled, effects.sends) == ((), None, ())
    one.step(PeerChanged("asker", 1, "new"))
    late = one.step(of("old", request(2)))
    assert (late.receipts, late.handled) == ((), None)


def test_a_late_receipt_of_a_lost_journal_deletes_nothing() -> None:
    """Numbers begin at 1 again, so an old receipt would cover new messages."""
    one = Named(quiet(ask, name="asker"), wirings()[0], "server")
    for event in (Local(Want(1)), PeerChanged("server", 1, "new"), Local(Want(2))):
        one.step(event)
    for taken, journal, believed, left in (
        (9, "old", "own", [1]),
        (9, "new", "", [1]),
        (1, "new", "own", []),
    ):
        assert [sent.number for sent in one.state.outbox["server"]] == [1]
        one.step(Receipted("server", taken, journal=journal, believed=believed))
        assert [sent.number for sent in one.state.outbox.get("server", ())] == left


@pytest.mark.parametrize("dies", [False, True])
def test_open_conversations_end_with_the_reason_once(dies: bool) -> None:
    """The behaviour hears of each, also if it dies between; the log says it in one line; nothing is
    left to send.
    """
    told: list[Broken] = []

    def said(turn: Turn) -> None:
        ask(turn)
        if isinstance(turn.event, Broken):
            told.append(turn.event)

    one = Named(quiet(said, name="asker"), wirings()[0], "server")
    for number in range(3):
        one.step(Local(Want(number)))
    assert len(one.state.conversations) == len(one.state.outbox["server"]) == 3
    after, effects = one.core.step(one.state, PeerChanged("server", 1, "new"), 0.0)
    lines = [f"{line.fields.get('why', '')} {line}" for line in effects.logs]
    assert len([line for line in lines if "begin" in line or "numbered" in line]) == 1
    one.state = one.core.boot(effects.record) if dies else after
    one.step(PeerChanged("server", 1, "new"))
    assert [(one.conversation, one.reason.partition(":")[0]) for one in told] == [
        (f"asker-1-{number}", "server lost its memory") for number in (1, 2, 3)
    ]
    assert not one.state.conversations
    assert not one.state.outbox
    one.restart()
    one.step(PeerChanged("server", 1, "new"))
    assert len(told) == 3


def test_words_in_a_lost_conversation_go_nowhere() -> None:
    """A behaviour that does not look may speak in it: no error, no number used, nothing sent. The
    token of a dead journal's last life may appear after the new one's: it is never believed again.
    """
    one = serving(said=agree_first)
    effects = one.step(PeerChanged("asker", 1, "new"))
    assert isinstance(effects.handled, Broken)
    assert not effects.sends
    assert not one.state.issued
    one.step(PeerChanged("asker", 5, "old"))
    assert one.state.journals == {"asker": "new"}


def test_what_is_remembered_of_lost_journals_is_bounded() -> None:
    """A peer that loses its journal again and again fills no record."""
    one = serving(said=agree_first)
    for number in range(100):
        one.step(PeerChanged("asker", 1, f"new-{number}"))
        one.step(of(f"new-{number}", request(1, conversation=f"asker-1-{number}x")))
    assert len(one.state.given_up) == peers.GIVEN_UP
    assert len(one.state.lost) <= peers.TOLD + 1


def test_a_subscriber_renews_when_the_observer_lost_its_memory() -> None:
    """The subscription breaks; observations of the new journal are news, though their versions are
    lower.
    """
    one = Named(toy_observers.knower(), toy_observers.wiring("knower"), "watcher")
    first = one.state.memory.soft.conversation
    for act, seen, fields in (
        (P.AGREE, None, {"id": "w1", "in_reply_to": first}),
        (P.INFORM, toy_observers.Seen("jar", 1), {"id": "jar@5.9"}),
    ):
        said = message(act, "watcher>knower", "subscribe", seen, conversation=first, **fields)
        effects = one.step(of("old", Arrived(said)))
    assert effects.receipts
    assert one.step(PeerChanged("watcher", 5, "new")).handled == Broken(
        first, "watcher lost its memory: its journal is gone, and with it this subscription"
    )


# --- two agents on wires --------------------------------------------------------------------------


def at_rest(wires: MemoryBus, wanted: int) -> bool:
    """All answered, nothing open, nothing to be sent again."""
    states = [node.state for node in wires.nodes.values()]
    if any(state is None or state.outbox or state.conversations for state in states):
        return False
    return len(wires.memory("asker").answers) == wanted


@pytest.mark.parametrize("victim", ["asker", "server"])
@pytest.mark.parametrize("after_s", [0.0003, 0.0008, 0.0012, 0.0018, 0.05, 0.1013, 0.1018, 0.21])
def test_a_journal_lost_at_any_moment(victim: str, after_s: float) -> None:
    """All is answered in the end, and nothing stays open on either side."""
    wires = toys(1, 2, 3)
    wires.run_for(after_s)
    wires.put_back(victim, None)
    wires.run(lambda: at_rest(wires, 3))
    assert wires.memory("asker").answers == ((1, 2), (2, 4), (3, 6))


@pytest.mark.parametrize("victim", ["asker", "server"])
@pytest.mark.parametrize("back", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("after_s", [0.0018, 0.05, 0.1018, 0.1523, 0.21])
def test_a_journal_whose_end_is_lost(victim: str, back: int, after_s: float) -> None:
    """All is answered in the end, and nothing stays open on either side; who forgot what it had
    taken says so.
    """
    wires = toys(1, 2, 3)
    kept, node = records(wires), wires.nodes[victim]
    wires.run_for(after_s)
    before = node.core.boot(node.journal)
    wires.put_back(victim, kept[victim][max(0, len(kept[victim]) - 1 - back)])
    after = node.core.boot(node.journal)
    wires.run(lambda: at_rest(wires, 3))
    assert wires.memory("asker").answers == ((1, 2), (2, 4), (3, 6))
    other = "server" if victim == "asker" else "asker"
    forgot = after.taken.get(other, 0) < before.taken.get(other, 0)
    mine, theirs = (wires.nodes[name].state.counts for name in (victim, other))
    assert peers.SHORTENED not in theirs
    assert mine.get(peers.SHORTENED, 0) == theirs.get("peer lost its memory", 0) == forgot


def records(wires: MemoryBus) -> dict[str, list[bytes]]:
    """The records of each agent, of its first life and of those that follow."""
    kept: dict[str, list[bytes]] = {}

    def keep(agent: str, effects: Effects) -> None:
        if effects.record is not None:
            kept.setdefault(agent, []).append(effects.record)

    wires.on_step = keep
    return kept


@given(
    seed=st.integers(0, 2**32),
    faults=faulty(0.3, 0.3, 0.4, 0.05),
    lost=st.lists(
        st.tuples(
            st.sampled_from(["asker", "server"]),
            st.floats(0.0, 0.6),
            st.none() | st.integers(1, 12),
        ),
        min_size=1,
        max_size=4,
    ),
)
@settings(max_examples=250, deadline=None)
def test_lost_and_shortened_journals_among_other_faults(
    seed: int, faults: Faults, lost: list[tuple[str, float, int | None]]
) -> None:
    """No other fault makes anybody wait for ever for a peer that knows nothing, or less than it
    knew.
    """
    wires = toys(1, 2, 3, seed=seed, faults=faults)
    kept = records(wires)
    for victim, pause_s, back in lost:
        wires.run_for(pause_s)
        if wires.up(victim) and back is None:
            wires.put_back(victim, None)
            kept.pop(victim, None)  # nobody believes a name again that was given up
        elif wires.up(victim) and kept.get(victim):
            wires.put_back(victim, kept[victim][max(0, len(kept[victim]) - 1 - back)])
    wires.faults = msgspec.structs.replace(faults, crash=0.0)
    wires.run(lambda: at_rest(wires, 3), limit_s=3600.0)
    assert wires.memory("asker").answers == ((1, 2), (2, 4), (3, 6))
