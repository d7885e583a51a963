"""A fleet with a fork server: who is made by it, and that it is one process more that may die."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from stepped import ended, until

from agent_runtime.io.cli import endpoints
from agent_runtime.io.fork_server import FORKS_VARIABLE
from agent_runtime.io.options import AGENTS_VARIABLE
from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE
from companion.tools.system import SYSTEM
from operate.fault_proxy import files
from operate.fleet_file import ProcessState
from operate.supervisor import core, folder
from operate.supervisor.__main__ import chosen
from operate.supervisor.shell import CONNECT, FORKS, FORKS_FILE, WIRES, Shell, forking, wired
from operate.system import Process, around

TABLE = (
    *around(),
    Process("loop", "a.loop", forked=False),
    Process("pl", "a.pl", after=("router", "monitor"), workers=("a.search",)),
    Process("ex", "a.ex", after=("router", "loop"), workers=("a.eye", "a.search")),
)
WAITS = """
import os, pathlib, signal, sys
if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    pathlib.Path(os.environ["ROCO_RUN_DIR"], sys.argv[0].split("/")[-2] + ".ready").touch()
    signal.pause()
"""


def test_the_server_is_ready_before_what_it_makes() -> None:
    """It has all that they import; a router and who locks memory wait for nothing more than
    before.
    """
    after = forking(TABLE)
    core.begin(after, 0.0)  # the order holds
    server, *others = after
    assert server.arguments == (
        "operate.recording.__main__", "a.pl.__main__", "a.search", "a.ex.__main__", "a.eye",
    )  # fmt: skip
    waits = {one.name for one in others if FORKS.name in one.after}
    assert waits == {"monitor", "pl", "ex"}
    assert [(one.name, one.module) for one in others] == [(one.name, one.module) for one in TABLE]


@pytest.mark.parametrize("few", [TABLE[:1], TABLE[:2], TABLE[:3]])
def test_a_server_for_one_process_is_not_worth_it(few: tuple[Process, ...]) -> None:
    """A part of a fleet, as `--only` has it."""
    assert forking(few) == few


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shell]:
    """Two processes and their fork server."""
    code, run = tmp_path / "code", tmp_path / "run"
    for name in ("one", "two"):
        (code / name).mkdir(parents=True)
        (code / name / "__init__.py").touch()
        (code / name / "__main__.py").write_text(WAITS)
    monkeypatch.syspath_prepend(str(code))
    folder.make(run)
    places = {RUN_FOLDER_VARIABLE: str(run), FORKS_VARIABLE: str(run / FORKS_FILE)}
    told = os.environ | places | {"PYTHONPATH": str(code), "OMP_NUM_THREADS": "1"}
    shell = Shell(run, forking((Process("one", "one"), Process("two", "two"))), "test", "", told)
    yield shell
    ended(shell)


def parent(shell: Shell, name: str) -> int:
    status = Path(f"/proc/{shell.children[name].pid}/status").read_text()
    return int(status.partition("\nPPid:\t")[2].split()[0])


@pytest.mark.process
def test_processes_are_made_by_the_server_also_by_a_new_one(fleet: Shell) -> None:
    """Its death ends nobody; a process that dies then is made by the next one. In the end all end
    in order.
    """
    until(fleet, lambda: fleet.fleet.ready)
    first = fleet.children[FORKS.name].pid
    assert {parent(fleet, "one"), parent(fleet, "two")} == {first}
    os.kill(first, signal.SIGKILL)
    until(fleet, lambda: not fleet.fleet.known[FORKS.name].running)
    until(fleet, lambda: fleet.fleet.known[FORKS.name].state is ProcessState.READY)
    assert [fleet.fleet.known[name].restarts for name in ("one", "two")] == [0, 0]
    fleet.children["one"].kill()
    until(fleet, lambda: fleet.fleet.known["one"].restarts == 1)
    until(fleet, lambda: fleet.fleet.ready)
    assert parent(fleet, "one") == fleet.children[FORKS.name].pid != first
    ended(fleet)
    assert {one.state for one in fleet.fleet.status} == {ProcessState.STOPPED}
    # a busy machine notes late heartbeats, too
    codes = {one.note for one in fleet.fleet.status if "code" in one.note}
    assert codes <= {"ended with code 0"}


@pytest.mark.process
def test_services_are_made_by_it(tmp_path: Path) -> None:
    """What they import changes nothing that counts at a start; a search process is made by it,
    too.
    """
    run = tmp_path / "run"
    command = [sys.executable, "-m", "services.supervisor", "--only", "router,pl,ex", "--run-dir"]
    with subprocess.Popen([*command, str(run)], stdin=subprocess.DEVNULL) as supervisor:
        try:
            files = [run / f"{name}.pid" for name in ("forks", "pl", "ex")]
            while not all(file.exists() for file in files) or len(children(run)) < 3:
                assert supervisor.poll() is None
                time.sleep(0.05)
            made = children(run)
            assert {int((run / f"{name}.pid").read_text()) for name in ("pl", "ex")} < made
        finally:
            supervisor.terminate()


def children(run: Path) -> set[int]:
    """Return the processes that the fork server of a run has made and that live."""
    pid = (run / "forks.pid").read_text().strip()
    return {int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()}


@pytest.mark.process
def test_a_server_that_hangs_holds_up_nobody(fleet: Shell) -> None:
    """What dies meanwhile is started without it."""
    until(fleet, lambda: fleet.fleet.ready)
    server = fleet.children[FORKS.name]
    os.kill(server.pid, signal.SIGSTOP)
    fleet.children["two"].kill()
    until(fleet, lambda: fleet.fleet.known["two"].restarts == 1)
    until(fleet, lambda: fleet.fleet.ready)
    assert parent(fleet, "two") == os.getpid()
    os.kill(server.pid, signal.SIGCONT)


# --- A fleet with wires ---------------------------------------------------------------------------


AGENTS = tuple(SYSTEM.design.agents)


@pytest.mark.parametrize("only", ["", "router,pl,km", "pl,ta"])
def test_agents_start_after_their_wires(tmp_path: Path, only: str) -> None:
    """In an order that the supervisor can start; all others are as they were."""
    before = chosen(only, SYSTEM.processes)
    processes, apart = wired(before, SYSTEM.design, "tls/10.0.0.1:7447", {}, tmp_path)
    assert core.begin(processes, 0.0).known.keys() == {WIRES.name, *(one.name for one in before)}
    agents = [one.name for one in before if one.name in AGENTS]
    assert [one.name for one in processes if WIRES.name in one.after] == agents
    assert [one for one in processes if one.name not in (*agents, WIRES.name)] == [
        one for one in before if one.name not in agents
    ]
    told = files.wires_of(tmp_path)
    assert told is not None
    assert (told.ends, set(told.ports)) == ({"router": ("10.0.0.1", 7447)}, set(agents))
    assert {name: own[CONNECT] for name, own in apart.items()} == {
        name: f"tls/127.0.0.1:{ports['router']}" for name, ports in told.ports.items()
    }
    assert len({ports["router"] for ports in told.ports.values()}) == len(agents)


def test_linked_agents_have_a_wire_to_each_neighbour(tmp_path: Path) -> None:
    """And to the router; each listens at its own address and is told the neighbours' only by their
    wires.
    """
    agents = {name: f"tls/10.0.0.1:{7500 + number}" for number, name in enumerate(AGENTS)}
    _, apart = wired(SYSTEM.processes, SYSTEM.design, "tls/10.0.0.1:7447", agents, tmp_path)
    told = files.wires_of(tmp_path)
    assert told is not None
    for name, ports in told.ports.items():
        assert ports.keys() == {"router", *SYSTEM.design.peers(name)}
        seen = endpoints(apart[name][AGENTS_VARIABLE])
        assert seen[name] == agents[name]
        assert {peer: seen[peer] for peer in SYSTEM.design.peers(name)} == {
            peer: f"tls/127.0.0.1:{port}" for peer, port in ports.items() if peer != "router"
        }
    assert {told.missing(name) for name in ("co-pl", "pl-co", "co", "router")} == {""}
    assert (
        told.missing("co-km")
        == "co-km has no wire; there are km, pl, ta, ex, co, hi, router for all to it, and the"
        " links co-hi, co-pl, co-ta, ex-ta, km-pl, km-ta"
    )


def test_an_address_is_a_host_and_a_port() -> None:
    """Of IPv6, too, whose brackets no socket wants; one without a port is refused by its name."""
    assert files.place("tls/[::1]:7447") == ("::1", 7447)
    assert files.place("tcp/robot.local:7448") == ("robot.local", 7448)
    for wrong in ("tls/robot.local", "robot.local:7447", "tls/:7447", "tls/robot:port", ""):
        with pytest.raises(ValueError, match="names no host and port") as told:
            files.place(wrong)
        assert repr(wrong) in str(told.value)
