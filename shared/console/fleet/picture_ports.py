"""Ports of a fleet's pictures: their variables, and which of those that are set another program
has.
"""

import socket
from collections.abc import Iterator
from typing import NamedTuple

from agent_runtime.io import fleet_processes
from console.fleet.local import Local
from console.fleet.process_status import Look
from console.fleet.targets import Target

HOST = "127.0.0.1"
SWITCH, GRPC, WEB = "ROCO_VIEW", "ROCO_VIEW_GRPC", "ROCO_VIEW_WEB"
CONNECT_S = 1.0
MONITOR = "monitor"


class Taken(NamedTuple):
    """A port that is set for the pictures and that another program has."""

    variable: str
    port: int

    @property
    def words(self) -> str:
        return f"another program listens at port {self.port} ({self.variable})"

    @property
    def remedy(self) -> str:
        return (
            "end that program, and the pictures come; or `roco down`, and `roco up` with another"
            f" {self.variable}"
        )


def taken(fleet: Target, now: Look) -> Iterator[Taken]:
    """Yield what keeps the monitor of a fleet on this machine from serving pictures."""
    if not isinstance(fleet, Local) or not any(
        one.name == MONITOR and one.status.pid for one in now.seen
    ):
        return
    if fleet.variable(MONITOR, SWITCH) == "off":
        return
    for name in (GRPC, WEB):
        text = fleet.variable(MONITOR, name)
        port = int(text) if text.isdecimal() else 0
        # A connection would have the monitor draw.
        if 0 < port < 65536 and not fleet_processes.listens(fleet.run, port) and listens(port):
            yield Taken(name, port)


def listens(port: int) -> bool:
    """Whether somebody listens at this port of this machine."""
    with socket.socket() as probe:
        probe.settimeout(CONNECT_S)
        return probe.connect_ex((HOST, port)) == 0
