"""Pretend wires: several agents in one process under a virtual clock, with seeded faults and
journals in memory.

The same core, the same order of effects, the same bytes as over the real wire; only sockets, disks
and time are pretended. Faults: loss, duplication, delay (which reorders), and crashes of a chosen
agent at a chosen point of a step, with a restart from its journal. While a device of an agent
computes (a real worker process), the virtual clock stands still.
"""

import heapq
import itertools
import random
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from queue import Empty
from typing import Any

import msgspec

from agent_runtime.core.agent import Agent
from agent_runtime.core.control import Command, Order
from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Effects,
    Local,
    Next,
    Ordered,
    PeerChanged,
    Receipt,
    Started,
    Tick,
)
from agent_runtime.core.state import CoreState, restored
from agent_runtime.core.step import Core
from agent_runtime.core.streams import preceding, receipted
from agent_runtime.core.wiring import Delivery, Wiring
from agent_runtime.io.devices import Device, DeviceMaker, NoDevice
from agent_runtime.io.inbox import OneReaderQueue
from fipa_codec.communicate import Communicate, decode, encode

LATENCY_S = 0.0005
"""One way through a router on loopback, some 0.4 ms for a whole round trip of 4 kB (measured);
rounded up.
"""


class Point(StrEnum):
    """Point of a step at which an agent dies."""

    BEFORE = "before"
    """The input is lost, nothing happened."""
    RECORDED = "recorded"
    """The record is on the disk, nothing has left."""
    RECEIPTED = "receipted"
    """Receipts have left, communicates have not."""
    AFTER = "after"
    """Everything has left, the devices were told."""


class Faults(msgspec.Struct, frozen=True):
    """Chances per message or step. `delay`: chance of up to `delay_s` more on the way, which
    reorders.
    """

    loss: float = 0.0
    duplication: float = 0.0
    delay: float = 0.0
    delay_s: float = 0.3
    crash: float = 0.0
    restart_s: float = 0.5


class Quiet(RuntimeFault):
    """The wires stopped without what was waited for; `now` is the virtual time. `asleep`: agents
    whose next step only they themselves could bring about, with what their rows wait for.
    """

    def __init__(
        self, why: str, now: float, states: dict[str, str], asleep: dict[str, str] | None = None
    ) -> None:
        self.why, self.now, self.states, self.asleep = why, now, states, asleep or {}
        standing = ", ".join(f"{agent} {state}" for agent, state in states.items())
        waiting = "".join(
            f"{agent} in {states[agent]} waits for its own {words}, which nothing brings about; "
            for agent, words in self.asleep.items()
        )
        super().__init__(f"{waiting}{why} at {now:.3f} s; agents stand at: {standing}")


class Node:
    """One agent on the wires; its journal survives a crash, `state` and `device` do not."""

    def __init__(self, agent: Agent[Any], wiring: Wiring, maker: DeviceMaker | None) -> None:
        self.core = Core(agent, wiring)
        self.maker = maker
        self.journal: bytes | None = None
        self.journals = 0
        self.state: CoreState | None = None
        self.device: Device = NoDevice()
        self.steps = 0
        self.boots = 0
        self.crash_at: tuple[Point, int] | None = None
        self.restart_s = 0.5
        self.wake_at: float | None = None


class _DevicePort:
    """The outlet of one life of an agent, by which its devices post and publish."""

    def __init__(self, wires: "MemoryBus", agent: str, boot: int) -> None:
        self._wires, self._agent, self._boot = wires, agent, boot

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        self._wires.posted.put((self._agent, self._boot, content, delay_s))

    def publish(self, kind: str, data: bytes, *peer: str) -> None:
        self._wires.published[self._agent, kind] = data

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        """Nobody beside the agents says anything here."""

    def hear_guests(self, on_data: Callable[[str, bytes], None]) -> None:
        """Hand on what `say_as_guest` gives for this agent."""
        self._wires.doors[self._agent] = on_data

    def say_to_guest(self, communicate: Communicate) -> None:
        self._wires.told_guests.append(communicate)


class MemoryBus:
    """Agents are `add`ed, then `run` goes on until a condition holds.

    `now`: the virtual clock [unix s]; `traffic`: every communicate sent, copies too; `published`:
    (agent, kind) -> the newest thing for people; `doors`: agent -> what takes a guest's words;
    `told_guests`: what guests were told; `on_step(agent, effects)` is called after each step.
    """

    def __init__(
        self, *, seed: int = 0, faults: Faults | None = None, now: float = 1_000_000.0
    ) -> None:
        self.now = now
        self.faults = faults or Faults()
        self.nodes: dict[str, Node] = {}
        self.traffic: list[Communicate] = []
        self.published: dict[tuple[str, str], bytes] = {}
        self.doors: dict[str, Callable[[str, bytes], None]] = {}
        self.told_guests: list[Communicate] = []
        self.on_step: Callable[[str, Effects], None] = lambda agent, effects: None
        self._chance = random.Random(seed)
        self._order = itertools.count()
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self.posted = OneReaderQueue[tuple[str, int, Any, float]]()

    # --- for tests and fleets ---------------------------------------------------------------------

    def add(self, agent: Agent[Any], wiring: Wiring, device: DeviceMaker | None = None) -> Node:
        """Put an agent on the wires; it starts when the clock runs."""
        node = self.nodes[agent.name] = Node(agent, wiring, device)
        self._at(self.now, lambda: self._boot(agent.name))
        return node

    def memory(self, agent: str) -> Any:
        """The agent's memory: the present one, while it is down the one in its journal."""
        node = self.nodes[agent]
        if node.state is not None:
            return node.state.memory
        agent_table = node.core.agent
        return (
            agent_table.memory
            if node.journal is None
            else restored(agent_table, node.journal).memory
        )

    def up(self, agent: str) -> bool:
        return self.nodes[agent].state is not None

    def post(self, agent: str, content: Any, delay_s: float = 0.0) -> None:
        """A word from the agent's own side, as a device would post it; repeated until the agent is
        up.
        """
        self._at(self.now + delay_s, lambda: self._local(agent, content))

    def order(self, agent: str, what: Order) -> None:
        """An order of the operator, put once: one for an agent that is down is lost."""
        command = Command(f"order-{next(self._order)}", what)
        self._at(self.now, lambda: self._happen(agent, Ordered(command)))

    def crash(
        self, agent: str, point: Point = Point.BEFORE, *, in_steps: int = 1, restart_s: float = 0.5
    ) -> None:
        """Kill the agent at this point of its nth step from now; it comes back `restart_s`
        later.
        """
        node = self.nodes[agent]
        node.crash_at, node.restart_s = (point, node.steps + in_steps), restart_s

    def kill(self, agent: str, *, restart_s: float = 0.5) -> None:
        """Kill the agent between two steps, unless it is down; it comes back `restart_s` later."""
        if self.nodes[agent].state is not None:
            self._die(agent, restart_s)

    def put_back(self, agent: str, journal: bytes | None, *, restart_s: float = 0.5) -> None:
        """Kill the agent and put another record in place of its journal; it comes back `restart_s`
        later. None: the journal is deleted, and the next one has another name.
        """
        self._die(agent, restart_s)
        self.nodes[agent].journal = journal

    def deliver(self, communicate: Communicate, journals: tuple[str, str] = ("", "")) -> None:
        """Put a communicate on the wire as a stranger might; `journals`: the names that are said
        with it.
        """
        self._carry(communicate, *journals)

    def call(self, delay_s: float, act: Callable[[], None]) -> None:
        """Call it when the virtual clock is there."""
        self._at(self.now + delay_s, act)

    def run(
        self, until: Callable[[], bool], *, limit_s: float = 600.0, patience_s: float = 60.0
    ) -> None:
        """Go on until the condition holds.

        Raises Quiet when nothing is left to happen, when `limit_s` of virtual time are over, or
        when a device that computes said nothing for `patience_s` of real time.
        """
        end = self.now + limit_s
        while not until():
            self._drain(patience_s)
            if not self._agenda:
                raise Quiet("nothing is left to happen", self.now, self._states(), self._asleep())
            at, _, act = heapq.heappop(self._agenda)
            if at > end:
                raise Quiet(f"not reached in {limit_s} s", self.now, self._states(), self._asleep())
            self.now = max(self.now, at)
            act()

    def run_for(self, seconds: float) -> None:
        """Go on for some virtual time."""
        over: list[bool] = []
        self._at(self.now + seconds, lambda: over.append(True))
        self.run(lambda: bool(over), limit_s=seconds + 1.0)

    def close(self) -> None:
        for node in self.nodes.values():
            node.device.close()

    # --- devices ----------------------------------------------------------------------------------

    def _drain(self, patience_s: float) -> None:
        """Take what devices posted; wait for them before the clock goes on."""
        while True:
            busy = any(node.device.busy for node in self.nodes.values())
            later = not self._agenda or self._agenda[0][0] > self.now
            try:
                timeout_s = patience_s if busy and later else 0.0
                agent, boot, content, delay_s = self.posted.get(timeout_s)
            except Empty:
                if busy and later and any(node.device.busy for node in self.nodes.values()):
                    why = f"a device said nothing for {patience_s} s"
                    raise Quiet(why, self.now, self._states(), self._asleep()) from None
                return
            self._at(self.now + delay_s, partial(self._from_device, agent, boot, content))

    def _from_device(self, agent: str, boot: int, content: Any) -> None:
        """A word of a device, which dies with the process of its agent."""
        if boot == self.nodes[agent].boots:
            self._happen(agent, Local(content))

    def _local(self, agent: str, content: Any) -> None:
        if self.nodes[agent].state is None:
            self._at(self.now + 0.1, lambda: self._local(agent, content))
        else:
            self._happen(agent, Local(content))

    # --- life and death ---------------------------------------------------------------------------

    def _boot(self, agent: str) -> None:
        node = self.nodes[agent]
        node.boots += 1
        if node.journal is None:
            node.journals += 1
            node.journal = node.core.first(f"{agent}-journal-{node.journals}")
        node.state = node.core.boot(node.journal)
        node.journal = node.core.record(node.state)
        node.wake_at = None
        boot = node.boots
        if node.maker is not None:
            node.device = node.maker(_DevicePort(self, agent, boot))
        incarnation, journal = node.state.incarnation, node.state.journal
        self._happen(agent, Started(first=incarnation == 1))
        for name, other in self.nodes.items():
            if other.state is None or name == agent:
                continue
            if name in node.core.wiring.peers:
                self._later(agent, PeerChanged(name, other.state.incarnation, other.state.journal))
            if agent in other.core.wiring.peers:
                self._later(name, PeerChanged(agent, incarnation, journal))

    def _die(self, agent: str, restart_s: float) -> None:
        node = self.nodes[agent]
        node.state, node.crash_at = None, None
        node.device.close()
        node.device = NoDevice()
        node.boots += 1
        for name, other in self.nodes.items():
            if other.state is not None and agent in other.core.wiring.peers:
                self._later(name, PeerChanged(agent, None))
        self._at(self.now + restart_s, lambda: self._boot(agent))

    # --- steps ------------------------------------------------------------------------------------

    def _later(self, agent: str, event: AnyEvent, delay_s: float = LATENCY_S) -> None:
        self._at(self.now + delay_s, lambda: self._happen(agent, event))

    def _happen(self, agent: str, event: AnyEvent) -> None:
        """Step the agent, and again while it can take more; an agent that is down hears nothing."""
        node = self.nodes[agent]
        following: AnyEvent | None = event
        while following is not None and node.state is not None:
            more = self._step(agent, node, node.state, following)
            following = Next() if more else None

    def _step(self, agent: str, node: Node, state: CoreState, event: AnyEvent) -> bool:
        """One step with its effects in order, or a part of it where the agent is to die."""
        node.steps += 1
        point, restart_s = self._doom(node)
        if point is Point.BEFORE:
            self._die(agent, restart_s)
            return False
        after, effects = node.core.step(state, event, self.now)
        self.on_step(agent, effects)
        node.state = after
        if effects.record is not None:
            node.journal = effects.record
        if after.journal != state.journal:  # as the shell has it: it begins again
            self._die(agent, self.faults.restart_s)
            return False
        if point is not Point.RECORDED:
            self._emit(agent, effects, receipts_only=point is Point.RECEIPTED)
        if point in (None, Point.AFTER):
            for content in effects.tells:
                node.device.tell(content)
        if point is not None:
            self._die(agent, restart_s)
            return False
        self._wake(agent, node, effects.wake_at)
        return effects.more

    def _doom(self, node: Node) -> tuple[Point | None, float]:
        if node.crash_at is not None and node.steps >= node.crash_at[1]:
            return node.crash_at[0], node.restart_s
        if self._happens(self.faults.crash):
            return self._chance.choice(list(Point)), self.faults.restart_s
        return None, 0.0

    def _wake(self, agent: str, node: Node, at: float | None) -> None:
        """Schedule a Tick at `at`, unless an earlier one is scheduled (the core then asks
        again).
        """
        if at is None or (node.wake_at is not None and self.now <= node.wake_at <= at):
            return
        at = node.wake_at = max(at, self.now)
        boot = node.boots

        def tick() -> None:
            if node.boots == boot and node.wake_at == at:
                node.wake_at = None
                self._happen(agent, Tick())

        self._at(at, tick)

    # --- the wire ---------------------------------------------------------------------------------

    def _emit(self, agent: str, effects: Effects, *, receipts_only: bool) -> None:
        for receipt in effects.receipts:
            if receipt.peer in self.nodes:
                arrive = partial(
                    self._happen,
                    receipt.peer,
                    receipted(agent, receipt, *self._journals(agent, receipt)),
                )
                self._through(arrive)
        for communicate in () if receipts_only else effects.sends:
            self.traffic.append(communicate)
            state = self.nodes[agent].state
            behind = preceding(state, communicate) if state is not None else (b"", 0)
            self._carry(communicate, *self._journals(agent, communicate), *behind)

    def _journals(self, agent: str, said: Communicate | Receipt) -> tuple[str, str]:
        """Names of journals that go with it, as over the real wire."""
        node = self.nodes[agent]
        assert node.state is not None
        peer = said.peer if isinstance(said, Receipt) else said.receiver
        if isinstance(said, Communicate):
            link = node.core.wiring.link(peer, said.protocol)
            if link is None or link.delivery is Delivery.VOLATILE:
                return "", ""
        return node.state.journal, node.state.journals.get(peer, "")

    def _carry(
        self,
        communicate: Communicate,
        journal: str = "",
        believed: str = "",
        after: bytes = b"",
        heard: int = 0,
    ) -> None:
        data = encode(communicate)
        receiver = communicate.receiver
        if receiver in self.nodes:
            self._through(
                lambda: self._happen(
                    receiver, Arrived(decode(data), journal, believed, after, heard)
                )
            )

    def _through(self, arrive: Callable[[], None]) -> None:
        for _ in range(2 if self._happens(self.faults.duplication) else 1):
            if not self._happens(self.faults.loss):
                extra = (
                    self._chance.uniform(0.0, self.faults.delay_s)
                    if self._happens(self.faults.delay)
                    else 0.0
                )
                self._at(self.now + LATENCY_S + extra, arrive)

    def _happens(self, chance: float) -> bool:
        return chance > 0.0 and self._chance.random() < chance

    def _at(self, time: float, act: Callable[[], None]) -> None:
        heapq.heappush(self._agenda, (time, next(self._order), act))

    def _asleep(self) -> dict[str, str]:
        """Agents in a state that own words end, with no wake-up due and nothing at work."""
        found: dict[str, str] = {}
        for name, node in self.nodes.items():
            rows, state = node.core.agent.rows, node.state
            if rows is None or state is None or state.wakes or node.device.busy:
                continue
            if words := rows.own(state.state):
                found[name] = " or ".join(words)
        return found

    def _states(self) -> dict[str, str]:
        return {
            name: "down" if node.state is None else node.state.state
            for name, node in self.nodes.items()
        }
