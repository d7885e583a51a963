"""The operator's orders to one agent: put on the signal `control`, and answered by the agent's next
heartbeat.

An order is put again until it is answered; the agent obeys a copy once more, which changes nothing.
"""

import time
from collections.abc import Callable

import msgspec

from agent_runtime.core.control import KIND, Command, Order, worded
from console.errors import NO, ConsoleError, FleetError, UsageError
from console.fleet import process_status
from console.fleet.identity import OPERATOR
from console.fleet.process_status import Beat
from console.fleet.targets import Target
from topdown.model.design import Design

ANSWER_S = 5.0
"""Time to wait for an answer [s]; estimate: an agent answers between two steps, some ms."""
AGAIN_S = 0.5
LOOK_S = 0.02


class RefusedError(ConsoleError):
    """The agent refused an order; its reason in words."""

    code = NO

    def __init__(self, agent: str, order: str, why: str) -> None:
        self.agent, self.order, self.why = agent, order, why
        super().__init__(f"{agent} refused {order}: {why}")


def agent_of(fleet: Target, name: str) -> str:
    """The name, where it is an agent that can be given orders. Raises UsageError."""
    design = fleet.system.design
    if name not in design.agents:
        raise UsageError(
            f"{name!r} is not an agent of {fleet.system.name}; its agents:"
            f" {', '.join(design.agents)}"
        )
    return name


def key(design: Design, system: str, agent: str) -> str:
    """The key of orders to an agent. Raises UsageError where the design has none."""
    signal = design.signals.get(KIND)
    if signal is None or OPERATOR not in signal.writers or agent not in signal.readers:
        raise UsageError(
            f"the design gives nobody the right to order {agent}: it needs a [[signal]] of kind"
            f" {KIND!r} with writers ="
            f' ["{OPERATOR}"] and {agent} among its readers; docs/parameters.md shows it'
        )
    return design.signal_key(KIND, system=system, owner=OPERATOR, peer=agent)


def order(fleet: Target, name: str, what: Order) -> Beat:
    """Give an order and wait until it is obeyed; the heartbeat that says so.

    Raises UsageError, RefusedError with the agent's reason, FleetError where it does not run or
    does not answer.
    """
    agent_of(fleet, name)
    now = fleet.look()
    if not any(one.name == name and one.status.pid for one in now.seen):
        raise FleetError(
            f"{name} does not run in {fleet.where}; `roco agent start {name}` starts it"
        )
    command = Command(f"{OPERATOR}-{time.time_ns():x}", what)
    system = now.fleet.system if now.fleet else fleet.system.name
    data = msgspec.msgpack.encode(command)
    with fleet.operating() as put:
        place = key(fleet.system.design, system, name)
        beat = _answered(fleet, name, command, lambda: put(place, data))
    if beat is None:
        late = f"{name} does not answer {worded(what)} within {ANSWER_S:.0f} s"
        raise FleetError(f"{late}; `roco agents {name}`")
    if beat.answer.why:
        raise RefusedError(name, worded(what), beat.answer.why)
    return beat


def heartbeat(fleet: Target, name: str) -> Beat | None:
    """The last heartbeat of an agent, None where it never had one."""
    return process_status.beat(fleet.read(name, f"{name}.heartbeat.json"))


def _answered(fleet: Target, name: str, command: Command, put: Callable[[], None]) -> Beat | None:
    """The heartbeat that answers a command; None where none does in time."""
    put()  # in containers it takes seconds, which are not the agent's
    until, again = time.monotonic() + ANSWER_S, time.monotonic() + AGAIN_S
    while (now := time.monotonic()) < until:
        if now >= again:
            put()
            again = time.monotonic() + AGAIN_S
        beat = heartbeat(fleet, name)
        if beat is not None and beat.answer.id == command.id:
            return beat
        time.sleep(LOOK_S)
    return None
