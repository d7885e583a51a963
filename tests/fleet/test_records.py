"""The discipline of the journal, seen on the true agents: what costs a record, and what must stand in one first."""

from collections import Counter

import msgspec
import pytest
from pretended_fleet import NAMES, Fleet

from agent_runtime.core.effects import Effects
from agent_runtime.core.events import Received
from agent_runtime.core.state import Record
from agent_runtime.core.streams import OUTBOX_BOUND
from agent_runtime.core.wiring import Delivery
from agent_runtime.testing.memory_bus import Faults
from companion.binding import wiring

EXPLORED = 5  # messages the explored fleet ever had unreceipted in one stream; co to ta, the others 3


def pours(fleet: Fleet) -> None:
    """The main job, from the words to the end."""
    fleet.say("pour the jar into the bowl")
    assert fleet.finish() == ["done"]


def delivery(agent: str, peer: str, protocol: str) -> Delivery:
    """Return how these two send messages of this protocol."""
    return wiring(agent, "test").required(peer, protocol).delivery


def test_questions_and_answers_cost_no_record(fleet) -> None:
    """Queries are asked, answered and handed to the search without a sync, unless the FSM goes to another state."""
    soft: Counter[str] = Counter()

    def look(agent: str, effects: Effects) -> None:
        one = effects.handled.communicate if isinstance(effects.handled, Received) else None
        if one is not None and delivery(agent, one.sender, one.protocol) is Delivery.VOLATILE:
            soft[agent] += 1
            moved = [line.fields for line in effects.logs if line.event == "state"]
            there_and_back = bool(moved) and moved[0]["old"] == moved[-1]["new"]
            assert effects.record is None or (moved and not there_and_back), f"{agent}, {one.performative}: {moved}"

    fleet.wires.on_step = look
    pours(fleet)
    assert soft["pl"] >= len(fleet.asked) > 10
    assert soft["km"] >= len(fleet.asked)


def test_the_whole_job_costs_few_records(fleet) -> None:
    """Two plans with all their queries cost pl a handful of syncs, and all agents together some hundred."""
    records: Counter[str] = Counter()
    fleet.wires.on_step = lambda agent, effects: records.update([agent] if effects.record else [])
    pours(fleet)
    assert records["pl"] <= 10, records  # seen: 6
    assert sum(records.values()) <= 200, records  # seen: 139 for 18 motions


@pytest.mark.parametrize("faults", [Faults(), Faults(loss=0.2, duplication=0.2, delay=0.2)], ids=["calm", "faults"])
def test_nothing_leaves_before_a_record_says_so(faults: Faults) -> None:
    """Receipts and durable communicates of a step are covered by its record or by an earlier one."""
    fleet = Fleet(seed=3, faults=faults)

    def look(agent: str, effects: Effects) -> None:
        journal = effects.record or fleet.wires.nodes[agent].journal
        written = msgspec.msgpack.decode(journal, type=Record)
        for receipt in effects.receipts:
            if receipt.subject and receipt.version == (0, 0):
                continue  # the last word of a volatile conversation: nothing to keep
            if receipt.subject:
                assert written.versions[receipt.peer][receipt.subject] >= receipt.version
            else:
                assert written.taken.get(receipt.peer, 0) >= receipt.taken
        for one in effects.sends:
            if delivery(agent, one.receiver, one.protocol) is Delivery.DURABLE:
                assert written.issued[one.receiver] >= int(one.id)
                unreceipted = [sent.number for sent in written.outbox.get(one.receiver, ())]
                assert not effects.record or int(one.id) in unreceipted

    fleet.wires.on_step = look
    pours(fleet)
    fleet.close()


@pytest.mark.parametrize("seed", range(3))
def test_outboxes_stay_as_short_as_explored(seed: int) -> None:
    """Even where a third of all messages is lost, nobody has more unreceipted than the exploration found."""
    fleet = Fleet(seed=seed, faults=Faults(loss=0.3, duplication=0.1))
    longest: Counter[str] = Counter()

    def look(agent: str, effects: Effects) -> None:
        for name in NAMES:
            state = fleet.wires.nodes[name].state
            for peer, sent in state.outbox.items() if state else ():
                longest[f"{name}-{peer}"] = max(longest[f"{name}-{peer}"], len(sent))

    fleet.wires.on_step = look
    pours(fleet)
    fleet.close()
    assert max(longest.values()) <= EXPLORED < OUTBOX_BOUND, longest
