"""`roco agents --offers`: a search finds what the design offers and fits all that it names; who is
up is told as up.
"""

import json
from pathlib import Path
from typing import Any, cast

import calling
import pytest

from companion.design import DESIGN
from console.fleet.offers import DOWN, UNKNOWN, UP, Search, acts, describe, states
from console.fleet.process_status import Beat, Look, Seen
from console.fleet.targets import Target
from operate.fleet_file import ProcessState, ProcessStatus

NOBODY = dict.fromkeys(DESIGN.agents, (UNKNOWN, ""))


class Fleet:
    """A fleet at one look."""

    def __init__(self, **states: ProcessState) -> None:
        self._states = states

    def look(self) -> Look:
        """Each process, with a heartbeat."""
        there = {name: ProcessStatus(name, state, pid=7) for name, state in self._states.items()}
        seen = tuple(Seen(one, Beat(state="idle")) for one in there.values())
        return Look(None, seen, False, 0.0)


def roco(*words: str, code: int = 0) -> str:
    """Return the verb's output where no fleet runs; its exit code must be `code`."""
    return calling.roco("agents", "--offers", *words, columns=300, code=code).output


@pytest.fixture(autouse=True)
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder without runs, and without compose projects of this machine."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("ROCO_ENTRY", "companion.tools.system:SYSTEM")


def found(*words: str) -> dict[str, Any]:
    """The agents found, by name."""
    return {one["agent"]: one for one in json.loads(roco(*words, "--format", "json"))}


def test_every_use_of_a_protocol_is_a_service_of_its_participant() -> None:
    """Once, and asked for by its initiator; nothing else is offered."""
    found, uses = describe(DESIGN, Search(), NOBODY), DESIGN.file.protocol
    offered = [(one.agent, service.name) for one in found for service in one.services]
    assert sorted(offered) == sorted((use.participant, use.name) for use in uses)
    asked = {(one.agent, asked.partition(": ")[2]) for one in found for asked in one.asks}
    assert asked == {(use.initiator, use.name) for use in DESIGN.file.protocol}


def test_query_kinds_are_those_of_the_interface() -> None:
    """With arguments and answers."""
    use = DESIGN.protocols["ask_for_acting"]
    told = [(one.performative, one.name, one.arguments, one.answers) for one in acts(DESIGN, use)]
    entries = DESIGN.entries("ask_for_acting")
    assert told == [(one.performative, one.name, one.arguments, one.answers) for one in entries]
    assert "query-ref objectPose(WM.ObjectPose) -> WM.PoseOf" in roco("km", "--long")
    assert "query-ref: listObjects, objectPose" in roco("km")


@pytest.mark.parametrize(
    ("words", "agents"),
    [
        (["--protocol", "query"], {"km"}),
        (["--protocol", "ask_for_acting"], {"km"}),
        (["--ontology", "RoCo"], {"km", "ta"}),
        (["--ontology", "RoCo", "--protocol", "subscribe"], {"ta"}),
        (["--language", "RC"], {"ex"}),
        (["hi", "pl"], {"hi", "pl"}),
    ],
)
def test_a_search_finds_who_has_all_of_it(words: list[str], agents: set[str]) -> None:
    """As the directory facilitator matches a template; services that do not fit are left out."""
    assert set(found(*words)) == agents
    if words[0] == "--language":
        assert all(words[1] in service["languages"] for service in found(*words)["ex"]["services"])


def test_a_search_in_vain_says_so() -> None:
    """Exit code 1 where nobody has all of it, 2 where the design does not know the name."""
    assert "nobody fits" in roco("--language", "RC", "--ontology", "RoCo", code=1)
    assert "nobody fits" in roco("--up", code=1)
    assert "no ontology 'Robo'; the design has RoCo" in roco("--ontology", "Robo", code=2)
    assert "no agent 'zz'" in roco("zz", code=2)


def test_up_is_who_is_ready() -> None:
    """Of a fleet that runs the others are down; where none runs nothing is known."""
    fleet = Fleet(km=ProcessState.READY, ta=ProcessState.STARTING, pl=ProcessState.STOPPED)
    told = states(cast(Target, fleet), DESIGN)
    assert told["km"] == (UP, "idle")
    assert told["ta"] == told["pl"] == told["hi"] == (DOWN, "")
    assert states(None, DESIGN) == NOBODY
