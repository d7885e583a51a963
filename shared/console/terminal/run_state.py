"""Picture of a running run: lines of live.jsonl folded into one state.

Pure but for `of_file`, which reads one. Lines of kinds or with fields of a later version are left
out.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import msgspec

from operate import wording
from operate.live_lines import (
    Against,
    AgentIn,
    Happened,
    LiveLine,
    PlanAt,
    PlanSeen,
    Sent,
    Step,
    Task,
)
from operate.system import System

Names = tuple[str, ...]
LATEST_EVENTS = 20  # the picture shows as many of them as there is room for
_decoder: msgspec.json.Decoder[LiveLine] = msgspec.json.Decoder(LiveLine)


class Seen(msgspec.Struct, frozen=True):
    """An agent: its state, whether its token is there; `t`: when it said so [unix s]."""

    state: str
    alive: bool = True
    t: float = 0.0


class Counted(msgspec.Struct, frozen=True):
    """A channel: how many communicates went by, their bytes in all, the last one in words."""

    count: int = 0
    bytes: int = 0
    last: str = ""


class Plan(msgspec.Struct, frozen=True):
    """A plan: its states in the tree's order, the present one, the paths of those passed, how it
    ended.
    """

    id: str
    tasks: tuple[Task, ...]
    states: tuple[Step, ...]
    at: Step | None = None
    passed: frozenset[Names] = frozenset()
    outcome: str = ""


class Event(msgspec.Struct, frozen=True):
    """Something worth a line: what happened, to what, and why; `t`: unix time [s]."""

    t: float
    name: str
    of: tuple[str, ...] = ()
    text: str = ""


class View(msgspec.Struct, frozen=True):
    """The picture. `sent`: communicates by sender."""

    agents: dict[str, Seen] = {}
    sent: dict[str, int] = {}
    channels: dict[str, Counted] = {}
    plan: Plan | None = None
    plans: int = 0
    events: tuple[Event, ...] = ()

    def with_event(self, event: Event) -> "View":
        """The same with one more event; the oldest ones are dropped."""
        return msgspec.structs.replace(self, events=(*self.events, event)[-LATEST_EVENTS:])


def fold(view: View, line: LiveLine) -> View:
    """The picture after one more line."""
    replaced = partial(msgspec.structs.replace, view)
    match line:
        case Sent(channel=channel, performative=performative, sender=sender, receiver=receiver):
            before = view.channels.get(channel, Counted())
            words = f"{sender} > {receiver}  {line.text or performative}"
            counted = Counted(before.count + 1, before.bytes + line.bytes, words)
            sent = {**view.sent, sender: view.sent.get(sender, 0) + 1}
            return replaced(sent=sent, channels={**view.channels, channel: counted})
        case AgentIn(agent=agent, state=state, alive=alive, t=t):
            return replaced(agents={**view.agents, agent: Seen(state, alive, t)})
        case PlanSeen(plan=plan, tasks=tasks, states=states):
            return replaced(plan=Plan(plan, tasks, states), plans=view.plans + 1)
        case PlanAt(at=at, outcome=outcome) if view.plan is not None:
            return replaced(plan=_moved(view.plan, at, outcome))
        case Happened(t=t, name=name, of=of, text=text):
            return view.with_event(Event(t, name, of, text))
        case Against(t=t, verdict=verdict):
            return view.with_event(Event(t, verdict, text=against(line)))
        case _:
            return view


def leaves(states: tuple[Step, ...]) -> list[Step]:
    """The states of a plan that are not machines: its steps."""
    return [one for one in states if not any(within(other.path, one.path) for other in states)]


def within(path: Names, machine: Names) -> bool:
    """Tell whether a path stands inside a machine."""
    return len(path) > len(machine) and path[: len(machine)] == machine


def tasks(some: tuple[Task, ...], system: System) -> str:
    """Return what a plan is for."""
    return ", then ".join(wording.task(one, system.plain) for one in some) or "plan"


def in_words(line: LiveLine, system: System) -> str:
    """The line for a log without pictures, in the system's words; "" for what is only counted or
    told elsewhere.
    """
    match line:
        case PlanSeen(tasks=some, states=states):
            return f"plan received: {tasks(some, system)}, in {len(leaves(states))} steps"
        case PlanAt(at=at, outcome="") if at is not None:
            does = system.step(at)  # the last state of a plan does nothing
            return f"  {does}" if does else ""
        case Happened(name=name, of=of, text=text, again=False):
            what = system.happened(name, of)
            return f"{what}: {text}" if text else what
        case AgentIn(agent=agent, alive=False):
            return f"{agent}: gone"
        case Against(verdict=verdict):
            return f"not as designed, {verdict}: {against(line)}"
        case _:
            return ""


def against(line: Against) -> str:
    """Return what deviates from the design, and the reason."""
    what = f"{line.sender} > {line.receiver} {line.performative}: " if line.sender else ""
    return f"{what}{line.why}"


def _moved(plan: Plan, at: Step | None, outcome: str) -> Plan:
    """The plan with another present state; the state before it counts as passed."""
    left = plan.at is not None and (outcome or at is None or plan.at.path != at.path)
    passed = plan.passed | {plan.at.path} if left and plan.at is not None else plan.passed
    return msgspec.structs.replace(plan, at=None if outcome else at, passed=passed, outcome=outcome)


def of_file(path: Path) -> Callable[[int], bytes]:
    """Reads a live file from a byte on; nothing where it is not there yet."""

    def read(offset: int) -> bytes:
        try:
            with path.open("rb") as file:
                file.seek(offset)
                return file.read()
        except FileNotFoundError:
            return b""

    return read


class Follow:
    """Takes what is new of a live file, wherever `read` reads it; a line not whole yet waits for
    the next look.
    """

    def __init__(self, read: Callable[[int], bytes]) -> None:
        self._read = read
        self._offset = 0

    def new(self) -> list[LiveLine]:
        """The lines written since the last look."""
        data = self._read(self._offset)
        whole = data[: data.rfind(b"\n") + 1]
        self._offset += len(whole)
        found: list[LiveLine] = []
        for raw in whole.splitlines():
            with suppress(msgspec.DecodeError):
                found.append(_decoder.decode(raw))
        return found
