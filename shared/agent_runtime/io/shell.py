"""The shell around the core: one loop thread that owns session, clock, journal and signals.

One step at a time, on the loop's thread or on the one that heard (see inbox): it steps the core
and carries the effects out in the one order that keeps the promise: record synced, receipts, sends,
messages to the devices. Where the record cannot be written, the step has not happened, and its
event waits (journal). Logs and step log, which nobody waits for, are written in the next pause.
SIGTERM and SIGINT stop it between steps. An exception of the agent's own code ends the process with
status 1: the journal is as before the step, and the supervisor restarts it.
"""

import gc
import heapq
import os
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import msgspec
import zenoh

from agent_runtime.core.agent import Agent
from agent_runtime.core.errors import JournalError, RuntimeFault
from agent_runtime.core.events import (
    AnyEvent,
    Deed,
    Local,
    Next,
    Out,
    PeerChanged,
    Receipted,
    Started,
    Tick,
)
from agent_runtime.core.peers import Peers, Watch, unheard_text
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.core.streams import preceding
from agent_runtime.core.wiring import Wiring
from agent_runtime.io import heartbeat, steplog
from agent_runtime.io.devices import Device, DeviceMaker, NoDevice
from agent_runtime.io.heartbeat import STEPS, Heartbeat, looked_into
from agent_runtime.io.inbox import Failed, Inbox, StepLock
from agent_runtime.io.journal import FullDisk, Journal, journal_file, new_name
from agent_runtime.io.logs import Log, clock
from agent_runtime.io.options import Options
from agent_runtime.io.run_files import make_run, ready_file
from agent_runtime.io.secured import KeysError
from agent_runtime.io.sessions import Joining, Links
from agent_runtime.io.steplog import StepLog, StepRecorder
from agent_runtime.io.zenoh_wire import (
    Bytes,
    OrderBytes,
    Ping,
    ReceiptBytes,
    Token,
    ZenohWire,
    arrived,
    ordered,
    receipt,
)
from fipa_codec.communicate import Communicate

# --- The way of devices to their agent: what they post waits at the step lock, what they publish
# goes onto the wire


class Posted(msgspec.Struct, frozen=True):
    """A device's message; `at` 0: now."""

    content: Any
    at: float


class DevicePort:
    """The outlet by which devices post and publish."""

    def __init__(self, lock: StepLock, wire: ZenohWire) -> None:
        self._lock, self._wire = lock, wire

    def __call__(self, content: Any, delay_s: float = 0.0) -> None:
        self._lock.post(Posted(content, clock.now() + delay_s if delay_s > 0.0 else 0.0))

    def publish(self, kind: str, data: bytes, *peer: str) -> None:
        self._wire.publish(kind, data, *peer)

    def hear(self, kind: str, on_data: Callable[[bytes], None]) -> None:
        self._wire.hear(kind, on_data)

    def hear_guests(self, on_data: Callable[[str, bytes], None]) -> None:
        self._wire.hear_guests(on_data)

    def say_to_guest(self, communicate: Communicate) -> None:
        self._wire.say_to_guest(communicate)


# --- Sums of what one agent was told too much of, and that the disk has its share: said in its log,
# for people


class Floods:
    """Writer of the log lines about dropped messages and the full step log; it remembers what it
    has logged.
    """

    def __init__(self, log: Log) -> None:
        self._log = log
        self._dropped: dict[str, int] = {}
        self._full_told = False

    def look(self, dropped: Mapping[str, int], *, full: bool) -> None:
        """Log who says more than is taken (`dropped`: "kind of peer" -> how often so far); `full`:
        the step log is.
        """
        for what, count in tuple(dropped.items()):
            new = count - self._dropped.get(what, 0)
            if new:
                self._dropped[what] = count
                kind, _, peer = what.partition(" of ")
                why = "more than a peer may say: what is durable or asked comes again"
                self._log.write(
                    "over quota", level="warning", sender=peer, kind=kind, count=new, why=why
                )
        if full and not self._full_told:
            self._full_told = True
            why = (
                "the step log is full, steps are not logged any more: begin a new run folder to"
                " have them"
            )
            self._log.write("disk limit", level="error", why=why)
        self._log.look()


# --- The shell around the core --------------------------------------------------------------------


QUIET_S = 0.005
"""Without anything new, after which logs are written; eight round trips. A kill -9 takes what was
not (estimate).
"""
COLLECT_AFTER = 10_000
"""Objects made and not freed, after which the youngest are collected; Python's own 700 are a few
steps' (estimate).
"""
# between two tries to listen where the address is taken or keys are in the making (estimate)
LISTEN_S = 0.1
HEARTBEAT_S = 1.0
"""Of the heartbeat file and of pings until they are answered; estimate: people look once a
second.
"""


class Stop(msgspec.Struct, frozen=True):
    """A signal to stop in order."""

    signal: int


class Shell:
    """One agent in one process; `run` returns the exit status."""

    def __init__(
        self, agent: Agent[Any], wiring: Wiring, options: Options, device: DeviceMaker | None = None
    ) -> None:
        """Opens files, takes the journal; nothing is sent before `run`.

        Raises JournalError where another process has the journal, KeysError where keys are missing,
        NoEndpointError where nobody told where neighbours are, OSError where the disk takes
        nothing.
        """
        self.name = agent.name
        self._options, run = options, options.run_dir
        make_run(run)
        self._links = Links(options, wiring)
        self._joining: Joining | None = None
        self.log = Log(agent.name, options.log_level, run / "logs" / f"{agent.name}.jsonl")
        self._disk = FullDisk(self.log)
        self._stop: Stop | None = None
        self._core = Core(agent, wiring)
        self._inbox = Inbox()
        self._peers = Peers(wiring.peers)
        self._unheard = Watch(wiring)
        self._journal = Journal(journal_file(run, agent.name))
        self._maker = device
        self._device: Device = NoDevice()
        self._later: list[tuple[float, int, Any]] = []
        self._unanswered = {
            (link.peer, link.channel.encode()) for link in wiring.links if link.awaited
        }
        try:
            self._steps = StepLog(run / "steps" / f"{agent.name}.steps")
            self._state: CoreState = self._boot()
        except BaseException:
            self._journal.close()
            raise
        self._show_level()
        self._wire: ZenohWire | None = None
        self._serving = False
        self._recorder = StepRecorder(self.log, self._steps, wiring)
        self._wake_at: float | None = None
        self._beat_at = self._quiet_at = 0.0
        self._steps_done: deque[tuple[float, Deed]] = deque(maxlen=STEPS)
        self._step_lock = StepLock(self._inbox, self._take, self._next_at)
        self._floods = Floods(self.log)

    def _boot(self) -> CoreState:
        """Raise the incarnation and sync it before anything is sent under it."""
        before = self._journal.last or self._core.first(new_name())
        state = self._core.boot(before)
        self._journal.append(self._core.record(state))
        self._steps.boot(state.incarnation, before, clock.now())
        ready_file(self._options.run_dir, self.name).unlink(missing_ok=True)
        return state

    # --- the loop ---------------------------------------------------------------------------------

    def run(self) -> int:
        """Serve until a signal comes. 0: stopped in order; 1: an error of the agent's own."""

        def caught(number: int, _: object) -> None:
            self._stop = Stop(number)
            self._inbox.interrupt(self._stop)

        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, caught)
        try:
            self._serve()
        except JournalError as error:
            self.log.write("begins again", level="error", why=str(error))
            return 1
        except Exception:
            self._recorder.write()
            self.log.write("died", level="error", why=traceback.format_exc())
            return 1
        finally:
            self._close()
        return 0

    def _serve(self) -> None:
        self._serving = True
        session = self._session()
        if session is None:
            return
        state = self._state
        wiring, incarnation = self._core.wiring, state.incarnation
        inbox = self._step_lock
        self._wire = ZenohWire(session, wiring, incarnation, inbox, state.journal, self._steps.path)

        def router_away(why: str) -> None:
            self.log.write("no router", level="warning", at=self._options.connect, why=why)

        self._joining = Joining(self._options, self.name, self._wire.join, router_away)
        self._wire.knows(state.journals)
        self._peers.links(True, clock.now())
        if self._maker is not None:
            self._device = self._maker(DevicePort(self._step_lock, self._wire))
        first = incarnation == 1
        self.log.write("started", incarnation=incarnation, state=state.state, first=first)
        self._happen(Started(first))
        # Objects made so far stay: no collection need look at them again (34 ms each in km, at
        # times amid an answer). Those that steps leave are freed without one: a question took 1.43
        # instead of 1.44 of a get (benchmarks/as_shipped.py).
        gc.collect()
        gc.freeze()
        gc.set_threshold(COLLECT_AFTER)
        self._step_lock.open()
        while True:
            item = self._inbox.get(self._step_lock.until - clock.now())
            with self._step_lock.held():
                if isinstance(item, Stop):
                    self.log.write("stopping", signal=item.signal)
                    return
                if isinstance(item, Failed):
                    raise item.error
                if self._disk.events:
                    happen = self._happen
                    self._disk.wait_for_room(happen, self._beat, lambda: self._stop is not None)
                if item is not None:
                    self._step_lock.step(item)
                self._on_time()

    def _session(self) -> zenoh.Session | None:
        """The session with the neighbours; None where a stop came. It beats on meanwhile."""
        told = ""
        while self._stop is None:
            if self._beat_at <= clock.now():
                self._beat_at = clock.now() + HEARTBEAT_S
                self._beat()
            try:
                session = self._links.open()
            except (zenoh.ZError, KeysError) as error:
                if str(error) != told:
                    told = str(error)
                    self.log.write("cannot listen", level="warning", at=self._links.at, why=told)
                time.sleep(LISTEN_S)
            else:
                self.log.write("listening", at=self._links.at)
                return session
        return None

    def _link_again(self) -> None:
        """Open the links anew where the keys were renewed, or one was revoked."""
        if self._wire is None or not self._links.stale:
            return
        self.log.write("the keys were renewed, or one was revoked")
        self._tell_links(up=False)
        self._wire.unlink()
        session = self._session()
        if session is not None:
            self._wire.link(session)
            self._tell_links(up=True)

    def _tell_links(self, *, up: bool) -> None:
        """The session with the others opened, or closed: all tokens come again."""
        for lost_or_back in self._peers.links(up, clock.now()):
            self._happen(lost_or_back)

    def _next_at(self) -> float:
        """The time of the next work that needs no event [unix s]."""
        if self._disk.events:
            return 0.0
        at = self._beat_at
        later = self._later[0][0] if self._later else None
        for other in (self._wake_at, self._peers.look_at, later):
            if other is not None and other < at:
                at = other
        return min(at, self._quiet_at) if self._recorder.pending else at

    def _on_time(self) -> None:
        if self._disk.events:
            return
        now = clock.now()
        if self._quiet_at <= now:
            self._recorder.write()
        for gone in self._peers.gone(now):
            self._changed(gone)
        while self._later and self._later[0][0] <= now:
            self._happen(Local(heapq.heappop(self._later)[2]))
        if self._wake_at is not None and self._wake_at <= now:
            self._happen(Tick())
        if self._beat_at <= now:
            self._beat_at = now + HEARTBEAT_S
            self._link_again()
            self._ping_all()
            for one, still in self._unheard.look(self._state, self._unanswered, self._peers, now):
                fields = {"peer": one.peer, "channel": one.channel, "what": one.what}
                level = "warning" if still else "info"
                why = unheard_text(self.name, one, now) if still else "heard again"
                self.log.write("unheard", level=level, **fields, why=why)
            self._floods.look(self._inbox.dropped, full=self._steps.full)
            self._beat()

    def _close(self) -> None:
        self._step_lock.close()
        self._serving = False
        self._recorder.write()
        self._device.close()
        if self._joining is not None:
            self._joining.close()
        if self._wire is not None:
            self._wire.close()
        self._journal.close()
        self._steps.close()
        ready_file(self._options.run_dir, self.name).unlink(missing_ok=True)
        self.log.write("stopped")
        self.log.close()

    # --- what comes in ----------------------------------------------------------------------------

    def _take(self, item: Any) -> None:
        match item:
            case Bytes():
                self._happen(arrived(item))
            case ReceiptBytes():
                event = receipt(item)
                if isinstance(event, Receipted):
                    self._unheard.receipted(item.peer)
                self._happen(event)
            case OrderBytes(data=data):
                self._happen(ordered(data))
            case Posted(content=content, at=0.0):
                self._happen(Local(content))
            case Posted(content=content, at=at):
                heapq.heappush(self._later, (at, id(item), content))
            case Token():
                for change in self._peers.token(
                    item.agent, item.incarnation, item.alive, clock.now(), item.journal
                ):
                    self._changed(change)
            case Ping():
                self._pinged(item)

    def _changed(self, change: PeerChanged) -> None:
        level = "info" if change.incarnation is not None else "warning"
        peer = change.agent
        self.log.write("peer", level=level, peer=peer, incarnation=change.incarnation or "gone")
        self._ping_all()
        self._happen(change)

    # --- steps ------------------------------------------------------------------------------------

    def _happen(self, event: AnyEvent) -> None:
        """Step, and again while more can be taken. What cannot be recorded waits, and all that
        follows behind it.
        """
        if self._disk.events:
            self._disk.events.append(event)
            return
        following: AnyEvent | None = event
        while following is not None:
            now, before = clock.now(), self._state
            after, out = self._core.begin(before, following, now)
            if out.record is not None:
                try:
                    self._journal.append(out.record)
                except OSError as error:
                    self._disk.failed(self._journal.path, error)
                    self._disk.events.append(following)
                    return
                self._disk.freed()
            if after.journals is not before.journals and self._wire is not None:
                self._wire.knows(after.journals)
            sizes = self._carry_out(out, after)
            effects = self._core.end(before, after, out, now)
            self._state = after
            if effects.deed is not None:
                self._steps_done.append((now, effects.deed))
            self._recorder.note(following, now, after, effects, sizes)
            self._wake_at = effects.wake_at
            if after.settings is not before.settings:
                self._show_level()
            if after.state != before.state or after.soft.answer is not before.soft.answer:
                self._beat()
            following = Next() if effects.more else None
            self._quiet_at = now + QUIET_S
            if after.journal != before.journal:
                hint = "the agent goes on under another name of it"
                raise JournalError(self._journal.path, "its end was lost", hint)
        if self._recorder.full or not self._serving:
            self._recorder.write()

    def _carry_out(self, out: Out, after: CoreState) -> list[int]:
        """Do what comes after the record, in this order; return the bytes of each communicate
        sent.
        """
        assert self._wire is not None
        for one in out.receipts:
            self._wire.send_receipt(one)
        sizes = [self._wire.send(said, *preceding(after, said)) for said in out.sends]
        for content in out.tells:
            self._device.tell(content)
        return sizes

    def _show_level(self) -> None:
        self.log.show(self._state.now_set.level or self._options.log_level)

    # --- readiness and life -----------------------------------------------------------------------

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
            agent=state.agent,
            pid=os.getpid(),
            incarnation=state.incarnation,
            step=state.soft.step,
            state=state.state,
            ready=not self._unanswered,
            up=self._wire is not None and self._wire.at_router,
            peers=dict(self._peers.alive),
            unreceipted={peer: len(sent) for peer, sent in state.outbox.items()},
            due={peer: len(due) for peer, due in state.due.items()},
            counts=state.counts
            | {f"dropped {kind}": count for kind, count in self._inbox.dropped.items()},
            at=clock.now(),
            unheard=self._unheard.now,
            paused=state.paused,
            level=state.now_set.level or self._options.log_level,
            parameters=state.soft.parameters,
            answer=state.soft.answer,
            trouble=self._disk.why or self._recorder.trouble,
        )
        whole = msgspec.structs.replace(beat, inside=looked_into(state, self._steps_done))
        heartbeat.write(self._options.run_dir, whole, beat)
        if self._wire is not None:
            self._wire.publish("state", msgspec.json.encode(beat))


def run(
    agent: Agent[Any],
    wiring: Wiring,
    options: Options,
    device: DeviceMaker | None = None,
    *,
    prepare: Callable[[Shell], None] | None = None,
) -> int:
    """Run an agent until a stop signal; return the exit status. `prepare` sees the shell before it
    serves (tests).

    With `options.replay` it does not serve: its steps are run again, and how that went is printed.
    """
    if options.replay is not None:
        return steplog.tell(agent, wiring, options.replay)
    log = Log(agent.name, options.log_level)
    disk, shell = FullDisk(log), None
    while shell is None:  # made as soon as the disk takes what it writes first
        try:
            shell = Shell(agent, wiring, options, device)
        except OSError as error:
            disk.failed(error.filename or options.run_dir, error)
            time.sleep(disk.pause_s())
        except RuntimeFault as fault:
            log.write("cannot start", level="error", why=str(fault))
            return 1
    if prepare is not None:
        prepare(shell)
    return shell.run()
