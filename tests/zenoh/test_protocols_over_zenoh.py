"""Each protocol of FIPA, with its cancels, between two real agents over a real router; a crowd; a
broker's targets.
"""

from pathlib import Path
from typing import Any

import fipa_agents as fipa
import pytest
from toy_fleet import Fleet, wait_for

from agent_runtime.core.agent import Agent
from agent_runtime.core.state import restored
from agent_runtime.io.journal import last_record
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import Role

pytestmark = pytest.mark.zenoh

PROCESS = Path(__file__).with_name("story_process.py")


def journalled(run: Path, agent: Agent[Any]) -> Any:
    """The memory in the agent's journal, the first one where there is none yet."""
    path = run / "journal" / f"{agent.name}.journal"
    record = last_record(path.read_bytes()) if path.exists() else None
    return agent.memory if record is None else restored(agent, record).memory


def opened(run: Path, *names: str) -> Fleet:
    """A router, and these agents as processes."""
    fleet = Fleet(run, PROCESS, names)
    fleet.start("router")
    fleet.ready("router")
    fleet.start(*names)
    return fleet


def closed(fleet: Fleet) -> None:
    """Nothing runs any more."""
    for name in list(fleet.processes):
        fleet.kill(name)


def test_every_story_of_every_protocol_ends_as_told(tmp_path: Path) -> None:
    """On both sides, by the journal of each."""
    fleet = opened(tmp_path, "alice", "bob")
    players = {Role.INITIATOR: fipa.alice(), Role.PARTICIPANT: fipa.bob()}

    def over() -> bool:
        memories = [journalled(fleet.run, agent) for agent in players.values()]
        return any(one.wrong for one in memories) or all(
            len(one.ends) == len(fipa.SCRIPT) for one in memories
        )

    try:
        wait_for(over, f"all {len(fipa.SCRIPT)} stories are played\n{fleet.logs()}", 50.0)
        for role, agent in players.items():
            played, wanted = journalled(fleet.run, agent), fipa.wanted(role)
            assert not played.wrong
            told = zip(fipa.SCRIPT, played.ends, wanted, strict=True)
            assert [(role, *row) for row in told if row[1] != row[2]] == []
        assert {name for name, _ in fipa.SCRIPT} == {protocol.name for protocol in PROTOCOLS}
    finally:
        closed(fleet)


def stands(run: Path) -> dict[str, str]:
    """The state of each participant."""
    return {name: journalled(run, fipa.worker(name)).state for name in fipa.CROWD}


def test_a_crowd_is_called_twice_and_one_is_awarded(tmp_path: Path) -> None:
    """One conversation-id with four participants: proposal, refusal, silence until too late."""
    fleet = opened(tmp_path, "caller", *fipa.CROWD)
    try:
        wait_for(
            lambda: journalled(tmp_path, fipa.caller()).outcomes,
            f"the call is over\n{fleet.logs()}",
        )
        assert journalled(tmp_path, fipa.caller()).outcomes == fipa.OUTCOMES
        wait_for(lambda: stands(tmp_path) == fipa.ENDS, f"the crowd has heard it\n{fleet.logs()}")
    finally:
        closed(fleet)


def test_targets_of_a_broker_answer_through_it_or_directly(tmp_path: Path) -> None:
    """Brokering, then recruiting, each with conversations inside: four agents, every answer
    once.
    """
    fleet = opened(tmp_path, "asker", "broker", *fipa.SCALES)
    try:
        wait_for(
            lambda: answered(tmp_path) == list(fipa.WEIGHTS.items()),
            f"all is answered\n{fleet.logs()}",
        )
        wait_for(
            lambda: len(journalled(tmp_path, fipa.asker()).ends) == 2,
            f"both are over\n{fleet.logs()}",
        )
        memory = journalled(tmp_path, fipa.asker())
        assert memory.ends == ("brokering done", "recruiting done")
        assert sorted(memory.relayed) == list(fipa.WEIGHTS.items())
    finally:
        closed(fleet)


def answered(run: Path) -> list[tuple[str, float]]:
    """Return the answers that the targets themselves gave the asker."""
    return sorted(journalled(run, fipa.asker()).answered)
