"""What ROS is told of a running fleet, served by `roco view --foxglove` to Foxglove, by `roco view
--ros` to nodes of ROS 2, until Ctrl-C.

It comes by the process that prints what goes by, with the rights of people's tools: they hear
everything and say nothing.
"""

import ipaddress
import os
import secrets
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol
from urllib.parse import urlsplit

import msgspec

from agent_runtime.core.errors import RuntimeFault
from console.errors import ConsoleError, UsageError, needing
from console.fleet import targets
from console.fleet.local import Local
from console.fleet.logs import Written, worded
from console.fleet.status import listens
from console.fleet.targets import Target
from console.output import Form, Format, tell_json
from console.traffic.listen import Source, source

if TYPE_CHECKING:
    from operate.ros.messages import Entry, Topic
    from operate.ros.telling import Live

LOOK_S = 0.1
"""Between two looks at logs and clock, and longest time until a viewer has what is latched."""
ROUTER = "127.0.0.1:7447"
"""Where rmw_zenoh looks for its router, unless its user says otherwise."""
MOST_DOMAIN = 232
"""The highest ROS_DOMAIN_ID (docs.ros.org, "The ROS_DOMAIN_ID")."""
NICENESS = 10
"""Where nothing but looking depends on it the fleet comes first; a stop must not wait."""


class Viewed(msgspec.Struct, frozen=True):
    """Where others look at a fleet now, in a file of its run folder: `roco doctor` tells it."""

    url: str
    may: str


VIEWED_FILES = {"Foxglove": "view-foxglove.json", "ROS 2": "view-ros.json"}


def viewed(fleet: Target, by: str) -> str:
    """Where a viewer sees a fleet of this machine now, and what it may do; "" for nowhere."""
    if not isinstance(fleet, Local):
        return ""
    try:
        told = msgspec.json.decode(fleet.read("", VIEWED_FILES[by]), type=Viewed)
    except msgspec.DecodeError:
        return ""
    at = urlsplit(told.url)
    if not listens(at.port or 0, at.hostname or ""):  # one that was killed leaves its file
        return ""
    return f"whoever reaches {told.url}, without a token: {told.may}"


@contextmanager
def _told(fleet: Target, by: str, url: str, may: str) -> Iterator[None]:
    """Tell it in the run folder meanwhile; containers have none here."""
    if not isinstance(fleet, Local):
        yield
        return
    file = fleet.run / VIEWED_FILES[by]
    file.write_bytes(msgspec.json.encode(Viewed(url, may)))
    try:
        yield
    finally:
        file.unlink(missing_ok=True)


class Outlet(Protocol):
    """Tells messages to whoever is there (operate.ros.messages.Entry)."""

    def offer(self, topics: "Iterable[Topic]") -> None:
        """Name topics before anything is told on them."""

    def tell(self, entry: "Entry") -> None:
        """Tell a message."""

    def answer(self) -> None:
        """Tell who came since the last time what is latched."""

    def close(self) -> None:
        """End it."""


class Served(msgspec.Struct, frozen=True):
    """`url`: where viewers connect; `page`: an address that opens Foxglove there."""

    url: str
    page: str


def foxglove(at: str, target: str, run_dir: Path | None, form: Form) -> None:
    """Serve to Foxglove. Raise ConsoleError where what serves is not installed, or nothing runs,
    UsageError for an address of others.
    """
    host, port = place(at)
    with needing("foxglove"):
        from operate.ros.foxglove_server import Foxglove
        from operate.ros.telling import Live
    fleet, may = targets.find(target, run_dir), "nothing comes in by it"
    with source(None, run_dir, target) as heard:
        try:
            outlet = Foxglove(heard.system.name, host, port)
        except RuntimeError as error:
            raise ConsoleError(f"nothing can be served at {host}:{port}: {error}") from error
        if form is Format.JSON:
            tell_json(Served(outlet.url, outlet.page))
        else:
            print(f"in Foxglove open the connection {outlet.url}, or the page {outlet.page}")
            print(f"{may}; Ctrl-C ends it", flush=True)
        os.nice(NICENESS)
        with _told(fleet, "Foxglove", outlet.url, may):
            fed(outlet, heard, Live(heard.system), fleet)


class Node(msgspec.Struct, frozen=True):
    """`router`: where nodes of ROS reach it; `own`: it ends with the command, else it was there."""

    router: str
    own: bool
    domain: int
    services: tuple[str, ...]


def ros(at: str, target: str, run_dir: Path | None, form: Form) -> None:
    """Be a node of ROS 2 over Zenoh. Raise ConsoleError where what is needed is not installed, or
    nothing runs, UsageError for an address of others, or a domain that cannot be.
    """
    host, port = place(at or ROUTER)
    domain = _domain(os.environ.get("ROS_DOMAIN_ID", ""))
    with needing("ros"):
        from operate.ros.telling import Live
        from operate.ros.zenoh_node import ZenohNode
    with source(None, run_dir, target) as heard:
        live, fleet = Live(heard.system), targets.find(target, run_dir)
        do = {name: partial(_done, what, fleet) for name, what in live.services.items()}
        endpoint = f"tcp/{host}:{port}"
        may = f"nothing comes in by it but {', '.join(do)}" if do else "nothing comes in by it"
        try:
            outlet = ZenohNode(endpoint, heard.system.name, domain, do)
        except RuntimeFault as error:
            raise ConsoleError(f"{error}; name another address with --at") from error
        if form is Format.JSON:
            tell_json(Node(endpoint, outlet.own, domain, tuple(do)))
        else:
            whose = "opened here" if outlet.own else "which was there"
            print(f"nodes of ROS 2 see it by the router at {endpoint}, {whose}; domain {domain}")
            print(f"{may}; Ctrl-C ends it", flush=True)
        with _told(fleet, "ROS 2", f"tcp://{host}:{port}", may):
            fed(outlet, heard, live, fleet)


def _done(what: Callable[[Target], str], fleet: Target) -> tuple[bool, str]:
    try:
        return True, what(fleet)
    except (ConsoleError, OSError) as error:
        return False, str(error)


def _domain(text: str) -> int:
    if text and not (text.isdecimal() and int(text) <= MOST_DOMAIN):
        raise UsageError(f"ROS_DOMAIN_ID is {text!r}; it must be 0 to {MOST_DOMAIN}")
    return int(text or 0)


def fed(outlet: Outlet, heard: Source, live: "Live", fleet: Target) -> None:
    """Tell an outlet what is heard until Ctrl-C, then close it."""
    from operate.ros.telling import logged

    outlet.offer(live.topics)
    look = 0.0
    # the logs of containers are read by a process each time
    logs = Written(fleet) if isinstance(fleet, Local) else None
    if logs is not None:
        logs.new()  # what was before
    try:
        for sample in heard.samples():
            if sample is not None:
                for entry in live.take(sample):
                    outlet.tell(entry)
            if time.monotonic() < look:
                continue
            look = time.monotonic() + LOOK_S
            for entry in live.pass_time(time.time()):
                outlet.tell(entry)
            for line in logs.new() if logs is not None else ():
                text = f"{line.event} {worded(line)}"
                outlet.tell(logged(line.t, line.agent, line.level, text))
            outlet.answer()
    except KeyboardInterrupt:
        pass
    finally:
        outlet.close()
        if lost := heard.lost():
            print(f"roco: {lost.removeprefix('; ')}", file=sys.stderr)


def place(at: str) -> tuple[str, int]:
    """Return the address of this machine that "ADDRESS:PORT" names, port 0 for a free one. Raise
    UsageError for others.

    Where none is named, it is one of the 2^24 of this machine, at a free port: any web page in a
    browser here may connect to what it finds, and Foxglove's library refuses none.
    """
    if not at:
        return str(ipaddress.IPv4Address(secrets.randbelow(2**24 - 2) + 1 + (127 << 24))), 0
    host, _, port = at.rpartition(":")
    with suppress(ValueError):
        if ipaddress.IPv4Address(host).is_loopback and 0 <= int(port) < 65536:
            return host, int(port)
    raise UsageError(f"{at!r} is no address of this machine alone; write it as 127.0.0.1:8765")
