"""The moment at which a fault begins: after some seconds, in a state of an agent, at the Nth
message, at a line told.

Pure but for `wait`, which hears the fleet through a tap. States are those that agents tell in their
heartbeats.
"""

import re
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample
from console.errors import FleetError, UsageError
from console.fleet import targets
from console.fleet.process_status import Beat
from console.terminal.run_state import Follow
from console.traffic import listen
from fipa_codec.communicate import UNREADABLE
from operate.live_lines import Happened, LiveLine, PlanAt
from topdown.model.design import Design

SECONDS = re.compile(r"(\d+(?:\.\d+)?)s?")
TIME = re.compile(r"@(\d+(?:\.\d+)?)")
MESSAGE = re.compile(r"(\d+)(?:st|nd|rd|th)?-message")
EVENT, PLAN = "event:", "plan:"
FORMS = (
    "seconds (2.5), a time (@UNIX), a state (STATE or AGENT:STATE), the Nth message (3rd-message),"
    f" an event of the run ({EVENT}NAME), or a step of the plan ({PLAN}STEP or {PLAN}STEP/ACT)"
)
LOOK_S = 0.02


class After(msgspec.Struct, frozen=True):
    """So many seconds from now."""

    seconds: float = 0.0


class Until(msgspec.Struct, frozen=True):
    """At this time [unix s]."""

    at: float


class InState(msgspec.Struct, frozen=True):
    """As soon as an agent tells that it is in this state."""

    agent: str
    state: str


class Message(msgspec.Struct, frozen=True):
    """With the Nth communicate, counted from now; `agent`: to or from it, "": any."""

    count: int
    agent: str = ""


class Event(msgspec.Struct, frozen=True):
    """As soon as the run tells an event of this name, `of` these things or numbers (`events` of
    report.json).

    The first of them are enough. Only what is told from now on counts.
    """

    name: str
    of: tuple[str, ...] = ()

    def there(self, line: LiveLine) -> bool:
        """Whether a line of live.jsonl tells it."""
        if not isinstance(line, Happened) or line.name != self.name:
            return False
        return line.of[: len(self.of)] == self.of


class InPlan(msgspec.Struct, frozen=True):
    """As soon as the plan is in a step that does this, with these things, and in this act of it
    ("": any).
    """

    does: str
    things: tuple[str, ...] = ()
    act: str = ""

    def there(self, line: LiveLine) -> bool:
        """Whether a line of live.jsonl tells it."""
        if not isinstance(line, PlanAt) or line.at is None or line.outcome:
            return False
        at = line.at
        does = at.does == self.does and at.things[: len(self.things)] == self.things
        return does and self.act in ("", at.act)


Moment = After | Until | InState | Message | Event | InPlan


def parse(text: str, design: Design, target: str) -> Moment:
    """Read a moment, for a fault of this process. Raise UsageError with the forms, or the states
    that there are.
    """
    if found := SECONDS.fullmatch(text or "0"):
        return After(float(found[1]))
    if found := TIME.fullmatch(text):
        return Until(float(found[1]))
    if found := MESSAGE.fullmatch(text):
        if int(found[1]) < 1:
            raise UsageError(f"{text!r}: messages are counted from 1; write 1st-message")
        return Message(int(found[1]), target if target in design.agents else "")
    kind, _, name = text.partition(":")
    if text.startswith((EVENT, PLAN)) and kind not in design.agents:
        if not name.strip():
            raise UsageError(f"{text!r} names nothing; give {FORMS}")
        event = text.startswith(EVENT)
        step, _, act = (name, "", "") if event else name.partition("/")
        first, *things = step.split() or [""]
        if not first:
            raise UsageError(f"{text!r} names no step; give {FORMS}")
        return Event(first, tuple(things)) if event else InPlan(first, tuple(things), act)
    agent, _, state = text.rpartition(":")
    return InState(_whose(agent, state, text, design, target), state)


def _whose(agent: str, state: str, text: str, design: Design, target: str) -> str:
    """Return the agent whose state is meant: the one named, else the fault's own, else the only one
    that has it.
    """
    states = {name: [one.name for one in entry.state] for name, entry in design.agents.items()}
    if agent and agent not in states:
        raise UsageError(f"{text!r}: the design has no agent {agent!r}; it has {', '.join(states)}")
    if agent and state not in states[agent]:
        there = f"it has {', '.join(states[agent])}"
        raise UsageError(f"{text!r}: {agent} has no state {state!r}; {there}")
    having = [name for name, own in states.items() if state in own and agent in ("", name)]
    if not having:
        none = "is no moment, and no agent has a state of that name"
        raise UsageError(f"{text!r} {none}; give {FORMS}")
    if target not in having and len(having) > 1:
        names = ", ".join(f"{name}:{state}" for name in having)
        raise UsageError(f"{text!r} is a state of several; name one: {names}")
    return target if target in having else having[0]


def counter(moment: InState | Message) -> Callable[[Sample], bool]:
    """Return what says of each sample, in order, whether the moment is there."""
    left = moment.count if isinstance(moment, Message) else 0

    def there(sample: Sample) -> bool:
        nonlocal left
        if isinstance(moment, InState):
            return _tells(sample, moment)
        one = listen.heard_message(sample)
        if one is not None and moment.agent in ("", one.sender, one.receiver):
            left -= 1
        return left <= 0

    return there


def _tells(sample: Sample, moment: InState) -> bool:
    """Whether a sample is a heartbeat that tells this state."""
    chunks = sample.key.split("/")
    if sample.token or chunks[2:5] != [listen.HOUSE, "state", moment.agent]:
        return False
    try:
        return msgspec.json.decode(sample.data, type=Beat).state == moment.state
    except UNREADABLE:
        return False


def wait(moment: Moment, within_s: float, target: str, run_dir: Path | None) -> None:
    """Come back at the moment. Raise FleetError where it does not come within `within_s`."""
    if isinstance(moment, After):
        time.sleep(moment.seconds)
        return
    if isinstance(moment, Until):
        time.sleep(max(0.0, moment.at - time.time()))
        return
    late = f"{moment_text(moment)} was not there within {within_s:g} s; nothing was done (--within)"
    until = time.monotonic() + within_s
    if isinstance(moment, Event | InPlan):
        follow = Follow(targets.find(target, run_dir).live)
        follow.new()
        while not any(moment.there(line) for line in follow.new()):
            if time.monotonic() > until:
                raise FleetError(late)
            time.sleep(LOOK_S)
        return
    there = counter(moment)
    with listen.source(None, run_dir, target) as heard:
        for sample in heard.samples():
            if sample is not None and there(sample):
                return
            if time.monotonic() > until:
                raise FleetError(late)


def moment_text(moment: Moment) -> str:
    """Return a moment as it is told; "" for at once."""
    match moment:
        case After(seconds=seconds):
            return f"{seconds:g} s" if seconds else ""
        case Until(at=at):
            return f"{datetime.fromtimestamp(at):%H:%M:%S.%f}"[:-4]
        case InState(agent=agent, state=state):
            return f"{agent}:{state}"
        case Event(name=name, of=of):
            return repr(" ".join((name, *of)))
        case InPlan(does=does, things=things, act=act):
            return repr(" ".join((does, *things)) + (f"/{act}" if act else ""))
        case Message(count=count, agent=agent):
            return f"message {count}{f' of {agent}' if agent else ''}"
