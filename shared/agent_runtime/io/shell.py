"""The shell around the core: one loop thread that owns session, clock, journal and signals.

One step at a time, on the loop's thread or on the one that heard (see floor): it steps the core and carries the effects
out in the one order that keeps the promise: record synced, receipts, sends, words to the devices. Logs and step log,
which nobody waits for, are written in the next pause. SIGTERM and SIGINT stop it between steps. An exception of the
agent's own code ends the process with status 1: the journal is as before the step, and the supervisor restarts it.
"""

import gc
import heapq
import os
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.agent import Agent
from agent_runtime.core.control import Answer, Command, Value
from agent_runtime.core.effects import Deed, Out, Receipt
from agent_runtime.core.errors import RuntimeFault
from agent_runtime.core.events import (
    AnyEvent,
    Arrived,
    Garbled,
    LinkChanged,
    Local,
    Next,
    Ordered,
    PeerChanged,
    Receipted,
    Started,
    Tick,
)
from agent_runtime.core.inside import STEPS, Inside, looked_into
from agent_runtime.core.peers import Peers
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.core.unheard import Unheard, Watch, words
from agent_runtime.core.wiring import Wiring
from agent_runtime.io.devices import Device, DeviceMaker, NoDevice
from agent_runtime.io.diary import Diary
from agent_runtime.io.floor import Failed, Floor
from agent_runtime.io.inbox import Inbox
from agent_runtime.io.journal import Journal
from agent_runtime.io.logs import Log
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.steplog import StepLog
from agent_runtime.io.zenoh_wire import Bytes, OrderBytes, Ping, ReceiptBytes, RouterSeen, Token, ZenohWire, open_client
from fipa_codec.communicate import decode
from fipa_codec.errors import MalformedError

QUIET_S = 0.005
"""Without anything new, after which logs are written; eight round trips. A kill -9 takes what was not (estimate)."""
COLLECT_AFTER = 10_000
"""Objects made and not freed, after which the youngest are collected; Python's own 700 are a few steps' (estimate)."""
HEARTBEAT_S = 1.0
"""Of the heartbeat file and of pings until they are answered; estimate: people look once a second."""


class Stop(msgspec.Struct, frozen=True):
    """A signal to stop in order."""

    signal: int


class Heartbeat(msgspec.Struct, frozen=True):
    """<agent>.heartbeat.json and the key `_/state/<agent>`: state and work of the agent. `at`: unix seconds.

    `inside`: what it has at hand; in the file only.
    """

    agent: str
    pid: int
    incarnation: int
    step: int
    state: str
    ready: bool
    up: bool
    peers: dict[str, int]
    unreceipted: dict[str, int]
    due: dict[str, int]
    counts: dict[str, int]
    at: float
    unheard: tuple[Unheard, ...] = ()
    paused: bool = False
    level: str = ""
    parameters: dict[str, Value] = {}
    answer: Answer = Answer()
    inside: Inside | None = None


class Shell:
    """One agent in one process; `run` returns the exit status."""

    def __init__(self, agent: Agent[Any], wiring: Wiring, options: Options, device: DeviceMaker | None = None) -> None:
        """Opens files, takes the journal; nothing is sent before `run`.

        Raises JournalError where another process has the journal, KeysError where keys are missing.
        """
        self.name = agent.name
        self._options, run = options, options.run_dir
        self._tls = client_tls(options.keys, self.name) if options.keys else None
        self.log = Log(agent.name, options.log_level, run / "logs" / f"{agent.name}.jsonl")
        self._core = Core(agent, wiring)
        self._inbox = Inbox()
        self._peers = Peers(wiring.peers)
        self._unheard = Watch(wiring)
        self._journal = Journal(run / "journal" / f"{agent.name}.journal")
        self._steps = StepLog(run / "steps" / f"{agent.name}.steps")
        self._maker = device
        self._device: Device = NoDevice()
        self._later: list[tuple[float, int, Any]] = []
        self._unanswered = {(link.peer, link.channel.encode()) for link in wiring.links if link.awaited}
        self._state: CoreState = self._boot()
        self._show_level()
        self._wire: ZenohWire | None = None
        self._serving = False
        self._diary = Diary(self.log, self._steps, wiring)
        self._wake_at: float | None = None
        self._beat_at = self._quiet_at = 0.0
        self._steps_done: deque[tuple[float, Deed]] = deque(maxlen=STEPS)
        self._floor = Floor(self._inbox, self._take, self._next_at)

    def _boot(self) -> CoreState:
        """Raise the incarnation and sync it before anything is sent under it."""
        before = self._journal.last
        state = self._core.boot(before)
        self._journal.append(self._core.record(state))
        self._steps.boot(state.incarnation, before or b"", time.time())
        self._ready_file.unlink(missing_ok=True)
        return state

    @property
    def _ready_file(self) -> Path:
        return self._options.run_dir / f"{self.name}.ready"

    # --- the loop -----------------------------------------------------------------------------------------------------

    def run(self) -> int:
        """Serve until a signal comes. 0: stopped in order; 1: an error of the agent's own."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda caught, _: self._inbox.interrupt(Stop(caught)))
        try:
            self._serve()
        except Exception:
            self._diary.write()
            self.log.write("died", level="error", why=traceback.format_exc())
            return 1
        finally:
            self._close()
        return 0

    def _serve(self) -> None:
        stopping: list[Stop] = []
        self._serving = True
        self.log.write("waiting for the router", at=self._options.connect)
        session = open_client(self._options.connect, lambda: self._stop_came(stopping), tls=self._tls)
        if session is None:
            return
        self._wire = ZenohWire(session, self._core.wiring, self._state.incarnation, self._floor)
        self._peers.router(True, time.time())
        if self._maker is not None:
            self._device = self._maker(_Desk(self._floor, self._wire))
        first = self._state.incarnation == 1
        self.log.write("started", incarnation=self._state.incarnation, state=self._state.state, first=first)
        self._happen(Started(first))
        # What is there now stays: no collection need look at it again (34 ms each in km, at times amid an answer). What
        # steps leave is free without one: a question took 1.43 instead of 1.44 of a get (benchmarks/communicates.py).
        gc.collect()
        gc.freeze()
        gc.set_threshold(COLLECT_AFTER)
        self._floor.open()
        while True:
            item = self._inbox.get(self._floor.until - time.time())
            with self._floor.held():
                if isinstance(item, Stop):
                    self.log.write("stopping", signal=item.signal)
                    return
                if isinstance(item, Failed):
                    raise item.error
                if item is not None:
                    self._floor.step(item)
                self._on_time()

    def _stop_came(self, stopping: list[Stop]) -> bool:
        """Whether a signal came while no router was reached yet."""
        item = self._inbox.get(0.0)
        if isinstance(item, Stop):
            stopping.append(item)
        return bool(stopping)

    def _next_at(self) -> float:
        """Return the time of the next work that needs no event [unix s]."""
        at = self._beat_at
        for other in (self._wake_at, self._peers.look_at, self._later[0][0] if self._later else None):
            if other is not None and other < at:
                at = other
        return min(at, self._quiet_at) if self._diary.pending else at

    def _on_time(self) -> None:
        now = time.time()
        if self._quiet_at <= now:
            self._diary.write()
        for gone in self._peers.gone(now):
            self._changed(gone)
        while self._later and self._later[0][0] <= now:
            self._happen(Local(heapq.heappop(self._later)[2]))
        if self._wake_at is not None and self._wake_at <= now:
            self._happen(Tick())
        if self._beat_at <= now:
            self._beat_at = now + HEARTBEAT_S
            self._ping_all()
            self._listen_back(now)
            self._beat()

    def _listen_back(self, now: float) -> None:
        """Check the outcome of what was sent; report changes."""
        for one, still in self._unheard.look(self._state, self._unanswered, self._peers, now):
            why, level = (words(self.name, one, now), "warning") if still else ("heard again", "info")
            self.log.write("unheard", level=level, peer=one.peer, channel=one.channel, what=one.what, why=why)

    def _close(self) -> None:
        self._floor.close()
        self._serving = False
        self._diary.write()
        self._device.close()
        if self._wire is not None:
            self._wire.close()
        self._journal.close()
        self._steps.close()
        self._ready_file.unlink(missing_ok=True)
        self.log.write("stopped")
        self.log.close()

    # --- what comes in ------------------------------------------------------------------------------------------------

    def _take(self, item: Any) -> None:
        match item:
            case Bytes():
                self._happen(_opened(item))
            case ReceiptBytes():
                self._happen(self._receipt(item))
            case OrderBytes(data=data):
                self._happen(_order(data))
            case _Posted(content=content, at=0.0):
                self._happen(Local(content))
            case _Posted(content=content, at=at):
                heapq.heappush(self._later, (at, id(item), content))
            case Token(agent=agent, incarnation=incarnation, alive=alive):
                for change in self._peers.token(agent, incarnation, alive, time.time()):
                    self._changed(change)
            case RouterSeen(up=up):
                for lost_or_back in self._peers.router(up, time.time()):
                    self._changed(lost_or_back)
            case Ping():
                self._pinged(item)

    def _receipt(self, item: ReceiptBytes) -> AnyEvent:
        try:
            receipt = msgspec.msgpack.decode(item.data, type=Receipt)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            return Garbled(f"receipt of {item.peer}", str(error))
        self._unheard.receipted(item.peer)
        return Receipted(item.peer, receipt.taken, receipt.subject, receipt.version)

    def _changed(self, change: PeerChanged | LinkChanged) -> None:
        if isinstance(change, PeerChanged):
            level = "info" if change.incarnation is not None else "warning"
            self.log.write("peer", level=level, peer=change.agent, incarnation=change.incarnation or "gone")
            self._ping_all()
        self._happen(change)

    # --- steps --------------------------------------------------------------------------------------------------------

    def _happen(self, event: AnyEvent) -> None:
        """Step, and again while more can be taken."""
        following: AnyEvent | None = event
        while following is not None:
            now, before = time.time(), self._state
            after, out = self._core.begin(before, following, now)
            sizes = self._carry_out(out)
            effects = self._core.end(before, after, out, now)
            self._state = after
            if effects.deed is not None:
                self._steps_done.append((now, effects.deed))
            self._diary.note(following, now, after, effects, sizes)
            self._wake_at = effects.wake_at
            if after.settings is not before.settings:
                self._show_level()
            if after.state != before.state or after.soft.answer is not before.soft.answer:
                self._beat()
            following = Next() if effects.more else None
            self._quiet_at = now + QUIET_S
        if self._diary.full or not self._serving:
            self._diary.write()

    def _carry_out(self, out: Out) -> list[int]:
        """In this order: see the module's text. The bytes of each communicate sent."""
        assert self._wire is not None
        if out.record is not None:
            self._journal.append(out.record)
        for receipt in out.receipts:
            self._wire.send_receipt(receipt)
        sizes = [self._wire.send(communicate) for communicate in out.sends]
        for content in out.tells:
            self._device.tell(content)
        return sizes

    def _show_level(self) -> None:
        self.log.show(self._state.now_set.level or self._options.log_level)

    # --- readiness and life -------------------------------------------------------------------------------------------

    def _ping_all(self) -> None:
        """Ask on every channel that has not answered yet."""
        if self._wire is not None:
            for peer, channel in self._unanswered:
                self._wire.ping(peer, channel)

    def _pinged(self, ping: Ping) -> None:
        assert self._wire is not None
        if not ping.pong:
            self._wire.ping(ping.peer, ping.channel, pong=True)
        elif (ping.peer, ping.channel) in self._unanswered:
            self._unanswered.discard((ping.peer, ping.channel))
            if not self._unanswered:
                self.log.write("ready")
                self._beat()

    def _beat(self) -> None:
        """Say what the agent is at: file, key, and once it is ready the file that says so."""
        state = self._state
        beat = Heartbeat(
            agent=self.name,
            pid=os.getpid(),
            incarnation=state.incarnation,
            step=state.soft.step,
            state=state.state,
            ready=not self._unanswered,
            up=self._peers.up,
            peers=dict(self._peers.alive),
            unreceipted={peer: len(sent) for peer, sent in state.outbox.items()},
            due={peer: len(due) for peer, due in state.due.items()},
            counts=state.counts | {f"dropped {kind}": count for kind, count in self._inbox.dropped.items()},
            at=time.time(),
            unheard=self._unheard.now,
            paused=state.paused,
            level=state.now_set.level or self._options.log_level,
            parameters=state.soft.parameters,
            answer=state.soft.answer,
        )
        whole = msgspec.structs.replace(beat, inside=looked_into(state, self._steps_done))
        _replace(self._options.run_dir / f"{self.name}.heartbeat.json", msgspec.json.encode(whole))
        if beat.ready and not self._ready_file.exists():
            _replace(self._ready_file, str(state.incarnation).encode())
        if self._wire is not None:
            self._wire.publish("state", msgspec.json.encode(beat))


class _Posted(msgspec.Struct, frozen=True):
    """A device's word; `at` 0: now."""

    content: Any
    at: float


class _Desk:
    """The outlet by which devices post and publish."""

    def __init__(self, floor: Floor, wire: ZenohWire) -> None:
        self._floor, self._wire = floor, wire

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        self._floor.post(_Posted(content, time.time() + delay_s if delay_s > 0.0 else 0.0))

    def publish(self, kind: str, data: bytes) -> None:
        self._wire.publish(kind, data)


def _order(data: bytes) -> AnyEvent:
    """The order in what came, if it is one."""
    try:
        return Ordered(msgspec.msgpack.decode(data, type=Command))
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return Garbled("order", str(error))


def _opened(item: Bytes) -> AnyEvent:
    """The communicate in what came, if it is one and says what its key says (the router's rights go by the key)."""
    try:
        communicate = decode(item.data)
    except MalformedError as error:
        return Garbled(item.key, str(error))
    one = communicate
    says = (one.sender, one.receiver, one.protocol, one.performative)
    if item.told != says:
        return Garbled(item.key, f"the communicate says {'/'.join(says)}", forged=True)
    return Arrived(communicate)


def _replace(path: Path, data: bytes) -> None:
    """Write a small file so that a reader sees the old one or the new one."""
    beside = path.with_name(f".{path.name}.new")
    beside.write_bytes(data)
    beside.replace(path)


def run(
    agent: Agent[Any],
    wiring: Wiring,
    options: Options,
    device: DeviceMaker | None = None,
    *,
    prepare: Callable[[Shell], None] | None = None,
) -> int:
    """Run an agent until a stop signal; return the exit status. `prepare` sees the shell before it serves (tests)."""
    try:
        shell = Shell(agent, wiring, options, device)
    except RuntimeFault as fault:
        Log(agent.name, options.log_level).write("cannot start", level="error", why=str(fault))
        return 1
    if prepare is not None:
        prepare(shell)
    return shell.run()
