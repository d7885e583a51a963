"""The kinds of faults, a row each: what is done to a process, how one sees that it is over, how it
is healed, and what `roco fault KIND` may be told.
"""

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from itertools import count
from pathlib import Path

import msgspec

from agent_runtime.core.control import Command, SetLevel
from console.errors import FleetError, UsageError
from console.fleet import operator
from console.fleet.identity import OPERATOR
from console.fleet.process_status import Seen
from console.fleet.targets import Put, Target
from console.traffic import listen
from operate.fault_lines import Fault
from operate.fleet_file import ProcessState

# --- A flood: well-formed data of one identity of the fleet to one agent, at a fixed rate, while
# its command lives The operator's is orders to set the log level that the agent has, each with an
# id of its own. An agent's is copies of the next communicate that it says, as of a sender that
# takes no receipt: the receiver must tell them from new ones.


TICK_S = 0.01
"""Between two bursts; estimate: even enough."""
HEARD_S = 30.0
"""Time to wait for the next communicate of an agent [s]; estimate."""
Next = Callable[[], tuple[str, bytes]]


@contextlib.contextmanager
def going_on(fleet: Target, fault: Fault) -> Iterator[None]:
    """Flood as long as this lasts. Raise UsageError: nobody may say that; FleetError: there is
    nothing to copy.
    """
    speaker, over = fault.speaker or OPERATOR, threading.Event()
    for agent in {fault.target, speaker} - {OPERATOR}:
        operator.agent_of(fleet, agent)
    with fleet.speaking(speaker, fault.target) as put:
        following = _orders(fleet, fault) if speaker == OPERATOR else _copies(fleet, fault)
        flooding = threading.Thread(
            target=_flood, args=(put, following, fault.amount, over), daemon=True
        )
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
    name = told.system if told else fleet.system.name
    key = operator.key(fleet.system.design, name, fault.target)
    order, numbers = SetLevel((beat and beat.level) or "info"), count(1)
    return lambda: (key, msgspec.msgpack.encode(Command(f"{fault.id}-{next(numbers)}", order)))


def _copies(fleet: Target, fault: Fault) -> Next:
    """Return what gives the next communicate of the speaker to the agent, again and again."""
    peers = fleet.system.design.peers(fault.speaker)
    if fault.target not in peers:
        raise UsageError(
            f"{fault.speaker} says nothing to {fault.target}; it talks with {', '.join(peers)}"
        )
    until = time.monotonic() + HEARD_S
    with listen.source(None, Path(fleet.where)) as heard:
        for sample in heard.samples():
            one = listen.heard_message(sample) if sample is not None else None
            if one is not None and (one.sender, one.receiver) == (fault.speaker, fault.target):
                copied = one.key, one.data
                return lambda: copied
            if time.monotonic() > until:
                break
    raise FleetError(
        f"{fault.speaker} said nothing to {fault.target} within {HEARD_S:g} s; nothing was done"
    )


# --- The kinds of faults, a row each --------------------------------------------------------------


BACK = "back"
KEPT_DOWN = "down"
"""A kill whose process is kept down for a time."""


class Amount(msgspec.Struct, frozen=True):
    """Size of a fault: an argument of the verb, or an option with a default. `tried`: values chaos
    chooses from.
    """

    metavar: str
    text: str
    tried: tuple[float, float]
    least: float | None = None
    most: float | None = None
    option: str = ""
    default: float | None = None


class Kind(msgspec.Struct, frozen=True):
    """`begin`: do it; `heal`: undo it, also where there is nothing to undo; `over`: why it has
    ended without that, "" while it goes on; `meanwhile`: lasts as long as it does.

    `for_s`: it is healed after that time; None: it has no --for and is over once the process is
    back. `timed`: the kind that is done where --for is given. `amount`: None where it has none.
    `speaker`: whether somebody speaks (--as). `agents`: only agents can be hit; `wire`: only those
    with a wire, or all to a router.
    """

    begin: Callable[[Target, Fault], None]
    over: Callable[[Seen | None, Fault], str]
    heal: Callable[[Target, Fault], None]
    for_s: float | None
    meanwhile: Callable[[Target, Fault], AbstractContextManager[None]] = lambda fleet, fault: (
        nullcontext()
    )
    timed: str = ""
    amount: Amount | None = None
    speaker: bool = False
    agents: bool = False
    wire: bool = False

    @property
    def lasts(self) -> bool:
        """Whether it is healed after its time; else it is over once the process is back."""
        return self.for_s is not None and not self.timed


def same(seen: Seen | None, fault: Fault) -> bool:
    """Whether this is the process that was hit, and it lives."""
    if seen is None or seen.used is None:
        return False
    return (seen.status.pid, seen.used.start) == (fault.pid, fault.start)


def back(seen: Seen | None, fault: Fault) -> bool:
    """Whether another process has taken the place of the one that was hit, lives, and is ready."""
    lives = seen is not None and seen.used is not None and seen.status.state is ProcessState.READY
    return lives and not same(seen, fault)


def now(fleet: Target, fault: Fault) -> Seen | None:
    """Return the process of that name as it is now."""
    return next((one for one in fleet.look().seen if one.name == fault.target), None)


def _sends(number: signal.Signals) -> Callable[[Target, Fault], None]:
    return lambda fleet, fault: fleet.signal(fault.target, number)


def _stopped(fleet: Target, fault: Fault) -> None:
    """Stop it, and see it stopped: a busy machine does not do so at once, and one that runs counts
    as continued.
    """
    fleet.signal(fault.target, signal.SIGSTOP)
    until = time.monotonic() + STOPPED_S
    while (
        same(seen := now(fleet, fault), fault) and not _is_frozen(seen) and time.monotonic() < until
    ):
        time.sleep(PERIOD_S)


def _is_frozen(seen: Seen | None) -> bool:
    return seen is not None and seen.used is not None and seen.used.frozen


def _killed(fleet: Target, fault: Fault) -> None:
    """Kill it, and let nobody start it again."""
    fleet.signal(fault.target, signal.SIGKILL)
    fleet.switch(fault.target, False)


def _if_same(heal: Callable[[Target, Fault], None]) -> Callable[[Target, Fault], None]:
    """Do it to the process that was hit, while it lives."""
    return lambda fleet, fault: heal(fleet, fault) if same(now(fleet, fault), fault) else None


def _nothing(fleet: Target, fault: Fault) -> None:
    """Do nothing: the supervisor restarts the process, or the fault's own command ended it."""


def _frozen_over(seen: Seen | None, fault: Fault) -> str:
    if not same(seen, fault):
        return "ended by another"
    return "" if _is_frozen(seen) else "continued by another"


def _back_over(seen: Seen | None, fault: Fault) -> str:
    return BACK if back(seen, fault) else ""


def _never_over(seen: Seen | None, fault: Fault) -> str:
    return ""


def _frozen(for_s: float) -> Kind:
    return Kind(_stopped, _frozen_over, _if_same(_sends(signal.SIGCONT)), for_s)


def _wired(kind: str, amount: Amount | None = None) -> Kind:
    """Return a fault of the wires of an agent, or of one link."""
    return Kind(
        lambda fleet, fault: fleet.wire(fault.wire, kind, fault.amount or 1.0),
        _never_over,
        lambda fleet, fault: fleet.wire(fault.wire, kind, None),
        WIRE_S,
        amount=amount,
        agents=True,
        wire=True,
    )


STOPPED_S, PERIOD_S = 10.0, 0.01
"""Time that a signal may need, and between two looks; estimates."""
HANG_S, PAUSE_S = 60.0, 1.0
"""Estimates: whoever looks after a hung process has ended it by then; a pause shorter than that is
not seen.
"""
WIRE_S = 5.0
"""Estimate: longer than the lease of a session (2 s), so that the others notice a cut."""
MORE_S = 5.0
"""Of a full disk, a flood, a stepped clock; estimate: some heartbeats and rounds of sending
again.
"""
SHARE = Amount("SHARE", "Of the pieces, up to 1.", (0.02, 0.2), 0.0001, 1.0)
KINDS = {
    "kill": Kind(_sends(signal.SIGKILL), _back_over, _nothing, 0.0, timed=KEPT_DOWN),
    KEPT_DOWN: Kind(
        _killed, _never_over, lambda fleet, fault: fleet.switch(fault.target, True), 0.0
    ),
    "restart": Kind(_sends(signal.SIGTERM), _back_over, _nothing, None),
    "hang": _frozen(HANG_S),
    "pause": _frozen(PAUSE_S),
    "cut": _wired("cut"),
    "delay": _wired("delay", Amount("SECONDS", "Added to each way [s].", (0.05, 0.5), 0.001, 60.0)),
    "loss": _wired("loss", SHARE),
    "rate": _wired("rate", Amount("BYTES", "Bytes per second, each way.", (5e3, 5e4), 100.0)),
    "corrupt": _wired("corrupt", SHARE),
    "disk-full": Kind(
        lambda fleet, fault: fleet.writing(fault.target, False),
        lambda seen, fault: "" if same(seen, fault) else "it ended",
        _if_same(lambda fleet, fault: fleet.writing(fault.target, True)),
        MORE_S,
    ),
    "flood": Kind(
        _nothing,
        _never_over,
        _nothing,
        MORE_S,
        going_on,
        amount=Amount(
            "N", "So many a second.", (100.0, 2000.0), 1.0, option="--per-second", default=500.0
        ),
        speaker=True,
        agents=True,
    ),
    "clock": Kind(
        lambda fleet, fault: fleet.clock(fault.target, fault.amount),
        _never_over,
        lambda fleet, fault: fleet.clock(fault.target, 0.0),
        MORE_S,
        amount=Amount("SECONDS", "Forward, or below 0 back.", (-3600.0, 3600.0)),
        agents=True,
    ),
}
"""By the name that faults.jsonl has."""
VERBS = tuple(kind for kind in KINDS if kind != KEPT_DOWN)
"""Verbs of `roco fault` that do one."""
AMOUNTS = tuple(
    name for name, kind in KINDS.items() if kind.amount is not None and not kind.amount.option
)
"""Those that need an amount."""
UNTIMED = tuple(name for name, kind in KINDS.items() if kind.for_s is None)
"""Those without --for."""
