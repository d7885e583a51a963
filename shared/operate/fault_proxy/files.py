"""Files of the run folder by which supervisor, `roco fault` and the proxy communicate.

wires.json: where the router and agents listen, and each agent's ports of the proxy; written by the
supervisor. NAME.KIND.wire: a condition of the wires of NAME while the file is there, its amount as
text. The wires of an agent are all its links; those of the router are all agents' to it; those of a
pair, such as co-pl, are the link of the two.
"""

from collections.abc import Mapping
from pathlib import Path

import msgspec

from agent_runtime.io import cli
from agent_runtime.io.run_files import write_whole
from agent_runtime.io.secured import ROUTER

WIRES_FILE, SUFFIX = "wires.json", ".wire"


class Wires(msgspec.Struct, frozen=True):
    """`ends`: where the router and agents listen (host, port); `ports`: agent -> end -> where the
    proxy listens, at `bind`.
    """

    ends: dict[str, tuple[str, int]]
    ports: dict[str, dict[str, int]]
    bind: str = "127.0.0.1"

    @property
    def pairs(self) -> tuple[str, ...]:
        """The names of the links between agents, either way round, such as co-pl."""
        ends = [(agent, end) for agent, ports in self.ports.items() for end in ports]
        return tuple(f"{agent}-{end}" for agent, end in ends if end in self.ports)

    def missing(self, name: str) -> str:
        """Return why no wire has that name, or "" if one has; the router stands for all wires to
        it.
        """
        if name in (*self.ends, *self.ports, *self.pairs):
            return ""
        pairs = sorted({"-".join(sorted(one.split("-"))) for one in self.pairs})
        links = f", and the links {', '.join(pairs)}" if pairs else ""
        return (
            f"{name} has no wire; there are {', '.join(self.ports)}, {ROUTER} for all to it{links}"
        )


class Conditions(msgspec.Struct, frozen=True):
    """State of a wire, both ways. `cut`: nothing passes; `delay`: of each byte [s]; `loss`: share
    of pieces that are lost and sent again, as TCP does; `rate`: most bytes per second, 0: no bound;
    `corrupt`: share of pieces of which a bit is turned over.
    """

    cut: float = 0.0
    delay: float = 0.0
    loss: float = 0.0
    rate: float = 0.0
    corrupt: float = 0.0


KINDS = Conditions.__struct_fields__


def wires_of(run: Path) -> Wires | None:
    """Return the wires of a run; None where its agents speak to the router without a proxy."""
    try:
        return msgspec.json.decode((run / WIRES_FILE).read_bytes(), type=Wires)
    except (OSError, msgspec.DecodeError):
        return None


def listed(connect: str, agents: Mapping[str, str], listen: str) -> Wires | None:
    """Return the wires that variables tell, as in containers; None where `listen` names no agent.

    `connect`: the router's endpoint; `agents`: those of agents; `listen`: of each agent the ports
    of the proxy by which it reaches the router and its neighbours,
    `hi@0.0.0.0:router=7511+co=7512,co@...`. ValueError: a port is not a number.
    """
    if "@" not in listen:
        return None
    ports, bind = {}, ""
    for one in cli.listed(listen):
        agent, _, where = one.partition("@")
        bind, _, pairs = where.rpartition(":")
        ports[agent] = {
            end: int(port) for end, _, port in (pair.partition("=") for pair in pairs.split("+"))
        }
    return Wires({name: place(at) for name, at in {ROUTER: connect, **agents}.items()}, ports, bind)


def place(address: str) -> tuple[str, int]:
    """Return host and port of an address. ValueError: it has none."""
    host, _, port = address.partition("/")[2].rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError(f"{address!r} names no host and port, as tls/127.0.0.1:7447 does")
    return host.strip("[]"), int(port)


def tell(run: Path, wires: Wires) -> None:
    """Write wires.json; no condition of an earlier start is left."""
    for file in run.glob(f"*{SUFFIX}"):
        file.unlink(missing_ok=True)
    write_whole(run / WIRES_FILE, msgspec.json.encode(wires) + b"\n")


def put(run: Path, name: str, kind: str, amount: float | None) -> None:
    """Set a condition of a wire, or end it (None)."""
    file = run / f"{name}.{kind}{SUFFIX}"
    if amount is None:
        file.unlink(missing_ok=True)
        return
    write_whole(file, str(amount).encode())


def conditions(run: Path) -> dict[str, Conditions]:
    """Return the conditions of each agent and router that has any. What cannot be read is left
    out.
    """
    found: dict[str, dict[str, float]] = {}
    for file in run.glob(f"[!.]*{SUFFIX}"):
        name, _, kind = file.name.removesuffix(SUFFIX).rpartition(".")
        try:
            if kind in KINDS:
                found.setdefault(name, {})[kind] = float(file.read_text())
        except (OSError, ValueError):
            continue
    return {name: Conditions(**kinds) for name, kinds in found.items()}
