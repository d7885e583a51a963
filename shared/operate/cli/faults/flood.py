"""A flood: well-formed data of one identity of the fleet to one agent, at a fixed rate, while its command lives.

The operator's is orders to set the log level that the agent has, each with an id of its own. An agent's is copies of
the next communicate that it says, as of a sender that takes no receipt: the receiver must tell them from new ones.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import msgspec

from agent_runtime.core.control import Command, SetLevel
from operate.cli.errors import FleetError, UsageError
from operate.cli.fleet import operator
from operate.cli.fleet.identity import OPERATOR
from operate.cli.fleet.targets import Put, Target
from operate.cli.traffic import listen
from operate.run_folder import Fault

TICK_S = 0.01
"""Between two bursts; estimate: even enough."""
HEARD_S = 30.0
"""Time to wait for the next communicate of an agent [s]; estimate."""
Next = Callable[[], tuple[str, bytes]]


@contextlib.contextmanager
def going_on(fleet: Target, fault: Fault) -> Iterator[None]:
    """Flood as long as this lasts. Raise UsageError: nobody may say that; FleetError: there is nothing to copy."""
    speaker, over = fault.speaker or OPERATOR, threading.Event()
    for agent in {fault.target, speaker} - {OPERATOR}:
        operator.agent_of(fleet, agent)
    with fleet.speaking(speaker, fault.target) as put:
        following = _orders(fleet, fault) if speaker == OPERATOR else _copies(fleet, fault)
        flooding = threading.Thread(target=_flood, args=(put, following, fault.amount, over), daemon=True)
        flooding.start()
        try:
            yield
        finally:
            over.set()
            flooding.join()


def _flood(put: Put, following: Next, per_second: float, over: threading.Event) -> None:
    """Put until it is over; what is late is made up for."""
    began, said = time.monotonic(), 0
    while not over.wait(TICK_S):
        while said < per_second * (time.monotonic() - began) and not over.is_set():
            said += 1
            with contextlib.suppress(Exception):  # who is down takes nothing: the flood goes on
                put(*following())


def _orders(fleet: Target, fault: Fault) -> Next:
    told, beat = fleet.look().fleet, operator.heartbeat(fleet, fault.target)
    key = operator.key(fleet.system.design, told.system if told else fleet.system.name, fault.target)
    order, numbers = SetLevel((beat and beat.level) or "info"), count(1)
    return lambda: (key, msgspec.msgpack.encode(Command(f"{fault.id}-{next(numbers)}", order)))


def _copies(fleet: Target, fault: Fault) -> Next:
    """Return what gives the next communicate of the speaker to the agent, again and again."""
    peers = fleet.system.design.peers(fault.speaker)
    if fault.target not in peers:
        raise UsageError(f"{fault.speaker} says nothing to {fault.target}; it talks with {', '.join(peers)}")
    until = time.monotonic() + HEARD_S
    with listen.source(None, Path(fleet.where)) as heard:
        for sample in heard.samples():
            one = listen.said(sample) if sample is not None else None
            if sample is not None and one is not None and (one.sender, one.receiver) == (fault.speaker, fault.target):
                copied = sample.key, sample.data
                return lambda: copied
            if time.monotonic() > until:
                break
    raise FleetError(f"{fault.speaker} said nothing to {fault.target} within {HEARD_S:g} s; nothing was done")
