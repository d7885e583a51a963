"""Two linked routers: one of them may die at any time; rights hold at each of them, and over the link."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from toy_fleet import wait_for

from agent_runtime.io import issuing
from agent_runtime.io.secured import ROUTERS, client_tls, rights_of, router_tls
from agent_runtime.io.sessions import client_config, free_endpoint, open_router
from companion.design import DESIGN
from operate.recording import history
from operate.run_folder import Fleet, ProcessState
from operate.system import load
from topdown.judge.verdicts import Verdict
from topdown.model.rights import families

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(180)]
EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"
PATIENCE_S = 60.0
SYSTEM = "roco"
ENOUGH = 50
"""Times 20 ms: a router joins within some of these, where it may."""
ORDER = """
[[order]]
item = "sheet"
source = "receiving"
target = "press"
"""


class Depot:
    """A depot with two routers, and what it says of itself."""

    def __init__(self, folder: Path, orders: int) -> None:
        self.folder, self.run = folder, folder / "run"
        (folder / "orders.toml").write_text(ORDER * orders)
        self.roco("up", "--routers", "2", "--out", str(self.run), "--scene", str(folder / "orders.toml"))

    def roco(self, *words: str) -> str:
        """Return what a verb prints."""
        clean = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
        command = [sys.executable, "-P", "-m", "operate.cli", *words]
        done = subprocess.run(command, cwd=self.folder, env=clean, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def told(self) -> Fleet:
        """Return fleet.json as it is now."""
        return msgspec.json.decode((self.run / "fleet.json").read_bytes(), type=Fleet)

    def delivered(self) -> int:
        """Number of orders that desk has heard to be delivered, as the monitor's verdicts have it."""
        lines = (self.run / "verdicts.jsonl").read_bytes().rpartition(b"\n")[0].splitlines()
        ends = [one for one in map(json.loads, lines) if one.get("text", "").startswith("delivered")]
        return len({(one["conversation"], one["id"]) for one in ends if one["receiver"] == "desk"})

    def kill(self, name: str) -> None:
        """kill -9; return once the supervisor has it ready again, and linked."""
        before = next(one for one in self.told().processes if one.name == name)
        joined = self.events("another router joined")
        os.kill(before.pid, signal.SIGKILL)

        def again() -> bool:
            now = next(one for one in self.told().processes if one.name == name)
            return now.state is ProcessState.READY and now.pid != before.pid

        wait_for(again, f"{name} is back", PATIENCE_S)
        wait_for(
            lambda: self.events("another router joined") >= joined + 2, "both routers are linked again", PATIENCE_S
        )

    def lines(self) -> list[dict[str, Any]]:
        """Return what all have logged so far."""
        logs = sorted((self.run / "logs").glob("*.jsonl"))
        return [json.loads(line) for log in logs for line in log.read_text().rpartition("\n")[0].splitlines()]

    def events(self, event: str) -> int:
        """Number of lines with this event."""
        return sum(line.get("event") == event for line in self.lines())


@pytest.fixture
def depot(tmp_path: Path) -> Iterator[Depot]:
    """A depot with some orders before it; ended at the end."""
    folder = tmp_path / "depot"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("runs", "__pycache__"))
    made = Depot(folder, 6)
    try:
        yield made
    finally:
        made.roco("down", "--run-dir", str(made.run))


def test_either_router_may_be_killed_amid_the_work(depot: Depot) -> None:
    """First the one that all use; then the other one, which all have gone to. Then one while an agent is at each: every
    order is delivered once, no peer is taken for dead, and the history has all that was said, as designed.
    """
    assert [one.name for one in depot.told().processes if one.name in ROUTERS] == list(ROUTERS)
    assert len(depot.told().connect.split(",")) == 2
    wait_for(lambda: depot.delivered() >= 1, "the first is delivered", PATIENCE_S)
    depot.kill("router")
    depot.kill("router-2")
    depot.roco("agent", "restart", "traffic", "--run-dir", str(depot.run))
    depot.kill("router")
    wait_for(lambda: depot.delivered() == 6, "all are delivered", PATIENCE_S)
    depot.roco("down", "--run-dir", str(depot.run))
    assert depot.delivered() == 6
    gone = [line for line in depot.lines() if line.get("event") == "peer" and line.get("incarnation") == "gone"]
    assert {line["peer"] for line in gone} <= {"traffic"}, gone
    assert depot.events("router away") >= 3
    past = history.load(depot.run, load("depot.system:SYSTEM", str(depot.folder)))
    assert {one.verdict for one in past.judged} <= {Verdict.LEGAL, Verdict.COPY}, past.judged
    assert past.holes == ()


# --- rights -------------------------------------------------------------------------------------------------------


class Linked:
    """Two routers with rights in this process, and sessions of anybody at either."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        issuing.issue(folder, DESIGN, (SYSTEM,), routers=2)
        self.at = {name: free_endpoint().replace("tcp/", "tls/") for name in ROUTERS}
        first, second = ROUTERS
        self._open = [self.router(first), self.router(second, self.at[first])]
        self.heard: dict[str, list[str]] = {name: [] for name in ROUTERS}
        for name in ROUTERS:
            self._open.insert(0, self.session("monitor", name))
            self._open[0].declare_subscriber("roco/roco/**", self._hear(name))

    def router(self, name: str, *links: str) -> zenoh.Session:
        """The router of this name."""
        rules = rights_of(self.folder, SYSTEM).access_control
        return open_router(self.at[name], router_tls(self.folder, name, joins=bool(links)), rules, links)

    def session(self, identity: str, at: str) -> zenoh.Session:
        """A session of an identity at one of the routers."""
        return zenoh.open(client_config(self.at[at], client_tls(self.folder, identity)))

    def _hear(self, name: str) -> Any:
        return lambda sample: self.heard[name].append(f"{sample.key_expr} {bytes(sample.payload).decode()}")

    def close(self) -> None:
        """End it."""
        for one in self._open:
            one.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def linked(tmp_path: Path) -> Iterator[Linked]:
    """Both routers, and a monitor at each."""
    made = Linked(tmp_path)
    yield made
    made.close()


@pytest.mark.parametrize("at", ROUTERS)
def test_what_an_agent_may_say_is_decided_where_it_comes_in_and_holds_over_the_link(linked: Linked, at: str) -> None:
    """Of every key of the design exactly the agent's own, heard at both routers."""
    keys = [(family.key, family.owner) for family in families(DESIGN, SYSTEM) if not family.token]
    with linked.session("ta", at) as thief:

        def through() -> bool:
            thief.put(f"roco/{SYSTEM}/_/state/ta", b"fence")
            return all(f"roco/{SYSTEM}/_/state/ta fence" in heard for heard in linked.heard.values())

        wait_for(through, "a subscription got from router to router")
        for key, _ in keys:
            thief.put(key, b"said")
        thief.put(f"roco/{SYSTEM}/_/state/ta", b"end")
        wait_for(lambda: all(heard[-1].endswith("end") for heard in linked.heard.values()), "all are decided")
    for heard in linked.heard.values():
        said = {line.partition(" ")[0] for line in heard if line.endswith(" said")}
        assert said == {key for key, owner in keys if owner == "ta"}


def test_nobody_overhears_at_the_other_router(linked: Linked) -> None:
    """A subscription to everything gets nothing of what is said at either."""
    overheard: list[str] = []
    key = next(one.key for one in families(DESIGN, SYSTEM) if (one.owner, one.peer) == ("co", "ta") and one.act)
    with linked.session("hi", "router-2") as thief, linked.session("co", "router") as speaker:
        ears = [thief.declare_subscriber(one, lambda it: overheard.append(str(it.key_expr))) for one in ("**", key)]
        wait_for(lambda: speaker.put(key, b"word") or any("word" in line for line in linked.heard["router-2"]), "heard")
        assert overheard == []
        del ears


@pytest.mark.parametrize(("name", "brings"), [("ta", False), ("router", False), ("router-2", True)])
def test_the_key_of_the_second_router_alone_is_for_joining(linked: Linked, name: str, brings: bool) -> None:
    """It speaks for everybody (docs/threats.md); an agent's or the first router's brings nothing of others."""
    key, heard = f"roco/{SYSTEM}/_/state/co", linked.heard["router"]
    tls = client_tls(linked.folder, "ta")
    tls |= {"connect_certificate": str(linked.folder / f"{name}.pem")}
    tls |= {"connect_private_key": str(linked.folder / f"{name}.key")}
    with (
        open_router(free_endpoint(), tls, None, (linked.at["router-2"],)) as false,
        linked.session("co", "router") as co,
    ):

        def said() -> bool:
            false.put(key, b"forged")
            co.put(key, b"fence")
            forged = any("forged" in line for line in heard)
            return forged or (not brings and sum("fence" in line for line in heard) > ENOUGH)

        wait_for(said, "it brings what it may, or co is heard meanwhile")
    assert any("forged" in line for line in heard) == brings
