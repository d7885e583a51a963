"""What ROS is told of a system: messages of what happens in it, while it runs or of a recording.

One mapping for all that takes them: a rosbag2, Foxglove, ROS over Zenoh. docs/ros.md says what is
on each topic. Times are those at which things were heard. Must not know: where messages go, what a
robot is.
"""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Protocol

import msgspec

from agent_runtime.io.tap import Sample
from fipa_codec.communicate import UNREADABLE
from operate.judging.judged import Judging
from operate.recording.happenings import Happening, Reader
from operate.recording.history import Entered
from operate.recording.records import Identity, Spoken, understood
from operate.ros.messages import (
    COMMUNICATE,
    DIAGNOSTICS,
    ERROR,
    LOG,
    LOG_LEVELS,
    OK,
    Entry,
    Topic,
    diagnosis,
    diagnostics,
    message,
    stamp,
)
from operate.system import System
from operate.verdict_lines import Judged
from topdown.judge.verdicts import Verdict

BEAT_S = 1.0
"""Between two diagnoses of what does not change; viewers take one for stale after 5 s."""


class More(Protocol):
    """What a system adds (operate.system.Additions.ros). `topics`: those that it may tell on.

    `services`: name of a std_srvs/Trigger -> what it does with a console.fleet.targets.Target, and
    gives in words. It may raise ConsoleError, OSError.
    """

    topics: tuple[Topic, ...]
    services: dict[str, Callable[[Any], str]]

    def take(self, happening: Happening) -> Iterator[Entry]:
        """Yield what is told of it."""


class Telling:
    """Takes what happens in the order of time; remembers what has to be told again."""

    def __init__(self, system: System, verdict: Callable[[Identity], Judged | None]) -> None:
        """`verdict`: what the judge says of a communicate, as far as it is known when that is
        told.
        """
        more = system.addition("ros")
        self._more: More | None = more() if more is not None else None
        self._system, self._verdict = system.name, verdict
        said = (Topic(_said_on(name), COMMUNICATE) for name in system.design.channels)
        of_any = (*said, Topic("/diagnostics", DIAGNOSTICS), Topic("/rosout", LOG))
        self.topics = (*of_any, *(self._more.topics if self._more is not None else ()))
        """Those that may come: who is to get the first message of one must know of it before."""
        self.services = self._more.services if self._more is not None else {}
        self._states: dict[str, Any] = {}
        self._beat = math.inf

    def take(self, happening: Happening) -> Iterator[Entry]:
        """Yield what is told of it."""
        at = happening.at
        yield from self.pass_time(at)
        match happening.what:
            case Spoken() as one:
                yield self._communicate(one)
            case Judged(violation=True) as one:
                said = f"{one.sender} > {one.receiver} {one.performative} {one.text}"
                yield logged(at, "judge", "error", f"{one.verdict}: {said}: {one.why}")
            case Entered() as one:
                self._beat = min(self._beat, at + BEAT_S)
                self._states[one.agent] = told = _diagnosis(one, self._system)
                yield diagnostics(at, told)
        if self._more is not None:
            yield from self._more.take(happening)

    def pass_time(self, now: float) -> Iterator[Entry]:
        """It is `now` [unix s]: each second the states of all agents are told."""
        while self._beat < now:
            yield diagnostics(self._beat, *self._states.values())
            self._beat += BEAT_S

    def _communicate(self, one: Spoken) -> Entry:
        words = _words(one)
        if (verdict := self._verdict(one.identity)) is not None:
            words |= {"verdict": str(verdict.verdict), "why": verdict.why}
        times = {"sent": stamp(one.sent), "received": stamp(one.received)}
        told = message(COMMUNICATE, **times, **words)
        return Entry(one.received, _said_on(one.channel), COMMUNICATE, told)


def _said_on(channel: str) -> str:
    name = re.sub(r"\W", "_", channel or "other", flags=re.ASCII)
    return f"/communicates/{name}"


def _diagnosis(one: Entered, system: str) -> Any:
    text = one.state if one.alive else f"gone; its last state was {one.state or 'not told'}"
    return diagnosis(f"agents/{one.agent}", OK if one.alive else ERROR, text, system)


def _words(one: Spoken) -> dict[str, Any]:
    said = one.communicate
    content = ""
    if said.content is not msgspec.UNSET:
        with suppress(*UNREADABLE):
            content = msgspec.json.encode(msgspec.msgpack.decode(said.content)).decode()
    same = ("sender", "receiver", "protocol", "language", "ontology", "reply_with", "in_reply_to")
    return {
        **{name: getattr(said, name) for name in same},
        "performative": str(one.performative),
        "conversation_id": one.conversation,
        "reply_by": stamp(said.reply_by or 0.0),
        "content": content,
        "id": one.id,
        "channel": one.channel,
        "size": one.size,
        "text": one.text,
        "verdict": "",
        "why": "",
    }


def logged(at: float, name: str, level: str, text: str) -> Entry:
    """Return a line of a log, on /rosout."""
    words = {"name": name, "msg": text, "file": "", "function": "", "line": 0}
    told = message(LOG, stamp=stamp(at), level=LOG_LEVELS.get(level, LOG_LEVELS["info"]), **words)
    return Entry(at, "/rosout", LOG, told)


class Live:
    """Takes samples of a running system as they are heard."""

    def __init__(self, system: System) -> None:
        self._system, self._judging, self._reader = system, Judging(system), Reader(system)
        self._now: dict[Identity, Judged] = {}
        self._telling = Telling(system, self._now.get)
        self.topics, self.services = self._telling.topics, self._telling.services

    def take(self, sample: Sample) -> Iterator[Entry]:
        """Yield what is told of it; of what was said again nothing."""
        record = understood(sample, self._system)
        judged = tuple(self._judging.lines(record))
        self._now.clear()
        self._now.update({(one.sender, one.receiver, one.id): one for one in judged})
        again = isinstance(record, Spoken) and any(
            one.verdict == Verdict.COPY for one in judged if one.t == record.received
        )
        for happening in () if again else self._reader.read(record):
            yield from self._telling.take(happening)
        for one in judged:
            yield from self._telling.take(Happening(one.t, one))

    def pass_time(self, now: float) -> Iterator[Entry]:
        """It is `now` [unix s]: what is told again, and what the judge waited for in vain."""
        for one in self._judging.pass_time(now):
            yield from self._telling.take(Happening(one.t, one))
        yield from self._telling.pass_time(now)
