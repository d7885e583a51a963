"""The recorder, or the router, is killed or frozen amid the traffic of a fleet: it misses nothing.

What was said meanwhile is in the step logs of the agents, also what somebody said who should not
have.
"""

import os
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import pytest
from depot_fleet import AGENTS, DESIGN_FILE, WAYS, Depot, running
from toy_fleet import wait_for

from agent_runtime.core.events import Arrived
from agent_runtime.io.steplog import read
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Origin, Spoken
from topdown.model.design import load

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(300)]
KILLS = 2
SAID = 10
R = TypeVar("R")
WRONG = Communicate(
    performative=Performative.INFORM,
    sender="mule",
    receiver="traffic",
    protocol="passage",
    language="WAY",
    conversation="mule-9-9",
    id="900",
    in_reply_to="8",
)
"""mule leaves an aisle that it is not in; nobody answers the number, far ahead of its stream."""


@pytest.fixture
def depot(tmp_path: Path) -> Iterator[Depot]:
    """The depot at work, with an order of each kind."""
    with running(tmp_path, count=len(WAYS)) as made:
        yield made


def arrived(depot: Depot, *agents: str) -> list[Communicate]:
    """Return the communicates that reached agents, by their step logs."""
    files = [depot.run / "steps" / f"{name}.steps" for name in agents or AGENTS]
    steps = [one for file in files if file.exists() for one in read(file)]
    kind = Arrived.__name__
    events = [msgspec.msgpack.decode(one.input, type=Arrived) for one in steps if one.kind == kind]
    return [one.communicate for one in events]


def recorded(depot: Depot) -> list[Spoken]:
    """Return the communicates that are recorded."""
    records = mcap_file.read(depot.run / TRAFFIC_FILE).records
    return [one for one in records if isinstance(one, Spoken)]


def unrecorded(depot: Depot) -> set[tuple[str, str, str]]:
    """Return the communicates that reached agents and that the recording lacks."""
    taken = {(one.sender, one.receiver, one.id) for one in arrived(depot)}
    return taken - {one.identity for one in recorded(depot)}


def judged(depot: Depot, code: int = 0) -> dict[str, Any]:
    """Return the output of `roco traffic judge` once all orders were carried out and the fleet is
    down.
    """

    def ended() -> int:
        """An order is carried out after two informs to the desk: assigned, and delivered."""
        to_desk = [one for one in arrived(depot, "desk") if one.protocol == "request"]
        return len({one.id for one in to_desk if one.performative == "inform"}) // 2

    wait_for(lambda: ended() >= depot.orders, "all orders are carried out", 120.0)
    depot.roco("down")
    found: dict[str, Any] = depot.json("traffic judge", str(depot.run), code=code)
    return found


def complete(depot: Depot) -> None:
    """Everything that reached an agent is recorded once, and judged; nobody is blamed."""
    found = judged(depot)
    assert found["violations"] == []
    assert not any(row.get("not judged") for row in found["channels"].values())
    assert unrecorded(depot) == set()
    copies = Counter(one.identity for one in recorded(depot) if one.origin is Origin.RECEIVER)
    assert copies == Counter((one.sender, one.receiver, one.id) for one in arrived(depot))


def put_as_mule(depot: Depot, one: Communicate) -> None:
    """With a key of the fleet somebody speaks for mule; traffic hears it."""
    with depot.session("mule", "traffic") as session:
        session.put(load(DESIGN_FILE).key(depot.fleet.system, one), encode(one))
        wait_for(lambda: one in arrived(depot, "traffic"), "traffic hears it")


@pytest.mark.parametrize("name", ["monitor", "router"])
def test_who_is_killed_costs_nothing(depot: Depot, name: str) -> None:
    """kill -9, again and again."""
    for _ in range(KILLS):
        depot.back(name, depot.kill(name))
    complete(depot)


def test_a_frozen_recorder_misses_nothing(depot: Depot) -> None:
    """It stands still while much is said, and no agent waits for it."""
    wait_for(lambda: depot.pid("monitor"), "the monitor is ready")
    pid, before = depot.pid("monitor"), len(arrived(depot))
    os.kill(pid, signal.SIGSTOP)
    try:
        wait_for(lambda: len(arrived(depot)) >= before + SAID, "agents go on")
        assert unrecorded(depot)
    finally:
        os.kill(pid, signal.SIGCONT)
    complete(depot)


def test_what_was_wrong_while_nobody_recorded_is_found(depot: Depot) -> None:
    """It is said as soon as the recorder is dead."""
    pid = depot.kill("monitor")
    put_as_mule(depot, WRONG)
    depot.back("monitor", pid)
    violations = {(one["id"], one["verdict"]) for one in judged(depot, 1)["violations"]}
    assert violations == {(WRONG.id, "wrong language"), (WRONG.id, "not said")}


def test_a_dead_letter_is_kept(depot: Depot) -> None:
    """A communicate that an agent turned away is listed while the fleet runs, and after the agent's
    death, of the folder.
    """
    put_as_mule(depot, msgspec.structs.replace(WRONG, id="first"))
    fields = ("reason", "sender", "receiver", "id")

    def listed() -> list[tuple[str, ...]]:
        letters = depot.json("traffic dead --run", str(depot.run), "--agent", "mule")
        return [tuple(one.get(name, "") for name in fields) for one in letters]

    expected = ("turned away", "mule", "traffic", "first")
    wait_for(lambda: expected in listed(), "it is listed")
    depot.back("traffic", depot.kill("traffic"))
    depot.roco("down")
    assert listed().count(expected) == 1
