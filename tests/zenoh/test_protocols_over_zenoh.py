"""Each protocol of FIPA, with its cancels, between two real agents over a real router; a crowd; a broker's targets."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import crowd_agents as crowd
import pytest
import recruiting_agents as cast
import story_agents as stories
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


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[Role, Any]]:
    """The memories of both players after all stories."""
    fleet = opened(tmp_path_factory.mktemp("stories"), "alice", "bob")
    players = {Role.INITIATOR: stories.alice(), Role.PARTICIPANT: stories.bob()}

    def over() -> bool:
        memories = [journalled(fleet.run, agent) for agent in players.values()]
        return any(one.wrong for one in memories) or all(len(one.ends) == len(stories.SCRIPT) for one in memories)

    try:
        wait_for(over, f"all {len(stories.SCRIPT)} stories are played\n{fleet.logs()}", 50.0)
        yield {role: journalled(fleet.run, agent) for role, agent in players.items()}
    finally:
        closed(fleet)


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.name)
@pytest.mark.parametrize("role", Role)
def test_every_story_of_the_protocol_ends_as_told(played: dict[Role, Any], role: Role, protocol: Any) -> None:
    """On both sides, by the journal of each."""
    assert not played[role].wrong
    mine = [place for place, (name, _) in enumerate(stories.SCRIPT) if name == protocol.name]
    assert mine
    wanted = stories.wanted(role)
    assert [played[role].ends[place] for place in mine] == [wanted[place] for place in mine]


def stands(run: Path) -> dict[str, str]:
    """The state of each participant."""
    return {name: journalled(run, crowd.worker(name)).state for name in crowd.CROWD}


def test_a_crowd_is_called_twice_and_one_is_awarded(tmp_path: Path) -> None:
    """One conversation-id with four participants: proposal, refusal, silence until too late."""
    fleet = opened(tmp_path, "caller", *crowd.CROWD)
    try:
        wait_for(lambda: journalled(tmp_path, crowd.caller()).outcomes, f"the call is over\n{fleet.logs()}")
        assert journalled(tmp_path, crowd.caller()).outcomes == crowd.OUTCOMES
        wait_for(lambda: stands(tmp_path) == crowd.ENDS, f"the crowd has heard it\n{fleet.logs()}")
    finally:
        closed(fleet)


def test_targets_of_a_broker_answer_through_it_or_directly(tmp_path: Path) -> None:
    """Brokering, then recruiting, each with conversations inside: four agents, every answer once."""
    fleet = opened(tmp_path, "asker", "broker", *cast.SCALES)
    try:
        wait_for(lambda: answered(tmp_path) == list(cast.WEIGHTS.items()), f"all is answered\n{fleet.logs()}")
        wait_for(lambda: len(journalled(tmp_path, cast.asker()).ends) == 2, f"both are over\n{fleet.logs()}")
        memory = journalled(tmp_path, cast.asker())
        assert memory.ends == ("brokering done", "recruiting done")
        assert sorted(memory.relayed) == list(cast.WEIGHTS.items())
    finally:
        closed(fleet)


def answered(run: Path) -> list[tuple[str, float]]:
    """Return the answers that the targets themselves gave the asker."""
    return sorted(journalled(run, cast.asker()).answered)
