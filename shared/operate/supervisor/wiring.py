"""A fleet whose agents reach the routers by wires and have wall clocks of their own, for `roco up --faults`."""

from pathlib import Path

import msgspec

from operate.supervisor.processes import Process
from operate.supervisor.securing import free_port
from operate.wires import clocks, files

WIRES = Process("wires", "operate.wires")
CONNECT = "ROCO_CONNECT"


def wired(
    processes: tuple[Process, ...], agents: tuple[str, ...], connect: str, run: Path
) -> tuple[tuple[Process, ...], dict[str, dict[str, str]]]:
    """Return the processes with the wires' own among them, and the variables that agents get apart; wires.json is told.

    `connect`: the routers' addresses. Agents start after the wires, and end before them.
    """
    addresses = files.routers(connect)
    wires = files.Wires(
        addresses,
        {one.name: {router: free_port() for router in addresses} for one in processes if one.name in agents},
    )
    files.tell(run, wires)
    first = next((n for n, one in enumerate(processes) if one.name in wires.ports), len(processes))
    before = tuple(one.name for one in processes[:first] if one.name in addresses)
    behind = (
        msgspec.structs.replace(one, after=(*one.after, WIRES.name)) if one.name in wires.ports else one
        for one in processes[first:]
    )
    link = connect.partition("/")[0]
    own = clocks.made(run, tuple(wires.ports))
    apart = {
        name: {CONNECT: ",".join(f"{link}/127.0.0.1:{port}" for port in ports.values()), **own.get(name, {})}
        for name, ports in wires.ports.items()
    }
    return (*processes[:first], msgspec.structs.replace(WIRES, after=before), *behind), apart
