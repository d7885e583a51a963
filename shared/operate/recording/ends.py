"""The record of a run as its agents keep it: what each said and heard, from their step logs, in the
order of time.

A communicate is in the log of its receiver, and its sender's log has all of it but the content. So
each is told once, when its receiver took it; one that nobody took is told from its sender's log,
which has the content only where the receiver keeps no log. Two logs that do not agree are told,
too. A reader may begin at any time, end at any time and go on from a cursor: nothing is missed, and
no agent waits for it. Must not know: who reads, the network.
"""

import math
import time
from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import msgspec

from agent_runtime.core.errors import StepLogError
from agent_runtime.core.events import Arrived, Garbled, Receipt, Receipted
from agent_runtime.io import steplog
from agent_runtime.io.steplog import BOOT, SentMessage, checked
from fipa_codec.communicate import UNREADABLE, Communicate, encode
from fipa_codec.errors import FipaError
from operate.file_names import STEPS
from operate.recording.records import (
    RECORDED,
    Garbage,
    House,
    Identity,
    Origin,
    Record,
    Spoken,
    Token,
    Unpaired,
    spoken,
)
from operate.structs import alike
from operate.system import System

# --- Times at which agents heard something, by their own step logs: a latency ends when the asker
# hears the answer Times are those of the agent's clock (agent_runtime.io.logs), which is also that
# of what it says. It is even within a life; of two lives, or of two hosts, clocks may differ. So
# both ends of a span are times of one life of one agent. Must not know: which spans are wanted.


RECEIPT = "receipt"


class HeardReceipt(msgspec.Struct, frozen=True):
    """A receipt of `owner` that came by, for communicates of `peer`."""

    at: float
    owner: str
    peer: str
    receipt: Receipt


class Hearing(msgspec.Struct, frozen=True):
    """Of one agent. `said`: communicate -> when it took it first; `lives`: when each began [unix
    s].
    """

    said: dict[Identity, float]
    lives: tuple[float, ...] = ()

    def after(self, sent: float, at: float | None) -> float | None:
        """Return how long after the agent said something, at `sent`, it heard something, at `at`
        [s].

        None where it did not, or where both times are not of one life.
        """
        if at is None or at < sent or any(sent < began <= at for began in self.lives):
            return None
        return at - sent


def of(records: Iterable[Record]) -> dict[str, Hearing]:
    """Return what each agent heard, and when."""
    said: defaultdict[str, dict[Identity, float]] = defaultdict(dict)
    lives: defaultdict[str, list[float]] = defaultdict(list)
    for one in records:
        match one:
            case Spoken(origin=Origin.RECEIVER):
                said[one.receiver].setdefault(one.identity, one.received)
            case Token(noted=True):
                lives[one.agent].append(one.received)
    return {agent: Hearing(said[agent], tuple(lives[agent])) for agent in {*said, *lives}}


def receipts(houses: Iterable[House]) -> Iterator[HeardReceipt]:
    """Yield the receipts among samples; one that cannot be read is left out."""
    for house in houses:
        if house.kind == RECEIPT:
            try:
                receipt = msgspec.msgpack.decode(house.data, type=Receipt)
            except UNREADABLE:
                continue
            yield HeardReceipt(house.received, house.owner, house.peer, receipt)


# --- The record of a run as its agents keep it ----------------------------------------------------


SETTLED_S = 0.1
"""A step is in its log so long after it was done, if its agent runs: it writes after 5 ms without a
message, and at the latest after 64 steps (agent_runtime.io.steplog). Later ones are told
late, and out of order. Estimate.
"""
LOST_S = 5.0
"""A volatile communicate that nobody took for so long is lost (estimate: a frozen agent goes on
within it).
"""
SURE_S = 1.0
"""An agent that lives so long after something was said in its name has it in its log, if it said it
(estimate).
"""
MOST_AT_ONCE = 5_000
"""Steps read from one log at a time, so that a reader that begins late shows progress (estimate:
0.3 s).
"""
FROZEN_S = 60.0
"""So long something that was said may be taken later; estimate: pauses of a minute are tried."""
STILL_TRIES, STILL_S = 50, 0.01
"""Estimate: an agent writes a batch of steps within a millisecond."""
MOST_SAID = 64
"""Times that an observation is said and compared: every 2 s, a receiver is away for two minutes
(estimate).
"""
REMEMBERED = 50_000
"""Communicates of which only one log is known so far; 20 MB (estimate)."""

T = TypeVar("T")


def ends_now(run: Path) -> dict[str, int]:
    """Return where the logs of a run folder end: a cursor for who wants what is said from now on.

    A log that grows at this moment may end amid a line, so it is looked at until it stands still,
    STILL_TRIES times.
    """
    before: dict[str, int] = {}
    for _ in range(STILL_TRIES):
        found = {path.stem: path.stat().st_size for path in (run / STEPS).glob(f"*.{STEPS}")}
        if found == before:
            break
        before = found
        time.sleep(STILL_S)
    return before


class _Log:
    """One agent's log: what was read and is not told yet, and how far it is complete."""

    def __init__(self, path: Path, at: int) -> None:
        self.agent, self.reader, self.told_until = path.stem, steplog.Reader(path, at), at
        self.waiting: deque[tuple[float, int, steplog.Step]] = deque()
        self.behind = self.broken = False
        self.lives: list[float] = []
        """When each life but the first began [unix s]: the last steps of the one before may be
        missing.
        """
        self.pairs = False
        """Whether its steps tell what they said, which logs of older versions do not."""
        self.alive: list[float] = []
        """Times at which it is known to have lived, no two within SURE_S / 2 [unix s]."""
        self.since = math.inf if at else -math.inf
        """When the first step that was read was done [unix s]; what was said before is not
        known.
        """

    def read(self) -> None:
        """Read what is new, or MOST_AT_ONCE of it; a damaged log is read up to there."""
        count, self.behind = 0, False
        try:
            for step in self.reader.new():
                self.waiting.append((step.at, self.reader.at, step))
                count += 1
                if count >= MOST_AT_ONCE:
                    self.behind = True
                    return
        except (StepLogError, OSError):
            self.broken = True

    def holds(self, identity: Identity, *, said: bool) -> bool:
        """Whether a communicate belongs to a step that waits: it is read, but its clock is ahead of
        the others, so it is not told yet.
        """
        for _, _, step in self.waiting:
            if said:
                some = [one.communicate for one in step.said or ()]
            else:
                some = [_came_in(step)] if step.kind == Arrived.__name__ else []
            if any((one.sender, one.receiver, one.id) == identity for one in some):
                return True
        return False

    def lived(self, at: float) -> None:
        """Note that the agent lived then."""
        place = bisect_left(self.alive, at)
        near = self.alive[max(0, place - 1) : place + 1]
        if all(abs(at - other) > SURE_S / 2 for other in near):
            self.alive.insert(place, at)

    def wrote(self, at: float, until: float) -> bool | None:
        """Whether it wrote all that it did at `at`; None: not known yet, at `until`. False: it died
        afterwards.
        """
        after = bisect_left(self.alive, at + SURE_S)
        if after == len(self.alive) or self.alive[after] > until or self.behind:
            return None
        return at > self.since + SURE_S and not any(
            at - SURE_S < life <= self.alive[after] for life in self.lives
        )

    def until(self, now: float) -> float:
        """The time up to which all of it is read, where the agent has written what it did until
        `now`.
        """
        return self.waiting[-1][0] if self.behind else now


class Ends:
    """Reads all logs of a run folder, again and again."""

    def __init__(
        self,
        run: Path,
        system: System,
        cursor: Mapping[str, int] | None = None,
        *,
        words: bool = True,
    ) -> None:
        """`cursor`: agent -> offset in its log; what is before it was told by another reader.
        `words`: records have their contents in a few words.
        """
        self._words = words
        self._folder, self._system, self._begun = run / STEPS, system, dict(cursor or {})
        self._logs: dict[str, _Log] = {}
        self._alive = defaultdict[str, list[float]](list)
        self._said: dict[Identity, tuple[tuple[SentMessage, ...], float]] = {}
        self._unsaid: dict[Identity, tuple[Communicate, float]] = {}
        self._paired: dict[Identity, frozenset[int]] = {}
        """A hash of each that both logs have: copies of it, whoever makes them, are no other
        words.
        """
        self._rules, self._paired_at, self._told_until = system.design.rules, 0.0, 0.0

    @property
    def cursor(self) -> dict[str, int]:
        """For each agent, the offset in its step log up to which all was told [bytes]."""
        return {agent: log.told_until for agent, log in self._logs.items()}

    @property
    def until(self) -> float:
        """The time [unix s] up to which all that was said is told, unless its receiver takes it
        later.
        """
        open_since = (at for _, at in self._said.values() if at > self._told_until - FROZEN_S)
        return min(self._told_until, min(open_since, default=self._told_until))

    def lived(self, agent: str, at: float) -> None:
        """An agent was heard to be alive at `at` [unix s]."""
        self._alive[agent].append(at)

    def new(self, now: float) -> Iterator[Record]:
        """Yield what is new and certain to be in its place at `now` [unix s]."""
        until = now - SETTLED_S
        for path in sorted(self._folder.glob(f"*.{STEPS}")):
            if path.stem not in self._logs:
                self._logs[path.stem] = _Log(path, self._begun.get(path.stem, 0))
            log = self._logs[path.stem]
            if not log.broken and len(log.waiting) < MOST_AT_ONCE:
                log.read()
            until = min(until, log.until(now - SETTLED_S))
        yield from self._until(until)
        yield from self._unpaired(until)
        self._told_until = until

    def rest(self) -> Iterator[Record]:
        """Yield all that is left: nobody writes any more."""
        behind = True
        while behind:
            yield from self.new(math.inf)
            behind = any(log.behind for log in self._logs.values())
        for identity in list(self._said):
            yield from self._lost(identity)

    def before(self, cursor: Mapping[str, int], alive: Callable[[], None]) -> Iterator[Record]:
        """Yield what another reader told up to these offsets; `new` goes on there. `alive` is
        called meanwhile.
        """
        for agent in cursor:
            self._logs[agent] = _Log(self._folder / f"{agent}.{STEPS}", 0)
        behind = True
        while behind:
            alive()
            behind = False
            for agent, log in self._logs.items():
                if not log.broken and log.reader.at < cursor[agent]:
                    log.read()
                    behind |= log.reader.at < cursor[agent] and not log.broken
            yield from self._until(math.inf, cursor)

    # --- in the order of time ---------------------------------------------------------------------

    def _until(self, until: float, offsets: Mapping[str, int] | None = None) -> Iterator[Record]:
        """Yield what was done until then [unix s], and stands before these offsets."""
        while True:
            heads = [
                log
                for log in self._logs.values()
                if log.waiting
                and log.waiting[0][0] <= until
                and (offsets is None or log.waiting[0][1] <= offsets[log.agent])
            ]
            if not heads:
                return
            log = min(heads, key=lambda one: one.waiting[0][0])
            at, end, step = log.waiting.popleft()
            if at > self._paired_at + SURE_S:
                yield from self._unpaired(at)
            yield from self._of_step(log, step)
            log.told_until = end

    def _of_step(self, log: _Log, step: steplog.Step) -> Iterator[Record]:
        log.lived(step.at)
        log.since = min(log.since, step.at)
        log.pairs |= step.said is not None
        try:
            yield from self._came(log, step)
        except UNREADABLE:
            log.broken = True
        for said in step.said or ():
            yield from self._went(said, step.at)

    def _came(self, log: _Log, step: steplog.Step) -> Iterator[Record]:
        match step.kind:
            case Arrived.__name__:
                one = _came_in(step)
                record = self._arrived(one, step.at, log.agent)
                if record is not None:
                    yield record
                    yield from self._taken(one, step.at)
            case Receipted.__name__:
                came = msgspec.msgpack.decode(step.input, type=Receipted)
                told = msgspec.msgpack.encode(alike(Receipt, came, peer=log.agent))
                yield House(RECEIPT, came.peer, log.agent, step.at, told)
            case Garbled.__name__:
                bad = msgspec.msgpack.decode(step.input, type=Garbled)
                if "/" in bad.key:
                    yield Garbage(bad.key, 0, bad.reason, step.at, b"", log=log.agent)
            case kind if kind == BOOT:
                if log.told_until:
                    log.lives.append(step.at)
                life = steplog.journal_of(step.input)
                yield Token(log.agent, step.incarnation, True, step.at, life, noted=True)

    def _arrived(self, one: Communicate, at: float, agent: str) -> Record | None:
        """The record of a communicate that reached an agent at `at`."""
        try:
            wire = encode(one)
            return spoken(one, wire, at, self._system, Origin.RECEIVER, words=self._words)
        except LookupError as error:
            return Garbage(_key(one, self._system), len(wire), str(error), at, wire, log=agent)
        except FipaError:
            return None

    # --- two logs of one communicate --------------------------------------------------------------

    def _went(self, said: SentMessage, at: float) -> Iterator[Record]:
        one = said.communicate
        identity = one.sender, one.receiver, one.id
        # it keeps no log, so the sender's has the content
        if one.receiver not in self._system.design.agents:
            yield from self._by_sender(said, at)
            return
        came = self._unsaid.pop(identity, None)
        if came is None:
            # An observation is said again with the time of then, and a receiver that was held up
            # takes the first one.
            earlier, _ = self._said.get(identity, ((), at))
            _remember(self._said, identity, ((*earlier[1 - MOST_SAID :], said), at))
        else:
            yield from self._compared((said,), *came)

    def _taken(self, one: Communicate, at: float) -> Iterator[Record]:
        identity = one.sender, one.receiver, one.id
        said = self._said.pop(identity, None)
        if said is not None:
            yield from self._compared(said[0], one, at)
        elif hash(checked(one)) not in self._paired.get(identity, ()):
            _remember(self._unsaid, identity, (one, at))

    def _compared(
        self, said: tuple[SentMessage, ...], came: Communicate, at: float
    ) -> Iterator[Unpaired]:
        """Yield that what came is none of what was said; remember all of it, to know later
        copies.
        """
        took, all_said = checked(came), [(one.communicate, one.check) for one in said]
        identity = came.sender, came.receiver, came.id
        _remember(self._paired, identity, frozenset(map(hash, (took, *all_said))))
        if took not in all_said:
            why = (
                f"{came.receiver} took other words than {came.sender} said under the id"
                f" {came.id!r}: their logs differ"
            )
            yield _unpaired(came, at, why, altered=True)

    def _unpaired(self, until: float) -> Iterator[Record]:
        """Yield what only one of two logs has, where that is certain; all until this time was
        told.
        """
        self._paired_at = until
        for agent, times in self._alive.items():
            while times and agent in self._logs:
                self._logs[agent].lived(times.pop())
        for identity, (one, at) in list(self._unsaid.items()):
            wrote = self._wrote(identity, at, until)
            if wrote is not None:
                del self._unsaid[identity]
            if wrote:
                yield _not_sent(one, at)
        for identity, ((*_, said), at) in list(self._said.items()):
            if until < at + LOST_S or self._is_kept(said.communicate):
                continue
            log = self._logs.get(identity[1])
            # its receiver may have taken it by a clock that is ahead
            if log is None or not log.holds(identity, said=False):
                yield from self._lost(identity)
        if not self._unsaid and until < math.inf:
            for log in self._logs.values():
                del log.alive[: bisect_left(log.alive, until)]

    def _wrote(self, identity: Identity, at: float, until: float) -> bool | None:
        """Whether its sender, which lived on, has not said what was taken at `at`; None: not known
        yet.
        """
        log = self._logs.get(identity[0])
        if log is None or not log.pairs or log.broken:
            return False if until >= at + LOST_S else None
        return None if log.holds(identity, said=True) else log.wrote(at, until)

    def _is_kept(self, one: Communicate) -> bool:
        """Whether its sender says it again until it is taken."""
        rule = self._rules.get((one.sender, one.receiver, one.protocol, one.performative))
        return rule is not None and (rule.durable or rule.latest)

    def _lost(self, identity: Identity) -> Iterator[Record]:
        (*_, said), at = self._said.pop(identity)
        yield from self._by_sender(said, at)

    def _by_sender(self, said: SentMessage, at: float) -> Iterator[Record]:
        """The record of a communicate that only its sender's log has; none of one that the design
        has not.
        """
        try:
            wire = encode(said.communicate)
            one = said.communicate
            record = spoken(one, wire, at, self._system, Origin.SENDER, words=self._words)
        except (LookupError, FipaError):
            return
        yield record.sized(said.size)


def _came_in(step: steplog.Step) -> Communicate:
    return msgspec.msgpack.decode(step.input, type=Arrived).communicate


def _remember(some: dict[Identity, T], identity: Identity, what: T) -> None:
    """Remember a communicate, and forget the oldest one where there are too many."""
    some[identity] = what
    if len(some) > REMEMBERED:
        del some[next(iter(some))]


def _not_sent(came: Communicate, at: float) -> Unpaired:
    why = (
        f"{came.receiver} took it, and the log of {came.sender} does not have it: somebody else"
        " said it in its name"
    )
    return _unpaired(came, at, why, altered=False)


def _unpaired(one: Communicate, at: float, why: str, *, altered: bool) -> Unpaired:
    return alike(
        Unpaired, one, performative=str(one.performative), altered=altered, why=why, received=at
    )


def _key(one: Communicate, system: System) -> str:
    """The key of a communicate that the design does not have, on no channel of it."""
    names = ("sender", "receiver", "protocol", "performative")
    told = {name: str(getattr(one, name)) for name in names}
    return system.design.file.system.key.format(system=RECORDED, channel="unknown", **told)
