"""A fleet with wires, for `roco up --faults`: agents reach the router and each other by them, and
have own clocks.
"""

from pathlib import Path

import msgspec

from agent_runtime.io.options import AGENTS_VARIABLE
from agent_runtime.io.reaching import free_port
from agent_runtime.io.secured import ROUTER
from operate.fault_proxy import clocks, files
from operate.supervisor.processes import Process
from topdown.model.design import Design

WIRES = Process("wires", "operate.fault_proxy")
CONNECT = "ROCO_CONNECT"


def wired(
    processes: tuple[Process, ...], design: Design, connect: str, agents: dict[str, str], run: Path
) -> tuple[tuple[Process, ...], dict[str, dict[str, str]]]:
    """Return the processes with the wires' own among them, and the variables that agents get apart;
    wires.json is told.

    `connect`: the router's address; `agents`: those of the agents. They start after the wires, and
    end before them.
    """
    link = connect.partition("/")[0]
    places = {name: files.place(address) for name, address in agents.items()}
    own = [one.name for one in processes if one.name in design.agents]
    ends = {name: (ROUTER, *(set(design.peers(name)) & set(places))) for name in own}
    listening = {name: {end: free_port() for end in near} for name, near in ends.items()}
    wires = files.Wires({ROUTER: files.place(connect)} | places, listening)
    files.tell(run, wires)
    first = next((n for n, one in enumerate(processes) if one.name in wires.ports), len(processes))
    before = tuple(one.name for one in processes[:first] if one.name == ROUTER)
    behind = (
        msgspec.structs.replace(one, after=(*one.after, WIRES.name))
        if one.name in wires.ports
        else one
        for one in processes[first:]
    )
    clocked, apart = clocks.made(run, tuple(wires.ports)), {}
    for name, ports in wires.ports.items():
        reached = {end: f"{link}/127.0.0.1:{port}" for end, port in ports.items()}
        seen = agents | {end: at for end, at in reached.items() if end in agents}
        apart[name] = {
            CONNECT: reached[ROUTER],
            AGENTS_VARIABLE: ",".join(f"{end}={at}" for end, at in seen.items()),
            **clocked.get(name, {}),
        }
    return (*processes[:first], msgspec.structs.replace(WIRES, after=before), *behind), apart
