"""Each protocol of FIPA, with its cancels, between two real agents over a real router; a crowd; a
broker's targets.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import fipa_agents as fipa
import pytest
from toy_fleet import Fleet, journalled

from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import Role

pytestmark = pytest.mark.zenoh

PROCESS = Path(__file__).with_name("story_process.py")


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Callable[..., Fleet]]:
    """Starts a router, and these agents as processes."""
    made: list[Fleet] = []

    def start(*names: str) -> Fleet:
        fleet = Fleet(tmp_path, PROCESS, names)
        made.append(fleet)
        fleet.start("router")
        fleet.ready("router")
        fleet.start(*names)
        return fleet

    yield start
    for fleet in made:
        fleet.end()


def test_every_story_of_every_protocol_ends_as_told(opened: Callable[..., Fleet]) -> None:
    """On both sides, by the journal of each."""
    fleet = opened("alice", "bob")
    players = {Role.INITIATOR: fipa.alice(), Role.PARTICIPANT: fipa.bob()}

    def over() -> bool:
        memories = [journalled(fleet.run, agent) for agent in players.values()]
        return any(one.wrong for one in memories) or all(
            len(one.ends) == len(fipa.SCRIPT) for one in memories
        )

    fleet.wait(over, f"all {len(fipa.SCRIPT)} stories are played", 50.0)
    for role, agent in players.items():
        played, wanted = journalled(fleet.run, agent), fipa.wanted(role)
        assert not played.wrong
        told = zip(fipa.SCRIPT, played.ends, wanted, strict=True)
        assert [(role, *row) for row in told if row[1] != row[2]] == []
    assert {name for name, _ in fipa.SCRIPT} == {protocol.name for protocol in PROTOCOLS}


def test_a_crowd_is_called_twice_and_one_is_awarded(opened: Callable[..., Fleet]) -> None:
    """One conversation-id with four participants: proposal, refusal, silence until too late."""
    fleet = opened("caller", *fipa.CROWD)
    outcomes = lambda: journalled(fleet.run, fipa.caller()).outcomes  # noqa: E731
    fleet.wait(outcomes, "the call is over")
    assert outcomes() == fipa.OUTCOMES

    def stands() -> dict[str, str]:
        return {name: journalled(fleet.run, fipa.worker(name)).state for name in fipa.CROWD}

    fleet.wait(lambda: stands() == fipa.ENDS, "the crowd has heard it")


def test_targets_of_a_broker_answer_through_it_or_directly(opened: Callable[..., Fleet]) -> None:
    """Brokering, then recruiting, each with conversations inside: four agents, every answer
    once.
    """
    fleet, weights = opened("asker", "broker", *fipa.SCALES), list(fipa.WEIGHTS.items())
    memory = lambda: journalled(fleet.run, fipa.asker())  # noqa: E731
    fleet.wait(lambda: sorted(memory().answered) == weights, "all is answered")
    fleet.wait(lambda: len(memory().ends) == 2, "both are over")
    assert memory().ends == ("brokering done", "recruiting done")
    assert sorted(memory().relayed) == weights
