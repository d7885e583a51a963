"""The recorder, or the router, is killed or frozen amid the traffic of a fleet: it misses nothing.

What was said meanwhile is in the step logs of the agents, also what somebody said who should not
have.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import cycle, islice
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import pytest
import zenoh
from toy_fleet import wait_for

from agent_runtime.core.events import Arrived
from agent_runtime.io.sessions import client_config
from agent_runtime.io.steplog import read
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.cli.fleet.identity import tls
from operate.cli.runs import folders
from operate.recording import mcap_file
from operate.recording.records import Origin, Spoken
from topdown.model.design import load

EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"
pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(300)]
ORDERS = [("receiving", "press"), ("store", "shipping"), ("press", "receiving")]
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


class Depot:
    """The depot in a copy of its own, up."""

    def __init__(self, folder: Path, orders: int) -> None:
        self.folder, self.run, self.orders = folder / "depot", folder / "run", orders
        shutil.copytree(EXAMPLE, self.folder, ignore=shutil.ignore_patterns("runs", "__pycache__"))
        wanted = islice(cycle(ORDERS), orders)
        lines = [f'[[order]]\nitem = "{a}"\nsource = "{a}"\ntarget = "{b}"\n' for a, b in wanted]
        (self.folder / "orders.toml").write_text("\n".join(lines))
        done = self.roco("up", "--out", str(self.run), "--scene", "orders.toml")
        assert done.returncode == 0, done.stderr

    def roco(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Call a verb."""
        command = [sys.executable, "-P", "-m", "operate.cli", *words]
        kept = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
        return subprocess.run(
            command, cwd=self.folder, env=kept, capture_output=True, text=True, timeout=100
        )

    def pid(self, name: str) -> int:
        """Of a process that is ready; 0 while it is not."""
        ready = (self.run / f"{name}.ready").exists() and (self.run / f"{name}.pid").exists()
        return int((self.run / f"{name}.pid").read_text()) if ready else 0

    def kill(self, name: str) -> None:
        """kill -9 as soon as it is ready."""
        wait_for(lambda: self.pid(name), f"{name} is ready")
        os.kill(self.pid(name), signal.SIGKILL)

    def back(self, name: str, pid: int) -> None:
        """Wait until another process has taken its place."""
        wait_for(lambda: self.pid(name) not in (0, pid), f"{name} is back")

    def arrived(self, agent: str) -> list[Communicate]:
        """Return the communicates that reached an agent, by its step log."""
        steps = [
            one
            for one in read(self.run / "steps" / f"{agent}.steps")
            if one.kind == Arrived.__name__
        ]
        return [msgspec.msgpack.decode(one.input, type=Arrived).communicate for one in steps]

    def heard(self) -> int:
        """Return the number of communicates that reached agents, by their step logs."""
        return sum(len(self.arrived(path.stem)) for path in (self.run / "steps").glob("*.steps"))

    def unrecorded(self) -> set[tuple[str, str, str]]:
        """Return the communicates that reached agents and that the recording lacks."""
        agents = [path.stem for path in (self.run / "steps").glob("*.steps")]
        taken = {
            (one.sender, one.receiver, one.id) for agent in agents for one in self.arrived(agent)
        }
        return taken - {one.identity for one in self.records(Spoken)}

    def records(self, kind: type[R]) -> list[R]:
        """Return the recorded records of a kind."""
        return [
            one
            for one in mcap_file.read(self.run / mcap_file.FILE).records
            if isinstance(one, kind)
        ]

    def ended(self) -> int:
        """Return the number of orders the desk knows to be carried out: two informs each, that it
        is assigned and delivered.
        """
        informs = {
            one.id
            for one in self.arrived("desk")
            if (one.protocol, one.performative) == ("request", "inform")
        }
        return len(informs) // 2

    def judged(self) -> dict[str, Any]:
        """Return the output of `roco traffic judge` once all orders were carried out and the fleet
        is down.
        """
        wait_for(lambda: self.ended() >= self.orders, "all orders are carried out", 120.0)
        self.roco("down", "--run-dir", str(self.run))
        found: dict[str, Any] = json.loads(
            self.roco("traffic", "judge", str(self.run), "--format", "json").stdout
        )
        return found


@pytest.fixture
def depot(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Depot]:
    """The depot at work, for as many orders as the test says."""
    fleet = Depot(tmp_path, getattr(request, "param", len(ORDERS)))
    yield fleet
    fleet.roco("down", "--run-dir", str(fleet.run))


def counts(found: dict[str, Any]) -> dict[str, int]:
    """Return the number of each verdict."""
    told: dict[str, int] = {}
    for row in found["channels"].values():
        for verdict, count in row.items():
            told[verdict] = told.get(verdict, 0) + count
    return told


def complete(depot: Depot) -> None:
    """Everything that reached an agent is recorded once, and judged; nobody is blamed."""
    found = depot.judged()
    assert found["violations"] == []
    assert counts(found).get("not judged", 0) == 0
    assert depot.unrecorded() == set()
    copies = Counter(one.identity for one in depot.records(Spoken) if one.origin is Origin.RECEIVER)
    arrived = Counter(
        (one.sender, one.receiver, one.id)
        for path in (depot.run / "steps").glob("*.steps")
        for one in depot.arrived(path.stem)
    )
    assert copies == arrived


@pytest.mark.parametrize("name", ["monitor", "router"])
def test_who_is_killed_costs_nothing(depot: Depot, name: str) -> None:
    """kill -9, again and again."""
    for _ in range(KILLS):
        pid = depot.pid(name)
        depot.kill(name)
        depot.back(name, pid)
    complete(depot)


def test_a_frozen_recorder_misses_nothing(depot: Depot) -> None:
    """It stands still while much is said, and no agent waits for it."""
    wait_for(lambda: depot.pid("monitor"), "the monitor is ready")
    pid, before = depot.pid("monitor"), depot.heard()
    os.kill(pid, signal.SIGSTOP)
    try:
        wait_for(lambda: depot.heard() >= before + SAID, "agents go on")
        assert depot.unrecorded()
    finally:
        os.kill(pid, signal.SIGCONT)
    complete(depot)


def test_what_was_wrong_while_nobody_recorded_is_found(depot: Depot) -> None:
    """With a key of the fleet somebody speaks for mule as soon as the recorder is dead."""
    fleet = folders.fleet(depot.run)
    assert fleet is not None
    session = zenoh.open(client_config(fleet.agents["traffic"], tls(depot.run, fleet, "mule")))
    pid = depot.pid("monitor")
    os.kill(pid, signal.SIGKILL)
    session.put(load(EXAMPLE / "depot" / "design.toml").key(fleet.system, WRONG), encode(WRONG))
    wait_for(lambda: WRONG in depot.arrived("traffic"), "traffic hears it")
    session.close()  # type: ignore[no-untyped-call]
    depot.back("monitor", pid)
    found = depot.judged()
    assert {(one["id"], one["verdict"]) for one in found["violations"]} == {
        (WRONG.id, "wrong language"),
        (WRONG.id, "not said"),
    }


def test_a_dead_letter_is_kept(depot: Depot) -> None:
    """A communicate that an agent turned away is listed while the fleet runs, and after the agent's
    death, of the folder.
    """
    fleet = folders.fleet(depot.run)
    assert fleet is not None
    session = zenoh.open(client_config(fleet.agents["traffic"], tls(depot.run, fleet, "mule")))
    letter = msgspec.structs.replace(WRONG, id="first")
    session.put(load(EXAMPLE / "depot" / "design.toml").key(fleet.system, letter), encode(letter))
    wait_for(lambda: letter in depot.arrived("traffic"), "traffic hears it")
    session.close()  # type: ignore[no-untyped-call]

    def listed() -> list[tuple[str, ...]]:
        words = ("traffic", "dead", "--run", str(depot.run), "--agent", "mule", "--format", "json")
        letters = json.loads(depot.roco(*words).stdout)
        return [
            tuple(one.get(name, "") for name in ("reason", "sender", "receiver", "id"))
            for one in letters
        ]

    expected = ("turned away", "mule", "traffic", "first")
    wait_for(lambda: expected in listed(), "it is listed")
    pid = depot.pid("traffic")
    depot.kill("traffic")
    depot.back("traffic", pid)
    depot.roco("down", "--run-dir", str(depot.run))
    assert listed().count(expected) == 1
