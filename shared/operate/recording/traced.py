"""The trace of a run: messages from its recording, causes from the step logs of its agents.

What a step said has the step's time as `sent`, so that a log tells of each communicate by which
step it was said. Must not know: how a trace is shown.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

from agent_runtime.core.errors import StepLogError
from agent_runtime.core.events import Arrived, Deed
from agent_runtime.io import steplog
from fipa_codec.communicate import UNREADABLE, Communicate
from operate.fault_lines import Fault
from operate.recording.history import History
from operate.recording.records import Record, Spoken, Token
from operate.structs import alike
from operate.system import System
from operate.tracing.trace import Away, Identity, Message, Step, Talk, Trace, spans
from operate.verdict_lines import Judged, ended, sides

LONGEST_S = 60.0
"""From a fault to the return of its agent; estimate: it is started again in seconds, at worst in a
minute.
"""


def of(records: Iterable[Record], past: History, logs: Iterable[Path], system: System) -> Trace:
    """Return the trace of a run; `logs`: the step logs of its agents."""
    said = [_message(one, system) for one in past.said]
    steps = [step for log in logs for step in _steps(log, said, system)]
    return Trace(
        system=system.name,
        begin=past.begin,
        spans=spans(list(_talks(said, past.judged, system)), steps),
        away=tuple(_away(records, past.faults)),
    )


def _message(one: Spoken, system: System) -> Message:
    text, reason = system.about(one.content), system.why(one.content)
    return alike(Message, one, heard=one.received, text=text, reason=reason)


# --- conversations --------------------------------------------------------------------------------


def _talks(said: list[Message], judged: tuple[Judged, ...], system: System) -> Iterator[Talk]:
    """Yield what was said as conversations of two agents each."""
    known = [one for one in judged if one.initiator]
    states = {_pair(one.conversation, one.protocol, one.sender, one.receiver): one for one in known}
    grouped: defaultdict[tuple[str, str, frozenset[str]], list[Message]] = defaultdict(list)
    for one in said:
        grouped[_pair(one.conversation, one.protocol, one.sender, one.receiver)].append(one)
    for key, messages in grouped.items():
        messages.sort(key=lambda one: one.sent)
        first = messages[0]
        last = states.get(key)
        pair = sides(system.design, first.protocol, first.sender, first.receiver)
        over = last is not None and ended(
            system.design, first.protocol, (last.initiator, last.participant)
        )
        yield Talk(first.conversation, first.protocol, first.channel, *pair, over, tuple(messages))


def _pair(
    conversation: str, protocol: str, one: str, other: str
) -> tuple[str, str, frozenset[str]]:
    return conversation, protocol, frozenset((one, other))


# --- steps ----------------------------------------------------------------------------------------


def _steps(log: Path, said: list[Message], system: System) -> Iterator[Step]:
    """Yield the steps of an agent that said something."""
    agent, mine = log.stem, defaultdict[float, list[Identity]](list)
    for one in said:
        if one.sender == agent:
            mine[one.sent].append(one.identity)
    waiting: dict[Identity, Communicate] = {}
    for step in _read(log):
        came = None if step.took else _came(step, waiting)
        took, certain = _took(step, agent, came, waiting, system)
        if said_now := mine.pop(step.at, []):
            event = "" if step.deed is None else step.deed.event
            yield Step(agent, step.at, event, took, tuple(said_now), step.parents, certain)


def _read(log: Path) -> Iterator[steplog.Step]:
    try:
        yield from steplog.read(log)
    except (*UNREADABLE, StepLogError, OSError):
        return


def _came(step: steplog.Step, waiting: dict[Identity, Communicate]) -> Communicate | None:
    """Return the communicate that came into a step; it waits to be taken from then on."""
    if step.kind != Arrived.__name__:
        return None
    try:
        came = msgspec.msgpack.decode(step.input, type=Arrived).communicate
    except UNREADABLE:
        return None
    return waiting.setdefault(_identity(came), came)  # a copy is no other one


def _took(
    step: steplog.Step,
    agent: str,
    came: Communicate | None,
    waiting: dict[Identity, Communicate],
    system: System,
) -> tuple[Identity | None, bool]:
    """Return the communicate that a step took, and whether the log names it; older ones have its
    use and act alone.
    """
    if step.took:
        sender, _, name = step.took.partition(" ")
        taken = sender, agent, name
        waiting.pop(taken, None)
        return taken, True
    if step.deed is None or step.deed.took is None:
        # the runtime itself answers what no behaviour sees
        answered = came if step.deed is None else None
        return (None if answered is None else _identity(answered)), True
    found = next((one for one in waiting.values() if _fits(one, step.deed, system)), None)
    if found is None:
        return None, False
    del waiting[_identity(found)]
    return _identity(found), found is came


def _fits(one: Communicate, deed: Deed, system: System) -> bool:
    assert deed.took is not None
    use, act, _ = deed.took
    try:
        return one.performative == act and str(system.design.rule(one).use) == use
    except LookupError:
        return False


def _identity(one: Communicate) -> Identity:
    return one.sender, one.receiver, one.id


# --- who was away ---------------------------------------------------------------------------------


def _away(records: Iterable[Record], faults: tuple[Fault, ...]) -> Iterator[Away]:
    """Yield the times in which an agent was gone, by the tokens of its lives."""
    gone: dict[str, float] = {}
    lives: dict[str, int] = {}
    for one in records:
        if not isinstance(one, Token):
            continue
        if not one.alive:
            gone.setdefault(one.agent, one.received)
        elif lives.get(one.agent, one.incarnation) != one.incarnation:
            yield Away(
                one.agent, gone.pop(one.agent, one.received), one.received, _fault(one, faults)
            )
        else:
            gone.pop(one.agent, None)
        if one.alive:
            lives[one.agent] = one.incarnation
    yield from (Away(agent, at) for agent, at in gone.items())


def _fault(back: Token, faults: tuple[Fault, ...]) -> str:
    """Return the kind of the newest fault that was done to an agent before it came back, within
    LONGEST_S.
    """
    hit = [one for one in faults if one.target == back.agent and not one.what]
    done = [one for one in hit if 0.0 <= back.received - one.began <= LONGEST_S]
    return done[-1].kind if done else ""
