"""A fleet with wires: each agent has a port of its own, starts after the wires, and is told of no
other address.
"""

from pathlib import Path

import pytest

from agent_runtime.io.cli import endpoints
from agent_runtime.io.options import AGENTS_VARIABLE
from companion.tools.system import SYSTEM
from operate.fault_proxy import files
from operate.supervisor import core
from operate.supervisor.__main__ import chosen
from operate.supervisor.shell import CONNECT, WIRES, wired

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
